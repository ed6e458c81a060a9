"""Rule time_against_published: the tuned engines and the paper's protocol in turn, on one core."""

from pathlib import Path

from filtercake import engine_choice
from filtercake.benchmark import as_published, compare, time_in_turn
from filtercake.config_loading import load_study
from filtercake.job import Progress, job
from filtercake.packing.result import publish
from filtercake.study import base_point

with job(snakemake.log[0]) as log:
    study = load_study(Path(snakemake.params.study))
    spec = base_point(study, snakemake.params.csd, engine_choice.choose).spec
    baseline = as_published(spec)
    timings = time_in_turn(
        [baseline, spec],
        study.csds[snakemake.params.csd].truncated,
        snakemake.params.replicates,
        lambda line: (log.info(line), Progress().note(line)),
    )
    for output, table in (
        (snakemake.output.timings, timings),
        (snakemake.output.comparison, compare(timings, baseline.engine)),
    ):
        with publish(Path(output)) as temporary:
            table.to_csv(temporary, index=False)
