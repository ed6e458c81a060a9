"""Rule calibrate_apart: calibrations of two and three distributions that no cohesion describes together."""

from pathlib import Path

import pandas as pd

from filtercake.packing.result import publish
from filtercake.run.job import job
from filtercake.validation.twin import Experiment, repeat_calibrations, summarise

with job(snakemake.log[0], snakemake.output) as log:
    packings, asked = pd.read_csv(snakemake.input.packings), snakemake.params
    measured = packings["cohesion_kJ_m3"] == asked.truth
    repeats = pd.concat(
        [
            repeat_calibrations(
                packings[~measured],
                packings[measured],
                asked.repeats,
                Experiment(asked.tests, asked.noise, count, asked.discrepancy, asked.shares),
            )
            for count in (2, 3)
        ],
        ignore_index=True,
    )
    log.info("\n%s", summarise(repeats).to_string())
    with publish(Path(snakemake.output[0])) as temporary:
        repeats.to_csv(temporary, index=False)
