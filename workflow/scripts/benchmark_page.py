"""Rule benchmark_page: one table, the plot and the page of run time against error."""

from pathlib import Path

import pandas as pd

from filtercake.figures.style import applied, save
from filtercake.packing.result import publish
from filtercake.results.tables import read_table
from filtercake.run.job import job
from filtercake.validation import pages
from filtercake.validation.error_against_time import on_front
from filtercake.validation.figures import run_time_error

with job(snakemake.log[0], snakemake.output):
    table = pd.concat([read_table(file) for file in snakemake.input.errors], ignore_index=True)
    table["on_front"] = table.groupby(["case", "estimator"], group_keys=False)[["axis", "n", "seconds", "error"]].apply(
        on_front
    )
    references = pages.reference_table(read_table(snakemake.input.reference), snakemake.params.cases)
    coverage = pd.concat([read_table(file) for file in snakemake.input.coverage], ignore_index=True)
    for output, rows in ((snakemake.output.table, table), (snakemake.output.coverage, coverage)):
        with publish(Path(output)) as temporary:
            rows.to_csv(temporary, index=False)
    with applied():
        figure = run_time_error.draw(table, references)
        save(figure, Path(snakemake.output.png), Path(snakemake.output.pdf))
    page = pages.benchmark(
        Path(snakemake.input.template),
        table,
        references,
        read_table(snakemake.input.choices),
        coverage,
        read_table(snakemake.input.answers),
        Path(snakemake.params.data),
    )
    with publish(Path(snakemake.output.page)) as temporary:
        temporary.write_text(page, encoding="utf-8")
