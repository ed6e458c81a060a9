# What proves the product: targets of their own, never part of a study. Read only when the command line names one of
# these rules, of their files or of their studies (validation_is_asked in common.smk).
from filtercake.study.points import with_engine
from filtercake.validation.stability import families as stress_families

# the studies of the comparison of engines, made by each
AGREEMENT_ENGINES = ["liggghts", "embedded"]
AGREEMENT = {
    study.name: study
    for base in load_studies(
        sorted((ROOT / "config" / "benchmarks").glob("agreement_*.yaml"))
    )
    for study in (with_engine(base, engine) for engine in AGREEMENT_ENGINES)
}
KNOWN.update(AGREEMENT)
KNOWN_POINTS.update(points_by_name(AGREEMENT))


rule agreement:
    input:
        expand("{results}/benchmark/agreement.csv", results=RESULTS),
    localrule: True


rule compare_engines:
    input:
        replicates=expand(
            "{results}/{study}/replicates.csv", results=RESULTS, study=AGREEMENT
        ),
    output:
        table="{results}/benchmark/agreement.csv",
        replicates="{results}/benchmark/agreement_replicates.csv",
    log:
        "{results}/benchmark/logs/agreement.log",
    benchmark:
        "{results}/benchmark/benchmarks/agreement.tsv"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=500,
        runtime=5,
    params:
        library=library("validation.agreement"),
        engines=AGREEMENT_ENGINES,
    message:
        "comparing the engines' ensembles"
    script:
        "../scripts/agreement.py"


# calibrations whose answer is known
TWIN = {
    study.name: study
    for study in load_studies(
        ROOT / "config" / "benchmarks" / f"{name}.yaml"
        for name in (
            "twin",
            "twin_truth",
            "twin_friction",
            "twin_friction_truth",
            "twin_discrepancy",
            "twin_pressed",
            "twin_pressed_truth",
        )
    )
}
KNOWN.update(TWIN)
KNOWN_POINTS.update(points_by_name(TWIN))


rule twin:
    input:
        expand("{results}/benchmark/twin.csv", results=RESULTS),
        expand("{results}/benchmark/twin_discrepancy.csv", results=RESULTS),
        expand("{results}/benchmark/twin_pressed.csv", results=RESULTS),
    localrule: True


rule repeat_calibrations:
    input:
        pool=expand(
            "{results}/{study}/replicates.csv",
            results=RESULTS,
            study=["twin", "twin_friction"],
        ),
        truth=expand(
            "{results}/{study}/replicates.csv",
            results=RESULTS,
            study=["twin_truth", "twin_friction_truth"],
        ),
    output:
        table="{results}/benchmark/twin.csv",
        repeats="{results}/benchmark/twin_repeats.csv",
    log:
        "{results}/benchmark/logs/twin.log",
    benchmark:
        "{results}/benchmark/benchmarks/twin.tsv"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        library=library("validation.twin"),
        repeats=20,
        tests=4,
        noise=0.05,
    message:
        "twenty calibrations whose answer is known"
    script:
        "../scripts/twin.py"


rule calibrate_pressed:
    input:
        pool="{results}/twin_pressed/replicates.csv",
        truth="{results}/twin_pressed_truth/replicates.csv",
    output:
        "{results}/benchmark/twin_pressed.csv",
    log:
        "{results}/benchmark/logs/twin_pressed.log",
    benchmark:
        "{results}/benchmark/benchmarks/twin_pressed.tsv"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        library=library("validation.twin"),
        repeats=20,
        tests=4,
        noise=0.05,
        # two packings of a point for every one of ten, and again for ten more with other measurements
        shares=10,
    message:
        "calibrations of pressed cakes whose friction is known"
    script:
        "../scripts/twin_pressed.py"


rule calibrate_apart:
    input:
        packings="{results}/twin_discrepancy/replicates.csv",
    output:
        "{results}/benchmark/twin_discrepancy.csv",
    log:
        "{results}/benchmark/logs/twin_discrepancy.log",
    benchmark:
        "{results}/benchmark/benchmarks/twin_discrepancy.tsv"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        library=library("validation.twin"),
        repeats=20,
        tests=4,
        noise=0.05,
        truth=35.0,
        discrepancy=0.2,
        # four packings of a point, two for every other calibration
        shares=2,
    message:
        "calibrations of distributions that no cohesion describes together"
    script:
        "../scripts/twin_discrepancy.py"


# several beds held against one of the paper's own size; these two are users' studies, so that they may be other files
# (asked for by path), or broken, which must not stop anything else
try:
    known_sizes = {
        study.name: study
        for study in load_studies(
            ROOT / "config" / "studies" / f"{name}.yaml"
            for name in BED_SIZES
            if name not in KNOWN
        )
    }
    bed_size_problem = ""
