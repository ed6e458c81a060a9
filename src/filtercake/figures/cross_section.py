"""Picture of one packing: the exact circles in which a vertical plane cuts its spheres."""

from __future__ import annotations

import itertools

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PatchCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from filtercake.figures import selection, style
from filtercake.figures.selection import StudyData
from filtercake.packing.result import Packing
from filtercake.packing.slab import bed_height, interior_slab
from filtercake.units import MICROMETRE, FloatArray

FEW_SIZES = 5
"""Up to so many sizes are named in a legend; more take a colour bar."""


def draw(data: StudyData) -> Figure:
    """Draw the plane y = L/2 of the base point's first accepted packing."""
    figure, (axes,) = style.panels(height=4.2)
    axes.set_xlabel("x (µm)")
    axes.set_ylabel("z (µm)")
    point = selection.main_point(data)
    if point is None:
        style.nothing(axes, "no point at the base material")
        return figure
    found, note = selection.packings(data, str(point["point"]), most=1)
    rows = data.summary[data.summary["point"] == point["point"]]
    if not found:
        style.nothing(axes, "no accepted packing at the base material")
        style.footer(figure, rows, note)
        return figure
    replicate, packing = found[0]
    draw_spheres(figure, axes, packing)
    if not packing.is_cell:
        draw_levels(axes, packing)
    style.legend(figure, [axes], columns=3)
    what = f"replicate {replicate} of {selection.label(data, str(point['csd']))}, plane y = L/2"
    style.footer(figure, rows, what, note)
    return figure


def plane_circles(packing: Packing, y: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Circles in which the plane at ``y`` (m) cuts the spheres, periodic images included (of pressed cells also in z).

    Returns
    -------
    tuple of ndarray
        x and z of the circles' centres, shape (m, 2), their radii and the spheres' diameters, shape (m,), all in m.
    """
    length, position, radius = packing.length, packing.position, packing.radius
    offset = position[:, 1] - y
    offset -= length * np.round(offset / length)
    cut = np.abs(offset) < radius
    circle = np.sqrt(radius[cut] ** 2 - offset[cut] ** 2)
    x, z, diameter = position[cut, 0], position[cut, 2], 2.0 * radius[cut]
    parts = []
    images = (-length, 0.0, length)
    for shift, lift in itertools.product(images, images if packing.is_cell else (0.0,)):
        seen = (x + shift + circle > 0.0) & (x + shift - circle < length)
        if packing.is_cell:
            seen &= (z + lift + circle > 0.0) & (z + lift - circle < length)
        parts.append(np.column_stack([x[seen] + shift, z[seen] + lift, circle[seen], diameter[seen]]))
    found = np.concatenate(parts)
    return found[:, :2], found[:, 2], found[:, 3]


def draw_spheres(figure: Figure, axes: Axes, packing: Packing) -> None:
    """Draw the circles in which the plane y = L/2 cuts a packing."""
    centre, cut_radius, diameter = plane_circles(packing, 0.5 * packing.length)
    sizes = np.unique(2.0 * packing.radius / MICROMETRE)
    norm = Normalize(sizes[0], sizes[-1])
    shades = colormaps["cividis"]
    few = sizes.size <= FEW_SIZES
    inks = {size: style.colour((5, 4, 2, 3, 1)[k]) for k, size in enumerate(sizes)} if few else {}
    colours = [inks[size] if few else shades(norm(size)) for size in diameter / MICROMETRE]
    circles = [Circle((x, z), r) for (x, z), r in zip(centre / MICROMETRE, cut_radius / MICROMETRE, strict=True)]
    axes.add_collection(
        PatchCollection(circles, facecolors=colours, edgecolors=style.INK, linewidths=0.35, gid="spheres")
    )
    if few:
        for size, ink in inks.items():
            axes.plot([], [], "o", color=ink, markeredgecolor=style.INK, markeredgewidth=0.4, label=f"{size:.4g} µm")
    else:
        figure.colorbar(ScalarMappable(norm, shades), ax=axes, label="Sphere diameter (µm)", shrink=0.8)
    side = packing.length / MICROMETRE
    axes.set_xlim(0.0, side)
    axes.set_aspect("equal")
    if packing.is_cell:
        axes.set_ylim(0.0, side)
        return
    # up to what lies on the bed: a sphere that was thrown up and has not come back would stretch the picture
    lying = bed_height(packing.position, packing.radius) + 2.0 * float(packing.radius.max())
    highest = float((packing.position[:, 2] + packing.radius).max())
    top = min(highest, lying) / MICROMETRE
    axes.set_ylim(-0.02 * top, 1.02 * top)


def draw_levels(axes: Axes, packing: Packing) -> None:
    """Draw a bed's floor, its height and the slab that is measured."""
    slab = interior_slab(packing.position, packing.radius)
    axes.axhline(0.0, color=style.INK, linewidth=1.6, label="floor", gid="floor")
    for limit in (slab.lower, slab.upper):
        axes.axhline(
            limit / MICROMETRE, color=style.colour(1), linewidth=1.1, linestyle="--", label="interior slab", gid="slab"
        )
    height = bed_height(packing.position, packing.radius) / MICROMETRE
    axes.axhline(height, color=style.INK, linewidth=0.9, linestyle=":", label="bed height", gid="height")
