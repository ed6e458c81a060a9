"""Packings are added until the porosity's interval is narrow, and the interval then still covers what it says."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from filtercake.crystals.csd import mixture
from filtercake.packing.pack import MANIFEST, pack_replicates
from filtercake.packing.replication import LEAST_REPLICATES, UntilNarrow
from filtercake.packing.result import read_record
from filtercake.packing.scene import Scene
from filtercake.packing.spread import known_spread
from filtercake.results.replicates import REPLICATE_COLUMNS, summarise
from filtercake.run import console
from filtercake.statistics import Spread, half_width, informed_half_width
from filtercake.study.loading import load_study
from filtercake.study.points import expand

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


def until(interval: float, values: np.ndarray, least: int = 1) -> UntilNarrow:
    rule = UntilNarrow(SCENE, interval, least)
    for value in values:
        if rule.add(float(value)):
            break
    return rule


SPREAD = known_spread(SCENE).sd


@pytest.mark.parametrize("ratio", [0.5, 0.8, 1.0])
@pytest.mark.parametrize("asked", [0.5, 0.9, 1.5])
def test_the_interval_covers_the_truth(ratio: float, asked: float) -> None:
    random = np.random.default_rng(1)
    covered = 0
    for _ in range(400):
        rule = until(asked * SPREAD, random.normal(0.35, ratio * SPREAD, 300))
        assert rule.half_width <= asked * SPREAD
        covered += abs(np.mean(rule.values) - 0.35) <= rule.half_width
    assert covered >= 0.92 * 400  # 0.95 less nearly three standard errors of 400 tries


def test_it_takes_few_more_packings_than_a_spread_that_is_known_for_certain() -> None:
    random = np.random.default_rng(2)
    for asked in (0.5, 0.9, 1.0):
        counts = [len(until(asked * SPREAD, random.normal(0.35, SPREAD, 300)).values) for _ in range(200)]
        assert np.mean(counts) < (1.96 / asked) ** 2 + 1.6


def test_more_spread_takes_more_packings() -> None:
    random = np.random.default_rng(2)
    counts = [
        np.mean([len(until(SPREAD, random.normal(0.35, s * SPREAD, 300)).values) for _ in range(50)]) for s in (0.5, 2)
    ]
    assert counts[0] < 5
    assert 7 < counts[1] < 25


def test_equal_packings_are_not_believed_at_once() -> None:
    assert len(until(2.0 * SPREAD, np.full(50, 0.35)).values) == LEAST_REPLICATES
    assert len(until(2.0 * SPREAD, np.full(50, 0.35), least=9).values) == 9
    assert len(until(0.5 * SPREAD, np.full(50, 0.35)).values) > 6


def test_a_lucky_small_spread_is_not_believed() -> None:
    values = 0.35 + SPREAD * np.array([0.0, 0.01, -0.01, 0.0, 0.01, *[0.0] * 30])
    assert len(until(0.7 * SPREAD, values).values) >= 6


def test_replicates_are_added_and_kept(tmp_path) -> None:
    wide = pack_replicates(SCENE, 40, tmp_path, "code", enough=UntilNarrow(SCENE, 0.05))
    assert len(wide) == LEAST_REPLICATES
    made = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("r*.npz")}
    rule = UntilNarrow(SCENE, 0.006)
    narrow = pack_replicates(SCENE, 40, tmp_path, "code", enough=rule)
    assert LEAST_REPLICATES < len(narrow) < 40
    assert rule.half_width <= 0.006
    assert len(read_record(tmp_path / MANIFEST)["replicates"]) == len(narrow)
    assert all((tmp_path / name).stat().st_mtime_ns == at for name, at in made.items())


def test_the_search_is_bounded(tmp_path) -> None:
    rule = UntilNarrow(SCENE, 1e-4)
    assert len(pack_replicates(SCENE, 8, tmp_path, "code", enough=rule)) == 8
    assert rule.half_width > 1e-4


def test_the_summary_and_the_last_lines_say_what_was_not_reached(tmp_path) -> None:
    rows = [
        {"point": point, "porosity_ci95_target": asked, "status": "ok", "porosity": value}
        for point, asked, values in (
            ("narrow", 0.01, (0.350, 0.351, 0.352)),
            ("wide", 0.01, (0.30, 0.35, 0.40)),
            ("free", np.nan, (0.30, 0.40)),
        )
        for value in values
    ]
    table = summarise(pd.DataFrame(rows).reindex(columns=list(REPLICATE_COLUMNS)))
    reached = dict(zip(table["point"], table["interval_reached"], strict=True))
    assert reached == {"narrow": "yes", "wide": "no", "free": ""}
    (tmp_path / "study").mkdir()
    table.to_csv(tmp_path / "study" / "summary.csv", index=False)
    said = console.success(tmp_path, {"study": {}})
    assert "wide: the porosity's interval is 0.12 after 3 packings, not 0.01 (packing.porosity_ci95_target)" in said
    assert "narrow" not in said.partition("summary.csv")[2]


def summarised(known: float, asked: float, values: tuple[float, ...]) -> pd.Series:
    rows = [
        {
            "point": "one",
            "porosity_ci95_target": asked,
            "status": "ok",
            "porosity": value,
            "resistance_m_kg": 1e9 * (1.0 - 10.0 * (value - 0.35)),
            "porosity_paper_count": value + 0.01,
            "porosity_known_sd": known,
            "porosity_known_freedom": 30.0 if known else np.nan,
        }
        for value in values
    ]
    return summarise(pd.DataFrame(rows).reindex(columns=list(REPLICATE_COLUMNS))).iloc[0]


def test_the_summary_has_the_interval_that_ended_the_search() -> None:
    values = (0.351, 0.349, 0.350)
    row = summarised(0.002, 0.01, values)
    half = informed_half_width(values, Spread(0.002, 30.0))
    assert row["porosity_ci95"] == pytest.approx(half)
    assert row["resistance_ci95_m_kg"] == pytest.approx(1e10 * half)  # the porosity's times the slope
    assert row["porosity_paper_count_ci95"] == pytest.approx(half_width(values))  # nothing is known of the count


def test_without_an_interval_asked_for_student_has_the_word() -> None:
    values = (0.351, 0.349, 0.350)
    row = summarised(np.nan, np.nan, values)
    assert row["porosity_ci95"] == pytest.approx(half_width(values))
    assert row["resistance_ci95_m_kg"] == pytest.approx(1e10 * half_width(values))


def test_equal_porosities_leave_a_resistance_its_own_interval() -> None:
    row = summarised(0.002, 0.01, (0.35, 0.35, 0.35))
    assert row["porosity_ci95"] > 0.0
    assert row["resistance_ci95_m_kg"] == 0.0


def test_a_study_asks_for_an_interval(tmp_path) -> None:
    path = tmp_path / "study.yaml"
    path.write_text(
        """
