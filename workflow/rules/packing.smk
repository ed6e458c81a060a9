# All replicates of a point in one job: start-up costs as much as a small packing. On a cluster, short points share a
# submission (profiles/slurm).


rule packing:
    input:
        csd=lambda wildcards: f"{RESULTS}/{wildcards.study}/csd/{packed_of(wildcards).csd}.csv",
    output:
        "{results}/{study}/packings/{point}/replicates.json",
    log:
        "{results}/{study}/logs/packing/{point}.log",
    benchmark:
        "{results}/{study}/benchmarks/packing/{point}.tsv"
    group:
        packing_group
    conda:
        "../envs/filtercake.yaml"
    threads: lambda wildcards: parallelism(packed_of(wildcards).scene)
    resources:
        mem_mb=lambda wildcards: estimate.memory_mb(packed_of(wildcards).scene),
        runtime=packing_minutes,
        cpus_per_task=lambda wildcards: parallelism(packed_of(wildcards).scene),
    params:
        code=lambda wildcards: packing_code(packed_of(wildcards).scene.engine),
        scene=lambda wildcards: packed_of(wildcards).scene.decisive(),
        # what follows from resources is no reason to make a packing again
        incidental=lambda wildcards, resources: packed_of(wildcards).scene.incidental(),
        replicates=lambda wildcards: packed_of(wildcards).replicates,
        most=lambda wildcards: packed_of(wildcards).most_replicates,
        interval=lambda wildcards: packed_of(wildcards).porosity_ci95_target,
    message:
        "packing {wildcards.point}"
    script:
        "../scripts/packing.py"
