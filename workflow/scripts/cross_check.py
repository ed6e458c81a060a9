"""Rule cross_check: porosities of the same clouds by two engines."""

from pathlib import Path

from filtercake.crystals.csd import read_tables
from filtercake.packing.result import publish
from filtercake.results.cross_check import agreement, cross_check_table
from filtercake.run.job import job
from filtercake.study.points import Point

with job(snakemake.log[0], snakemake.output) as log:
    pairs = [(Point.from_dict(own), Point.from_dict(other)) for own, other in snakemake.params.pairs]
    output = Path(snakemake.output[0])
    packings = output.parents[1] / "packings"
    table = cross_check_table(pairs, packings, read_tables(snakemake.input.csds), snakemake.params.sphericity)
    log.info("%s", agreement(table).words)
    with publish(output) as temporary:
        table.to_csv(temporary, index=False)
