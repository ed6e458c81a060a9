"""Kozeny constants of solved packings, by the Sauter mean and by eq. 3's, against the width of sizes and porosity."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from filtercake.figures import style
from filtercake.validation.permeability import BED, CELL, LAYERED
from filtercake.validation.resistance_law import CARMAN, ERDIM, ERGUN, van_der_hoef

LINES = {
    "Carman, 180": (CARMAN, "-"),
    "Erdim et al., 160": (ERDIM, "--"),
    "Ergun, 150": (ERGUN, ":"),
}
SERIES = {
    (BED, "constant"): ("beds, Sauter mean", 0, "o", "full"),
    (CELL, "constant"): ("hard spheres, Sauter mean", 2, "^", "full"),
    (BED, "eq3"): ("beds, mean of eq. 3", 1, "o", "none"),
    (CELL, "eq3"): ("hard spheres, mean of eq. 3", 1, "^", "none"),
    (LAYERED, "constant"): ("layers, Sauter mean", 3, "s", "full"),
    (LAYERED, "eq3"): ("layers, mean of eq. 3", 3, "s", "none"),
}
"""Label, colour, marker and filling of each kind of cases by each mean."""


def draw(cases: pd.DataFrame) -> Figure:
    """Draw both panels from the table of :func:`filtercake.validation.resistance_law.by_case`."""
    figure, (width, pores) = style.panels(2, width=style.DOUBLE, height=3.9, columns=2, sharey=True)
    for axes in (width, pores):
        for label, (value, dashes) in LINES.items():
            axes.axhline(value, color=style.FAINT, linewidth=0.9, linestyle=dashes, label=label, zorder=1)
    for (kind, column), look in SERIES.items():
        rows = cases[cases["kind"] == kind]
        _points(width, rows, "ratio", column, look)
        if kind != LAYERED:
            _points(pores, rows, "porosity", column, look)
    ratio, mean = np.geomspace(1.0, 2.5, 50), float(cases.loc[cases["kind"] == BED, "constant"].mean())
    width.plot(ratio, mean / ratio, color=style.colour(1), linewidth=0.9, label=f"{mean:.0f} over the width")
    porosity = np.linspace(0.40, 0.70, 50)
    pores.plot(
        porosity, van_der_hoef(porosity), color=style.INK, linewidth=0.9, label="van der Hoef et al., hard spheres"
    )
    width.set_xscale("log")
    width.set_xlim(0.97, 2.6)
    width.set_xticks([1.0, 1.2, 1.5, 2.0, 2.5], ["1", "1.2", "1.5", "2", "2.5"])
    width.minorticks_off()
    width.set_xlabel("Width of the sizes: Σx/d² over (Σx/d)²")
    pores.set_xlabel(style.POROSITY)
    width.set_ylabel("Kozeny constant A")
    style.legend(figure, (width, pores), columns=3)
    return figure


def _points(axes: Axes, rows: pd.DataFrame, x: str, column: str, look: tuple[str, int, str, str]) -> None:
    label, index, marker, filled = look
    if rows.empty:
        return
    interval = "ci95" if column == "constant" else "eq3_ci95"
    axes.errorbar(
        rows[x],
        rows[column],
        yerr=rows[interval],
        color=style.colour(index),
        marker=marker,
        markerfacecolor=None if filled == "full" else "white",
        linestyle="none",
        capsize=2.0,
        elinewidth=0.8,
        label=label,
        zorder=4 if column == "constant" else 3,
    )
