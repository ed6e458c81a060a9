# A study's size distributions: whole, and as they are packed; and the crystallizer behind them.


rule csd:
    input:
        file=csd_file,
    output:
        "{results}/{study}/csd/{csd}.csv",
    log:
        "{results}/{study}/logs/csd/{csd}.log",
    benchmark:
        "{results}/{study}/benchmarks/csd/{csd}.tsv"
    localrule: True
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=500,
        runtime=5,
    params:
        library=library("crystals.crystallizer") + library("crystals.size_laws"),
        source=csd_params,
    message:
        "size distribution {wildcards.csd} of {wildcards.study}"
    script:
        "../scripts/csd.py"


rule crystallizer:
    input:
        csds=csd_tables,
    output:
        "{results}/{study}/tables/crystallizer.csv",
    log:
        "{results}/{study}/logs/crystallizer.log",
    benchmark:
        "{results}/{study}/benchmarks/crystallizer.tsv"
    localrule: True
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=500,
        runtime=5,
    params:
        library=library("results.paper_tables"),
        study=lambda wildcards: study_of(wildcards).model.model_dump(mode="json"),
        states=crystallizer_states,
    message:
        "crystallizer of {wildcards.study}"
    script:
        "../scripts/crystallizer.py"
