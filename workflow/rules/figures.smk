# One rule for all figures; the catalogue says which a study has, each depends only on its own module.


rule figure:
    input:
        points="{results}/{study}/points.csv",
        summary="{results}/{study}/summary.csv",
        replicates="{results}/{study}/replicates.csv",
        csds=csd_tables,
        crystallizer=crystallizer_tables,
    output:
        png=report(
            "{results}/{study}/figures/{figure}.png",
            category="Study {study}",
            subcategory="Figures",
            caption="../report/figure.rst",
            labels=figure_labels,
        ),
        pdf="{results}/{study}/figures/{figure}.pdf",
    log:
        "{results}/{study}/logs/figures/{figure}.log",
    benchmark:
        "{results}/{study}/benchmarks/figures/{figure}.tsv"
    wildcard_constraints:
        figure="|".join(catalogue.FIGURES),
    group:
        "figures"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=2000,
        runtime=figure_minutes,
    params:
        library=lambda wildcards: library(catalogue.module_of(wildcards.figure)),
        study=lambda wildcards: study_of(wildcards).model.model_dump(mode="json"),
    message:
        "{wildcards.figure} of {wildcards.study}"
    script:
        "../scripts/figure.py"
