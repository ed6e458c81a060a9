"""Overlapping pairs of a packing, against brute force."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filtercake.packing.contacts import (
    find_contacts,
    floor_overlap,
    lens_volume,
    lens_volume_below,
    relative_overlap,
)


def brute_force(position: np.ndarray, radius: np.ndarray, length: float) -> dict[tuple[int, int], float]:
    delta = position[:, None, :] - position[None, :, :]
    delta[..., :2] -= length * np.round(delta[..., :2] / length)
    overlap = radius[:, None] + radius[None, :] - np.sqrt((delta**2).sum(axis=-1))
    i, j = np.nonzero(np.triu(overlap > 0.0, k=1))
    return {(int(a), int(b)): float(overlap[a, b]) for a, b in zip(i, j, strict=True)}


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.integers(2, 80), st.floats(1.0, 30.0))
def test_all_pairs_of_any_width_of_sizes(seed: int, n: int, width: float) -> None:
    rng = np.random.default_rng(seed)
    length = 10.0
    radius = 2.0 * width ** -rng.random(n)  # spread over a factor `width`, largest near 2
    position = rng.uniform([0, 0, 0], [length, length, 12.0], (n, 3))
    found = find_contacts(position, radius, length)
    expected = brute_force(position, radius, length)
    pairs = {tuple(sorted((int(i), int(j)))): float(d) for (i, j), d in zip(found.pairs, found.overlap, strict=True)}
    assert len(pairs) == len(found.overlap)  # no pair twice
    assert pairs.keys() == expected.keys()
    for pair, depth in pairs.items():
        assert depth == pytest.approx(expected[pair], abs=1e-12)


def test_a_contact_across_a_corner_of_the_periodic_box() -> None:
    position = np.array([[0.1, 0.1, 5.0], [9.9, 9.9, 5.0], [5.0, 5.0, 5.0]])
    found = find_contacts(position, np.full(3, 0.2), 10.0)
    assert found.pairs.tolist() in ([[0, 1]], [[1, 0]])
    assert found.overlap[0] == pytest.approx(0.4 - np.sqrt(0.08), rel=1e-12)


def test_there_is_nothing_periodic_about_the_height() -> None:
    position = np.array([[5.0, 5.0, 0.1], [5.0, 5.0, 9.9]])
    assert len(find_contacts(position, np.full(2, 0.5), 10.0).overlap) == 0


def test_spheres_outside_the_box_are_wrapped_and_the_caller_s_array_is_left_alone() -> None:
    position = np.array([[10.0, -0.1, 5.0], [0.0, 9.9, 5.3]])
    before = position.copy()
    found = find_contacts(position, np.full(2, 0.2), 10.0)
    assert found.overlap == pytest.approx([0.1])
    assert np.array_equal(position, before)


def test_overlap_is_measured_by_the_smaller_diameter() -> None:
    position = np.array([[5.0, 5.0, 2.0], [5.0, 5.0, 4.4]])
    radius = np.array([2.0, 0.5])
    found = find_contacts(position, radius, 20.0)
    assert relative_overlap(found, radius) == pytest.approx([0.1])


def test_the_floor_is_touched_from_above_only() -> None:
    position = np.array([[0, 0, 0.9], [0, 0, 1.0], [0, 0, 3.0]])
    assert floor_overlap(position, np.ones(3)) == pytest.approx([0.05, 0.0, 0.0])


def test_the_lens_of_two_equal_spheres_is_two_caps() -> None:
    # R = 1, r = 1: each cap is 1/2 high, pi h^2 (3 R - h) / 3 = 5 pi / 24
    found = find_contacts(np.array([[3.0, 3.0, 2.0], [4.0, 3.0, 2.0]]), np.ones(2), 9.0)
    assert lens_volume(found, np.ones(2)) == pytest.approx([5.0 * np.pi / 12.0], rel=1e-14)


def test_a_sphere_inside_another_is_shared_whole() -> None:
    radius = np.array([1.0, 0.2])
    position = np.array([[3.0, 3.0, 2.0], [3.3, 3.2, 2.1]])
    found = find_contacts(position, radius, 9.0)
    small = 4.0 / 3.0 * np.pi * 0.2**3
    assert lens_volume(found, radius) == pytest.approx([small])
    assert lens_volume_below(np.array([2.1]), found, position, radius, 9.0)[0] == pytest.approx(small / 2.0, rel=1e-9)


@given(
    st.floats(0.2, 1.0),
    st.floats(0.002, 0.9),
    st.floats(0.0, np.pi),
    st.floats(0.0, 2.0 * np.pi),
    st.floats(0.0, 1.0),
)
def test_lenses_below_a_plane(size: float, overlap: float, tilt: float, turn: float, share: float) -> None:
    """Whole under the plane, nothing over it, and what the plane parts adds up, seen from either side."""
    radius = np.array([1.0, size])
    distance = 1.0 + size - overlap * size
    axis = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
    position = np.array([[0.0, 0.0, 5.0], distance * axis + [0.0, 0.0, 5.0]])
    found = find_contacts(position, radius, 9.0)
    whole = lens_volume(found, radius)[0]
    top = (position[:, 2] + radius).min()
    bottom = (position[:, 2] - radius).max()
    assert lens_volume_below(np.array([top]), found, position, radius, 9.0)[0] == pytest.approx(whole, rel=1e-12)
    assert lens_volume_below(np.array([bottom]), found, position, radius, 9.0)[0] == 0.0
    height = bottom + share * (top - bottom)
    below = lens_volume_below(np.array([height]), found, position, radius, 9.0)[0]
    mirrored = position * [1.0, 1.0, -1.0] + [0.0, 0.0, 10.0]
    above = lens_volume_below(np.array([10.0 - height]), found, mirrored, radius, 9.0)[0]
    assert below + above == pytest.approx(whole, rel=1e-3, abs=1e-12)


def test_lenses_across_the_edge_of_the_periodic_box() -> None:
    radius = np.full(2, 0.5)
    position = np.array([[0.1, 2.0, 1.0], [3.9, 2.0, 1.3]])
    moved = (position + np.array([1.0, 0.0, 0.0])) % 4.0
    plane = np.array([1.2])
    volumes = [lens_volume_below(plane, find_contacts(p, radius, 4.0), p, radius, 4.0)[0] for p in (position, moved)]
    assert volumes[0] > 0.0
    assert volumes[0] == pytest.approx(volumes[1], rel=1e-12)