csds:
  broad:
    mixture: [{size_um: 30, volume_fraction: 0.3}, {size_um: 300, volume_fraction: 0.7}]
  narrow:
    mixture: [{size_um: 30, volume_fraction: 0.3}, {size_um: 40, volume_fraction: 0.7}]
material: {density_kg_m3: 2000}
packing: {porosity_ci95_target: 0.002, max_replicates: 30, replicates: 4}
sweeps:
  - csd: [broad, narrow]
"""
    )
    broad, narrow = expand(load_study(path), lambda *_: "embedded")
    assert (narrow.scene.particles, narrow.scene.bed_depth_factor) == (2000, 1.0)
    assert (broad.porosity_ci95_target, broad.replicates, broad.most_replicates) == (0.002, 4, 30)
    # 4.6 x 4.6 x 10 largest diameters at 70 % solids
    solids = 4.6 * 4.6 * 10 * 0.7 * 300e-6**3
    mean = 1.0 / (0.3 / 30e-6**3 + 0.7 / 300e-6**3) * np.pi / 6
    assert broad.scene.particles == pytest.approx(solids / mean, rel=1e-3)
    side = (broad.scene.particles * mean / (0.35 * 2 * broad.scene.bed_depth_factor)) ** (1 / 3)
    assert side == pytest.approx(4.6 * 300e-6, rel=1e-3)
