"""Messages at the start and the end of a run: plan, places of the results, reasons of failures."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from filtercake.packing.pack import MANIFEST
from filtercake.results.tables import read_table
from filtercake.run.answers import answers, design_answers
from filtercake.run.job import failure_reason
from filtercake.study.points import Point

SHOWN = 5
"""Failed packings listed by name; the rest is in the table."""

REPORT = "report.html"
"""Name of the report in the folder of the results, where ``make report`` puts it."""

NUMBERS = ("summary.csv", "calibration.json", "design/design.json")
"""Files of a study or calibration that the report shows."""

CHATTER = ("Select jobs to execute", "Execute ", "Loading script code", "Adding ")
"""Starts of Snakemake's lines that come again with every job or file; its log keeps them."""

Points = Mapping[str, Mapping[str, Point]]
"""Points by study and name."""


def worth_reading(record: logging.LogRecord) -> bool:
    """Whether a line of Snakemake's is no routine message; warnings and errors never are."""
    return record.levelno > logging.INFO or not record.getMessage().startswith(CHATTER)


def plan(points: Points, missing: Mapping[str, Mapping[str, int]]) -> str:
    """One line about what a run is about to do.

    Parameters
    ----------
    points : mapping
        Points by study and name, all of the run.
    missing : mapping
        Packings to make, by study and name of the points that are to be made or completed.
    """
    engines = sorted({points[study][name].scene.engine for study, group in missing.items() for name in group})
    total = sum(len(group) for group in points.values())
    making = sum(len(group) for group in missing.values())
    packings = sum(sum(group.values()) for group in missing.values())
    by = f" with {', '.join(engines)}" if packings else ""
    return f"filtercake: {', '.join(points)}: {making} of {total} points, {packings} packings to make{by}"


def failed_packings(folder: Path, points: Iterable[str]) -> Iterator[tuple[str, int, str]]:
    """Point, replicate and reason of every failed packing of a study whose results are in ``folder``."""
    for point in points:
        manifest = folder / "packings" / point / MANIFEST
        if manifest.exists():
            for entry in json.loads(manifest.read_text(encoding="utf-8"))["replicates"]:
                if entry["status"] != "ok":
                    yield point, entry["replicate"], entry["reason"]


def success(results: Path, points: Points) -> str:
    """Say what studies and calibrations found, where figures, tables and report are, and which packings failed."""
    lines: list[str] = []
    for study, group in points.items():
        folder = results / study
        made = {"figures": folder / "figures", "tables": folder / "tables", "numbers": folder / "summary.csv"}
        answer = folder / "calibration.json"
        if answer.exists():
            made["numbers"] = answer
            lines += ["", *(f"{study}: {line}" for line in _answer(answer))]
        chosen = folder / "design" / "design.json"
        if chosen.exists():
            made["design"] = chosen.parent
            lines += ["", *(f"{study}: {line}" for line in design_answers(chosen))]
        table = list(answers(folder))
        if table:
            lines += ["", f"{study}, +- the half-width of the 95 % interval over the packings:"]
            lines += [f"  {line}" for line in table]
        places = ", ".join(f"{what} in {path}" for what, path in made.items() if path.exists())
        lines.append(f"{study}: {places}" if places else f"{study}: packings in {folder / 'packings'}")
        failed = list(failed_packings(folder, group))
        if failed:
            rows = folder / "replicates.csv"
            where = f"status failed in {rows}; " if rows.exists() else ""
            lines.append(f"{len(failed)} packings failed ({where}make retry):")
        lines += [f"  {point} r{replicate}: {reason}" for point, replicate, reason in failed[:SHOWN]]
        lines += [f"{study}: {line}" for line in _wide_intervals(folder / "summary.csv")]
        checked = folder / "tables" / "cross_check.csv"
        lines += [f"{study}: {_cross_check(checked)}"] if checked.exists() else []
    return "\n".join([*lines, *_report(results, points)])


def _report(results: Path, studies: Iterable[str]) -> Iterator[str]:
    """Name the report where there is one, and say so where the results are newer."""
    report = results / REPORT
    if not report.exists():
        return
    made = report.stat().st_mtime
    numbers = [results / study / name for study in studies for name in NUMBERS]
    older = any(path.exists() and path.stat().st_mtime > made for path in numbers)
    yield f"report: {report}{' (older than these results: make report)' if older else ''}"


def _cross_check(table: Path) -> str:
    # measures packings, which planning a run need not wait for
    from filtercake.results.cross_check import agreement

    return agreement(read_table(table)).words


def _answer(file: Path) -> Iterator[str]:
    """Say what a calibration found, and what must be known of it."""
    record = json.loads(file.read_text(encoding="utf-8"))
    at = "" if record["fixed"] is None else f", at {record['beside']} = {record['fixed']:g}"
    for name, found in record["parameters"].items():
        yield f"{name} = {found['value']:.3g} (95 %: {found['low']:.3g} to {found['high']:.3g}){at}"
    for finding in record["findings"]:
        yield f"{finding['kind']}: {finding['text']}"


def _wide_intervals(summary: Path) -> Iterator[str]:
    """Points whose porosity interval is wider than its target, in words."""
    if not summary.exists():
        return
    table = read_table(summary)
    for row in table[table["interval_reached"] == "no"].to_dict("records"):
        yield (
            f"{row['point']}: the porosity's interval is {row['porosity_ci95']:.2g} after {row['n']} packings, not "
            f"{row['porosity_ci95_target']:g} (packing.porosity_ci95_target); raise packing.max_replicates"
        )


def failure(results: Path, points: Points, since: float, cluster_logs: Path | None = None) -> str:
    """Name the jobs that failed since the run's start (s since the epoch), their reasons and logs, and how to resume.

    A cluster keeps logs of its own, in ``cluster_logs``; among them are those of submissions that failed.
    """
    lines = []
    for study in points:
        folder = results / study / "logs"
        for log in sorted(folder.rglob("*.log")):
            reason = failure_reason(log) if log.stat().st_mtime >= since else ""
            if reason:
                name = " ".join(log.relative_to(folder).with_suffix("").parts)
                lines += [f"\nfailed: {name} ({study})", f"  reason: {reason}", f"  log:    {log}"]
    if not lines:
        lines.append(
            "\nfailed; no job says why: it was stopped from outside, or Snakemake's own message above says more"
        )
    resume = "make resume (or: snakemake --cores 2 --rerun-incomplete)"
    if cluster_logs is not None:
        logs = [log for log in cluster_logs.rglob("*.log") if log.stat().st_mtime >= since]
        lines += [f"  submission's log: {log}" for log in sorted(logs)[:SHOWN]]
        resume = "make resume PROFILE=slurm"
    lines.append(f"\nFinished packings are kept. Resume with: {resume}")
    return "\n".join(lines)
