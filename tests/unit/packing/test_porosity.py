"""Porosity of packings whose porosity is known: clipped spheres, lattices, and a count of random points."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.packing.contacts import find_contacts
from filtercake.packing.porosity import (
    measure,
    paper_count_porosity,
    porosity_profile,
    slab_porosity,
    volume_below,
)
from filtercake.packing.result import Packing
from filtercake.packing.slab import Slab, bed_height, interior_slab, why_too_thin

UM = 1e-6

PAIR = ((1.1, 0.0, 0.0), (1.1, 0.3, 0.35), (2.3, 0.0, 0.0), (2.3, 0.55, -0.2))
"""Two pairs of overlapping spheres: height of the larger one, and how far the smaller one is from it."""

Arrays = tuple[np.ndarray, np.ndarray]


def solids(position: np.ndarray, radius: np.ndarray, length: float, lower: float, upper: float) -> float:
    """Volume of solids between two heights, from the slab's porosity."""
    return (1.0 - slab_porosity(position, radius, length, Slab(lower, upper))) * length**2 * (upper - lower)


def cubic(cells: int, layers: int) -> Arrays:
    """Spheres of diameter 1 that touch on a simple cubic lattice."""
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in (cells, cells, layers)), indexing="ij"), axis=-1)
    position = grid.reshape(-1, 3) + 0.5
    return position, np.full(len(position), 0.5)


