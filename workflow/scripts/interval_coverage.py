"""Rule coverage: ask for an interval again and again, and see how often it holds the reference."""

from dataclasses import replace
from pathlib import Path

from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.result import publish
from filtercake.results.tables import read_table
from filtercake.run.job import Progress, job
from filtercake.study import engine_choice
from filtercake.study.loading import load_study
from filtercake.study.points import base_point, with_engine
from filtercake.validation.error_against_time import reference_of
from filtercake.validation.interval_coverage import Asked, coverage

with job(snakemake.log[0], snakemake.output) as log:
    case = snakemake.params.case
    study = with_engine(load_study(Path(case["study"])), Embedded.name)
    scene = base_point(study, case["csd"], engine_choice.choose, friction=case["friction"]).scene
    asked = Asked(
        snakemake.wildcards.case,
        replace(scene, particles=case["particles"]),
        reference_of(read_table(snakemake.input.reference), case["reference"], case["friction"]),
        tuple(snakemake.params.intervals),
    )
    table = coverage(asked, snakemake.params.repeats, lambda line: (log.info(line), Progress().note(line)))
    with publish(Path(snakemake.output[0])) as temporary:
        table.to_csv(temporary, index=False)
