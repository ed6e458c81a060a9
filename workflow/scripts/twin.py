"""Rule repeat_calibrations: how often calibrations find a cohesion that is known."""

from pathlib import Path

import pandas as pd

from filtercake.packing.result import publish
from filtercake.results.tables import read_table
from filtercake.run.job import job
from filtercake.validation.twin import Experiment, repeat_calibrations, summarise

with job(snakemake.log[0], snakemake.output) as log:
    pool, truth = (
        pd.concat([read_table(file) for file in files], ignore_index=True)
        for files in (snakemake.input.pool, snakemake.input.truth)
    )
    count, asked = snakemake.params.repeats, Experiment(snakemake.params.tests, snakemake.params.noise)
    repeats = pd.concat(
        [
            repeat_calibrations(pool[pool["friction"] == friction], truth[truth["friction"] == friction], count, asked)
            for friction in sorted(truth["friction"].unique())
        ],
        ignore_index=True,
    )
    table = summarise(repeats)
    log.info("\n%s", table.to_string())
    for output, made in ((snakemake.output.repeats, repeats), (snakemake.output.table, table)):
        with publish(Path(output)) as temporary:
            made.to_csv(temporary, index=False)
