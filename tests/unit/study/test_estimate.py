"""The estimate of run time holds against the measured ones of docs/data; walltimes, groups and disk follow from it."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
import yaml

from filtercake.cli.commands import main
from filtercake.packing.engines.base import LARGE_BED
from filtercake.packing.replication import LEAST_REPLICATES
from filtercake.packing.scene import Scene
from filtercake.study import limits
from filtercake.study.estimate import (
    ACCURACY,
    BASE_MB,
    GROUP_SIZES,
    LONGEST_MINUTES,
    Estimate,
    estimate,
    fall_steps,
    group_size,
    job_seconds,
    memory_mb,
    packing_seconds,
    packings_of,
    together,
    walltime_minutes,
)
from filtercake.study.loading import LoadedStudy, load_study
from filtercake.study.points import Point, expand
from filtercake.units import duration
from filtercake.validation.growth import even_distribution

REPOSITORY = Path(__file__).resolve().parents[3]
DATA = REPOSITORY / "docs" / "data"
PAGE = (REPOSITORY / "docs" / "cluster.md").read_text(encoding="utf-8")
CASES = {
    "pmma": ("config/studies/pmma.yaml", "pmma_50_50", 0.0),
    "pmma_friction": ("config/studies/pmma.yaml", "pmma_50_50", 0.3),
    "alum": ("config/benchmarks/agreement_alum.yaml", "alum_15min", 0.0),
    "alum_wide": ("config/benchmarks/agreement_alum.yaml", "alum_15min", 0.0),
}


def scene_of(case: str, engine: str, particles: int) -> Scene:
    """A case of the benchmark at its default time step."""
    path, name, friction = CASES[case]
    study = load_study(REPOSITORY / path)
    point = next(point for point in expand(study, lambda *_: "embedded") if point.csd == name)
    changes = {"engine": engine, "particles": particles, "friction": friction, "cohesion": 50e3}
    return dataclasses.replace(point.scene, **changes).with_time_step(limits.default_time_step(friction))


def measured() -> list[pytest.param]:
    """Defaults, other numbers of spheres and the other engine, of the benchmark's table."""
    table = pd.read_csv(DATA / "run_time_error.csv")
    table = table[(table["estimator"] == "interior slab") & table["axis"].isin(["default", "spheres", "engine"])]
    rows = table[table["particles"] >= 1000].to_dict("records")
    return [
        pytest.param(row["case"], row["engine"], int(row["particles"]), row["seconds"], id=f"{row['case']}-{k}")
        for k, row in enumerate(rows)
    ]


@pytest.mark.parametrize(("case", "engine", "particles", "seconds"), measured())
def test_a_packing_takes_what_was_measured(case: str, engine: str, particles: int, seconds: float) -> None:
    assert 1.0 / ACCURACY < packing_seconds(scene_of(case, engine, particles)) / seconds < ACCURACY


def test_there_are_enough_measurements() -> None:
    assert len(measured()) >= 9


def test_growth_is_that_of_the_table() -> None:
    scene = scene_of("pmma", "embedded", 1000)
    for row in pd.read_csv(DATA / "growth.csv").to_dict("records"):
        csd = even_distribution(row["size_ratio"])
        made = dataclasses.replace(scene, csd=csd, particles=int(row["particles"])).with_time_step(0.5)
        assert 1.0 / ACCURACY < packing_seconds(made) / row["wall_s"] < ACCURACY, row
        assert 1.0 / ACCURACY < fall_steps(made) / row["steps"] < ACCURACY, row


def test_steps_are_those_of_the_agreement_table() -> None:
    study = load_study(REPOSITORY / "config/benchmarks/agreement_pmma.yaml")
    table = pd.read_csv(DATA / "agreement_replicates.csv")
    table = table[(table["engine"] == "embedded") & (table["status"] == "ok")]
    compared = 0
    for point in expand(study, lambda *_: "embedded"):
        row = point.row()
        same = (table["csd"] == point.csd) & (table["friction"] == point.scene.friction)
        steps = table[same & (table["cohesion_kJ_m3"] == row["cohesion_kJ_m3"])]["steps"]
        if len(steps):
            scene = point.scene.with_time_step(limits.default_time_step(point.scene.friction))
            assert 1.0 / ACCURACY < fall_steps(scene) / steps.mean() < ACCURACY, point.name
            compared += 1
    assert compared >= 7


@pytest.fixture
def point_of(study_from: Callable[..., LoadedStudy]) -> Callable[..., Point]:
    """A point of the smallest study; keywords replace values of its scene."""
    study = study_from()
    point = expand(study, lambda *_: "embedded")[0]

    def make(replicates: int = 8, **changes: object) -> Point:
        scene = dataclasses.replace(point.scene, **changes)
        return dataclasses.replace(point, scene=scene, replicates=replicates)

    return make


