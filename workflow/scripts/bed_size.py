"""Rule compare_sizes: mean porosities of several beds and of one larger bed."""

from pathlib import Path

from filtercake.packing.result import publish
from filtercake.results.tables import read_table
from filtercake.run.job import job
from filtercake.validation.agreement import compare_sizes

with job(snakemake.log[0], snakemake.output) as log:
    table = compare_sizes(*(read_table(path) for path in snakemake.input.replicates))
    log.info("\n%s", table.to_string())
    with publish(Path(snakemake.output[0])) as temporary:
        table.to_csv(temporary, index=False)
