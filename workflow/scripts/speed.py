"""Rule time_in_turn: one case by several protocols in turn, on one core."""

from dataclasses import replace
from pathlib import Path

from filtercake.packing.result import publish
from filtercake.run.job import Progress, job
from filtercake.study import engine_choice
from filtercake.study.loading import load_study
from filtercake.study.points import base_point
from filtercake.units import KILOJOULE_PER_M3, MICROMETRE, MICROSECOND
from filtercake.validation.timing import compare, contender, present, time_in_turn

with job(snakemake.log[0], snakemake.output) as log:
    case = snakemake.params.case
    study = load_study(Path(case["study"]))
    scene = base_point(study, case["csd"], engine_choice.choose).scene
    cohesion = case.get("cohesion_kJ_m3", scene.cohesion / KILOJOULE_PER_M3) * KILOJOULE_PER_M3
    particles = case.get("particles", scene.particles)
    scene = replace(scene, particles=particles, cohesion=cohesion, processes=case["processes"])
    engines = present(case["engines"])
    if missing := set(case["engines"]) - set(engines):
        Progress().note(f"left out, not on this machine: {', '.join(sorted(missing))}")
    published = {
        "time_step": case.get("time_step_us", 0.0) * MICROSECOND,
        "skin": case.get("skin_um", 0.0) * MICROMETRE,
        "steps": case.get("steps", 0),
    }
    timings = time_in_turn(
        [contender(name, scene, **published) for name in engines],
        case["replicates"],
        lambda line: (log.info(line), Progress().note(line)),
    )
    for output, table in (
        (snakemake.output.timings, timings),
        (snakemake.output.comparison, compare(timings)),
    ):
        with publish(Path(output)) as temporary:
            table.to_csv(temporary, index=False)
