"""Intervals against tabulated quantiles, against scipy.stats, and against how often they cover."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from filtercake.statistics import (
    Spread,
    difference_half_width,
    effective_freedom,
    half_width,
    informed_half_width,
    informed_spread,
    likelihood_limit,
    paired_half_width,
    pooled_spread,
    quantile,
    standard_error,
)

REPOSITORY = Path(__file__).resolve().parents[2]
ONE = np.array([0.350, 0.354, 0.349])
OTHER = np.array([0.361, 0.340, 0.352, 0.333, 0.347])


@pytest.mark.parametrize(
    ("freedom", "expected"), [(1, 12.7062), (2, 4.3027), (8, 2.3060), (30, 2.0423), (math.inf, 1.95996)]
)
def test_quantiles_are_the_tabulated_ones(freedom: float, expected: float) -> None:
    assert quantile(freedom) == pytest.approx(expected, abs=5e-5)


@pytest.mark.parametrize(("freedom", "expected"), [(1, 161.45), (2, 18.513), (3, 10.128), (math.inf, 3.8415)])
def test_an_estimated_scale_takes_f_in_place_of_chi_square(freedom: float, expected: float) -> None:
    assert likelihood_limit(freedom) == pytest.approx(expected, rel=1e-4)


def test_intervals_are_those_of_scipy_stats() -> None:
    for values in (ONE, OTHER):
        low, high = stats.t.interval(0.95, values.size - 1, values.mean(), stats.sem(values))
        assert half_width(values) == pytest.approx(0.5 * (high - low))
        assert standard_error(values) == pytest.approx(stats.sem(values))
    welch = stats.ttest_ind(ONE, OTHER, equal_var=False).confidence_interval(0.95)
    assert difference_half_width(ONE, OTHER) == pytest.approx(0.5 * (welch.high - welch.low))
    paired = stats.ttest_rel(ONE, OTHER[:3]).confidence_interval(0.95)
    assert paired_half_width(ONE, OTHER[:3]) == pytest.approx(0.5 * (paired.high - paired.low))


def test_means_of_three_are_covered_as_often_as_it_says() -> None:
    # 2000 samples: the share covered has a standard deviation of 0.5 %, three of which are allowed
    samples = np.random.default_rng(2).normal(0.36, 0.003, (2000, 3))
    covered = [abs(sample.mean() - 0.36) <= half_width(sample) for sample in samples]
    assert np.mean(covered) == pytest.approx(0.95, abs=0.015)


def test_a_difference_is_covered_as_often_as_it_says() -> None:
    random = np.random.default_rng(4)
    pairs = [(random.normal(0.35, 0.001, 4), random.normal(0.35, 0.004, 6)) for _ in range(2000)]
    covered = sum(abs(one.mean() - other.mean()) <= difference_half_width(one, other) for one, other in pairs)
    assert 0.935 <= covered / len(pairs) <= 0.965  # three standard errors of 0.005


def test_what_pairs_share_is_no_part_of_their_interval() -> None:
    shared = np.array([0.30, 0.36, 0.33, 0.40])
    small = np.array([1e-3, 2e-3, 1e-3, 0.0])
    assert paired_half_width(shared + small, shared) == pytest.approx(half_width(small))


@pytest.mark.parametrize("values", [[], [0.35]])
def test_one_packing_has_no_spread(values: list[float]) -> None:
    assert math.isnan(half_width(values))
    assert math.isnan(standard_error(values))
    assert math.isnan(difference_half_width(values, OTHER))
    assert math.isnan(difference_half_width(OTHER, values))
    assert math.isnan(paired_half_width(values, values))
    assert math.isnan(pooled_spread([values, values]).sd)
    assert pooled_spread([values]).freedom == 0.0
    assert math.isnan(quantile(0.0))


def test_spread_is_pooled_by_degrees_of_freedom() -> None:
    found = pooled_spread([[1.0, 3.0], [10.0, 10.0, 10.0], [5.0], []])
    assert (found.sd, found.freedom) == (pytest.approx(math.sqrt(2.0 / 3.0)), 3.0)


def test_freedom_is_that_of_the_part_that_counts() -> None:
    assert effective_freedom([1.0, 0.0], [3.0, 50.0]) == pytest.approx(3.0)
    assert effective_freedom([1.0, 1.0], [4.0, 4.0]) == pytest.approx(8.0)
    assert effective_freedom([1.0, 1.0], [4.0, math.inf]) == pytest.approx(16.0)
    assert math.isinf(effective_freedom([1.0, 1.0], [math.inf, math.inf]))
    assert difference_half_width([0.3, 0.3], [0.3, 0.3]) == 0.0


def test_what_is_known_beforehand_counts_by_its_freedom() -> None:
    values, known = [1.0, 2.0, 3.0], Spread(2.0, 6.0)
    found = informed_spread(values, known)
    assert (found.sd, found.freedom) == (pytest.approx(math.sqrt((2 * 1.0 + 6 * 4.0) / 8)), 8.0)
    assert informed_half_width(values, known) == pytest.approx(quantile(8.0) * found.sd / math.sqrt(3))
    assert informed_half_width([1.0], known) == pytest.approx(quantile(6.0) * 2.0)
    assert math.isnan(informed_half_width([], known))


def test_a_spread_known_for_certain_gives_the_normal_interval() -> None:
    assert informed_half_width(np.arange(4.0), Spread(1.5, 1e12)) == pytest.approx(1.959964 * 1.5 / 2, rel=1e-5)


def test_values_that_contradict_what_is_known_count_alone() -> None:
    values, known = np.array([-1.0, 0.0, 1.0, 0.5]), Spread(0.01, 30.0)
    assert informed_half_width(values, known) == pytest.approx(half_width(values))
    assert informed_spread(values * 0.01, known).freedom == 33.0


def test_adding_values_until_the_interval_is_narrow_covers_as_often_as_it_says() -> None:
    """Variances scatter about the known one as its freedom says; Student's interval that ends a search covers less."""
    random, known = np.random.default_rng(4), Spread(1.0, 30.0)
    covered, alone, count, tries = 0, 0, 0, 1500
    for _ in range(tries):
        values = random.standard_normal(40) * math.sqrt(30.0 / random.chisquare(30.0))
        n = next(n for n in range(3, 41) if informed_half_width(values[:n], known) <= 0.9 or n == 40)
        covered += abs(values[:n].mean()) <= informed_half_width(values[:n], known)
        count += n
        n = next(n for n in range(3, 41) if half_width(values[:n]) <= 0.9 or n == 40)
        alone += abs(values[:n].mean()) <= half_width(values[:n])
    assert covered / tries == pytest.approx(0.95, abs=0.015)  # 2.7 standard errors
    assert alone / tries < 0.935
    assert count / tries < 6.0  # (1.96 / 0.9)^2 = 4.7


def test_no_interval_is_made_elsewhere() -> None:
    own = re.compile(
        r"\b1\.96\b|chdtri\b|\bndtri\b|fdtri\b|norm\.ppf|scipy\.stats\.(t|norm|chi2|f)\b|from scipy import stats"
    )
    files = [path for folder in ("src", "workflow") for path in (REPOSITORY / folder).rglob("*") if path.is_file()]
    texts = [path for path in files if path.suffix in (".py", ".j2", ".smk", ".rst") and path.name != "statistics.py"]
    assert len(texts) > 100
    assert [path.name for path in texts if own.search(path.read_text(encoding="utf-8"))] == []
