"""Packings are added until the porosity's interval is narrow, and the interval then still covers what it says."""

from __future__ import annotations

import numpy as np
import pytest

from filtercake.csd import mixture
from filtercake.packing.pack import MANIFEST, pack_replicates
from filtercake.packing.result import read_record
from filtercake.packing.spec import PackingSpec
from filtercake.precision import LEAST_REPLICATES, UntilNarrow

SPEC = PackingSpec(
    particles=150,
    void_fraction=0.6,
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


def until(interval: float, values: np.ndarray, least: int = 1) -> UntilNarrow:
    rule = UntilNarrow(SPEC, interval, least)
    for value in values:
        if rule.add(float(value)):
            break
    return rule


@pytest.mark.parametrize("spread", [0.0005, 0.0015, 0.0026, 0.004])
def test_the_interval_covers_the_truth(spread: float) -> None:
    random = np.random.default_rng(1)
    covered = 0
    for _ in range(400):
        rule = until(0.002, random.normal(0.35, spread, 300))
        assert rule.half_width <= 0.002
        covered += abs(np.mean(rule.values) - 0.35) <= 0.002
    assert covered >= 0.92 * 400  # 0.95 less two standard errors of 400 tries


def test_more_spread_takes_more_packings() -> None:
    random = np.random.default_rng(2)
    counts = [np.mean([len(until(0.002, random.normal(0.35, s, 300)).values) for _ in range(50)]) for s in (1e-3, 4e-3)]
    assert counts[0] < 8
    assert 12 < counts[1] < 30  # (1.96 * 4e-3 / 2e-3)^2 = 15


def test_equal_packings_are_not_believed_at_once() -> None:
    assert len(until(0.002, np.full(50, 0.35)).values) == LEAST_REPLICATES
    assert len(until(0.002, np.full(50, 0.35), least=9).values) == 9


def test_one_lucky_interval_is_not_enough() -> None:
    # narrow after the sixth, wide after the seventh
    values = [0.35, 0.35, 0.35, 0.35, 0.352, 0.349, 0.356, *[0.35] * 30]
    assert len(until(0.0011, np.array(values)).values) > 8


def test_replicates_are_added_and_kept(tmp_path) -> None:
    csd = mixture([20e-6, 30e-6], [0.5, 0.5])
    wide = pack_replicates(SPEC, csd, 40, tmp_path, "code", enough=UntilNarrow(SPEC, 0.05))
    assert len(wide) == LEAST_REPLICATES
    made = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("r*.npz")}
    rule = UntilNarrow(SPEC, 0.006)
    narrow = pack_replicates(SPEC, csd, 40, tmp_path, "code", enough=rule)
    assert LEAST_REPLICATES < len(narrow) < 40
    assert rule.half_width <= 0.006
    assert len(read_record(tmp_path / MANIFEST)["replicates"]) == len(narrow)
    assert all((tmp_path / name).stat().st_mtime_ns == at for name, at in made.items())


def test_the_search_is_bounded(tmp_path) -> None:
    csd = mixture([20e-6, 30e-6], [0.5, 0.5])
    rule = UntilNarrow(SPEC, 1e-4)
    assert len(pack_replicates(SPEC, csd, 8, tmp_path, "code", enough=rule)) == 8
    assert rule.half_width > 1e-4
