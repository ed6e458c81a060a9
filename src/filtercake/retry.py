"""Forget the packings that failed, so that the next run makes them again: ``python -m filtercake.retry results``."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from filtercake.packing.pack import MANIFEST


def forget_failures(results: Path) -> list[str]:
    """Remove the manifests that hold a failed packing; accepted packings stay and are not made again.

    Parameters
    ----------
    results : Path
        Folder of the results.

    Returns
    -------
    list of str
        The points whose manifest was removed.
    """
    forgotten = []
    for manifest in sorted(results.glob(f"*/packings/*/{MANIFEST}")):
        try:
            replicates = json.loads(manifest.read_text(encoding="utf-8"))["replicates"]
            failed = any(entry["status"] != "ok" for entry in replicates)
        except (OSError, ValueError, KeyError, TypeError):
            failed = True  # unreadable: make it anew
        if failed:
            manifest.unlink()
            forgotten.append(f"{manifest.parents[2].name}/{manifest.parent.name}")
    return forgotten


if __name__ == "__main__":
    for point in forget_failures(Path(sys.argv[1] if len(sys.argv) > 1 else "results")):
        print(f"to be made again: {point}")
