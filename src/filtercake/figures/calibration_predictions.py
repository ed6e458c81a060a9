"""Predicted resistances and filter areas with their intervals, and with the paper's safety factor beside."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from filtercake.calibration.tables import SAFETY_FACTOR
from filtercake.figures import calibrated, style
from filtercake.figures.calibrated import CalibrationData

RESISTANCE = ("resistance_m_kg", "resistance_low_m_kg", "resistance_high_m_kg", "resistance_with_safety_factor_m_kg")
AREA = ("filter_area_m2", "filter_area_low_m2", "filter_area_high_m2", "filter_area_with_safety_factor_m2")
NAME_CHARACTERS = 20
"""Of a line of a distribution's name."""
DECADE = 10.0
"""Factor between resistances on the axis up to which more of its ticks have numbers."""


def draw(data: CalibrationData) -> Figure:
    """Draw one row per distribution: its resistance, and its filter area where a filter is given."""
    table = data.predictions
    if table is None or table.empty:
        figure, (axes,) = style.panels(width=style.MEDIUM, height=2.4)
        axes.set_xlabel("Specific cake resistance (m/kg)")
        style.nothing(axes, "no prediction was asked for")
        return figure
    filtered = AREA[0] in table
    height = 1.5 + 0.34 * len(table)
    figure, panels = style.panels(
        2 if filtered else 1,
        width=style.DOUBLE if filtered else style.MEDIUM,
        height=height,
        columns=2 if filtered else 1,
        sharey=True,
    )
    _rows(panels[0], table, RESISTANCE)
    style.resistance_axis(panels[0], table[RESISTANCE[0]].to_numpy(np.float64), log=True, abscissa=True)
    if table[RESISTANCE[3]].max() < DECADE * table[RESISTANCE[1]].min():
        panels[0].xaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0)))
    panels[0].set_title(calibrated.panel_title(data, 45 if filtered else 75), loc="left")
    if filtered:
        _rows(panels[1], table, AREA)
        panels[1].set_xlim(left=0.0)
        panels[1].set_xlabel("Filter area (m²)")
    places = np.arange(len(table))
    panels[0].set_yticks(places, [data.label(str(csd), NAME_CHARACTERS) for csd in table["csd"]])
    panels[0].set_ylim(len(table) - 0.5, -0.5)
    style.legend(figure, panels, columns=2)
    _footer(figure, data, table)
    return figure


def _rows(axes: Axes, table: pd.DataFrame, columns: tuple[str, str, str, str]) -> None:
    value, low, high, safe = (table[name].to_numpy(np.float64) for name in columns)
    places = np.arange(len(table))
    axes.errorbar(
        value,
        places,
        xerr=np.stack([value - low, high - value]),
        fmt=style.marker(0),
        color=style.colour(0),
        capsize=2.5,
        elinewidth=1.0,
        label="predicted, with 95 % interval",
        zorder=3,
    )
    axes.plot(
        safe,
        places,
        "D",
        markerfacecolor="white",
        markeredgecolor=style.colour(1),
        markeredgewidth=1.1,
        label=f"at {SAFETY_FACTOR:g} times the predicted resistance (safety factor)",
        zorder=2.5,
        gid="safety",
    )
    axes.yaxis.set_tick_params(length=0.0)
    axes.grid(axis="y", color=style.FAINT, alpha=0.3, linewidth=0.5)


def _footer(figure: Figure, data: CalibrationData, table: pd.DataFrame) -> None:
    fitted = calibrated.fitted_packings(data)
    predicted = calibrated.main_packings(data, [str(csd) for csd in table["csd"]])
    words = [f"fit: {calibrated.count(fitted)}"]
    if len(predicted):
        words.append(f"predicted distributions: {calibrated.count(predicted)}")
    engines = [*fitted["engine"], *predicted["engine"]]
    calibrated.footer(figure, data, words, engines, _covered(data, table))


def _covered(data: CalibrationData, table: pd.DataFrame) -> str:
    """Whether the safety factor covers the intervals, in words."""
    beyond = table[table["high_over_resistance"] > SAFETY_FACTOR]
    if beyond.empty:
        most = float(table["high_over_resistance"].max())
        return f"upper ends of the intervals are at most {most:.2f} times the prediction: the safety factor covers them"
    names = ", ".join(data.label(str(csd)) for csd in beyond["csd"])
    return f"the safety factor does not cover the interval of {names}"
