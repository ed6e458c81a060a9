"""What a study found, as a small table for the terminal; what its design found, in words."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from filtercake.results.tables import read_table

MOST_ROWS: Final = 12
"""Points listed; the rest is in the table of the results."""

Row = Mapping[Any, Any]


def answers(folder: Path) -> Iterator[str]:
    """Tabulate porosity, resistance and area of the filter at every point of a study, with their 95 % intervals.

    Parameters
    ----------
    folder : Path
        Folder of its results; without a ``summary.csv`` there is nothing to say.

    Yields
    ------
    str
        A heading and one line per point, of at most ``MOST_ROWS``; then how many more there are, and where.
    """
    summary = folder / "summary.csv"
    if not summary.exists():
        return
    points = read_table(summary).to_dict("records")
    areas = _areas(folder / "tables" / "filter.csv")
    titles = ["point", "porosity", "resistance, m/kg", *(["filter area, m2"] if areas else [])]
    rows = [
        [str(point["point"]), *_found(point), *([areas.get(str(point["point"]), "-")] if areas else [])]
        for point in points[:MOST_ROWS]
    ]
    yield from _aligned([titles, *rows])
    if len(points) > MOST_ROWS:
        yield f"... and {len(points) - MOST_ROWS} more in {summary}"


def design_answers(file: Path) -> Iterator[str]:
    """Say what a study's design found, from its record.

    Yields
    ------
    str
        One line per finding, what it is about first.
    """
    for finding in json.loads(file.read_text(encoding="utf-8"))["findings"]:
        yield f"{finding['kind']}: {finding['text']}"


def _found(point: Row) -> tuple[str, str]:
    """Write porosity and resistance of a point."""
    if not math.isfinite(point["porosity"]):
        return "no accepted packing", "-"
    return (
        _with_interval(point["porosity"], point["porosity_ci95"]),
        _with_interval(point["resistance_m_kg"], point["resistance_ci95_m_kg"]),
    )


def _areas(file: Path) -> dict[str, str]:
    """Areas of the filter by point, with the ends of their intervals; none where the study has no filter."""
    if not file.exists():
        return {}
    return {str(row["point"]): _area(row) for row in read_table(file).to_dict("records")}


def _area(row: Row) -> str:
    area, low, high = (row[f"filter_area_{end}m2"] for end in ("", "low_", "high_"))
    if not math.isfinite(area):
        return "-"
    return f"{area:.3g} ({low:.3g} to {high:.3g})" if math.isfinite(low) and math.isfinite(high) else f"{area:.3g}"


def _with_interval(value: float, half: float) -> str:
    """Write a value with its half-width; a dash for one that is not known (a single packing)."""
    return f"{value:.4g} +- {half:.2g}" if math.isfinite(half) else f"{value:.4g} +- -"


def _aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Write rows of cells with their columns one below the other."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip()