def face_centred(cells: int, layers: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Spheres of diameter 1 that touch on a face-centred cubic lattice: positions, radii, lattice constant."""
    a = math.sqrt(2.0)
    basis = np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]]) * a
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in (cells, cells, layers)), indexing="ij"), axis=-1)
    position = (grid.reshape(-1, 1, 3) * a + basis).reshape(-1, 3) + np.array([0.0, 0.0, 0.5])
    return position, np.full(len(position), 0.5), a


def random_bed(seed: int = 1, n: int = 60) -> tuple[np.ndarray, np.ndarray, float]:
    """Spheres of many sizes at random heights (porosity counts each by itself)."""
    rng = np.random.default_rng(seed)
    return rng.uniform([0, 0, 0.3], [4, 4, 6], (n, 3)), rng.uniform(0.05, 0.3, n), 4.0


# --- one sphere ----------------------------------------------------------------------------------------------------


def test_the_cap_of_a_sphere_in_closed_form() -> None:
    # V = pi h^2 (3 R - h) / 3; R = 1, h = 1/2: 5 pi / 24
    centre, radius = np.array([2.0]), np.array([1.0])
    assert volume_below(1.5, centre, radius)[0] == pytest.approx(5.0 * math.pi / 24.0, rel=1e-14)
    assert volume_below(2.0, centre, radius)[0] == pytest.approx(2.0 * math.pi / 3.0, rel=1e-14)
    assert volume_below(3.0, centre, radius)[0] == pytest.approx(4.0 * math.pi / 3.0, rel=1e-14)
    assert volume_below(9.0, centre, radius)[0] == pytest.approx(4.0 * math.pi / 3.0, rel=1e-14)
    assert volume_below(1.0, centre, radius)[0] == 0.0
    assert volume_below(-5.0, centre, radius)[0] == 0.0


@pytest.mark.parametrize(
    ("lower", "upper", "volume"),
    [
        (1.0, 3.0, 4.0 * math.pi / 3.0),  # whole
        (0.0, 5.0, 4.0 * math.pi / 3.0),  # well inside
        (1.5, 2.5, 4.0 * math.pi / 3.0 - 2.0 * 5.0 * math.pi / 24.0),  # clipped above and below: 11 pi / 12
        (2.0, 4.0, 2.0 * math.pi / 3.0),  # upper half
        (3.0, 4.0, 0.0),  # just above it
        (5.0, 6.0, 0.0),
        (0.0, 1.0, 0.0),  # just below it
    ],
)
def test_one_sphere_and_a_slab(lower: float, upper: float, volume: float) -> None:
    position, radius, length = np.array([[1.0, 1.0, 2.0]]), np.array([1.0]), 3.0
    porosity = slab_porosity(position, radius, length, Slab(lower, upper))
    assert porosity == pytest.approx(1.0 - volume / (9.0 * (upper - lower)), abs=1e-14)


@pytest.mark.parametrize("upper", [1.0, 0.5])
def test_a_slab_without_thickness_is_refused(upper: float) -> None:
    with pytest.raises(ValueError, match="has no thickness"):
        slab_porosity(*random_bed(), Slab(1.0, upper))


# --- many spheres --------------------------------------------------------------------------------------------------


def test_slab_porosity_against_a_count_of_random_points() -> None:
    # disjoint spheres in a box periodic sideways; 4e5 points: sd sqrt(p q / n) = 7e-4, and 4 sd allowed
    rng = np.random.default_rng(20)
    length, slab = 4.0, Slab(0.8, 2.9)
    position, radius = np.empty((0, 3)), np.empty(0)
    while len(radius) < 60:
        p, r = rng.uniform([0, 0, 0.3], [4, 4, 4]), rng.uniform(0.15, 0.5)
        d = position - p
        d[:, :2] -= length * np.round(d[:, :2] / length)
        if np.all(np.linalg.norm(d, axis=1) > radius + r):
            position, radius = np.vstack([position, p]), np.append(radius, r)
    points = rng.uniform([0, 0, slab.lower], [length, length, slab.upper], (400_000, 3))
    inside = np.zeros(len(points), dtype=bool)
    for p, r in zip(position, radius, strict=True):
        d = points - p
        d[:, :2] -= length * np.round(d[:, :2] / length)
        inside |= (d**2).sum(axis=1) < r**2
    porosity = slab_porosity(position, radius, length, slab)
    assert 0.7 < porosity < 0.95
    assert porosity == pytest.approx(1.0 - inside.mean(), abs=4.0 * np.sqrt(inside.mean() * 0.9 / len(points)))


def test_what_two_spheres_share_counts_once() -> None:
    # a chain of overlapping pairs across the slab's faces, against a count of random points: 4 sd allowed
    rng = np.random.default_rng(3)
    length, slab = 4.0, Slab(1.0, 2.0)
    position = np.array([[x + dx, y, z + dz] for x in (0.5, 2.5) for y in (0.6, 2.6) for z, dx, dz in PAIR])
    radius = np.tile([0.5, 0.3], 8)
    assert len(find_contacts(position, radius, length).overlap) == 8
    points = rng.uniform([0, 0, slab.lower], [length, length, slab.upper], (1_000_000, 3))
    inside = np.zeros(len(points), dtype=bool)
    for p, r in zip(position, radius, strict=True):
        inside |= ((points - p) ** 2).sum(axis=1) < r**2
    error = 4.0 * math.sqrt(inside.mean() / len(points))
    assert slab_porosity(position, radius, length, slab) == pytest.approx(1.0 - inside.mean(), abs=error)
    twice = (volume_below(2.0, position[:, 2], radius) - volume_below(1.0, position[:, 2], radius)).sum() / 16.0
    assert twice - inside.mean() > 4.0 * error


@pytest.mark.parametrize("lower", [0.0, 0.3, 1.0, 1.77])
def test_a_simple_cubic_lattice_over_whole_periods(lower: float) -> None:
    position, radius = cubic(3, 8)
    for periods in (1, 3, 5):
        porosity = slab_porosity(position, radius, 3.0, Slab(lower, lower + periods))
        assert porosity == pytest.approx(1.0 - math.pi / 6.0, abs=1e-13)


def test_a_simple_cubic_lattice_over_half_a_period() -> None:
    # the middle half of a layer, |z| < R/2, holds 11/16 of each sphere
    position, radius = cubic(2, 4)
    porosity = slab_porosity(position, radius, 2.0, Slab(1.25, 1.75))
    assert porosity == pytest.approx(1.0 - math.pi / 6.0 * (11.0 / 16.0) * 2.0, abs=1e-13)


@pytest.mark.parametrize("lower_periods", [0.5, 0.83, 1.0])
def test_a_face_centred_cubic_lattice_over_whole_periods(lower_periods: float) -> None:
    position, radius, a = face_centred(2, 5)
    slab = Slab(0.5 + lower_periods * a, 0.5 + (lower_periods + 2.0) * a)
    porosity = slab_porosity(position, radius, 2.0 * a, slab)
    assert porosity == pytest.approx(1.0 - math.pi / (3.0 * math.sqrt(2.0)), abs=1e-13)


cuts = st.lists(st.floats(-1.0, 8.0), min_size=3, max_size=3, unique=True).filter(
    lambda c: min(abs(c[0] - c[1]), abs(c[1] - c[2]), abs(c[0] - c[2])) > 1e-3
)


@given(cuts, st.integers(0, 1000))
def test_slabs_add_up(heights: list[float], seed: int) -> None:
    a, b, c = sorted(heights)
    bed = random_bed(seed, 20)
    assert solids(*bed, a, b) + solids(*bed, b, c) == pytest.approx(solids(*bed, a, c), abs=1e-10)


@given(st.integers(0, 1000), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_a_shift_sideways_changes_nothing(seed: int, dx: float, dy: float) -> None:
    position, radius, length = random_bed(seed, 20)
    moved = position.copy()
    moved[:, :2] = (moved[:, :2] + [dx, dy]) % length
    slab = Slab(0.7, 4.1)
    assert slab_porosity(moved, radius, length, slab) == slab_porosity(position, radius, length, slab)
    assert paper_count_porosity(moved, radius, length) == paper_count_porosity(position, radius, length)


@given(st.integers(0, 1000), st.floats(0.01, 100.0))
def test_porosity_has_no_unit(seed: int, k: float) -> None:
    position, radius, length = random_bed(seed, 20)
    once = slab_porosity(position, radius, length, Slab(0.7, 4.1))
    again = slab_porosity(k * position, k * radius, k * length, Slab(0.7 * k, 4.1 * k))
    assert again == pytest.approx(once, abs=1e-12)


def test_the_profile_averages_to_the_slab() -> None:
    position, radius, length = random_bed()
    edges = np.array([0.5, 0.6, 1.1, 2.0, 2.05, 3.7])
    profile = porosity_profile(position, radius, length, edges)
    assert profile.shape == (5,)
    mean = np.average(profile, weights=np.diff(edges))
    assert mean == pytest.approx(slab_porosity(position, radius, length, Slab(0.5, 3.7)), abs=1e-13)


def test_the_profile_of_a_lattice_follows_its_layers() -> None:
    position, radius = cubic(2, 4)
    profile = porosity_profile(position, radius, 2.0, np.arange(0.0, 4.01, 0.25))
    # quarters of a layer: outer ones hold 5/32 of each sphere, inner ones 11/32
    outer, inner = (1.0 - math.pi / 6.0 * part / 0.25 for part in (5 / 32, 11 / 32))
    assert profile == pytest.approx([outer, inner, inner, outer] * 4, abs=1e-13)


# --- as published --------------------------------------------------------------------------------------------------


def test_the_published_count_takes_spheres_whole_by_centre() -> None:
    # L = 2: centres at 0.5, 2.0 (on the edge: inside) and 2.1 (outside); radius 0.5
    position = np.array([[1, 1, 0.5], [1, 1, 2.0], [1, 1, 2.1]])
    assert paper_count_porosity(position, np.full(3, 0.5), 2.0) == pytest.approx(1.0 - 2.0 * math.pi / 6.0 / 8.0)


def test_the_published_count_of_a_lattice_as_high_as_wide() -> None:
    position, radius = cubic(4, 7)
    assert paper_count_porosity(position, radius, 4.0) == pytest.approx(1.0 - math.pi / 6.0, abs=1e-13)


# --- height and interior -------------------------------------------------------------------------------------------


def test_the_height_of_even_layers() -> None:
    position, radius = cubic(2, 6)
    assert bed_height(position, radius) == pytest.approx(6.0, rel=1e-14)


def test_the_height_of_an_even_column_of_mixed_spheres() -> None:
    # mean height weighted by volume: a large sphere counts eight small ones
    position = np.array([[0, 0, 1.0], [0, 0, 4.0]])
    assert bed_height(position, np.array([1.0, 0.5])) == pytest.approx(2.0 * (8.0 * 1.0 + 4.0) / 9.0, rel=1e-14)


def test_the_interior_leaves_out_a_largest_diameter_at_each_end() -> None:
    position, radius = cubic(2, 6)
    slab = interior_slab(position, radius)
    assert (slab.lower, slab.upper, slab.thickness) == pytest.approx((1.0, 5.0, 4.0), rel=1e-13)


@pytest.mark.parametrize(("layers", "thick_enough"), [(2, False), (3, True), (4, True)])
def test_a_bed_needs_an_interior_of_one_largest_diameter(layers: int, thick_enough: bool) -> None:
    position, radius = cubic(2, layers)
    slab = interior_slab(position, radius)
    reason = why_too_thin(Slab(slab.lower, slab.upper + 1e-12), radius)
    assert (reason is None) == thick_enough


def test_a_shallow_bed_says_by_how_much() -> None:
    reason = why_too_thin(Slab(50 * UM, 70 * UM), np.array([10 * UM, 25 * UM]))
    assert reason is not None
    assert "20 um thick" in reason
    assert "50 um of the largest sphere" in reason
    assert "use more particles" in reason
    inverted = why_too_thin(Slab(50 * UM, 20 * UM), np.array([25 * UM]))
    assert inverted is not None
    assert "interior is 0 um thick" in inverted


# --- all of them at once -------------------------------------------------------------------------------------------


def test_measuring_a_lattice(make_scene) -> None:
    position, radius = cubic(4, 8)
    packing = Packing(position * 40 * UM, radius * 40 * UM, 4 * 40 * UM)
    found = measure(packing, make_scene(cohesion=50e3))
    cubic_porosity = 1.0 - math.pi / 6.0
    assert found.interior == pytest.approx(cubic_porosity, abs=1e-12)
    assert found.from_floor == pytest.approx(cubic_porosity, abs=1e-12)
    assert found.paper_count == pytest.approx(cubic_porosity, abs=1e-12)
    assert (found.slab.lower / UM, found.slab.upper / UM) == pytest.approx((40.0, 280.0))
    # 3 (1 - eps) d_eq/d with d_eq/d = (3 pi s (1 - nu^2) / E)^2 / 4 = 0.2047 %
    overlap = (3 * math.pi * 50e3 * 0.96 / 5e6) ** 2 / 4
    assert found.compaction == pytest.approx(3 * (1 - cubic_porosity) * overlap, rel=1e-10)


def test_a_bed_lower_than_the_box_is_wide_counts_no_air_above_it(make_scene) -> None:
    position, radius = cubic(6, 4)
    found = measure(Packing(position * UM, radius * UM, 6 * UM), make_scene())
    assert found.from_floor == pytest.approx(1.0 - math.pi / 6.0, abs=1e-12)
    # the published count does: 4 of 6 layers
    assert found.paper_count == pytest.approx(1.0 - math.pi / 6.0 * 4 / 6, abs=1e-12)


def test_paper_count_goes_as_deep_as_the_column() -> None:
    position = np.array([[1.0, 1.0, z] for z in (0.5, 1.5, 2.5, 3.5, 4.5)])
    radius = np.full(5, 0.5)
    assert paper_count_porosity(position, radius, 2.0, 2.0) == pytest.approx(1.0 - 4.0 * math.pi / 6.0 / 16.0)
    assert paper_count_porosity(position, radius, 2.0, 1.0) == paper_count_porosity(position, radius, 2.0)
