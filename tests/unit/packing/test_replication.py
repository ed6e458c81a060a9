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
from filtercake.results.replicates import REPLICATE_COLUMNS, summarise
from filtercake.run import console
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
