"""Rule crystallizer: growth, nucleation and sizes of the crystals at every residence time."""

from pathlib import Path

from filtercake.crystals.crystallizer import SteadyState
from filtercake.crystals.csd import read_tables
from filtercake.packing.result import publish
from filtercake.results.paper_tables import crystallizer_table
from filtercake.run.job import job
from filtercake.study.config.study import Study

with job(snakemake.log[0], snakemake.output), publish(Path(snakemake.output[0])) as temporary:
    study = Study.model_validate(snakemake.params.study)
    states = {name: SteadyState(**values) for name, values in snakemake.params.states.items()}
    csds = read_tables(snakemake.input.csds)
    crystallizer_table(study, states, csds).to_csv(temporary, index=False)
