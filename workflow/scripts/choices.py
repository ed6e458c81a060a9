"""Rule choices: what the model leaves open, and what each choice changes."""

from pathlib import Path

from filtercake import engine_choice
from filtercake.accuracy import choice_table, choices, time_variants
from filtercake.config_loading import load_study
from filtercake.job import Progress, job
from filtercake.packing.result import publish
from filtercake.study import base_point

with job(snakemake.log[0], snakemake.output) as log:
    study = load_study(Path(snakemake.params.study))
    wide = load_study(Path(snakemake.params.wide)).csds[snakemake.params.wide_csd]
    name = snakemake.params.csd
    spec = base_point(study, name, engine_choice.choose).spec
    listed = choices(spec, study.csds[name].full, snakemake.params.replicates)
    timings = time_variants(
        [listed[0].against, *(item.variant for item in listed)],
        lambda line: (log.info(line), Progress().note(line)),
    )
    with publish(Path(snakemake.output[0])) as temporary:
        choice_table(timings, listed, wide.full, wide.truncated).to_csv(temporary, index=False)
