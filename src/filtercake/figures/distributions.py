"""Size distributions of the crystallizer's product at every residence time (paper, Fig. 12)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from filtercake.crystals.crystallizer import volume_density
from filtercake.figures import selection, style
from filtercake.figures.selection import StudyData
from filtercake.units import MICROMETRE, MINUTE

LARGEST_SHOWN = 3.0
"""Sizes shown, over the largest volume mean: all but 0.2 % of the volume (twelve size scales)."""
PERCENT_PER_MICROMETRE = 100.0 * MICROMETRE


def draw(data: StudyData) -> Figure:
    """Draw one curve per residence time, and its two mean sizes on it."""
    figure, (axes,) = style.panels(width=style.MEDIUM, height=3.6)
    products = selection.products(data)
    largest = LARGEST_SHOWN * max((state.volume_mean for _, _, state in products), default=0.0)
    size = np.linspace(0.0, largest, 401)
    for name, volume, state in products:
        ink = style.colour(selection.number(data, name))
        density = volume_density(state, size)
        means = np.array([state.number_mean, state.volume_mean])
        heights = volume_density(state, means)
        label = f"{state.residence_time / MINUTE:g} min ({volume:g} m³)"
        axes.plot(size / MICROMETRE, density * PERCENT_PER_MICROMETRE, color=ink, label=label, gid="density")
        for mean, height, fill, gid in zip(means, heights, ("white", ink), ("number", "volume"), strict=True):
            axes.plot(
                [mean / MICROMETRE],
                [height * PERCENT_PER_MICROMETRE],
                "o",
                color=ink,
                markerfacecolor=fill,
                markersize=4.0,
                zorder=3,
                gid=gid,
            )
    axes.set_xlabel("Crystal diameter (µm)")
    axes.set_ylabel("Volume density (%/µm)")
    if not products:
        style.nothing(axes, "no distribution is made by a crystallizer")
        return figure
    axes.set_xlim(0.0, largest / MICROMETRE)
    axes.set_ylim(bottom=0.0)
    means_keys = [
        style.key("number mean size", color=style.FAINT, marker="o", markerfacecolor="white", linewidth=0.0),
        style.key("volume mean size", color=style.FAINT, marker="o", linewidth=0.0),
    ]
    style.legend(figure, [axes], columns=3, extra=means_keys)
    notes = ["residence time (crystallizer volume)", "full distributions, before truncation; no packing enters"]
    style.footer(figure, data.summary.iloc[:0], *notes)
    return figure
