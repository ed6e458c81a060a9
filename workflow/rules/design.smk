# Designs: packings in rounds, each chosen from what is known after those before it. They are packings of the study, and
# stand among its own; what follows from them is in <study>/design. The helpers are in common_design.smk.


rule design:
    input:
        design_outputs,
    localrule: True


checkpoint design_round:
    input:
        manifests_of_design(design_rounds_before),
        rounds=design_rounds_before,
        csds=design_csds,
    output:
        "{results}/{study}/design/rounds/{number}.json",
    log:
        "{results}/{study}/logs/design/rounds/{number}.log",
    benchmark:
        "{results}/{study}/benchmarks/design/rounds/{number}.tsv"
    localrule: True
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        library=library("design.task"),
        design=design_params,
        packings=lambda wildcards: f"{RESULTS}/{wildcards.study}/packings",
    message:
        "round {wildcards.number} of the design of {wildcards.study}"
    script:
        "../scripts/design_round.py"


rule design_outcome:
    input:
        manifests_of_design(all_design_rounds),
        rounds=all_design_rounds,
        csds=design_csds,
    output:
        summary="{results}/{study}/design/design.json",
        tables=expand(
            "{{results}}/{{study}}/design/tables/{table}.csv", table=DESIGN_TABLES
        ),
    log:
        "{results}/{study}/logs/design/design.log",
    benchmark:
        "{results}/{study}/benchmarks/design/design.tsv"
    localrule: True
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        library=library("design.tables"),
        design=design_params,
        packings=lambda wildcards: f"{RESULTS}/{wildcards.study}/packings",
    message:
        "design of {wildcards.study}"
    script:
        "../scripts/design_outcome.py"


rule design_figure:
    input:
        summary="{results}/{study}/design/design.json",
        tables=expand(
            "{{results}}/{{study}}/design/tables/{table}.csv", table=DESIGN_TABLES
        ),
    output:
        png=report(
            "{results}/{study}/design/figures/{figure}.png",
            category=design_title,
            subcategory="Figures",
            caption="../report/figure.rst",
            labels=figure_labels,
        ),
        pdf="{results}/{study}/design/figures/{figure}.pdf",
    log:
        "{results}/{study}/logs/design/figures/{figure}.log",
    benchmark:
        "{results}/{study}/benchmarks/design/figures/{figure}.tsv"
    wildcard_constraints:
        figure="|".join(catalogue.DESIGN_FIGURES),
    group:
        "figures"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=2000,
        runtime=figure_minutes,
    params:
        library=lambda wildcards: library(catalogue.module_of(wildcards.figure)),
        title=lambda wildcards: study_of(wildcards).model.title,
    message:
        "{wildcards.figure} of {wildcards.study}"
    script:
        "../scripts/design_figure.py"
