"""Stokes flow around spheres on a staggered grid, compiled: which faces are open, and the operators between them.

Lengths are in node spacings. Grids have the axes x, y, z; the velocity component along an axis sits on the low face of
each cell along that axis. Open faces, those whose middle is fluid, are numbered one component after the other.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from filtercake.packing.compiled import cached_njit
from filtercake.units import FloatArray

Indices = NDArray[np.int32]
Reals = NDArray[Any]
"""Either precision."""

PLATE = -1
"""Owner of what lies in the plate; a sphere's is its number from 1, that of fluid 0."""
CLOSEST = 1e-3
"""Walls nearer than this to a face's middle are taken to be this far."""


@cached_njit
def paint_spheres(owner: Indices, centre: FloatArray, radius: FloatArray, offset: FloatArray) -> None:
    """Enter every sphere in the nodes (nx, ny, nz), at ``offset`` from whole numbers, that it covers; it wraps."""
    nx, ny, nz = owner.shape
    for s in range(radius.size):
        x, y, z, r = centre[s, 0] - offset[0], centre[s, 1] - offset[1], centre[s, 2] - offset[2], radius[s]
        for i in range(math.ceil(x - r), math.floor(x + r) + 1):
            in_plane = r * r - (i - x) ** 2
            if in_plane <= 0.0:
                continue
            reach = math.sqrt(in_plane)
            for j in range(math.ceil(y - reach), math.floor(y + reach) + 1):
                in_row = in_plane - (j - y) ** 2
                if in_row <= 0.0:
                    continue
                half = math.sqrt(in_row)
                for k in range(math.ceil(z - half), math.floor(z + half) + 1):
                    owner[i % nx, j % ny, k % nz] = s + 1


@cached_njit
def number_open(owner: Indices) -> Indices:
    """Give the open faces numbers in the order of memory, the others -1."""
    number = np.full(owner.shape, -1, dtype=np.int32)
    count = 0
    for face in np.ndindex(owner.shape):
        if owner[face] == 0:
            number[face] = count
            count += 1
    return number


@cached_njit
def _sphere_distance(
    away: FloatArray, axis: int, sign: int, nodes: tuple[int, int, int], centre: FloatArray, radius: float
) -> float:
    """Distance along an axis from a point to a sphere that covers the next node; ``away`` is the point."""
    square, along = 0.0, 0.0
    for a in range(3):
        step = sign if a == axis else 0
        apart = centre[a] - away[a] - step
        apart += step - nodes[a] * round(apart / nodes[a])  # the image that covers the next node
        square += apart * apart
        if a == axis:
            along = sign * apart
    return along - math.sqrt(max(along * along - square + radius * radius, 0.0))


@cached_njit
def connect(
    owner: Indices,
    number: Indices,
    centre: FloatArray,
    radius: FloatArray,
    half_plate: float,
    neighbour: Indices,
    diagonal: Reals,
    cell: Indices,
) -> None:
    """Fill in, for every open face, its neighbours, the diagonal of the viscous operator and the cells it joins.

    A neighbour behind a wall is the last entry, which holds no velocity; the wall at distance t < 1 adds 1/t to the
    diagonal, an open neighbour 1.

    Parameters
    ----------
    owner, number : ndarray of int, shape (3, nx, ny, nz)
        What covers each face's middle; the faces' numbers.
    centre, radius : ndarray, shapes (n, 3) and (n,)
        Spheres, in node spacings.
    half_plate : float
        Half the thickness of a plate in the plane x = 0, in node spacings.
    neighbour, diagonal, cell : ndarray, shapes (m, 6), (m,) and (m, 2)
        Results; cells count in the order of memory, the one on the low side first.
    """
    _, nx, ny, nz = owner.shape
    nodes = (nx, ny, nz)
    place = np.zeros(3)
    for c, i, j, k in np.ndindex(owner.shape):
        if owner[c, i, j, k] != 0:
            continue
        m = number[c, i, j, k]
        place[0], place[1], place[2] = i + 0.5, j + 0.5, k + 0.5
        place[c] -= 0.5
        diagonal[m] = 0.0
        for side in range(6):
            axis, sign = side // 2, 1 - 2 * (side % 2)
            ii = (i + (sign if axis == 0 else 0)) % nx
            jj = (j + (sign if axis == 1 else 0)) % ny
            kk = (k + (sign if axis == 2 else 0)) % nz
            wall = owner[c, ii, jj, kk]
            if wall == 0:
                neighbour[m, side] = number[c, ii, jj, kk]
                diagonal[m] += 1.0
                continue
            neighbour[m, side] = neighbour.shape[0]
            if wall == PLATE:
                distance = (nx - place[0] if sign > 0 else place[0]) - half_plate
            else:
                distance = _sphere_distance(place, axis, sign, nodes, centre[wall - 1], radius[wall - 1])
            diagonal[m] += 1.0 / min(max(distance, CLOSEST), 1.0)
        low = ((i - (c == 0)) % nx, (j - (c == 1)) % ny, (k - (c == 2)) % nz)
        cell[m, 0] = (low[0] * ny + low[1]) * nz + low[2]
        cell[m, 1] = (i * ny + j) * nz + k


@cached_njit(fastmath=True)
def add_viscous(velocity: Reals, neighbour: Indices, diagonal: Reals, out: Reals) -> None:
    """Add minus the Laplacian of the velocity (m + 1 entries, the last 0)."""
    for m in range(neighbour.shape[0]):
        near = neighbour[m]
        total = velocity[near[0]] + velocity[near[1]] + velocity[near[2]]
        total += velocity[near[3]] + velocity[near[4]] + velocity[near[5]]
        out[m] += diagonal[m] * velocity[m] - total


@cached_njit(fastmath=True)
def smooth(
    velocity: Reals,
    change: Reals,
    wanted: Reals,
    neighbour: Indices,
    diagonal: Reals,
    keep: np.float32,
    step: np.float32,
    out: Reals,
) -> None:
    """One step of Chebyshev's iteration: a new change of ``keep`` of the old one and ``step`` of the residual."""
    for m in range(neighbour.shape[0]):
        near = neighbour[m]
        total = velocity[near[0]] + velocity[near[1]] + velocity[near[2]]
        total += velocity[near[3]] + velocity[near[4]] + velocity[near[5]]
        residual = wanted[m] + total - diagonal[m] * velocity[m]
        change[m] = keep * change[m] + step * residual / diagonal[m]
        out[m] = velocity[m] + change[m]


@cached_njit
def add_gradient(pressure: Reals, cell: Indices, out: Reals) -> None:
    """Add the gradient of the pressure to the faces."""
    for m in range(cell.shape[0]):
        out[m] += pressure[cell[m, 1]] - pressure[cell[m, 0]]


@cached_njit
def add_inflow(velocity: Reals, cell: Indices, out: Reals) -> None:
    """Add what flows into each cell: the transpose of the gradient."""
    for m in range(cell.shape[0]):
        out[cell[m, 1]] += velocity[m]
        out[cell[m, 0]] -= velocity[m]
