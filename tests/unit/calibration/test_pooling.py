"""Weighted means of measurements, and the scatter between them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filtercake.calibration.pooling import chi_square, improbable, pool, scatter


def test_measurements_that_agree_are_averaged_by_weight() -> None:
    found = pool([1.0, 1.2, 1.1], [0.1, 0.2, 0.1])
    weights = np.array([100.0, 25.0, 100.0])
    assert found.mean == pytest.approx(np.average([1.0, 1.2, 1.1], weights=weights))
    assert found.variance == pytest.approx(1.0 / 225.0)
    squares = float(np.sum(weights * (np.array([1.0, 1.2, 1.1]) - found.mean) ** 2))
    assert found.chi_square == pytest.approx(squares) == pytest.approx(chi_square([1.0, 1.2, 1.1], [0.1, 0.2, 0.1]))
    assert found.degrees_of_freedom == 2 and found.scatter == 0.0


def test_one_measurement_is_itself() -> None:
    found = pool([3.0], [0.1])
    assert (found.mean, found.chi_square, found.degrees_of_freedom, found.scatter) == (3.0, 0.0, 0, 0.0)
    assert found.variance == pytest.approx(0.01)
    # whatever the round-off of its mean
    assert all(scatter([value], [0.1]) == 0.0 for value in np.random.default_rng(0).normal(22.0, 1.0, 100))


def test_scatter_of_equal_errors_is_in_closed_form() -> None:
    values = np.array([0.0, 0.5, 0.2, -0.4])
    own = np.std(values, ddof=1)
    assert scatter(values, np.full(4, 0.1)) == pytest.approx(math.sqrt(own**2 - 0.01))
    assert scatter(values, np.full(4, 1.01 * own)) == 0.0
    found = pool(values, np.full(4, 0.1))
    assert found.scatter == scatter(values, np.full(4, 0.1))
    assert found.variance == pytest.approx(own**2 / 4.0)


def test_scatter_makes_the_squares_what_they_should_be() -> None:
    random = np.random.default_rng(0)
    errors = random.uniform(0.01, 0.3, 20)
    values = 0.5 * random.standard_normal(20)
    added = scatter(values, errors)
    assert chi_square(values, np.hypot(errors, added)) == pytest.approx(19.0)
    assert 0.3 < added < 0.7


def test_a_vague_measurement_far_away_is_no_scatter() -> None:
    assert scatter([0.0, 0.01, 1.0], [0.02, 0.02, 1.0]) == 0.0


def test_what_chance_explains_is_left_alone() -> None:
    assert not improbable(3.84, 1) and improbable(3.85, 1) and not improbable(100.0, 0)
    # more than expected, but not improbable: no scatter is added
    found = pool([0.0, 0.25], [0.1, 0.1])
    assert found.chi_square > 3.0 and found.scatter == 0.0 and scatter([0.0, 0.25], [0.1, 0.1]) > 0.0
