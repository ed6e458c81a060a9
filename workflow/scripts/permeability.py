"""Rule permeability: solve the flow in packings of a point."""

from pathlib import Path

from filtercake.permeability.replicates import solve_replicates
from filtercake.run.job import Progress, job

with job(snakemake.log[0], snakemake.output) as logger:
    progress, point, asked = Progress(), snakemake.wildcards.point, snakemake.params

    def say(line):
        """Log a line and show it."""
        logger.info(line)
        progress.note(f"{point} flow {line}")

    solve_replicates(
        Path(snakemake.input[0]).parent,
        Path(snakemake.output[0]).parent,
        asked.packings,
        accuracy=asked.accuracy,
        code=asked.library,
        report=say,
        note=logger.info,
    )
