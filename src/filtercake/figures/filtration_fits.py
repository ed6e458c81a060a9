"""Constant-pressure filtration tests: t/V against V with the lines of both forms, one panel per test."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from filtercake.calibration.measurements import VOLUME_UNITS, Measurements
from filtercake.figures import style
from filtercake.filtration.analysis import FiltrationAnalysis
from filtercake.filtration.constant_pressure import BoolArray, FiltrationTest, disagreement
from filtercake.units import KILOPASCAL

MOST_PANELS = 24
MOST_READINGS = 500
"""Readings drawn in one panel."""
LITRES_FROM = 5e-3
"""Largest volume (m3) from which volumes are shown in L, not mL."""
HEADROOM = 1.5
"""Height of a panel over what the fit reaches; readings that were left out and lie above are drawn at its edge."""
LONGEST_NAME, LONGEST_OF_THREE = 40, 26
"""Characters of a name that a panel's title has room for, and where three panels stand side by side."""
MOST_DIGITS = 3
"""Digits behind the point of a result, at most."""
USED, LEFT_OUT, ABOVE = "used", "left out", "above"
INTEGRAL, DIFFERENTIAL, BAND = "integral", "differential", "band"


def draw(measurements: Measurements) -> Figure:
    """Draw one panel per test; readings left out of the integral form's fit are hollow."""
    shown = list(zip(measurements.tests, measurements.results, strict=True))[:MOST_PANELS]
    columns = 1 if len(shown) < 2 else 2 if len(shown) < 5 else 3
    rows = -(-max(len(shown), 1) // columns)
    width = style.SINGLE if columns == 1 else style.DOUBLE
    figure, panels = style.panels(max(len(shown), 1), width=width, height=0.9 + 2.3 * rows, columns=columns)
    if not shown:
        style.nothing(panels[0], "no filtration test among the measurements")
        return figure
    largest = max(float(test.volume.max()) for test, _ in shown)
    unit = "L" if largest >= LITRES_FROM else "mL"
    for k, (axes, (test, found)) in enumerate(zip(panels, shown, strict=True)):
        _panel(axes, test, found, unit, columns)
        if k >= len(shown) - columns:
            axes.set_xlabel(f"Filtrate volume V ({unit})")
        if k % columns == 0:
            axes.set_ylabel(f"t/V (s/{unit})")
    style.legend(figure, panels, columns=2 if columns == 1 else 3)
    style.footer(figure, pd.DataFrame(), *_notes(measurements, len(shown), panels))
    return figure


def _notes(measurements: Measurements, shown: int, panels: list[Axes]) -> list[str]:
    notes = ["α and Rₘ with half-widths of 95 % intervals"]
    if any(line.get_gid() == ABOVE for axes in panels for line in axes.get_lines()):
        notes.append("hollow triangles: left out, above the panel")
    if any(test.time.size > MOST_READINGS for test in measurements.tests):
        notes.append("of very many readings only some are drawn")
    pairs = list(zip(measurements.tests, measurements.results, strict=True))
    apart = [test.name for test, found in pairs if disagreement(found.integral, found.differential)]
    shifted = [f"{test.name} ({found.time_zero:.3g} s)" for test, found in pairs if found.time_zero != 0.0]
    if shifted:
        notes.append(f"time zero fitted: {', '.join(shifted)}")
    if apart:
        notes.append(f"integral and differential form disagree: {', '.join(apart)}")
    if len(measurements.tests) > shown:
        notes.append(f"{len(measurements.tests) - shown} more tests are not shown")
    return notes


def _panel(axes: Axes, test: FiltrationTest, found: FiltrationAnalysis, unit: str, columns: int) -> None:
    scale = VOLUME_UNITS[unit]
    largest = float(test.volume.max())
    volume = np.linspace(0.0, largest, 201)[1:]
    # from its first reading on: nearer to V = 0 its own beginning, t0/V, grows without bound
    own = volume[volume >= test.volume[found.differential.kept][0]]
    if found.time_zero != 0.0:
        volume = own
    line, half = (values * scale for values in found.integral.time_per_volume(volume))
    other = found.differential.time_per_volume(own)[0] * scale
    top = _readings(axes, test, found.integral.kept, float(max((line + half)[-1], other[-1])), scale)
    x, ink = volume / scale, style.colour(0)
    axes.plot(x, line, color=ink, label="integral form", gid=INTEGRAL, zorder=2)
    axes.fill_between(
        x, line - half, line + half, color=ink, alpha=0.2, linewidth=0.0, label="its 95 % interval", gid=BAND, zorder=1
    )
    axes.plot(own / scale, other, "--", color=style.colour(1), label="differential form", gid=DIFFERENTIAL, zorder=2)
    axes.set_xlim(0.0, 1.04 * largest / scale)
    axes.set_ylim(min(0.0, 1.05 * float((line - half).min())), top)
    room = LONGEST_NAME if columns < 3 else LONGEST_OF_THREE
    below = _short(test.csd, room - 10)  # beside the pressure
    axes.set_title(f"{_short(test.name, room)}\n{below}, {test.pressure_drop / KILOPASCAL:g} kPa", loc="left")
    results = "\n".join(_results(found))
    size = 7.0 if columns < 3 else 6.2
    axes.text(0.98, 0.03, results, transform=axes.transAxes, ha="right", va="bottom", fontsize=size)


def _readings(axes: Axes, test: FiltrationTest, kept: BoolArray, reach: float, scale: float) -> float:
    """Plot the readings, an even choice where there are very many; return the upper limit of the panel."""
    chosen = slice(None, None, -(-test.volume.size // MOST_READINGS))
    x, y, kept = (test.volume / scale)[chosen], (test.time / test.volume * scale)[chosen], kept[chosen]
    fitted = 1.06 * max(reach, float(y[kept].max()))
    top = max(fitted, min(1.06 * float(y.max()), HEADROOM * fitted))
    above = ~kept & (y > top)
    beside = ~kept & ~above
    ink: dict[str, Any] = {"color": style.INK, "markersize": 3.2, "linewidth": 0.0, "zorder": 3.0}
    hollow = {**ink, "markerfacecolor": "white", "markeredgewidth": 0.8}
    axes.plot(x[kept], y[kept], marker="o", label="readings used", gid=USED, **ink)
    if beside.any():
        axes.plot(x[beside], y[beside], marker="o", label="readings left out", gid=LEFT_OUT, **hollow)
    if above.any():
        edge = np.full(int(above.sum()), top)
        axes.plot(x[above], edge, marker="^", clip_on=False, label="readings left out", gid=ABOVE, **hollow)
    return top


def _short(name: str, room: int) -> str:
    return name if len(name) <= room else name[: room - 1] + "…"


def _results(found: FiltrationAnalysis) -> list[str]:
    return [
        f"α = {with_interval(found.resistance, found.resistance_ci95)} m/kg",
        f"Rₘ = {with_interval(found.medium_resistance, found.medium_resistance_ci95)} 1/m",
    ]


def with_interval(value: float, half: float) -> str:
    """Write a value and its half-width, with two digits of the latter, in a power of ten."""
    largest = max(abs(value), half)
    if not (math.isfinite(value + half) and largest > 0.0):
        return f"{value:.4g} ± {half:g}".replace("nan", "–")
    exponent = math.floor(math.log10(largest))
    scaled, reach = value / 10.0**exponent, half / 10.0**exponent
    digits = min(max(1 - math.floor(math.log10(reach)), 0), MOST_DIGITS) if reach > 0.0 else MOST_DIGITS
    return f"({scaled:.{digits}f} ± {reach:.{digits}f})·{style.power_of_ten(exponent)}".replace("-", "−")
