"""Overlapping pairs of a packing, for any width of size distribution."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from filtercake.packing.cloud import size_levels
from filtercake.units import FloatArray, IntArray

NODES = 96
"""Heights at which a lens is cut when a plane passes through it."""


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
    from scipy import spatial

    wrapped = position.copy()
    wrapped[:, :2] %= length
    wrapped[:, :2][wrapped[:, :2] >= length] = 0.0
    wrapped[:, 2] -= wrapped[:, 2].min()
    box = np.array([length, length, 0.0])
    level = size_levels(radius)
    members = [np.flatnonzero(level == k) for k in np.unique(level)]
    trees = [spatial.cKDTree(wrapped[m], boxsize=box) for m in members]
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


def lens_volume(contacts: Contacts, radius: FloatArray) -> FloatArray:
    """Volume that the two spheres of each pair share, m3, shape (m,), in closed form.

    ``pi (R_i + R_j - r)^2 (r^2 + 2 r (R_i + R_j) - 3 (R_i - R_j)^2) / (12 r)``; a sphere that lies wholly inside the
    other shares all of its volume.
    """
    first, second = (radius[contacts.pairs[:, k]] for k in (0, 1))
    total, depth = first + second, contacts.overlap
    distance = total - depth
    smaller = np.minimum(first, second)
    inside = distance <= np.abs(first - second)
    safe = np.where(inside, 1.0, distance)
    lens = np.pi * depth**2 * (safe**2 + 2.0 * safe * total - 3.0 * (first - second) ** 2) / (12.0 * safe)
    return np.asarray(np.where(inside, 4.0 / 3.0 * np.pi * smaller**3, lens))


def lens_volume_below(
    heights: FloatArray, contacts: Contacts, position: FloatArray, radius: FloatArray, length: float
) -> FloatArray:
    """Volume below horizontal planes that pairs of spheres share, m3, summed over all pairs, shape (k,).

    Lenses that a plane cuts are integrated over height, with the area that two circles share in closed form.

    Parameters
    ----------
    heights : ndarray, shape (k,)
        Heights of the planes, m.
    contacts : Contacts
        The overlapping pairs.
    position, radius : ndarray, shapes (n, 3) and (n,)
        Centres and radii, m.
    length : float
        Side of the box, periodic in x and y, m.
    """
    i, j = contacts.pairs[:, 0], contacts.pairs[:, 1]
    apart = position[j] - position[i]
    apart[:, :2] -= length * np.round(apart[:, :2] / length)
    top = position[i, 2] + _lens_top(apart, radius[i], radius[j])
    bottom = position[i, 2] - _lens_top(apart * [1.0, 1.0, -1.0], radius[i], radius[j])
    lens = lens_volume(contacts, radius)
    found = np.empty(heights.size)
    for k, height in enumerate(heights):
        cut = (bottom < height) & (height < top)
        found[k] = lens[top <= height].sum()
        if cut.any():
            spheres = [(radius[of[cut]] ** 2, position[of[cut], 2]) for of in (i, j)]
            found[k] += _cut_lenses(height, bottom[cut], spheres, np.sum(apart[cut, :2] ** 2, axis=1))
    return found


def _cut_lenses(
    height: float, bottom: FloatArray, spheres: list[tuple[FloatArray, FloatArray]], sideways: FloatArray
) -> float:
    """Volume of lenses between their lowest points and a height, from squared radii and heights of their spheres."""
    # z = middle - half cos(t): the square roots at both ends of a lens become smooth
    angle, weight = _quadrature()
    half = 0.5 * (height - bottom)[:, np.newaxis]
    z = bottom[:, np.newaxis] + half * (1.0 - np.cos(angle))
    first, second = (
        np.maximum(square[:, np.newaxis] - (z - centre[:, np.newaxis]) ** 2, 0.0) for square, centre in spheres
    )
    area = shared_area(first, second, sideways[:, np.newaxis])
    return float(np.sum(half * np.sin(angle) * area * weight))


@cache
def _quadrature() -> tuple[FloatArray, FloatArray]:
    """Angles from 0 to pi, and weights, of Gauss and Legendre."""
    angle, weight = np.polynomial.legendre.leggauss(NODES)
    return 0.5 * np.pi * (angle + 1.0), 0.5 * np.pi * weight


def _lens_top(apart: FloatArray, first: FloatArray, second: FloatArray) -> FloatArray:
    """Height of the lens's highest point over the first centre: a pole inside the other sphere, or on their circle."""
    up = apart[:, 2]
    distance = np.sqrt(np.sum(apart**2, axis=1))
    sideways = np.sum(apart[:, :2] ** 2, axis=1)
    along = (distance**2 + first**2 - second**2) / (2.0 * distance)
    circle = np.sqrt(np.maximum(first**2 - along**2, 0.0))
    on_circle = along * up / distance + circle * np.sqrt(sideways) / distance
    own_pole = sideways + (first - up) ** 2 <= second**2
    other_pole = sideways + (up + second) ** 2 <= first**2
    return np.asarray(np.where(own_pole, first, np.where(other_pole, up + second, on_circle)))


def shared_area(first: FloatArray, second: FloatArray, distance: FloatArray) -> FloatArray:
    """Area that two circles share, from the squares of their radii and of the distance of their centres."""
    a, b, d = np.sqrt(first), np.sqrt(second), np.sqrt(np.maximum(distance, np.finfo(np.float64).tiny))
    with np.errstate(divide="ignore", invalid="ignore"):
        alpha = np.arccos(np.clip((distance + first - second) / (2.0 * d * a), -1.0, 1.0))
        beta = np.arccos(np.clip((distance + second - first) / (2.0 * d * b), -1.0, 1.0))
        lens = first * (alpha - 0.5 * np.sin(2.0 * alpha)) + second * (beta - 0.5 * np.sin(2.0 * beta))
    apart, inside = d >= a + b, d <= np.abs(a - b)
    return np.asarray(np.where(apart, 0.0, np.where(inside, np.pi * np.minimum(first, second), lens)))


def floor_overlap(position: FloatArray, radius: FloatArray) -> FloatArray:
    """Overlap of each sphere with the floor at z = 0 over its diameter, shape (n,), 0 where it doesn't touch."""
    return np.asarray(np.maximum(radius - position[:, 2], 0.0) / (2.0 * radius))
