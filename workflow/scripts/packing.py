"""Rule packing: make all replicates of a point."""

from dataclasses import replace
from pathlib import Path

from filtercake.crystals.csd import read_table
from filtercake.packing.pack import pack_replicates
from filtercake.packing.replication import UntilNarrow
from filtercake.packing.scene import Scene
from filtercake.run.job import Progress, job


def main(table, asked, manifest, point, logger):
    """Pack and report each replicate as it comes."""
    progress = Progress()

    def report(outcome, record):
        if outcome.status == "ok":
            line = f"r{outcome.replicate}: {record['steps']:,} steps, {record['wall_s']:.1f} s"
        else:
            line = f"r{outcome.replicate} failed: {outcome.reason}"
        logger.info(line)
        progress.packed(f"{point} {line}")

    def note(line):
        logger.info(line)
        progress.note(f"{point} {line}")

    _, truncated = read_table(table)
    # sizes as the table has them: what is packed is what the resistance is computed for
    scene = replace(Scene.from_dict({**asked.scene, **asked.incidental}), csd=truncated)
    enough = UntilNarrow(scene, asked.interval, asked.replicates) if asked.interval else lambda _: False
    pack_replicates(scene, asked.most, Path(manifest).parent, asked.code, report, note, enough)
    if asked.interval:
        note(f"interval {enough.half_width:.2g} after {len(enough.values)} packings, {asked.interval:g} asked for")


with job(snakemake.log[0], snakemake.output) as log:
    main(
        snakemake.input.csd,
        snakemake.params,
        snakemake.output[0],
        snakemake.wildcards.point,
        log,
    )
