"""Rule design_outcome: the best design, from the estimate and all packings of the rounds."""

from pathlib import Path

from filtercake.design import tables as tabulate
from filtercake.design.outcome import Outcome
from filtercake.design.task import Task
from filtercake.packing.result import publish, read_record, write_json
from filtercake.run.job import job

with job(snakemake.log[0], snakemake.output) as log:
    task = Task.from_params(snakemake.params.design)
    made = [read_record(Path(file)) for file in snakemake.input.rounds]
    visited = [name for one in made for name in one["packings"]]
    packings = task.measured(visited, Path(snakemake.params.packings), snakemake.input.csds)
    outcome = Outcome(task, packings, made[-1]["why"])
    record, tables = tabulate.summary(outcome), tabulate.tables(outcome)
    for finding in record["findings"]:
        log.info("%s: %s", finding["kind"], finding["text"])
    for output in map(Path, snakemake.output.tables):
        with publish(output) as temporary:
            tables[output.stem].to_csv(temporary, index=False)
    write_json(Path(snakemake.output.summary), record)
