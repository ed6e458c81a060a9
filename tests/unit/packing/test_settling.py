"""The stop rule on made-up trajectories."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.packing.settling import (
    CALM_CHECKS,
    CHECKS_PER_FALL,
    TYPICAL_SOLIDS,
    StopRule,
    Trajectory,
    stopped_falling,
)

RULE = StopRule(check_steps=100, max_checks=160, height_tolerance=1e-3, energy_fraction=1e-3, calm_checks=2)


def trajectory(height: list[float], energy: list[float]) -> Trajectory:
    n = len(height)
    return Trajectory(np.arange(n) * 1e-5, np.array(height, float), np.array(energy, float), np.full(n, 0.4))


def test_a_bed_at_rest_is_settled_at_the_second_calm_check() -> None:
    record = trajectory([10, 6, 3, 3, 3, 3], [1, 5, 8, 1e-3, 1e-3, 1e-3])
    assert RULE.settled_at(record) == 4  # calm at 3 and 4


def test_a_bed_that_still_falls_is_not() -> None:
    heights = [10 * 0.995**k for k in range(200)]
    assert RULE.settled_at(trajectory(heights, [1.0] + [1e-6] * 199)) is None


def test_a_bed_that_rises_is_not_at_rest_either() -> None:
    heights = [10 * 1.005**k for k in range(200)]
    assert RULE.settled_at(trajectory(heights, [1.0, 1.0] + [1e-6] * 198)) is None


def test_a_bed_that_still_moves_is_not_at_rest_though_its_height_stays() -> None:
    assert RULE.settled_at(trajectory([3.0] * 200, [1.0] * 200)) is None
    just_over = [1.0, 1.0] + [1.0001e-3] * 100
    just_under = [1.0, 1.0] + [0.9999e-3] * 100
    assert RULE.settled_at(trajectory([3.0] * 102, just_over)) is None
    assert RULE.settled_at(trajectory([3.0] * 102, just_under)) == 3


def test_one_calm_check_interrupted_does_not_count() -> None:
    #                       0  1  2     3  4     5  6     7
    record = trajectory([3] * 8, [9, 9, 1e-6, 9, 1e-6, 9, 1e-6, 9])
    assert RULE.settled_at(record) is None
    followed = trajectory([3] * 10, [9, 9, 1e-6, 9, 1e-6, 9, 1e-6, 9, 1e-6, 1e-6])
    assert RULE.settled_at(followed) == 9


def test_the_first_entry_is_no_check() -> None:
    # the state before the first step says nothing about rest, however still it is
    assert RULE.settled_at(trajectory([3], [0.0])) is None
    assert RULE.settled_at(trajectory([], [])) is None
    assert RULE.settled_at(trajectory([3, 3], [1.0, 1e-6])) is None


def test_the_peak_is_the_peak_so_far() -> None:
    # a bed that starts slowly: 1e-6 is calm against 1e-2 only once the fall has reached it
    record = trajectory([3] * 6, [1e-6, 1e-6, 1e-6, 1e-2, 1e-6, 1e-6])
    assert RULE.settled_at(record) == 5


def test_a_bed_that_never_moves_at_all_is_not_settled() -> None:
    assert RULE.settled_at(trajectory([3] * 20, [0.0] * 20)) is None


def test_values_that_are_no_numbers_are_never_rest() -> None:
    nan = math.nan
    assert RULE.settled_at(trajectory([3, 3, nan, nan, nan], [1, 1, 1e-9, 1e-9, 1e-9])) is None
    assert RULE.settled_at(trajectory([3] * 5, [1, 1, nan, nan, nan])) is None


@given(
    st.lists(st.tuples(st.floats(1.0, 2.0), st.floats(1e-9, 1.0)), min_size=2, max_size=40), st.floats(0.001, 1000.0)
)
def test_the_rule_has_no_unit(record: list[tuple[float, float]], k: float) -> None:
    # scale by powers of two: exact in floating point, so that no comparison can flip
    k = 2.0 ** round(math.log2(k))
    heights, energies = [h for h, _ in record], [e for _, e in record]
    scaled = trajectory([k * h for h in heights], [k**3 * e for e in energies])
    assert RULE.settled_at(scaled) == RULE.settled_at(trajectory(heights, energies))


@given(st.lists(st.tuples(st.floats(1.0, 1.002), st.floats(1e-9, 1.0)), min_size=2, max_size=40))
def test_what_comes_after_rest_does_not_matter(record: list[tuple[float, float]]) -> None:
    heights, energies = [h for h, _ in record], [e for _, e in record]
    index = RULE.settled_at(trajectory(heights, energies))
    if index is not None:
        shorter = trajectory(heights[: index + 1], energies[: index + 1])
        assert RULE.settled_at(shorter) == index
        assert RULE.settled_at(trajectory(heights[:index], energies[:index])) is None


# --- scaling to a box ----------------------------------------------------------------------------------------------


def test_the_rule_for_a_bed_by_hand(make_scene) -> None:
    scene = make_scene(settling_velocity=0.01, time_step=0.3e-6, max_fall_times=4.0, porosity_tolerance=1e-4)
    rule = StopRule.for_bed(scene, 282e-6)
    # from 2 L = 564 um at -0.01 m/s: (sqrt(1e-4 + 2*9.81*564e-6) - 0.01)/9.81 = 9.75 ms
    fall = (math.sqrt(1e-4 + 2 * 9.81 * 564e-6) - 0.01) / 9.81
    assert fall == pytest.approx(9.75e-3, rel=1e-3)
    assert rule.check_steps == round(fall / 40 / 0.3e-6)
    assert rule.max_checks == 160
    assert rule.height_tolerance == pytest.approx(1e-4 / TYPICAL_SOLIDS)
    assert rule.calm_checks == CALM_CHECKS


@pytest.mark.parametrize("velocity", [0.0, 0.01])
def test_the_free_fall_time_solves_the_fall(make_scene, velocity: float) -> None:
    t = make_scene(settling_velocity=velocity).free_fall_time(1e-3)
    assert velocity * t + 0.5 * 9.81 * t**2 == pytest.approx(1e-3, rel=1e-12)


def test_a_larger_box_gets_more_steps_between_checks_not_more_checks(make_scene) -> None:
    scene = make_scene(settling_velocity=0.0)
    small, large = StopRule.for_bed(scene, 200e-6), StopRule.for_bed(scene, 800e-6)
    # free fall from rest: time goes as sqrt(height)
    assert large.check_steps == pytest.approx(2 * small.check_steps, abs=1)
    assert large.max_checks == small.max_checks == CHECKS_PER_FALL * 4
    assert large.height_tolerance == small.height_tolerance


def test_the_checks_cover_the_time_asked_for(make_scene) -> None:
    scene = make_scene(max_fall_times=2.5)
    rule = StopRule.for_bed(scene, 300e-6)
    covered = rule.check_steps * rule.max_checks * scene.time_step
    assert covered == pytest.approx(2.5 * scene.free_fall_time(600e-6), rel=0.5 / rule.check_steps + 0.01)


def test_a_step_longer_than_a_check_still_runs(make_scene) -> None:
    assert StopRule.for_bed(make_scene(time_step=1.0), 300e-6).check_steps == 1


# --- runs of fixed length ------------------------------------------------------------------------------------------


def test_stopped_falling_looks_at_the_last_tenth_only() -> None:
    heights = np.concatenate([np.linspace(10, 3, 90), np.full(10, 3.0)])
    record = trajectory(heights.tolist(), [0.0] * 100)
    assert stopped_falling(record, 1e-6)
    assert not stopped_falling(record, 1e-6, last_share=0.2)


def test_stopped_falling_turns_height_into_porosity() -> None:
    # a fall of 1 % in mean height is 0.65 % in porosity
    record = trajectory([3.03] * 95 + [3.03, 3.02, 3.01, 3.005, 3.0], [0.0] * 100)
    assert not stopped_falling(record, 0.0064)
    assert stopped_falling(record, 0.0066)


def test_a_bed_still_falling_at_a_constant_rate_has_not_stopped() -> None:
    assert not stopped_falling(trajectory(np.linspace(10, 3, 100).tolist(), [0.0] * 100), 1e-3)


def test_a_bed_that_swings_without_falling_is_at_rest() -> None:
    swing = [3.0 * (1.0 + 0.004 * math.sin(2 * math.pi * k / 4.4)) for k in range(60)]
    energy = [1.0, 1.0] + [1e-4] * 58
    assert max(abs(np.diff(swing))) / 3.0 > 5 * RULE.height_tolerance  # from check to check it does not look calm
    settled = RULE.settled_at(trajectory(swing, energy))
    assert settled is not None
    assert settled < 20
    falling = [height * 0.99**k for k, height in enumerate(swing)]
    assert RULE.settled_at(trajectory(falling, energy)) is None
