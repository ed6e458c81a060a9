"""The R-z crystallizer against the MSMPR one, a numerical solution of its population balance, and its own balances."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from filtercake.crystals.crystallizer import (
    Kinetics,
    crystal_size_distribution,
    cumulative_volume,
    get_kinetics,
    steady_state,
)
from filtercake.crystals.r_z import RzState, Withdrawal, number_density, r_z_product, r_z_steady_state
from filtercake.errors import CrystallizerError, CsdError

UM = 1e-6
TAU, SLURRY = 900.0, 200.0
ALUM = get_kinetics("ammonium_alum")
NITRATE = get_kinetics("potassium_nitrate")
BOTH = Withdrawal(5.0, 50.0 * UM, 3.0, 300.0 * UM)

withdrawals = st.builds(
    lambda r, fines, z, more: Withdrawal(r, fines * UM, z, (fines + more) * UM),
    st.floats(1.0, 50.0),
    st.floats(0.0, 200.0),
    st.floats(1.0, 50.0),
    st.floats(0.0, 500.0),
)


def alum(withdrawal: Withdrawal) -> RzState:
    return r_z_steady_state(ALUM, TAU, SLURRY, withdrawal)


def rate(withdrawal: Withdrawal, size: float) -> float:
    """Rate of withdrawal of a size over that of the mixed product."""
    if size < withdrawal.fines_size:
        return withdrawal.fines_ratio
    return withdrawal.classification_ratio if size > withdrawal.classification_size else 1.0


def integrated(withdrawal: Withdrawal, scale: float, power: int, *, weighted: bool = False) -> float:
    """Integral of L^power n / n0 by quadrature of the density that follows from the population balance."""

    def density(size: float) -> float:
        cuts = (withdrawal.fines_size, withdrawal.classification_size)
        passed = [min(size, cuts[0]), max(0.0, min(size, cuts[1]) - cuts[0]), max(0.0, size - cuts[1])]
        ratios = (withdrawal.fines_ratio, 1.0, withdrawal.classification_ratio)
        lost = sum(length * ratio for length, ratio in zip(passed, ratios, strict=True))
        return size**power * math.exp(-lost / scale) * (rate(withdrawal, size) if weighted else 1.0)

    edges = sorted({0.0, withdrawal.fines_size, withdrawal.classification_size, 80.0 * scale})
    edges = [edge for edge in edges if edge <= 80.0 * scale]
    return math.fsum(
        quad(density, low, high, epsrel=1e-11, epsabs=0.0, limit=400)[0]
        for low, high in itertools.pairwise(edges)
        if high > low
    )


# --- MSMPR ---


@pytest.mark.parametrize("kinetics", [ALUM, NITRATE], ids=lambda kinetics: kinetics.name)
def test_without_either_it_is_the_mixed_crystallizer(kinetics: Kinetics) -> None:
    plain = steady_state(kinetics, TAU, SLURRY)
    found = r_z_steady_state(kinetics, TAU, SLURRY, Withdrawal())
    assert found.growth_rate == pytest.approx(plain.growth_rate, rel=1e-12)
    assert found.nucleation_rate == pytest.approx(plain.nucleation_rate, rel=1e-12)
    assert found.product_concentration == pytest.approx(SLURRY, rel=1e-12)
    product, mixed = r_z_product(found), crystal_size_distribution(plain.size_scale)
    assert product.size == pytest.approx(mixed.size, rel=1e-12)
    assert product.volume_fraction == pytest.approx(mixed.volume_fraction, abs=1e-14)
    assert product.sum_x_over_d == pytest.approx(mixed.sum_x_over_d, rel=1e-12)
    assert product.sum_x_over_d2 == pytest.approx(mixed.sum_x_over_d2, rel=1e-12)


@given(st.floats(0.0, 500.0), st.floats(0.0, 500.0))
def test_sizes_do_nothing_where_the_ratios_are_one(fines: float, more: float) -> None:
    plain = steady_state(ALUM, TAU, SLURRY)
    found = alum(Withdrawal(1.0, fines * UM, 1.0, (fines + more) * UM))
    assert found.growth_rate == pytest.approx(plain.growth_rate, rel=1e-11)


# --- the population balance, solved numerically ---


@pytest.mark.parametrize(
    "withdrawal",
    [Withdrawal(5.0, 50.0 * UM), Withdrawal(1.0, 0.0, 3.0, 300.0 * UM), BOTH, Withdrawal(20.0, 80.0 * UM, 10.0, 80e-6)],
)
def test_growth_rate_and_density_of_a_numerical_solution(withdrawal: Withdrawal) -> None:
    def solved(growth: float) -> tuple[float, list[tuple[float, float]]]:
        """Slurry concentration by stepping G dn/dL = -h n / tau with its third moment, and n at the ends of pieces."""
        a = growth * TAU
        n0 = 1e3 * ALUM.nucleation_coefficient * SLURRY * growth ** (2 - 1)
        state, start, seen = np.array([1.0, 0.0]), 0.0, []
        for end, h in (
            (withdrawal.fines_size, withdrawal.fines_ratio),
            (min(withdrawal.classification_size, 40.0 * a), 1.0),
            (60.0 * a, withdrawal.classification_ratio),
        ):
            if end > start:
                step = solve_ivp(
                    lambda x, y, h=h: [-h * y[0], x**3 * y[0]],
                    (start / a, end / a),
                    state,
                    method="DOP853",
                    rtol=1e-12,
                    atol=1e-30,
                )
                state, start = step.y[:, -1], end
                seen.append((end, float(state[0] * n0)))
        return ALUM.shape_factor * ALUM.density * n0 * a**4 * float(state[1]), seen

    growth = brentq(lambda g: solved(g)[0] - SLURRY, 1e-9, 1e-5, xtol=1e-22, rtol=1e-13)
    found = alum(withdrawal)
    assert found.growth_rate == pytest.approx(growth, rel=1e-6)
    for size, density in solved(growth)[1]:
        if density > 1.0:  # the last end is where next to nothing is left
            assert float(number_density(found, size)) == pytest.approx(density, rel=1e-6)


@settings(max_examples=40)
@given(withdrawals)
def test_the_slurry_holds_the_crystals_asked_for(withdrawal: Withdrawal) -> None:
    found = alum(withdrawal)
    n0 = found.nucleation_rate / found.growth_rate
    volume = integrated(withdrawal, found.size_scale, 3)
    assert ALUM.density * n0 * volume == pytest.approx(SLURRY, rel=1e-8)
    kinetics = 1e3 * ALUM.nucleation_coefficient * SLURRY * found.growth_rate**2
    assert found.nucleation_rate == pytest.approx(kinetics, rel=1e-10)


@settings(max_examples=40)
@given(withdrawals)
def test_what_grows_on_leaves_as_crystals(withdrawal: Withdrawal) -> None:
    # 3 a int L^2 n = int h L^3 n: by the product, and the fines that are dissolved
    a = alum(withdrawal).size_scale
    deposited = 3.0 * a * integrated(withdrawal, a, 2)
    assert integrated(withdrawal, a, 3, weighted=True) == pytest.approx(deposited, rel=1e-7)


def test_the_product_holds_what_grows_on_without_fines_dissolution() -> None:
    found = alum(Withdrawal(1.0, 0.0, 3.0, 300.0 * UM))
    n0 = found.nucleation_rate / found.growth_rate
    deposited = 3.0 * found.size_scale * integrated(found.withdrawal, found.size_scale, 2)
    assert found.product_concentration == pytest.approx(ALUM.density * n0 * deposited, rel=1e-8)
    assert found.product_concentration > SLURRY


# --- the product's classes ---


@settings(max_examples=25)
@given(withdrawals)
def test_the_products_sums_are_those_of_its_density(withdrawal: Withdrawal) -> None:
    found = alum(withdrawal)
    product = r_z_product(found)
    scale, fines, coarse = found.size_scale, withdrawal.fines_size, withdrawal.classification_size

    def in_product(power: int) -> float:
        points = sorted({0.0, fines, coarse, 80.0 * scale})
        return math.fsum(
            quad(
                lambda size: size**power * float(number_density(found, size, in_product=True)),
                low * (1.0 + 1e-12),
                high,
                epsrel=1e-9,
                epsabs=0.0,
                limit=400,
            )[0]
            for low, high in itertools.pairwise(points)
            if high <= 80.0 * scale and high > low
        )

    volume = in_product(3)
    # of the volume, 2e-4 is above the largest class; of the sums a smaller share still
    assert product.sum_x_over_d == pytest.approx(in_product(2) / volume, rel=3e-4)
    assert product.sum_x_over_d2 == pytest.approx(in_product(1) / volume, rel=3e-4)
    assert product.volume_fraction.sum() == pytest.approx(1.0, rel=1e-12)


def test_the_product_jumps_at_the_classification_size() -> None:
    found = alum(BOTH)
    below, above = (
        float(number_density(found, BOTH.classification_size * k, in_product=True)) for k in (1 - 1e-9, 1 + 1e-9)
    )
    assert above / below == pytest.approx(BOTH.classification_ratio, rel=1e-6)
    inside = [float(number_density(found, BOTH.classification_size * k)) for k in (1 - 1e-9, 1 + 1e-9)]
    assert inside[0] == pytest.approx(inside[1], rel=1e-6)


def test_the_largest_class_is_where_the_mixed_products_is() -> None:
    product = r_z_product(alum(Withdrawal()))
    edge = 2.0 * product.largest - product.size[-2] * 0.5 - product.largest * 0.5
    assert float(cumulative_volume(alum(Withdrawal()).size_scale, edge)) == pytest.approx(1.0 - 2.1e-4, abs=1e-5)


# --- directions ---


@settings(max_examples=20)
@given(st.floats(1.0, 50.0), st.floats(1.05, 3.0))
def test_fines_dissolution_makes_coarser_crystals(ratio: float, k: float) -> None:
    once, more = (alum(Withdrawal(r, 50.0 * UM)) for r in (ratio, k * ratio))
    assert more.growth_rate > once.growth_rate
    assert r_z_product(more).sauter_mean > r_z_product(once).sauter_mean


def test_classified_removal_makes_a_narrower_product() -> None:
    plain, classified = (r_z_product(alum(w)) for w in (Withdrawal(), Withdrawal(1.0, 0.0, 5.0, 300.0 * UM)))
    widths = [csd.sum_x_over_d2 / csd.sum_x_over_d**2 for csd in (plain, classified)]
    assert widths[0] == pytest.approx(1.5, rel=1e-3)  # 9/6 of an MSMPR product
    assert widths[1] < widths[0]


# --- bad input ---


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"fines_ratio": 0.9}, "fines_ratio = 0.9: must be from 1 to 1000"),
        ({"classification_ratio": math.nan}, "classification_ratio = nan: must be from 1"),
        ({"classification_ratio": 1e4}, "classification_ratio = 10000: must be from 1 to 1000"),
        ({"fines_size": -1.0}, "fines_size = -1 m: must be finite and not negative"),
        ({"fines_size": math.inf}, "fines_size = inf m: must be finite"),
        ({"fines_size": 2e-4, "classification_size": 1e-4}, "classification_size = 0.0001 m: must be at least fines_s"),
    ],
)
def test_bad_withdrawals_are_refused(values: dict[str, float], says: str) -> None:
    with pytest.raises(CrystallizerError) as caught:
        Withdrawal(**values)
    assert str(caught.value).startswith(says)


def test_kinetics_with_several_roots_are_refused() -> None:
    slow = dataclasses.replace(ALUM, growth_rate_exponent=0.5)
    with pytest.raises(CrystallizerError, match=r"growth_rate_exponent = 0.5: must be at least 1 where"):
        r_z_steady_state(slow, TAU, SLURRY, BOTH)
    assert r_z_steady_state(slow, TAU, SLURRY, Withdrawal(5.0, 50.0 * UM)).growth_rate > 0.0


def test_bad_arguments_are_refused() -> None:
    with pytest.raises(CrystallizerError, match="residence_time_s = 0"):
        r_z_steady_state(ALUM, 0.0, SLURRY, BOTH)
    with pytest.raises(CrystallizerError, match="size = -1: must be finite and not negative"):
        number_density(alum(BOTH), [1.0, -1.0])
    for width in (0.0, math.nan, 1e-12):
        with pytest.raises(CrystallizerError, match="bin_width = "):
            r_z_product(alum(BOTH), width)
    with pytest.raises(CsdError, match="leaves no bin"):
        r_z_product(alum(BOTH), 1.0)
