"""The initial cloud: N spheres at random, without overlap, above the floor; the same for every engine."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.errors import CloudError
from filtercake.packing.compiled import compiled
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
    """How large a bed of a distribution has to be."""

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
    if particles < 1:
        raise CloudError("the cloud holds no sphere; particles must be at least 1")
    packed = merge_rare(csd, particles)
    counts = packed.class_counts(particles)
    radius = np.repeat(0.5 * packed.size[::-1], counts[::-1])
    length = box_length(csd, particles, void_fraction, bed_depth_factor)
    if 2.0 * radius[0] > length:
        raise CloudError(
            f"the largest sphere ({2.0 * radius[0] / MICROMETRE:.4g} um) is wider than the periodic box "
            f"({length / MICROMETRE:.4g} um); use more particles than {particles}"
        )
    height = PLACEMENT_HEIGHT * bed_depth_factor * length
    position = np.empty((particles, 3))
    rng = np.random.Generator(np.random.PCG64(seed))
    level, cells = _grid_levels(radius, length, height)
    # unit lengths of the box keep the kernel free of any unit system
    placed = _place(position, radius / length, height / length, level, cells, rng, MAX_ATTEMPTS)
    if placed < particles:
        raise CloudError(
            f"sphere {placed + 1} of {particles} ({2.0 * radius[placed] / MICROMETRE:.4g} um) found no free place "
            f"in {MAX_ATTEMPTS} tries at void fraction {void_fraction:g}; use a larger void_fraction"
        )
    return Cloud(position * length, radius, length, height)


def _grid_levels(radius: FloatArray, length: float, height: float) -> tuple[IntArray, IntArray]:
    """Size level of each sphere (factor 2 apart) and each level's grid shape (levels, 3)."""
    largest = radius[0]
    level = np.floor(np.log2(largest / radius) + 1e-12).astype(np.int64)
    cells = np.empty((int(level.max()) + 1, 3), dtype=np.int64)
    for k in range(cells.shape[0]):
        cell = 2.0 * largest / 2.0**k
        across = max(1, int(length / cell))
        cells[k] = across, across, max(1, math.ceil(height / cell))
    return level, cells


@compiled
def _place(
    position: FloatArray,
    radius: FloatArray,
    height: float,
    level: IntArray,
    cells: IntArray,
    rng: np.random.Generator,
    max_attempts: int,
) -> int:
    """Fill ``position`` (box side 1) and return how many spheres found a place."""
    n = radius.size
    start = np.zeros(cells.shape[0] + 1, dtype=np.int64)
    for k in range(cells.shape[0]):
        start[k + 1] = start[k] + cells[k, 0] * cells[k, 1] * cells[k, 2]
    head = np.full(start[-1], -1, dtype=np.int64)
    following = np.full(n, -1, dtype=np.int64)
    reach = np.zeros(cells.shape[0])  # largest radius present on each level
    for i in range(n):
        r = radius[i]
        found = False
        for _ in range(max_attempts):
            x = rng.random()
            y = rng.random()
            z = r + rng.random() * (height - 2.0 * r)
            if _is_free(x, y, z, r, position, radius, height, cells, start, head, following, reach):
                found = True
                break
        if not found:
            return i
        position[i, 0], position[i, 1], position[i, 2] = x, y, z
        k = level[i]
        reach[k] = max(reach[k], r)
        cell = start[k] + _cell(x, y, z, height, cells[k])
        following[i] = head[cell]
        head[cell] = i
    return n


@compiled
def _cell(x: float, y: float, z: float, height: float, cells: IntArray) -> int:
    cx = min(int(x * cells[0]), cells[0] - 1)
    cy = min(int(y * cells[1]), cells[1] - 1)
    cz = min(int(z / height * cells[2]), cells[2] - 1)
    return int((cz * cells[1] + cy) * cells[0] + cx)


@compiled
def _is_free(
    x: float,
    y: float,
    z: float,
    r: float,
    position: FloatArray,
    radius: FloatArray,
    height: float,
    cells: IntArray,
    start: IntArray,
    head: IntArray,
    following: IntArray,
    reach: FloatArray,
) -> bool:
    """Whether a sphere at (x, y, z) overlaps none of those placed so far."""
    for k in range(cells.shape[0]):
        if reach[k] == 0.0:
            continue
        span = r + reach[k]
        nx, ny, nz = cells[k, 0], cells[k, 1], cells[k, 2]
        x0, x1 = int(np.floor((x - span) * nx)), int(np.floor((x + span) * nx))
        y0, y1 = int(np.floor((y - span) * ny)), int(np.floor((y + span) * ny))
        z0 = max(0, int((z - span) / height * nz)) if z > span else 0
        z1 = min(nz - 1, int((z + span) / height * nz))
        x1, y1 = min(x1, x0 + nx - 1), min(y1, y0 + ny - 1)
        for cz in range(z0, z1 + 1):
            for cy in range(y0, y1 + 1):
                row = start[k] + (cz * ny + cy % ny) * nx
                for cx in range(x0, x1 + 1):
                    j = head[row + cx % nx]
                    while j >= 0:
                        dx, dy = x - position[j, 0], y - position[j, 1]
                        dx -= np.round(dx)
                        dy -= np.round(dy)
                        dz = z - position[j, 2]
                        gap = r + radius[j]
                        if dx * dx + dy * dy + dz * dz < gap * gap:
                            return False
                        j = following[j]
    return True
