"""Porosity against height in exact slices: the floor layer, the interior and the surface of the beds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from filtercake.figures import selection, style
from filtercake.figures.selection import StudyData
from filtercake.packing.porosity import porosity_profile
from filtercake.packing.result import Packing
from filtercake.packing.slab import bed_height, interior_slab
from filtercake.statistics import half_width
from filtercake.units import MICROMETRE, FloatArray

SLICES_PER_DIAMETER = 20
"""Slices in one largest diameter: fine enough for the layers that the floor makes."""
ABOVE = 1.15
"""Heights shown, over the bed's height."""
COLUMNS = 4


def draw(data: StudyData) -> Figure:
    """Draw one panel per distribution: the mean over its packings, their 95 % interval, and the interior slab."""
    rows = selection.base_points(data)
    count = max(len(rows), 1)
    columns = min(count, COLUMNS)
    width = (style.SINGLE, style.MEDIUM, style.DOUBLE, style.DOUBLE)[columns - 1]
    height = 1.0 + 2.9 * -(-count // columns)
    figure, panels = style.panels(count, width=width, height=height, columns=columns, sharex=True, sharey=True)
    notes = [_panel(axes, data, row) for axes, (_, row) in zip(panels, rows.iterrows(), strict=False)]
    for k, axes in enumerate(panels):
        axes.set_xlabel(style.POROSITY)
        if k % columns == 0:
            axes.set_ylabel("Height above the floor (µm)")
    if rows.empty:
        style.nothing(panels[0], "no point at the base material")
        return figure
    panels[0].set_xlim(0.0, 1.0)
    panels[0].set_xticks((0.0, 0.5, 1.0), ("0", "0.5", "1"))
    panels[0].set_xticks(np.arange(0.1, 1.0, 0.1), minor=True)
    panels[0].set_ylim(bottom=0.0)
    mean = style.key("mean and 95 % interval", color=style.FAINT)
    style.legend(figure, panels, columns=min(4, 2 * columns), extra=[mean])
    style.footer(figure, rows, f"slices of 1/{SLICES_PER_DIAMETER} of the largest diameter", *filter(None, notes))
    return figure


def mean_profile(beds: list[Packing]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean porosity profile of one or more beds and the half-width of its 95 % interval.

    Returns
    -------
    tuple of ndarray
        Heights of the slices' middles (m), means and half-widths (nan for a single bed), shape (m,).
    """
    top = ABOVE * max(bed_height(bed.position, bed.radius) for bed in beds)
    thickness = 2.0 * max(float(bed.radius.max()) for bed in beds) / SLICES_PER_DIAMETER
    edges = np.arange(0.0, top + thickness, thickness)
    profiles = np.array([porosity_profile(bed.position, bed.radius, bed.length, edges) for bed in beds])
    halves = np.array([half_width(column) for column in profiles.T])
    return 0.5 * (edges[1:] + edges[:-1]), profiles.mean(axis=0), halves


def _panel(axes: Axes, data: StudyData, row: pd.Series[Any]) -> str:
    axes.set_title(selection.label(data, str(row["csd"])), loc="left")
    found, note = selection.packings(data, str(row["point"]))
    beds = [packing for _, packing in found]
    if not beds:
        style.nothing(axes, "no accepted packing at the base material")
        return note
    height, mean, half = mean_profile(beds)
    slabs = [interior_slab(bed.position, bed.radius) for bed in beds]
    lower, upper = (np.mean([getattr(slab, side) for slab in slabs]) / MICROMETRE for side in ("lower", "upper"))
    axes.axhspan(lower, upper, color=style.FAINT, alpha=0.15, linewidth=0.0, label="interior slab", gid="slab")
    axes.axhline(
        float(np.mean([bed_height(bed.position, bed.radius) for bed in beds])) / MICROMETRE,
        color=style.INK,
        linewidth=0.9,
        linestyle=":",
        label="bed height",
        gid="height",
    )
    ink = style.colour(selection.number(data, str(row["csd"])))
    if np.isfinite(half).any():
        axes.fill_betweenx(height / MICROMETRE, mean - half, mean + half, color=ink, alpha=0.3, linewidth=0.0)
    axes.plot(mean, height / MICROMETRE, color=ink, linewidth=1.0, gid="mean")
    interior = float(row["porosity"])
    axes.plot([interior] * 2, [lower, upper], color=style.INK, linestyle="--", linewidth=0.9, label="interior porosity")
    return note
