"""Rule stability_page: one table, the maps and the page of all stress tests."""

from pathlib import Path

import pandas as pd

from filtercake.figures.style import applied, save
from filtercake.packing.result import publish
from filtercake.results.tables import read_table
from filtercake.run.job import job
from filtercake.validation import pages
from filtercake.validation.figures import stability_maps
from filtercake.validation.stability import with_fence

with job(snakemake.log[0], snakemake.output):
    table = with_fence(pd.concat([read_table(file) for file in snakemake.input.tables], ignore_index=True))
    with publish(Path(snakemake.output.table)) as temporary:
        table.to_csv(temporary, index=False)
    with applied():
        save(stability_maps.draw(table), Path(snakemake.output.png), Path(snakemake.output.pdf))
    with publish(Path(snakemake.output.page)) as temporary:
        temporary.write_text(pages.stability(Path(snakemake.input.template), table), encoding="utf-8")
