"""Rule choices: what the model leaves open, and what each choice changes."""

from pathlib import Path

from filtercake.packing.result import publish
from filtercake.run.job import Progress, job
from filtercake.study import engine_choice
from filtercake.study.loading import load_study
from filtercake.study.points import base_point
from filtercake.validation.error_against_time import choice_table, choices, time_variants

with job(snakemake.log[0], snakemake.output) as log:
    study = load_study(Path(snakemake.params.study))
    wide = load_study(Path(snakemake.params.wide)).csds[snakemake.params.wide_csd]
    scene = base_point(study, snakemake.params.csd, engine_choice.choose).scene
    listed = choices(scene, snakemake.params.replicates)
    timings = time_variants(
        [listed[0].against, *(item.variant for item in listed)],
        lambda line: (log.info(line), Progress().note(line)),
    )
    with publish(Path(snakemake.output[0])) as temporary:
        choice_table(timings, listed, wide.full, wide.truncated).to_csv(temporary, index=False)
