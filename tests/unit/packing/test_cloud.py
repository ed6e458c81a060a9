"""The initial cloud: Table 1, exact numbers, no overlap, and the same cloud for the same seed."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from filtercake.crystals.csd import CrystalSizeDistribution, mixture
from filtercake.errors import CloudError
from filtercake.packing import cloud as cloud_module
from filtercake.packing.cloud import Cloud, box_length, make_cloud
from filtercake.packing.representation import merge_rare

UM = 1e-6


def smallest_gap(cloud: Cloud) -> float:
    """Brute force over all pairs and their nearest images: least r - R_i - R_j, m."""
    delta = cloud.position[:, None, :] - cloud.position[None, :, :]
    delta[..., :2] -= cloud.length * np.round(delta[..., :2] / cloud.length)
    gap = np.sqrt((delta**2).sum(axis=-1)) - cloud.radius[:, None] - cloud.radius[None, :]
    np.fill_diagonal(gap, np.inf)
    return float(gap.min())


# --- box length: Table 1 -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("small", "printed_um", "floor_um"), [(0.75, 250, 249), (0.50, 282, 282), (0.25, 342, 342)])
def test_table_1_of_the_paper_for_pmma(pmma, small: float, printed_um: int, floor_um: int) -> None:
    length = box_length(pmma(small), 2000, 0.65) / UM
    assert round(length) == printed_um
    assert int(length) == floor_um  # 249.995 of 75/25


@pytest.mark.parametrize(("minutes", "printed_um"), [(15, 5046), (30, 5808), (45, 6352), (60, 6658)])
def test_table_1_of_the_paper_for_alum(alum, minutes: int, printed_um: int) -> None:
    # the printed values are rounded to the nearest: 5807.91 and 6351.97 are printed as 5808 and 6352
    assert round(box_length(alum(minutes)[1].csd, 100_000, 0.60) / UM) == printed_um


def test_box_length_of_equal_spheres_by_hand() -> None:
    # 1000 spheres of 10 um at void fraction 0.65 in L x L x 2L
    length = (1000 * np.pi / 6 * 1e-15 / 0.35 / 2) ** (1 / 3)
    assert box_length(mixture([10 * UM], [1.0]), 1000, 0.65) == pytest.approx(length, rel=1e-13)


@given(st.integers(100, 10_000), st.floats(0.5, 0.9), st.floats(0.1, 10.0))
def test_box_length_scales_with_the_sizes(particles: int, void_fraction: float, k: float) -> None:
    small, large = mixture([20 * UM, 50 * UM], [0.5, 0.5]), mixture([20 * UM * k, 50 * UM * k], [0.5, 0.5])
    once = box_length(small, particles, void_fraction)
    assert box_length(large, particles, void_fraction) == pytest.approx(k * once, rel=1e-12)
    assert box_length(small, 8 * particles, void_fraction) == pytest.approx(2 * once, rel=1e-12)


@given(st.integers(100, 10_000), st.floats(0.5, 0.9), st.floats(0.5, 10.0))
def test_a_deep_box_is_as_deep_as_a_wide_one_of_more_spheres(particles: int, void_fraction: float, c: float) -> None:
    csd = mixture([20 * UM, 50 * UM], [0.5, 0.5])
    deep = box_length(csd, particles, void_fraction, c)
    assert 2.0 * c * deep**3 == pytest.approx(2.0 * box_length(csd, particles, void_fraction) ** 3, rel=1e-12)
    # depth c L of N spheres is L of c^2 N
    assert c * deep == pytest.approx(box_length(csd, 1, void_fraction) * (c**2 * particles) ** (1 / 3), rel=1e-12)


def test_a_deep_cloud_has_the_void_fraction_asked_for(pmma) -> None:
    cloud = make_cloud(pmma(0.5), 1000, 0.65, 3, bed_depth_factor=2.0)
    assert cloud.height == pytest.approx(4.0 * cloud.length)
    assert cloud.void_fraction == pytest.approx(0.65, abs=2e-3)
    assert smallest_gap(cloud) > 0.0 and cloud.position[:, 2].max() > 3.0 * cloud.length


# --- placement -----------------------------------------------------------------------------------------------------


@settings(max_examples=15)
@given(
    st.lists(st.integers(10, 60), min_size=1, max_size=4, unique=True),
    st.integers(60, 300),
    st.floats(0.68, 0.9),
    st.integers(0, 2**63 - 1),
)
def test_no_two_spheres_overlap_even_across_the_periodic_sides(
    sizes: list[int], particles: int, void_fraction: float, seed: int
) -> None:
    csd = CrystalSizeDistribution.from_classes(np.array(sizes) * UM, np.full(len(sizes), 1.0 / len(sizes)))
    cloud = make_cloud(csd, particles, void_fraction, seed)
    assert smallest_gap(cloud) > -1e-12 * cloud.length
    assert np.all((cloud.position[:, :2] >= 0.0) & (cloud.position[:, :2] < cloud.length))
    z = cloud.position[:, 2]
    assert np.all(z - cloud.radius >= -1e-12 * cloud.length)
    assert np.all(z + cloud.radius <= 2.0 * cloud.length * (1.0 + 1e-12))


def test_spheres_do_lie_across_the_periodic_sides(pmma) -> None:
    # the region is filled up to its sides: some sphere must reach over each of them (else images were never tried)
    cloud = make_cloud(pmma(0.5), 2000, 0.65, 7)
    for axis in (0, 1):
        assert np.any(cloud.position[:, axis] < cloud.radius)
        assert np.any(cloud.position[:, axis] > cloud.length - cloud.radius)


def test_class_counts_are_exact(pmma) -> None:
    csd = pmma(0.25)
    cloud = make_cloud(csd, 2000, 0.65, 1)
    diameters, counts = np.unique(2.0 * cloud.radius, return_counts=True)
    assert diameters == pytest.approx(csd.size, rel=1e-15)
    assert counts.tolist() == csd.class_counts(2000).tolist()
    assert cloud.position.shape == (2000, 3)


def test_the_void_fraction_is_the_one_asked_for(pmma) -> None:
    # off only by the rounding of class counts: at most one sphere in each class
    cloud = make_cloud(pmma(0.5), 2000, 0.65, 1)
    one_each = np.pi / 6 * (20e-6**3 + 50e-6**3) / (cloud.length**2 * cloud.height)
    assert cloud.height == pytest.approx(2.0 * cloud.length, rel=1e-15)
    assert abs(cloud.void_fraction - 0.65) < one_each


def test_the_same_seed_gives_the_same_cloud_and_another_seed_another(pmma) -> None:
    first, again, other = (make_cloud(pmma(0.5), 500, 0.65, seed) for seed in (11, 11, 12))
    assert np.array_equal(first.position, again.position)
    assert np.array_equal(first.radius, again.radius)
    assert np.array_equal(first.radius, other.radius)
    assert not np.any(np.all(first.position == other.position, axis=1))


def test_a_cloud_scales_with_its_sizes() -> None:
    small = make_cloud(mixture([20 * UM, 50 * UM], [0.5, 0.5]), 300, 0.65, 3)
    large = make_cloud(mixture([40 * UM, 100 * UM], [0.5, 0.5]), 300, 0.65, 3)
    assert large.position == pytest.approx(2.0 * small.position, rel=1e-12)


def test_the_positions_are_spread_evenly(pmma) -> None:
    # small spheres come last and fill what is left: their mean position is the middle, sd L/sqrt(12 n)
    cloud = make_cloud(pmma(0.75), 2000, 0.65, 5)
    sigma = cloud.length / np.sqrt(12 * 2000)
    middle = cloud.position.mean(axis=0)
    assert np.all(np.abs(middle[:2] - 0.5 * cloud.length) < 4.0 * sigma)
    assert abs(middle[2] - cloud.length) < 4.0 * 2.0 * sigma


def test_a_wide_distribution_is_placed_in_seconds_without_overlap(alum) -> None:
    csd = alum(15)[1].csd
    make_cloud(csd, 300, 0.7, 1)  # compile
    started = time.perf_counter()
    cloud = make_cloud(csd, 20_000, 0.60, 1)
    assert time.perf_counter() - started < 10.0
    counts = merge_rare(csd, 20_000).class_counts(20_000)
    assert np.unique(2.0 * cloud.radius, return_counts=True)[1].tolist() == counts.tolist()
    assert_no_overlap(cloud)


def assert_no_overlap(cloud: Cloud) -> None:
    """Check every pair that could touch, by a tree over the spheres at least as large as each decade of size."""
    box = np.array([cloud.length, cloud.length, 0.0])
    for largest in np.geomspace(cloud.radius.max(), cloud.radius.min(), 6):
        # every pair whose larger sphere is at most `largest`
        members = np.flatnonzero(cloud.radius <= largest * (1.0 + 1e-12))
        lower = largest / (cloud.radius.max() / cloud.radius.min()) ** 0.2
        big = members[cloud.radius[members] >= lower * (1.0 - 1e-12)]
        tree, others = cKDTree(cloud.position[big], boxsize=box), cKDTree(cloud.position[members], boxsize=box)
        near = tree.sparse_distance_matrix(others, 2.0 * largest, output_type="ndarray")
        i, j = big[near["i"]], members[near["j"]]
        gap = near["v"] - cloud.radius[i] - cloud.radius[j]
        assert np.all(gap[i != j] > -1e-12 * cloud.length)


@pytest.mark.slow
def test_the_paper_s_alum_cloud_of_100_000_takes_less_than_half_a_minute(alum) -> None:
    csd = alum(15)[1].csd
    make_cloud(csd, 300, 0.7, 1)  # compile
    started = time.perf_counter()
    cloud = make_cloud(csd, 100_000, 0.60, 1)
    assert time.perf_counter() - started < 30.0
    assert cloud.radius.size == 100_000
    assert_no_overlap(cloud)


# --- refusals ------------------------------------------------------------------------------------------------------


def test_too_dense_a_cloud_is_refused_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    # random sequential addition of equal spheres jams at a solids fraction of 0.384 (Talbot, Schaaf and Tarjus 1991),
    # so that 0.45 never fits
    monkeypatch.setattr(cloud_module, "MAX_ATTEMPTS", 20_000)
    with pytest.raises(CloudError) as caught:
        make_cloud(mixture([30 * UM], [1.0]), 500, 0.55, 1)
    for words in ("of 500 (30 um) found no free place in 20000 tries", "void fraction 0.55", "use a larger void_frac"):
        assert words in str(caught.value)


def test_a_sphere_wider_than_the_box_is_refused() -> None:
    with pytest.raises(CloudError, match=r"largest sphere \(50 um\) is wider than the periodic box .* use more part"):
        make_cloud(mixture([50 * UM], [1.0]), 1, 0.65, 1)


def good_cloud_values() -> dict[str, object]:
    position = np.array([[10.0, 10.0, 10.0], [30.0, 30.0, 30.0]]) * UM
    return {"position": position, "radius": np.full(2, 5 * UM), "length": 50 * UM, "height": 100 * UM}


def test_a_good_cloud_is_accepted() -> None:
    assert Cloud(**good_cloud_values()).radius.size == 2  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"position": np.array([[np.nan, 0, 0], [1, 1, 1]]) * UM}, "position or radius that is not finite"),
        ({"position": np.array([[np.inf, 0, 0], [1, 1, 1]]) * UM}, "position or radius that is not finite"),
        ({"radius": np.array([np.nan, 5 * UM])}, "position or radius that is not finite"),
        ({"radius": np.array([0.0, 5 * UM])}, "not positive"),
        ({"radius": np.array([-1 * UM, 5 * UM])}, "not positive"),
        ({"length": 0.0}, "not positive"),
        ({"length": float("nan")}, "not positive"),
        ({"radius": np.full(3, 5 * UM)}, r"3 radii but positions of shape \(2, 3\)"),
        ({"radius": np.array([26 * UM, 5 * UM])}, r"largest sphere \(52 um\) is wider than the periodic box \(50 um\)"),
        ({"radius": np.empty(0), "position": np.empty((0, 3))}, "holds no sphere"),
    ],
)
def test_no_engine_sees_a_cloud_that_is_none(change: dict[str, object], says: str) -> None:
    with pytest.raises(CloudError, match=says):
        Cloud(**{**good_cloud_values(), **change})  # type: ignore[arg-type]


def test_zero_particles_are_refused(small_csd: CrystalSizeDistribution) -> None:
    with pytest.raises(CloudError):
        make_cloud(small_csd, 0, 0.65, 1)
