# From packings to tables: porosity and resistance of every replicate, then means with intervals.


rule points:
    output:
        "{results}/{study}/points.csv",
    log:
        "{results}/{study}/logs/points.log",
    benchmark:
        "{results}/{study}/benchmarks/points.tsv"
    localrule: True
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=500,
        runtime=5,
    params:
        library=library("study.points"),
        points=point_rows,
    message:
        "points of {wildcards.study}"
    script:
        "../scripts/points.py"


rule replicates:
    input:
        manifests=manifests,
        csds=csd_tables,
        flows=solved_flows,
    output:
        "{results}/{study}/replicates.csv",
    log:
        "{results}/{study}/logs/replicates.log",
    benchmark:
        "{results}/{study}/benchmarks/replicates.tsv"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=2000,
        runtime=lambda wildcards: min(30, granted_minutes()),
    params:
        library=library("results.replicates"),
        points=point_rows,
        sphericity=lambda wildcards: study_of(wildcards).model.material.sphericity,
        law=lambda wildcards: study_of(wildcards).model.resistance_law,
    message:
        "porosity and resistance of every packing of {wildcards.study}"
    script:
        "../scripts/replicates.py"


rule summary:
    input:
        replicates="{results}/{study}/replicates.csv",
    output:
        "{results}/{study}/summary.csv",
    log:
        "{results}/{study}/logs/summary.log",
    benchmark:
        "{results}/{study}/benchmarks/summary.tsv"
    localrule: True
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=500,
        runtime=5,
    params:
        library=library("results.replicates"),
    message:
        "means and intervals of {wildcards.study}"
    script:
        "../scripts/summary.py"


rule tables:
    input:
        summary="{results}/{study}/summary.csv",
        replicates="{results}/{study}/replicates.csv",
        csds=csd_tables,
    output:
        table1="{results}/{study}/tables/table1.csv",
        table2="{results}/{study}/tables/table2.csv",
        table4="{results}/{study}/tables/table4.csv",
        comparison="{results}/{study}/tables/comparison.csv",
    log:
        "{results}/{study}/logs/tables.log",
    benchmark:
        "{results}/{study}/benchmarks/tables.tsv"
    localrule: True
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=500,
        runtime=5,
    params:
        library=library("results.paper_tables"),
        study=lambda wildcards: study_of(wildcards).model.model_dump(mode="json"),
    message:
        "tables of {wildcards.study}"
    script:
        "../scripts/tables.py"


rule filter_design:
    input:
        summary="{results}/{study}/summary.csv",
        csds=csd_tables,
    output:
        "{results}/{study}/tables/filter.csv",
    log:
        "{results}/{study}/logs/filter.log",
    benchmark:
        "{results}/{study}/benchmarks/filter.tsv"
    localrule: True
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=500,
        runtime=5,
    params:
        library=library("results.filter_design"),
        study=lambda wildcards: study_of(wildcards).model.model_dump(mode="json"),
    message:
        "filter of {wildcards.study}"
    script:
        "../scripts/filter.py"


rule cross_check:
    input:
        manifests=cross_check_manifests,
        csds=csd_tables,
    output:
        "{results}/{study}/tables/cross_check.csv",
    log:
        "{results}/{study}/logs/cross_check.log",
    benchmark:
        "{results}/{study}/benchmarks/cross_check.tsv"
    localrule: True
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        library=library("results.cross_check"),
        pairs=lambda wildcards: [
            [point.as_dict() for point in pair]
            for pair in cross_checked(wildcards.study)
        ],
        sphericity=lambda wildcards: study_of(wildcards).model.material.sphericity,
    message:
        "the same clouds by two engines, of {wildcards.study}"
    script:
        "../scripts/cross_check.py"


rule provenance:
    input:
        filter_tables,
        cross_check_tables,
        crystallizer_tables,
        "{results}/{study}/points.csv",
        "{results}/{study}/tables/table1.csv",
        summary="{results}/{study}/summary.csv",
        replicates="{results}/{study}/replicates.csv",
        figures=lambda wildcards: expand(
            "{results}/{study}/figures/{figure}.{suffix}",
            results=RESULTS,
            study=wildcards.study,
            figure=figures_of(wildcards.study),
            suffix=["png", "pdf"],
        ),
    output:
        "{results}/{study}/provenance.json",
    log:
        "{results}/{study}/logs/provenance.log",
    benchmark:
        "{results}/{study}/benchmarks/provenance.tsv"
    localrule: True
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=500,
        runtime=5,
    message:
        "provenance of {wildcards.study}"
    script:
        "../scripts/provenance.py"
