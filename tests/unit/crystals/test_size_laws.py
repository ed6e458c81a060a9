"""Lognormal and Rosin-Rammler distributions against their closed forms and an instrument's own means."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from filtercake.crystals.csd import truncate
from filtercake.crystals.size_laws import LEAST_EXPONENT, lognormal, rosin_rammler
from filtercake.errors import CsdError

UM = 1e-6


@pytest.mark.parametrize("spread", [1.02, 1.3, 2.0, 3.5])
def test_the_sums_of_a_lognormal_are_its_closed_forms(spread: float) -> None:
    d50, reach = 40 * UM, spread**1.2815515655446004
    csd = lognormal(d50 / reach, d50, d50 * reach)
    log = math.log(spread)
    assert csd.sum_x_over_d == pytest.approx(math.exp(0.5 * log**2) / d50, rel=1e-12)
    assert csd.sum_x_over_d2 == pytest.approx(math.exp(2.0 * log**2) / d50**2, rel=1e-12)
    assert float(csd.volume_fraction @ csd.size) == pytest.approx(d50 * math.exp(0.5 * log**2), rel=2e-2)


@pytest.mark.parametrize("exponent", [2.05, 3.0, 8.0])
def test_the_sums_of_a_rosin_rammler_are_its_closed_forms(exponent: float) -> None:
    csd = rosin_rammler(60 * UM, exponent)
    assert csd.sum_x_over_d == pytest.approx(math.gamma(1 - 1 / exponent) / (60 * UM), rel=1e-12)
    assert csd.sum_x_over_d2 == pytest.approx(math.gamma(1 - 2 / exponent) / (60 * UM) ** 2, rel=1e-12)
    assert csd.volume_fraction[csd.size > 60 * UM].sum() == pytest.approx(math.exp(-1), abs=0.08)


@pytest.mark.parametrize("csd", [lognormal(20 * UM, 40 * UM, 80 * UM), rosin_rammler(60 * UM, 3.0)])
def test_a_class_adds_what_its_crystals_do(csd) -> None:
    # inside the distribution, x/d^2 of a class is between those of its edges
    step = csd.size[1] / csd.size[0]
    inside = slice(1, -1)
    mean = np.sqrt(csd.volume_fraction / csd.x_over_d2)[inside]
    assert (mean > csd.size[inside] / math.sqrt(step)).all()
    assert (mean < csd.size[inside] * math.sqrt(step)).all()


def test_a_class_of_rosin_rammler_is_the_integral_over_it() -> None:
    csd, d, n = rosin_rammler(1.0 * UM, 2.5), 1.0, 2.5
    step = csd.size[11] / csd.size[10]
    lower, upper = (csd.size[10] / UM * step**half for half in (-0.5, 0.5))
    density = lambda x: n / d * (x / d) ** (n - 1) * math.exp(-((x / d) ** n))  # noqa: E731
    for power, found in ((0, csd.volume_fraction[10]), (1, csd.x_over_d[10] * UM), (2, csd.x_over_d2[10] * UM**2)):
        assert found == pytest.approx(quad(lambda x, p=power: density(x) / x**p, lower, upper)[0], rel=1e-9)


def test_glass_beads_have_the_means_of_their_instrument() -> None:
    # laser diffraction: d10/50/90 53.5/74.796/104.309, D[3,2] 72.289, D[4,3] 77.278 um
    csd = lognormal(53.5 * UM, 74.796 * UM, 104.309 * UM)
    assert csd.sauter_mean / UM == pytest.approx(72.289, rel=2e-3)
    assert float(csd.volume_fraction @ csd.size) / UM == pytest.approx(77.278, rel=3e-3)
    assert "d50 +0.1% off" in csd.understood


def test_truncation_leaves_rare_classes_out_of_the_packing_only() -> None:
    csd = lognormal(20 * UM, 40 * UM, 80 * UM)
    cut = truncate(csd, 0.001)
    assert 0.99 < cut.kept_volume < 1.0
    assert cut.csd.size.size < csd.size.size


@pytest.mark.parametrize(
    ("sizes", "says"),
    [
        ((20, 40, 100), "are not of a lognormal distribution: d50 is -11% off sqrt"),
        ((40, 20, 80), "d10, d50, d90 = 40, 20, 80 um: must ascend"),
        ((20, 20, 20), "must ascend"),
    ],
)
def test_sizes_that_are_no_lognormal_are_refused(sizes: tuple[float, ...], says: str) -> None:
    with pytest.raises(CsdError) as caught:
        lognormal(*(size * UM for size in sizes))
    assert says in str(caught.value)


@pytest.mark.parametrize("exponent", [0.8, 1.5, LEAST_EXPONENT])
def test_a_rosin_rammler_without_a_sum_is_refused(exponent: float) -> None:
    with pytest.raises(CsdError, match=r"exponent = .*must be above 2: .* give the classes"):
        rosin_rammler(60 * UM, exponent)
