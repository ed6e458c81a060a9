# Benchmarks: targets of their own, never part of a study.


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
