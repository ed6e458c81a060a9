"""Costs by their options, and the drum's area with safety and on the filtrate basis."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from filtercake import api
from filtercake.design.costs import PRESETS
from filtercake.errors import ConfigError, CostError, FilterError

DRUM: dict[str, Any] = {
    "slurry_flow_m3_h": 20,
    "slurry_concentration_kg_m3": 200,
    "pressure_drop_kPa": 53.32,
    "submerged_fraction": 0.3,
    "rotation_rate_rpm": 0.2,
    "medium_resistance_1_m": 5e9,
}


def test_both_correlations_of_a_drum() -> None:
    found = api.cost(equipment="drum_filter", filter_area_m2=3.44, cost_index=800)
    assert [item.correlation for item in found] == ["drum_filter_turton", "drum_filter_seider"]
    assert [round(item.purchase / 1e3) for item in found] == [191, 194]
    assert [item.installed / item.purchase for item in found] == pytest.approx([1.65, 2.32])
    assert all(item.in_range and item.installed_as == "bare module" for item in found)
    assert (found[0].smallest, found[0].largest, found[0].size_unit) == (0.9, 300.0, "m2")
    assert (found[1].cost_index, found[1].index_year) == (567.0, 2013)


@pytest.mark.parametrize(
    ("equipment", "size"),
    [
        ("leaf_filter", {"filter_area_m2": 10}),
        ("plate_and_frame_filter", {"filter_area_m2": 10}),
        ("batch_evaporative_crystallizer", {"crystallizer_volume_m3": 5}),
        ("forced_circulation_crystallizer", {"crystals_kg_s": 1}),
    ],
)
def test_each_kind_has_its_size(equipment: str, size: dict[str, float]) -> None:
    (found,) = api.cost(equipment=equipment, cost_index=600, currency_per_usd=0.9, **size)
    assert 0.0 < found.purchase < found.installed
    with pytest.raises(ConfigError, match=r"= 1: is no size of a " + equipment):
        wrong = "crystals_kg_s" if "filter" in equipment or "batch" in equipment else "filter_area_m2"
        api.cost(equipment=equipment, cost_index=600, **size, **{wrong: 1})


def test_a_file_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    text = PRESETS.read_text(encoding="utf-8").replace("leaf_filter", "nutsche")
    path.write_text(text, encoding="utf-8")
    (mine,) = api.cost(equipment="nutsche", filter_area_m2=10, cost_index=397, costs_file=str(path))
    assert mine.purchase == pytest.approx(28827.04, rel=1e-6)


def test_wrong_costs_are_refused() -> None:
    with pytest.raises(CostError, match=r"equipment = 'leaf_filer': .*did you mean leaf_filter"):
        api.cost(equipment="leaf_filer", filter_area_m2=10, cost_index=600)
    with pytest.raises(ConfigError, match=r"cost_index = \(missing\): must be given"):
        api.cost(equipment="leaf_filter", filter_area_m2=10)
    with pytest.raises(ConfigError, match=r"filter_area_m2 = \(missing\): must be given for a leaf_filter"):
        api.cost(equipment="leaf_filter", cost_index=600)


def test_areas_with_safety_grow_with_the_resistance_they_are_for() -> None:
    found = api.filter_area(resistance_m_kg=1e9, resistance_ci95_m_kg=3e8, **DRUM)
    upper, paper = (api.filter_area(resistance_m_kg=alpha, **DRUM).filter_area_m2 for alpha in (1.3e9, 2e9))
    assert (found.filter_area_upper_m2, found.filter_area_paper_factor_m2) == (
        pytest.approx(upper),
        pytest.approx(paper),
    )
    assert found.safety.startswith("the 95 % interval ends at 1.3 times the resistance found")
    with pytest.raises(FilterError, match="resistance = 0 m/kg: must be positive"):
        api.filter_area(resistance_m_kg=0, resistance_ci95_m_kg=1, **DRUM)


def test_the_filtrate_basis_needs_the_cake() -> None:
    cake = {"porosity": 0.293, "density_kg_m3": 2450}
    slurry, filtrate = (
        api.filter_area(resistance_m_kg=1.009e8, filtrate_basis=basis, **cake, **DRUM) for basis in (False, True)
    )
    assert slurry.filter_area_m2 / filtrate.filter_area_m2 == pytest.approx(1.0849, abs=1e-4)
    with pytest.raises(ConfigError, match="filtrate_basis needs porosity and density_kg_m3"):
        api.filter_area(resistance_m_kg=1.009e8, filtrate_basis=True, **DRUM)
