"""Ensembles of beds held against each other, on made-up numbers."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from filtercake.statistics import half_width
from filtercake.study.config.sweep import OF_BEDS
from filtercake.validation.agreement import compare_engines, compare_sizes

BASE = dict(zip(OF_BEDS, (50.0, 0.0, 0.2, 0.3, 5.0), strict=True))


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


@pytest.mark.parametrize(
    ("half_widths", "agree"), [(0.0, True), (0.95, True), (-0.95, True), (1.05, False), (-1.05, False), (2.0, False)]
)
def test_engines_agree_within_the_interval_of_their_difference_alone(half_widths: float, agree: bool) -> None:
    values = np.array([0.3500, 0.3510, 0.3520, 0.3510, 0.3505, 0.3515])
    # of two samples of one spread, Welch's interval is Student's by 2 (n - 1) degrees of freedom
    half = 2.228139 * float(np.std(values, ddof=1)) * (2.0 / values.size) ** 0.5
    ours = beds(list(values + half_widths * half), 2000).assign(engine="embedded")
    theirs = beds(list(values), 2000).assign(engine="liggghts")
    table = compare_engines(pd.concat([theirs, ours]), "liggghts", "embedded")
    (row,) = table.to_dict("records")
    assert row["sharp"]
    assert row["difference_ci95"] == pytest.approx(half, rel=1e-6)
    assert bool(row["agree"]) == agree


def test_ensembles_too_wide_to_tell_do_not_agree() -> None:
    wide = [0.34, 0.35, 0.36]
    both = pd.concat([beds(wide, 2000).assign(engine=engine) for engine in ("liggghts", "embedded")])
    (row,) = compare_engines(both, "liggghts", "embedded").to_dict("records")
    assert row["difference"] == 0.0
    assert not row["sharp"]
    assert not row["agree"]