def test_a_study_adds_up(point_of: Callable[..., Point]) -> None:
    point = point_of()
    found = estimate([point, point])
    assert (found.points, found.packings) == (2, 16)
    assert found.core_seconds == pytest.approx(2 * job_seconds(point))
    assert found.disk > 16 * 32 * point.scene.particles
    assert together([found, found]).core_seconds == 2 * found.core_seconds
    assert estimate([point], on_cluster=True).core_seconds > found.core_seconds / 2
    assert estimate([]) == Estimate(0.0, 0.0, 0.0, 0, 0)


def test_wall_time_is_never_less_than_the_longest_job(
    point_of: Callable[..., Point],
) -> None:
    point = point_of()
    found = estimate([point] * 10)
    assert found.wall_seconds(2) == pytest.approx(found.core_seconds / 2)
    assert found.wall_seconds(1000) == found.longest
    assert "on 1000 cores" in found.words(1000) and "on 1 core," in found.words(1)


def test_a_large_bed_takes_two_cores_for_half_the_time(
    point_of: Callable[..., Point],
) -> None:
    large = point_of(particles=LARGE_BED)
    one = point_of(particles=LARGE_BED, processes=1)
    assert job_seconds(large) < 0.6 * job_seconds(one)
    assert group_size(large) == 1


def test_walltime_doubles_with_every_retry_and_has_an_end(
    point_of: Callable[..., Point],
) -> None:
    point = point_of(replicates=1000)
    first = walltime_minutes(point)
    assert 60 * first > 4.0 * point.replicates * packing_seconds(point.scene)
    assert walltime_minutes(point, 2) == 2 * first
    assert walltime_minutes(point, 30) == LONGEST_MINUTES


def test_short_points_share_a_submission_and_long_ones_do_not(
    point_of: Callable[..., Point],
) -> None:
    sizes = [group_size(point_of(replicates=n)) for n in (1, 30, 1000)]
    assert sizes == [GROUP_SIZES[0], GROUP_SIZES[1], 1]


@pytest.mark.parametrize("granted", [5, 20, 60, 240])
@pytest.mark.parametrize("replicates", [1, 30])
def test_a_submission_asks_for_no_more_than_is_granted(
    granted: int, replicates: int, point_of: Callable[..., Point]
) -> None:
    point = point_of(replicates=replicates)
    size = group_size(point, granted=granted)
    whole = min(walltime_minutes(point), granted)
    for attempt in (1, 2, 3):
        asked = walltime_minutes(point, attempt, granted=granted)
        assert asked >= whole  # a smaller group is no reason for less time
        assert size * asked <= granted


def test_the_profile_knows_every_size_of_group() -> None:
    profile = yaml.safe_load((REPOSITORY / "profiles" / "slurm" / "profile.yaml").read_text(encoding="utf-8"))
    assert {f"packing_{size}={size}" for size in GROUP_SIZES} <= set(profile["group-components"])


def test_an_interval_takes_as_many_packings_as_the_benchmark_found(
    point_of: Callable[..., Point],
) -> None:
    point = point_of()
    table = pd.read_csv(DATA / "coverage.csv")
    here = (table["case"] == "pmma") & (table["rule"] == "known spread") & (table["asked"] == 0.002)
    found = table.loc[here, "n"].mean()
    narrow = dataclasses.replace(point, replicates=1, porosity_ci95_target=0.002, max_replicates=64)
    assert packings_of(narrow) == pytest.approx(found, abs=1.0)
    assert packings_of(dataclasses.replace(narrow, max_replicates=4)) == 4
    assert packings_of(dataclasses.replace(narrow, porosity_ci95_target=0.1)) == LEAST_REPLICATES


def test_memory_grows_with_the_bed(point_of: Callable[..., Point]) -> None:
    assert BASE_MB < memory_mb(point_of().scene) < memory_mb(point_of(particles=100_000).scene)


@pytest.mark.parametrize(("seconds", "text"), [(5.0, "5 s"), (600.0, "10 min"), (7200.0, "2.0 h")])
def test_times_in_words(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_cores_must_be_a_number(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["estimate", str(REPOSITORY / "config/test/tiny.yaml"), "--cores", "many"]) == 2
    assert "--cores = many: must be a whole number" in capsys.readouterr().err


def test_the_page_on_clusters_estimates_its_own_sweep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    study = tmp_path / "config" / "studies" / "sweep.yaml"
    study.parent.mkdir(parents=True)
    study.write_text(re.search(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL)[1], encoding="utf-8")
    (command,) = re.findall(r"^filtercake (.*)$", PAGE, flags=re.MULTILINE)
    assert main(command.split()) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert printed.startswith("points 1000 packings 8000")
    assert printed in " ".join(PAGE.split())
