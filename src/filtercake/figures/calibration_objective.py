"""Deviance of each value of the fitted properties from the measurements, and the findings about the fit."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from filtercake.figures import calibrated, style
from filtercake.figures.calibrated import CalibrationData
from filtercake.units import FloatArray

LEAST_HEIGHT, MOST_HEIGHT = 6.0, 20.0
"""Deviances at the top of the axes; the threshold is always seen, and so is the minimum."""
ABOVE = 1.08
"""Top of the axes over a threshold that is higher than that."""
LEVELS = (0.0, 1.0, 2.0, 6.0, 10.0, 15.0, MOST_HEIGHT)
DEVIANCE = "Deviance above the minimum (–)"
CHARACTERS = {False: 84, True: 66}
"""Of a line of findings, without and with a scale of colours beside the axes."""
LINE_HEIGHT = 0.135
"""Of a line of findings, in."""


def draw(data: CalibrationData) -> Figure:
    """Draw the deviance against the fitted property, or over both, with the 95 % interval or region."""
    findings = _findings(data)
    height = 4.3 if data.fits_both else 3.9
    figure, (axes,) = style.panels(width=style.MEDIUM, height=height + LINE_HEIGHT * len(findings))
    axes.set_title(calibrated.panel_title(data, 75), loc="left")
    axes.set_xlabel(style.AXES[data.axis])
    (_contours if data.fits_both else _curves)(axes, data)
    style.legend(figure, [axes], columns=1)
    _say(axes, findings)
    rows = calibrated.fitted_packings(data, rivals=True)
    notes = ["deviance: −2 ln(likelihood)", _squares(data)]
    if len(data.summary["rivals"]) > 1:
        notes.append("each curve less its own minimum, which is marked")
    calibrated.footer(figure, data, [calibrated.count(rows)], rows["engine"], *notes)
    return figure


def _curves(axes: Axes, data: CalibrationData) -> None:
    beside = data.objective[data.beside].to_numpy(np.float64)
    # the one taken is in front of its rivals, and the first of the legend
    ranked = sorted(dict.fromkeys(beside.tolist()), key=lambda level: not np.isclose(level, data.held))
    for index, level in enumerate(ranked):
        rows = data.objective[np.isclose(beside, level)]
        along, deviance = (rows[name].to_numpy(np.float64) for name in (data.axis, "deviance"))
        main, ink = index == 0, style.colour(index)
        axes.plot(
            along,
            deviance,
            color=ink,
            linewidth=1.6 if main else 1.0,
            linestyle="-" if main else (0, (5, 1.5)),
            label=_label(data, level),
            zorder=3.0 - 0.1 * index,
            gid="deviance",
        )
        if not main:
            best = data.summary["rivals"][f"{level:g}"][data.axis]
            axes.plot([best], [0.0], style.marker(index), color=ink, clip_on=False, zorder=4, gid="rival")
    axes.plot(
        [data.found[0]],
        [0.0],
        style.marker(0),
        color=style.colour(0),
        markeredgecolor=style.INK,
        markersize=6.0,
        clip_on=False,
        label=f"best {calibrated.found_words(data, data.axis)}",
        zorder=5,
        gid="best",
    )
    _interval(axes, data)
    threshold = float(data.summary["threshold"])
    axes.axhline(
        threshold,
        color=style.INK,
        linewidth=0.9,
        linestyle=(0, (1, 1.5)),
        label=f"95 % threshold of one parameter ({threshold:.3g})",
        gid="threshold",
    )
    highest = float(data.objective["deviance"].max())
    axes.set_ylim(0.0, max(min(max(1.05 * highest, LEAST_HEIGHT), MOST_HEIGHT), ABOVE * threshold))
    axes.set_xlim(float(data.objective[data.axis].min()), float(data.objective[data.axis].max()))
    axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    axes.set_ylabel(DEVIANCE)


def _label(data: CalibrationData, level: float) -> str:
    rivals = data.summary["rivals"]
    chosen = " (taken)" if len(rivals) > 1 and np.isclose(level, data.held) else ""
    return f"{calibrated.held_words(data, level)}{chosen}: χ² = {rivals[f'{level:g}']['chi_square']:.1f}"


def _squares(data: CalibrationData) -> str:
    freedom = max(data.summary["degrees_of_freedom"], 0)
    value = f"χ² = {data.summary['chi_square']:.1f}" if data.fits_both else "χ²"
    return f"{value} with {freedom or 'no'} degree{'s' if freedom > 1 else ''} of freedom"


def _interval(axes: Axes, data: CalibrationData) -> None:
    """Shade the values in the 95 % interval, each of its stretches on its own."""
    rows = data.objective[np.isclose(data.objective[data.beside], data.held)]
    along, deviance = (rows[name].to_numpy(np.float64) for name in (data.axis, "deviance"))
    ends = stretches(along, deviance, float(data.summary["threshold"]))
    look: dict[str, Any] = {"color": style.colour(0), "alpha": 0.13, "linewidth": 0.0, "zorder": 0}
    for low, high in ends:
        axes.axvspan(low, high, label="95 % interval", gid="interval", **look)


def stretches(values: FloatArray, deviance: FloatArray, threshold: float) -> list[tuple[float, float]]:
    """Return the ends of every stretch in which a deviance on a grid is under a threshold, ascending."""
    excess = deviance - threshold
    inside = np.concatenate([[False], excess <= 0.0, [False]])
    first, last = np.flatnonzero(~inside[:-1] & inside[1:]), np.flatnonzero(inside[:-1] & ~inside[1:]) - 1

    def crossing(within: int, beyond: int) -> float:
        if not 0 <= beyond < values.size:
            return float(values[within])
        share = excess[within] / (excess[within] - excess[beyond])
        return float(values[within] + share * (values[beyond] - values[within]))

    return [(crossing(int(a), int(a) - 1), crossing(int(b), int(b) + 1)) for a, b in zip(first, last, strict=True)]


def _contours(axes: Axes, data: CalibrationData) -> None:
    table = data.objective.pivot(index=data.beside, columns=data.axis, values="deviance")
    grid = (table.columns.to_numpy(np.float64), table.index.to_numpy(np.float64), table.to_numpy(np.float64))
    threshold = float(data.summary["threshold"])
    filled = axes.contourf(*grid, levels=sorted({*LEVELS, threshold}), cmap="Blues", extend="max")
    bar = axes.figure.colorbar(filled, ax=axes, label=DEVIANCE, pad=0.02)
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))
    if grid[2].max() > threshold:
        axes.contour(*grid, levels=[threshold], colors=style.INK, linewidths=1.1).set_gid("region")
        axes.plot(
            [], [], color=style.INK, linewidth=1.1, label=f"95 % region of one parameter (deviance {threshold:.3g})"
        )
    along, beside = data.found, data.estimate(data.beside)
    _edges(axes, along, beside)
    axes.plot(
        [along[0]],
        [beside[0]],
        style.marker(0),
        color=style.colour(1),
        markeredgecolor=style.INK,
        markersize=6.0,
        clip_on=False,
        label=f"best: {calibrated.found_words(data, data.axis)},\n{calibrated.found_words(data, data.beside)}",
        zorder=5,
        gid="best",
    )
    axes.set_ylabel(style.AXES[data.beside])


def _edges(axes: Axes, along: tuple[float, float, float], beside: tuple[float, float, float]) -> None:
    """Draw the 95 % intervals of both parameters along the axes."""
    look: dict[str, Any] = {"color": style.colour(1), "linewidth": 3.0, "solid_capstyle": "butt", "clip_on": False}
    look |= {"zorder": 4, "gid": "interval"}
    axes.plot(along[1:], [0.0, 0.0], transform=axes.get_xaxis_transform(), label="95 % intervals", **look)
    axes.plot([0.0, 0.0], beside[1:], transform=axes.get_yaxis_transform(), **look)


def _findings(data: CalibrationData) -> list[str]:
    """Lines of the findings, each finding a sentence."""
    lines = []
    for finding in data.summary["findings"]:
        sentence = f"• {finding['text'][:1].upper()}{finding['text'][1:]}."
        lines += textwrap.wrap(sentence, CHARACTERS[data.fits_both], subsequent_indent="   ")
    return lines


def _say(axes: Axes, lines: list[str]) -> None:
    """Write the findings under the abscissa's label, where the layout makes room for them."""
    if lines:
        axes.annotate(
            "\n".join(lines),
            (0.0, 0.0),
            xycoords=(axes.transAxes, axes.xaxis.label),
            xytext=(0.0, -5.0),
            textcoords="offset points",
            ha="left",
            va="top",
            fontsize=7.0,
            color=style.INK,
            linespacing=1.25,
            annotation_clip=False,
            gid="findings",
        )
