# All replicates of a point in one job: start-up costs as much as a small packing. On a cluster, short points share a
# submission (profiles/slurm).


rule packing:
    input:
        csd=lambda wildcards: f"{RESULTS}/{wildcards.study}/csd/{point_of(wildcards).csd}.csv",
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
    threads: lambda wildcards: parallelism(point_of(wildcards).spec)
    resources:
        mem_mb=lambda wildcards: estimate.memory_mb(point_of(wildcards).spec),
        runtime=packing_minutes,
        cpus_per_task=lambda wildcards: parallelism(point_of(wildcards).spec),
    params:
        code=lambda wildcards: packing_code(point_of(wildcards).spec.engine),
        spec=lambda wildcards: point_of(wildcards).spec.as_dict(),
        replicates=lambda wildcards: point_of(wildcards).replicates,
        most=lambda wildcards: point_of(wildcards).most_replicates,
        interval=lambda wildcards: point_of(wildcards).porosity_ci95_target,
    message:
        "packing {wildcards.point}"
    script:
        "../scripts/packing.py"
