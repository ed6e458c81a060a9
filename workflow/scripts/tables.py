"""Rule tables: the paper's tables with our values beside the published ones."""

from pathlib import Path

from filtercake.crystals.csd import read_tables
from filtercake.packing.result import publish
from filtercake.results.paper_tables import comparison, table1, table2, table4
from filtercake.results.tables import read_table
from filtercake.run.job import job
from filtercake.study.config.study import Study

with job(snakemake.log[0], snakemake.output):
    study = Study.model_validate(snakemake.params.study)
    csds = read_tables(snakemake.input.csds)
    for output, table in (
        (snakemake.output.table1, table1(study, csds)),
        (snakemake.output.table2, table2(study, csds)),
        (snakemake.output.table4, table4(study, csds, read_table(snakemake.input.summary))),
        (snakemake.output.comparison, comparison(study, read_table(snakemake.input.replicates))),
    ):
        with publish(Path(output)) as temporary:
            table.to_csv(temporary, index=False)
