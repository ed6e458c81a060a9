"""The twin experiment on packings made up by a law."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from filtercake.validation.twin import Experiment, repeat_calibrations, summarise

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
