"""The weighing of change-points: least squares from running sums, long tests, and what is no filtration."""

from __future__ import annotations

import numpy as np
import pytest

from filtercake.filtration.undisturbed import LEAST_WEIGHT, Segments, choices


def parabola(volume: np.ndarray) -> np.ndarray:
    return np.asarray(0.5 * volume + volume**2)


def test_running_sums_give_least_squares() -> None:
    volume = np.linspace(0.1, 1.0, 12)
    time = parabola(volume) + np.random.default_rng(1).normal(0.0, 0.01, 12)
    design = np.stack([np.ones(12), volume, volume**2], axis=1)
    segments = Segments(design, time)
    for first, last in ((0, 12), (2, 9), (7, 12)):
        part = slice(first, last)
        coefficients, squares, *_ = np.linalg.lstsq(design[part], time[part], rcond=None)
        first_, last_ = np.array([first]), np.array([last])
        assert segments.squares(first_, last_) == pytest.approx(squares, rel=1e-6)
        variance = squares[0] / (last - first - 3) * np.linalg.inv(design[part].T @ design[part])
        ratios = coefficients[1:] / np.sqrt(np.diag(variance)[1:])
        assert segments.ratios(first_, last_)[0] == pytest.approx(ratios, rel=1e-5)


@pytest.mark.parametrize("readings", [12, 30, 200])
def test_change_points_are_found_to_the_reading(readings: int) -> None:
    volume = np.linspace(0.02, 1.0, readings)
    time = parabola(volume)
    start, stop = readings // 6, readings - readings // 4
    time[:start] += 0.1 * (volume[start] - volume[:start]) + 0.02
    time[stop:] += 3.0 * (volume[stop:] - volume[stop - 1])
    best = choices(time, volume, known_zero=True)[0]
    assert (best.start, best.stop, best.free_zero) == (start, stop, False)


def test_weights_are_of_what_is_left() -> None:
    volume = np.linspace(0.05, 1.0, 20)
    time = parabola(volume) + np.random.default_rng(2).normal(0.0, 0.01, 20)
    found = choices(time, volume, known_zero=True)
    weights = [choice.weight for choice in found]
    assert max(weights) == pytest.approx(1.0) and min(weights) >= LEAST_WEIGHT
    assert {choice.free_zero for choice in found} == {True, False}
    assert {choice.free_zero for choice in choices(time, volume, known_zero=False)} == {True}


def test_readings_of_one_volume_at_the_end_pass() -> None:
    volume = np.concatenate([np.linspace(0.1, 1.0, 10), np.full(6, 1.0)])
    time = np.concatenate([parabola(volume[:10]), 1.5 + np.arange(1.0, 7.0)])
    best = choices(time, volume, known_zero=True)[0]
    assert (best.start, best.stop) == (0, 10)


def test_a_straight_line_is_no_filtration() -> None:
    volume = np.linspace(0.05, 1.0, 20)
    time = parabola(volume)
    time[8:] = time[7] + 2.1 * (volume[8:] - volume[7])
    assert all(choice.stop <= 9 for choice in choices(time, volume, known_zero=True)[:1])
