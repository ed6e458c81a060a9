"""Interior porosity against cohesion, one line per friction (paper, Fig. 9)."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from filtercake.figures import selection, style
from filtercake.figures.selection import StudyData

FREE = ("cohesion_kJ_m3", "friction")


def draw(data: StudyData) -> Figure:
    """Draw our porosity with its 95 % interval, the paper's estimate of the same packings, and published values."""
    cases = selection.varied(data, FREE, "cohesion_kJ_m3")
    figure, panels = style.panels(max(len(cases), 1), width=style.MEDIUM, height=0.5 + 3.3 * max(len(cases), 1))
    for axes in panels:
        axes.set_xlabel(style.COHESION)
        axes.set_ylabel("Interior porosity (–)")
    if not cases:
        style.nothing(panels[0], "no distribution with more than one cohesion")
        return figure
    every = pd.concat([rows for _, rows in cases])
    for axes, (csd, rows) in zip(panels, cases, strict=True):
        _panel(axes, data, csd, rows, sorted(every["friction"].unique()))
    counted = style.key(
        "same packings, counted as in the paper",
        marker="o",
        markerfacecolor="none",
        markeredgecolor=style.FAINT,
        linewidth=0.0,
    )
    style.legend(figure, panels, extra=[counted])
    style.footer(figure, every, "error bars: 95 % intervals of the mean")
    return figure


def _panel(axes: Axes, data: StudyData, csd: str, rows: pd.DataFrame, frictions: list[float]) -> None:
    for index, friction in enumerate(frictions):
        line = rows[rows["friction"] == friction].sort_values("cohesion_kJ_m3")
        if line.empty:
            continue
        columns = ("cohesion_kJ_m3", "porosity", "porosity_ci95")
        label = f"friction {friction:g}"
        style.error_line(axes, line, *columns, label=label, index=index, place=index, count=len(frictions))
        counted = axes.plot(
            line["cohesion_kJ_m3"],
            line["porosity_paper_count"],
            style.marker(index),
            markerfacecolor="none",
            markeredgecolor=style.colour(index),
            alpha=0.45,
            gid="paper_count",
        )
        style.shift(counted, axes, index, len(frictions))
    if rows["porosity"].isna().all():
        style.nothing(axes, style.ALL_FAILED)
    style.title(axes, selection.label(data, csd), len(frictions))
    for value in selection.published(data, csd, "porosity"):
        if value.cohesion_kJ_m3 is None:
            style.published_level(axes, value)
        else:
            style.published_point(axes, value.cohesion_kJ_m3, value.value, value)
