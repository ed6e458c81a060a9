"""Rule time_growth: run time per sphere and step against the number of spheres and the size ratio."""

from pathlib import Path

from filtercake.figures.style import applied, save
from filtercake.packing.result import publish
from filtercake.run.job import Progress, job
from filtercake.study import engine_choice
from filtercake.study.loading import load_study
from filtercake.study.points import base_point
from filtercake.validation.figures import growth as figure
from filtercake.validation.growth import Case, time_growth

with job(snakemake.log[0], snakemake.output) as log:
    study = load_study(Path(snakemake.params.study))
    scene = base_point(study, snakemake.params.csd, engine_choice.choose).scene
    table = time_growth(
        scene,
        [Case(**case) for case in snakemake.params.cases],
        lambda line: (log.info(line), Progress().note(line)),
    )
    with publish(Path(snakemake.output.table)) as temporary:
        table.to_csv(temporary, index=False)
    with applied():
        save(figure.draw(table), Path(snakemake.output.png), Path(snakemake.output.pdf))
