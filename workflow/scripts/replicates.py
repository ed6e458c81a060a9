"""Rule replicates: measure porosity and resistance of every packing of a study."""

from pathlib import Path

from filtercake.crystals.csd import read_tables
from filtercake.packing.result import publish
from filtercake.results.replicates import replicates_table
from filtercake.run.job import job
from filtercake.study.points import Point


def main(points, folder, csd_tables, asked, flows, output):
    """Measure and write the table."""
    csds = read_tables(csd_tables)
    solved = folder / "permeability" if flows else None
    table = replicates_table(points, folder / "packings", csds, asked.sphericity, asked.law, solved)
    with publish(output) as temporary:
        table.to_csv(temporary, index=False)


with job(snakemake.log[0], snakemake.output):
    main(
        [Point.from_dict(values) for values in snakemake.params.points],
        Path(snakemake.output[0]).parent,
        snakemake.input.csds,
        snakemake.params,
        snakemake.input.flows,
        Path(snakemake.output[0]),
    )
