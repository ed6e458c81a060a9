"""Rule design_pages: what the report says and tabulates of a design."""

from pathlib import Path

from filtercake.figures.designed import DesignData
from filtercake.report import captions, pages
from filtercake.run.job import job
from filtercake.run.provenance import describe
from filtercake.study.config.study import Study

with job(snakemake.log[0]):
    summary = Path(snakemake.input.summary)
    study = Study.model_validate(snakemake.params.study)
    data = DesignData.read(snakemake.wildcards.study, study.title, summary, snakemake.input.tables)
    figures = [Path(figure) for figure in snakemake.input.figures]
    templates = Path(snakemake.input.front).parent
    captions.write(templates, figures, captions.design_values(data), Path(snakemake.output.captions))
    found = pages.contents(summary.parent, data.packings, study, describe(Path(snakemake.scriptdir).parents[1]))
    pages.write(Path(snakemake.input.page), found, Path(snakemake.output.pages))
