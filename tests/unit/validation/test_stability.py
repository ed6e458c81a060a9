"""The stress tests' own machinery: cases, outcomes, conservation, and what counts as undetected."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from filtercake.packing.cloud import Cloud
from filtercake.packing.result import SettledState
from filtercake.packing.scene import Scene
from filtercake.packing.settling import Trajectory
from filtercake.units import GRAVITY
from filtercake.validation import stability
from filtercake.validation.stability import (
    Case,
    cases,
    distribution,
    energy_gain,
    momentum_drift,
    run,
    scene_of,
    undetected,
)

ENGINES = ("embedded", "liggghts")


def case(x_name: str = "time_step", x: float = 0.0, y_name: str = "friction", y: float = 0.0) -> Case:
    return Case("test", "embedded", x_name, x, y_name, y)


def scene(**numbers: float) -> Scene:
    return scene_of({**stability.BASE, **numbers}, "embedded")


def test_there_are_enough_cases_and_no_two_are_the_same() -> None:
    listed = cases(ENGINES)
    assert len(listed) >= 150
    assert len({(c.family, c.engine, c.x, c.y) for c in listed}) == len(listed)
    assert {c.family for c in listed} == set(stability.families())


def test_without_liggghts_only_the_embedded_engine_is_stressed() -> None:
    assert {c.engine for c in cases(["embedded"])} == {"embedded"}
    assert {c.engine for c in cases(ENGINES)} == {"embedded", "liggghts", "liggghts_si"}


def test_the_stress_reaches_as_far_as_asked() -> None:
    scenes = [c.numbers for c in cases(ENGINES)]
    steps = [numbers["time_step"] for numbers in scenes if numbers["time_step"]]
    assert (min(steps), max(steps)) == (0.02, 2.0)
    for name, low, high in (
        ("cohesion_kJ_m3", 0, 500),
        ("youngs_modulus_MPa", 0.5, 500),
        ("restitution", 0.01, 0.99),
        ("friction", 0, 2),
        ("size_ratio", 1, 50),
        ("drop_height", 1, 10),
    ):
        values = [numbers[name] for numbers in scenes]
        assert (min(values), max(values)) == (low, high), name
    assert max(numbers["density_kg_m3"] for numbers in scenes) == 100 * 1180.0


@pytest.mark.parametrize("ratio", [1.0, 2.5, 5.0, 10.0, 20.0, 50.0])
def test_every_width_has_its_large_spheres(ratio: float) -> None:
    csd, particles, _ = distribution(ratio)
    assert csd.largest / csd.smallest == pytest.approx(ratio)
    counts = csd.class_counts(particles)
    assert counts.sum() == particles
    assert counts.min() >= (1 if ratio == 1.0 else stability.LARGE_SPHERES)


def test_a_higher_drop_is_a_faster_start() -> None:
    low, high = (scene(drop_height=times) for times in (1.0, 10.0))
    cloud_height = (high.settling_velocity**2 - low.settling_velocity**2) / (2.0 * GRAVITY) / 9.0
    assert 4e-4 < cloud_height < 6e-4  # twice the box side of 1000 spheres, 0.22 mm
    assert high.max_fall_times == 10 * low.max_fall_times


def test_outcomes_of_a_safe_a_wild_and_a_refused_case(monkeypatch) -> None:
    monkeypatch.setattr(stability, "PARTICLES", 400)
    table = run([case(), case(x=2.0), case("youngs_modulus_MPa", 0.5, "cohesion_kJ_m3", 100.0)], replicates=2)
    safe, wild, soft = table.to_dict("records")
    assert safe["outcome"] in ("ok", "undecided", "inaccurate")
    assert safe["n_accepted"] == 2
    assert safe["momentum_drift"] < 1e-10
    assert 0.0 <= safe["energy_gain"] < 0.01
    assert wild["outcome"] == "exploded"
    assert wild["n_accepted"] == 0
    assert "shorter time step" in wild["reason"]
    assert soft["outcome"] in ("unsettled", "refused", "exploded")


def test_one_accepted_packing_of_many_is_no_success(monkeypatch) -> None:
    results = iter([stability._Try("ok", porosity=0.35), stability._Try("unsettled", "still moving")] * 3)
    monkeypatch.setattr(stability, "_try", lambda *_: next(results))
    row = stability._judge(case(), {0: 0.35, 1: 0.351}, 4)
    assert row["outcome"] == "unsettled"
    assert (row["n"], row["n_accepted"]) == (4, 2)
    assert row["reason"] == "still moving"


def test_what_never_rests_is_not_tried_for_ever(monkeypatch) -> None:
    monkeypatch.setattr(stability, "_try", lambda *_: stability._Try("unsettled", "still moving"))
    row = stability._judge(case(), {0: 0.35, 1: 0.351}, 10)
    assert (row["n"], row["n_accepted"], row["outcome"]) == (stability.HOPELESS, 0, "unsettled")
    assert stability._reference(scene(), 10) == {}


def test_a_bias_beyond_its_uncertainty_is_inaccurate(monkeypatch) -> None:
    row = judged(monkeypatch, [0.360, 0.3601, 0.3599, 0.360], [0.350, 0.3501, 0.3499])
    assert row["outcome"] == "inaccurate"
    assert row["bias"] == pytest.approx(0.01)


def judged(monkeypatch, porosities: list[float], reference: list[float]) -> dict[str, object]:
    """Judge a case whose packings are all accepted; a reference of nan was not."""
    values = iter(porosities)
    monkeypatch.setattr(stability, "_try", lambda *_: stability._Try("ok", porosity=next(values)))
    known = {k: value for k, value in enumerate(reference) if not math.isnan(value)}
    return stability._judge(case(), known, len(porosities))


def test_packings_are_held_against_the_reference_of_the_same_cloud(monkeypatch) -> None:
    clouds = np.array([0.33, 0.36, 0.35, 0.34])
    row = judged(monkeypatch, list(clouds + np.array([1e-4, 3e-4, 2e-4, 2e-4])), list(clouds))
    assert (row["outcome"], row["bias"]) == ("ok", pytest.approx(2e-4))
    # t(3) = 3.1824; the differences' spread is 8.165e-5
    assert row["bias_ci95"] == pytest.approx(3.1824 * 8.165e-5 / 2.0, rel=1e-3)
    # the second cloud's reference failed: neither takes part
    row = judged(monkeypatch, [0.331, 0.5, 0.351, 0.341], [0.33, math.nan, 0.35, 0.34])
    assert row["bias"] == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("porosities", "reference"),
    [
        ([0.350, 0.354, 0.346], [0.350, 0.350, 0.350]),  # no bias, but +- 0.01
        ([0.351, 0.351], [0.350, math.nan]),  # one pair has no spread
        ([0.351, 0.351], []),
    ],
)
def test_what_cannot_be_told_is_undecided(monkeypatch, porosities: list[float], reference: list[float]) -> None:
    assert judged(monkeypatch, porosities, reference)["outcome"] == "undecided"


@pytest.mark.parametrize(
    ("bias", "half", "expected"),
    [
        (0.0009, 0.001, "ok"),
        (-0.0011, 0.001, "undecided"),
        (0.0029, 0.001, "undecided"),
        (-0.0031, 0.001, "inaccurate"),
        (math.nan, math.nan, "undecided"),
        (0.0, math.nan, "undecided"),
    ],
)
def test_the_verdict_is_the_intervals(bias: float, half: float, expected: str) -> None:
    assert stability.verdict(bias, half) == expected


def state(height: list[float], energy: list[float], velocity: np.ndarray) -> SettledState:
    steps = np.arange(len(height), dtype=float)
    record = Trajectory(steps, np.array(height), np.array(energy), np.zeros(len(height)))
    radius = np.full(len(velocity), 1e-5)
    return SettledState(velocity * 0, velocity, radius, 1e-4, record, 1, len(radius), 0, "embedded", "")


def test_energy_that_appears_is_seen() -> None:
    made = scene()
    cloud = Cloud(np.full((2, 3), 5e-5), np.full(2, 1e-5), 1e-4, 2e-4)
    weight = 2 * made.density * 4 / 3 * np.pi * 1e-15 * GRAVITY
    still = np.zeros((2, 3))
    falling = state([1e-4, 5e-5, 5e-5], [0.0, weight * 5e-5, 0.0], still)
    assert energy_gain(falling, made, cloud) == pytest.approx(0.0, abs=1e-12)
    fed = state([1e-4, 5e-5, 5e-5], [0.0, 0.0, weight * 2e-5], still)
    assert energy_gain(fed, made, cloud) == pytest.approx(0.2)
    assert math.isinf(energy_gain(state([1e-4, math.nan], [0.0, 0.0], still), made, cloud))


def test_sideways_drift_is_that_of_the_centre_of_mass() -> None:
    velocity = np.array([[0.3, 0.4, -9.0], [0.3, 0.4, 9.0]])
    assert momentum_drift(state([1.0, 1.0], [0.0, 0.0], velocity)) == pytest.approx(0.5)
    assert momentum_drift(state([1.0, 1.0], [0.0, 0.0], velocity * [[1], [-1]])) == pytest.approx(0.0)


def test_the_fence_knows_what_liggghts_does_not_take() -> None:
    listed = [c for c in cases(ENGINES) if (c.family, c.x, c.y) == ("restitution_time_step", 0.01, 0.5)]
    table = pd.DataFrame([{"family": c.family, "engine": c.engine, "x": c.x, "y": c.y} for c in listed])
    found = stability.with_fence(table)
    assert dict(zip(found["engine"], found["fence"], strict=True)) == {"embedded": "allowed", "liggghts": "refused"}


def test_undetected_is_wrong_accepted_and_unannounced() -> None:
    rows = [
        (0.010, 0.002, 3, "allowed"),
        (0.010, 0.002, 3, "warned"),
        (0.010, 0.002, 0, "allowed"),
        (0.010, 0.008, 3, "allowed"),
        (-0.010, 0.002, 3, "allowed"),
        (0.010, math.nan, 1, "allowed"),
    ]
    table = pd.DataFrame(rows, columns=["bias", "bias_ci95", "n_accepted", "fence"])
    assert list(undetected(table).index) == [0, 4]
