"""A study's points, seeds and tables."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.crystals.csd import mixture, read_table, to_table
from filtercake.filtration.resistance import (
    CARMAN,
    CARMAN_CONSTANT,
    CARMAN_CONSTANT_CI95,
    KozenyConstant,
    carman_sauter,
    kozeny_carman,
    resistance,
)
from filtercake.packing.pack import MANIFEST, Outcome, cloud_seed
from filtercake.packing.result import Packing, write_json
from filtercake.packing.scene import Scene, digest, stage_seed
from filtercake.results.replicates import REPLICATE_COLUMNS, SUMMARY_COLUMNS, replicates_table, summarise
from filtercake.results.resistance_columns import resistance_columns
from filtercake.study.loading import LoadedStudy
from filtercake.study.points import POINT_COLUMNS, Point, expand, points_table

UM = 1e-6

SWEEPS = """\
title: Points
csds:
  a: {mixture: [{size_um: 20, volume_fraction: 0.5}, {size_um: 50, volume_fraction: 0.5}]}
  b: {mixture: [{size_um: 30, volume_fraction: 1}]}
material: {density_kg_m3: 1180}
packing: {particles: 500, replicates: 3}
sweeps:
"""


def points(study: LoadedStudy) -> list[Point]:
    return expand(study, lambda *_: "liggghts")


@pytest.fixture
def points_of(study_from: Callable[..., LoadedStudy]) -> Callable[[str], list[Point]]:
    """Points of a study with the given sweeps."""
    return lambda sweeps, head=SWEEPS: points(study_from(head + sweeps))


# --- points --------------------------------------------------------------------------------------------------------


def test_a_sweep_visits_every_combination(points_of) -> None:
    found = points_of("  - {csd: [a, b], cohesion_kJ_m3: [0, 50, 100], friction: [0, 0.1]}\n")
    assert len(found) == len({point.name for point in found}) == 12
    visited = {(p.csd, p.scene.cohesion, p.scene.friction) for p in found}
    assert visited == {(c, s, mu) for c in "ab" for s in (0.0, 50e3, 100e3) for mu in (0.0, 0.1)}
    assert {(p.scene.poisson_ratio, p.scene.restitution, p.scene.youngs_modulus) for p in found} == {(0.2, 0.3, 5e6)}


def test_sweeps_are_united_and_a_point_in_two_is_visited_once_with_the_more_replicates(points_of) -> None:
    found = points_of(
        "  - {csd: a, cohesion_kJ_m3: [0, 50], replicates: 8}\n"
        "  - {csd: a, poisson_ratio: [0.2, 0.4]}\n"  # 0.2 at 50 kJ/m3 is in the first block
        "  - {csd: a, cohesion_kJ_m3: 0, replicates: 20}\n"
    )
    assert len(found) == 3
    replicates = {(p.scene.cohesion, p.scene.poisson_ratio): p.replicates for p in found}
    assert replicates == {(0.0, 0.2): 20, (50e3, 0.2): 8, (50e3, 0.4): 3}


def test_units_are_converted_once(points_of) -> None:
    (point,) = points_of("  - {csd: a, cohesion_kJ_m3: 15, youngs_modulus_MPa: 8}\n")
    assert (point.scene.cohesion, point.scene.youngs_modulus) == (15e3, 8e6)
    row = point.row()
    assert (row["cohesion_kJ_m3"], row["youngs_modulus_MPa"]) == (15.0, 8.0)
    assert tuple(row) == POINT_COLUMNS


def test_the_time_step_follows_the_smallest_sphere_and_the_modulus(points_of) -> None:
    head = SWEEPS.replace("replicates: 3", "replicates: 3, time_step_rayleigh: 0.25")
    soft, stiff, coarse = points_of("  - {csd: a}\n  - {csd: a, youngs_modulus_MPa: 20}\n  - {csd: b}\n", head)
    # 20 um PMMA at 5 MPa: 0.8223 us
    assert soft.scene.time_step == pytest.approx(0.25 * 0.8223e-6, rel=1e-4)
    assert stiff.scene.time_step == pytest.approx(0.5 * soft.scene.time_step, rel=1e-12)
    assert coarse.scene.time_step == pytest.approx(1.5 * soft.scene.time_step, rel=1e-12)
    assert soft.scene.rayleigh_fraction == pytest.approx(0.25, rel=1e-12)


def test_a_time_step_in_us_overrides_the_share(points_of) -> None:
    head = SWEEPS.replace("replicates: 3", "replicates: 3, time_step_us: 0.1")
    (point,) = points_of("  - {csd: a}\n", head)
    assert point.scene.time_step == pytest.approx(0.1e-6, rel=1e-14)


def test_friction_shortens_the_default_step_and_nothing_else_does(points_of) -> None:
    without, some, more = points_of("  - {csd: a, friction: [0, 0.05, 0.5]}\n")
    assert some.scene.time_step == more.scene.time_step < without.scene.time_step
    assert without.scene.rayleigh_fraction < 0.61  # stable in the prototype to 0.97


def test_auto_asks_for_an_engine(study_from) -> None:
    asked = []

    def choose(scene: Scene) -> str:
        asked.append((scene.csd.size.tolist(), scene.particles, scene.restitution))
        return "some_engine"

    found = expand(study_from(SWEEPS + "  - {csd: [a, b], restitution: [0.3, 0.05]}\n"), choose)
    assert [point.scene.engine for point in found] == ["some_engine"] * 4
    assert [rest for _, *rest in asked] == [[500, 0.3], [500, 0.05]] * 2
    named = SWEEPS.replace("replicates: 3", "replicates: 3, engine: liggghts_as_published")
    assert expand(study_from(named + "  - {csd: a}\n"), choose)[0].scene.engine == "liggghts_as_published"


def test_a_point_survives_json(points_of) -> None:
    (point,) = points_of("  - {csd: a, cohesion_kJ_m3: 0.1, friction: 0.3}\n")
    again = Point.from_dict(json.loads(json.dumps(point.as_dict())))
    assert again == point


def test_points_table(points_of) -> None:
    table = points_table(points_of("  - {csd: [a, b], friction: [0, 0.1], replicates: 4}\n"))
    assert tuple(table.columns) == (*POINT_COLUMNS, "replicates")
    assert table["replicates"].tolist() == [4] * 4
    assert table["point"].is_unique


# --- slugs ---------------------------------------------------------------------------------------------------------


def slug(points_of: Callable[..., list[Point]], sweep: str = "{csd: a}", head: str = SWEEPS) -> str:
    (point,) = points_of(f"  - {sweep}\n", head)
    return point.name


def test_a_slug_is_readable_and_a_file_name(points_of) -> None:
    assert re.fullmatch(r"a_s50_mu0_[0-9a-f]{8}", slug(points_of))
    assert re.fullmatch(
        r"a_s12\.5_mu0\.05_nu0\.4_e0\.6_E8_[0-9a-f]{8}",
        slug(
            points_of,
            "{csd: a, cohesion_kJ_m3: 12.5, friction: 0.05, "
            "poisson_ratio: 0.4, restitution: 0.6, youngs_modulus_MPa: 8}",
        ),
    )


def test_a_slug_is_stable(points_of) -> None:
    assert slug(points_of) == slug(points_of)
    assert slug(points_of, "{csd: a, cohesion_kJ_m3: 5e1}") == slug(points_of, "{csd: [a], cohesion_kJ_m3: [50.0]}")


@pytest.mark.parametrize(
    ("good", "other"),
    [
        ("particles: 500", "particles: 501"),
        ("density_kg_m3: 1180", "density_kg_m3: 1181"),
        ("density_kg_m3: 1180", "density_kg_m3: 1180, poisson_ratio: 0.21"),
        ("density_kg_m3: 1180", "density_kg_m3: 1180, youngs_modulus_MPa: 6"),
        ("density_kg_m3: 1180", "density_kg_m3: 1180, restitution: 0.31"),
        ("density_kg_m3: 1180", "density_kg_m3: 1180, cohesion_kJ_m3: 50.0000001"),
        ("density_kg_m3: 1180", "density_kg_m3: 1180, friction: 1e-9"),
        ("replicates: 3", "replicates: 3, seed: 2"),
        ("replicates: 3", "replicates: 3, initial_void_fraction: 0.66"),
        ("replicates: 3", "replicates: 3, settling_velocity_m_s: 0.02"),
        ("replicates: 3", "replicates: 3, time_step_us: 0.1"),
        ("replicates: 3", "replicates: 3, porosity_tolerance: 2e-4"),
        ("replicates: 3", "replicates: 3, max_fall_times: 5"),
        ("replicates: 3", "replicates: 3, engine: liggghts_as_published"),
        ("size_um: 20, volume_fraction: 0.5}", "size_um: 20.001, volume_fraction: 0.5}"),
        ("{size_um: 20, volume_fraction: 0.5}, ", "{size_um: 20, volume_fraction: 0.499}, "),
    ],
)
def test_a_slug_changes_with_the_physics(points_of, good: str, other: str) -> None:
    assert good in SWEEPS
    assert slug(points_of, head=SWEEPS.replace(good, other)) != slug(points_of)


@pytest.mark.parametrize(
    ("good", "other"),
    [
        ("replicates: 3", "replicates: 5"),
        ("replicates: 3", "replicates: 3, time_limit_min: 5"),
        ("replicates: 3", "replicates: 3, write_vtk: true"),
        ("title: Points", "title: Another title"),
        ("a: {mixture", "a: {label: another label, mixture"),
        ("density_kg_m3: 1180", "density_kg_m3: 1180, sphericity: 0.8"),  # in the resistance only
    ],
)
def test_a_slug_does_not_change_with_anything_else(points_of, good: str, other: str) -> None:
    assert good in SWEEPS
    assert slug(points_of, head=SWEEPS.replace(good, other)) == slug(points_of)


# --- seeds ---------------------------------------------------------------------------------------------------------


def test_a_digest_is_the_sha256_of_compact_sorted_json() -> None:
    assert digest("a", {"y": 1, "x": [0.5]}) == hashlib.sha256(b'["a",{"x":[0.5],"y":1}]').hexdigest()


@given(st.lists(st.integers() | st.text() | st.booleans(), max_size=4))
def test_seeds_fit_a_signed_64_bit_integer(parts: list[Any]) -> None:
    assert 0 <= stage_seed(*parts) < 2**63
    assert stage_seed(*parts) == stage_seed(*parts)


@pytest.mark.parametrize(
    "change",
    [
        {"friction": 0.3},
        {"cohesion": 0.0},
        {"engine": "liggghts_as_published"},
        {"time_step": 1e-8},
        {"density": 2450.0},
        {"youngs_modulus": 1e7},
        {"poisson_ratio": 0.4},
        {"restitution": 0.9},
        {"processes": 2},
        {"skin": 1e-6},
    ],
)
def test_points_that_differ_in_the_contact_share_their_clouds(make_scene, change: dict[str, Any]) -> None:
    assert cloud_seed(make_scene(**change), 3) == cloud_seed(make_scene(), 3)


def test_clouds_differ_by_replicate_distribution_number_void_fraction_and_base_seed(make_scene, pmma) -> None:
    seeds = [cloud_seed(make_scene(csd=pmma(0.5)), k) for k in range(100)]
    seeds += [cloud_seed(make_scene(csd=pmma(0.25)), k) for k in range(100)]
    seeds += [
        cloud_seed(make_scene(csd=pmma(0.5), **c), 0)
        for c in ({"particles": 301}, {"initial_void_fraction": 0.7}, {"seed": 2})
    ]
    assert len(set(seeds)) == 203


def test_a_cloud_s_seed_outlives_a_csv_round_trip(make_scene, pmma, tmp_path: Path) -> None:
    csd = mixture([20.1 * UM, 33.3 * UM, 50 * UM], [1 / 3, 1 / 7, 1 - 1 / 3 - 1 / 7])
    to_table(csd, csd).to_csv(tmp_path / "csd.csv", index=False)
    _, again = read_table(tmp_path / "csd.csv")
    assert cloud_seed(make_scene(csd=again), 0) == cloud_seed(make_scene(csd=csd), 0)


def test_a_spec_survives_json(make_scene) -> None:
    scene: Scene = make_scene(time_step=1 / 3 * 1e-6)
    assert Scene.from_dict(json.loads(json.dumps(scene.as_dict()))) == scene


# --- tables --------------------------------------------------------------------------------------------------------


def row(point: str, replicate: int, porosity: float = 0.36, status: str = "ok", **more: Any) -> dict[str, Any]:
    values: dict[str, Any] = {"point": point, "study": "s", "csd": "a", "replicate": replicate, "status": status}
    if status == "ok":
        values.update(porosity=porosity, porosity_paper_count=porosity + 0.01, resistance_m_kg=1e9 * porosity)
        values.update(
            resistance_sauter_m_kg=9e8 * porosity,
            resistance_truncated_m_kg=8e8 * porosity,
            wall_s=2.0,
            overlap_max=0.001 * (replicate + 1),
        )
    return {**values, **more}


def table(*rows: dict[str, Any]) -> pd.DataFrame:
    return pd.DataFrame(list(rows), columns=list(REPLICATE_COLUMNS))


def test_a_summary_by_hand() -> None:
    found = summarise(table(row("p", 0, 0.35), row("p", 1, 0.36), row("p", 2, 0.37)))
    assert tuple(found.columns) == SUMMARY_COLUMNS
    (line,) = found.to_dict("records")
    assert (line["n"], line["n_failed"], line["wall_s"]) == (3, 0, 6.0)
    assert line["porosity"] == pytest.approx(0.36)
    assert line["porosity_ci95"] == pytest.approx(4.302653 * 0.01 / np.sqrt(3), rel=1e-6)
    assert line["porosity_paper_count"] == pytest.approx(0.37)
    assert line["resistance_m_kg"] == pytest.approx(3.6e8)
    assert line["resistance_ci95_m_kg"] == pytest.approx(4.302653 * 1e7 / np.sqrt(3), rel=1e-6)
    assert line["resistance_truncated_m_kg"] == pytest.approx(8e8 * 0.36)
    assert line["overlap_max"] == pytest.approx(0.003)


def test_each_law_has_its_interval_over_the_packings_and_the_study_s_law_one_of_its_own() -> None:
    csd, packed = mixture([20 * UM, 50 * UM], [0.5, 0.5]), mixture([50 * UM], [1.0])
    porosities = (0.35, 0.36, 0.37)
    columns = [resistance_columns("carman", value, (csd, packed), 1180.0, 1.0) for value in porosities]
    (line,) = summarise(table(*(row("p", k, 0.36, **values) for k, values in enumerate(columns)))).to_dict("records")
    for name in ("", "_additive", "_carman", "_sauter"):
        values = [values[f"resistance{name}_m_kg"] for values in columns]
        assert line[f"resistance{name}_m_kg"] == pytest.approx(np.mean(values))
        half = 4.302653 * np.std(values, ddof=1) / np.sqrt(3)
        assert line[f"resistance{name}_ci95_m_kg"] == pytest.approx(half, rel=1e-6)
    relative = line["resistance_law_ci95_m_kg"] / line["resistance_m_kg"]
    assert relative == pytest.approx(CARMAN_CONSTANT_CI95 / CARMAN_CONSTANT)


def test_columns_of_a_cake_whose_flow_is_solved() -> None:
    csd, packed = mixture([20 * UM, 50 * UM], [0.5, 0.5]), mixture([50 * UM], [1.0])
    found = resistance_columns("stokes", 0.36, (csd, packed), 1180.0, 0.9, KozenyConstant(168.0, 0.02))
    assert found["resistance_m_kg"] == pytest.approx(resistance("stokes", 0.36, csd, 1180.0, 0.9, 168.0))
    assert found["resistance_truncated_m_kg"] == pytest.approx(resistance("stokes", 0.36, packed, 1180.0, 0.9, 168.0))
    assert found["resistance_law_ci95_m_kg"] == pytest.approx(0.02 * found["resistance_m_kg"])
    assert found["resistance_carman_m_kg"] == pytest.approx(resistance(CARMAN, 0.36, csd, 1180.0, 0.9))
    with pytest.raises(ValueError, match="stokes needs a kozeny_constant"):
        resistance_columns("stokes", 0.36, (csd, packed), 1180.0, 0.9)


def test_failed_replicates_are_counted_and_left_out() -> None:
    found = summarise(table(row("p", 0, 0.35), row("p", 1, status="failed", reason="killed"), row("p", 2, 0.37)))
    (line,) = found.to_dict("records")
    assert (line["n"], line["n_failed"]) == (2, 1)
    assert line["porosity"] == pytest.approx(0.36)


def test_a_point_of_which_everything_failed_keeps_its_row() -> None:
    found = summarise(table(row("bad", 0, status="failed"), row("bad", 1, status="failed"), row("good", 0)))
    bad, good = found.to_dict("records")
    assert (bad["point"], bad["n"], bad["n_failed"]) == ("bad", 0, 2)
    for column in ("porosity", "porosity_ci95", "resistance_m_kg", "resistance_ci95_m_kg", "overlap_max"):
        assert np.isnan(bad[column])
    assert good["porosity"] == pytest.approx(0.36)
    assert np.isnan(good["porosity_ci95"])  # one value has no interval


def test_points_keep_their_order() -> None:
    rows = [row(name, 0) for name in ("zebra", "ape", "mouse")]
    assert summarise(table(*rows))["point"].tolist() == ["zebra", "ape", "mouse"]


def test_no_packing_at_all_is_an_empty_summary() -> None:
    found = summarise(table())
    assert tuple(found.columns) == SUMMARY_COLUMNS
    assert found.empty


def test_replicates_are_measured_and_damaged_ones_are_rows_with_a_reason(points_of, tmp_path: Path) -> None:
    (point,) = points_of("  - {csd: a, replicates: 3}\n")
    csd = mixture([20 * UM, 50 * UM], [0.5, 0.5])
    packed = mixture([50 * UM], [1.0])
    folder = tmp_path / point.name
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in (4, 4, 8)), indexing="ij"), axis=-1).reshape(-1, 3)
    position, radius = (grid + 0.5) * 40 * UM, np.full(128, 20 * UM)
    record = {"replicate": 0, "seed": 11, "settled": True, "overlap_max": 0.001, "coordination": 4.0, "particles": 128}
    record |= {"length_m": 160 * UM, "bed_height_m": 320 * UM, "steps": 1000, "wall_s": 1.5}
    outcomes = []
    for k in (0, 1):
        made = Packing(position, radius, 160 * UM, {**record, "replicate": k})
        outcomes.append(Outcome(k, "ok", "", 11 + k, made.save(folder / f"r{k}.npz"), 1))
    outcomes.append(Outcome(2, "failed", "LIGGGHTS was killed by signal 9", 13, "", 3))
    write_json(folder / MANIFEST, {"key": "k", "replicates": [dataclasses.asdict(outcome) for outcome in outcomes]})
    (folder / "r1.npz").write_bytes((folder / "r1.npz").read_bytes()[:-10])

    found = replicates_table([point], tmp_path, {"a": (csd, packed)}, sphericity=0.9)
    assert tuple(found.columns) == REPLICATE_COLUMNS
    assert found["replicate"].tolist() == [0, 1, 2]
    assert found["status"].tolist() == ["ok", "failed", "failed"]
    assert "checksum" in found["reason"][1]
    assert found["reason"][2] == "LIGGGHTS was killed by signal 9"
    assert found["seed"].tolist() == [11, 12, 13]
    good = found.iloc[0]
    cubic = 1.0 - np.pi / 6.0
    assert good["porosity"] == pytest.approx(cubic, abs=1e-12)
    assert good["resistance_m_kg"] == pytest.approx(kozeny_carman(cubic, csd, 1180.0, 0.9), rel=1e-10)
    assert good["resistance_sauter_m_kg"] == pytest.approx(carman_sauter(cubic, csd, 1180.0, 0.9), rel=1e-10)
    assert good["resistance_truncated_m_kg"] == pytest.approx(kozeny_carman(cubic, packed, 1180.0, 0.9), rel=1e-10)
    assert (good["length_um"], good["bed_height_um"]) == (pytest.approx(160.0), pytest.approx(320.0))
    assert found.loc[1:, "porosity"].isna().all()
    assert good["resistance_carman_m_kg"] == pytest.approx(resistance(CARMAN, cubic, csd, 1180.0, 0.9), rel=1e-10)
    assert good["resistance_additive_m_kg"] == good["resistance_m_kg"]
    assert found["resistance_law"].tolist() == ["additive"] * 3
    by_carman = replicates_table([point], tmp_path, {"a": (csd, packed)}, 0.9, CARMAN)
    first = by_carman.iloc[0]
    assert first["resistance_m_kg"] == first["resistance_carman_m_kg"] == good["resistance_carman_m_kg"]
    assert first["resistance_additive_m_kg"] == good["resistance_additive_m_kg"]
    assert first["resistance_truncated_m_kg"] == pytest.approx(resistance(CARMAN, cubic, packed, 1180.0, 0.9))
    half = first["resistance_m_kg"] * CARMAN_CONSTANT_CI95 / CARMAN_CONSTANT
    assert first["resistance_law_ci95_m_kg"] == pytest.approx(half)
    (line,) = summarise(by_carman).to_dict("records")
    assert line["resistance_law"] == "carman" and line["resistance_law_ci95_m_kg"] == pytest.approx(half)
    assert np.isnan(line["resistance_carman_ci95_m_kg"])  # one packing
    (line,) = summarise(found).to_dict("records")
    assert (line["n"], line["n_failed"]) == (1, 2)
