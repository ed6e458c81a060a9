"""Rule calibrate_cohesion: fit a calibration's parameters to the measured resistances."""

from pathlib import Path

from filtercake.calibration import tables as tabulate
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
    record = tabulate.summary(outcome, task.settings, made[-1]["why"])
    record["prediction_points"] = list(prediction_points(task.settings, task.candidates, outcome.fit))
    tables = {
        "parity": tabulate.parity_table(outcome, task.settings, task.observations),
        "objective": tabulate.objective_table(outcome, task.settings),
        "response": tabulate.response_table(outcome, task.settings, task.observations),
        "pressures": tabulate.pressures_table(outcome),
        "simulated": simulated,
    }
    for output in map(Path, snakemake.output.tables):
        with publish(output) as temporary:
            tables[output.stem].to_csv(temporary, index=False)
    write_json(Path(snakemake.output.summary), record)
