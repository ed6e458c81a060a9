"""Rule study_pages: what the report says and tabulates of a study."""

from pathlib import Path

from filtercake.figures.selection import StudyData
from filtercake.packing.result import read_record
from filtercake.report import captions, pages
from filtercake.run.job import job

with job(snakemake.log[0]):
    folder = Path(snakemake.input.summary).parent
    data = StudyData.read(
        snakemake.wildcards.study,
        snakemake.params.study,
        folder,
        snakemake.input.csds,
        snakemake.input.crystallizer,
    )
    figures = [Path(figure) for figure in snakemake.input.figures]
    templates = Path(snakemake.input.front).parent
    captions.write(templates, figures, captions.study_values(data), Path(snakemake.output.captions))
    provenance = read_record(Path(snakemake.input.provenance))
    found = pages.contents(folder, data.replicates, data.study, provenance)
    pages.write(Path(snakemake.input.page), found, Path(snakemake.output.pages))
