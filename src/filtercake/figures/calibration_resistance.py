"""Resistance against cohesion with the measured values and the chosen cohesion (paper, Fig. 10)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from filtercake.figures import calibrated, style
from filtercake.figures.calibrated import CalibrationData
from filtercake.statistics import quantile

TOGETHER = 3
"""Most distributions in one panel."""
HOLLOW = "white"
"""Markers of packings whose friction is not the curves'."""
MARGIN = 0.025
"""Of the range of cohesions, beside its ends: their markers are whole."""


def draw(data: CalibrationData) -> Figure:
    """Draw smooth models, packings and measurements of each distribution, and the calibrated cohesion."""
    names = data.measured
    groups = [names] if len(names) <= TOGETHER else [[name] for name in names]
    alone = len(groups) == 1
    rows = -(-len(groups) // 2)
    width, height = (style.MEDIUM, 4.4) if alone else (style.DOUBLE, 1.1 + 2.3 * rows)
    figure, panels = style.panels(len(groups), width=width, height=height, columns=1 if alone else 2)
    friction = calibrated.packed_friction(data)
    means = calibrated.measured_means(data)
    for axes, group in zip(panels, groups, strict=True):
        for place, csd in enumerate(group):
            _measured(axes, data, csd, means[means["csd"] == csd])
            _response(axes, data, csd, data.label(csd, 30) if alone else "_")
            _packings(axes, data, csd, friction, place)
        _chosen(axes, data)
        style.title(axes, calibrated.panel_title(data, 75) if alone else data.label(group[0]), len(group))
        _scale(axes, data, group, means)
    style.legend(figure, panels, columns=2, extra=_keys(data, friction))
    shown = calibrated.fitted_packings(data)
    notes = ["bars and bands: 95 % intervals", _friction(data, friction), "" if alone else data.title]
    calibrated.footer(figure, data, [calibrated.count(shown)], shown["engine"], *notes)
    return figure


def _friction(data: CalibrationData, friction: float) -> str:
    """Note that the packings shown have another friction than the curves; empty where they have the same."""
    if np.isclose(friction, data.friction):
        return ""
    return f"packings are those at friction {friction:g}, the nearest to the {data.friction:.3g} of the curves"


def _measured(axes: Axes, data: CalibrationData, csd: str, mean: pd.DataFrame) -> None:
    ink = style.colour(data.number(csd))
    value, low, high = (float(mean[f"measured{end}_m_kg"].iloc[0]) for end in ("", "_low", "_high"))
    axes.axhspan(low, high, color=ink, alpha=0.13, linewidth=0.0, zorder=0, gid="measured_interval")
    axes.axhline(value, color=ink, linewidth=0.9, linestyle=(0, (4, 2)), zorder=1, gid="measured")


def _response(axes: Axes, data: CalibrationData, csd: str, label: str) -> None:
    rows = data.response[(data.response["csd"] == csd) & np.isclose(data.response["friction"], data.friction)]
    cohesion, resistance, error = (
        rows[name].to_numpy(np.float64) for name in ("cohesion_kJ_m3", "resistance_m_kg", "relative_error")
    )
    ink, reach = style.colour(data.number(csd)), np.exp(quantile() * error)
    axes.fill_between(
        cohesion, resistance / reach, resistance * reach, color=ink, alpha=0.3, linewidth=0.0, zorder=2, gid="band"
    )
    axes.plot(cohesion, resistance, color=ink, label=label, zorder=2.5, gid="response")


def _packings(axes: Axes, data: CalibrationData, csd: str, friction: float, place: int) -> None:
    means = calibrated.packed_at(data, csd, friction)
    columns = ("cohesion_kJ_m3", "resistance_m_kg", "resistance_ci95_m_kg")
    # in the middle of its places: the crosses of failed points find their row, and nothing moves sideways
    index = data.number(csd)
    style.error_line(axes, means, *columns, label="_", index=index, place=place, count=2 * place + 1)
    for drawn in axes.containers[-1:]:
        if isinstance(drawn, ErrorbarContainer):  # the smooth model joins them
            drawn.lines[0].set(linestyle="none", markersize=4.0)
            if not np.isclose(friction, data.friction):
                drawn.lines[0].set_markerfacecolor(HOLLOW)


def _chosen(axes: Axes, data: CalibrationData) -> None:
    value, low, high = data.cohesion
    axes.axvspan(low, high, color=style.FAINT, alpha=0.18, linewidth=0.0, zorder=0, gid="interval")
    axes.axvline(value, color=style.INK, linewidth=0.9, zorder=1, gid="chosen")


def _scale(axes: Axes, data: CalibrationData, group: list[str], means: pd.DataFrame) -> None:
    own = data.response[data.response["csd"].isin(group)]
    shown = np.concatenate([own["resistance_m_kg"].to_numpy(np.float64), means["measured_m_kg"].to_numpy(np.float64)])
    style.resistance_axis(axes, shown, log=True)
    low, high = float(own["cohesion_kJ_m3"].min()), float(own["cohesion_kJ_m3"].max())
    axes.set_xlim(low - MARGIN * (high - low), high + MARGIN * (high - low))
    axes.set_xlabel(style.COHESION)


def _keys(data: CalibrationData, friction: float) -> list[Line2D]:
    """Entries for what looks alike for every distribution."""
    cohesion = calibrated.with_interval(*data.cohesion, unit=" kJ/m³")
    packings: dict[str, Any] = {"color": style.FAINT, "marker": "o", "linewidth": 0.0}
    if not np.isclose(friction, data.friction):
        packings["markerfacecolor"] = HOLLOW
    return [
        style.key(f"cohesion {cohesion}", color=style.INK, linewidth=0.9),
        style.key("measured, mean with 95 % band", color=style.FAINT, linestyle=(0, (4, 2)), linewidth=0.9),
        style.key(f"packings at friction {friction:g}, mean and 95 %", **packings),
        style.key(f"smooth model at friction {data.friction:.3g}, 95 % band", color=style.FAINT),
    ]
