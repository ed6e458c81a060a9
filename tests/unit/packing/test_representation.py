"""What N spheres hold of a distribution, and when that is another distribution."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.crystals.csd import CrystalSizeDistribution, Truncation, mixture
from filtercake.packing.cloud import make_cloud
from filtercake.packing.representation import merge_rare, particles_for, represent

UM = 1e-6


def test_one_large_crystal_in_thousands_cannot_be_left_out() -> None:
    """5 and 100 um half and half: 2000 spheres hold a quarter of a large one; all voids would be those of one size."""
    csd = mixture([5 * UM, 100 * UM], [0.5, 0.5])
    found = represent(csd, 2000)
    assert (found.merged, found.share) == (1, pytest.approx(0.5))
    assert found.porosity_shift == pytest.approx(0.36 - 0.22, abs=0.02)
    # 8001 spheres hold one large crystal: by volume, half
    assert particles_for(csd, 0.002, 2_000_000) == pytest.approx(8001, abs=1)
    assert abs(represent(csd, 8001).porosity_shift) < 1e-6
    assert particles_for(csd, 0.002, 5000) is None


def test_the_alum_of_the_paper_is_represented(
    alum: Callable[[int], tuple[CrystalSizeDistribution, Truncation]],
) -> None:
    for minutes in (15, 30, 45, 60):
        csd = alum(minutes)[1].csd
        found = represent(csd, 25_000)
        assert 5 <= found.merged <= 20
        assert 0.005 < found.share < 0.03
        assert abs(found.porosity_shift) < 0.0005
        spheres = make_cloud(csd, 25_000, 0.6, 1, 2.0).radius
        lost = 1.0 - (8.0 * spheres**3).sum() / (25_000 * (csd.number_fraction @ csd.size**3))
        assert abs(lost) < 0.005


def test_a_distribution_without_rare_classes_is_left_alone() -> None:
    csd = mixture([20 * UM, 50 * UM], [0.5, 0.5])
    assert merge_rare(csd, 2000) is csd
    assert represent(csd, 2000).merged == 0
    assert represent(csd, 2000).share == 0.0


@given(
    st.lists(st.tuples(st.floats(1.0, 200.0), st.floats(0.01, 1.0)), min_size=1, max_size=30),
    st.integers(1, 5000),
)
def test_merging_conserves_volume_and_number(classes: list[tuple[float, float]], particles: int) -> None:
    size, volume = np.array(classes).T
    csd = CrystalSizeDistribution.from_classes(size * UM, volume / volume.sum())
    merged = merge_rare(csd, particles)
    assert merged.volume_fraction.sum() == pytest.approx(1.0, abs=1e-12)
    per_volume = (csd.volume_fraction / csd.size**3).sum()
    assert (merged.volume_fraction / merged.size**3).sum() == pytest.approx(per_volume, rel=1e-9)
    assert csd.smallest * (1 - 1e-12) <= merged.smallest <= merged.largest <= csd.largest * (1 + 1e-12)
    if merged.size.size > 1:
        assert (particles * merged.number_fraction).min() >= 1.0 - 1e-9
        assert (merged.class_counts(particles) >= 1).all()


def test_a_cloud_holds_no_fewer_classes_than_it_can() -> None:
    csd = mixture([10 * UM, 40 * UM, 60 * UM, 80 * UM], [0.4, 0.3, 0.2, 0.1])
    counts = 500 * csd.number_fraction
    assert (counts < 1.0).sum() == 1
    radius = make_cloud(csd, 500, 0.7, 3).radius
    solids = (4.0 / 3.0 * np.pi * radius**3).sum()
    assert solids == pytest.approx(500 * csd.mean_particle_volume, rel=0.15)
    assert np.unique(radius).size == merge_rare(csd, 500).size.size
