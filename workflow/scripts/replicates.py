"""Rule replicates: measure porosity and resistance of every packing of a study."""

from pathlib import Path

from filtercake.crystals.csd import read_tables
from filtercake.packing.result import publish
from filtercake.results.replicates import replicates_table
from filtercake.run.job import job
from filtercake.study.points import Point


def main(points, packings, csd_tables, sphericity, law, output):
    """Measure and write the table."""
    csds = read_tables(csd_tables)
    table = replicates_table(points, packings, csds, sphericity, law)
    with publish(output) as temporary:
        table.to_csv(temporary, index=False)


with job(snakemake.log[0], snakemake.output):
    main(
        [Point.from_dict(values) for values in snakemake.params.points],
        Path(snakemake.output[0]).parent / "packings",
        snakemake.input.csds,
        snakemake.params.sphericity,
        snakemake.params.law,
        Path(snakemake.output[0]),
    )
