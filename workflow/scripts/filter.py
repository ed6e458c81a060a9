"""Rule filter_design: the drum filter that every point's slurry needs."""

from pathlib import Path

import pandas as pd

from filtercake.config import Study
from filtercake.csd import from_table
from filtercake.job import job
from filtercake.packing.result import publish
from filtercake.tables import filter_design

with job(snakemake.log[0], snakemake.output) as log, publish(Path(snakemake.output[0])) as temporary:
    study = Study.model_validate(snakemake.params.study)
    csds = {Path(table).stem: from_table(pd.read_csv(table)) for table in snakemake.input.csds}
    table = filter_design(study, csds, pd.read_csv(snakemake.input.summary))
    for point, warnings in zip(table["point"], table["filter_warnings"], strict=True):
        if warnings:
            log.warning("%s: %s", point, warnings)
    table.to_csv(temporary, index=False)
