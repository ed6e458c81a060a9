"""Specific cake resistance against pressure drop: how compressible the cakes are, and the calibrated packings."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from filtercake.calibration.measurements import Measurement, compressibility_by_csd, with_pressure
from filtercake.figures import style
from filtercake.figures.calibrated import CalibrationData, with_interval
from filtercake.filtration.constant_pressure import CompressibilityFit
from filtercake.statistics import quantile
from filtercake.units import KILOPASCAL

BEYOND = 1.12
"""Factor by which a line extends beyond the lowest and the highest pressure."""
MOST_DIGITS = 3
"""Digits behind the point of an exponent, at most."""
LINE, BAND, PACKED = "line", "band", "packed"
ENTRY_HEIGHT = 0.1
"""Of an entry of the legend, in."""


def draw(data: CalibrationData) -> Figure:
    """Draw every distribution's resistances over pressure, with a power law where there are several pressures.

    Beside them, where the packings know pressures, what they have at the calibrated parameters.
    """
    measurements = data.measurements
    series = {} if measurements is None else with_pressure(measurements)
    modelled = pd.DataFrame() if data.pressures is None else data.pressures
    figure, (axes,) = style.panels(width=style.MEDIUM, height=3.4 + ENTRY_HEIGHT * 2 * len(modelled))
    if measurements is None or not series:
        style.nothing(axes, "no resistance is given with its pressure")
        return figure
    fits = compressibility_by_csd(measurements)
    for index, (csd, entries) in enumerate(series.items()):
        _series(axes, csd, entries, fits.get(csd), index, len(series))
    for row in modelled.to_dict("records"):
        _packings(axes, data, row, list(series).index(str(row["csd"])))
    alpha = np.array([entry.resistance for entries in series.values() for entry in entries])
    style.resistance_axis(axes, alpha, log=True)
    _pressure_axis(axes, [entry.pressure_drop or np.nan for entries in series.values() for entry in entries])
    _widen(axes)
    style.legend(figure, [axes], columns=1 if len(series) < 4 or len(modelled) else 2)
    style.footer(figure, pd.DataFrame(), *_notes(fits))
    return figure


def _notes(fits: dict[str, CompressibilityFit]) -> list[str]:
    notes = ["error bars: 95 % intervals by each resistance's own error"]
    if fits:
        notes.append("α ∝ Δpᵏ; bands and ±: 95 % intervals of the line and of k")
    return notes + [f"{csd}: {note}" for csd, fit in fits.items() for note in fit.notes]


def _series(
    axes: Axes, csd: str, entries: Sequence[Measurement], fit: CompressibilityFit | None, index: int, count: int
) -> None:
    pressure = np.array([entry.pressure_drop or np.nan for entry in entries])
    alpha = np.array([entry.resistance for entry in entries])
    factor = np.exp(quantile() * np.array([entry.relative_se for entry in entries]))
    ink = style.colour(index)
    drawn = axes.errorbar(
        pressure / KILOPASCAL,
        alpha,
        yerr=np.stack([alpha - alpha / factor, alpha * factor - alpha]),
        fmt=style.marker(index),
        color=ink,
        capsize=2.0,
        elinewidth=0.8,
        label=_label(csd, fit),
        zorder=3,
    )
    style.shift(drawn.get_children(), axes, index, count)
    if fit is None:
        return
    along = np.geomspace(pressure.min() / BEYOND, pressure.max() * BEYOND, 101)
    value, low, high = fit.resistance_at(along)
    axes.plot(along / KILOPASCAL, value, color=ink, gid=LINE, zorder=2)
    if np.isfinite(low).all():
        axes.fill_between(along / KILOPASCAL, low, high, color=ink, alpha=0.18, linewidth=0.0, gid=BAND, zorder=1)


def _packings(axes: Axes, data: CalibrationData, row: dict[Hashable, Any], index: int) -> None:
    """Plot a distribution's calibrated packings at the measured pressures, with their 95 % intervals."""
    own = data.parity[data.parity["csd"] == row["csd"]].drop_duplicates("pressure_kPa").sort_values("pressure_kPa")
    pressure, value, low, high = (
        own[name].to_numpy(np.float64)
        for name in ("pressure_kPa", "modelled_m_kg", "modelled_low_m_kg", "modelled_high_m_kg")
    )
    ends = [row[f"exponent_modelled{end}"] for end in ("", "_low", "_high")]
    ink: Any = style.colour(index)
    axes.plot(
        pressure,
        value,
        style.marker(index),
        linestyle=(0, (4, 1.5)),
        linewidth=1.0,
        color=ink,
        markerfacecolor="white",
        label=f"{row['csd']}, calibrated packings: k = {with_interval(*ends)}".replace(" -", " −"),
        gid=PACKED,
        zorder=2.5,
    )
    axes.vlines(pressure, low, high, color=ink, linewidth=0.8, linestyle=(0, (2, 1)), zorder=2.4, gid=PACKED)


def _label(csd: str, fit: CompressibilityFit | None) -> str:
    if fit is None:
        return csd
    half = fit.exponent_ci95
    if np.isnan(half):
        return f"{csd}: k = {fit.exponent:.2f} (no interval)".replace("= -", "= −")
    digits = min(max(1 - math.floor(math.log10(half)), 0), MOST_DIGITS) if half > 0.0 else MOST_DIGITS
    return f"{csd}: k = {fit.exponent:.{digits}f} ± {half:.{digits}f}".replace("= -", "= −")


def _pressure_axis(axes: Axes, pressure: Sequence[float]) -> None:
    axes.set_xscale("log")
    wide = max(pressure) > 20.0 * min(pressure)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if wide else (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("Pressure drop Δp (kPa)")
    axes.set_xlim(min(pressure) / KILOPASCAL / BEYOND**2, max(pressure) / KILOPASCAL * BEYOND**2)


def _widen(axes: Axes) -> None:
    """Show at least a factor of two, so that the scatter of an incompressible cake does not look like a trend."""
    low, high = axes.get_ylim()
    if high < 2.0 * low:
        middle = np.sqrt(low * high)
        axes.set_ylim(middle / np.sqrt(2.0), middle * np.sqrt(2.0))
