"""Rule points: tabulate a study's sweep points."""

from pathlib import Path

from filtercake.packing.result import publish
from filtercake.run.job import job
from filtercake.study.points import Point, points_table

with job(snakemake.log[0], snakemake.output):
    table = points_table(Point.from_dict(values) for values in snakemake.params.points)
    with publish(Path(snakemake.output[0])) as temporary:
        table.to_csv(temporary, index=False)