except FiltercakeError as error:
    known_sizes, bed_size_problem = {}, str(error)
KNOWN.update(known_sizes)
KNOWN_POINTS.update(points_by_name(known_sizes))


rule bed_size:
    input:
        expand("{results}/benchmark/bed_size.csv", results=RESULTS),
    localrule: True


rule compare_sizes:
    input:
        replicates=bed_size_tables,
    output:
        "{results}/benchmark/bed_size.csv",
    log:
        "{results}/benchmark/logs/bed_size.log",
    benchmark:
        "{results}/benchmark/benchmarks/bed_size.tsv"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=500,
        runtime=5,
    params:
        library=library("validation.agreement"),
    message:
        "comparing the sizes of beds"
    script:
        "../scripts/bed_size.py"


# what is timed, each case's engines in turn; the first is the one to beat, with its authors' own settings
SPEED = {
    "pmma": {
        "study": str(ROOT / "config" / "studies" / "pmma.yaml"),
        "csd": "pmma_50_50",
        "engines": ["liggghts_as_published", "liggghts", "embedded"],
        "replicates": 3,
        "processes": 1,
        "time_step_us": 0.1,
        "steps": 150_000,
    },
    "alum": {
        "study": str(ROOT / "config" / "benchmarks" / "agreement_alum.yaml"),
        "csd": "alum_15min",
        "engines": ["liggghts_as_published", "embedded"],
        "replicates": 1,
        "processes": 1,
        "time_step_us": 0.5,
        "skin_um": 10,
        "steps": 120_000,
    },
    # against another engine of today, from the same clouds; LAMMPS knows no such cohesion
    "pmma_without_cohesion": {
        "study": str(ROOT / "config" / "studies" / "pmma.yaml"),
        "csd": "pmma_50_50",
        "cohesion_kJ_m3": 0,
        "engines": ["lammps", "liggghts", "embedded"],
        "replicates": 3,
        "processes": 1,
    },
    "alum_without_cohesion": {
        "study": str(ROOT / "config" / "benchmarks" / "agreement_alum.yaml"),
        "csd": "alum_15min",
        "cohesion_kJ_m3": 0,
        "engines": ["lammps", "liggghts", "embedded"],
        "replicates": 1,
        "processes": 1,
    },
    "alum_full": {
        "study": str(ROOT / "config" / "benchmarks" / "agreement_alum.yaml"),
        "csd": "alum_15min",
        "particles": 100_000,
        "engines": ["embedded"],
        "replicates": 1,
        "processes": 2,
    },
}


rule speed:
    input:
        expand("{results}/benchmark/speed_{case}.csv", results=RESULTS, case=SPEED),
    localrule: True


rule time_in_turn:
    input:
        templates=sorted(
            str(path) for path in (ROOT / "liggghts_templates").glob("*.j2")
        ),
    output:
        timings="{results}/benchmark/timings_{case}.csv",
        comparison="{results}/benchmark/speed_{case}.csv",
    log:
        "{results}/benchmark/logs/speed_{case}.log",
    benchmark:
        "{results}/benchmark/benchmarks/speed_{case}.tsv"
    conda:
        "../envs/filtercake.yaml"
    # alone on the machine: nothing else may run while it times
    threads: workflow.cores
    resources:
        mem_mb=2000,
        runtime=180,
    params:
        library=library("validation.timing"),
        case=lambda wildcards: SPEED[wildcards.case],
    message:
        "timing {wildcards.case}"
    script:
        "../scripts/speed.py"


rule growth:
    input:
        expand("{results}/benchmark/growth.csv", results=RESULTS),
        expand("{results}/benchmark/large_beds.csv", results=RESULTS),
    localrule: True


rule time_growth:
    output:
        table="{results}/benchmark/growth.csv",
        png="{results}/benchmark/growth.png",
        pdf="{results}/benchmark/growth.pdf",
    log:
        "{results}/benchmark/logs/growth.log",
    benchmark:
        "{results}/benchmark/benchmarks/growth.tsv"
    conda:
        "../envs/filtercake.yaml"
    # alone on the machine: nothing else may run while it times
    threads: workflow.cores
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        library=library("validation.growth"),
        figure=library("validation.figures.growth"),
        study=str(ROOT / "config" / "studies" / "pmma.yaml"),
        csd="pmma_50_50",
        cases=[
            {"series": "particles", "particles": particles, "size_ratio": 4.0}
            for particles in (1000, 3000, 10_000, 30_000, 100_000, 200_000)
        ]
        + [
            {"series": "size_ratio", "particles": 40_000, "size_ratio": ratio}
            for ratio in (1.0, 2.0, 4.0, 8.0, 16.0, 30.0)
        ],
    message:
        "timing the embedded engine's growth"
    script:
        "../scripts/growth.py"


