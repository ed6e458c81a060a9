# A study's size distributions: whole, and as they are packed.


rule csd:
    input:
        file=csd_file,
        library=library("crystallizer"),
    output:
        "{results}/{study}/csd/{csd}.csv",
    log:
        "{results}/{study}/logs/csd/{csd}.log",
    benchmark:
        "{results}/{study}/benchmarks/csd/{csd}.tsv"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=500,
        runtime=5,
    params:
        source=csd_params,
    message:
        "size distribution {wildcards.csd} of {wildcards.study}"
    script:
        "../scripts/csd.py"
