"""Rule provenance: versions, engines and machine behind a study's results."""

from pathlib import Path

from filtercake.packing.result import write_json
from filtercake.results.tables import read_table
from filtercake.run.job import job
from filtercake.run.provenance import describe

with job(snakemake.log[0], snakemake.output):
    replicates = read_table(snakemake.input.replicates)
    write_json(
        Path(snakemake.output[0]),
        {
            **describe(Path(snakemake.scriptdir).parents[1]),
            "engines": sorted(replicates["engine"].unique()),
            "packings": len(replicates),
            "failed": int((replicates["status"] != "ok").sum()),
            "seeds": {f"{row.point}/r{row.replicate}": int(row.seed) for row in replicates.itertuples(index=False)},
        },
    )