rule time_large_beds:
    output:
        beds="{results}/benchmark/large_beds.csv",
        hours="{results}/benchmark/whole_bed.csv",
    log:
        "{results}/benchmark/logs/large_beds.log",
    benchmark:
        "{results}/benchmark/benchmarks/large_beds.tsv"
    conda:
        "../envs/filtercake.yaml"
    # alone on the machine: nothing else may run while it times
    threads: workflow.cores
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        library=library("validation.large_beds"),
        study=str(ROOT / "config" / "studies" / "pmma.yaml"),
        csd="pmma_50_50",
        # laid out once, twice along each axis, five times: 40 000 to a million
        particles=40_000,
        tiles=[1, 2, 5],
        steps=1000,
    message:
        "timing large beds on one and two threads"
    script:
        "../scripts/large_beds.py"


# reference ensembles: hours of LIGGGHTS, whose packings' table is kept in docs/data
REFERENCES = {
    study.name: study
    for study in load_studies(
        sorted((ROOT / "config" / "benchmarks").glob("reference_*.yaml"))
    )
}
KNOWN.update(REFERENCES)
KNOWN_POINTS.update(points_by_name(REFERENCES))


rule reference:
    input:
        expand("{results}/benchmark/reference_replicates.csv", results=RESULTS),
    localrule: True


rule gather_references:
    input:
        replicates=expand(
            "{results}/{study}/replicates.csv", results=RESULTS, study=REFERENCES
        ),
    output:
        "{results}/benchmark/reference_replicates.csv",
    log:
        "{results}/benchmark/logs/reference.log",
    benchmark:
        "{results}/benchmark/benchmarks/reference.tsv"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=500,
        runtime=5,
    message:
        "gathering the reference ensembles"
    script:
        "../scripts/reference.py"


# run time against error: every variant of a case in turn, in one job of one thread; the cases go side by side, so that
# all are timed under the same load. --config quick=true takes a few packings of each
QUICK = bool(config.get("quick", False))
PMMA = str(ROOT / "config" / "studies" / "pmma.yaml")
ALUM = str(ROOT / "config" / "benchmarks" / "agreement_alum.yaml")
ERROR_CASES = {
    "pmma": {
        "study": PMMA,
        "csd": "pmma_50_50",
        "friction": 0.0,
        "particles": 2000,
        "reference": "reference_pmma",
    },
    "alum_wide": {
        "study": ALUM,
        "csd": "alum_15min",
        "friction": 0.0,
        "particles": 20_000,
        "reference": "reference_alum",
    },
    "pmma_friction": {
        "study": PMMA,
        "csd": "pmma_50_50",
        "friction": 0.3,
        "particles": 2000,
        "reference": "reference_pmma",
    },
    "alum": {
        "study": ALUM,
        "csd": "alum_15min",
        "friction": 0.0,
        "particles": 4000,
        "reference": "reference_alum_small",
    },
}
COVERAGE_CASES = ["pmma", "pmma_friction"]
if QUICK:
    del ERROR_CASES["alum_wide"]
BENCHMARK = f"{RESULTS}/benchmark{'_quick' if QUICK else ''}"
REDRAWN = f"{RESULTS}/benchmark_redrawn"
DATA = ROOT / "docs" / "data"
PAGE_FOLDER = f"{re.escape(BENCHMARK)}|{re.escape(REDRAWN)}"


rule redraw:
    input:
        f"{REDRAWN}/benchmark.md",
        f"{REDRAWN}/stability.md",
    localrule: True


rule benchmark:
    input:
        f"{BENCHMARK}/benchmark.md",
    localrule: True


rule time_variants:
    input:
        reference=str(ROOT / "docs" / "data" / "reference_replicates.csv"),
        templates=sorted(
            str(path) for path in (ROOT / "liggghts_templates").glob("*.j2")
        ),
    output:
        timings=f"{BENCHMARK}/variants/{{case}}.csv",
        errors=f"{BENCHMARK}/errors/{{case}}.csv",
    log:
        f"{BENCHMARK}/logs/variants/{{case}}.log",
    benchmark:
        f"{BENCHMARK}/benchmarks/variants/{{case}}.tsv"
    # the longest first
    priority: 50
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=2000,
        runtime=120,
    params:
        library=library("validation.error_against_time"),
        case=lambda wildcards: ERROR_CASES[wildcards.case],
        quick=QUICK,
    message:
        "run time and error: {wildcards.case}"
    script:
        "../scripts/run_time_error.py"


rule choices:
    output:
        f"{BENCHMARK}/choices.csv",
    log:
        f"{BENCHMARK}/logs/choices.log",
    benchmark:
        f"{BENCHMARK}/benchmarks/choices.tsv"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=60,
    params:
        library=library("validation.error_against_time"),
        study=PMMA,
        csd="pmma_50_50",
        wide=ALUM,
        wide_csd="alum_15min",
        replicates=4 if QUICK else 16,
    message:
        "what the model leaves open"
    script:
        "../scripts/choices.py"


