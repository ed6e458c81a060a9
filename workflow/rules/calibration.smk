# Calibrations: packings in rounds, each chosen from the fit of those before it. A calibration is packed as a study
# of its own, named calibration_<file>; its helpers are in common_calibration.smk.


wildcard_constraints:
    calibration="calibration_[A-Za-z0-9_-]+",
    number="[0-9]+",


rule calibrate:
    input:
        calibration_outputs,
    localrule: True


checkpoint choose_round:
    input:
        manifests_of_rounds(rounds_before),
        rounds=rounds_before,
        csds=calibration_csds,
    output:
        "{results}/{calibration}/rounds/{number}.json",
    log:
        "{results}/{calibration}/logs/rounds/{number}.log",
    benchmark:
        "{results}/{calibration}/benchmarks/rounds/{number}.tsv"
    localrule: True
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        library=library("calibration.rounds"),
        calibration=calibration_params,
        packings=lambda wildcards: f"{RESULTS}/{wildcards.calibration}/packings",
    message:
        "round {wildcards.number} of {wildcards.calibration}"
    script:
        "../scripts/choose_round.py"


checkpoint calibrate_cohesion:
    input:
        manifests_of_rounds(all_rounds),
        rounds=all_rounds,
        csds=calibration_csds,
    output:
        summary="{results}/{calibration}/calibration.json",
        tables=expand("{{results}}/{{calibration}}/tables/{table}.csv", table=TABLES),
    log:
        "{results}/{calibration}/logs/calibration.log",
    benchmark:
        "{results}/{calibration}/benchmarks/calibration.tsv"
    localrule: True
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        library=library("calibration.tables"),
        calibration=calibration_params,
        packings=lambda wildcards: f"{RESULTS}/{wildcards.calibration}/packings",
    message:
        "fitting {wildcards.calibration}"
    script:
        "../scripts/calibrate.py"


rule predictions:
    input:
        prediction_manifests,
        manifests_of_rounds(all_rounds),
        summary="{results}/{calibration}/calibration.json",
        rounds=all_rounds,
        csds=calibration_csds,
    output:
        "{results}/{calibration}/tables/predictions.csv",
    log:
        "{results}/{calibration}/logs/predictions.log",
    benchmark:
        "{results}/{calibration}/benchmarks/predictions.tsv"
    localrule: True
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        library=library("calibration.tables"),
        tables=library("results.paper_tables"),
        calibration=calibration_params,
        packings=lambda wildcards: f"{RESULTS}/{wildcards.calibration}/packings",
        study=lambda wildcards: calibration_of(wildcards).study.model.model_dump(
            mode="json"
        ),
    message:
        "predictions of {wildcards.calibration}"
    script:
        "../scripts/predictions.py"


rule measurement_fits:
    input:
        files=measurement_files,
    output:
        fits="{results}/{calibration}/tables/fits.csv",
        compressibility="{results}/{calibration}/tables/compressibility.csv",
    log:
        "{results}/{calibration}/logs/fits.log",
    benchmark:
        "{results}/{calibration}/benchmarks/fits.tsv"
    localrule: True
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=500,
        runtime=5,
    params:
        library=library("calibration.measurements"),
    message:
        "fitting the filtration tests of {wildcards.calibration}"
    script:
        "../scripts/measurement_fits.py"


rule calibration_figure:
    input:
        files=measurement_files,
        summary="{results}/{calibration}/calibration.json",
        tables=expand("{{results}}/{{calibration}}/tables/{table}.csv", table=TABLES),
        predictions=prediction_tables,
    output:
        png=report(
            "{results}/{calibration}/figures/{figure}.png",
            category=calibration_title,
            subcategory="Figures",
            caption="../report/figure.rst",
            labels=figure_labels,
        ),
        pdf="{results}/{calibration}/figures/{figure}.pdf",
    log:
        "{results}/{calibration}/logs/figures/{figure}.log",
    benchmark:
        "{results}/{calibration}/benchmarks/figures/{figure}.tsv"
    wildcard_constraints:
        figure="|".join(catalogue.CALIBRATION_FIGURES),
    group:
        "figures"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=2000,
        runtime=figure_minutes,
    params:
        library=lambda wildcards: library(catalogue.module_of(wildcards.figure)),
        title=lambda wildcards: calibration_of(wildcards).model.title,
        labels=lambda wildcards: {
            name: csd.label
            for name, csd in calibration_of(wildcards).study.csds.items()
        },
    message:
        "{wildcards.figure} of {wildcards.calibration}"
    script:
        "../scripts/calibration_figure.py"
