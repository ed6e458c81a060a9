"""Sizes and costs of crystallizer and filter, against the formulas that they are made of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.design.costs import equipment_cost, load_correlations
from filtercake.design.plant import (
    NOT_COSTED,
    TOO_LARGE,
    TOO_MUCH_MEDIUM,
    TOO_THIN,
    CakeOf,
    Limits,
    Plant,
    Settings,
    Suction,
    evaluate,
    moisture_ends,
)
from filtercake.filtration import deliquoring
from filtercake.filtration.drum_filter import DrumFilter, area, cake_thickness, medium_share

KNOWN = load_correlations()
PLANT = Plant(
    production=200.0 * 20.0 / 3600.0,
    density=2450.0,
    viscosity=1e-3,
    liquid_density=1000.0,
    medium_resistance=5e9,
    crystallizer_cost=KNOWN["batch_evaporative_crystallizer_turton"],
    filter_cost={"drum": KNOWN["drum_filter_turton"], "leaf": KNOWN["leaf_filter_turton"]},
    cost_index=397.0,
    turnaround=1200.0,
)
SETTINGS = Settings("drum", 900.0, 200.0, 53.32e3, 0.3, 1.0 / 300.0)
CAKE = CakeOf(np.array(0.293), np.array(1.009e8), 170e-6)
DRUM = DrumFilter(53.32e3, 0.3, 1.0 / 300.0, 5e9, 1e-3, 200.0)


def test_a_drum_is_that_of_eq_10_and_costs_what_the_correlations_say() -> None:
    found = evaluate(PLANT, SETTINGS, CAKE)
    assert float(found.crystallizer_volume) == pytest.approx(5.0)
    assert float(found.filter_area) == pytest.approx(3.44, abs=0.005)  # the paper's, Fig. 14
    assert float(found.medium_share) == pytest.approx(float(medium_share(DRUM, 1.009e8)))
    assert float(found.cake_thickness) == pytest.approx(float(cake_thickness(DRUM, 1.009e8, 0.293, 2450.0)))
    vessel = equipment_cost("batch_evaporative_crystallizer_turton", 5.0, 397.0)
    drum = equipment_cost("drum_filter_turton", found.filter_area, 397.0)
    assert float(found.objective("installed_cost")) == pytest.approx(float(vessel.installed + drum.installed))
    assert float(found.objective("purchase_cost")) == pytest.approx(float(vessel.purchase + drum.purchase))
    assert float(found.objective("filter_area")) == float(found.filter_area)
    assert found.feasible.all() and found.in_range.all()


@given(st.floats(1.1, 3.0))
def test_a_thicker_slurry_is_less_of_it(factor: float) -> None:
    thin, thick = (evaluate(PLANT, replace(SETTINGS, slurry_concentration=c), CAKE) for c in (200.0, 200.0 * factor))
    assert float(thick.crystallizer_volume) == pytest.approx(float(thin.crystallizer_volume) / factor)
    assert float(thick.filter_area) < float(thin.filter_area)
    richer = replace(DRUM, slurry_concentration=200.0 * factor)
    assert float(thick.filter_area) == pytest.approx(float(area(richer, 1.009e8, 20.0 / 3600.0 / factor)))


def test_a_currency_and_a_year_scale_all_costs() -> None:
    plain, other = (
        evaluate(plant, SETTINGS, CAKE) for plant in (PLANT, replace(PLANT, cost_index=794.0, currency_per_usd=3.0))
    )
    for name in ("installed_cost", "purchase_cost"):
        assert float(other.objective(name)) == pytest.approx(6.0 * float(plain.objective(name)))


def test_a_batch_filter_makes_the_cake_of_the_most_crystals_that_is_allowed() -> None:
    leaf = replace(SETTINGS, filter_type="leaf")
    free = evaluate(PLANT, leaf, CAKE)
    areas = []
    for low in np.array([0.5, 1.0, 1.5, 2.0]) * float(free.cake_thickness):
        found = evaluate(replace(PLANT, limits=Limits(thinnest=low)), leaf, CAKE)
        assert float(found.cake_thickness) == pytest.approx(max(low, float(free.cake_thickness)))
        areas.append(float(found.filter_area))
    assert areas[0] == areas[1] == pytest.approx(float(free.filter_area))
    assert areas[1] < areas[2] < areas[3]
    thin = evaluate(replace(PLANT, limits=Limits(thickest=0.5 * float(free.cake_thickness))), leaf, CAKE)
    assert float(thin.filter_area) > float(free.filter_area)
    # the same area takes the same crystals, whatever shape the settings have
    many = evaluate(PLANT, replace(leaf, pressure_drop=np.array([30e3, 53.32e3])), CAKE)
    assert many.filter_area[1] == pytest.approx(float(free.filter_area)) and many.filter_area[0] > many.filter_area[1]


@pytest.mark.parametrize(
    ("limits", "missed"),
    [
        (Limits(thinnest=0.1), TOO_THIN),
        (Limits(largest_area=3.0), TOO_LARGE),
        (Limits(largest_medium_share=0.4), TOO_MUCH_MEDIUM),
    ],
)
def test_a_limit_that_is_missed_is_named_and_costs_infinitely_much(limits: Limits, missed: str) -> None:
    found = evaluate(replace(PLANT, limits=limits), SETTINGS, CAKE)
    assert [name for name, where in found.misses.items() if where.all()] == [missed]
    assert np.isinf(found.objective("installed_cost")).all()


def test_what_no_correlation_is_for_is_refused_and_what_is_just_outside_marked() -> None:
    beside = evaluate(PLANT, replace(SETTINGS, residence_time=60.0 * 100.0), CAKE)  # 33 m3, of 1.5 to 30
    assert beside.feasible.all() and not beside.in_range.any()
    far = evaluate(PLANT, replace(SETTINGS, residence_time=60.0 * 1000.0), CAKE)
    assert far.misses[NOT_COSTED].all()


def test_a_moisture_is_that_of_the_suction_after_the_slurry() -> None:
    plant = replace(PLANT, suction=Suction(0.4, 0.072))
    found = evaluate(plant, SETTINGS, CAKE)
    wet = deliquoring.WetCake(1.009e8, 0.293, 2450.0, 170e-6, found.cake_thickness)
    liquor = deliquoring.Liquor(53.32e3, 1e-3, 1000.0, 0.072)
    expected = deliquoring.moisture(wet, liquor, deliquoring.saturation(wet, liquor, 0.4 * 300.0))
    assert float(found.cake_moisture) == pytest.approx(float(expected))
    low, high = moisture_ends(plant, SETTINGS, CAKE, found.cake_thickness)
    assert float(low) < float(found.cake_moisture) < float(high)
    assert np.isnan(evaluate(PLANT, SETTINGS, CAKE).cake_moisture).all()
