"""Pressed cakes: porosity and resistance against friction, or against adhesion where that alone varies."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from filtercake.figures import selection, style
from filtercake.figures.selection import StudyData
from filtercake.packing.scene import FILTRATION_PROTOCOL
from filtercake.study.points import base_rows

FRICTION, ADHESION = "friction", "adhesion_mJ_m2"
FREE: Final = (FRICTION, ADHESION)
QUANTITIES: Final = (("porosity", "porosity_ci95"), ("resistance_m_kg", "resistance_ci95_m_kg"))


def draw(data: StudyData) -> Figure:
    """Draw both quantities with their 95 % intervals, one line per distribution and value of the other property."""
    rows = _rows(data)
    along = FRICTION if rows[FRICTION].nunique() > 1 or rows.empty else ADHESION
    figure, panels = style.panels(2, width=style.SINGLE, height=5.4)
    lines = list(_lines(data, rows, along))
    for axes, (name, interval) in zip(panels, QUANTITIES, strict=True):
        for index, (label, line) in enumerate(lines):
            style.error_line(axes, line, along, name, interval, label=label, index=index, place=index, count=len(lines))
        axes.set_xlabel(style.AXES[along])
    if not lines:
        style.nothing(panels[0], "no distribution with more than one friction or adhesion")
    _scales(panels, rows)
    style.legend(figure, panels, columns=1)
    pressures = sorted(float(value) for value in rows["pressure_kPa"].unique())
    notes = [f"at {', '.join(f'{value:g}' for value in pressures)} kPa"] if pressures else []
    style.footer(figure, rows, "error bars: 95 % intervals of the mean", *notes, selection.law_note(data))
    return figure


def _rows(data: StudyData) -> pd.DataFrame:
    """Pressed points at the base, but for friction and adhesion; those that stick by a cohesion are left out."""
    rows = base_rows(data.study, data.summary, FREE)
    rows = rows[(rows["protocol"] == FILTRATION_PROTOCOL) & rows[ADHESION].notna()]
    own = data.study.base("pressure_kPa")
    # without a pressure of its own a study's first stands for it
    return rows if rows.empty or own is not None else rows[rows["pressure_kPa"] == rows["pressure_kPa"].iloc[0]]


def _lines(data: StudyData, rows: pd.DataFrame, along: str) -> Iterator[tuple[str, pd.DataFrame]]:
    other = ADHESION if along == FRICTION else FRICTION
    for csd in data.study.csds:
        own = rows[rows["csd"] == csd]
        for value in sorted(own[other].unique()):
            line = own[own[other] == value].sort_values(along)
            if line[along].nunique() > 1:
                unit = " mJ/m²" if other == ADHESION else ""
                word = "adhesion" if other == ADHESION else "friction"
                yield f"{selection.label(data, csd)}, {word} {value:g}{unit}", line


def _scales(panels: list[Axes], rows: pd.DataFrame) -> None:
    panels[0].set_ylabel(style.POROSITY)
    values = rows["resistance_m_kg"].to_numpy(np.float64)
    style.resistance_axis(panels[1], values if np.isfinite(values).any() else np.ones(1), log=True)
