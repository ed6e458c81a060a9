"""Batch filters against Ruth's law, a published test, the calculus of the best cake, and their own inverses."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from filtercake.errors import FilterError
from filtercake.filtration.batch_filter import (
    BatchCake,
    BatchFilter,
    area_for,
    best_height,
    capacity_of,
    cycle,
    height_after,
    solids_per_filtrate,
)
from filtercake.filtration.drum_filter import DrumFilter, cake_mass_per_area, forming_time, on_filtrate_basis

CAKE = BatchCake(resistance=1e10, porosity=0.4, density=1500.0)
NUTSCHE = BatchFilter(
    pressure_drop=2e5,
    medium_resistance=1e10,
    viscosity=1e-3,
    solids_per_filtrate=100.0,
    turnaround_time=1200.0,
    deliquoring_time=600.0,
    wash_ratio=2.0,
)

positive = st.floats(0.1, 10.0)
cakes = st.builds(
    BatchCake,
    resistance=st.floats(1e7, 1e13),
    porosity=st.floats(0.2, 0.9),
    density=st.floats(800.0, 5000.0),
)
filters = st.builds(
    BatchFilter,
    pressure_drop=st.floats(1e4, 1e6),
    medium_resistance=st.floats(0.0, 1e12),
    viscosity=st.floats(1e-4, 0.1),
    solids_per_filtrate=st.floats(1.0, 500.0),
    turnaround_time=st.floats(10.0, 1e5),
    deliquoring_time=st.floats(0.0, 1e4),
    wash_ratio=st.floats(0.0, 5.0),
    wash_viscosity=st.one_of(st.none(), st.floats(1e-4, 0.1)),
)
heights = st.floats(1e-4, 1.0)


def changed(batch: BatchFilter = NUTSCHE, **values: object) -> BatchFilter:
    return dataclasses.replace(batch, **values)  # type: ignore[arg-type]


# --- times ---


def test_a_cycle_by_hand() -> None:
    # 5 cm of 900 kg/m3 are 45 kg/m2 from 0.45 m3 of filtrate; (mu/dP)(alpha c v^2/2 + Rm v)
    found = cycle(NUTSCHE, CAKE, 0.05)
    assert float(found.cake_mass) == pytest.approx(45.0)
    assert float(found.filtration_time) == pytest.approx(1e-3 / 2e5 * (1e10 * 100.0 * 0.45**2 / 2.0 + 1e10 * 0.45))
    # pores of 0.02 m hold 0.02 m3/m2: 0.04 m3/m2 of liquor through alpha w + Rm
    assert float(found.wash_time) == pytest.approx(0.04 * 1e-3 * (1e10 * 45.0 + 1e10) / 2e5)
    assert float(found.standing_time) == 1800.0
    assert float(found.time) == pytest.approx(528.75 + 92.0 + 1800.0)
    assert float(found.productivity) == pytest.approx(45.0 / 2420.75)
    assert bool(found.fits)


def test_a_textbooks_filtration() -> None:
    # CaCO3, Geankoplis 14.2-1: 5.009 L through 0.0439 m2 in 107.3 s at 338 kPa; alpha and Rm by least squares
    cake = BatchCake(resistance=1.79e11, porosity=0.5, density=2700.0)
    batch = BatchFilter(338e3, 1.13e11, 8.937e-4, 23.47, turnaround_time=0.0)
    height = 23.47 * 5.009e-3 / 0.0439 / (2700.0 * 0.5)
    assert float(cycle(batch, cake, height).filtration_time) == pytest.approx(107.3, rel=0.02)


@given(filters, cakes, heights)
def test_the_height_after_the_time_of_filtration_is_the_height(
    batch: BatchFilter, cake: BatchCake, height: float
) -> None:
    time = cycle(batch, cake, height).filtration_time
    assert float(height_after(batch, cake, time)) == pytest.approx(height, rel=1e-10)


def test_early_filtration_is_the_mediums_and_late_the_cakes() -> None:
    early, late = (height_after(NUTSCHE, CAKE, np.array([t, 4.0 * t])) for t in (1e-9, 1e9))
    assert early[1] / early[0] == pytest.approx(4.0, rel=1e-6)
    assert late[1] / late[0] == pytest.approx(2.0, rel=1e-3)


@given(st.floats(1e7, 1e12), st.floats(0.0, 1e12), st.floats(10.0, 400.0))
def test_a_drums_cake_forms_as_in_a_batch(alpha: float, medium: float, slurry: float) -> None:
    cake = BatchCake(alpha, 0.4, 1500.0)
    drum = DrumFilter(6e4, 0.3, 0.01, medium, 1e-3, slurry)
    drum = on_filtrate_basis(drum, 0.4, 1500.0)
    batch = BatchFilter(6e4, medium, 1e-3, solids_per_filtrate(slurry, cake), turnaround_time=0.0)
    height = cake_mass_per_area(drum, alpha) / 900.0
    assert float(cycle(batch, cake, height).filtration_time) == pytest.approx(30.0, rel=1e-10)
    assert float(forming_time(drum, alpha, 900.0 * height)) == pytest.approx(30.0, rel=1e-10)


@given(filters, cakes, heights, positive, positive, positive)
def test_dimensions(batch: BatchFilter, cake: BatchCake, height: float, m: float, kg: float, s: float) -> None:
    """Any change of the units of length, mass and time changes each result as its own unit says."""
    wash = None if batch.wash_viscosity is None else batch.wash_viscosity * kg / (m * s)
    other = BatchFilter(
        pressure_drop=batch.pressure_drop * kg / (m * s**2),
        medium_resistance=batch.medium_resistance / m,
        viscosity=batch.viscosity * kg / (m * s),
        solids_per_filtrate=batch.solids_per_filtrate * kg / m**3,
        turnaround_time=batch.turnaround_time * s,
        deliquoring_time=batch.deliquoring_time * s,
        wash_ratio=batch.wash_ratio,
        wash_viscosity=wash,
    )
    there = BatchCake(cake.resistance * m / kg, cake.porosity, cake.density * kg / m**3)
    once, then = cycle(batch, cake, height), cycle(other, there, height * m)
    pairs = [
        (then.cake_mass, once.cake_mass, kg / m**2),
        (then.filtration_time, once.filtration_time, s),
        (then.wash_time, once.wash_time, s),
        (then.time, once.time, s),
        (then.productivity, once.productivity, kg / (m**2 * s)),
        (best_height(other, there), best_height(batch, cake), m),
        (height_after(other, there, 7.0 * s), height_after(batch, cake, 7.0), m),
        (area_for(then, 3.0 * kg / s), area_for(once, 3.0), m**2),
    ]
    for scaled, plain, factor in pairs:
        assert float(scaled) == pytest.approx(float(plain) * factor, rel=1e-9, abs=1e-300)


@given(filters, cakes, heights, st.floats(1.01, 3.0))
def test_times_go_up_and_down_with_the_right_things(
    batch: BatchFilter, cake: BatchCake, height: float, k: float
) -> None:
    once = float(cycle(batch, cake, height).filtration_time)
    assert float(cycle(changed(batch, viscosity=k * batch.viscosity), cake, height).filtration_time) > once
    for name in ("pressure_drop", "solids_per_filtrate"):
        more = changed(batch, **{name: k * getattr(batch, name)})
        assert float(cycle(more, cake, height).filtration_time) < once
    assert float(cycle(batch, cake, k * height).filtration_time) > k * once * (1.0 - 1e-12)
    tighter = dataclasses.replace(cake, resistance=k * cake.resistance)
    assert float(cycle(batch, tighter, height).filtration_time) > once
    washed = changed(batch, wash_ratio=batch.wash_ratio + 1.0)
    assert float(cycle(washed, cake, height).time) > float(cycle(batch, cake, height).time)


def test_wash_liquor_of_another_viscosity() -> None:
    thick = cycle(changed(wash_viscosity=3e-3), CAKE, 0.05)
    assert float(thick.wash_time) == pytest.approx(3.0 * float(cycle(NUTSCHE, CAKE, 0.05).wash_time))
    assert float(cycle(changed(wash_ratio=0.0), CAKE, 0.05).wash_time) == 0.0


# --- the best cake ---


@given(filters, cakes)
def test_the_best_height_of_the_calculus_is_that_of_a_search(batch: BatchFilter, cake: BatchCake) -> None:
    best = float(best_height(batch, cake))

    def less(log_height: float) -> float:
        return -math.log(float(cycle(batch, cake, math.exp(log_height)).productivity))

    found = minimize_scalar(less, bounds=(math.log(best) - 7.0, math.log(best) + 7.0), method="bounded")
    # the search knows the height to the root of its rounding, the productivity there to that of the calculus
    assert -less(math.log(best)) >= -found.fun - 1e-12
    if float(batch.medium_resistance) < 1e9:  # else the maximum is so flat that rounding hides it
        assert math.exp(float(found.x)) == pytest.approx(best, rel=0.02)


def test_the_best_cake_takes_as_long_as_the_filter_stands_still() -> None:
    dry = changed(medium_resistance=0.0)
    found = cycle(dry, CAKE, best_height(dry, CAKE))
    assert float(found.filtration_time + found.wash_time) == pytest.approx(1800.0)
    assert float(best_height(dry, CAKE)) == float(best_height(NUTSCHE, CAKE))  # whatever the medium


def test_on_a_grid_of_heights_none_is_better() -> None:
    grid = np.geomspace(1e-3, 10.0, 100_001)
    productivity = cycle(NUTSCHE, CAKE, grid).productivity
    best = best_height(NUTSCHE, CAKE)
    assert float(cycle(NUTSCHE, CAKE, best).productivity) >= float(productivity.max())
    assert grid[int(productivity.argmax())] == pytest.approx(float(best), rel=1e-3)


def test_a_height_limit_binds() -> None:
    free = float(best_height(NUTSCHE, CAKE))
    limited = changed(height_limit=0.5 * free)
    assert float(best_height(limited, CAKE)) == 0.5 * free
    assert float(best_height(changed(height_limit=2.0 * free), CAKE)) == free
    heights = np.array([0.4, 0.5, 0.6]) * free
    found = cycle(limited, CAKE, heights)
    assert found.fits.tolist() == [True, True, False]
    assert (np.diff(found.productivity) > 0.0).all()  # so that the limit is the best within it


def test_without_a_standing_time_there_is_no_best_height() -> None:
    with pytest.raises(FilterError, match=r"turnaround_time = 0 s: must be positive where deliquoring_time = 0 s"):
        best_height(changed(turnaround_time=0.0, deliquoring_time=0.0), CAKE)


# --- areas, arrays, balances ---


def test_area_and_capacity_are_inverse() -> None:
    found = cycle(NUTSCHE, CAKE, [0.02, 0.05])
    needed = area_for(found, 0.1)
    assert needed.tolist() == pytest.approx([0.1 / p for p in found.productivity])
    assert capacity_of(found, needed).tolist() == pytest.approx([0.1, 0.1])


@given(st.floats(0.01, 800.0))
def test_solids_per_filtrate_closes_the_volume(slurry: float) -> None:
    c = float(solids_per_filtrate(slurry, CAKE))
    filtrate = slurry / c
    assert filtrate + slurry / 900.0 == pytest.approx(1.0, rel=1e-12)
    assert c > slurry


def test_a_slurry_as_dense_as_its_cake_is_refused() -> None:
    with pytest.raises(FilterError, match=r"slurry_concentration = 900 kg/m3: must be below the 900 kg/m3 of crystals"):
        solids_per_filtrate([100.0, 900.0], CAKE)


def test_arrays_broadcast() -> None:
    cake = BatchCake(np.array([1e9, 1e10, 1e11]), 0.4, 1500.0)
    batch = changed(pressure_drop=np.array([[1e5], [2e5]]))
    best = best_height(batch, cake)
    found = cycle(batch, cake, best)
    assert best.shape == found.time.shape == found.productivity.shape == found.fits.shape == (2, 3)
    one = cycle(NUTSCHE, CAKE, best_height(NUTSCHE, CAKE))
    assert float(found.productivity[1, 1]) == float(one.productivity)
    assert found.standing_time.shape == (2, 3)


# --- bad input ---


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("pressure_drop", 0.0, "pressure_drop = 0 Pa: must be positive and finite"),
        ("medium_resistance", -1.0, "medium_resistance = -1 1/m: must be zero or positive"),
        ("viscosity", math.nan, "viscosity = nan Pa s: must be positive"),
        ("solids_per_filtrate", 0.0, "solids_per_filtrate = 0 kg/m3: must be positive"),
        ("turnaround_time", -1.0, "turnaround_time = -1 s: must be zero or positive"),
        ("deliquoring_time", math.inf, "deliquoring_time = inf s: must be zero or positive, and finite"),
        ("wash_ratio", -0.5, "wash_ratio = -0.5: must be zero or positive"),
        ("wash_viscosity", 0.0, "wash_viscosity = 0 Pa s: must be positive"),
        ("height_limit", 0.0, "height_limit = 0 m: must be positive"),
        ("height_limit", math.nan, "height_limit = nan m: must be positive"),
    ],
)
def test_bad_filters_are_refused(name: str, value: float, says: str) -> None:
    with pytest.raises(FilterError) as caught:
        changed(**{name: value})
    assert str(caught.value).startswith(says)


def test_bad_cakes_and_arguments_are_refused() -> None:
    with pytest.raises(FilterError) as caught:
        BatchCake(0.0, 1.0, -5.0)
    assert [line.split(" = ")[0] for line in str(caught.value).splitlines()] == ["resistance", "porosity", "density"]
    found = cycle(NUTSCHE, CAKE, 0.05)
    calls = {
        "height": lambda: cycle(NUTSCHE, CAKE, [0.1, 0.0]),
        "filtration_time": lambda: height_after(NUTSCHE, CAKE, -1.0),
        "solids_flow": lambda: area_for(found, math.nan),
        "filter_area": lambda: capacity_of(found, 0.0),
        "slurry_concentration": lambda: solids_per_filtrate(0.0, CAKE),
    }
    for name, call in calls.items():
        with pytest.raises(FilterError, match=f"{name} = "):
            call()
