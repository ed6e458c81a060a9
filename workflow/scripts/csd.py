"""Rule csd: tabulate one size distribution, whole and truncated."""

from pathlib import Path

from filtercake.csd import mixture, read_csd, to_table, truncate
from filtercake.job import job
from filtercake.packing.result import publish
from filtercake.units import MICROMETRE


def main(file, classes, truncation, output):
    """Read or mix the classes and write the table."""
    if file:
        full = read_csd(Path(file[0]))
    else:
        full = mixture([size * MICROMETRE for size, _ in classes], [fraction for _, fraction in classes])
    table = to_table(full, truncate(full, truncation).csd)
    with publish(Path(output)) as temporary:
        table.to_csv(temporary, index=False)


with job(snakemake.log[0]):
    source = snakemake.params.source
    main(list(snakemake.input.file), source["classes"], source["truncation"], snakemake.output[0])
