"""Studies of pressed cakes: their points, which share packings, and what is refused before any job starts."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from filtercake import api
from filtercake.errors import ConfigError
from filtercake.study.loading import LoadedStudy
from filtercake.study.points import POINT_COLUMNS, Point, base_point, base_rows, expand, packed, points_table

HEAD = """\
title: Pressed
csds:
  a: {mixture: [{size_um: 20, volume_fraction: 0.5}, {size_um: 50, volume_fraction: 0.5}]}
  fine: {mixture: [{size_um: 1, volume_fraction: 1}]}
material: {density_kg_m3: 1180, adhesion_mJ_m2: 10}
packing: {protocol: filtration, pressure_kPa: 50, particles: 500, replicates: 3}
sweeps:
"""
StudyFrom = Callable[..., LoadedStudy]


def choose(*_: object) -> str:
    return "liggghts"


def points(study: LoadedStudy) -> list[Point]:
    return expand(study, choose)


def refusal(study_from: StudyFrom, text: str) -> str:
    with pytest.raises(ConfigError) as caught:
        study_from(text)
    return str(caught.value)


def test_pressures_and_adhesions_are_points_of_the_same_packings(study_from: StudyFrom) -> None:
    found = points(study_from(HEAD + "  - {csd: a, pressure_kPa: [10, 50, 200], adhesion_mJ_m2: [1, 10]}\n"))
    assert len({point.name for point in found}) == 6
    assert len({point.packings for point in found}) == 1
    rows = points_table(found)
    assert tuple(rows.columns) == (*POINT_COLUMNS, "replicates")
    assert sorted(zip(rows["pressure_kPa"], rows["adhesion_mJ_m2"], strict=True)) == [
        *itertools.product([10.0, 50.0, 200.0], [1.0, 10.0])
    ]
    assert set(rows["protocol"]) == {"filtration"} and set(rows["engine"]) == {"embedded"}
    assert set(rows["cohesion_kJ_m3"]) == {0.0}


def test_what_packs_otherwise_has_packings_of_its_own(study_from: StudyFrom) -> None:
    sweeps = "  - {csd: a, friction: [0, 0.3], adhesion_mJ_m2: [0, 10]}\n  - {csd: a, protocol: gravity}\n"
    found = points(study_from(HEAD + sweeps))
    assert len({point.packings for point in found}) == len(found) == 5
    (falling,) = (point for point in found if point.scene.protocol == "gravity")
    assert falling.packings == falling.name and falling.scene.cohesion == 50e3
    assert falling.scene.engine == "liggghts"
    row = falling.row()
    assert math.isnan(row["pressure_kPa"]) and math.isnan(row["adhesion_mJ_m2"])


def test_both_protocols_of_one_block(study_from: StudyFrom) -> None:
    sweep = "  - {csd: a, protocol: [gravity, filtration], pressure_kPa: [10, 50]}\n"
    found = points(study_from(HEAD + sweep))
    # a falling bed knows no pressure
    assert sorted(point.scene.protocol for point in found) == ["filtration", "filtration", "gravity"]


def test_the_most_packings_of_a_shared_folder_are_made(study_from: StudyFrom) -> None:
    sweeps = "  - {csd: a, replicates: 2}\n  - {csd: a, pressure_kPa: 10, replicates: 5}\n"
    (one,) = packed(points(study_from(HEAD + sweeps))).values()
    assert one.replicates == 5
    assert one.scene == one.scene.as_packed()


def test_the_pressure_is_the_filters_where_none_is_given(study_from: StudyFrom) -> None:
    text = HEAD.replace("pressure_kPa: 50, ", "").replace(
        "csds:",
        """\
