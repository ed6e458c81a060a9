"""Resistance by the study's law against porosity, with our porosities and published values on it (paper, Fig. 8)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from filtercake.figures import selection, style
from filtercake.figures.selection import StudyData
from filtercake.filtration.resistance import law_of, resistance
from filtercake.packing.engines import label_of
from filtercake.study.config.published import Published
from filtercake.study.points import base_rows

MARGIN = 0.025
"""Porosity drawn beyond the outermost value."""
WIDEST = 0.05
"""The axis makes room for an interval up to this half-width."""
TYPICAL = (0.32, 0.42)


def draw(data: StudyData) -> Figure:
    """Draw one curve per distribution (the study's law, full distribution), our mean and its 95 % interval on it."""
    figure, (axes,) = style.panels(width=style.MEDIUM, height=3.9)
    rows = selection.base_points(data)
    names = list(rows["csd"]) or list(data.csds)
    shown = [value.value for name in names for value in selection.published(data, name, "porosity")]
    reach = rows["porosity_ci95"].fillna(0.0).clip(upper=WIDEST)
    shown += [*(rows["porosity"] - reach).dropna(), *(rows["porosity"] + reach).dropna()]
    low, high = (min(shown) - MARGIN, max(shown) + MARGIN) if shown else TYPICAL
    porosity = np.linspace(max(low, 0.02), min(high, 0.98), 201)
    highest = []
    for name in names:
        curve = np.array([_resistance(data, name, value) for value in porosity])
        highest.append(curve.max())
        axes.plot(porosity, curve, color=_ink(data, name), label=selection.label(data, name), zorder=2)
    axes.set_xlim(porosity[0], porosity[-1])
    axes.set_ylim(0.0, 1.02 * max(highest))
    for _, row in rows.iterrows():
        _ours(axes, data, row)
    others = [key for engine, own in _others(data) for key in _other(axes, data, engine, own)]
    published = [key for name in names for key in _published(axes, data, name)]
    style.resistance_axis(axes, np.array(highest))
    axes.set_xlabel(style.POROSITY)
    ours = style.key("this work, 95 % interval", color=style.FAINT, marker="o", linewidth=0.0)
    style.legend(figure, [axes], extra=[ours, *others, *published] if rows["porosity"].notna().any() else published)
    notes = [f"curves: {selection.law_title(data.study.resistance_law)} with the full distribution"]
    if any(line.get_gid() == "published" and np.min(line.get_ydata()) == 0.0 for line in axes.get_lines()):
        notes.append("markers on the abscissa: no resistance published")
    if any(value.low is not None for name in names for value in selection.published(data, name, "resistance_m_kg")):
        notes.append("dotted: only a range follows from the text")
    if rows.empty:
        notes.append("no point at the base material")
    style.footer(figure, rows, *notes)
    return figure


def _resistance(data: StudyData, csd: str, porosity: float) -> float:
    material, law = data.study.material, data.study.resistance_law
    constant = _solved_constant(data, csd) if law_of(law).needs_kozeny_constant else None
    return resistance(law, porosity, data.csds[csd][0], material.density, material.sphericity, constant)


def _solved_constant(data: StudyData, csd: str) -> float:
    """Kozeny constant of the base point of a distribution, the mean of all its points where there is none."""
    rows = data.summary[data.summary["csd"] == csd]
    base = base_rows(data.study, rows)
    found = (base if base["kozeny_constant"].notna().any() else rows)["kozeny_constant"]
    return float(found.mean())


def _ink(data: StudyData, csd: str) -> str:
    return style.colour(selection.number(data, csd))


def _ours(axes: Axes, data: StudyData, row: pd.Series[Any]) -> None:
    """Plot our mean; its interval as a band from the porosity up to the curve and along it to the resistance."""
    mean, half = float(row["porosity"]), float(row["porosity_ci95"])
    ink = _ink(data, str(row["csd"]))
    if not np.isfinite(mean):
        return
    if np.isfinite(half):
        low, high = np.clip([mean - half, mean + half], *axes.get_xlim())
        inside = np.linspace(low, high, 21)
        on_curve = np.array([_resistance(data, str(row["csd"]), value) for value in inside])
        left = np.array([axes.get_xlim()[0], inside[0]])
        axes.fill_between(inside, 0.0, on_curve, color=ink, alpha=0.2, linewidth=0.0, zorder=1)
        axes.fill_between(left, on_curve[-1], on_curve[0], color=ink, alpha=0.2, linewidth=0.0, zorder=1)
    axes.errorbar(
        [mean],
        [float(row["resistance_m_kg"])],
        xerr=[half],
        yerr=[float(row["resistance_ci95_m_kg"])],
        color=ink,
        marker="o",
        capsize=2.0,
        elinewidth=0.9,
        zorder=4,
    )


def _others(data: StudyData) -> Iterable[tuple[str, pd.DataFrame]]:
    """List the base points by each engine beside the study's own, those with an accepted packing."""
    rows = selection.other_engines(data)
    for engine, own in rows[rows["porosity"].notna()].groupby("engine", sort=False):
        yield label_of(str(engine)), own


def _other(axes: Axes, data: StudyData, engine: str, rows: pd.DataFrame) -> list[Line2D]:
    """Plot the means by another engine, hollow; return their legend entry."""
    hollow: dict[str, Any] = {"marker": "s", "markersize": 6.5, "markerfacecolor": "none", "linewidth": 0.0}
    for _, row in rows.iterrows():
        axes.errorbar(
            [float(row["porosity"])],
            [float(row["resistance_m_kg"])],
            xerr=[float(row["porosity_ci95"])],
            color=_ink(data, str(row["csd"])),
            capsize=3.0,
            elinewidth=0.7,
            zorder=3.5,
            gid="other_engine",
            **hollow,
        )
    return [style.key(f"this work by {engine}, 95 % interval", markeredgecolor=style.FAINT, **hollow)]


def _published(axes: Axes, data: StudyData, csd: str) -> list[Line2D]:
    """Plot published pairs, a porosity without its resistance on the abscissa; return their legend entries."""
    resistances = {_origin(value): value for value in selection.published(data, csd, "resistance_m_kg")}
    keys = []
    for value in selection.published(data, csd, "porosity"):
        resistance = resistances.get(_origin(value))
        if resistance is not None and resistance.low is not None and resistance.high is not None:
            style.published_range(axes, value.value, resistance.low, resistance.high, colour=_ink(data, csd))
        else:
            height = resistance.value if resistance is not None else 0.0
            style.published_point(axes, value.value, height, value, fill=_ink(data, csd), label="_")
        shape, label = style.PUBLISHED_MARKERS[value.kind], style.published_label(value)
        keys.append(style.key(label, marker=shape, color=style.FAINT, markeredgecolor=style.INK, linewidth=0.0))
    return keys


def _origin(value: Published) -> tuple[object, ...]:
    """Key that published values of one experiment or simulation share."""
    return value.source, value.kind, value.cohesion_kJ_m3, value.friction
