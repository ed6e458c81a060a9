"""Cascades of crystallizers against the MSMPR one, mass balances and a numerical solution of the population balance."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from filtercake.crystals.cascade import MOST_STAGES, Stage, cascade, cascade_product
from filtercake.crystals.crystallizer import Kinetics, crystal_size_distribution, get_kinetics, steady_state
from filtercake.errors import CrystallizerError, CsdError

ALUM = get_kinetics("ammonium_alum")
NITRATE = get_kinetics("potassium_nitrate")

runs = st.lists(st.tuples(st.floats(60.0, 7200.0), st.floats(1.0, 100.0)), min_size=1, max_size=6)
"""Residence time of each stage, s, and what it crystallizes, kg/m3."""


def solve(run: list[tuple[float, float]], kinetics: Kinetics = ALUM) -> tuple[Stage, ...]:
    return cascade(kinetics, [time for time, _ in run], np.cumsum([mass for _, mass in run]).tolist())


def equal(stages: int) -> tuple[Stage, ...]:
    """A quarter of an hour and 200 kg/m3 in equal steps."""
    return solve([(900.0 / stages, 200.0 / stages)] * stages)


@pytest.mark.parametrize("kinetics", [ALUM, NITRATE], ids=lambda kinetics: kinetics.name)
def test_one_stage_is_the_mixed_crystallizer(kinetics: Kinetics) -> None:
    (stage,) = cascade(kinetics, [900.0], [200.0])
    plain = steady_state(kinetics, 900.0, 200.0)
    assert (stage.growth_rate, stage.nucleation_rate) == (plain.growth_rate, plain.nucleation_rate)
    assert stage.sauter_mean == pytest.approx(plain.sauter_mean, rel=1e-13)
    product, mixed = cascade_product([stage]), crystal_size_distribution(plain.size_scale)
    assert product.size == pytest.approx(mixed.size, rel=1e-9)
    assert product.volume_fraction == pytest.approx(mixed.volume_fraction, abs=1e-12)
    assert product.sum_x_over_d2 == pytest.approx(mixed.sum_x_over_d2, rel=1e-11)


@given(runs)
def test_every_stage_holds_the_crystals_asked_for(run: list[tuple[float, float]]) -> None:
    slurry = np.cumsum([mass for _, mass in run])
    for stage, wanted in zip(solve(run), slurry, strict=True):
        assert ALUM.shape_factor * ALUM.density * stage.moments.m3 == pytest.approx(wanted, rel=1e-9)
        kinetics = 1e3 * ALUM.nucleation_coefficient * wanted * stage.growth_rate**2
        assert stage.nucleation_rate == pytest.approx(kinetics, rel=1e-9)


@given(runs)
def test_crystals_are_the_sum_of_those_born_and_grown(run: list[tuple[float, float]]) -> None:
    # a crystal born in stage j leaves with the sum of exponential sizes of means a_j, a_(j+1) ...: its raw moments
    # follow from the cumulants sum a, sum a^2, 2 sum a^3, whatever the recursion does
    stages = solve(run)
    born = [stage.nucleation_rate * stage.residence_time for stage in stages]
    m0 = m1 = m2 = m3 = 0.0
    for j, number in enumerate(born):
        a = np.array([stage.size_scale for stage in stages[j:]])
        first, second, third = a.sum(), (a**2).sum(), 2.0 * (a**3).sum()
        m0, m1 = m0 + number, m1 + number * first
        m2 += number * (second + first**2)
        m3 += number * (third + 3.0 * second * first + first**3)
    assert stages[-1].moments == pytest.approx((m0, m1, m2, m3), rel=1e-9)


@settings(max_examples=5)
@given(runs.filter(lambda run: len(run) < 4))
def test_the_products_sums_are_those_of_its_moments(run: list[tuple[float, float]]) -> None:
    last = solve(run)[-1].moments
    product = cascade_product(solve(run))
    # 2e-4 of the volume is above the largest class
    assert product.sum_x_over_d == pytest.approx(last.m2 / last.m3, rel=3e-4)
    assert product.sum_x_over_d2 == pytest.approx(last.m1 / last.m3, rel=3e-4)


def test_the_density_is_that_of_a_numerical_solution() -> None:
    stages = solve([(600.0, 40.0), (1200.0, 100.0), (300.0, 60.0)])
    a = np.array([stage.size_scale for stage in stages])
    start = np.array([stage.nucleation_rate / stage.growth_rate for stage in stages])
    product = cascade_product(stages)
    width = product.size[1] - product.size[0]
    edges = np.arange(product.size.size + 1) * width

    def slope(x: float, y: np.ndarray) -> np.ndarray:
        n, before = y[:3], np.concatenate(([0.0], y[:2]))
        return np.concatenate(((before - n) / (a / width), [x * n[2], x**2 * n[2], x**3 * n[2]]))

    solved = solve_ivp(
        slope,
        (0.0, edges[-1] / width),
        np.concatenate((start, np.zeros(3))),
        t_eval=edges / width,
        method="DOP853",
        rtol=1e-12,
        atol=1e-12 * start.max(),
    )
    length, surface, volume = (np.diff(row) for row in solved.y[3:])
    assert product.volume_fraction == pytest.approx(volume / volume.sum(), abs=1e-8)
    # the classes' sums are over all of the volume, of which the last edge leaves 2e-4
    whole = stages[-1].moments.m3 / width**4
    assert product.sum_x_over_d == pytest.approx(surface.sum() / whole / width, rel=1e-6)
    assert product.sum_x_over_d2 == pytest.approx(length.sum() / whole / width**2, rel=1e-6)


def test_more_stages_make_a_narrower_product() -> None:
    widths = [
        csd.sum_x_over_d2 / csd.sum_x_over_d**2 for csd in (cascade_product(equal(stages)) for stages in (1, 2, 4))
    ]
    assert widths[0] == pytest.approx(1.5, rel=1e-3)
    assert (np.diff(widths) < 0.0).all()


def test_a_second_stage_that_crystallizes_little_changes_little() -> None:
    one, two = solve([(900.0, 200.0)]), solve([(900.0, 200.0), (900.0, 1e-6)])
    assert two[-1].sauter_mean == pytest.approx(one[-1].sauter_mean, rel=1e-6)
    assert two[-1].growth_rate < 1e-6 * one[-1].growth_rate


def test_any_growth_exponent_above_minus_three_has_a_root() -> None:
    for exponent in (-2.5, 0.0, 0.5, 4.0):
        kinetics = dataclasses.replace(ALUM, growth_rate_exponent=exponent, nucleation_coefficient=1e3)
        last = cascade(kinetics, [600.0, 600.0], [50.0, 200.0])[-1]
        assert ALUM.density * last.moments.m3 == pytest.approx(200.0, rel=1e-9)


@pytest.mark.parametrize(
    ("times", "slurries", "says"),
    [
        ([], [], "0 residence times and 0 slurry concentrations: must be as many"),
        ([600.0], [50.0, 100.0], "1 residence times and 2 slurry concentrations"),
        ([600.0] * (MOST_STAGES + 1), [10.0] * (MOST_STAGES + 1), f"one for each of 1 to {MOST_STAGES} stages"),
        ([600.0, 600.0], [100.0, 100.0], "slurry_concentration_kg_m3 = 100: must be above the 100 of the stage before"),
        ([600.0, -1.0], [50.0, 100.0], "residence_time_s = -1"),
        ([600.0, 600.0], [50.0, math.nan], "slurry_concentration_kg_m3 = nan"),
    ],
)
def test_bad_cascades_are_refused(times: list[float], slurries: list[float], says: str) -> None:
    with pytest.raises(CrystallizerError, match=says):
        cascade(ALUM, times, slurries)


def test_bad_widths_are_refused() -> None:
    with pytest.raises(CrystallizerError, match="bin_width = 0 m"):
        cascade_product(equal(2), 0.0)
    with pytest.raises(CsdError, match="leaves no bin"):
        cascade_product(equal(2), 1.0)
