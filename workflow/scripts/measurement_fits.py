"""Rule measurement_fits: resistances from filtration tests, and how they change with pressure."""

from pathlib import Path

from filtercake.calibration.measurements import compressibility_table, fits_table, load_measurements
from filtercake.packing.result import publish
from filtercake.run.job import job

with job(snakemake.log[0], snakemake.output) as log:
    measurements = load_measurements(Path(snakemake.input.files[0]))
    for warning in measurements.warnings:
        log.info("%s", warning)
    tables = {
        snakemake.output.fits: fits_table(measurements),
        snakemake.output.compressibility: compressibility_table(measurements),
    }
    for output, table in tables.items():
        with publish(Path(output)) as temporary:
            table.to_csv(temporary, index=False)
