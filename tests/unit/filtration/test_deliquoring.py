"""Deliquoring against the correlation worked by hand, its limits, its inverse and the directions it must go."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from filtercake.errors import FilterError
from filtercake.filtration.deliquoring import (
    KNEE,
    LEAST_SATURATION,
    SATURATION_ERROR,
    TIME_RANGE,
    Liquor,
    WetCake,
    capillary_number,
    dimensionless_time,
    irreducible_saturation,
    moisture,
    moisture_range,
    saturation,
    threshold_pressure,
    time_to_moisture,
)
from filtercake.units import GRAVITY

CAKE = WetCake(resistance=1e9, porosity=0.4, density=1300.0, sauter_mean=50e-6, height=0.02)
WATER = Liquor(pressure_drop=50e3, viscosity=1e-3, density=1000.0, surface_tension=0.072)

cakes = st.builds(
    WetCake,
    resistance=st.floats(1e7, 1e12),
    porosity=st.floats(0.25, 0.8),
    density=st.floats(800.0, 5000.0),
    sauter_mean=st.floats(5e-6, 1e-3),
    height=st.floats(1e-3, 0.5),
)
liquors = st.builds(
    Liquor,
    pressure_drop=st.floats(1e4, 1e6),
    viscosity=st.floats(1e-4, 0.1),
    density=st.floats(600.0, 1500.0),
    surface_tension=st.floats(0.01, 0.1),
)
times = st.floats(1e-2, 1e6)


def drains(cake: WetCake, liquor: Liquor) -> bool:
    return float(liquor.pressure_drop) > float(threshold_pressure(cake, liquor))


# --- by hand ---


def test_by_hand() -> None:
    # Nc = 0.064 * 2.5e-9 * (9810 * 0.02 + 50000) / (0.36 * 0.02 * 0.072) = 0.015493, to the power -0.49: 7.705
    assert float(capillary_number(CAKE, WATER)) == pytest.approx(0.015493, rel=1e-4)
    assert float(irreducible_saturation(CAKE, WATER)) == pytest.approx(0.155 * (1.0 + 0.031 * 7.7055), rel=1e-4)
    # 4.6 * 0.6 * 0.072 / (0.4 * 50e-6)
    assert float(threshold_pressure(CAKE, WATER)) == pytest.approx(9936.0)
    # k = 1 / (1e9 * 780) m2; T = k dP t / (eps mu L^2 (1 - 0.19203))
    assert float(CAKE.permeability) == pytest.approx(1.28205e-12, rel=1e-5)
    assert float(dimensionless_time(CAKE, WATER, 1.0)) == pytest.approx(0.49586, rel=1e-4)
    # 1 / (1 + 1.08 * 0.49586^0.88) = 0.63189; S = 0.19203 + 0.80797 * 0.63189
    assert float(saturation(CAKE, WATER, 1.0)) == pytest.approx(0.70258, rel=1e-4)
    # T = 49.586: 1 / (1 + 1.46 * 49.586^0.48) = 0.09516
    assert float(saturation(CAKE, WATER, 100.0)) == pytest.approx(0.26892, rel=1e-4)
    # 0.26892 * 0.4 * 1000 / (0.26892 * 0.4 * 1000 + 0.6 * 1300)
    assert float(moisture(CAKE, WATER, 0.26892)) == pytest.approx(0.12120, rel=1e-3)


def test_the_knee_is_a_small_fall() -> None:
    per_second = float(dimensionless_time(CAKE, WATER, 1.0))
    least = float(irreducible_saturation(CAKE, WATER))
    at_knee = KNEE / per_second
    before, after = ((float(saturation(CAKE, WATER, at_knee * k)) - least) / (1.0 - least) for k in (0.9999, 1.0001))
    assert before == pytest.approx(1.0 / (1.0 + 1.08 * KNEE**0.88), rel=1e-3)
    assert (before, after) == (pytest.approx(0.343, abs=1e-3), pytest.approx(0.334, abs=1e-3))
    assert TIME_RANGE[0] < KNEE < TIME_RANGE[1]


def test_a_coarse_cake_keeps_the_least_there_is() -> None:
    coarse = dataclasses.replace(CAKE, sauter_mean=0.1)
    assert float(irreducible_saturation(coarse, WATER)) == pytest.approx(LEAST_SATURATION, rel=1e-3)
    # what was measured for paracetamol is within the error that is stated
    assert LEAST_SATURATION - SATURATION_ERROR < 0.085


# --- limits ---


@given(cakes, liquors)
def test_saturation_begins_full_and_ends_at_the_irreducible(cake: WetCake, liquor: Liquor) -> None:
    assert float(saturation(cake, liquor, 0.0)) == 1.0
    least = float(irreducible_saturation(cake, liquor))
    assert LEAST_SATURATION < least <= 1.0
    end = float(saturation(cake, liquor, 1e40))
    assert end == pytest.approx(least if drains(cake, liquor) else 1.0, rel=1e-9)


def test_below_the_threshold_nothing_leaves() -> None:
    limit = float(threshold_pressure(CAKE, WATER))
    below, above = (dataclasses.replace(WATER, pressure_drop=factor * limit) for factor in (0.999, 1.001))
    assert float(saturation(CAKE, below, 1e9)) == 1.0
    assert float(saturation(CAKE, above, 1e9)) < 0.5
    assert math.isinf(float(time_to_moisture(CAKE, below, 0.2)))
    assert math.isfinite(float(time_to_moisture(CAKE, above, 0.2)))


# --- the inverse ---


@given(cakes, liquors, times)
def test_the_time_to_the_moisture_after_a_time_is_the_time(cake: WetCake, liquor: Liquor, time: float) -> None:
    assume(drains(cake, liquor))
    t = float(dimensionless_time(cake, liquor, time))
    assume(1e-4 < t < 1e6 and not KNEE * 0.999 < t < 2.2)  # what falls at the knee comes back as the knee: below
    wet = moisture(cake, liquor, saturation(cake, liquor, time))
    assert float(time_to_moisture(cake, liquor, wet)) == pytest.approx(time, rel=1e-6)


@given(cakes, liquors, st.floats(0.01, 0.6))
def test_after_the_time_to_a_moisture_the_cake_is_that_dry(cake: WetCake, liquor: Liquor, wanted: float) -> None:
    time = float(time_to_moisture(cake, liquor, wanted))
    if math.isinf(time):
        assert float(moisture(cake, liquor, saturation(cake, liquor, 1e30))) >= wanted * (1.0 - 1e-9)
    else:
        slightly_later = time * (1.0 + 1e-9)
        assert float(moisture(cake, liquor, saturation(cake, liquor, slightly_later))) <= wanted * (1.0 + 1e-9)


def test_a_moisture_in_the_fall_is_reached_at_the_knee() -> None:
    least = float(irreducible_saturation(CAKE, WATER))
    wet = moisture(CAKE, WATER, least + (1.0 - least) * 0.338)
    time = time_to_moisture(CAKE, WATER, wet)
    assert float(dimensionless_time(CAKE, WATER, time)) == pytest.approx(KNEE, rel=1e-12)


def test_times_that_are_none() -> None:
    full = float(moisture(CAKE, WATER, 1.0))
    assert time_to_moisture(CAKE, WATER, [full + 0.01, 0.01]).tolist() == [0.0, math.inf]


# --- directions ---


@given(cakes, liquors, times, st.floats(1.01, 3.0))
def test_longer_and_harder_is_drier(cake: WetCake, liquor: Liquor, time: float, k: float) -> None:
    once = float(saturation(cake, liquor, time))
    assert float(saturation(cake, liquor, k * time)) <= once
    harder = dataclasses.replace(liquor, pressure_drop=k * liquor.pressure_drop)
    assert float(saturation(cake, harder, time)) <= once
    assert float(irreducible_saturation(cake, harder)) <= float(irreducible_saturation(cake, liquor))
    thicker = dataclasses.replace(liquor, viscosity=k * liquor.viscosity)
    assert float(saturation(cake, thicker, time)) >= once
    tighter = dataclasses.replace(cake, resistance=k * cake.resistance)
    assert float(saturation(tighter, liquor, time)) >= once


@given(cakes, liquors, st.floats(0.0, 0.9), st.floats(0.001, 0.1))
def test_more_liquor_is_more_moisture(cake: WetCake, liquor: Liquor, share: float, more: float) -> None:
    once, wetter = (float(moisture(cake, liquor, full)) for full in (share, share + more))
    low, high = (float(end) for end in moisture_range(cake, liquor, share))
    assert low <= once < wetter < 1.0
    assert wetter <= high * (1.0 + 1e-12)


def test_the_range_is_of_the_stated_error() -> None:
    low, high = moisture_range(CAKE, WATER, [0.05, 0.5, 0.95])
    assert low.tolist() == moisture(CAKE, WATER, [0.0, 0.4, 0.85]).tolist()
    assert high.tolist() == pytest.approx(moisture(CAKE, WATER, [0.15, 0.6, 1.0]).tolist())


# --- dimensions ---


@given(cakes, liquors, times, *(st.floats(0.1, 10.0) for _ in range(3)))
def test_dimensions(cake: WetCake, liquor: Liquor, time: float, m: float, kg: float, s: float) -> None:
    """Any change of the units of length, mass and time changes each result as its own unit says."""
    # gravity is a constant of the module: a density that makes up for its change of unit keeps rho_l g in scale
    gravity = m / s**2
    there = WetCake(
        cake.resistance * m / kg, cake.porosity, cake.density * kg / m**3, cake.sauter_mean * m, cake.height * m
    )
    other = Liquor(
        pressure_drop=liquor.pressure_drop * kg / (m * s**2),
        viscosity=liquor.viscosity * kg / (m * s),
        density=liquor.density * kg / m**3 * gravity,
        surface_tension=liquor.surface_tension * kg / s**2,
    )
    pairs = [
        (capillary_number(there, other), capillary_number(cake, liquor), 1.0),
        (threshold_pressure(there, other), threshold_pressure(cake, liquor), kg / (m * s**2)),
        (dimensionless_time(there, other, time * s), dimensionless_time(cake, liquor, time), 1.0),
        (there.permeability, cake.permeability, m**2),
    ]
    for scaled, once, factor in pairs:
        assert float(scaled) == pytest.approx(float(once) * factor, rel=1e-9)


def test_gravity_is_in_the_capillary_number() -> None:
    high = dataclasses.replace(CAKE, height=1.0)
    driving = 1000.0 * GRAVITY * 1.0 + 50e3
    assert float(capillary_number(high, WATER)) == pytest.approx(0.064 * 2.5e-9 * driving / (0.36 * 0.072))


# --- arrays, bad input ---


def test_arrays_broadcast() -> None:
    many = dataclasses.replace(CAKE, height=np.array([[0.01], [0.02]]))
    found = saturation(many, WATER, [1.0, 10.0, 100.0])
    assert found.shape == (2, 3)
    assert float(found[1, 2]) == float(saturation(CAKE, WATER, 100.0))
    assert time_to_moisture(many, WATER, [0.15, 0.2, 0.25]).shape == (2, 3)


def test_bad_values_are_named_at_once() -> None:
    with pytest.raises(FilterError) as caught:
        WetCake(-1.0, 1.0, 0.0, math.nan, math.inf)
    names = [line.split(" = ")[0] for line in str(caught.value).splitlines()]
    assert names == ["resistance", "porosity", "density", "sauter_mean", "height"]
    with pytest.raises(FilterError) as caught:
        Liquor(0.0, -1.0, 0.0, math.inf)
    names = [line.split(" = ")[0] for line in str(caught.value).splitlines()]
    assert names == ["pressure_drop", "viscosity", "density", "surface_tension"]


def test_bad_arguments_are_refused() -> None:
    calls = {
        "time = -1 s: must be zero or positive": lambda: saturation(CAKE, WATER, -1.0),
        "saturation = 1.1: must be from 0 to 1": lambda: moisture(CAKE, WATER, 1.1),
        "moisture = 1: must be above 0 and below 1": lambda: time_to_moisture(CAKE, WATER, 1.0),
        "saturation = nan": lambda: moisture_range(CAKE, WATER, math.nan),
    }
    for says, call in calls.items():
        with pytest.raises(FilterError, match=says):
            call()
