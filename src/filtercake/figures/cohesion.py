"""A measured quantity against cohesion, one panel per distribution and one line per friction."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from filtercake.figures import selection, style
from filtercake.figures.selection import StudyData
from filtercake.units import FloatArray

FREE = ("cohesion_kJ_m3", "friction")


class Beside(NamedTuple):
    """A second estimate of the same packings: its column, its mark, how it looks by series, and its legend entry."""

    column: str
    gid: str
    look: Callable[[int], dict[str, Any]]
    key: Line2D


def draw(
    data: StudyData, columns: tuple[str, str], beside: Beside, label: Callable[[Axes, FloatArray], object], *notes: str
) -> Figure:
    """Draw a quantity with its 95 % interval, a second estimate, and published values.

    ``columns`` are those of the quantity and the half-width of its interval; ``label`` labels a panel's ordinate, given
    the values it shows; ``notes`` go below the figure.
    """
    cases = selection.varied(data, FREE, "cohesion_kJ_m3")
    count = max(len(cases), 1)
    figure, panels = style.panels(count, width=style.MEDIUM, height=0.5 + 3.3 * count)
    for axes in panels:
        axes.set_xlabel(style.COHESION)
    if not cases:
        label(panels[0], np.array([]))
        style.nothing(panels[0], "no distribution with more than one cohesion")
        return figure
    every = pd.concat([rows for _, rows in cases])
    frictions = sorted(every["friction"].unique())
    for axes, (csd, rows) in zip(panels, cases, strict=True):
        for index, friction in enumerate(frictions):
            line = rows[rows["friction"] == friction].sort_values("cohesion_kJ_m3")
            if len(line):
                _line(axes, line, columns, beside, index, len(frictions))
        if rows[columns[0]].isna().all():
            style.nothing(axes, style.ALL_FAILED)
        style.title(axes, selection.label(data, csd), len(frictions))
        for value in selection.published(data, csd, columns[0]):
            if value.cohesion_kJ_m3 is None:
                style.published_level(axes, value)
            else:
                style.published_point(axes, value.cohesion_kJ_m3, value.value, value)
        label(axes, rows[columns[0]].to_numpy(np.float64))
    style.legend(figure, panels, extra=[beside.key])
    style.footer(figure, every, "error bars: 95 % intervals of the mean", *notes)
    return figure


def _line(axes: Axes, rows: pd.DataFrame, columns: tuple[str, str], beside: Beside, index: int, count: int) -> None:
    label, x = f"friction {rows['friction'].iloc[0]:g}", "cohesion_kJ_m3"
    style.error_line(axes, rows, x, *columns, label=label, index=index, place=index, count=count)
    other = axes.plot(rows[x], rows[beside.column], gid=beside.gid, **beside.look(index))
    style.shift(other, axes, index, count)
