"""Resistance against cohesion (paper, Fig. 10) or friction, with the measured values and the calibrated one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from filtercake.calibration.rounds import Cake
from filtercake.figures import calibrated, style
from filtercake.figures.calibrated import CalibrationData
from filtercake.statistics import quantile

TOGETHER = 3
"""Most distributions in one panel."""
HOLLOW = "white"
"""Markers of packings that are not of the curves' friction or adhesion."""
MARGIN = 0.025
"""Of the abscissa's range, beside its ends: their markers are whole."""


def draw(data: CalibrationData) -> Figure:
    """Draw smooth models, packings and measurements of each cake, and the calibrated value."""
    groups = _groups(data)
    alone = len(groups) == 1
    rows = -(-len(groups) // 2)
    width, height = (style.MEDIUM, 4.4) if alone else (style.DOUBLE, 1.1 + 2.3 * rows)
    figure, panels = style.panels(len(groups), width=width, height=height, columns=1 if alone else 2)
    level = calibrated.packed_level(data)
    means = calibrated.measured_means(data)
    for axes, group in zip(panels, groups, strict=True):
        for place, cake in enumerate(group):
            _measured(axes, data, cake, calibrated.of_cake(means, *cake))
            _response(axes, data, cake, _label(data, cake, alone))
            _packings(axes, data, cake, level, place)
        _chosen(axes, data)
        style.title(axes, calibrated.panel_title(data, 75) if alone else data.label(group[0][0]), len(group))
        _scale(axes, data, group, means)
    style.legend(figure, panels, columns=2, extra=_keys(data, level))
    shown = calibrated.fitted_packings(data)
    notes = ["bars and bands: 95 % intervals", _other(data, level), "" if alone else data.title]
    calibrated.footer(figure, data, [calibrated.count(shown)], shown["engine"], *notes)
    return figure


def _groups(data: CalibrationData) -> list[list[Cake]]:
    """Cakes of each panel: all in one where they are few, those of one distribution otherwise."""
    if len(data.cakes) <= TOGETHER:
        return [data.cakes]
    return [[cake for cake in data.cakes if cake[0] == csd] for csd in data.measured]


def _label(data: CalibrationData, cake: Cake, alone: bool) -> str:
    if alone:
        return calibrated.cake_label(data, cake, 30)
    return "_" if cake[1] is None else f"{cake[1]:g} kPa, {data.label(cake[0], 30)}"


def _other(data: CalibrationData, level: float) -> str:
    """Note that the packings shown are not of the curves' friction or adhesion; empty where they are."""
    if np.isclose(level, data.held):
        return ""
    return (
        f"packings are those at {calibrated.held_words(data, level)}, the nearest to the {data.held:.3g} of the curves"
    )


def _measured(axes: Axes, data: CalibrationData, cake: Cake, mean: pd.DataFrame) -> None:
    ink = style.colour(data.shade(cake))
    value, low, high = (float(mean[f"measured{end}_m_kg"].iloc[0]) for end in ("", "_low", "_high"))
    axes.axhspan(low, high, color=ink, alpha=0.13, linewidth=0.0, zorder=0, gid="measured_interval")
    axes.axhline(value, color=ink, linewidth=0.9, linestyle=(0, (4, 2)), zorder=1, gid="measured")


def _response(axes: Axes, data: CalibrationData, cake: Cake, label: str) -> None:
    own = calibrated.of_cake(data.response, *cake)
    rows = own[np.isclose(own[data.beside], data.held)]
    along, resistance, error = (
        rows[name].to_numpy(np.float64) for name in (data.axis, "resistance_m_kg", "relative_error")
    )
    ink, reach = style.colour(data.shade(cake)), np.exp(quantile() * error)
    axes.fill_between(
        along, resistance / reach, resistance * reach, color=ink, alpha=0.3, linewidth=0.0, zorder=2, gid="band"
    )
    axes.plot(along, resistance, color=ink, label=label, zorder=2.5, gid="response")


def _packings(axes: Axes, data: CalibrationData, cake: Cake, level: float, place: int) -> None:
    means = calibrated.packed_at(data, cake, level)
    columns = (data.axis, "resistance_m_kg", "resistance_ci95_m_kg")
    # in the middle of its places: the crosses of failed points find their row, and nothing moves sideways
    index = data.shade(cake)
    style.error_line(axes, means, *columns, label="_", index=index, place=place, count=2 * place + 1)
    for drawn in axes.containers[-1:]:
        if isinstance(drawn, ErrorbarContainer):  # the smooth model joins them
            drawn.lines[0].set(linestyle="none", markersize=4.0)
            if not np.isclose(level, data.held):
                drawn.lines[0].set_markerfacecolor(HOLLOW)


def _chosen(axes: Axes, data: CalibrationData) -> None:
    value, low, high = data.found
    axes.axvspan(low, high, color=style.FAINT, alpha=0.18, linewidth=0.0, zorder=0, gid="interval")
    axes.axvline(value, color=style.INK, linewidth=0.9, zorder=1, gid="chosen")


def _scale(axes: Axes, data: CalibrationData, group: list[Cake], means: pd.DataFrame) -> None:
    own = data.response[data.response["csd"].isin([csd for csd, _ in group])]
    shown = np.concatenate([own["resistance_m_kg"].to_numpy(np.float64), means["measured_m_kg"].to_numpy(np.float64)])
    style.resistance_axis(axes, shown, log=True)
    low, high = float(own[data.axis].min()), float(own[data.axis].max())
    axes.set_xlim(low - MARGIN * (high - low), high + MARGIN * (high - low))
    axes.set_xlabel(style.AXES[data.axis])


def _keys(data: CalibrationData, level: float) -> list[Line2D]:
    """Entries for what looks alike for every cake."""
    packings: dict[str, Any] = {"color": style.FAINT, "marker": "o", "linewidth": 0.0}
    if not np.isclose(level, data.held):
        packings["markerfacecolor"] = HOLLOW
    return [
        style.key(calibrated.found_words(data, data.axis), color=style.INK, linewidth=0.9),
        style.key("measured, mean with 95 % band", color=style.FAINT, linestyle=(0, (4, 2)), linewidth=0.9),
        style.key(f"packings at {calibrated.held_words(data, level)}, mean and 95 %", **packings),
        style.key(f"smooth model at {calibrated.held_words(data, data.held)}, 95 % band", color=style.FAINT),
    ]
