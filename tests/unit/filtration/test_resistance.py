"""Specific cake resistance against the paper's Table 4 and Fig. 14."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.crystals.csd import CrystalSizeDistribution, mixture
from filtercake.filtration.resistance import carman_sauter, implied_porosity, kozeny_carman, log_sensitivity

UM = 1e-6

porosities = st.floats(0.05, 0.95)


@st.composite
def distributions(draw: st.DrawFn) -> CrystalSizeDistribution:
    sizes = draw(st.lists(st.integers(5, 500), min_size=1, max_size=6, unique=True))
    weights = draw(st.lists(st.integers(1, 100), min_size=len(sizes), max_size=len(sizes)))
    return CrystalSizeDistribution.from_classes(np.array(sizes) * UM, np.array(weights) / sum(weights))


@pytest.mark.parametrize(
    ("small", "porosity", "alpha"), [(0.75, 0.392, 3.04e9), (0.50, 0.359, 3.06e9), (0.25, 0.358, 1.97e9)]
)
def test_table_4_of_the_paper(pmma, small: float, porosity: float, alpha: float) -> None:
    # three figures are printed for both: half a unit of the last is 0.25 % of alpha
    assert kozeny_carman(porosity, pmma(small), 1180.0) == pytest.approx(alpha, rel=0.005)


@pytest.mark.parametrize(
    ("a_um", "porosity", "alpha"),
    [(58.417, 0.293, 1.009e8), (67.103, 0.2925, 7.69e7), (72.771, 0.2925, 6.54e7), (77.081, 0.292, 5.86e7)],
)
def test_alum_resistances_behind_fig_14(a_um: float, porosity: float, alpha: float) -> None:
    # one class of diameter a sqrt(6) has the analytic sum x/d^2 = 1/(6 a^2) of the whole MSMPR distribution
    equivalent = mixture([math.sqrt(6.0) * a_um * UM], [1.0])
    assert kozeny_carman(porosity, equivalent, 2450.0) == pytest.approx(alpha, rel=0.001)


def test_the_full_alum_distribution_reproduces_fig_14_and_the_truncated_one_does_not(alum) -> None:
    full, cut = alum(15)
    assert kozeny_carman(0.293, full, 2450.0) == pytest.approx(1.009e8, rel=0.01)  # bins of 5 um: 0.6 %
    assert kozeny_carman(0.293, cut.csd, 2450.0) < 0.94e8


@pytest.mark.parametrize(("small", "ratio"), [(0.75, 1.09), (0.50, 1.18), (0.25, 1.22)])
def test_additive_over_sauter_of_the_pmma_mixes(pmma, small: float, ratio: float) -> None:
    csd = pmma(small)
    found = kozeny_carman(0.36, csd, 1180.0) / carman_sauter(0.36, csd, 1180.0)
    assert found == pytest.approx(ratio, abs=0.005)


def test_additive_over_sauter_of_alum(alum) -> None:
    # whole MSMPR: sum x/d^2 / (sum x/d)^2 = (1/6) / (1/3)^2 = 1.5; 1.39 is the truncated one's
    full, cut = alum(15)
    ratio = [kozeny_carman(0.3, c, 2450.0) / carman_sauter(0.3, c, 2450.0) for c in (full, cut.csd)]
    assert ratio[0] == pytest.approx(1.5, rel=0.01)
    assert ratio[1] == pytest.approx(1.39, abs=0.02)


def test_kozeny_carman_of_equal_spheres_by_hand() -> None:
    # 180 * 0.6 / (0.4^3 * 1000 * (100e-6)^2)
    assert kozeny_carman(0.4, mixture([100 * UM], [1.0]), 1000.0) == pytest.approx(1.6875e8, rel=1e-12)
    assert carman_sauter(0.4, mixture([100 * UM], [1.0]), 1000.0) == pytest.approx(1.6875e8, rel=1e-12)
    assert kozeny_carman(0.4, mixture([100 * UM], [1.0]), 1000.0, 0.5) == pytest.approx(4 * 1.6875e8, rel=1e-12)


@pytest.mark.parametrize(("porosity", "value"), [(0.36, -9.9), (0.293, -11.7)])
def test_sensitivities_of_physics_md(porosity: float, value: float) -> None:
    assert round(log_sensitivity(porosity), 1) == value


@given(porosities)
def test_log_sensitivity_is_the_derivative(porosity: float) -> None:
    csd, h = mixture([20 * UM, 50 * UM], [0.5, 0.5]), 1e-5 * porosity * (1.0 - porosity)
    above, below = (math.log(kozeny_carman(porosity + d, csd, 1180.0)) for d in (h, -h))
    # central difference: relative error about (h/eps)^2 = 1e-10, rounding 1e-15 / h
    assert log_sensitivity(porosity) == pytest.approx((above - below) / (2.0 * h), rel=1e-6)


@given(porosities, st.floats(0.001, 0.04), distributions())
def test_resistance_falls_with_porosity(porosity: float, more: float, csd: CrystalSizeDistribution) -> None:
    for law in (kozeny_carman, carman_sauter):
        assert law(porosity + more, csd, 1180.0) < law(porosity, csd, 1180.0)


@given(porosities, distributions(), st.floats(100.0, 1e4), st.floats(0.1, 10.0), st.floats(0.1, 1.0))
def test_resistance_scales_as_the_law_says(
    porosity: float, csd: CrystalSizeDistribution, density: float, k: float, psi: float
) -> None:
    scaled = CrystalSizeDistribution.from_classes(csd.size * k, csd.volume_fraction)
    for law in (kozeny_carman, carman_sauter):
        once = law(porosity, csd, density)
        assert law(porosity, csd, k * density) == pytest.approx(once / k, rel=1e-12)
        assert law(porosity, scaled, density) == pytest.approx(once / k**2, rel=1e-12)
        assert law(porosity, csd, density, psi) == pytest.approx(once / psi**2, rel=1e-12)


@given(porosities, distributions())
def test_sauter_is_never_above_additive(porosity: float, csd: CrystalSizeDistribution) -> None:
    additive, sauter = kozeny_carman(porosity, csd, 1180.0), carman_sauter(porosity, csd, 1180.0)
    assert sauter <= additive * (1.0 + 1e-12)
    if csd.size.size == 1:
        assert sauter == pytest.approx(additive, rel=1e-12)
    else:
        assert sauter < additive


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((0.0, 1180.0, 1.0), "porosity 0 is not between 0 and 1"),
        ((1.0, 1180.0, 1.0), "porosity 1 is not"),
        ((-0.1, 1180.0, 1.0), "porosity -0.1"),
        ((math.nan, 1180.0, 1.0), "porosity nan"),
        ((0.4, 0.0, 1.0), "density 0 kg/m3 is not positive"),
        ((0.4, -5.0, 1.0), "density -5"),
        ((0.4, math.inf, 1.0), "density inf"),
        ((0.4, math.nan, 1.0), "density nan"),
        ((0.4, 1180.0, 0.0), "sphericity 0"),
        ((0.4, 1180.0, 1.1), "sphericity 1.1"),
        ((0.4, 1180.0, math.nan), "sphericity nan"),
    ],
)
def test_bad_arguments_are_refused(pmma, arguments: tuple[float, float, float], says: str) -> None:
    porosity, density, sphericity = arguments
    for law in (kozeny_carman, carman_sauter):
        with pytest.raises(ValueError) as caught:
            law(porosity, pmma(0.5), density, sphericity)
        assert says in str(caught.value)


@given(distributions(), st.floats(-300.0, 300.0))
def test_any_positive_resistance_implies_a_porosity(csd: CrystalSizeDistribution, exponent: float) -> None:
    found = implied_porosity(10.0**exponent, csd, 1180.0)
    assert 0.0 <= found <= 1.0
    if 1e-6 < found < 1.0 - 1e-6:
        assert kozeny_carman(found, csd, 1180.0) == pytest.approx(10.0**exponent, rel=1e-8)
