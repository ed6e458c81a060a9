# A study's size distributions: whole, and as they are packed.


def csd_params(wildcards):
    csd = study_of(wildcards).model.csds[wildcards.csd]
    classes = [[item.size_um, item.volume_fraction] for item in csd.mixture or []]
    return {"classes": classes, "truncation": csd.truncate_below_volume_fraction}


def csd_file(wildcards):
    file = study_of(wildcards).csds[wildcards.csd].file
    return [str(file)] if file else []


rule csd:
    input:
        file=csd_file,
        library=library("csd"),
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
