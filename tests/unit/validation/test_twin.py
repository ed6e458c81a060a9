"""The twin experiment on packings made up by a law."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from filtercake.validation.twin import Experiment, repeat_calibrations, repeat_pressed, summarise

VALUES = (0.0, 20.0, 30.0, 40.0, 50.0, 60.0, 80.0, 100.0)
OFFSETS = {"fine": 0.2, "coarse": -0.4}


def packings(
    seed: int, cohesions: tuple[float, ...], replicates: int, shift: float = 0.0, offsets: dict[str, float] = OFFSETS
) -> pd.DataFrame:
    random = np.random.default_rng(seed)
    rows = [
        {
            "csd": csd,
            "cohesion_kJ_m3": s,
            "friction": 0.0,
            "replicate": k,
            "status": "ok",
            "resistance_m_kg": math.exp(
                22.0 + offset + shift - 0.7 / (1.0 + math.exp((55.0 - s) / 14.0)) + 0.025 * random.standard_normal()
            ),
        }
        for csd, offset in offsets.items()
        for s in cohesions
        for k in range(replicates)
    ]
    return pd.DataFrame(rows)


def test_known_cohesion_is_found_as_often_as_the_interval_says() -> None:
    table = repeat_calibrations(
        packings(1, VALUES, 80), packings(2, (35.0,), 40), repeats=20, asked=Experiment(4, 0.05)
    )
    (row,) = summarise(table).to_dict("records")
    assert row["repeats"] == 20 and row["truth_kJ_m3"] == 35.0
    assert row["covered"] >= 17 and row["median_relative_error"] < 0.10
    assert table["value_kJ_m3"].nunique() == 20  # every repeat has packings and measurements of its own


def test_every_repeat_has_packings_of_its_own() -> None:
    """Every second replicate is of a harder cake: the second of two repeats gets those, and finds another cohesion."""
    pool = packings(1, VALUES, 8)
    pool.loc[pool["replicate"] % 2 == 1, "resistance_m_kg"] *= 1.2
    table = repeat_calibrations(pool, packings(2, (45.0,), 40), repeats=2, asked=Experiment(4, 0.001))
    first, second = table["value_kJ_m3"]
    assert abs(first - 45.0) < 5.0 and second > first + 5.0


def test_a_wrong_model_is_found_out() -> None:
    """Measured cakes all 15 % harder than the packings, which a cohesion makes up for: the intervals miss."""
    three = {**OFFSETS, "middle": 0.0}
    hard = packings(2, (55.0,), 40, shift=0.15, offsets=three)
    table = repeat_calibrations(packings(1, VALUES, 40, offsets=three), hard, 10, Experiment(4, 0.02))
    assert summarise(table)["covered"].iloc[0] <= 3


@pytest.mark.parametrize("count", [2, 3])
def test_a_discrepancy_of_20_percent_is_covered(count: int) -> None:
    three = {**OFFSETS, "middle": 0.0}
    pool, real = packings(1, VALUES, 4, offsets=three), packings(2, (35.0,), 20, offsets=three)
    table = repeat_calibrations(pool, real, repeats=20, asked=Experiment(4, 0.05, count, 0.2, shares=2))
    assert table["covered"].sum() >= 18
    assert (table["distributions"] == count).all() and (table["discrepancy"] == 0.2).all()
    width = table["high_kJ_m3"] - table["low_kJ_m3"]
    # two distributions leave nothing but the range; three do better
    assert (width.median() < 80.0) == (count == 3)
    (row,) = summarise(table).to_dict("records")
    assert row["median_relative_half_width"] == pytest.approx(0.5 * width.median() / 35.0)


def test_packings_are_dealt_out_again() -> None:
    pool = packings(1, VALUES, 4)
    pool.loc[pool["replicate"] % 2 == 1, "resistance_m_kg"] *= 1.2
    table = repeat_calibrations(pool, packings(2, (45.0,), 40), repeats=4, asked=Experiment(4, 0.001, shares=2))
    first, second, third, fourth = table["value_kJ_m3"]
    assert first == pytest.approx(third, abs=1.0) and second == pytest.approx(fourth, abs=1.0)
    assert second > first + 5.0


def test_shares_must_suffice_and_conditions_agree() -> None:
    with pytest.raises(ValueError, match="at least 2 are needed"):
        repeat_calibrations(packings(1, VALUES, 20), packings(2, (35.0,), 4), 20, Experiment(1, 0.05))
    with pytest.raises(ValueError, match="cohesion_kJ_m3 must have one value"):
        repeat_calibrations(
            packings(1, VALUES, 40), packings(2, (35.0, 40.0), 4), repeats=20, asked=Experiment(1, 0.05)
        )
    other = packings(2, (35.0,), 4).assign(friction=0.05)
    with pytest.raises(ValueError, match="different frictions"):
        repeat_calibrations(packings(1, VALUES, 40), other, 20, Experiment(1, 0.05))


def cakes(
    seed: int, frictions: tuple[float, ...], replicates: int, drops: tuple[float, ...] = (20.0, 200.0)
) -> pd.DataFrame:
    """Pressed packings by a law; what a packing errs by is nearly the same at every pressure."""
    random = np.random.default_rng(seed)
    rows = []
    for mu in frictions:
        for k in range(replicates):
            own = 0.03 * random.standard_normal()
            for drop in drops:
                value = 22.0 - mu / (mu + 0.2) + 0.02 * math.log(drop) + own + 0.005 * random.standard_normal()
                rows.append(("a", mu, 10.0, drop, k, "ok", math.exp(value)))
    names = ["csd", "friction", "adhesion_mJ_m2", "pressure_kPa", "replicate", "status", "resistance_m_kg"]
    return pd.DataFrame(rows, columns=names)


FRICTIONS = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5)


def test_friction_of_pressed_cakes_is_found_as_often_as_the_interval_says() -> None:
    table = repeat_pressed(cakes(1, FRICTIONS, 80), cakes(2, (0.15,), 60), 40, Experiment(tests=4, noise=0.05))
    assert set(table["pressures"]) == {2} and len(table) == 40
    assert 34 <= table["covered"].sum() <= 40
    assert table["error"].median() < 0.03
    # the packings' shared error is in the interval: by the tests alone it would be narrower than this
    steep = 0.2 / 0.35**2
    assert (0.5 * (table["high"] - table["low"])).median() > 1.96 * 0.05 / math.sqrt(8.0) / steep


def test_pressed_pool_and_truth_stick_alike() -> None:
    with pytest.raises(ValueError, match="pool and truth have different adhesions"):
        repeat_pressed(cakes(1, FRICTIONS, 4).assign(adhesion_mJ_m2=1.0), cakes(2, (0.15,), 4), 2, Experiment(1, 0.05))
    with pytest.raises(ValueError, match="friction must have one value, not 2"):
        repeat_pressed(cakes(1, FRICTIONS, 4), cakes(2, (0.15, 0.2), 4), 2, Experiment(1, 0.05))
