"""Rule compare_engines: mean porosities of two engines, case by case."""

from pathlib import Path

import pandas as pd

from filtercake.packing.result import publish
from filtercake.results.tables import read_table
from filtercake.run.job import job
from filtercake.validation.agreement import compare_engines

COLUMNS = ["study", "csd", "cohesion_kJ_m3", "friction", "engine", "replicate", "seed", "status", "reason"]
COLUMNS += ["porosity", "porosity_paper_count", "overlap_max", "coordination", "steps"]

with job(snakemake.log[0], snakemake.output) as log:
    replicates = pd.concat([read_table(path) for path in snakemake.input.replicates], ignore_index=True)
    table = compare_engines(replicates, *snakemake.params.engines)
    log.info("\n%s", table.to_string())
    for output, made in ((snakemake.output.replicates, replicates[COLUMNS]), (snakemake.output.table, table)):
        with publish(Path(output)) as temporary:
            made.to_csv(temporary, index=False)
