"""Rule documentation_page: a page of the documentation as HTML that needs no other file."""

from pathlib import Path

from filtercake.packing.result import publish
from filtercake.report import markdown, pages
from filtercake.run.job import job

with job(snakemake.log[0]), publish(Path(snakemake.output[0])) as temporary:
    body = markdown.to_html(Path(snakemake.input.text).read_text(encoding="utf-8"))
    temporary.write_text(pages.prose(Path(snakemake.input.page), snakemake.params.title, body), encoding="utf-8")
