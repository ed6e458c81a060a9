"""Rule time_variants: every variant of one scene in turn, its time and its error."""

from dataclasses import replace
from pathlib import Path

import pandas as pd

from filtercake.packing.result import publish
from filtercake.results.tables import read_table
from filtercake.run.job import Progress, job
from filtercake.study import engine_choice
from filtercake.study.loading import load_study
from filtercake.study.points import base_point
from filtercake.validation.error_against_time import errors, reference_of, time_peers, time_variants, variants

with job(snakemake.log[0], snakemake.output) as log:
    case, name = snakemake.params.case, snakemake.wildcards.case
    study = load_study(Path(case["study"]))
    scene = base_point(study, case["csd"], engine_choice.choose, friction=case["friction"]).scene
    scene = replace(scene, particles=case["particles"])
    csd = study.csds[case["csd"]]
    listed = variants(name, scene, csd.full, quick=snakemake.params.quick)
    timings = pd.concat(
        [
            time_variants(listed, lambda line: (log.info(line), Progress().note(line))),
            time_peers(csd.truncated),
        ],
        ignore_index=True,
    )
    reference = reference_of(read_table(snakemake.input.reference), case["reference"], case["friction"])
    for output, table in (
        (snakemake.output.timings, timings),
        (snakemake.output.errors, errors(name, timings, reference)),
    ):
        with publish(Path(output)) as temporary:
            table.to_csv(temporary, index=False)
