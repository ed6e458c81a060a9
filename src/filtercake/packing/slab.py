"""Height of a bed and its interior slab."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filtercake.units import FloatArray

MARGIN_DIAMETERS = 1.0
"""Largest diameters left out at the floor and below the top."""
SMALLEST_THICKNESS_DIAMETERS = 1.0
"""A slab thinner than this many largest diameters does not represent the bed."""
LEAST_BED_DIAMETERS = 2.0 * MARGIN_DIAMETERS + SMALLEST_THICKNESS_DIAMETERS
"""Depth of a bed that has such a slab, in largest diameters."""


@dataclass(frozen=True)
class Slab:
    """A horizontal slice of a bed, heights in m."""

    lower: float
    upper: float

    @property
    def thickness(self) -> float:
        """Upper minus lower height, m; not positive where the bed has no interior."""
        return self.upper - self.lower


def bed_height(position: FloatArray, radius: FloatArray) -> float:
    """Height of the even bed with the same solids and the same centre of mass, m: twice the mean height.

    Smooth and free of any threshold; a few spheres lying on top hardly move it.

    Parameters
    ----------
    position : ndarray, shape (n, 3)
        Centres, m, floor at z = 0.
    radius : ndarray, shape (n,)
        Radii, m.
    """
    return 2.0 * float(np.average(position[:, 2], weights=radius**3))


def interior_slab(position: FloatArray, radius: FloatArray) -> Slab:
    """Interior of a bed: one largest diameter above the floor to one below the bed's height.

    The floor orders the layer on it and the surface is rough; both reach about one largest diameter deep.
    """
    margin = MARGIN_DIAMETERS * 2.0 * float(radius.max())
    return Slab(margin, bed_height(position, radius) - margin)


def why_too_thin(slab: Slab, radius: FloatArray) -> str | None:
    """Say why a slab cannot represent its bed, None where it can."""
    needed = SMALLEST_THICKNESS_DIAMETERS * 2.0 * float(radius.max())
    if slab.thickness >= needed:
        return None
    return (
        f"the bed is too shallow: its interior is {max(slab.thickness, 0.0) * 1e6:.4g} um thick, "
        f"less than the {needed * 1e6:.4g} um of the largest sphere; use more particles"
    )
