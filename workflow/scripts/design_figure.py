"""Rule design_figure: draw one figure of a design as PNG and PDF."""

from pathlib import Path

from filtercake.figures.catalogue import draw
from filtercake.figures.designed import DesignData
from filtercake.figures.style import save
from filtercake.run.job import job

with job(snakemake.log[0], snakemake.output):
    data = DesignData.read(
        snakemake.wildcards.study, snakemake.params.title, Path(snakemake.input.summary), snakemake.input.tables
    )
    save(draw(snakemake.wildcards.figure, data), Path(snakemake.output.png), Path(snakemake.output.pdf))
