"""Coverage of intervals asked for: both rules see the same packings, and what is broken is found."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from filtercake.packing.spread import known_spread
from filtercake.validation import interval_coverage
from filtercake.validation.error_against_time import Reference
from filtercake.validation.interval_coverage import ALONE, COLUMNS, KNOWN, Asked, coverage, summary, unlike
from filtercake.validation.pressure import bed
from filtercake.validation.timing import Contender

SCENE = bed({"mixture": {20.0: 0.5, 50.0: 0.5}}, particles=2000)
SPREAD = known_spread(SCENE).sd
REPEATS = 60


def asked(true: float = 0.35, standard_error: float = 0.0) -> Asked:
    return Asked("pmma", SCENE, Reference(true, standard_error), (SPREAD,))


@pytest.fixture
def packed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Packings of a known mean and spread; every tenth is not accepted."""

    def settle_timed(made: Contender, replicate: int) -> dict[str, Any]:
        value = np.random.default_rng([made.scene.seed, replicate]).normal(0.35, SPREAD)
        return {"status": "no" if replicate % 10 == 9 else "ok", "porosity": value, "wall_s": 2.0}

    monkeypatch.setattr(interval_coverage, "settle_timed", settle_timed)


def test_intervals_hold_the_truth_and_take_fewer_packings(packed: None) -> None:
    table = coverage(asked(), REPEATS)
    assert list(table.columns) == list(COLUMNS)
    assert table["reached"].all()
    known, alone = (summary(table).set_index("rule").loc[rule] for rule in (KNOWN, ALONE))
    assert known["met"] >= 53  # 57 expected, less twice the standard deviation
    assert known["mean"] < 0.75 * alone["mean"]
    assert abs(known["porosity"] - 0.35) <= 1.5 * known["porosity_ci95"]
    assert known["seconds"] == pytest.approx(2.0 * known["mean"], rel=0.05)


def test_a_wrong_porosity_is_found_out(packed: None) -> None:
    table = coverage(asked(0.35 + 2.0 * SPREAD), REPEATS)
    assert summary(table)["met"].max() < 10
    unsure = coverage(asked(0.35 + 2.0 * SPREAD, standard_error=2.0 * SPREAD), REPEATS)
    assert summary(unsure)["met"].min() > 50


def test_what_is_not_accepted_does_not_count(packed: None) -> None:
    table = coverage(asked(), REPEATS)
    long = table[table["n"] >= 10]
    assert (long["seconds"] > 2.0 * long["n"]).all()


def test_a_wider_interval_takes_fewer_of_the_same_packings(packed: None) -> None:
    both = coverage(replace(asked(), intervals=(SPREAD, 1.5 * SPREAD)), 20)
    alone = coverage(asked(), 20)
    pd.testing.assert_frame_equal(both[both["asked"] == SPREAD].reset_index(drop=True), alone)
    wide = summary(both[both["asked"] > SPREAD]).set_index("rule")["mean"]
    assert wide[KNOWN] <= 0.5 * wide[ALONE]


def test_without_an_end_the_last_packing_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def far_apart(_: Contender, replicate: int) -> dict[str, Any]:
        return {"status": "ok", "porosity": float(replicate % 2), "wall_s": 1.0}

    monkeypatch.setattr(interval_coverage, "settle_timed", far_apart)
    table = coverage(asked(), 1)
    assert list(table["n"]) == [64, 64]
    assert not table["reached"].any()


def test_a_scene_that_scatters_as_its_kind_is_covered() -> None:
    table = unlike(500).set_index("ratio")
    assert table.loc[1.0, "covered"] == pytest.approx(0.95, abs=0.03)
    assert table.loc[0.8, "covered"] > 0.95
    assert (table["n"] < table["n_alone"]).all()
    assert table.loc[2.0, "n"] > 2.0 * table.loc[1.0, "n"]


def test_the_summary_counts() -> None:
    rows = pd.DataFrame(
        {
            "case": "pmma",
            "asked": 0.002,
            "rule": KNOWN,
            "n": [5, 6, 7],
            "porosity": [0.35, 0.36, 0.37],
            "covered": [True, True, False],
            "reached": [True, False, True],
            "seconds": [1.0, 2.0, 3.0],
        }
    )
    found = summary(rows).iloc[0]
    assert (found["repeats"], found["met"], found["least"], found["most"], found["mean"]) == (3, 1, 5, 7, 6.0)