rule answers:
    output:
        f"{BENCHMARK}/answers.csv",
    log:
        f"{BENCHMARK}/logs/answers.log",
    benchmark:
        f"{BENCHMARK}/benchmarks/answers.tsv"
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=60,
    params:
        library=library("validation.answers"),
        mixture={20: 0.5, 50: 0.5},
        frictions=[0.0, 0.3],
        packings=2 if QUICK else 6,
    message:
        "ways to a resistance and a filter area"
    script:
        "../scripts/answers.py"


rule coverage:
    input:
        reference=str(ROOT / "docs" / "data" / "reference_replicates.csv"),
    output:
        f"{BENCHMARK}/coverage/{{case}}.csv",
    log:
        f"{BENCHMARK}/logs/coverage/{{case}}.log",
    benchmark:
        f"{BENCHMARK}/benchmarks/coverage/{{case}}.tsv"
    wildcard_constraints:
        case="|".join(COVERAGE_CASES),
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=90,
    params:
        library=library("validation.interval_coverage"),
        case=lambda wildcards: ERROR_CASES[wildcards.case],
        intervals=[0.002, 0.003],
        repeats=4 if QUICK else 40,
    message:
        "an interval asked for, again and again: {wildcards.case}"
    script:
        "../scripts/interval_coverage.py"


rule benchmark_page:
    input:
        coverage=tables_of_page(
            [str(DATA / "coverage.csv")],
            expand(
                "{folder}/coverage/{case}.csv", folder=BENCHMARK, case=COVERAGE_CASES
            ),
        ),
        errors=tables_of_page(
            [str(DATA / "run_time_error.csv")],
            expand("{folder}/errors/{case}.csv", folder=BENCHMARK, case=ERROR_CASES),
        ),
        reference=str(DATA / "reference_replicates.csv"),
        stored=sorted(str(path) for path in DATA.glob("*.csv")),
        choices=tables_of_page(str(DATA / "choices.csv"), f"{BENCHMARK}/choices.csv"),
        answers=tables_of_page(str(DATA / "answers.csv"), f"{BENCHMARK}/answers.csv"),
        template=str(ROOT / "workflow" / "report" / "benchmark.md.j2"),
    output:
        table="{folder}/run_time_error.csv",
        coverage="{folder}/coverage.csv",
        png="{folder}/images/run_time_error.png",
        pdf="{folder}/images/run_time_error.pdf",
        page="{folder}/benchmark.md",
    log:
        "{folder}/logs/page.log",
    benchmark:
        "{folder}/benchmarks/page.tsv"
    wildcard_constraints:
        folder=PAGE_FOLDER,
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=5,
    params:
        library=library("validation.pages"),
        figure=library("validation.figures.run_time_error"),
        cases=ERROR_CASES,
        data=lambda wildcards, input: str(Path(input.reference).parent),
    message:
        "page on run time and error"
    script:
        "../scripts/benchmark_page.py"


# stress tests: one job per map
rule stability:
    input:
        f"{BENCHMARK}/stability.md",
    localrule: True


rule stress:
    input:
        templates=sorted(
            str(path) for path in (ROOT / "liggghts_templates").glob("*.j2")
        ),
    output:
        f"{BENCHMARK}/stress/{{family}}.csv",
    log:
        f"{BENCHMARK}/logs/stress/{{family}}.log",
    benchmark:
        f"{BENCHMARK}/benchmarks/stress/{{family}}.tsv"
    wildcard_constraints:
        family="|".join(stress_families()),
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=2000,
        runtime=120,
    params:
        library=library("validation.stability"),
        quick=QUICK,
    message:
        "stress tests: {wildcards.family}"
    script:
        "../scripts/stability.py"


rule stability_page:
    input:
        tables=tables_of_page(
            [str(DATA / "stability.csv")],
            expand(
                "{folder}/stress/{family}.csv",
                folder=BENCHMARK,
                family=stress_families(),
            ),
        ),
        template=str(ROOT / "workflow" / "report" / "stability.md.j2"),
    output:
        table="{folder}/stability.csv",
        png="{folder}/images/stability_maps.png",
        pdf="{folder}/images/stability_maps.pdf",
        page="{folder}/stability.md",
    log:
        "{folder}/logs/stability_page.log",
    benchmark:
        "{folder}/benchmarks/stability_page.tsv"
    wildcard_constraints:
        folder=PAGE_FOLDER,
    conda:
        "../envs/filtercake.yaml"
    resources:
        mem_mb=1000,
        runtime=5,
    params:
        library=library("validation.pages"),
        figure=library("validation.figures.stability_maps"),
    message:
        "page on stability"
    script:
        "../scripts/stability_page.py"
