"""Specific cake resistance against cohesion, one line per friction (paper, Fig. 10)."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from filtercake.figures import selection, style
from filtercake.figures.porosity_cohesion import FREE
from filtercake.figures.selection import StudyData


def draw(data: StudyData) -> Figure:
    """Draw our resistance with its 95 % interval (eq. 3), Carman's form of the same law, and published values."""
    cases = selection.varied(data, FREE, "cohesion_kJ_m3")
    figure, panels = style.panels(max(len(cases), 1), width=style.MEDIUM, height=0.5 + 3.3 * max(len(cases), 1))
    for axes in panels:
        axes.set_xlabel(style.COHESION)
    if not cases:
        style.resistance_axis(panels[0], np.array([]))
        style.nothing(panels[0], "no distribution with more than one cohesion")
        return figure
    sauter = style.key("Carman's form (Sauter mean), same packings", color=style.FAINT, linewidth=0.9, linestyle="--")
    every = pd.concat([rows for _, rows in cases])
    for axes, (csd, rows) in zip(panels, cases, strict=True):
        _panel(axes, data, csd, rows, sorted(every["friction"].unique()))
    style.legend(figure, panels, extra=[sauter])
    style.footer(figure, every, "error bars: 95 % intervals of the mean")
    return figure


def _panel(axes: Axes, data: StudyData, csd: str, rows: pd.DataFrame, frictions: list[float]) -> None:
    for index, friction in enumerate(frictions):
        line = rows[rows["friction"] == friction].sort_values("cohesion_kJ_m3")
        if line.empty:
            continue
        columns = ("cohesion_kJ_m3", "resistance_m_kg", "resistance_ci95_m_kg")
        label = f"friction {friction:g}"
        style.error_line(axes, line, *columns, label=label, index=index, place=index, count=len(frictions))
        sauter = axes.plot(
            line["cohesion_kJ_m3"],
            line["resistance_sauter_m_kg"],
            color=style.colour(index),
            linewidth=0.8,
            linestyle="--",
            alpha=0.5,
            gid="sauter",
        )
        style.shift(sauter, axes, index, len(frictions))
    if rows["resistance_m_kg"].isna().all():
        style.nothing(axes, style.ALL_FAILED)
    style.title(axes, selection.label(data, csd), len(frictions))
    for value in selection.published(data, csd, "resistance_m_kg"):
        if value.cohesion_kJ_m3 is None:
            style.published_level(axes, value)
        else:
            style.published_point(axes, value.cohesion_kJ_m3, value.value, value)
    style.resistance_axis(axes, rows["resistance_m_kg"].to_numpy(np.float64), log=True)
