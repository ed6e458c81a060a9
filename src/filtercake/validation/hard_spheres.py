"""Hard spheres in a periodic cell by the Monte Carlo method: random arrays without gravity, contacts or a floor.

Spheres start anywhere, overlapping; moves that deepen no sphere's overlaps are taken until there are none, and those
that make none from then on (Metropolis et al., J. Chem. Phys. 21 (1953) 1087).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from filtercake.packing.compiled import cached_njit
from filtercake.units import FloatArray

SWEEPS: Final = 2000
MOST_SWEEPS: Final = 100_000
"""Moves of each sphere in which overlaps must vanish."""
TAKEN: Final = 0.4
"""Share of moves that is to be taken: it sets their reach."""


@dataclass(frozen=True)
class Species:
    """Spheres of one size: how many, their diameter (m), and between which heights (m) their centres stay."""

    count: int
    diameter: float
    low: float = 0.0
    high: float = math.inf


def arrange(
    species: Sequence[Species], box: FloatArray, seed: Sequence[int], sweeps: int = SWEEPS
) -> tuple[FloatArray, FloatArray]:
    """Arrange hard spheres at random; return their centres (n, 3) and radii (n,), m.

    Parameters
    ----------
    species : sequence of Species
        The spheres. Centres that have no bounds wander through the periodic cell.
    box : ndarray, shape (3,)
        Sides of the cell, m.
    seed : sequence of int
        Seed.
    sweeps : int
        Moves of each sphere once none overlap.

    Raises
    ------
    ValueError
        If overlaps do not vanish: the array is too dense.
    """
    random = np.random.default_rng(list(seed))
    radius = np.repeat([0.5 * kind.diameter for kind in species], [kind.count for kind in species])
    bounds = np.array([(kind.low, min(kind.high, box[2])) for kind in species for _ in range(kind.count)])
    position = random.random((radius.size, 3)) * box
    position[:, 2] = bounds[:, 0] + random.random(radius.size) * (bounds[:, 1] - bounds[:, 0])
    step, left = 0.2 * float(radius.min()), sweeps
    for _ in range(MOST_SWEEPS):
        overlapping, taken = _sweep(position, radius, box, bounds, step, random.random((radius.size, 3)))
        step = min(step * (1.02 if taken > TAKEN * radius.size else 0.98), 0.5 * float(box.min()))
        left -= not overlapping
        if left == 0:
            return position, radius
    raise ValueError(f"spheres overlap after {MOST_SWEEPS:,} sweeps: too dense")


def deepest_overlap(position: FloatArray, radius: FloatArray, box: FloatArray) -> float:
    """Return the deepest overlap over the sum of both radii; negative where no spheres touch."""
    apart = position[:, None, :] - position[None, :, :]
    apart -= box * np.round(apart / box)
    relative = 1.0 - np.linalg.norm(apart, axis=2) / (radius[:, None] + radius[None, :])
    np.fill_diagonal(relative, -math.inf)
    return float(relative.max())


@cached_njit
def _sweep(
    position: FloatArray, radius: FloatArray, box: FloatArray, bounds: FloatArray, step: float, draws: FloatArray
) -> tuple[int, int]:
    """Try to move each sphere once; return how many overlapped before and how many moved."""
    overlapping, taken = 0, 0
    for i in range(radius.size):
        before = _overlap(position, radius, box, i, position[i, 0], position[i, 1], position[i, 2])
        overlapping += before > 0.0
        x = (position[i, 0] + step * (2.0 * draws[i, 0] - 1.0)) % box[0]
        y = (position[i, 1] + step * (2.0 * draws[i, 1] - 1.0)) % box[1]
        z = position[i, 2] + step * (2.0 * draws[i, 2] - 1.0)
        if bounds[i, 0] == 0.0 and bounds[i, 1] == box[2]:
            z %= box[2]
        elif not bounds[i, 0] <= z < bounds[i, 1]:
            continue
        if _overlap(position, radius, box, i, x, y, z) <= before:
            position[i, 0], position[i, 1], position[i, 2] = x, y, z
            taken += 1
    return overlapping, taken


@cached_njit
def _overlap(position: FloatArray, radius: FloatArray, box: FloatArray, i: int, x: float, y: float, z: float) -> float:
    """Sum of the overlaps (m) of sphere i at a place."""
    total = 0.0
    for j in range(radius.size):
        reach = radius[i] + radius[j]
        dz = abs(position[j, 2] - z)
        dz = min(dz, box[2] - dz)
        if dz >= reach:
            continue
        dx, dy = abs(position[j, 0] - x), abs(position[j, 1] - y)
        dx, dy = min(dx, box[0] - dx), min(dy, box[1] - dy)
        square = dx * dx + dy * dy + dz * dz
        if square < reach * reach and j != i:
            total += reach - math.sqrt(square)
    return total
