# Benchmarks: targets of their own, never part of a study.

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
        library=library("agreement"),
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
        engines=AGREEMENT_ENGINES,
    message:
        "comparing the engines' ensembles"
    script:
        "../scripts/agreement.py"


rule speed:
    input:
        expand("{results}/benchmark/speed.csv", results=RESULTS),
    localrule: True


rule time_against_published:
    input:
        library=library("benchmark"),
        templates=sorted(
            str(path) for path in (ROOT / "liggghts_templates").glob("*.j2")
        ),
    output:
        timings="{results}/benchmark/timings.csv",
        comparison="{results}/benchmark/speed.csv",
    log:
        "{results}/benchmark/logs/speed.log",
    benchmark:
        "{results}/benchmark/benchmarks/speed.tsv"
    conda:
        "../envs/filtercake.yaml"
    # alone on the machine: nothing else may run while it times
    threads: workflow.cores
    resources:
        mem_mb=2000,
        runtime=120,
    params:
        replicates=8,
        study=str(ROOT / "config" / "studies" / "pmma.yaml"),
        csd="pmma_50_50",
    message:
        "timing the tuned deck against the paper's protocol"
    script:
        "../scripts/speed.py"
