"""Rule design_round: decide what a design packs next."""

from pathlib import Path

from filtercake.design.confirm import choose
from filtercake.design.task import Task
from filtercake.packing.result import read_record, write_json
from filtercake.run.job import job

with job(snakemake.log[0], snakemake.output) as log:
    task = Task.from_params(snakemake.params.design)
    visited = [name for file in snakemake.input.rounds for name in read_record(Path(file))["packings"]]
    found = task.found(task.measured(visited, Path(snakemake.params.packings), snakemake.input.csds))
    chosen = choose(task.problem, task.prior, task.candidates, found, task.design.packings)
    log.info("%s", chosen.why)
    write_json(Path(snakemake.output[0]), vars(chosen))
