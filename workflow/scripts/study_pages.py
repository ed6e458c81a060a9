"""Rule study_pages: what the report says and tabulates of a study."""

from pathlib import Path

import pandas as pd

from filtercake.config import Study
from filtercake.csd import from_table
from filtercake.figures.catalogue import StudyData
from filtercake.job import job
from filtercake.packing.result import read_record
from filtercake.report import captions, pages

with job(snakemake.log[0]):
    folder = Path(snakemake.input.summary).parent
    data = StudyData(
        name=snakemake.wildcards.study,
        study=Study.model_validate(snakemake.params.study),
        points=pd.read_csv(snakemake.input.points),
        summary=pd.read_csv(snakemake.input.summary),
        replicates=pd.read_csv(snakemake.input.replicates),
        csds={Path(table).stem: from_table(pd.read_csv(table)) for table in snakemake.input.csds},
        packings=folder / "packings",
        crystallizer=next(map(pd.read_csv, snakemake.input.crystallizer), pd.DataFrame()),
    )
    figures = [Path(figure) for figure in snakemake.input.figures]
    templates = Path(snakemake.input.front).parent
    captions.write(templates, figures, captions.study_values(data), Path(snakemake.output.captions))
    provenance = read_record(Path(snakemake.input.provenance))
    found = pages.contents(folder, data.replicates, data.study, provenance)
    pages.write(Path(snakemake.input.page), found, Path(snakemake.output.pages))
