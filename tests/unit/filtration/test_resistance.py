"""Specific cake resistance against the paper's Table 4 and Fig. 14."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.crystals.crystallizer import crystal_size_distribution
from filtercake.crystals.csd import CrystalSizeDistribution, mixture
from filtercake.filtration.resistance import (
    ADDITIVE,
    CARMAN,
    CARMAN_CONSTANT,
    CARMAN_CONSTANT_CI95,
    KOZENY_CARMAN,
    RESISTANCE_LAWS,
    STOKES,
    carman_sauter,
    implied_porosity,
    kozeny_carman,
    law_of,
    law_relative_ci95,
    log_sensitivity,
    resistance,
)

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


# --- the registry ---------------------------------------------------------------------------------------------------

CONSTANTS = {STOKES: 168.0}
"""Kozeny constants of the laws that need one."""


def by(law: str, porosity: float, csd: CrystalSizeDistribution, density: float = 1180.0, psi: float = 1.0) -> float:
    return resistance(law, porosity, csd, density, psi, CONSTANTS.get(law))


@pytest.mark.parametrize(
    ("law", "constant", "sizes"),
    [
        # 20 and 50 um by halves: sum x/d^2 = 1.45e9 1/m2, sum x/d = 35 000 1/m
        (ADDITIVE, 180.0, 1.45e9),
        (CARMAN, 170.0, 35_000.0**2),
        (STOKES, 168.0, 35_000.0**2),
    ],
)
def test_each_law_by_hand(pmma, law: str, constant: float, sizes: float) -> None:
    # (1 - 0.36) / (0.36^3 0.9^2 1180)
    flow = 0.64 / (0.046656 * 0.81 * 1180.0)
    assert by(law, 0.36, pmma(0.5), 1180.0, 0.9) == pytest.approx(constant * flow * sizes, rel=1e-12)
    assert law_of(law).evaluate(0.36, pmma(0.5), 1180.0, 0.9, 168.0) == by(law, 0.36, pmma(0.5), 1180.0, 0.9)


def test_the_laws_of_before_are_still_there(pmma) -> None:
    csd = pmma(0.75)
    assert kozeny_carman(0.4, csd, 1180.0, 0.8) == by(ADDITIVE, 0.4, csd, 1180.0, 0.8)
    assert carman_sauter(0.4, csd, 1180.0, 0.8) == pytest.approx(
        KOZENY_CARMAN / CARMAN_CONSTANT * by(CARMAN, 0.4, csd, 1180.0, 0.8), rel=1e-12
    )


def test_a_whole_crystallizer_s_product_is_one_and_a_half_times_180_over_carman_s_constant() -> None:
    # b ~ exp(-L/a): sum x/d^2 = 1/(6 a^2) and sum x/d = 1/(3 a)
    a = 58.417 * UM
    exact = CrystalSizeDistribution(
        np.array([4.0 * a]), np.array([1.0]), np.array([1.0 / (3.0 * a)]), np.array([1.0 / (6.0 * a**2)])
    )
    # the classes end at 15 a, beyond which lie 2e-4 of the volume
    for csd, tolerance in ((exact, 1e-12), (crystal_size_distribution(a), 2e-4)):
        ratio = by(ADDITIVE, 0.3, csd) / by(CARMAN, 0.3, csd)
        assert ratio == pytest.approx(1.5 * KOZENY_CARMAN / CARMAN_CONSTANT, rel=tolerance)


@given(porosities, st.integers(5, 500))
def test_one_size_leaves_only_the_constants_apart(porosity: float, size: int) -> None:
    csd = mixture([size * UM], [1.0])
    ratio = by(ADDITIVE, porosity, csd) / by(CARMAN, porosity, csd)
    assert ratio == pytest.approx(KOZENY_CARMAN / CARMAN_CONSTANT, rel=1e-12)


@given(
    st.sampled_from([*RESISTANCE_LAWS]), st.floats(0.01, 0.99), distributions(), st.floats(100, 1e4), st.floats(0.1, 1)
)
def test_a_resistance_implies_the_porosity_it_came_from(
    law: str, porosity: float, csd: CrystalSizeDistribution, density: float, psi: float
) -> None:
    alpha = by(law, porosity, csd, density, psi)
    assert implied_porosity(alpha, csd, density, psi, law, CONSTANTS.get(law)) == pytest.approx(porosity, rel=1e-9)


def test_an_implied_porosity_is_by_eq_3_unless_said(pmma) -> None:
    assert implied_porosity(by(ADDITIVE, 0.36, pmma(0.5)), pmma(0.5), 1180.0) == pytest.approx(0.36)
    assert implied_porosity(by(ADDITIVE, 0.36, pmma(0.5)), pmma(0.5), 1180.0, law=CARMAN) < 0.345


def test_a_law_without_its_constant_is_refused(pmma) -> None:
    with pytest.raises(ValueError, match="stokes needs a kozeny_constant, solved on the packings"):
        resistance(STOKES, 0.36, pmma(0.5), 1180.0)
    with pytest.raises(ValueError, match="stokes needs a kozeny_constant"):
        implied_porosity(1e9, pmma(0.5), 1180.0, law=STOKES)
    for bad in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match=r"kozeny_constant .* is not positive"):
            resistance(STOKES, 0.36, pmma(0.5), 1180.0, kozeny_constant=bad)


def test_an_unknown_law_is_refused_with_the_nearest(pmma) -> None:
    for call in (
        lambda: resistance("carmen", 0.36, pmma(0.5), 1180.0),
        lambda: implied_porosity(1e9, pmma(0.5), 1180.0, law="carmen"),
        lambda: law_relative_ci95("carmen", pmma(0.5)),
    ):
        with pytest.raises(ValueError) as caught:
            call()
        said = "unknown resistance law 'carmen'; allowed: additive, carman, stokes; did you mean carman?"
        assert str(caught.value) == said


def test_carman_s_interval_is_that_of_its_constant(pmma) -> None:
    assert law_relative_ci95(CARMAN, pmma(0.5)) == pytest.approx(CARMAN_CONSTANT_CI95 / CARMAN_CONSTANT)


@given(distributions())
def test_the_additive_law_s_interval_reaches_the_far_end_of_carman_s(csd: CrystalSizeDistribution) -> None:
    additive, carman = by(ADDITIVE, 0.36, csd), by(CARMAN, 0.36, csd)
    reach, half = (law_relative_ci95(law, csd) for law in (ADDITIVE, CARMAN))
    assert additive * (1.0 - reach) == pytest.approx(carman * (1.0 - half))
    if csd.size.size == 1:
        assert reach == pytest.approx((KOZENY_CARMAN - CARMAN_CONSTANT + CARMAN_CONSTANT_CI95) / KOZENY_CARMAN)


def test_a_solved_constant_brings_its_own_interval(pmma) -> None:
    assert law_relative_ci95(STOKES, pmma(0.5), 0.018) == 0.018
    assert math.isnan(law_relative_ci95(STOKES, pmma(0.5)))


@pytest.mark.parametrize("name", RESISTANCE_LAWS)
def test_each_law_says_what_it_is(name: str) -> None:
    law = RESISTANCE_LAWS[name]
    assert law.name == name and law.equation.startswith("alpha = ")
    for text in (law.title, law.units, law.validity, law.accuracy, law.source):
        assert text
    assert law.constant is None or f"{law.constant:g} " in law.equation
