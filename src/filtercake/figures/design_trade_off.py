"""Designs that no other one beats in both of two objectives (Pareto)."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from filtercake.figures import designed, style
from filtercake.figures.designed import TIME, DesignData

COLUMNS = {"filter_area": "filter_area_m2"}
"""Columns of objectives that are not called as these."""


def draw(data: DesignData) -> Figure:
    """Draw the second objective against the first; colours are residence times."""
    figure, (axes,) = style.panels(width=style.MEDIUM, height=3.6)
    first, second = data.summary["objective"], data.summary["trade_off"]
    axes.set_xlabel(designed.objective_label(data, first))
    axes.set_ylabel(designed.objective_label(data, second))
    if data.pareto.empty:
        style.nothing(axes, designed.NOTHING)
        designed.footer(figure, data)
        return figure
    one, other = (
        designed.scaled(name, data.pareto[COLUMNS.get(name, name)].to_numpy(np.float64)) for name in (first, second)
    )
    axes.plot(one, other, color=style.FAINT, linewidth=0.8, zorder=1)
    times = data.pareto[TIME].to_numpy(np.float64)
    whole = data.search[TIME]
    dots = axes.scatter(
        one,
        other,
        c=times,
        cmap="viridis",
        norm=LogNorm(whole.min(), whole.max()),
        s=22.0,
        edgecolors=style.INK,
        linewidths=0.4,
        label="beaten by no other design in both",
        zorder=3,
    )
    bar = figure.colorbar(dots, ax=axes, label=designed.LABEL)
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    bar.ax.yaxis.set_minor_formatter(NullFormatter())
    bar.ax.set_yticks([float(f"{value:.2g}") for value in np.geomspace(whole.min(), whole.max(), 5)])
    best = [float(designed.scaled(name, np.array(data.best[COLUMNS.get(name, name)]))) for name in (first, second)]
    axes.plot(
        *best, "*", color=style.colour(1), markersize=9.0, label="least of the first alone", linestyle="", zorder=4
    )
    style.legend(figure, [axes], columns=2)
    designed.footer(figure, data, "at the mean of what is known of the porosity")
    return figure
