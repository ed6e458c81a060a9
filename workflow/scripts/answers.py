"""Rule answers: run time against error in the specific resistance and in the filter area."""

from pathlib import Path

import pandas as pd

from filtercake.packing.result import publish
from filtercake.run.job import Progress, job
from filtercake.validation.answers import answers

with job(snakemake.log[0], snakemake.output) as log:
    asked = snakemake.params
    table = pd.concat(
        [
            answers(
                asked.mixture, friction, asked.packings, lambda line: (log.info(line), Progress().note(line))
            ).assign(friction=friction)
            for friction in asked.frictions
        ],
        ignore_index=True,
    )
    with publish(Path(snakemake.output[0])) as temporary:
        table.to_csv(temporary, index=False)
