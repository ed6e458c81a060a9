"""Rule choose_round: decide what a calibration packs next."""

from pathlib import Path

from filtercake.calibration.rounds import Task, choose_round
from filtercake.packing.result import read_record, write_json
from filtercake.run.job import job

with job(snakemake.log[0], snakemake.output) as log:
    task = Task.from_params(snakemake.params.calibration)
    visited = [name for file in snakemake.input.rounds for name in read_record(Path(file))["points"]]
    simulated = task.simulate(visited, Path(snakemake.params.packings), snakemake.input.csds) if visited else None
    chosen = choose_round(
        int(snakemake.wildcards.number), task.settings, task.candidates, visited, task.observations, simulated
    )
    log.info("%s", chosen.why)
    write_json(Path(snakemake.output[0]), vars(chosen))
