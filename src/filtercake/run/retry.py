"""Forget the packings that failed, so that they are made again: ``python -m filtercake.run.retry results``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from filtercake.packing.pack import MANIFEST
from filtercake.run import checksums

LAST = ("provenance.json", "replicates.csv", "calibration.json")
"""Last files of a study or calibration; while one exists, Snakemake looks for nothing behind it."""


def forget_failures(results: Path, *, may_pass: bool = False) -> list[str]:
    """Forget the points that hold a failed packing, and list them; accepted packings stay and are not made again.

    With ``may_pass``, only those that failed for a reason outside the packing.
    """
    forgotten = []
    for manifest in sorted(results.glob(f"*/packings/*/{MANIFEST}")):
        try:
            replicates = json.loads(manifest.read_text(encoding="utf-8"))["replicates"]
            failed = any(_counts(entry, may_pass) for entry in replicates)
        except (OSError, ValueError, KeyError, TypeError):
            failed = True  # unreadable: make it anew
        if failed:
            forget(manifest)
            forgotten.append(f"{manifest.parents[2].name}/{manifest.parent.name}")
    return forgotten


def _counts(entry: dict[str, Any], may_pass: bool) -> bool:
    return entry["status"] != "ok" and (not may_pass or bool(entry.get("may_pass")))


def forget(path: Path) -> None:
    """Remove a file below ``<results>/<study>`` with the tables and figures made from it, never a packing.

    In a folder without packings, nothing else is removed.
    """
    path.unlink(missing_ok=True)
    study = next((parent for parent in path.parents if (parent / "packings").is_dir()), None)
    if study is None:
        return
    for name in LAST:
        (study / name).unlink(missing_ok=True)
    for noted in sorted((study / "logs").rglob(f"*{checksums.SUFFIX}")):
        try:
            made = checksums.read(noted)
        except checksums.ChecksumsDamaged:
            continue  # names nothing that can be trusted; resuming sees to it
        if path not in made and any(study / "packings" in output.parents for output in made):
            continue
        for output in made:
            output.unlink(missing_ok=True)
        noted.unlink()


if __name__ == "__main__":
    for point in forget_failures(Path(sys.argv[1] if len(sys.argv) > 1 else "results")):
        print(f"to be made again: {point}")
