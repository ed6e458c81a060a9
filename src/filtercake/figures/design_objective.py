"""What a design minimises against the residence time, with its interval, and the parts of a cost."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from filtercake.design.words import COSTS
from filtercake.figures import designed, style
from filtercake.figures.designed import TIME, DesignData

COLUMNS = ("objective", "objective_low", "objective_high")
PARTS = (("crystallizer", "crystallizer", "--"), ("filter", "filter", "-."))
"""Parts of a cost: start of their columns, name, and line."""


def draw(data: DesignData) -> Figure:
    """Draw the objective with its band, its parts, the optimum with its interval, and where packings were made."""
    figure, (axes,) = style.panels(width=style.MEDIUM, height=3.6)
    name = data.summary["objective"]
    rows = designed.known(data.search)
    designed.time_axis(axes, data)
    axes.set_ylabel(designed.objective_label(data, name))
    if rows.empty:
        style.nothing(axes, designed.NOTHING)
        designed.footer(figure, data)
        return figure
    shown = rows.assign(**{column: designed.scaled(name, rows[column].to_numpy(np.float64)) for column in COLUMNS})
    label = "crystallizer and filter" if name in COSTS else "best settings"
    designed.band(axes, shown, COLUMNS, 0, f"{label}, 95 % interval")
    if name in COSTS:
        _parts(axes, rows, name)
        axes.set_ylim(bottom=0.0)
    designed.optimum_span(axes, data)
    _optimum(axes, data, name)
    _packed(axes, data)
    style.legend(figure, [axes], columns=2)
    designed.footer(figure, data, _flat(data), _index(data, name))
    return figure


def _parts(axes: Axes, rows: pd.DataFrame, name: str) -> None:
    for k, (part, label, line) in enumerate(PARTS, 1):
        values = designed.scaled(name, rows[f"{part}_{name}"].to_numpy(np.float64))
        axes.plot(rows[TIME], values, line, color=style.colour(k), linewidth=1.0, label=label)


def _optimum(axes: Axes, data: DesignData, name: str) -> None:
    """Plot the optimum with the intervals of its residence time and of its objective."""
    found, value = data.summary[TIME], data.summary["value"]
    middle, low, high = (float(designed.scaled(name, np.array(value[key]))) for key in ("value", "low", "high"))
    axes.errorbar(
        [found["value"]],
        [middle],
        xerr=[[found["value"] - found["low"]], [found["high"] - found["value"]]],
        yerr=[[middle - low], [high - middle]],
        fmt="o",
        color=style.INK,
        markerfacecolor="white",
        capsize=2.0,
        elinewidth=0.9,
        label="optimum, 95 % intervals",
        zorder=4,
    )


def _packed(axes: Axes, data: DesignData) -> None:
    """Mark the residence times that were packed."""
    if len(data.levels):
        axes.plot(
            data.levels[TIME],
            np.full(len(data.levels), 0.02),
            "^",
            color=style.INK,
            markersize=4.0,
            transform=axes.get_xaxis_transform(),
            label="packings",
            linestyle="",
        )


def _flat(data: DesignData) -> str:
    flat = data.summary.get("flat_min")
    if not flat or flat[0] == flat[1]:
        return ""
    return f"within {100.0 * data.summary['tolerance']:g} % of the least from {flat[0]:.3g} to {flat[1]:.3g} min"


def _index(data: DesignData, name: str) -> str:
    return f"costs at CEPCI {data.summary['cost_index']:g}" if name in COSTS else ""
