"""Regression of filtration tests against closed forms, simulated tests, and textbook least squares."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from filtercake.errors import FiltercakeError, FiltrationError
from filtercake.filtration.constant_pressure import (
    MINIMUM_READINGS,
    FiltrationFit,
    FiltrationTest,
    compressibility,
    disagreement,
    fit_differential,
    fit_integral,
)

ALPHA, MEDIUM = 3.29e9, 5e9
FORMS: list[Callable[..., FiltrationFit]] = [fit_integral, fit_differential]
SEEDS = 600
TOLERANCE = 3.0 * math.sqrt(0.95 * 0.05 / SEEDS)
"""Three standard deviations of a share of 0.95 counted over SEEDS tests: 0.027."""


def make(
    readings: int = 20,
    *,
    alpha: float = ALPHA,
    medium: float = MEDIUM,
    first: float = 1e-4,
    last: float = 1e-3,
    change: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]] | None = None,
    **values: Any,
) -> FiltrationTest:
    """Build a test at evenly spaced volumes, 45 cm2, 50 kPa, water, 100 g/L; ``change`` disturbs time and volume."""
    known: dict[str, Any] = {"area": 45e-4, "pressure_drop": 50e3, "viscosity": 1e-3, "solids_per_filtrate": 100.0}
    known |= values
    volume = np.linspace(first, last, readings)
    driving = known["area"] * known["pressure_drop"] / known["viscosity"]
    curvature = alpha * known["solids_per_filtrate"] / (2.0 * known["area"] * driving)
    time = curvature * volume**2 + medium / driving * volume
    if change is not None:
        time, volume = change(time, volume)
    return FiltrationTest("run", "pmma", time, volume, **known)


def time_noise(seed: int, size: float = 0.5) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    return lambda t, v: (t + np.random.default_rng(seed).normal(0.0, size, t.size), v)


def volume_noise(seed: int, size: float = 3e-6) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    return lambda t, v: (t, v + np.random.default_rng(seed).normal(0.0, size, v.size))


def held_back(*volumes: float, seed: int = 11, size: float = 0.5) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """Take some volume (mL) from each of the first readings, as an outlet with air in it does; times err too."""

    def change(time: np.ndarray, volume: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        time, volume = time_noise(seed, size)(time, volume)
        volume[: len(volumes)] -= np.array(volumes) * 1e-6
        return time, volume

    return change


def holds(fit: FiltrationFit, alpha: float = ALPHA) -> bool:
    return abs(fit.resistance - alpha) <= fit.resistance_ci95


# --- without noise ---


@pytest.mark.parametrize("fit", FORMS)
@pytest.mark.parametrize("readings", [5, 6, 20, 301])
def test_exact_data_give_exact_resistances(fit: Callable[..., FiltrationFit], readings: int) -> None:
    found = fit(make(readings))
    assert found.resistance == pytest.approx(ALPHA, rel=1e-10)
    assert found.medium_resistance == pytest.approx(MEDIUM, rel=1e-10)
    assert found.kept.all() and found.n == readings and found.left_out == 0 and found.notes == ()
    assert found.resistance_ci95 < 1e-9 * ALPHA


def test_lines_of_both_forms() -> None:
    # mu alpha c / (2 A^2 dP) = 1e-3 * 3.29e9 * 100 / (2 * 2.025e-5 * 5e4) and mu Rm / (A dP) = 1e-3 * 5e9 / 225
    integral, differential = (fit(make()) for fit in FORMS)
    assert integral.slope == pytest.approx(3.29e8 / 2.025, rel=1e-10)
    assert differential.slope == pytest.approx(2.0 * 3.29e8 / 2.025, rel=1e-10)
    assert integral.intercept == pytest.approx(5e6 / 225.0, rel=1e-10)
    assert differential.intercept == pytest.approx(5e6 / 225.0, rel=1e-9)
    assert integral.dof == 18 and differential.dof == 17
    assert integral.time_offset == 0.0 and differential.time_offset == pytest.approx(0.0, abs=1e-9)


tests = st.builds(
    make,
    st.integers(5, 40),
    alpha=st.floats(1e8, 1e12),
    medium=st.floats(1e9, 1e11),
    area=st.floats(1e-4, 1.0),
    pressure_drop=st.floats(1e3, 1e6),
    viscosity=st.floats(1e-4, 1e-1),
    solids_per_filtrate=st.floats(1.0, 500.0),
)


@given(tests, st.sampled_from(FORMS))
def test_any_exact_test_loses_no_reading_and_closes(test: FiltrationTest, fit: Callable[..., FiltrationFit]) -> None:
    found = fit(test)
    driving = test.area * test.pressure_drop / test.viscosity
    rebuilt = found.resistance * test.solids_per_filtrate / (2.0 * test.area * driving) * test.volume**2
    rebuilt += found.medium_resistance / driving * test.volume
    assert found.kept.all()
    np.testing.assert_allclose(rebuilt, test.time, rtol=1e-7)
    assert disagreement(fit_integral(test), fit_differential(test)) is None


@given(st.integers(0, 10_000), st.sampled_from(FORMS), *[st.floats(1e-2, 1e2)] * 3)
def test_results_have_their_dimensions(
    seed: int, fit: Callable[..., FiltrationFit], m: float, kg: float, s: float
) -> None:
    # the same test in other units of length, mass and time
    test = make(change=time_noise(seed))
    other = dataclasses.replace(
        test,
        time=test.time * s,
        volume=test.volume * m**3,
        area=test.area * m**2,
        pressure_drop=test.pressure_drop * kg / (m * s**2),
        viscosity=test.viscosity * kg / (m * s),
        solids_per_filtrate=test.solids_per_filtrate * kg / m**3,
    )
    one, two = fit(test), fit(other)
    assert two.kept.tolist() == one.kept.tolist()
    for name, unit in (("resistance", m / kg), ("medium_resistance", 1.0 / m)):
        for part in ("", "_se", "_ci95"):
            assert getattr(two, name + part) == pytest.approx(getattr(one, name + part) * unit, rel=1e-7), name + part
    assert two.slope == pytest.approx(one.slope * s / m**6, rel=1e-7)
    assert two.intercept == pytest.approx(one.intercept * s / m**3, rel=1e-7)
    assert two.time_offset == pytest.approx(one.time_offset * s, rel=1e-6)


@given(st.integers(0, 10_000), st.sampled_from(FORMS), st.floats(0.01, 100.0))
def test_slower_by_a_factor_is_as_much_more_resistant(seed: int, fit: Callable[..., FiltrationFit], by: float) -> None:
    test = make(change=time_noise(seed))
    one, two = fit(test), fit(dataclasses.replace(test, time=by * test.time))
    assert two.resistance == pytest.approx(by * one.resistance, rel=1e-8)
    assert two.medium_resistance == pytest.approx(by * one.medium_resistance, rel=1e-6)
    assert two.resistance_ci95 == pytest.approx(by * one.resistance_ci95, rel=1e-7)


# --- what is fitted ---


def test_integral_form_is_t_over_v_with_weights_v_squared() -> None:
    test = make(change=time_noise(1))
    slope, intercept = np.polyfit(test.volume * 1e3, test.time / test.volume * 1e-3, 1, w=test.volume)
    fit = fit_integral(test)
    assert fit.slope == pytest.approx(slope * 1e6, rel=1e-9)
    assert fit.intercept == pytest.approx(intercept * 1e3, rel=1e-9)


def test_differential_form_is_generalised_least_squares_of_the_difference_quotients() -> None:
    test = make(change=time_noise(2))
    v, t = test.volume * 1e3, test.time
    step, middle = np.diff(v), 0.5 * (v[1:] + v[:-1])
    quotient = np.diff(t) / step
    errors = np.diag(1.0 / step) @ np.diff(np.eye(v.size), axis=0)
    weights = np.linalg.inv(errors @ errors.T)
    design = np.stack([np.ones_like(middle), middle], axis=1)
    intercept, slope = np.linalg.solve(design.T @ weights @ design, design.T @ weights @ quotient)
    fit = fit_differential(test)
    assert fit.slope == pytest.approx(slope * 1e6, rel=1e-9)
    assert fit.intercept == pytest.approx(intercept * 1e3, rel=1e-9)
    ordinary = np.polyfit(middle, quotient, 1)[0]
    assert abs(ordinary / slope - 1.0) > 1e-3  # which is another thing


def test_differential_form_does_not_care_when_the_clock_was_started() -> None:
    test = make(change=time_noise(3))
    one, two = fit_differential(test), fit_differential(dataclasses.replace(test, time=test.time + 100.0))
    assert two.resistance == pytest.approx(one.resistance, rel=1e-9)
    assert two.medium_resistance == pytest.approx(one.medium_resistance, rel=1e-7)
    assert two.time_offset == pytest.approx(one.time_offset + 100.0, rel=1e-9)


@pytest.mark.parametrize(("fit", "powers"), [(fit_integral, (1, 2)), (fit_differential, (0, 1, 2))])
def test_errors_are_hc3(fit: Callable[..., FiltrationFit], powers: tuple[int, ...]) -> None:
    test = make(9, change=volume_noise(4))
    design = (test.volume * 1e3)[:, None] ** np.array(powers)
    bread = np.linalg.inv(design.T @ design)
    hat = np.diag(design @ bread @ design.T)
    residual = test.time - design @ bread @ design.T @ test.time
    covariance = bread @ design.T @ np.diag((residual / (1.0 - hat)) ** 2) @ design @ bread
    found = fit(test)
    curvature_se, per_curvature = math.sqrt(covariance[-1, -1]) * 1e6, ALPHA / (3.29e8 / 2.025)
    assert found.resistance_se == pytest.approx(curvature_se * per_curvature, rel=1e-8)
    assert found.medium_resistance_se == pytest.approx(math.sqrt(covariance[-2, -2]) * 1e3 * 225.0 * 1e3, rel=1e-8)
    quantile = stats.t.ppf(0.975, 9 - len(powers))
    assert found.resistance_ci95 == pytest.approx(quantile * found.resistance_se)
    assert found.medium_resistance_ci95 == pytest.approx(quantile * found.medium_resistance_se)


def test_a_reading_that_alone_decides_a_coefficient_errs_like_the_others() -> None:
    # 1 and 2 decide the line through the cluster at 3: no residual, and HC3 is 0/0 there
    volume = np.array([1.0, 2.0, 3.0, 3.0, 3.0, 3.0]) * 1e-4
    time = np.array([10.0, 35.0, 70.0, 71.0, 72.0, 74.0])
    fit = fit_differential(dataclasses.replace(make(6), time=time, volume=volume))
    common = np.var(time[2:], ddof=1)
    design = np.vander(np.array([1.0, 2.0, 3.0, 3.0, 3.0, 3.0]), 3)
    ordinary = math.sqrt(common * np.linalg.inv(design.T @ design)[0, 0]) * 1e8
    assert math.sqrt(fit.covariance[2, 2]) / 2.0 == pytest.approx(ordinary, rel=0.05)


@pytest.mark.parametrize("fit", FORMS)
def test_line_and_band_of_t_over_v(fit: Callable[..., FiltrationFit]) -> None:
    found = fit(make(change=time_noise(5)))
    v = np.array([1e-4, 5e-4, 1e-3])
    line, half = found.time_per_volume(v)
    divisor = 1.0 if fit is fit_integral else 2.0
    np.testing.assert_allclose(line, found.time_offset / v + found.intercept + found.slope * v / divisor)
    row = np.array([1.0 / v[1], 1.0, v[1] / divisor])
    assert half[1] == pytest.approx(stats.t.ppf(0.975, found.dof) * math.sqrt(row @ found.covariance @ row))
    # far to the right only the slope counts
    far = found.time_per_volume(1e6)
    assert float(far[1][0]) == pytest.approx(
        1e6 * found.resistance_ci95 / found.resistance * found.slope / divisor, rel=1e-3
    )


# --- with noise ---


@pytest.mark.parametrize(
    ("noise", "readings", "lowest"),
    [
        # lowest: 0.95 less three standard deviations of the count; for volumes less what HC3 lacks (0.01)
        (time_noise, 8, 0.95 - TOLERANCE),
        (time_noise, 20, 0.95 - TOLERANCE),
        (volume_noise, 8, 0.94 - TOLERANCE),
        (volume_noise, 20, 0.94 - TOLERANCE),
    ],
)
@pytest.mark.parametrize("fit", FORMS)
def test_intervals_cover(fit: Callable[..., FiltrationFit], noise: Any, readings: int, lowest: float) -> None:
    fits = [fit(make(readings, change=noise(seed))) for seed in range(SEEDS)]
    alpha = np.mean([holds(found) for found in fits])
    medium = np.mean([abs(found.medium_resistance - MEDIUM) <= found.medium_resistance_ci95 for found in fits])
    # intervals are a little too wide for few readings, and never absurdly so
    highest = 0.995 if readings < 10 or noise is volume_noise else 0.96 + TOLERANCE
    assert lowest <= alpha <= highest
    assert lowest <= medium <= highest
    # and their width is the real scatter's, which coverage alone would not tell for the mean of many
    scatter = np.std([found.resistance for found in fits])
    assert np.median([found.resistance_se for found in fits]) == pytest.approx(
        scatter, rel=0.4 if readings < 10 else 0.3
    )


# --- what is doubtful, and what is refused ---


def test_forms_that_agree_say_nothing() -> None:
    said = [disagreement(*(fit(make(change=time_noise(seed))) for fit in FORMS)) for seed in range(200)]
    assert sum(text is not None for text in said) <= 12  # their intervals are not independent: 2 % or so


def test_a_disagreement_names_what_and_how_much() -> None:
    test = make(change=lambda t, v: (time_noise(1, 0.2)(t, v)[0] + 6.0, v))
    integral, differential = (fit(test) for fit in FORMS)
    text = disagreement(integral, differential)
    assert text is not None and "medium" in text and "cake" in text
    assert f"{integral.resistance:.4g} and {differential.resistance:.4g} m/kg" in text
    limit = math.hypot(integral.resistance_ci95, differential.resistance_ci95)
    just = dataclasses.replace(differential, resistance=integral.resistance + 0.99 * limit)
    assert "cake" not in str(disagreement(integral, just))
    over = dataclasses.replace(differential, resistance=integral.resistance + 1.01 * limit)
    assert "cake" in str(disagreement(integral, over))


def test_negative_medium_resistance_is_a_note() -> None:
    slight = make(medium=0.0, change=lambda t, v: (t + 0.3 * np.cos(np.arange(t.size)) - 0.1, v))
    fit = fit_integral(slight)
    assert -fit.medium_resistance_ci95 < fit.medium_resistance < 0.0
    (note,) = fit.notes
    assert "negative" in note and "not told from zero" in note
    clear = fit_integral(make(medium=-2e9, first=3e-4))
    (note,) = clear.notes
    assert clear.medium_resistance + clear.medium_resistance_ci95 < 0.0
    assert "negative" in note and "start-up or the time zero is doubtful" in note


def test_a_cake_not_told_from_zero_is_a_note() -> None:
    noisy = make(alpha=2e7, medium=1e11, change=time_noise(6, 4.0))
    fit = fit_integral(noisy)
    assert 0.0 < fit.resistance < fit.resistance_ci95
    assert any("cake resistance" in note and "not told from zero" in note for note in fit.notes)


@pytest.mark.parametrize("fit", FORMS)
@pytest.mark.parametrize("alpha", [0.0, -1e8])
def test_a_cake_that_does_not_resist_is_refused(fit: Callable[..., FiltrationFit], alpha: float) -> None:
    bent = make(alpha=alpha - 1e6, medium=1e11)
    with pytest.raises(FiltrationError, match=r"run: the (integral|differential) form gives .* m/kg: must be positive"):
        fit(bent)


@pytest.mark.parametrize(
    ("key", "value", "unit"),
    [
        ("area", 0.0, "m2"),
        ("area", math.inf, "m2"),
        ("pressure_drop", -5e4, "Pa"),
        ("viscosity", math.nan, "Pa s"),
        ("solids_per_filtrate", 0.0, "kg/m3"),
    ],
)
def test_impossible_values_are_named(key: str, value: float, unit: str) -> None:
    with pytest.raises(FiltrationError) as caught:
        dataclasses.replace(make(), **{key: value})
    assert str(caught.value) == f"run: {key} = {value:g} {unit}: must be positive and finite"
    assert isinstance(caught.value, FiltercakeError)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("key", ["time", "volume"])
def test_impossible_readings_are_named(key: str, bad: float) -> None:
    values = getattr(make(), key).copy()
    values[3] = bad
    with pytest.raises(FiltrationError, match=rf"run: {key} = {bad:g} (s|m3): must be positive and finite"):
        dataclasses.replace(make(), **{key: values})


def test_readings_must_fit_together() -> None:
    test = make()
    with pytest.raises(FiltrationError, match="20 times but 19 volumes"):
        dataclasses.replace(test, volume=test.volume[1:])
    with pytest.raises(FiltrationError, match=r"times must ascend"):
        dataclasses.replace(test, time=test.time[::-1])
    with pytest.raises(FiltrationError, match=r"1 readings: must be at least 2"):
        make(MINIMUM_READINGS - 1)
    assert make(MINIMUM_READINGS).time.size == 2


@pytest.mark.parametrize("fit", FORMS)
def test_volumes_that_stand_still_are_refused(fit: Callable[..., FiltrationFit]) -> None:
    stopped = make(change=lambda t, v: (t, np.full_like(v, v[6])))
    with pytest.raises(FiltrationError, match="run: the volumes of the readings hardly differ"):
        fit(stopped)


# --- compressibility ---

PRESSURES = np.array([25e3, 50e3, 100e3, 200e3])


def law(pressure: np.ndarray, alpha0: float = 2e9, exponent: float = 0.4) -> np.ndarray:
    return np.asarray(alpha0 * (pressure / 1e5) ** exponent)


@pytest.mark.parametrize("errors", [None, 0.03, np.array([0.01, 0.02, 0.05, 0.1])])
def test_exact_power_law(errors: Any) -> None:
    fit = compressibility(PRESSURES, law(PRESSURES), errors)
    assert fit.exponent == pytest.approx(0.4, rel=1e-10)
    assert fit.alpha0 == pytest.approx(2e9, rel=1e-10)
    assert fit.n == 4 and fit.notes == () and fit.reference_pressure == 100e3
    value, low, high = fit.resistance_at([25e3, 400e3])
    np.testing.assert_allclose(value, law(np.array([25e3, 400e3])), rtol=1e-10)
    assert (low <= value).all() and (value <= high).all()


def test_interval_of_the_points_own_errors() -> None:
    # exact points: only the stated errors are left; uncorrelated about the weighted mean of ln dP
    error = np.array([0.01, 0.02, 0.05, 0.1])
    fit = compressibility(PRESSURES, law(PRESSURES), error)
    x = np.log(PRESSURES / 1e5)
    design = np.stack([np.ones(4), x], axis=1)
    covariance = np.linalg.inv(design.T @ np.diag(error**-2.0) @ design)
    assert fit.exponent_ci95 == pytest.approx(1.959964 * math.sqrt(covariance[1, 1]), rel=1e-6)
    half = 1.959964 * math.sqrt(covariance[0, 0])
    assert fit.alpha0_high == pytest.approx(fit.alpha0 * math.exp(half), rel=1e-6)
    assert fit.alpha0_low == pytest.approx(fit.alpha0 * math.exp(-half), rel=1e-6)
    row = np.array([1.0, math.log(0.7)])
    _, low, high = fit.resistance_at(70e3)
    assert math.log(high / low) == pytest.approx(2.0 * 1.959964 * math.sqrt(row @ covariance @ row), rel=1e-6)


def test_interval_of_the_spread() -> None:
    alpha = law(PRESSURES) * np.exp([0.1, -0.12, 0.03, -0.02])
    textbook = stats.linregress(np.log(PRESSURES), np.log(alpha))
    for errors in (None, 1e-4, 7.0 * np.full(4, 1e-4)):
        fit = compressibility(PRESSURES, alpha, errors)
        assert fit.exponent == pytest.approx(textbook.slope, rel=1e-9)
        assert fit.exponent_ci95 == pytest.approx(stats.t.ppf(0.975, 2) * textbook.stderr, rel=1e-9)
    assert compressibility(PRESSURES, alpha, 1.0).exponent_ci95 > 2.0 * fit.exponent_ci95


@pytest.mark.parametrize(
    ("stated", "real", "lowest", "highest"),
    [
        (None, 0.05, 0.95 - TOLERANCE, 0.95 + TOLERANCE),
        (0.05, 0.05, 0.95 - TOLERANCE, 1.0),  # the larger of two intervals, either of which covers 0.95
        (0.01, 0.05, 0.95 - TOLERANCE, 0.95 + TOLERANCE),
        (0.2, 0.05, 0.99, 1.0),
    ],
)
@pytest.mark.parametrize("points", [3, 8])
def test_compressibility_covers(stated: Any, real: float, lowest: float, highest: float, points: int) -> None:
    pressure = np.geomspace(25e3, 200e3, points)
    truth = float(law(np.array([60e3]))[0])
    exponent, alpha0, between = 0, 0, 0
    for seed in range(SEEDS):
        noise = np.random.default_rng(seed).normal(0.0, real, points)
        fit = compressibility(pressure, law(pressure) * np.exp(noise), stated)
        exponent += abs(fit.exponent - 0.4) <= fit.exponent_ci95
        alpha0 += fit.alpha0_low <= 2e9 <= fit.alpha0_high
        _, low, high = fit.resistance_at(60e3)
        between += bool(low <= truth <= high)
    for hits in (exponent, alpha0, between):
        assert lowest <= hits / SEEDS <= highest


@given(st.floats(1e3, 1e6), st.integers(0, 1000))
def test_the_reference_pressure_changes_nothing_but_alpha0(reference: float, seed: int) -> None:
    alpha = law(PRESSURES) * np.exp(np.random.default_rng(seed).normal(0.0, 0.1, 4))
    one, two = (compressibility(PRESSURES, alpha, 0.05, pressure) for pressure in (1e5, reference))
    assert two.exponent == pytest.approx(one.exponent, rel=1e-8)
    assert two.exponent_ci95 == pytest.approx(one.exponent_ci95, rel=1e-8)
    for pressure in (1e3, 5e4, 1e6):
        np.testing.assert_allclose(two.resistance_at(pressure), one.resistance_at(pressure), rtol=1e-8)
    assert (two.alpha0, two.alpha0_low, two.alpha0_high) == pytest.approx(
        tuple(float(value) for value in two.resistance_at(reference))
    )


@pytest.mark.parametrize("errors", [None, 0.05])
def test_two_points_give_no_interval(errors: float | None) -> None:
    fit = compressibility([5e4, 1e5], [1e9, 2e9], errors)
    assert fit.exponent == pytest.approx(1.0, rel=1e-12) and fit.alpha0 == pytest.approx(2e9, rel=1e-12)
    assert math.isnan(fit.exponent_ci95) and math.isnan(fit.alpha0_low) and math.isnan(fit.alpha0_high)
    value, low, high = fit.resistance_at(7e4)
    assert float(value) == pytest.approx(1.4e9) and math.isnan(low) and math.isnan(high)
    (note,) = fit.notes
    assert "third pressure" in note


def test_repeats_at_two_pressures_give_an_interval_and_a_note() -> None:
    fit = compressibility([5e4, 5e4, 1e5, 1e5], [1e9, 1.1e9, 2e9, 2.1e9])
    assert 0.0 < fit.exponent_ci95 < 1.0
    assert "two pressures" in fit.notes[0]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (([5e4], [1e9]), "two different pressures"),
        (([5e4, 5e4, 5e4], [1e9, 2e9, 3e9]), "two different pressures"),
        (([], []), "two different pressures"),
        (([5e4, 1e5], [1e9]), "2 pressures but 1 resistances"),
        (([5e4, 0.0], [1e9, 1e9]), "pressure_drop = 0 Pa: must be positive"),
        (([5e4, 1e5], [1e9, -1e9]), "resistance = -1e\\+09 m/kg: must be positive"),
        (([5e4, 1e5], [1e9, math.nan]), "resistance = nan m/kg: must be positive"),
        (([5e4, 1e5], [1e9, 1e9], [0.1, 0.0]), "relative_se = 0: must be positive"),
        (([5e4, 1e5], [1e9, 1e9], [0.1, 0.1, 0.1]), "3 values of relative_se but 2"),
        (([5e4, 1e5], [1e9, 1e9], None, -1.0), "reference_pressure = -1 Pa: must be positive"),
    ],
)
def test_compressibility_refuses(arguments: tuple[Any, ...], says: str) -> None:
    with pytest.raises(FiltrationError, match=says):
        compressibility(*arguments)


def test_resistance_at_refuses_no_pressure() -> None:
    with pytest.raises(FiltrationError, match="pressure_drop = 0 Pa"):
        compressibility(PRESSURES, law(PRESSURES)).resistance_at([1e5, 0.0])


@pytest.mark.parametrize(("key", "at", "factor"), [("volume", 3, 1e-300), ("volume", 19, 1e200), ("time", 0, 1e-12)])
def test_a_reading_no_instrument_shows_is_named(key: str, at: int, factor: float) -> None:
    test = make()
    values = getattr(test, key).copy()
    values[at] *= factor
    with pytest.raises(FiltrationError, match=rf"reading {at + 1}: {key} = .*must be within a factor of 1e\+08"):
        dataclasses.replace(test, **{key: values})
