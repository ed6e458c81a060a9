"""Rule time_growth: run time per sphere and step against the number of spheres and the size ratio."""

from pathlib import Path

from filtercake import engine_choice
from filtercake.config_loading import load_study
from filtercake.figures import growth as figure
from filtercake.figures.catalogue import save
from filtercake.figures.style import applied
from filtercake.growth import Case, time_growth
from filtercake.job import Progress, job
from filtercake.packing.result import publish
from filtercake.study import base_point

with job(snakemake.log[0], snakemake.output) as log:
    study = load_study(Path(snakemake.params.study))
    spec = base_point(study, snakemake.params.csd, engine_choice.choose).spec
    table = time_growth(
        spec,
        [Case(**case) for case in snakemake.params.cases],
        lambda line: (log.info(line), Progress().note(line)),
    )
    with publish(Path(snakemake.output.table)) as temporary:
        table.to_csv(temporary, index=False)
    with applied():
        save(figure.draw(table), Path(snakemake.output.png), Path(snakemake.output.pdf))
