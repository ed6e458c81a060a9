"""Size classes that are packed and those left out, with the threshold between them (paper, Fig. 5)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from filtercake.crystals.csd import kept_classes
from filtercake.figures import selection, style
from filtercake.figures.selection import StudyData
from filtercake.study.config.crystals import Csd
from filtercake.units import MICROMETRE, FloatArray

MOST_PANELS = 4
KEPT, DISCARDED = style.colour(0), style.colour(1)


def draw(data: StudyData) -> Figure:
    """Draw one panel per truncated distribution: the share of every class, and what the packing leaves out."""
    csds = data.study.csds
    names = [name for name in data.csds if name in csds and csds[name].truncation]
    names.sort(key=lambda name: selection.number(data, name))
    shown = names[:MOST_PANELS]
    columns = min(max(len(shown), 1), 2)
    rows = -(-max(len(shown), 1) // columns)
    width = style.SINGLE if columns == 1 else style.DOUBLE
    figure, panels = style.panels(
        max(len(shown), 1), width=width, height=1.0 + 2.0 * rows, columns=columns, sharex=True, sharey=True
    )
    keys = [line for axes, name in zip(panels, shown, strict=False) for line in _panel(axes, data, name)]
    for k, axes in enumerate(panels):
        if k >= len(panels) - columns:
            axes.set_xlabel("Crystal diameter (µm)")
            axes.tick_params(labelbottom=True)
        if k % columns == 0:
            axes.set_ylabel("Share of the volume per class (%)")
        axes.set_xlim(left=0.0)
        axes.set_ylim(bottom=0.0)
    if not shown:
        style.nothing(panels[0], "no distribution is truncated")
    style.legend(figure, panels, columns=columns, extra=keys)
    notes = ["packings are of the kept classes; resistances are of all classes"] if shown else []
    if len(names) > len(shown):
        notes.append(f"{len(names) - len(shown)} more truncated distributions are not shown")
    points = selection.base_points(data)
    style.footer(figure, points[points["csd"].isin(shown)], *notes)
    return figure


def class_edges(size: FloatArray) -> FloatArray:
    """Edges of classes around their sizes: halfway between neighbours, shape (n,) to (n + 1,)."""
    if size.size == 1:
        return np.array([0.95 * size[0], 1.05 * size[0]])
    inner = 0.5 * (size[1:] + size[:-1])
    first, last = max(2.0 * size[0] - inner[0], 0.0), 2.0 * size[-1] - inner[-1]
    return np.asarray(np.concatenate([[first], inner, [last]]), dtype=np.float64)


def _panel(axes: Axes, data: StudyData, name: str) -> list[Line2D]:
    full, truncated = data.csds[name]
    threshold = data.study.csds[name].truncate_below_volume_fraction
    kept = kept_classes(full, truncated)
    edges, share = class_edges(full.size) / MICROMETRE, full.volume_fraction * 100.0
    for chosen, ink, label, gid in (
        (kept, KEPT, "packed", "kept"),
        (~kept, DISCARDED, "left out of the packing", "discarded"),
    ):
        values = np.where(chosen, share, np.nan)
        axes.stairs(values, edges, fill=True, color=ink, linewidth=0.0, label=label, gid=gid)
    _limits(axes, data.study.csds[name])
    axes.set_title(selection.label(data, name), loc="left")
    volume = float(full.volume_fraction[kept].sum())
    lines = [
        f"keeps {volume:.1%} of the volume,".replace("%", " %"),
        f"{truncated.smallest / MICROMETRE:.1f} to {truncated.largest / MICROMETRE:.1f} µm",
    ]
    axes.text(0.98, 0.96, "\n".join(lines), transform=axes.transAxes, ha="right", va="top", fontsize=7.0)
    keys = []
    for quantity in ("smallest_um", "largest_um"):
        for value in selection.published(data, name, quantity):
            style.published_point(axes, value.value, threshold * 100.0, value, label="_")
            keys.append(
                style.key(
                    f"smallest and largest: {style.published_label(value)}",
                    marker=style.PUBLISHED_MARKERS[value.kind],
                    markerfacecolor="white",
                    markeredgecolor=style.INK,
                    linewidth=0.0,
                )
            )
    return keys


def _limits(axes: Axes, csd: Csd) -> None:
    """Draw the threshold per class and the smallest and largest size, each where it is given."""
    look: dict[str, Any] = {"color": style.INK, "linewidth": 0.9}
    share = 100.0 * csd.truncate_below_volume_fraction
    if share > 0.0:
        label = f"threshold: {share:g} % of the volume"
        axes.axhline(share, linestyle="--", label=label, gid="threshold", **look)
    for size, word in ((csd.truncate_below_um, "smallest"), (csd.truncate_above_um, "largest")):
        if size is not None:
            axes.axvline(size, linestyle=":", label=f"{word} size packed: {size:g} µm", gid="limit", **look)
