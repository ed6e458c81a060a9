"""What is known of the porosity: the estimate's error as a process, updated by packings."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.design.belief import Belief, LevelEstimate, Packed, correlation

TIMES = [300.0, 600.0, 1200.0, 2400.0]


def prior(deviation: float = 0.004, scatter: float = 0.002, pressures: int = 1, slope: float = 0.01) -> Belief:
    estimates = [
        LevelEstimate(
            np.full(pressures, 0.35) + slope * math.log(time / 600.0) - 0.01 * np.arange(pressures),
            np.full(pressures, deviation),
            np.full(pressures, scatter),
        )
        for time in TIMES
    ]
    return Belief.prior(TIMES, estimates, 4)


def test_the_correlation_is_what_the_module_says() -> None:
    factors = np.array([1.0, 1.26, 2.0, 4.0])
    assert correlation(np.log(factors)).round(2).tolist() == [1.0, 0.92, 0.52, 0.14]


def test_the_estimate_passes_between_its_levels() -> None:
    belief = prior()
    assert belief.levels == (0, 4, 8, 12)
    assert np.exp(belief.position[[0, 4, 8, 12]]) == pytest.approx(TIMES)
    assert belief.mean[:, 0] == pytest.approx(0.35 + 0.01 * (belief.position - math.log(600.0)), abs=1e-12)
    assert belief.deviation[:, 0] == pytest.approx(0.004, rel=1e-6)


def test_a_step_of_the_estimate_is_smoothed_and_widens_it() -> None:
    times = list(np.geomspace(300.0, 3600.0, 9))
    step = [0.35 + 0.0005 * (k % 2) for k in range(9)]
    estimates = [LevelEstimate(np.array([p]), np.array([1e-4]), np.array([0.002])) for p in step]
    belief = Belief.prior(times, estimates, 2)
    assert np.ptp(belief.mean) < 0.0005
    assert belief.deviation[:, 0] == pytest.approx(math.hypot(1e-4, 0.00025), rel=0.1)


def test_packings_update_as_the_textbook_says() -> None:
    belief, values = prior(), np.array([[0.356], [0.358], [0.357], [0.357]])
    after = belief.after([Packed(1, values)])
    expected = 0.002**2
    seen = float(np.sum((values - values.mean()) ** 2)) / expected
    noise = expected * (4.0 + seen) / (4.0 + 3.0) / 4.0
    gain = 0.004**2 / (0.004**2 + noise)
    assert after.mean[4, 0] == pytest.approx(0.35 + gain * 0.007)
    assert after.deviation[4, 0] == pytest.approx(0.004 * math.sqrt(1.0 - gain))
    # two levels on, a factor of 4 in the residence time, 0.14 of the error is shared
    assert after.mean[12, 0] == pytest.approx(belief.mean[12, 0] + correlation(np.log(4.0)) * gain * 0.007)


@given(
    st.lists(st.integers(0, 3), min_size=1, max_size=4, unique=True),
    st.integers(1, 6),
    st.floats(1e-4, 0.02),
    st.floats(-0.03, 0.03),
)
def test_packings_never_widen_what_is_known(levels: list[int], count: int, deviation: float, shift: float) -> None:
    belief = prior(deviation, pressures=2)
    spread = np.linspace(-0.001, 0.001, count)[:, None]
    after = belief.after([Packed(level, 0.35 + shift + spread + np.zeros((count, 2))) for level in levels])
    assert (after.deviation <= belief.deviation * (1.0 + 1e-9)).all()
    assert np.isfinite(after.mean).all()


def test_nothing_packed_changes_nothing() -> None:
    belief = prior()
    assert belief.after([]) is belief
    assert belief.after([Packed(0, np.empty((0, 1)))]) is belief


def test_drawn_curves_have_the_spread_and_the_correlation() -> None:
    belief = prior(pressures=3)
    curves = belief.draws(20000, 1)
    assert curves.std(axis=0) == pytest.approx(1.0, abs=0.03)
    measured = np.corrcoef(curves[:, 0], curves[:, 4])[0, 1]
    assert measured == pytest.approx(float(correlation(np.log(2.0))), abs=0.02)
    assert (belief.draws(10, 1) == curves[:10]).all()


def test_no_interval_reaches_what_no_cake_can_be() -> None:
    wide = prior(0.2)
    assert wide.at(0, -3.0)[0] == 0.02 and wide.at(0, 3.0)[0] == 0.9
    assert wide.at(4)[0] == pytest.approx(0.35)
