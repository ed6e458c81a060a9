"""Batch filters and deliquoring by their options: the library's answers in a user's units."""

from __future__ import annotations

from typing import Any

import pytest

from filtercake import api
from filtercake.errors import ConfigError, FilterError
from filtercake.filtration.batch_filter import BatchCake, BatchFilter, best_height, cycle, solids_per_filtrate
from filtercake.filtration.deliquoring import Liquor, WetCake, saturation

BATCH: dict[str, Any] = {
    "resistance_m_kg": 1e10,
    "porosity": 0.4,
    "density_kg_m3": 1500,
    "slurry_concentration_kg_m3": 100,
    "pressure_drop_kPa": 200,
    "medium_resistance_1_m": 1e10,
    "viscosity_mPa_s": 2.0,
    "turnaround_time_min": 20,
    "deliquoring_time_min": 10,
    "wash_ratio": 2,
    "wash_viscosity_mPa_s": 1.0,
}
WET: dict[str, Any] = {
    "resistance_m_kg": 1e9,
    "porosity": 0.4,
    "density_kg_m3": 1300,
    "sauter_mean_um": 50,
    "cake_height_mm": 20,
    "pressure_drop_kPa": 50,
}


def test_a_batch_filter_in_a_users_units() -> None:
    cake = BatchCake(1e10, 0.4, 1500.0)
    batch = BatchFilter(2e5, 1e10, 2e-3, solids_per_filtrate(100.0, cake), 1200.0, 600.0, 2.0, 1e-3)
    wanted = cycle(batch, cake, best_height(batch, cake))
    found = api.batch_filter(slurry_flow_m3_h=3.6, **BATCH)
    assert found.cake_height_mm == pytest.approx(1e3 * float(wanted.height))
    assert found.cycle_time_min == pytest.approx(float(wanted.time) / 60.0)
    parts = found.filtration_time_min + found.wash_time_min + found.deliquoring_time_min + found.turnaround_time_min
    assert parts == pytest.approx(found.cycle_time_min)
    # 3.6 m3/h of 100 kg/m3 are 0.1 kg/s
    assert found.filter_area_m2 == pytest.approx(0.1 / float(wanted.productivity))
    assert found.crystals_kg_m2_h == pytest.approx(3600.0 * float(wanted.productivity))
    # what a cycle takes is what comes in meanwhile
    assert found.slurry_per_batch_m3 == pytest.approx(3.6 * found.cycle_time_min / 60.0)


def test_the_best_height_is_better_than_its_neighbours() -> None:
    best = api.batch_filter(slurry_flow_m3_h=1, **BATCH)
    for factor in (0.8, 1.25):
        other = api.batch_filter(slurry_flow_m3_h=1, cake_height_mm=factor * best.best_height_mm, **BATCH)
        assert other.filter_area_m2 > best.filter_area_m2
        assert other.best_height_mm == best.best_height_mm


def test_a_limit_and_a_cake_beyond_it() -> None:
    limited = api.batch_filter(slurry_flow_m3_h=1, height_limit_mm=15, **BATCH)
    assert limited.cake_height_mm == limited.best_height_mm == pytest.approx(15.0) and limited.fits
    assert not api.batch_filter(slurry_flow_m3_h=1, height_limit_mm=15, cake_height_mm=16, **BATCH).fits


def test_flow_and_area_are_inverse() -> None:
    found = api.batch_filter(slurry_flow_m3_h=2.5, **BATCH)
    assert api.batch_filter(filter_area_m2=found.filter_area_m2, **BATCH).slurry_flow_m3_h == pytest.approx(2.5)


def test_deliquoring_in_a_users_units() -> None:
    found = api.deliquoring(time_min=1.5, **WET)
    cake, liquor = WetCake(1e9, 0.4, 1300.0, 50e-6, 0.02), Liquor(50e3, 1e-3, 1000.0, 0.072)
    assert found.saturation == pytest.approx(float(saturation(cake, liquor, 90.0)))
    assert found.threshold_pressure_kPa == pytest.approx(9.936)
    assert found.moisture_low < found.moisture < found.moisture_high
    assert found.lowest_moisture < found.moisture
    assert found.in_range
    assert api.deliquoring(moisture=found.moisture, **WET).time_min == pytest.approx(1.5)


@pytest.mark.parametrize("time", [1e-3, 100.0])
def test_times_beyond_the_correlation_are_marked(time: float) -> None:
    assert not api.deliquoring(time_min=time, **WET).in_range


def test_moistures_and_pressures_out_of_reach_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"moisture = 0.05: must be above 0.08965, which no time of deliquoring"):
        api.deliquoring(moisture=0.05, **WET)
    with pytest.raises(ConfigError, match=r"pressure_drop_kPa = 9: must be above 9.936 kPa"):
        api.deliquoring(time_min=1, **{**WET, "pressure_drop_kPa": 9})
    with pytest.raises(ConfigError, match="exactly one of time_min and moisture"):
        api.deliquoring(time_min=1, moisture=0.2, **WET)


def test_every_wrong_option_is_named() -> None:
    with pytest.raises(ConfigError) as caught:
        api.batch_filter(slurry_flow_m3_h=1, **{**BATCH, "porosity": 40, "wash_ration": 1, "viscosity_mPa_s": -1})
    text = str(caught.value)
    assert "porosity = 40" in text and "viscosity_mPa_s = -1" in text and "did you mean wash_ratio" in text
    with pytest.raises(ConfigError, match="exactly one of slurry_flow_m3_h and filter_area_m2"):
        api.batch_filter(**BATCH)
    with pytest.raises(ConfigError, match="turnaround_time_min or deliquoring_time_min must be above 0"):
        api.batch_filter(slurry_flow_m3_h=1, **{**BATCH, "turnaround_time_min": 0, "deliquoring_time_min": 0})
    with pytest.raises(FilterError, match="slurry_concentration = 950 kg/m3: must be below the 900 kg/m3"):
        api.batch_filter(slurry_flow_m3_h=1, **{**BATCH, "slurry_concentration_kg_m3": 950})
