"""Seeds that grow: one size in closed form, balances of mass and number, limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.crystals.csd import CrystalSizeDistribution, mixture
from filtercake.crystals.seeded_batch import grow_seeds
from filtercake.errors import CrystallizerError

UM = 1e-6
seeds = st.lists(st.tuples(st.integers(5, 500), st.floats(0.01, 1.0)), min_size=1, max_size=8).map(
    lambda classes: CrystalSizeDistribution.from_classes(
        [size * UM for size, _ in classes], np.array([x for _, x in classes]) / sum(x for _, x in classes)
    )
)


def numbers(csd: CrystalSizeDistribution, mass: float) -> np.ndarray:
    """Crystals of each class in so much mass, in arbitrary units."""
    return np.asarray(mass * csd.volume_fraction / csd.size**3)


def test_seeds_of_one_size_grow_with_the_root_of_their_mass() -> None:
    found = grow_seeds(mixture([50.0 * UM], [1.0]), 27.0)
    assert found.csd.size.tolist() == pytest.approx([150.0 * UM], rel=1e-12)
    assert found.growth == pytest.approx(100.0 * UM, rel=1e-12)


def test_two_sizes_by_hand() -> None:
    # halves of 10 and 20 um grown by 10 um: 0.5 * 8 + 0.5 * 27/8 = 5.6875 times the mass
    found = grow_seeds(mixture([10.0 * UM, 20.0 * UM], [0.5, 0.5]), 5.6875)
    assert found.growth == pytest.approx(10.0 * UM, rel=1e-10)
    assert found.csd.volume_fraction.tolist() == pytest.approx([4.0 / 5.6875, 1.6875 / 5.6875], rel=1e-10)


@given(seeds, st.floats(1.0001, 1e6))
def test_mass_is_made_and_no_crystal_is_born(csd: CrystalSizeDistribution, ratio: float) -> None:
    found = grow_seeds(csd, ratio)
    assert found.growth > 0.0
    assert found.csd.size == pytest.approx(csd.size + found.growth, rel=1e-12)
    assert numbers(found.csd, ratio) == pytest.approx(numbers(csd, 1.0), rel=1e-8)


@given(seeds, st.floats(1.0, 100.0), st.floats(1.01, 10.0))
def test_more_mass_is_more_growth_and_a_smaller_relative_width(
    csd: CrystalSizeDistribution, ratio: float, k: float
) -> None:
    once, more = grow_seeds(csd, ratio), grow_seeds(csd, k * ratio)
    assert more.growth > once.growth
    assert more.csd.largest / more.csd.smallest <= once.csd.largest / once.csd.smallest * (1.0 + 1e-12)


def test_fine_seeds_take_on_more_for_their_mass() -> None:
    # a third of 5 um, two of 30: twice their mass has the smaller Sauter mean, a hundred times the larger
    csd = mixture([5.0 * UM, 30.0 * UM], [1.0 / 3.0, 2.0 / 3.0])
    assert grow_seeds(csd, 2.0).csd.sauter_mean < csd.sauter_mean < grow_seeds(csd, 100.0).csd.sauter_mean


def test_no_growth_leaves_the_seeds() -> None:
    csd = mixture([10.0 * UM, 20.0 * UM], [0.3, 0.7])
    found = grow_seeds(csd, 1.0)
    assert found.growth == 0.0 and found.csd.size.tolist() == csd.size.tolist()


@pytest.mark.parametrize("ratio", [0.99, 0.0, -1.0, math.nan, math.inf, 1e10])
def test_bad_ratios_are_refused(ratio: float) -> None:
    with pytest.raises(CrystallizerError, match=r"mass_ratio = .*: must be from 1 to 1e\+09"):
        grow_seeds(mixture([1e-5], [1.0]), ratio)
