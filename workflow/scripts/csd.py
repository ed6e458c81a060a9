"""Rule csd: tabulate one size distribution, whole and truncated."""

from pathlib import Path

from filtercake.crystals.crystallizer import crystal_size_distribution
from filtercake.crystals.csd import mixture, read_csd, to_table, truncate
from filtercake.packing.result import publish
from filtercake.run.job import job
from filtercake.units import MICROMETRE


def distribution(file, source):
    """Read the file, mix the classes, or take the crystallizer's product."""
    if file:
        return read_csd(Path(file[0]))
    if "size_scale_um" in source:
        return crystal_size_distribution(source["size_scale_um"] * MICROMETRE, source["bin_width_um"] * MICROMETRE)
    classes = source["classes"]
    return mixture([size * MICROMETRE for size, _ in classes], [fraction for _, fraction in classes])


with job(snakemake.log[0], snakemake.output), publish(Path(snakemake.output[0])) as temporary:
    full = distribution(list(snakemake.input.file), snakemake.params.source)
    table = to_table(full, truncate(full, **snakemake.params.source["truncation"]).csd)
    table.to_csv(temporary, index=False)
