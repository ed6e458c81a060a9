"""The best design, where calculus or counting knows it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from search_problems import CONCENTRATION, LEVELS, belief, best_time, plant, power, problem

from filtercake.design.plant import TOO_LARGE, Limits, evaluate
from filtercake.design.search import (
    FLAT,
    INTERIOR,
    LOWER,
    OPEN,
    UPPER,
    best_at,
    evaluated,
    every_design,
    find,
    pareto,
)


@settings(max_examples=20)
@given(st.floats(0.3, 2.0))
def test_costs_that_are_powers_are_least_where_calculus_says(exponent: float) -> None:
    expected = best_time(exponent)
    assume(LEVELS[0] * 1.05 < expected < LEVELS[-1] / 1.05)
    found = find(problem(exponent), belief(1e-5))
    assert found.residence_time == pytest.approx(expected, rel=0.03)  # steps of 6 %
    assert found.kind == INTERIOR
    assert found.low <= found.residence_time <= found.high
    # with the porosity known, the parabola between the steps finds it closer
    assert float(np.exp(np.median(found.draws))) == pytest.approx(expected, rel=0.005)


def test_what_is_not_known_of_the_porosity_widens_the_optimum() -> None:
    found = [find(problem(), belief(deviation)) for deviation in (0.001, 0.004, 0.016)]
    widths = [item.high - item.low for item in found]
    assert widths[0] < widths[1] < widths[2]
    costs = [item.value_high - item.value_low for item in found]
    assert costs[0] < costs[1] < costs[2]
    assert found[0].kind == INTERIOR and found[2].kind == OPEN


def test_most_curves_have_their_optimum_in_its_interval() -> None:
    found = find(problem(), belief(0.008))
    inside = np.mean((found.draws >= np.log(found.low)) & (found.draws <= np.log(found.high)))
    assert inside == pytest.approx(0.95, abs=0.01)


@pytest.mark.parametrize(("alpha", "kind", "place"), [(1e6, LOWER, 0), (1e13, UPPER, -1)])
def test_an_optimum_at_an_end_of_the_range_is_a_bound(alpha: float, kind: str, place: int) -> None:
    base = problem()
    scaled = replace(base, resistance=lambda k, porosity: base.resistance(k, porosity) * alpha / 1e10)
    found = find(scaled, belief(0.004))
    assert found.kind == kind
    assert found.residence_time == pytest.approx(base.residence_times[place])
    assert found.at_bounds[place] == 1.0


def test_an_optimum_that_does_not_matter_is_flat() -> None:
    open_ = find(problem(tolerance=1e-6, target=0.01), belief(0.004))
    flat = find(problem(tolerance=0.1, target=0.01), belief(0.004))
    assert open_.kind == OPEN and flat.kind == FLAT
    assert flat.flat[0] <= flat.low < flat.high <= flat.flat[1]
    surface = flat.surface / flat.surface.min(axis=1, keepdims=True)
    inside = (np.array(problem().residence_times) >= flat.flat[0]) & (problem().residence_times <= flat.flat[1])
    assert (np.mean(surface[:, inside] <= 1.1, axis=0) >= 0.95).all()


def test_a_faster_drum_is_smaller_down_to_the_thinnest_cake_allowed() -> None:
    ranges = {**problem().ranges, "rotation_rate": (1e-3, 1e-1)}
    free = problem(ranges=ranges)
    limited = problem(ranges=ranges, plant=plant(limits=Limits(thinnest=5e-3)))
    for place in (0, 24, 48):
        assert best_at(free, belief(0.001), place, 0.0).settings.rotation_rate == pytest.approx(0.1)
        choice = best_at(limited, belief(0.001), place, 0.0)
        assert float(evaluated(limited, belief(0.001), place, choice).cake_thickness) == pytest.approx(5e-3, rel=2e-3)
        assert choice.value > best_at(free, belief(0.001), place, 0.0).value


def test_a_limit_that_no_design_keeps_leaves_none() -> None:
    found = find(problem(plant=plant(limits=Limits(largest_area=1e-3))), belief(0.004))
    assert not found.possible and found.kind == OPEN and not found.settled
    (_, _, item), *_ = every_design(problem(plant=plant(limits=Limits(largest_area=1e-3))), belief(0.004), 0)
    assert item.misses[TOO_LARGE].all()


def test_a_limit_that_part_of_the_range_keeps_bounds_the_optimum() -> None:
    areas = [
        float(evaluated(problem(), belief(1e-6), place, best_at(problem(), belief(1e-6), place, 0.0)).filter_area)
        for place in range(49)
    ]
    limit = areas[40] * 1.0001
    found = find(problem(plant=plant(limits=Limits(largest_area=limit))), belief(1e-6))
    assert found.place == 40 > int(np.argmin([abs(t - best_time(0.6)) for t in problem().residence_times]))


@pytest.mark.parametrize("price", [1e2, 1e6])
def test_the_cheaper_filter_type_is_taken(price: float) -> None:
    costs = {**plant().filter_cost, "leaf": power(price, 0.7, "m2", "leaf_filter")}
    both = problem(plant=plant(filter_cost=costs), filter_types=("drum", "leaf"))
    found = find(both, belief(0.001))
    alone = {kind: find(replace(both, filter_types=(kind,)), belief(0.001)).value for kind in ("drum", "leaf")}
    assert found.value == min(alone.values())
    assert found.choice.settings.filter_type == min(alone, key=lambda kind: alone[kind])


def test_four_settings_at_once_go_where_each_goes_alone() -> None:
    ranges = {"slurry_concentration": (100.0, 300.0), "submerged_fraction": (0.2, 0.4), "rotation_rate": (5e-3, 2e-2)}
    many = problem(ranges=ranges, pressure_drops=np.geomspace(2e4, 8e4, 3))
    wide = belief(0.001)
    same = replace(wide, mean=np.repeat(wide.mean, 3, axis=1), covariance=np.repeat(wide.covariance, 3, axis=0))
    chosen = best_at(many, same, 24, 0.0)
    assert chosen.pressure == 2
    settings_found = chosen.settings
    assert settings_found.pressure_drop == pytest.approx(8e4)
    for name, (_, high) in ranges.items():
        assert getattr(settings_found, name) == pytest.approx(high)
    again = evaluate(many.plant, settings_found, many.cake(24, np.array(0.4)))
    assert float(again.objective("installed_cost")) == pytest.approx(chosen.value)
    assert ranges["slurry_concentration"][0] < CONCENTRATION < ranges["slurry_concentration"][1]


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=30))
def test_what_no_other_design_beats_is_found(points: list[tuple[int, int]]) -> None:
    one, other = (np.array(values, dtype=float) for values in zip(*points, strict=True))
    found = {points[k] for k in pareto(one, other)}
    expected = {(a, b) for a, b in points if not any((c <= a and d <= b) and (c < a or d < b) for c, d in points)}
    assert found == expected
    assert len(pareto(one, other)) == len(found)


def test_designs_that_miss_a_limit_are_beaten_by_all() -> None:
    assert pareto(np.array([np.inf, 1.0]), np.array([0.0, 2.0])).tolist() == [1]
    assert pareto(np.array([np.inf]), np.array([np.inf])).size == 0
