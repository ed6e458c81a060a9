"""Porosity of a packing: the exact slab in its interior, the profile over height, and the paper's count."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from filtercake.packing import contact_law
from filtercake.packing.compression import CompressionCurve
from filtercake.packing.contacts import find_contacts, lens_volume_below
from filtercake.packing.result import Packing
from filtercake.packing.scene import Scene
from filtercake.packing.slab import Slab, bed_height, interior_slab
from filtercake.units import FloatArray


@dataclass(frozen=True)
class PorosityResult:
    """Porosities of one packing.

    Attributes
    ----------
    interior : float
        Exact porosity of the interior slab: the answer.
    from_floor : float
        Exact porosity of the slab 0..L, the floor layer included.
    paper_count : float
        The paper's estimate: spheres counted whole by centre in 0..L.
    compaction : float
        Estimated loss of porosity because contacts overlap (positive).
    slab : Slab
        The interior slab, m.
    """

    interior: float
    from_floor: float
    paper_count: float
    compaction: float
    slab: Slab


def volume_below(height: float | FloatArray, centre: FloatArray, radius: FloatArray) -> FloatArray:
    """Volume of spheres below a horizontal plane, m3, in closed form (spherical cap).

    The heights of plane and centres and the radii, all in m, broadcast against each other.
    """
    depth = np.clip(height - centre + radius, 0.0, 2.0 * radius)
    return np.asarray(np.pi / 3.0 * depth**2 * (3.0 * radius - depth))


def slab_porosity(position: FloatArray, radius: FloatArray, length: float, slab: Slab) -> float:
    """Exact porosity between two heights: spheres clipped by the slab's faces in closed form.

    Positions (n, 3), radii (n,) and the side of the periodic box in m. Overlaps count twice, as in every published
    porosity of such beds; :func:`filtercake.packing.contact_law.soft_contact_compaction` says how much that is.

    Raises
    ------
    ValueError
        If the slab has no thickness.

    Notes
    -----
    What two spheres share counts once; what three share at a point, in contacts deeper than any that is accepted,
    counts as if only pairs did.
    """
    if slab.thickness <= 0.0:
        raise ValueError(f"the slab {slab.lower:g}..{slab.upper:g} m has no thickness")
    return float(porosity_profile(position, radius, length, np.array([slab.lower, slab.upper]))[0])


def paper_count_porosity(
    position: FloatArray, radius: FloatArray, length: float, bed_depth_factor: float = 1.0
) -> float:
    """Porosity as the paper estimates it: whole spheres whose centre lies in 0..L, over L^3.

    In a bed ``bed_depth_factor`` times as deep, the count goes as much higher: the paper's takes in most of its bed.
    """
    depth = bed_depth_factor * length
    inside = (position[:, 2] >= 0.0) & (position[:, 2] <= depth)
    return 1.0 - float(np.sum(4.0 / 3.0 * np.pi * radius[inside] ** 3)) / (length**2 * depth)


def porosity_profile(position: FloatArray, radius: FloatArray, length: float, edges: FloatArray) -> FloatArray:
    """Exact porosity of each slice between consecutive heights ``edges`` (m + 1,), shape (m,).

    Positions (n, 3), radii (n,), the side of the periodic box and the ascending edges in m.
    """
    contacts = find_contacts(position, radius, length)
    spheres = np.array([volume_below(edge, position[:, 2], radius).sum() for edge in edges])
    below = spheres - lens_volume_below(edges, contacts, position, radius, length)
    return np.asarray(1.0 - np.diff(below) / (length**2 * np.diff(edges)))


def measure(packing: Packing, scene: Scene) -> PorosityResult:
    """Measure all porosities of an accepted packing.

    A pressed one has neither floor nor surface: its porosity is that of the whole cell, corrected to rigid spheres, at
    the last load; the paper's count and the slab at the floor do not exist (nan).
    """
    if scene.is_pressed:
        porosity = float(CompressionCurve.of(packing.diagnostics).porosity[-1])
        return PorosityResult(porosity, math.nan, math.nan, 0.0, Slab(0.0, packing.length))
    position, radius, length = packing.position, packing.radius, packing.length
    slab = interior_slab(position, radius)
    interior = slab_porosity(position, radius, length, slab)
    return PorosityResult(
        interior=interior,
        from_floor=slab_porosity(position, radius, length, Slab(0.0, min(length, bed_height(position, radius)))),
        paper_count=paper_count_porosity(position, radius, length, scene.bed_depth_factor),
        compaction=contact_law.soft_contact_compaction(
            interior, scene.cohesion, scene.youngs_modulus, scene.poisson_ratio
        ),
        slab=slab,
    )
