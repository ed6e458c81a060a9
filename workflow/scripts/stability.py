"""Rule stress: settle every case of one map and judge what became of it."""

from pathlib import Path

from filtercake.packing.engines import ENGINES
from filtercake.packing.result import publish
from filtercake.run.job import Progress, job
from filtercake.validation.stability import cases, run

with job(snakemake.log[0], snakemake.output) as log:
    runnable = [name for name, engine in ENGINES.items() if engine().why_missing() is None]
    quick = snakemake.params.quick
    table = run(
        cases(runnable, snakemake.wildcards.family, quick),
        lambda line: (log.info(line), Progress().note(line)),
        2 if quick else 0,
    )
    with publish(Path(snakemake.output[0])) as temporary:
        table.to_csv(temporary, index=False)
