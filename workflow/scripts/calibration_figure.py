"""Rule calibration_figure: draw one figure of a calibration as PNG and PDF."""

from pathlib import Path

from filtercake.calibration.measurements import load_measurements
from filtercake.figures.calibrated import CalibrationData
from filtercake.figures.catalogue import draw
from filtercake.figures.style import save
from filtercake.packing.result import read_record
from filtercake.results.tables import read_table
from filtercake.run.job import job

with job(snakemake.log[0], snakemake.output):
    tables = {Path(table).stem: read_table(table) for table in snakemake.input.tables}
    predictions = [read_table(table) for table in snakemake.input.predictions]
    data = CalibrationData(
        name=snakemake.wildcards.calibration,
        title=snakemake.params.title,
        summary=read_record(Path(snakemake.input.summary)),
        predictions=predictions[0] if predictions else None,
        labels=dict(snakemake.params.labels),
        measurements=load_measurements(Path(snakemake.input.files[0])),
        **tables,
    )
    save(draw(snakemake.wildcards.figure, data), Path(snakemake.output.png), Path(snakemake.output.pdf))
