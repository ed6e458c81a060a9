"""Rule figure: draw one figure of a study as PNG and PDF."""

from pathlib import Path

from filtercake.figures.catalogue import draw
from filtercake.figures.selection import StudyData
from filtercake.figures.style import save
from filtercake.run.job import job

with job(snakemake.log[0], snakemake.output):
    data = StudyData.read(
        snakemake.wildcards.study,
        snakemake.params.study,
        Path(snakemake.input.summary).parent,
        snakemake.input.csds,
        snakemake.input.crystallizer,
    )
    save(draw(snakemake.wildcards.figure, data), Path(snakemake.output.png), Path(snakemake.output.pdf))
