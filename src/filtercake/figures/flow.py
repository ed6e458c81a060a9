"""Picture of the flow through one packing: the speed in a vertical plane, and the spheres that it cuts."""

from __future__ import annotations

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from filtercake.figures import selection, style
from filtercake.figures.cross_section import plane_circles
from filtercake.figures.selection import StudyData
from filtercake.packing.result import Packing
from filtercake.permeability.replicates import read_picture
from filtercake.permeability.result import Picture
from filtercake.units import MICROMETRE

SOLID = "#d9d9d9"
FASTEST = 8.0
"""Speed over the superficial velocity at which the colours end."""


def draw(data: StudyData) -> Figure:
    """Draw the plane y = L/2 of the base point's first accepted packing, flow upwards."""
    figure, (axes,) = style.panels(height=4.2)
    axes.set_xlabel("x (µm)")
    axes.set_ylabel("z (µm)")
    point = selection.main_point(data)
    if point is None:
        style.nothing(axes, "no point at the base material")
        return figure
    name = str(point["point"])
    found, note = selection.packings(data, name, most=1)
    picture = read_picture(data.packings.parent / "permeability" / selection.folder(data, name))
    rows = data.summary[data.summary["point"] == name]
    if not found or picture is None:
        style.nothing(axes, "no accepted packing at the base material")
        style.footer(figure, rows, note)
        return figure
    replicate, packing = found[0]
    _speed(figure, axes, picture)
    _spheres(axes, packing, picture)
    row = rows.iloc[0]
    what = f"replicate {replicate} of {selection.label(data, str(point['csd']))}, plane y = L/2; flow upwards"
    constant = f"Kozeny constant {row['kozeny_constant']:.0f} ± {row['kozeny_constant_ci95']:.0f}"
    style.footer(figure, rows, what, constant, note)
    return figure


def _speed(figure: Figure, axes: Axes, picture: Picture) -> None:
    layers, across = picture.speed.shape
    step, bottom = picture.spacing / MICROMETRE, picture.bottom / MICROMETRE
    shades = colormaps["viridis"].copy()
    shades.set_bad(SOLID)
    image = axes.imshow(
        picture.speed,
        origin="lower",
        extent=(0.0, across * step, bottom, bottom + layers * step),
        cmap=shades,
        vmin=0.0,
        vmax=FASTEST,
        interpolation="nearest",
    )
    figure.colorbar(image, ax=axes, label="Speed over superficial velocity", shrink=0.8, extend="max")


def _spheres(axes: Axes, packing: Packing, picture: Picture) -> None:
    across = picture.speed.shape[1]
    # the cut of the lattice is the layer of nodes just behind the middle
    plane = (across // 2 + 0.5) * picture.spacing
    centre, radius, _ = plane_circles(packing, plane)
    circles = [Circle((x, z), r) for (x, z), r in zip(centre / MICROMETRE, radius / MICROMETRE, strict=True)]
    axes.add_collection(PatchCollection(circles, facecolors=SOLID, edgecolors=style.INK, linewidths=0.3, gid="spheres"))
    axes.set_xlim(0.0, packing.length / MICROMETRE)
    axes.set_aspect("equal")
