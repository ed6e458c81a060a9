"""Rule calibrate_pressed: how often calibrations find the friction of pressed cakes."""

from pathlib import Path

from filtercake.packing.result import publish
from filtercake.results.tables import read_table
from filtercake.run.job import job
from filtercake.validation.twin import Experiment, repeat_pressed

with job(snakemake.log[0], snakemake.output) as log:
    pool, truth = (read_table(Path(file)) for file in (snakemake.input.pool, snakemake.input.truth))
    asked = snakemake.params
    repeats = repeat_pressed(pool, truth, asked.repeats, Experiment(asked.tests, asked.noise, shares=asked.shares))
    log.info("%d of %d intervals hold the truth", repeats["covered"].sum(), len(repeats))
    with publish(Path(snakemake.output[0])) as temporary:
        repeats.to_csv(temporary, index=False)
