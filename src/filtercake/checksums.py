"""Checksums of what the jobs of a workflow made, one file per job beside its log, as ``sha256sum`` writes them."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from filtercake.packing.result import publish, sha256

SUFFIX = ".sha256"


def write(checksums: Path, outputs: Iterable[str | Path]) -> None:
    """Note the SHA-256 of a job's outputs; names are relative to the file, so that the results may be moved.

    Parameters
    ----------
    checksums : Path
        The file to write; ``sha256sum -c`` in its folder checks it.
    outputs : iterable of str or Path
        What the job made.
    """
    lines = [f"{sha256(Path(output))}  {os.path.relpath(output, checksums.parent)}\n" for output in outputs]
    with publish(checksums) as temporary:
        temporary.write_text("".join(lines), encoding="utf-8")


def read(checksums: Path) -> dict[Path, str]:
    """Return the SHA-256 by output; lines that are none are left out."""
    found = {}
    for line in checksums.read_text(encoding="utf-8", errors="replace").splitlines():
        checksum, _, name = line.partition("  ")
        if name and len(checksum) == 64:
            found[Path(os.path.normpath(checksums.parent / name))] = checksum
    return found


def spoiled(checksums: Path) -> list[Path]:
    """List the outputs that are missing or no longer what the job made."""
    return [path for path, known in read(checksums).items() if not path.is_file() or sha256(path) != known]
