"""Rule time_large_beds: large beds on one and two threads, their memory, and what a million spheres would take."""

from pathlib import Path

from filtercake.packing.result import publish
from filtercake.run.job import Progress, job
from filtercake.study import engine_choice
from filtercake.study.loading import load_study
from filtercake.study.points import base_point
from filtercake.validation.large_beds import large_beds_of, time_large_beds, whole_bed_hours

with job(snakemake.log[0], snakemake.output) as log:
    asked = snakemake.params
    scene = base_point(load_study(Path(asked.study)), asked.csd, engine_choice.choose).scene
    scene = large_beds_of(scene, asked.particles)
    beds = time_large_beds(scene, asked.tiles, asked.steps, 3, lambda line: (log.info(line), Progress().note(line)))
    for output, table in (
        (snakemake.output.beds, beds),
        (snakemake.output.hours, whole_bed_hours(scene, beds)),
    ):
        with publish(Path(output)) as temporary:
            table.to_csv(temporary, index=False, float_format="%.5g")
