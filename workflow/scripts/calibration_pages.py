"""Rule calibration_pages: what the report says and tabulates of a calibration."""

from pathlib import Path

from filtercake.calibration.measurements import load_measurements
from filtercake.figures.calibrated import CalibrationData
from filtercake.packing.result import read_record
from filtercake.report import captions, pages
from filtercake.results.tables import read_table
from filtercake.run.job import job
from filtercake.run.provenance import describe
from filtercake.study.config.study import Study

with job(snakemake.log[0]):
    folder = Path(snakemake.input.summary).parent
    tables = {Path(table).stem: read_table(table) for table in snakemake.input.tables}
    data = CalibrationData(
        name=snakemake.wildcards.calibration,
        title=snakemake.params.title,
        summary=read_record(Path(snakemake.input.summary)),
        predictions=next((read_table(table) for table in snakemake.input.predictions), None),
        labels=dict(snakemake.params.labels),
        measurements=load_measurements(Path(snakemake.input.files[0])),
        **tables,
    )
    figures = [Path(figure) for figure in snakemake.input.figures]
    templates = Path(snakemake.input.front).parent
    captions.write(templates, figures, captions.calibration_values(data), Path(snakemake.output.captions))
    study = Study.model_validate(snakemake.params.study)
    found = pages.contents(folder, data.packings, study, describe(Path(snakemake.scriptdir).parents[1]))
    pages.write(Path(snakemake.input.page), found, Path(snakemake.output.pages))
