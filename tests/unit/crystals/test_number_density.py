"""Distributions from number densities: exponentials against the closed form, PharmaPy's arrays, bad grids."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.crystals.number_density import from_number_density
from filtercake.errors import CsdError

UM = 1e-6
SCALE = 58.417 * UM


def exponential(cells: int, *, upper: float = 20.0) -> tuple[np.ndarray, np.ndarray]:
    """Middles of cells, m, and the MSMPR density there."""
    edges = np.linspace(0.0, upper * SCALE, cells + 1)
    size = 0.5 * (edges[1:] + edges[:-1])
    return size, 1e12 * np.exp(-size / SCALE)


def test_an_msmpr_product_on_a_fine_grid() -> None:
    csd = from_number_density(*exponential(4000))
    # sum x/d = 1/(3 a), sum x/d^2 = 1/(6 a^2); cells of a/200
    assert csd.sum_x_over_d == pytest.approx(1.0 / (3.0 * SCALE), rel=1e-5)
    assert csd.sum_x_over_d2 == pytest.approx(1.0 / (6.0 * SCALE**2), rel=1e-5)
    below = csd.volume_fraction[csd.size < 4.0 * SCALE].sum()
    assert below == pytest.approx(1.0 - math.exp(-4.0) * (1.0 + 4.0 + 8.0 + 64.0 / 6.0), abs=1e-3)


def test_the_error_falls_with_the_square_of_the_cells() -> None:
    errors = [from_number_density(*exponential(n)).sum_x_over_d2 * 6.0 * SCALE**2 - 1.0 for n in (20, 40)]
    assert abs(errors[1]) < 0.3 * abs(errors[0]) < 0.1


def test_a_geometric_grid() -> None:
    size = np.geomspace(0.5 * UM, 1500.0 * UM, 2000)
    csd = from_number_density(size, np.exp(-size / SCALE))
    assert csd.sum_x_over_d == pytest.approx(1.0 / (3.0 * SCALE), rel=1e-4)


def test_pharmapys_arrays() -> None:
    # sizes in um from 1 to 1000, number per um and m3 of slurry, as its finite volumes give them
    x_distrib = np.linspace(1.0, 1000.0, 400)
    distrib = 3e8 * np.exp(-0.5 * ((x_distrib - 300.0) / 50.0) ** 2)
    csd = from_number_density(1e-6 * x_distrib, distrib)
    # moments of a normal distribution: m3 = mu^3 + 3 mu s^2, m2 = mu^2 + s^2
    assert csd.sauter_mean == pytest.approx((300.0**3 + 3.0 * 300.0 * 2500.0) / (300.0**2 + 2500.0) * UM, rel=1e-4)


@given(st.lists(st.integers(0, 10**12), min_size=2, max_size=30).filter(any), st.floats(1e-6, 1e6))
def test_only_the_shape_counts(density: list[int], factor: float) -> None:
    size = np.linspace(1.0, 100.0, len(density)) * UM
    once, scaled = (from_number_density(size, k * np.array(density)) for k in (1.0, factor))
    assert scaled.volume_fraction == pytest.approx(once.volume_fraction, rel=1e-9)
    assert scaled.sum_x_over_d2 == pytest.approx(once.sum_x_over_d2, rel=1e-9)
    # by Cauchy and Schwarz, whatever the density
    assert once.sum_x_over_d2 >= once.sum_x_over_d**2 * (1.0 - 1e-12)


def test_one_full_cell_is_a_uniform_density() -> None:
    # from 15 to 25 um: int L^2 / int L^3
    csd = from_number_density(np.array([10.0, 20.0, 30.0]) * UM, [0.0, 5.0, 0.0])
    assert csd.size.tolist() == pytest.approx([20.0 * UM])
    assert csd.sum_x_over_d * UM == pytest.approx((25.0**3 - 15.0**3) / 3.0 / ((25.0**4 - 15.0**4) / 4.0))
    assert csd.sum_x_over_d2 * UM**2 == pytest.approx((25.0**2 - 15.0**2) / 2.0 / ((25.0**4 - 15.0**4) / 4.0))


def test_a_grid_from_zero_has_half_a_cell_there() -> None:
    csd = from_number_density(np.array([0.0, 10.0, 20.0]) * UM, [1.0, 0.0, 0.0])
    assert csd.size.tolist() == pytest.approx([2.5 * UM])
    assert csd.sum_x_over_d * UM == pytest.approx((5.0**3 / 3.0) / (5.0**4 / 4.0))


def test_rounding_below_zero_is_none() -> None:
    size, density = exponential(100)
    spoilt = density.copy()
    spoilt[50] = -1e-12 * density.max()
    spoilt_more = density.copy()
    spoilt_more[50] = -1e-6 * density.max()
    assert from_number_density(size, spoilt).size.size == 99
    with pytest.raises(CsdError, match=r"number_density = -.*must be finite and not negative"):
        from_number_density(size, spoilt_more)


@pytest.mark.parametrize(
    ("size", "density", "says"),
    [
        ([1e-5, 2e-5], [1.0], "2 sizes but 1 number densities"),
        ([[1e-5, 2e-5]], [[1.0, 1.0]], "in one dimension"),
        ([1e-5], [1.0], "1 sizes: a number density needs at least 2"),
        ([2e-5, 1e-5], [1.0, 1.0], "size: must be finite, ascend"),
        ([-1e-5, 1e-5], [1.0, 1.0], "start at 0 or above"),
        ([1e-5, math.inf], [1.0, 1.0], "size: must be finite"),
        ([1e-5, 2e-5], [1.0, math.nan], "number_density = nan"),
        ([1e-5, 2e-5], [1.0, math.inf], "number_density = inf"),
        ([1e-5, 2e-5], [0.0, 0.0], "the crystals have no volume"),
        ([10.0, 20.0], [1.0, 1.0], "is the unit right"),
    ],
)
def test_bad_arrays_are_refused(size: list[float], density: list[float], says: str) -> None:
    with pytest.raises(CsdError, match=says):
        from_number_density(size, density)
