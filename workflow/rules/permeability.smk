# Stokes flow in the first accepted packings of a point, where the study asks for it. Each solved packing is kept, so
# that a job that was stopped goes on where it was.


rule permeability:
    input:
        "{results}/{study}/packings/{point}/replicates.json",
    output:
        "{results}/{study}/permeability/{point}/permeability.json",
    log:
        "{results}/{study}/logs/permeability/{point}.log",
    benchmark:
        "{results}/{study}/benchmarks/permeability/{point}.tsv"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=flow_memory_mb,
        runtime=lambda wildcards: granted_minutes(),
    params:
        library=library("permeability.replicates"),
        packings=lambda wildcards: study_of(wildcards).model.permeability.packings,
        accuracy=lambda wildcards: study_of(wildcards).model.permeability.accuracy,
    message:
        "flow through {wildcards.point}"
    script:
        "../scripts/permeability.py"
