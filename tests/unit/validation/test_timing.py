"""The benchmarks' tables, on made-up timings and tiny beds."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from filtercake.crystals.csd import mixture
from filtercake.packing.scene import Scene
from filtercake.validation import growth
from filtercake.validation.agreement import compare_engines
from filtercake.validation.growth import Case, even_distribution, time_growth
from filtercake.validation.timing import compare, contender, time_in_turn, warm_up

SCENE = Scene(
    csd=mixture([20e-6, 30e-6], [0.5, 0.5]),
    particles=150,
    initial_void_fraction=0.6,
    settling_velocity=0.01,
    density=1180.0,
    youngs_modulus=5e6,
    poisson_ratio=0.2,
    restitution=0.3,
    friction=0.0,
    cohesion=50e3,
    time_step=0.25e-6,
    engine="embedded",
)


def test_beds_are_timed_and_measured() -> None:
    lines: list[str] = []
    table = time_in_turn([contender("embedded", SCENE)], 2, lines.append)
    assert list(table["replicate"]) == [0, 1]
    assert (table["wall_s"] > 0).all()
    assert (table["status"] == "ok").all()
    assert table["porosity"].between(0.25, 0.5).all()
    assert len(lines) == 2


@pytest.mark.parametrize("initial_void_fraction", [0.5, 0.65])
def test_the_warm_up_finds_room_whatever_the_distribution(initial_void_fraction: float) -> None:
    for csd in (mixture([32e-6, 543e-6], [0.1, 0.9]), mixture([50e-6], [1.0])):
        scene = replace(SCENE, csd=csd, initial_void_fraction=initial_void_fraction, particles=20_000)
        warm_up(contender("embedded", scene))


def test_ratios_and_intervals_of_made_up_timings() -> None:
    rows = [
        {"engine": engine, "replicate": k, "wall_s": wall, "status": status, "porosity": porosity}
        for engine, k, wall, status, porosity in (
            ("slow", 0, 100.0, "ok", 0.350),
            ("fast", 0, 2.0, "ok", 0.351),
            ("slow", 1, 110.0, "ok", 0.352),
            ("fast", 1, 2.5, "not settled", 0.353),
        )
    ]
    rows = [{**row, "particles": 10, "peak_memory_MB": 1} for row in rows]
    slow, fast = compare(pd.DataFrame(rows)).to_dict("records")
    assert (slow["engine"], slow["times_faster"]) == ("slow", 1.0)
    assert fast["times_faster"] == pytest.approx(105.0 / 2.25)
    # of packings made right after each other
    assert (fast["times_faster_low"], fast["times_faster_high"]) == pytest.approx((110.0 / 2.5, 100.0 / 2.0))
    assert fast["n_not_accepted"] == 1
    assert fast["difference"] == pytest.approx(0.001)
    # equal spreads of two each: Welch's two degrees of freedom, t = 4.3027, standard errors of 0.0014142 / sqrt(2)
    assert fast["difference_ci95"] == pytest.approx(np.hypot(1, 1) * 4.3027 * 0.001, rel=1e-4)
    assert bool(fast["same_porosity"])


def ensemble(engine: str, values: list[float], friction: float = 0.0) -> list[dict[str, object]]:
    case = {"csd": "a", "cohesion_kJ_m3": 50.0, "friction": friction, "poisson_ratio": 0.2, "restitution": 0.3}
    return [
        {**case, "youngs_modulus_MPa": 5.0, "engine": engine, "status": "ok", "porosity": value, "particles": 100}
        for value in values
    ]


def test_ensembles_agree_differ_or_say_nothing() -> None:
    spread = np.array([-0.001, 0.0, 0.001] * 12)
    table = compare_engines(
        pd.DataFrame(
            ensemble("one", list(0.350 + spread))
            + ensemble("two", list(0.3502 + spread))
            + ensemble("one", list(0.350 + spread), friction=0.1)
            + ensemble("two", list(0.351 + spread), friction=0.1)
            + ensemble("one", list(0.350 + 9 * spread), friction=0.2)
            + ensemble("two", list(0.350 + 9 * spread), friction=0.2)
            + ensemble("one", list(0.350 + spread), friction=0.3)
            + ensemble("two", list(0.3506 + spread), friction=0.3)
            + ensemble("one", [0.350], friction=0.4)
            + ensemble("two", [0.350], friction=0.4)
        ),
        "one",
        "two",
    )
    # standard error of each: sqrt(24/35) 0.001 / 6
    assert table["difference_se"].iloc[0] == pytest.approx(np.sqrt(2 * 24 / 35) * 0.001 / 6)
    # of 35 degrees of freedom each, twice: t(70) = 1.9944; 0.0006 are three standard errors
    assert table["difference_ci95"].iloc[0] == pytest.approx(1.9944 * table["difference_se"].iloc[0], rel=1e-4)
    assert list(table["sharp"]) == [True, True, False, True, False]
    assert list(table["agree"]) == [True, False, False, False, False]
    assert list(table["n_one"]) == [36, 36, 36, 36, 1]
    assert np.isnan(table["difference_ci95"].iloc[-1])


def test_growth_is_timed_per_sphere_and_step() -> None:
    table = time_growth(
        replace(SCENE, initial_void_fraction=0.65), [Case("particles", 150, 4.0), Case("size_ratio", 200, 2.0)]
    )
    expected = 1e9 * table["wall_s"] / table["steps"] / table["particles"]
    assert table["ns_per_particle_step"].to_numpy() == pytest.approx(expected.to_numpy())
    assert list(table["series"]) == ["particles", "size_ratio"]


def test_a_case_is_held_against_the_first_one_before_and_after(monkeypatch: pytest.MonkeyPatch) -> None:
    paces = iter([10.0, 11.0, 20.0, 50.0, 30.0])  # before, first case, after, second case, after
    state = SimpleNamespace(steps=100, wall_time=1.0)
    monkeypatch.setattr(growth, "_time", lambda *_: (state, next(paces)))
    table = time_growth(SCENE, [Case("particles", 150, 4.0), Case("particles", 300, 4.0)])
    assert list(table["ns_per_particle_step"]) == [11.0, 50.0]
    assert list(table["reference_ns"]) == [15.0, 25.0]


@pytest.mark.parametrize("ratio", [2.0, 30.0])
def test_the_even_distribution_has_the_ratio_asked_for(ratio: float) -> None:
    csd = even_distribution(ratio)
    assert csd.largest / csd.smallest == pytest.approx(ratio)
    assert csd.volume_fraction == pytest.approx(np.full(10, 0.1))
