"""What a filtration test says: known faults, each found; what stays open widens the interval or is refused."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from filtercake.calibration.measurements import FiltrationConditions, filtration_test_of
from filtercake.errors import FiltrationError
from filtercake.filtration.analysis import FiltrationAnalysis, analyse
from filtercake.filtration.constant_pressure import READING_ERROR, FiltrationTest, fit_integral

FILES = Path(__file__).resolve().parents[2] / "data" / "leaf_tests"
CONDITIONS = {"area_cm2": 50, "pressure_drop_kPa": 70, "viscosity_mPa_s": 1, "solids_per_filtrate_kg_m3": 100}
ALPHA, MEDIUM = 3.5e9, 1.75e10


def read(name: str, **more: float) -> FiltrationTest:
    return filtration_test_of(
        FiltrationConditions.model_validate({**CONDITIONS, **more}), name, "crystals", FILES / f"{name}.csv"
    )


def made(time: np.ndarray, volume: np.ndarray, **more: object) -> FiltrationTest:
    """Make a test of the same conditions; s and mL."""
    values = {"area": 50e-4, "pressure_drop": 70e3, "viscosity": 1e-3, "solids_per_filtrate": 100.0, **more}
    return FiltrationTest("run", "crystals", time, volume * 1e-6, **values)  # type: ignore[arg-type]


def law(volume: np.ndarray) -> np.ndarray:
    return np.asarray(0.05 * volume + 1e-4 * volume**2)


VOLUME = np.linspace(50.0, 1200.0, 24)


def left_out(found: FiltrationAnalysis) -> list[int]:
    return np.flatnonzero(~found.integral.kept).tolist()


def test_an_undisturbed_test_is_taken_whole() -> None:
    found = analyse(read("base"))
    assert found.resistance == pytest.approx(ALPHA, rel=1e-9)
    assert found.medium_resistance == pytest.approx(MEDIUM, rel=1e-9)
    assert found.form == "integral" and found.time_zero == 0.0 and not left_out(found) and not found.notes
    assert found.resistance_ci95 < 1e-9 * ALPHA


def test_a_clock_started_early_is_seen_and_said() -> None:
    found = analyse(read("early_clock"))
    assert found.resistance == pytest.approx(ALPHA, rel=1e-6)
    assert found.medium_resistance == pytest.approx(MEDIUM, rel=1e-5)
    assert found.time_zero == pytest.approx(30.0, rel=1e-6) and found.form == "differential"
    (note,) = found.notes
    assert "began at 30 s of the clock (clock started early" in note
    # the forms agree over the readings used, from there on
    assert found.integral.resistance == pytest.approx(found.differential.resistance, rel=1e-6)


def test_a_clock_started_late_leaves_the_medium_in_doubt() -> None:
    found = analyse(made(law(VOLUME[4:]) - 15.0, VOLUME[4:]))
    assert found.resistance == pytest.approx(ALPHA, rel=1e-6)
    assert found.time_zero == pytest.approx(-15.0, rel=1e-6)
    assert "clock started late" in found.notes[0]
    # b'^2 = b^2 - 4 a t0: the medium's resistance if there was filtrate before
    other = MEDIUM * math.sqrt(0.05**2 + 4.0 * 1e-4 * 15.0) / 0.05
    assert f"if the volumes are off instead, the medium's resistance is {other:.3g} 1/m" in found.notes[0]
    assert found.medium_resistance_ci95 == pytest.approx(other - MEDIUM, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "lines", "count", "why"),
    [
        ("short_tail", "lines 12 to 14", 3, "slower than a growing cake (cake dry, or chamber full?)"),
        ("solids_settled", "lines 10 to 14", 5, "faster than a growing cake (no solids left"),
    ],
)
def test_the_end_of_a_test_is_left_out(name: str, lines: str, count: int, why: str) -> None:
    found = analyse(read(name))
    assert found.resistance == pytest.approx(ALPHA, rel=1e-6) and found.resistance_ci95 < 0.05 * ALPHA
    (note,) = [text for text in found.notes if "end of the test" in text]
    assert note.startswith(f"end of the test: {lines} left out ({count} of 13 readings, from ") and why in note


def test_filtrate_that_was_there_is_taken_off() -> None:
    test = read("vessel_not_empty")
    found = analyse(test)
    assert found.resistance == pytest.approx(ALPHA, rel=1e-9)
    assert found.medium_resistance == pytest.approx(MEDIUM, rel=1e-9)
    assert test.notes[0].startswith("line 2: 150 mL at time zero, taken off all volumes")


def test_masses() -> None:
    found = analyse(read("balance", filtrate_density_kg_m3=789.0))
    assert found.resistance == pytest.approx(ALPHA, rel=1e-9)
    with pytest.raises(FiltrationError, match=r"balance.csv: line 1: holds masses of filtrate: give filtrate_density"):
        read("balance")


def test_a_pumps_ramp_is_left_out_or_becomes_the_time_zero() -> None:
    # the pressure rises in proportion to time for 20 s: t^2 / 40 s = a V^2 + b V there, t - 10 s beyond
    time = np.where(law(VOLUME) < 10.0, np.sqrt(40.0 * law(VOLUME)), law(VOLUME) + 10.0)
    found = analyse(made(time, VOLUME))
    assert found.resistance == pytest.approx(ALPHA, rel=1e-4)
    assert found.time_zero == pytest.approx(10.0, rel=1e-3)
    assert max(left_out(found)) == np.flatnonzero(law(VOLUME) < 10.0)[-1]
    assert "start-up: readings 1 to" in found.notes[0] and "more filtrate than a constant pressure" in found.notes[0]


def test_both_ends() -> None:
    time = law(VOLUME) + 20.0
    time[:3] += [6.0, 5.0, 2.0]
    time[20:] += [10.0, 30.0, 60.0, 100.0]
    found = analyse(made(time, VOLUME))
    assert left_out(found) == [0, 1, 2, 20, 21, 22, 23]
    assert found.resistance == pytest.approx(ALPHA, rel=1e-6) and found.time_zero == pytest.approx(20.0, rel=1e-6)


def test_an_unknown_beginning_is_fitted() -> None:
    found = analyse(made(law(VOLUME[3:]) - law(VOLUME[3]), VOLUME[3:], known_zero=False))
    assert found.resistance == pytest.approx(ALPHA, rel=1e-6)
    assert "the beginning is not among the readings: fitted, at -14 s of the clock" in found.notes[0]


def test_textbook_data() -> None:
    conditions = {
        "area_cm2": 439.0,
        "pressure_drop_kPa": 338.0,
        "viscosity_mPa_s": 0.8937,
        "solids_per_filtrate_kg_m3": 23.47,
    }
    test = read("geankoplis", **conditions)
    # the ordinary least squares of t/V: errors of the times that grow with V
    plain = fit_integral(test, growth=1.0)
    assert plain.resistance == pytest.approx(1.79e11, rel=3e-3)
    assert plain.medium_resistance == pytest.approx(1.13e11, rel=4e-3)
    found = analyse(test)
    for alpha in (1.79e11, 1.863e11):  # and what the book reads from its plot
        assert abs(found.resistance - alpha) <= found.resistance_ci95 < 0.1 * found.resistance


def test_two_readings_give_a_number_with_a_wide_interval() -> None:
    time, volume = law(VOLUME[[11, 23]]), VOLUME[[11, 23]]
    found = analyse(made(time, volume))
    assert found.resistance == pytest.approx(ALPHA, rel=1e-9) and found.medium_resistance == pytest.approx(MEDIUM)
    # by hand: a = (t2/V2 - t1/V1)/(V2 - V1), each time and volume off by 2 %
    draws = np.random.default_rng(1).normal(1.0, READING_ERROR, (2, 2, 200_000))
    t, v = time[:, None] * draws[0], volume[:, None] * draws[1]
    slope = (t[1] / v[1] - t[0] / v[0]) / (v[1] - v[0])
    assert found.resistance_ci95 / ALPHA == pytest.approx(1.96 * float(np.std(slope)) / 1e-4, rel=0.03)
    assert any("2 readings do not tell their errors: 2 % of each" in note for note in found.notes)
    half = analyse(made(time, volume, reading_error=0.01))
    assert half.resistance_ci95 == pytest.approx(0.5 * found.resistance_ci95)


def test_few_readings_that_scatter_more_than_stated_are_less_sure() -> None:
    volume = VOLUME[[5, 11, 17, 23]]
    good = analyse(made(law(volume), volume))
    bad = analyse(made(law(volume) * np.array([1.0, 1.3, 0.8, 1.0]), volume))
    assert bad.resistance_ci95 > 4.0 * good.resistance_ci95


def test_what_no_readings_decide_is_refused_with_their_lines() -> None:
    # the pressure was quartered half-way: two filtrations of about as many readings
    time = np.where(VOLUME <= 600.0, law(VOLUME), law(np.array(600.0)) + 4.0 * (law(VOLUME) - law(np.array(600.0))))
    noisy = time + np.random.default_rng(4).normal(0.0, 0.5, time.size)
    test = dataclasses.replace(made(noisy, VOLUME), lines=tuple(range(2, 26)), known_zero=False)
    with pytest.raises(FiltrationError, match=r"do not decide between .* m/kg from lines \d+ to \d+ and .* from lines"):
        analyse(test)


def test_no_filtration_is_refused() -> None:
    with pytest.raises(FiltrationError, match=r"m/kg: must be positive; the readings do not slow down"):
        analyse(made(10.0 * np.sqrt(VOLUME), VOLUME))


def test_few_undisturbed_tests_lose_readings_and_their_intervals_stay_narrow() -> None:
    found = []
    for seed in range(60):
        noise = np.random.default_rng(seed).normal(0.0, 0.5, VOLUME.size)
        found.append(analyse(made(law(VOLUME) + noise, VOLUME)))
    assert sum(bool(left_out(result)) for result in found) <= 8
    assert sum(result.time_zero != 0.0 for result in found) <= 10
    assert sum(abs(result.resistance - ALPHA) <= result.resistance_ci95 for result in found) >= 54
    plain = [
        fit_integral(made(law(VOLUME) + np.random.default_rng(seed).normal(0.0, 0.5, VOLUME.size), VOLUME))
        for seed in range(60)
    ]
    ratio = [result.resistance_ci95 / fit.resistance_ci95 for result, fit in zip(found, plain, strict=True)]
    assert np.median(ratio) < 2.0


def test_a_resistance_known_badly_is_said() -> None:
    noise = np.random.default_rng(4).normal(0.0, 8.0, VOLUME.size)
    found = analyse(made(np.sort(law(VOLUME) + 10.0 + noise).clip(0.1), VOLUME))
    assert found.resistance_ci95 > 0.1 * found.resistance
    percent = 100.0 * found.resistance_ci95 / found.resistance
    assert f"the cake resistance is known to within {percent:.0f} % only" in found.notes
