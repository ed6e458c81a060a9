"""Modelled against measured resistance at the calibrated parameters, and as predicted from the other measurements."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from filtercake.calibration.rounds import Cake
from filtercake.figures import calibrated, style
from filtercake.figures.calibrated import CalibrationData
from filtercake.units import FloatArray

MARGIN = 1.08
"""Factor by which the axes go beyond the data."""
ENTRY_HEIGHT = 0.13
"""Of an entry of the legend, in."""


def draw(data: CalibrationData) -> Figure:
    """Draw every measurement, with the 95 % intervals of both sides."""
    # the axes are nearly square; matplotlib's layout does not keep the labels of exactly square ones apart
    figure, (axes,) = style.panels(width=style.SINGLE, height=4.2 + ENTRY_HEIGHT * (len(data.cakes) + 2))
    axes.set_title(calibrated.panel_title(data, 45), loc="left")
    for cake in data.cakes:
        _cake(axes, data, cake)
    means = calibrated.measured_means(data)
    keys = []
    if means["left_out_m_kg"].notna().any():
        _left_out(axes, data, means)
        hollow: dict[str, Any] = {"marker": "o", "markersize": 8.0, "markerfacecolor": "none", "linewidth": 0.0}
        keys.append(style.key("predicted from the other distributions", markeredgecolor=style.FAINT, **hollow))
    low, high = _limits(data, means)
    axes.plot(
        [low, high], [low, high], color=style.INK, linewidth=0.8, zorder=1, label="modelled = measured", gid="equal"
    )
    style.resistance_axis(axes, np.array([low, high]), log=True, factor=", modelled")
    style.resistance_axis(axes, np.array([low, high]), log=True, factor=", measured", abscissa=True)
    axes.set_xlim(low, high)
    axes.set_ylim(low, high)
    style.legend(figure, [axes], columns=1, extra=keys)
    rows = calibrated.fitted_packings(data)
    calibrated.footer(
        figure, data, [calibrated.count(rows)], rows["engine"], "bars: 95 % intervals", typical_errors(means)
    )
    return figure


def typical_errors(means: pd.DataFrame) -> str:
    """Root mean square of the ln errors against the measured means of the cakes, in words."""
    by = "cake" if means["pressure_kPa"].notna().any() else "distribution"
    measured = np.log(means["measured_m_kg"].to_numpy(np.float64))
    words = []
    for column, what in (("modelled_m_kg", "modelled"), ("left_out_m_kg", "predicted from the others")):
        error = np.log(means[column].to_numpy(np.float64)) - measured
        error = error[np.isfinite(error)]
        if error.size:
            percent = 100.0 * math.sqrt(float(np.mean(error**2)))
            words.append(f"{percent:.{0 if percent >= 9.95 else 1}f} % {what}")
    return f"typical error of ln(resistance) by {by}: {', '.join(words)}"


def _cake(axes: Axes, data: CalibrationData, cake: Cake) -> None:
    """Plot the measurements of a cake; markers and both ends of the bars are the table's."""
    rows, number = calibrated.of_cake(data.parity, *cake), data.shade(cake)
    measured, modelled = (rows[name].to_numpy(np.float64) for name in ("measured_m_kg", "modelled_m_kg"))
    ink = style.colour(number)
    look: dict[str, Any] = {"fmt": "none", "ecolor": ink, "elinewidth": 0.8, "capsize": 2.0, "zorder": 3}
    # a bar through its own middle: the modelled value may lie beside its interval's
    low, high = (rows[f"modelled_{end}_m_kg"].to_numpy(np.float64) for end in ("low", "high"))
    axes.errorbar(measured, 0.5 * (low + high), yerr=0.5 * (high - low), **look)
    low, high = _measured_interval(rows)
    axes.errorbar(0.5 * (low + high), modelled, xerr=0.5 * (high - low), **look)
    label = calibrated.cake_label(data, cake)
    axes.plot(measured, modelled, style.marker(number), color=ink, label=label, zorder=4, gid="modelled")


def _measured_interval(rows: pd.DataFrame) -> tuple[FloatArray, FloatArray]:
    measured, relative = (rows[name].to_numpy(np.float64) for name in ("measured_m_kg", "relative_uncertainty"))
    factor = np.exp(calibrated.reach_of(rows) * relative)
    return measured / factor, measured * factor


def _left_out(axes: Axes, data: CalibrationData, means: pd.DataFrame) -> None:
    for row, cake in zip(means.to_dict("records"), data.cakes, strict=True):
        number = data.shade(cake)
        axes.plot(
            [row["measured_m_kg"]],
            [row["left_out_m_kg"]],
            style.marker(number),
            markerfacecolor="none",
            markeredgecolor=style.colour(number),
            markeredgewidth=0.9,
            markersize=8.0,  # around the filled ones, which may be at the same place
            zorder=4,
            gid="left_out",
        )


def _limits(data: CalibrationData, means: pd.DataFrame) -> tuple[float, float]:
    """Return common ends of both axes, a little beyond all that is shown."""
    drawn = data.parity[["modelled_m_kg", "modelled_low_m_kg", "modelled_high_m_kg"]].to_numpy(np.float64).ravel()
    every = np.concatenate([drawn, means["left_out_m_kg"].to_numpy(np.float64), *_measured_interval(data.parity)])
    return float(np.nanmin(every)) / MARGIN, float(np.nanmax(every)) * MARGIN
