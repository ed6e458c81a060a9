"""Synthetic filtration tests with every fault: intervals hold the truth, and no large error is silent."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from filtercake.validation import leaf_tests
from filtercake.validation.leaf_tests import COLUMNS, KINDS, RESISTANCE, analyse_all, summarise, write_readings

SEEDS = range(12)


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    return analyse_all(SEEDS)


def test_intervals_hold_the_truth(table: pd.DataFrame) -> None:
    assert tuple(table.columns) == COLUMNS and len(table) == len(KINDS) * len(SEEDS)
    good = table[table["answered"]]
    assert len(good) >= 0.95 * len(table)
    assert good["covered"].mean() >= 0.9
    assert (good.groupby("kind")["covered"].mean() >= 0.7).all()


def test_no_large_error_is_silent(table: pd.DataFrame) -> None:
    assert not table["silent"].any()
    assert (table["relative_error"].abs() > leaf_tests.LARGE).any()  # there are large ones, and they are said


def test_intervals_are_of_use(table: pd.DataFrame) -> None:
    summary = summarise(table).set_index("kind")
    assert summary.loc["undisturbed", "median_relative_ci95"] < 0.15
    assert summary.loc["all", "median_relative_error"] < 0.06
    assert summary.loc["all", "tests"] == len(table)


def test_summary_counts() -> None:
    rows = [
        ("a", 0, True, 1.1 * RESISTANCE, 0.2 * RESISTANCE, 0.1, True, False),
        ("a", 1, True, 1.3 * RESISTANCE, 0.13 * RESISTANCE, 0.3, False, True),
        ("a", 2, False, np.nan, np.nan, np.nan, False, False),
    ]
    line = summarise(pd.DataFrame(rows, columns=list(COLUMNS))).iloc[0]
    assert (line["tests"], line["refused"], line["covered"], line["silent"]) == (3, 1, 0.5, 1)
    assert line["median_relative_error"] == pytest.approx(0.2)


@pytest.mark.parametrize("kind", KINDS)
def test_files_differ_by_seed_and_say_the_same_again(kind: str) -> None:
    assert write_readings(kind, 1) == write_readings(kind, 1) != write_readings(kind, 3)
