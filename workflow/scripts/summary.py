"""Rule summary: means and 95 % intervals of every point."""

from pathlib import Path

from filtercake.packing.result import publish
from filtercake.results.replicates import summarise
from filtercake.results.tables import read_table
from filtercake.run.job import job

with job(snakemake.log[0], snakemake.output), publish(Path(snakemake.output[0])) as temporary:
    summarise(read_table(snakemake.input.replicates)).to_csv(temporary, index=False)
