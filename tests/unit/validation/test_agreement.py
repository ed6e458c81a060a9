"""Ensembles of beds held against each other, on made-up numbers."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from filtercake.statistics import half_width
from filtercake.study.config.sweep import SWEPT
from filtercake.validation.agreement import compare_sizes

BASE = dict(zip(SWEPT, (50.0, 0.0, 0.2, 0.3, 5.0), strict=True))


def beds(values: list[float], particles: int, csd: str = "alum", status: str = "ok", **changes: float) -> pd.DataFrame:
    rows = [
        {
            "csd": csd,
            **BASE,
            **changes,
            "status": status,
            "particles": particles,
            "porosity": value,
            "porosity_paper_count": value + 0.002,
        }
        for value in values
    ]
    return pd.DataFrame(rows)


VALUES = [0.289, 0.290, 0.291, 0.290]


@pytest.mark.parametrize(("large", "within"), [(0.2901, True), (0.2960, False), (0.2840, False)])
def test_a_large_bed_is_held_against_the_interval_of_the_small_ones(large: float, within: bool) -> None:
    noise = [
        beds([0.5], 25_000, csd="other"),
        beds([0.5], 25_000, friction=0.3),
        beds([0.5], 25_000, status="failed"),
    ]
    table = compare_sizes(pd.concat([beds(VALUES, 25_000), *noise]), beds([large], 100_000)).set_index("estimator")
    assert table.index.tolist() == ["porosity", "porosity_paper_count"]
    for shift, (_, row) in zip((0.0, 0.002), table.iterrows(), strict=True):
        assert (row["n_small"], row["n_large"]) == (4, 1)
        assert (row["particles_small"], row["particles_large"]) == (25_000, 100_000)
        assert row["mean_small"] == pytest.approx(0.290 + shift)
        assert row["ci95_small"] == pytest.approx(half_width(np.array(VALUES)))
        assert row["difference"] == pytest.approx(large - 0.290)
        assert row["within"] == within


def test_without_an_interval_nothing_is_within() -> None:
    assert not compare_sizes(beds([0.29], 25_000), beds([0.29], 100_000))["within"].any()
