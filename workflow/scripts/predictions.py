"""Rule predictions: resistance and filter area of distributions that were never tested."""

from pathlib import Path

from filtercake.calibration.rounds import Task, conclude
from filtercake.calibration.tables import prediction_table
from filtercake.packing.result import publish, read_record
from filtercake.results.filter_design import drum_of
from filtercake.run.job import job
from filtercake.study.config.study import Study
from filtercake.units import HOUR


def main(task, packings, tables, rounds, summary, study):
    """Fit again, which costs a second, and predict."""
    visited = [name for file in rounds for name in read_record(Path(file))["points"]]
    outcome = conclude(task.settings, task.observations, task.simulate(visited, packings, tables))
    near = task.simulate(read_record(Path(summary))["prediction_points"], packings, tables)
    drum = drum_of(study) if study.filter else None
    flow = study.crystallizer.slurry_flow_m3_h / HOUR if study.filter else 0.0
    return prediction_table(outcome, task.settings, near, task.full_csds(tables), drum, flow)


with job(snakemake.log[0], snakemake.output):
    table = main(
        Task.from_params(snakemake.params.calibration),
        Path(snakemake.params.packings),
        snakemake.input.csds,
        snakemake.input.rounds,
        snakemake.input.summary,
        Study.model_validate(snakemake.params.study),
    )
    with publish(Path(snakemake.output[0])) as temporary:
        table.to_csv(temporary, index=False)
