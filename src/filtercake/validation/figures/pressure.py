"""The pressure cell: porosity against load over strength by two ways, and solids and contacts against friction."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from filtercake.figures import style
from filtercake.validation.pressure import FRICTIONS, PATHS
from filtercake.validation.pressure_evidence import CLOSE, FITS, LOOSE, fitted

WAYS = {
    "stress": ("stress raised", "o", "full"),
    "cohesion": ("cohesion weakened", "s", "none"),
    "direct": ("pressed at once", "x", "full"),
}
"""Label, marker and filling of each way to a load."""


def draw_load(means: pd.DataFrame) -> Figure:
    """Draw porosity against x from the table of :func:`filtercake.validation.pressure_evidence.averages`."""
    figure, (axes,) = style.panels(width=style.MEDIUM, height=3.6)
    here = means[means["section"] == PATHS]
    for index, friction in enumerate(FRICTIONS):
        for way, (label, marker, filled) in WAYS.items():
            rows = here[(here["friction"] == friction) & here["case"].str.startswith(f"{way}_")].sort_values("load")
            axes.errorbar(
                rows["load"],
                rows["porosity"],
                yerr=rows["se"],
                color=style.colour(index),
                marker=marker,
                markerfacecolor=None if filled == "full" else "white",
                linestyle="none",
                capsize=2.0,
                elinewidth=0.8,
                zorder=3,
                label=f"friction {friction:g}, {label}",
            )
        if friction in FITS:
            load = np.geomspace(2.0, 150.0, 100)
            name = f"friction {friction:g}, an earlier program's fit"
            axes.plot(load, fitted(load, friction), color=style.colour(index), linewidth=0.9, label=name)
    axes.set_xscale("log")
    axes.set_xlim(2.0, 150.0)
    axes.set_xticks([3.0, 10.0, 30.0, 100.0], ["3", "10", "30", "100"])
    axes.minorticks_off()
    axes.set_xlabel("Stress over what the contacts' cohesion holds, x = p/p$_c$")
    axes.set_ylabel(style.POROSITY)
    style.legend(figure, (axes,), columns=2)
    return figure


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
