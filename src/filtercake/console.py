"""What a run says at its start and at its end: the plan, where the results are, and why something failed."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from filtercake.job import failure_reason
from filtercake.packing.pack import MANIFEST
from filtercake.study import Point

SHOWN = 5
"""Failed packings listed by name; the rest is in the table."""

_FAILED_JOB = re.compile(r"Error in rule (?P<rule>\w+):.*?\n(?P<body>(?:[ ]{4}.*\n)+)")
_JOB_LOG = re.compile(r"^\s*log: (?P<log>\S+)", re.MULTILINE)

Points = Mapping[str, Mapping[str, Point]]
"""Points by study and name."""


def plan(points: Points, packings: int) -> str:
    """One line about what a run is about to do."""
    engines = sorted({point.spec.engine for group in points.values() for point in group.values()})
    total = sum(len(group) for group in points.values())
    return f"filtercake: {', '.join(points)}: {total} points, {packings} packings to make with {', '.join(engines)}"


def failed_packings(folder: Path, points: Iterable[str]) -> Iterator[tuple[str, int, str]]:
    """Point, replicate and reason of every failed packing of a study whose results are in ``folder``."""
    for point in points:
        manifest = folder / "packings" / point / MANIFEST
        if manifest.exists():
            for entry in json.loads(manifest.read_text(encoding="utf-8"))["replicates"]:
                if entry["status"] != "ok":
                    yield point, entry["replicate"], entry["reason"]


def success(results: Path, points: Points) -> str:
    """Say where every study's figures and tables are, and which packings failed."""
    lines = []
    for study, group in points.items():
        folder = results / study
        lines.append(f"\n{study}: figures in {folder / 'figures'}, tables in {folder / 'tables'}")
        lines.append(f"{study}: numbers in {folder / 'summary.csv'}")
        failed = list(failed_packings(folder, group))
        if failed:
            lines.append(f"{len(failed)} packings failed (status failed in {folder / 'replicates.csv'}; make retry):")
        lines += [f"  {point} r{replicate}: {reason}" for point, replicate, reason in failed[:SHOWN]]
    return "\n".join(lines)


def failure(snakemake_log: Path) -> str:
    """Name the jobs that failed, their reasons and logs, and the command that resumes."""
    text = snakemake_log.read_text(encoding="utf-8", errors="replace") if snakemake_log.is_file() else ""
    jobs: dict[tuple[str, str], None] = {}
    for match in _FAILED_JOB.finditer(text):
        found = _JOB_LOG.search(match["body"])
        jobs[match["rule"], found["log"] if found else ""] = None
    lines = []
    for rule, log in jobs:
        reason = failure_reason(Path(log)) if log else ""
        lines += [f"\nfailed: {rule} {Path(log).stem}", f"  reason: {reason or 'see the log'}", f"  log:    {log}"]
    lines.append("\nFinished packings are kept. Resume with: make resume (or: snakemake --cores 2 --rerun-incomplete)")
    return "\n".join(lines)
