"""Rule figure: draw one figure of a study as PNG and PDF."""

from pathlib import Path

import pandas as pd

from filtercake.config import Study
from filtercake.csd import from_table
from filtercake.figures.catalogue import StudyData, draw, save
from filtercake.job import job

with job(snakemake.log[0], snakemake.output):
    data = StudyData(
        name=snakemake.wildcards.study,
        study=Study.model_validate(snakemake.params.study),
        points=pd.read_csv(snakemake.input.points),
        summary=pd.read_csv(snakemake.input.summary),
        replicates=pd.read_csv(snakemake.input.replicates),
        csds={Path(table).stem: from_table(pd.read_csv(table)) for table in snakemake.input.csds},
        packings=Path(snakemake.params.packings),
        crystallizer=next(map(pd.read_csv, snakemake.input.crystallizer), pd.DataFrame()),
    )
    save(draw(snakemake.wildcards.figure, data), Path(snakemake.output.png), Path(snakemake.output.pdf))
