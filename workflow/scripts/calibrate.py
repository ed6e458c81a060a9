"""Rule calibrate_cohesion: fit the cohesion to the measured resistances."""

from pathlib import Path

from filtercake.calibration import rounds
from filtercake.calibration.rounds import Task, conclude, prediction_points
from filtercake.packing.result import publish, read_record, write_json
from filtercake.run.job import job

with job(snakemake.log[0], snakemake.output) as log:
    task = Task.from_params(snakemake.params.calibration)
    made = [read_record(Path(file)) for file in snakemake.input.rounds]
    visited = [name for one in made for name in one["points"]]
    simulated = task.simulate(visited, Path(snakemake.params.packings), snakemake.input.csds)
    outcome = conclude(task.settings, task.observations, simulated)
    for finding in outcome.findings:
        log.info("%s: %s", finding.kind, finding.text)
    record = rounds.summary(outcome, task.settings, made[-1]["why"])
    record["prediction_points"] = list(prediction_points(task.settings, task.candidates, outcome.fit))
    tables = {
        "parity": rounds.parity_table(outcome, task.settings, task.observations),
        "objective": rounds.objective_table(outcome, task.settings),
        "response": rounds.response_table(outcome, task.settings),
        "simulated": simulated,
    }
    for output in map(Path, snakemake.output.tables):
        with publish(output) as temporary:
            tables[output.stem].to_csv(temporary, index=False)
    write_json(Path(snakemake.output.summary), record)
