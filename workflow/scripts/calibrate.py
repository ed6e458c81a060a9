"""Rule calibrate_cohesion: fit the cohesion to the measured resistances."""

from pathlib import Path

from filtercake import calibration_study
from filtercake.calibration_study import Task, conclude, prediction_points
from filtercake.job import job
from filtercake.packing.result import publish, read_record, write_json

with job(snakemake.log[0], snakemake.output) as log:
    task = Task.from_params(snakemake.params.calibration)
    rounds = [read_record(Path(file)) for file in snakemake.input.rounds]
    visited = [name for made in rounds for name in made["points"]]
    simulated = task.simulate(visited, Path(snakemake.params.packings), snakemake.input.csds)
    outcome = conclude(task.settings, task.observations, simulated)
    for finding in outcome.findings:
        log.info("%s: %s", finding.kind, finding.text)
    record = calibration_study.summary(outcome, task.settings, rounds[-1]["why"])
    record["prediction_points"] = list(prediction_points(task.settings, task.candidates, outcome.fit))
    tables = {
        "parity": calibration_study.parity_table(outcome, task.settings, task.observations),
        "objective": calibration_study.objective_table(outcome, task.settings),
        "response": calibration_study.response_table(outcome, task.settings),
        "simulated": simulated,
    }
    for output in map(Path, snakemake.output.tables):
        with publish(output) as temporary:
            tables[output.stem].to_csv(temporary, index=False)
    write_json(Path(snakemake.output.summary), record)
