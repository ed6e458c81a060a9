"""Rule filter_design: the drum filter that every point's slurry needs."""

from pathlib import Path

from filtercake.crystals.csd import read_tables
from filtercake.packing.result import publish
from filtercake.results.filter_design import filter_design
from filtercake.results.tables import read_table
from filtercake.run.job import job
from filtercake.study.config.study import Study

with job(snakemake.log[0], snakemake.output) as log, publish(Path(snakemake.output[0])) as temporary:
    study = Study.model_validate(snakemake.params.study)
    csds = read_tables(snakemake.input.csds)
    table = filter_design(study, csds, read_table(snakemake.input.summary))
    for point, warnings in zip(table["point"], table["filter_warnings"], strict=True):
        if warnings:
            log.warning("%s: %s", point, warnings)
    table.to_csv(temporary, index=False)
