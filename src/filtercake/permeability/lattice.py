"""Fluid nodes of a bed of spheres on a cubic lattice: who neighbours whom, and how far the walls are.

Only the fluid is stored, in blocks of 64 nodes: within a block, all values of one direction lie side by side, so that a
block is worked on with vector instructions. A node's place in direction q is
``(block * DIRECTIONS + q) * BLOCK + node in block``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from filtercake.errors import FiltercakeError
from filtercake.packing.compiled import cached_njit
from filtercake.units import FloatArray, IntArray

BLOCK: Final = 64
"""Nodes of a block."""
# fmt: off
VELOCITIES: Final = np.array([
    [0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1],
    [1, 1, 0], [-1, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 0, 1], [-1, 0, -1], [1, 0, -1], [-1, 0, 1],
    [0, 1, 1], [0, -1, -1], [0, 1, -1], [0, -1, 1],
], dtype=np.int64)
# fmt: on
"""D3Q19: each odd direction is followed by its opposite."""
WEIGHTS: Final = np.array([1 / 3] + [1 / 18] * 6 + [1 / 36] * 12)
OPPOSITE: Final = np.array([0] + [q + 1 if q % 2 else q - 1 for q in range(1, 19)], dtype=np.int64)
DIRECTIONS: Final = len(WEIGHTS)
WALL_SCALE: Final = 127
"""Unit of the wall distances kept as int8: 1 - 2 q, q the distance over the link, is within 1 of itself."""
MOST_PLACES: Final = 2**31 - 1
"""Places that the index of neighbours can name."""


@dataclass(frozen=True)
class Spheres:
    """Spheres in a box that is periodic in x and y, and in z if it is a cell.

    Attributes
    ----------
    position : ndarray, shape (n, 3)
        Centres, m.
    radius : ndarray, shape (n,)
        Radii, m.
    box : ndarray, shape (3,)
        Sides, m. Of a bed, the third is its height with the free layers.
    bottom : float
        Height of the box's lower face, m.
    """

    position: FloatArray
    radius: FloatArray
    box: FloatArray
    bottom: float = 0.0


@dataclass(frozen=True)
class Lattice:
    """Fluid nodes of a lattice of spacing ``spacing``.

    Attributes
    ----------
    spacing : float
        Distance of nodes, m.
    shape : tuple of int
        Nodes of the box in z, y and x, solid ones included.
    fluid : int
        Number of fluid nodes; the last block is filled up with nodes that see only themselves.
    source : ndarray of int32, shape (places,)
        Place that streams into each place; its own beside a wall.
    wall : ndarray of int8, shape (places,)
        ``1 - 2 q`` of links that end at a wall, 0 elsewhere.
    layer : ndarray of int32, shape (blocks * BLOCK,)
        Layer in z of each node; -1 of the filling.
    number : ndarray of int32, shape (nz, ny, nx)
        Number of the fluid node at each place of the box, -1 in a sphere.
    """

    spacing: float
    shape: tuple[int, int, int]
    fluid: int
    source: NDArray[np.int32]
    wall: NDArray[np.int8]
    layer: NDArray[np.int32]
    number: NDArray[np.int32]

    @property
    def blocks(self) -> int:
        """Blocks, the last one filled up."""
        return self.layer.size // BLOCK

    def fluid_per_layer(self) -> NDArray[np.int64]:
        """Fluid nodes of each layer, shape (nz,)."""
        return np.bincount(self.layer[: self.fluid], minlength=self.shape[0])


def build(spheres: Spheres, across: int, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Lattice:
    """Lay a lattice over spheres: a node inside any of them is solid, overlapping spheres are their union.

    Parameters
    ----------
    spheres : Spheres
        What the fluid flows around.
    across : int
        Nodes along x; the other sides must be whole numbers of the same spacing.
    offset : (float, float, float)
        Shift of the spheres against the lattice, in spacings.

    Raises
    ------
    FiltercakeError
        If a side is no whole number of spacings, no node is fluid, or there are more than the index can name.
    """
    spacing = float(spheres.box[0]) / across
    sides = spheres.box / spacing
    counts = np.rint(sides).astype(np.int64)
    if np.any(np.abs(sides - counts) > 1e-6 * sides):
        raise FiltercakeError(f"a box of {sides[0]:g} x {sides[1]:g} x {sides[2]:g} spacings: must be whole numbers")
    nx, ny, nz = (int(count) for count in counts)
    centre = (spheres.position - [0.0, 0.0, spheres.bottom]) / spacing - 0.5 + np.asarray(offset)
    radius = spheres.radius / spacing
    number = np.zeros((nz, ny, nx), dtype=np.int32)
    _mark_solids(number, centre, radius)
    lattice = connect(number, spacing, wall_distance=1.0)
    _measure_walls(number, lattice.wall, centre, radius, VELOCITIES)
    return lattice


def connect(number: NDArray[np.int32], spacing: float, *, wall_distance: float = 0.5) -> Lattice:
    """Connect the fluid nodes of a periodic box.

    Parameters
    ----------
    number : ndarray of int32, shape (nz, ny, nx)
        -1 in solids, anything else in the fluid; receives the numbers of the fluid nodes.
    spacing : float
        Distance of nodes, m.
    wall_distance : float
        Where all walls are on the links that end in them, 0 to 1.

    Raises
    ------
    FiltercakeError
        If no node is fluid, or there are more than the index can name.
    """
    fluid = _number_fluid(number)
    if fluid == 0:
        raise FiltercakeError(f"no fluid between the spheres on {number.shape[2]} nodes across: use a finer lattice")
    blocks = -(-fluid // BLOCK)
    places = blocks * DIRECTIONS * BLOCK
    if places > MOST_PLACES:
        raise FiltercakeError(
            f"{fluid:,} fluid nodes: must be at most {MOST_PLACES // DIRECTIONS:,}; use less accuracy"
        )
    source, wall = np.empty(places, dtype=np.int32), np.zeros(places, dtype=np.int8)
    layer = np.full(blocks * BLOCK, -1, dtype=np.int32)
    at_wall = np.int8(round((1.0 - 2.0 * wall_distance) * WALL_SCALE))
    _connect(number, source, wall, layer, at_wall, VELOCITIES, OPPOSITE)
    return Lattice(spacing, (number.shape[0], number.shape[1], number.shape[2]), fluid, source, wall, layer, number)


@cached_njit
def _mark_solids(number: NDArray[np.int32], centre: FloatArray, radius: FloatArray) -> None:
    """Set nodes inside a sphere to -1; centres and radii in spacings, node (k, j, i) at (i, j, k)."""
    nz, ny, nx = number.shape
    for s in range(radius.size):
        x, y, z = centre[s]
        r = radius[s]
        for k in range(math.ceil(z - r), math.floor(z + r) + 1):
            left = r * r - (k - z) ** 2
            if left < 0.0:
                continue
            ry = math.sqrt(left)
            for j in range(math.ceil(y - ry), math.floor(y + ry) + 1):
                rest = left - (j - y) ** 2
                if rest < 0.0:
                    continue
                rx = math.sqrt(rest)
                for i in range(math.ceil(x - rx), math.floor(x + rx) + 1):
                    number[k % nz, j % ny, i % nx] = -1


@cached_njit
def _number_fluid(number: NDArray[np.int32]) -> int:
    """Give the fluid nodes numbers in the order of the rows; return how many there are."""
    flat = number.reshape(-1)
    found = 0
    for n in range(flat.size):
        if flat[n] >= 0:
            flat[n] = found
            found += 1
    return found


@cached_njit
def _connect(
    number: NDArray[np.int32],
    source: NDArray[np.int32],
    wall: NDArray[np.int8],
    layer: NDArray[np.int32],
    at_wall: np.int8,
    velocities: IntArray,
    opposite: IntArray,
) -> None:
    """Fill in where each place streams from, and mark links to walls."""
    nz, ny, nx = number.shape
    directions, block = 19, 64
    fluid = 0
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                n = number[k, j, i]
                if n < 0:
                    continue
                fluid = max(fluid, n + 1)
                layer[n] = k
                base = (n // block) * directions * block + n % block
                for q in range(directions):
                    # what flows in along q comes from behind; a wall there sends back what went towards it
                    back = number[(k - velocities[q, 2]) % nz, (j - velocities[q, 1]) % ny, (i - velocities[q, 0]) % nx]
                    if back < 0:
                        source[base + q * block] = base + q * block
                        wall[base + opposite[q] * block] = at_wall
                    else:
                        source[base + q * block] = (
                            (back // block) * directions * block + opposite[q] * block + back % block
                        )
    for n in range(fluid, layer.size):
        base = (n // block) * directions * block + n % block
        for q in range(directions):
            source[base + q * block] = base + q * block


@cached_njit
def _measure_walls(
    number: NDArray[np.int32], wall: NDArray[np.int8], centre: FloatArray, radius: FloatArray, velocities: IntArray
) -> None:
    """Keep for every link to a wall how far its first sphere is: 1 - 2 q in units of 1/127."""
    nz, ny, nx = number.shape
    directions, block, reach = 19, 64, 1.5
    for s in range(radius.size):
        x, y, z = centre[s]
        r = radius[s]
        outer = (r + reach) ** 2
        for k in range(math.ceil(z - r - reach), math.floor(z + r + reach) + 1):
            for j in range(math.ceil(y - r - reach), math.floor(y + r + reach) + 1):
                rest = outer - (k - z) ** 2 - (j - y) ** 2
                if rest < 0.0:
                    continue
                rx = math.sqrt(rest)
                for i in range(math.ceil(x - rx), math.floor(x + rx) + 1):
                    n = number[k % nz, j % ny, i % nx]
                    if n < 0:
                        continue
                    dx, dy, dz = i - x, j - y, k - z
                    c = dx * dx + dy * dy + dz * dz - r * r
                    base = (n // block) * directions * block + n % block
                    for q in range(1, directions):
                        place = base + q * block
                        if (
                            wall[place] == 0
                            and number[
                                (k + velocities[q, 2]) % nz, (j + velocities[q, 1]) % ny, (i + velocities[q, 0]) % nx
                            ]
                            >= 0
                        ):
                            continue
                        a = 0.0
                        b = 0.0
                        for axis in range(3):
                            e = velocities[q, axis]
                            a += e * e
                            b += e * (dx if axis == 0 else dy if axis == 1 else dz)
                        inner = b * b - a * c
                        if inner < 0.0 or b >= 0.0:
                            continue
                        t = (-b - math.sqrt(inner)) / a
                        if t <= 1.0:
                            near = np.int8(round((1.0 - 2.0 * max(t, 0.0)) * 127.0))
                            wall[place] = max(wall[place], near)
