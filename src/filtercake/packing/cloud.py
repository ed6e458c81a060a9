"""The initial cloud: N spheres at random, without overlap, above the floor; the same for every engine."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.errors import CloudError
from filtercake.packing.representation import merge_rare
from filtercake.units import MICROMETRE, FloatArray, IntArray

MAX_ATTEMPTS = 4_000_000
"""Random positions tried for one sphere before the cloud is called too dense."""

PLACEMENT_HEIGHT = 2.0
"""Height of the region the spheres start in, in units of the box length L (paper, section 3.1)."""

NARROW = 4.0
"""Largest over smallest size up to which a distribution counts as narrow."""
NARROW_PARTICLES = 2000
"""Spheres in a bed of a narrow distribution (paper, Table 3)."""
WIDTH_DIAMETERS, DEPTH_DIAMETERS = 4.6, 10.0
"""Width of the box and depth of the settled bed of a broad distribution, in largest diameters."""
CELL_DIAMETERS = 3.3
"""Side of a pressed cell of a broad distribution, in largest diameters."""
SETTLED_POROSITY = 0.3
"""Rough porosity of such a bed, for its depth only."""


@dataclass(frozen=True)
class Cloud:
    """Spheres before settling.

    Attributes
    ----------
    position : ndarray, shape (n, 3)
        Centres, m; x and y periodic in [0, length), z above the floor at 0.
    radius : ndarray, shape (n,)
        Radii, m.
    length : float
        Side L of the square periodic box, m.
    height : float
        Height of the region the spheres start in, m.
    """

    position: FloatArray
    radius: FloatArray
    length: float
    height: float

    def __post_init__(self) -> None:
        """Check shapes and values, so that no engine ever sees a NaN or an empty cloud."""
        n = self.radius.size
        if n == 0:
            raise CloudError("the cloud holds no sphere; particles must be at least 1")
        if self.position.shape != (n, 3):
            raise CloudError(f"the cloud has {n} radii but positions of shape {self.position.shape}")
        if not (np.isfinite(self.position).all() and np.isfinite(self.radius).all()):
            raise CloudError("the cloud holds a position or radius that is not finite")
        if not (self.radius > 0.0).all() or not self.length > 0.0:
            raise CloudError("the cloud holds a radius or a box length that is not positive")
        if 2.0 * float(self.radius.max()) > self.length:
            raise CloudError(
                f"the largest sphere ({2e6 * float(self.radius.max()):.4g} um) is wider than the periodic box "
                f"({self.length / MICROMETRE:.4g} um): it would touch itself; use more particles"
            )

    @property
    def void_fraction(self) -> float:
        """Void fraction of the starting region."""
        solids = 4.0 / 3.0 * np.pi * float(np.sum(self.radius**3))
        return 1.0 - solids / (self.length**2 * self.height)


def box_length(
    csd: CrystalSizeDistribution, particles: int, void_fraction: float, bed_depth_factor: float = 1.0
) -> float:
    """System dimension L, m: ``(N <V> / ((1 - e0) 2 c))^(1/3)`` (paper, Table 1, with c = 1).

    Parameters
    ----------
    csd : CrystalSizeDistribution
        The (truncated) distribution that is packed.
    particles : int
        Number of spheres N.
    void_fraction : float
        Initial void fraction e0 of the region 0..2cL.
    bed_depth_factor : float
        How many times deeper than the paper's the bed is, in units of its box side: c.
    """
    solids = particles * csd.mean_particle_volume
    return float((solids / ((1.0 - void_fraction) * PLACEMENT_HEIGHT * bed_depth_factor)) ** (1.0 / 3.0))


@dataclass(frozen=True)
class BedSize:
    """Number of spheres and relative depth of a bed."""

    particles: int
    bed_depth_factor: float


def bed_for(csd: CrystalSizeDistribution, void_fraction: float) -> BedSize:
    """Choose the size of a bed: the paper's 2000 spheres, or a column of a broad distribution deep enough.

    A packing is looser for two to three largest diameters under its surface, and its small spheres must be many around
    each large one. A broad distribution's bed is as deep as the paper's of 100 000 crystals, in a narrower box.

    Parameters
    ----------
    csd : CrystalSizeDistribution
        The (truncated) distribution.
    void_fraction : float
        Void fraction of the initial cloud.
    """
    if csd.largest <= NARROW * csd.smallest:
        return BedSize(NARROW_PARTICLES, 1.0)
    width, depth = WIDTH_DIAMETERS * csd.largest, DEPTH_DIAMETERS * csd.largest
    solids = width**2 * depth * (1.0 - SETTLED_POROSITY)
    bed_depth_factor = depth * (1.0 - SETTLED_POROSITY) / ((1.0 - void_fraction) * PLACEMENT_HEIGHT * width)
    return BedSize(max(NARROW_PARTICLES, math.ceil(solids / csd.mean_particle_volume)), round(bed_depth_factor, 3))


def cell_for(csd: CrystalSizeDistribution) -> int:
    """Choose how many spheres a pressed cell of a (truncated) distribution has: 2000, or enough for its width.

    Without floor and surface it need only be wide enough that its largest spheres are not neighbours of themselves.
    """
    wanted = (1.0 - SETTLED_POROSITY) * (CELL_DIAMETERS * csd.largest) ** 3 / csd.mean_particle_volume
    return max(NARROW_PARTICLES, math.ceil(wanted / 100.0) * 100)


def make_cloud(
    csd: CrystalSizeDistribution, particles: int, void_fraction: float, seed: int, bed_depth_factor: float = 1.0
) -> Cloud:
    """Place N spheres by random sequential addition, large ones first, with exact class counts.

    Parameters
    ----------
    csd : CrystalSizeDistribution
        The (truncated) distribution to pack.
    particles : int
        Number of spheres; rare classes are merged (:func:`filtercake.packing.representation.merge_rare`), counts
        follow by largest remainder.
    void_fraction : float
        Initial void fraction of the region 0..2cL; 0.65, or 0.60 for broad distributions.
    seed : int
        Seed of the random stream; the same seed gives the same cloud on every machine.
    bed_depth_factor : float
        c, as in :func:`box_length`.

    Raises
    ------
    CloudError
        If a sphere finds no free place (void fraction too small for a narrow distribution).
    """
    radius = class_radii(csd, particles)
    length = box_length(csd, particles, void_fraction, bed_depth_factor)
    if 2.0 * radius[0] > length:
        raise CloudError(
            f"the largest sphere ({2.0 * radius[0] / MICROMETRE:.4g} um) is wider than the periodic box "
            f"({length / MICROMETRE:.4g} um); use more particles than {particles}"
        )
    height = PLACEMENT_HEIGHT * bed_depth_factor * length
    return Cloud(place_spheres(radius, length, height, seed), radius, length, height)


def class_radii(csd: CrystalSizeDistribution, particles: int) -> FloatArray:
    """Radii of N spheres, m, shape (N,), the largest first: rare classes merged, counts by largest remainder."""
    if particles < 1:
        raise CloudError("the cloud holds no sphere; particles must be at least 1")
    packed = merge_rare(csd, particles)
    counts = packed.class_counts(particles)
    return np.repeat(0.5 * packed.size[::-1], counts[::-1])


def place_spheres(radius: FloatArray, length: float, height: float, seed: int, *, periodic: bool = False) -> FloatArray:
    """Place spheres by random sequential addition in a box that is periodic in x and y.

    Parameters
    ----------
    radius : ndarray, shape (n,)
        Radii, m, the largest first.
    length, height : float
        Side and height of the box, m.
    seed : int
        Seed of the random stream.
    periodic : bool
        Whether the box is periodic in z too; otherwise the spheres lie wholly between 0 and ``height``.

    Returns
    -------
    ndarray, shape (n, 3)
        Centres, m.

    Raises
    ------
    CloudError
        If a sphere finds no free place.
    """
    from filtercake.packing.cloud_kernels import place

    position = np.empty((radius.size, 3))
    rng = np.random.Generator(np.random.PCG64(seed))
    level, cells = _grid_levels(radius, length, height)
    # unit lengths of the box keep the kernel free of any unit system
    placed = place(position, radius / length, height / length, level, cells, rng, MAX_ATTEMPTS, periodic)
    if placed < radius.size:
        void_fraction = 1.0 - 4.0 / 3.0 * np.pi * float(np.sum(radius**3)) / (length**2 * height)
        raise CloudError(
            f"sphere {placed + 1} of {radius.size} ({2.0 * radius[placed] / MICROMETRE:.4g} um) found no free place "
            f"in {MAX_ATTEMPTS} tries at void fraction {void_fraction:g}; use a larger void_fraction"
        )
    return position * length


def size_levels(radius: FloatArray) -> IntArray:
    """Size level of each sphere, shape (n,): its radius is 1 to 1/2, 1/2 to 1/4, ... of the largest."""
    return np.asarray(np.floor(np.log2(radius.max() / radius) + 1e-12).astype(np.int64))


def _grid_levels(radius: FloatArray, length: float, height: float) -> tuple[IntArray, IntArray]:
    """Size level of each sphere (factor 2 apart) and each level's grid shape (levels, 3)."""
    largest = radius[0]
    level = size_levels(radius)
    cells = np.empty((int(level.max()) + 1, 3), dtype=np.int64)
    for k in range(cells.shape[0]):
        cell = 2.0 * largest / 2.0**k
        across = max(1, int(length / cell))
        cells[k] = across, across, max(1, math.ceil(height / cell))
    return level, cells
