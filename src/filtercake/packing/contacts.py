"""Overlapping pairs of a packing, for any width of size distribution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from filtercake.packing.cloud import size_levels
from filtercake.units import FloatArray, IntArray


@dataclass(frozen=True)
class Contacts:
    """Overlapping pairs.

    Attributes
    ----------
    pairs : ndarray, shape (m, 2)
        Indices of the spheres.
    overlap : ndarray, shape (m,)
        Depth R_i + R_j - r, m.
    """

    pairs: IntArray
    overlap: FloatArray


def find_contacts(position: FloatArray, radius: FloatArray, length: float) -> Contacts:
    """Find every overlapping pair in a box periodic in x and y.

    Spheres are searched by size level, so that a wide distribution costs no more than its contacts. Positions (n, 3),
    radii (n,) and the side of the box in m.
    """
    wrapped = position.copy()
    wrapped[:, :2] %= length
    wrapped[:, :2][wrapped[:, :2] >= length] = 0.0
    wrapped[:, 2] -= wrapped[:, 2].min()
    box = np.array([length, length, 0.0])
    level = size_levels(radius)
    members = [np.flatnonzero(level == k) for k in np.unique(level)]
    trees = [scipy.spatial.cKDTree(wrapped[m], boxsize=box) for m in members]
    first, second, depth = [], [], []
    for a, coarse in enumerate(members):
        for b in range(a, len(members)):
            fine = members[b]
            reach = float(radius[coarse].max() + radius[fine].max())
            near = trees[a].sparse_distance_matrix(trees[b], reach, output_type="ndarray")
            i, j = coarse[near["i"]], fine[near["j"]]
            overlap = radius[i] + radius[j] - near["v"]
            keep = (overlap > 0.0) & ((i < j) if a == b else True)
            first.append(i[keep])
            second.append(j[keep])
            depth.append(overlap[keep])
    pairs = np.column_stack([np.concatenate(first), np.concatenate(second)])
    return Contacts(pairs, np.concatenate(depth))


def relative_overlap(contacts: Contacts, radius: FloatArray) -> FloatArray:
    """Overlap of each pair over the diameter of its smaller sphere, shape (m,)."""
    smaller = np.minimum(radius[contacts.pairs[:, 0]], radius[contacts.pairs[:, 1]])
    return np.asarray(contacts.overlap / (2.0 * smaller))


def floor_overlap(position: FloatArray, radius: FloatArray) -> FloatArray:
    """Overlap of each sphere with the floor at z = 0 over its diameter, shape (n,), 0 where it doesn't touch."""
    return np.asarray(np.maximum(radius - position[:, 2], 0.0) / (2.0 * radius))
