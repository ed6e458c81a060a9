"""The pressure cell: porosity against load over strength by two ways, and solids and contacts against friction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from filtercake.figures import style
from filtercake.validation.pressure import COMPARED, FRICTIONS
from filtercake.validation.pressure_column import SLICES
from filtercake.validation.pressure_evidence import CLOSE, FITS, LOOSE, fitted

WAYS = {
    "stress": ("stress raised", "o", "full"),
    "cohesion": ("cohesion weakened", "s", "none"),
    "direct": ("pressed at once", "x", "full"),
}
"""Label, marker and filling of each way to a load."""


def draw_load(led: pd.DataFrame) -> Figure:
    """Draw porosity against x from the table of :func:`filtercake.validation.pressure_evidence.led`."""
    figure, panels = style.panels(len(FRICTIONS), width=style.DOUBLE, height=3.0, columns=len(FRICTIONS))
    for axes, friction in zip(panels, FRICTIONS, strict=True):
        here = led[led["friction"] == friction]
        for index, (way, (label, marker, filled)) in enumerate(WAYS.items()):
            rows = here[here["case"].str.startswith(f"{way}_")].sort_values("load")
            bars = axes.errorbar(
                rows["load"],
                rows["porosity"],
                yerr=rows["ci95"],
                color=style.colour(index),
                marker=marker,
                markersize=3.0,
                markerfacecolor=None if filled == "full" else "white",
                linestyle="none",
                capsize=2.0,
                elinewidth=0.8,
                zorder=3,
                label=label,
            )
            style.shift(bars.get_children(), axes, index, len(WAYS))
        if friction in FITS:
            load = np.geomspace(2.0, 150.0, 100)
            axes.plot(load, fitted(load, friction), color=style.FAINT, linewidth=0.9, label="an earlier program's fit")
        axes.set_title(f"friction {friction:g}")
        _axis_of_loads(axes, 2.0, 150.0, COMPARED)
    panels[1].set_xlabel("Stress over what the contacts' cohesion holds, x = p/p$_c$")
    panels[0].set_ylabel(style.POROSITY)
    style.legend(figure, panels, columns=4)
    return figure


KINDS = {
    "": ("slices of columns", "o", "full"),
    "cell": ("cells", "s", "none"),
    "axial": ("cells pressed along one axis", "D", "none"),
}
"""Label, marker and filling of what the table of columns holds against each other."""


def draw_columns(table: pd.DataFrame) -> Figure:
    """Draw porosity against x from the table of :func:`filtercake.validation.pressure_evidence.columns`."""
    figure, panels = style.panels(len(FRICTIONS), width=style.DOUBLE, height=2.8, columns=len(FRICTIONS))
    for axes, friction in zip(panels, FRICTIONS, strict=True):
        rows = table[table["friction"] == friction].sort_values("load")
        for index, (name, (label, marker, filled)) in enumerate(KINDS.items()):
            bars = axes.errorbar(
                rows["load"],
                rows[name or "porosity"],
                yerr=rows[f"{name}_ci95" if name else "ci95"],
                color=style.colour(index),
                marker=marker,
                markersize=3.5,
                markerfacecolor=None if filled == "full" else "white",
                linestyle="none",
                capsize=2.0,
                elinewidth=0.8,
                zorder=3,
                label=label,
            )
            style.shift(bars.get_children(), axes, index, len(KINDS))
        axes.set_title(f"friction {friction:g}")
        _axis_of_loads(axes, 2.0, 15.0, SLICES)
    panels[1].set_xlabel("Stress over what the contacts' cohesion holds, x = p/p$_c$")
    panels[0].set_ylabel(style.POROSITY)
    style.legend(figure, panels, columns=3)
    return figure


def _axis_of_loads(axes: Axes, low: float, high: float, marked: Sequence[float]) -> None:
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    axes.set_xticks(list(marked), [f"{load:g}" for load in marked])
    axes.minorticks_off()


def draw_friction(series: pd.DataFrame) -> Figure:
    """Draw one size from the table of :func:`filtercake.validation.pressure_evidence.friction_series`."""
    figure, (solids, contacts) = style.panels(2, width=style.DOUBLE, height=2.7, columns=2)
    solids.errorbar(
        series["friction"],
        series["solids"],
        yerr=series["se"],
        color=style.colour(0),
        marker="o",
        capsize=2.0,
        elinewidth=0.8,
        label="cells of 2000",
        zorder=3,
    )
    solids.plot(
        [0.0], [CLOSE], "D", color=style.INK, markerfacecolor="white", label="published, friction 0 and 1", zorder=4
    )
    style.published_range(solids, 1.0, *LOOSE, colour=style.INK)
    solids.set_ylabel("Solids fraction (–)")
    contacts.plot(series["friction"], series["coordination"], "-o", color=style.colour(1), label="all spheres")
    contacts.plot(series["friction"], series["backbone"], "-^", color=style.colour(2), label="without rattlers")
    for number in (4.0, 6.0):
        contacts.axhline(number, color=style.FAINT, linewidth=0.8, linestyle="--", zorder=0)
    contacts.set_ylabel("Contacts of a sphere")
    for axes in (solids, contacts):
        axes.set_xlabel("Friction")
    style.legend(figure, (solids, contacts), columns=3)
    return figure