crystallizer: {kinetics: ammonium_alum, slurry_concentration_kg_m3: 200, slurry_flow_m3_h: 20}
filter: {pressure_drop_kPa: 40, submerged_fraction: 0.3, rotation_rate_rpm: 0.2, medium_resistance_1_m: 5.0e+9}
csds:""",
    )
    (point,) = points(study_from(text + "  - {csd: a}\n"))
    assert point.scene.pressure == 40e3


def test_rows_at_the_base_are_those_of_the_studys_protocol(study_from: StudyFrom) -> None:
    sweeps = "  - {csd: a, adhesion_mJ_m2: [1, 10], pressure_kPa: [10, 50]}\n  - {csd: a, protocol: gravity}\n"
    study = study_from(HEAD + sweeps)
    table = points_table(points(study))
    (base,) = base_rows(study.model, table).to_dict("records")
    assert (base["protocol"], base["pressure_kPa"], base["adhesion_mJ_m2"]) == ("filtration", 50.0, 10.0)
    assert base["point"] == base_point(study, "a", choose).name
    assert sorted(base_rows(study.model, table, ("pressure_kPa",))["pressure_kPa"]) == [10.0, 50.0]
    both = base_rows(study.model, table, ("protocol",))
    assert sorted(both["protocol"]) == ["filtration", "gravity"]


def test_particles_follow_the_protocol(study_from: StudyFrom) -> None:
    wide = "a: {lognormal: {d10_um: 25, d50_um: 60, d90_um: 140}}"
    text = HEAD.replace("particles: 500, ", "").replace(
        "a: {mixture: [{size_um: 20, volume_fraction: 0.5}, {size_um: 50, volume_fraction: 0.5}]}", wide
    )
    falling, pressed = points(study_from(text + "  - {csd: a, protocol: [gravity, filtration]}\n"))
    # no depth is needed where there is no floor and no surface
    assert 2000 <= pressed.scene.particles < 0.5 * falling.scene.particles
    side = (pressed.scene.particles * pressed.scene.csd.mean_particle_volume / 0.7) ** (1.0 / 3.0)
    assert side >= 3.29 * pressed.scene.csd.largest


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("pressure_kPa: 50, ", "", ["packing.pressure_kPa", "(missing)", "must be given with protocol: filtration"]),
        ("pressure_kPa: 50", "pressure_kPa: 0", ["packing.pressure_kPa", "greater than or equal to 0.001"]),
        ("pressure_kPa: 50", "pressure_kPa: 1e9", ["packing.pressure_kPa", "less than or equal to 10000"]),
        ("pressure_kPa: 50", "pressure_kPa: 9000", ["packing.pressure_kPa", "must be at most 469 kPa at E = 3 GPa"]),
        ("adhesion_mJ_m2: 10", "youngs_modulus_GPa: 0.001", ["packing.pressure_kPa", "at E = 0.001 GPa"]),
        ("adhesion_mJ_m2: 10", "adhesion_mJ_m2: 2000", ["material.adhesion_mJ_m2", "more than the pressure of 50 kPa"]),
        ("adhesion_mJ_m2: 10", "adhesion_mJ_m2: 1000", ["material.adhesion_mJ_m2", "contacts are pulled out of shape"]),
        ("adhesion_mJ_m2: 10", "adhesion_mJ_m2: -1", ["material.adhesion_mJ_m2", "greater than or equal to 0"]),
        ("particles: 500", "particles: 50", ["packing.particles", "a cell of", "of its largest spheres"]),
        ("adhesion_mJ_m2: 10", "friction: 2.5", ["material.friction", "less than or equal to 2"]),
        ("adhesion_mJ_m2: 10", "friction: 0.3, restitution: 0.1", ["material.restitution", "must be at least 0.2"]),
        ("replicates: 3", "time_step_rayleigh: 0.9", ["packing.time_step_rayleigh", "must be at most 0.5"]),
        ("replicates: 3", "engine: liggghts", ["packing.engine", "cakes are pressed by the embedded engine"]),
        ("protocol: filtration, pressure_kPa: 50", "protocol: gravity", ["material.adhesion_mJ_m2", "needs protocol"]),
        ("protocol: filtration", "protocol: filtering", ["packing.protocol", "did you mean filtration"]),
    ],
)
def test_hostile_values_are_refused_with_a_reason(study_from: StudyFrom, old: str, new: str, says: list[str]) -> None:
    assert old in HEAD
    sweep = "  - {csd: a}\n"
    if "adhesion_mJ_m2: 1000" in new:
        sweep = "  - {csd: a, pressure_kPa: 400}\n"
    message = refusal(study_from, HEAD.replace(old, new) + sweep)
    for words in says:
        assert words in message, message


@pytest.mark.parametrize(
    ("sweep", "says"),
    [
        ("{csd: a, cohesion_kJ_m3: [0, 50]}", "sweeps[0].cohesion_kJ_m3"),
        ("{csd: a, protocol: gravity, pressure_kPa: 20}", "sweeps[0].pressure_kPa"),
        ("{csd: a, protocol: [gravity], adhesion_mJ_m2: [1, 2]}", "sweeps[0].adhesion_mJ_m2"),
        ("{csd: a, pressure_kPa: [50, 5000]}", "sweeps[0].pressure_kPa[1]"),
        ("{csd: a, protocol: falling}", "sweeps[0].protocol"),
    ],
)
def test_sweeps_that_make_no_sense_are_named(study_from: StudyFrom, sweep: str, says: str) -> None:
    assert says in refusal(study_from, f"{HEAD}  - {sweep}\n")


def test_the_finest_crystals_are_allowed_under_enough_pressure(study_from: StudyFrom) -> None:
    """1 um and 10 mJ/m2: the contacts hold 12 kPa, and the cake is compressible."""
    (point,) = points(study_from(HEAD + "  - {csd: fine, pressure_kPa: 100}\n"))
    assert point.scene.strength == pytest.approx(3.0 * np.pi / 8.0 * 1e-2 / 1e-6)
    assert point.scene.load_over_strength == pytest.approx(8.49, abs=0.01)


def test_an_export_is_that_of_the_shared_packings(study_from: StudyFrom, tmp_path: Path) -> None:
    study = study_from(HEAD.replace("particles: 500", "particles: 150") + "  - {csd: a, pressure_kPa: [10, 50]}\n")
    first, second = points(study)
    found = [
        api.export(str(study.path), point.name, tmp_path / "results", tmp_path / f"out{k}")
        for k, point in enumerate((first, second))
    ]
    assert found[0].point == found[1].point == first.packings
    assert "cloud.npz" not in (found[0].folder / "README.md").read_text(encoding="utf-8")
    scenes = [json.loads((item.folder / "packing.json").read_text(encoding="utf-8"))["scene"] for item in found]
    assert scenes[0] == scenes[1] and scenes[0]["protocol"] == "filtration"
