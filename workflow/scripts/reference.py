"""Rule gather_references: the packings of all reference ensembles in one table."""

from pathlib import Path

import pandas as pd

from filtercake.packing.result import publish
from filtercake.results.tables import read_table
from filtercake.run.job import job
from filtercake.validation.error_against_time import REFERENCE_COLUMNS

with job(snakemake.log[0], snakemake.output), publish(Path(snakemake.output[0])) as temporary:
    tables = [read_table(file)[list(REFERENCE_COLUMNS)] for file in snakemake.input.replicates]
    pd.concat(tables, ignore_index=True).to_csv(temporary, index=False)
