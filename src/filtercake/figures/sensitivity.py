"""Porosity against Poisson's ratio and restitution: what the paper says hardly matters (section 4.1)."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from filtercake.figures import selection, style
from filtercake.figures.selection import StudyData
from filtercake.study.points import base_rows

PROPERTIES = {"poisson_ratio": "Poisson's ratio (–)", "restitution": "Coefficient of restitution (–)"}
LEAST_HALF_SPAN = 0.015
"""The axes reach at least this far on both sides: an error of 0.015 in porosity is 15 % in resistance."""


def draw(data: StudyData) -> Figure:
    """Draw one panel per property that varies, with the base value's 95 % interval behind."""
    cases = {name: selection.varied(data, (name,), name) for name in PROPERTIES}
    cases = {name: found for name, found in cases.items() if found}
    width = style.SINGLE if len(cases) < 2 else style.MEDIUM
    figure, panels = style.panels(max(len(cases), 1), width=width, height=2.8, columns=2 if cases else 1, sharey=True)
    panels[0].set_ylabel("Interior porosity (–)")
    if not cases:
        panels[0].set_xlabel("Poisson's ratio or coefficient of restitution (–)")
        style.nothing(panels[0], "neither Poisson's ratio nor the coefficient of restitution varies")
        return figure
    for axes, (name, found) in zip(panels, cases.items(), strict=True):
        for place, (csd, rows) in enumerate(found):
            _series(axes, data, name, csd, rows.sort_values(name), place, len(found))
        axes.set_xlabel(PROPERTIES[name])
    every = pd.concat([rows for found in cases.values() for _, rows in found]).drop_duplicates("point")
    _widen(panels[0], every)
    style.legend(figure, panels)
    style.footer(figure, every, "error bars: 95 % intervals of the mean")
    return figure


def _series(axes: Axes, data: StudyData, name: str, csd: str, rows: pd.DataFrame, place: int, count: int) -> None:
    index, label = selection.number(data, csd), selection.label(data, csd)
    style.error_line(axes, rows, name, "porosity", "porosity_ci95", label=label, index=index, place=place, count=count)
    if rows["porosity"].isna().all():
        style.nothing(axes, style.ALL_FAILED)
    base = base_rows(data.study, rows)
    if base.empty:
        return
    mean, half = float(base["porosity"].iloc[0]), float(base["porosity_ci95"].iloc[0])
    if mean == mean and half == half:
        ink = style.colour(index)
        axes.axhspan(
            mean - half,
            mean + half,
            color=ink,
            alpha=0.13,
            linewidth=0.0,
            label="base value, 95 %",
            gid="base",
        )


def _widen(axes: Axes, rows: pd.DataFrame) -> None:
    low = (rows["porosity"] - rows["porosity_ci95"].fillna(0.0)).min()
    high = (rows["porosity"] + rows["porosity_ci95"].fillna(0.0)).max()
    if low == low:
        middle, half = 0.5 * (low + high), max(LEAST_HALF_SPAN, 0.6 * (high - low))
        axes.set_ylim(middle - half, middle + half)
