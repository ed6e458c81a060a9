"""Costs of equipment against values worked out by hand, and what is marked or refused outside their ranges."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.design.costs import (
    CEPCI,
    FARTHEST,
    PRESETS,
    Correlation,
    costs_side_by_side,
    equipment_cost,
    load_correlations,
)
from filtercake.errors import ConfigError, CostError

KNOWN = load_correlations()

# by hand, in decimal arithmetic of 30 digits: three sizes each (m2, m3, kg/s), US dollars of the correlation's own year
BY_HAND = {
    "drum_filter_turton": [(1.0, 64908.26), (3.44, 95003.58), (100.0, 356369.1)],
    "drum_filter_seider": [(1.0, 115397.8), (3.44, 137396.1), (50.0, 358149.5)],
    "leaf_filter_turton": [(1.0, 6587.187), (10.0, 28827.04), (100.0, 136804.4)],
    "plate_and_frame_filter_turton": [(1.0, 18862.53), (10.0, 50003.45), (50.0, 120152.7)],
    "batch_evaporative_crystallizer_turton": [(2.0, 37496.22), (5.0, 49699.73), (20.0, 91707.39)],
    "forced_circulation_crystallizer_woods": [(0.5, 467474.4), (1.0, 675000.0), (4.0, 1407329.0)],
}
FACTORS = {"drum_filter_turton": 1.65, "drum_filter_seider": 2.32, "forced_circulation_crystallizer_woods": 1.43}

MINE = """
correlations:
  my_nutsche:
    title: our Nutsche filters
    equipment: nutsche
    formula: power
    coefficients: [20000, 0.6]
    size_unit: m2
    size_range: [0.1, 4]
    cost_index: 800
    index_year: 2024
    installed_factor: 2
    installed_as: installed
    source: our own orders
