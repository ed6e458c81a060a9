"""Rule csd: tabulate one size distribution, whole and truncated."""

from pathlib import Path

from filtercake.crystals.crystallizer import crystal_size_distribution
from filtercake.crystals.csd import read_csd, to_table, truncate
from filtercake.crystals.size_laws import made
from filtercake.packing.result import publish
from filtercake.run.job import job
from filtercake.units import MICROMETRE


def distribution(file, source):
    """Read the file, take the crystallizer's product, or make it from the study's numbers."""
    if file:
        return read_csd(Path(file[0]))
    if "size_scale_um" in source:
        return crystal_size_distribution(source["size_scale_um"] * MICROMETRE, source["bin_width_um"] * MICROMETRE)
    return made(source)


with job(snakemake.log[0], snakemake.output) as log, publish(Path(snakemake.output[0])) as temporary:
    full = distribution(list(snakemake.input.file), snakemake.params.source)
    if full.understood:
        log.info("%s: %s", ", ".join(snakemake.input.file) or snakemake.wildcards.csd, full.understood)
    table = to_table(full, truncate(full, **snakemake.params.source["truncation"]).csd)
    table.to_csv(temporary, index=False)
