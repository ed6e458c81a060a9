"""Checksums of what the jobs of a workflow made, one file per job beside its log, as ``sha256sum`` writes them."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path

from filtercake.errors import FiltercakeError
from filtercake.packing.result import publish, sha256

SUFFIX = ".sha256"
_OWN = "# of the lines above: "
"""Starts the last line, a comment to ``sha256sum``."""


class ChecksumsDamaged(FiltercakeError):  # noqa: N818 - reads better where it is caught
    """A file of checksums is not what was written."""


def write(checksums: Path, outputs: Iterable[str | Path]) -> None:
    """Note the SHA-256 of a job's outputs in a file that ``sha256sum -c`` in its folder checks.

    Names are relative to the file, so that the results may be moved.
    """
    lines = [f"{sha256(Path(output))}  {os.path.relpath(output, checksums.parent)}\n" for output in outputs]
    text = "".join(lines)
    with publish(checksums) as temporary:
        temporary.write_text(f"{text}{_OWN}{_digest(text)}\n", encoding="utf-8")


def read(checksums: Path) -> dict[Path, str]:
    """Return the SHA-256 by output.

    Raises
    ------
    ChecksumsDamaged
        If the file is not what was written: no name in it can be trusted.
    """
    text, mark, own = checksums.read_text(encoding="utf-8", errors="replace").partition(_OWN)
    if not mark or own != f"{_digest(text)}\n":
        raise ChecksumsDamaged(f"{checksums} is not what was written")
    rows = (line.split("  ", 1) for line in text.splitlines())
    return {Path(os.path.normpath(checksums.parent / name)): checksum for checksum, name in rows}


def spoiled(checksums: Path) -> list[Path]:
    """List the outputs that are missing or no longer what the job made.

    Raises
    ------
    ChecksumsDamaged
        As for :func:`read`.
    """
    return [path for path, known in read(checksums).items() if not path.is_file() or sha256(path) != known]


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
