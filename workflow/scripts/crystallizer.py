"""Rule crystallizer: growth, nucleation and sizes of the crystals at every residence time."""

from pathlib import Path

import pandas as pd

from filtercake.crystals.crystallizer import SteadyState
from filtercake.crystals.csd import from_table
from filtercake.packing.result import publish
from filtercake.results.paper_tables import crystallizer_table
from filtercake.run.job import job
from filtercake.study.config.study import Study

with job(snakemake.log[0], snakemake.output), publish(Path(snakemake.output[0])) as temporary:
    study = Study.model_validate(snakemake.params.study)
    states = {name: SteadyState(**values) for name, values in snakemake.params.states.items()}
    csds = {Path(table).stem: from_table(pd.read_csv(table)) for table in snakemake.input.csds}
    crystallizer_table(study, states, csds).to_csv(temporary, index=False)