"""


def test_every_correlation_is_checked() -> None:
    assert set(BY_HAND) == set(KNOWN)


@pytest.mark.parametrize("name", BY_HAND)
def test_by_hand_to_four_digits(name: str) -> None:
    for size, cost in BY_HAND[name]:
        found = equipment_cost(name, size, KNOWN[name].cost_index)
        assert float(found.purchase) == pytest.approx(cost, rel=5e-5)
        assert float(found.installed) == pytest.approx(cost * KNOWN[name].installed_factor, rel=5e-5)
        assert bool(found.in_range) == (KNOWN[name].si_range is not None)


def test_factors_as_published() -> None:
    assert {name: KNOWN[name].installed_factor for name in FACTORS} == FACTORS
    assert KNOWN["forced_circulation_crystallizer_woods"].installed_as == "installed"
    assert KNOWN["drum_filter_turton"].installed_as == "bare module"


def test_index_years() -> None:
    assert {KNOWN[name].cost_index for name in BY_HAND} == {CEPCI[2001], CEPCI[2007], CEPCI[2013]}
    assert all(CEPCI[correlation.index_year] == correlation.cost_index for correlation in KNOWN.values())


def test_two_books_agree_on_the_papers_drum() -> None:
    turton, seider = costs_side_by_side("drum_filter", 3.44, 800.0)
    assert (turton.name, seider.name) == ("drum_filter_turton", "drum_filter_seider")
    assert float(turton.purchase) == pytest.approx(float(seider.purchase), rel=0.02)
    for cost in (turton, seider):
        assert 191e3 < float(cost.purchase) < 194e3


def test_the_papers_case() -> None:
    # MSMPR of 5 and 20 m3, drum of 3.44 and 2.905 m2: the larger crystallizer costs more than its filter saves
    mixer = equipment_cost("batch_evaporative_crystallizer_turton", [5.0, 20.0], 397.0).purchase
    drum = equipment_cost("drum_filter_turton", [3.44, 2.905], 397.0).purchase
    assert (mixer / 1e3).round().tolist() == [50.0, 92.0]
    assert (drum / 1e3).round().tolist() == [95.0, 90.0]


@given(st.sampled_from(sorted(KNOWN)), st.floats(0.0, 1.0), st.floats(1.01, 3.0), st.floats(100.0, 2000.0))
def test_costs_go_with_index_and_currency_and_grow_with_size(name: str, share: float, k: float, index: float) -> None:
    low, high = KNOWN[name].si_range or (0.1, 10.0)
    size = low * (high / low) ** share
    once = equipment_cost(name, size, index)
    assert float(equipment_cost(name, size, k * index).purchase) == pytest.approx(k * float(once.purchase))
    assert float(equipment_cost(name, size, index, k).installed) == pytest.approx(k * float(once.installed))
    assert float(equipment_cost(name, k * size, index).purchase) > float(once.purchase)


def test_arrays() -> None:
    sizes = np.array([[1.0, 2.0, 400.0]])
    found = equipment_cost("drum_filter_turton", sizes, 600.0)
    assert found.purchase.shape == found.installed.shape == found.in_range.shape == (1, 3)
    assert float(found.purchase[0, 1]) == float(equipment_cost("drum_filter_turton", 2.0, 600.0).purchase)
    assert found.in_range.tolist() == [[True, True, False]]


def test_the_exponent_is_the_slope() -> None:
    for correlation in KNOWN.values():
        size = np.array([2.0])
        slope = np.log(correlation.purchase(size * 1.0001) / correlation.purchase(size)) / np.log(1.0001)
        assert correlation.exponent(size) == pytest.approx(slope, rel=1e-3)


def test_seiders_range_in_square_metres() -> None:
    low, high = KNOWN["drum_filter_seider"].si_range or (0.0, 0.0)
    assert (low, high) == (pytest.approx(0.929, abs=1e-3), pytest.approx(74.32, abs=0.01))
    inside = equipment_cost("drum_filter_seider", [0.9, 0.93, 74.0, 75.0], 567.0).in_range
    assert inside.tolist() == [False, True, True, False]


def test_far_outside_is_refused() -> None:
    assert not equipment_cost("leaf_filter_turton", 235.0 * 0.99 * FARTHEST, 397.0).in_range
    with pytest.raises(CostError, match=r"size = 3000 m2: leaf_filter_turton is of 0.6 to 235 m2; must be within a"):
        equipment_cost("leaf_filter_turton", [1.0, 3000.0], 397.0)


def test_a_larger_one_that_costs_less_is_refused() -> None:
    # Seider's parabola turns at ln A = 0.1905 / (2 * 0.0554), A = 5.58 ft2 = 0.518 m2
    assert not equipment_cost("drum_filter_seider", 0.53, 567.0).in_range
    with pytest.raises(CostError, match=r"size = 0.51 m2: by drum_filter_seider a larger one would cost less"):
        equipment_cost("drum_filter_seider", 0.51, 567.0)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            ("drum_filter_turtle", 1.0, 397.0),
            r"correlation = 'drum_filter_turtle': allowed: .*did you mean drum_filter_t",
        ),
        (("drum_filter_turton", 0.0, 397.0), r"size = 0 m2: must be positive and finite"),
        (("drum_filter_turton", [1.0, float("nan")], 397.0), r"size = nan m2: must be positive"),
        (("drum_filter_turton", 1.0, -1.0), r"cost_index = -1: must be positive"),
        (("drum_filter_turton", 1.0, 397.0, float("inf")), r"currency_per_usd = inf: must be positive"),
    ],
)
def test_bad_arguments_are_refused(arguments: tuple[object, ...], says: str) -> None:
    with pytest.raises(CostError, match=says):
        equipment_cost(*arguments)  # type: ignore[arg-type]


def test_unknown_equipment_is_refused() -> None:
    with pytest.raises(CostError, match=r"equipment = 'drum': allowed: drum_filter, leaf_filter.*"):
        costs_side_by_side("drum", 1.0, 397.0)


def test_a_file_of_ones_own_adds_to_them(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(MINE, encoding="utf-8")
    found = load_correlations(path)
    assert set(found) == {*KNOWN, "my_nutsche"}
    (cost,) = costs_side_by_side("nutsche", 2.0, 400.0, correlations=found)
    assert float(cost.purchase) == pytest.approx(20000 * 2.0**0.6 / 2.0)
    assert float(cost.installed) == pytest.approx(20000 * 2.0**0.6)
    path.write_text(MINE.replace("my_nutsche", "leaf_filter_turton"), encoding="utf-8")
    assert load_correlations(path)["leaf_filter_turton"].title == "our Nutsche filters"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("size_unit: m2", "size_unit: yd2", r"correlations.my_nutsche.size_unit = 'yd2': allowed: 'm2', 'ft2'"),
        ("cost_index: 800", "cost_indx: 800", r"cost_indx = 800: unknown key.*did you mean cost_index"),
        ("cost_index: 800", "cost_index: 0", r"my_nutsche.cost_index = 0: must be greater than 0"),
        ("[0.1, 4]", "[4, 0.1]", r"size_range must be the smallest size, then the largest"),
        ("[20000, 0.6]", "[20000, 0.6, 1]", r"power has two coefficients, both positive"),
        ("[20000, 0.6]", "[20000, -0.6]", r"power has two coefficients, both positive"),
        ("[20000, 0.6]", "[20000]", r"coefficients = \[20000\]: must hold at least 2 values"),
        ("source: our own orders", "", r"my_nutsche.source = \(missing\): must be given"),
    ],
)
def test_a_wrong_file_is_named(old: str, new: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    assert old in MINE
    path.write_text(MINE.replace(old, new), encoding="utf-8")
    with pytest.raises(ConfigError, match=says) as caught:
        load_correlations(path)
    assert str(path) in str(caught.value)


def test_every_preset_says_where_it_is_from() -> None:
    assert PRESETS.is_file()
    for correlation in KNOWN.values():
        assert isinstance(correlation, Correlation)
        assert len(correlation.source) > 20
