"""The scene: what decides a packing, its way through JSON, and what follows from its numbers."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from filtercake.crystals.csd import CrystalSizeDistribution, mixture
from filtercake.errors import CsdError
from filtercake.packing import contact_law
from filtercake.packing.cloud import make_cloud
from filtercake.packing.pack import pack_replicates
from filtercake.packing.scene import OF_FILTRATION, Scene

MakeScene = Callable[..., Scene]
INCIDENTAL: list[dict[str, Any]] = [{"processes": 2}, {"time_limit": 60.0}, {"write_vtk": True}]
DECISIVE: dict[str, Any] = {
    "csd": mixture([30e-6, 50e-6], [0.5 + 1e-15, 0.5 - 1e-15]),
    "particles": 301,
    "initial_void_fraction": 0.66,
    "settling_velocity": 0.02,
    "density": 1181.0,
    "youngs_modulus": 6e6,
    "poisson_ratio": 0.3,
    "restitution": 0.4,
    "friction": 0.1,
    "cohesion": 51e3,
    "time_step": 1e-7,
    "engine": "embedded",
    "seed": 2,
    "porosity_tolerance": 1e-5,
    "max_fall_times": 5.0,
    "skin": 1e-6,
    "bed_depth_factor": 2.0,
}


@pytest.mark.parametrize("change", INCIDENTAL)
def test_how_a_scene_is_run_decides_nothing(make_scene: MakeScene, change: dict[str, Any]) -> None:
    scene, other = make_scene(), make_scene(**change)
    assert other.decisive() == scene.decisive()
    assert (other, hash(other)) == (scene, hash(scene))
    assert other.as_dict() != scene.as_dict()


@pytest.mark.parametrize("name", DECISIVE)
def test_everything_else_decides(make_scene: MakeScene, name: str) -> None:
    assert make_scene(**{name: DECISIVE[name]}) != make_scene()


def test_no_number_is_forgotten() -> None:
    known = {*DECISIVE, *OF_FILTRATION, *(name for c in INCIDENTAL for name in c)}
    assert {field.name for field in dataclasses.fields(Scene)} == known


def test_what_only_pressed_cakes_have_decides_nothing_of_others(make_scene: MakeScene) -> None:
    pressed = {"pressure": 1e5, "adhesion": 1e-3, "crystal_modulus": 3e9}
    assert make_scene(**pressed) == make_scene()
    assert not {*OF_FILTRATION} & {*make_scene().decisive()}
    cake = make_scene(protocol="filtration", **pressed)
    assert cake != make_scene()
    for name, value in pressed.items():
        assert make_scene(**{"protocol": "filtration", **pressed, name: 1.5 * value}) != cake


def test_a_pressed_cell_serves_every_pressure_and_strength(make_scene: MakeScene) -> None:
    def packed(**changed: Any) -> Scene:
        given = {"protocol": "filtration", "pressure": 5e4, "adhesion": 1e-2, "crystal_modulus": 3e9, "cohesion": 0.0}
        return make_scene(**{**given, **changed}).as_packed()

    one = packed()
    assert one == packed(pressure=2e5) == packed(adhesion=1e-4) == packed(crystal_modulus=2e10) == one.as_packed()
    others = [
        packed(adhesion=0.0),
        packed(adhesion=0.0, cohesion=5e4),
        packed(friction=0.3),
        packed(seed=9),
        packed(particles=999),
        packed(restitution=0.9),
    ]
    assert len({one, *others}) == 7
    # the simulated modulus is the cell's own; the step over Rayleigh's is kept
    soft = make_scene(protocol="filtration", pressure=5e4, crystal_modulus=3e9, youngs_modulus=9e6)
    assert soft.as_packed().rayleigh_fraction == pytest.approx(soft.rayleigh_fraction, rel=1e-12)


def test_a_scene_survives_json_to_the_last_bit(make_scene: MakeScene) -> None:
    csd = CrystalSizeDistribution(np.array([1 / 3, 2 / 3]) * 1e-4, np.array([1 / 7, 6 / 7 + 1e-13]))
    scene = make_scene(csd=csd, time_step=1e-6 / 3, time_limit=7.0, processes=2, write_vtk=True)
    again = Scene.from_dict(json.loads(json.dumps(scene.as_dict())))
    assert again.as_dict() == scene.as_dict()
    assert (again.csd.volume_fraction == csd.volume_fraction).all()
    decisive = Scene.from_dict(json.loads(json.dumps(scene.decisive())))
    assert decisive == scene and decisive.time_limit == 0.0


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"particles": 2.5}, "particles = 2.5: must be a finite int"),
        ({"particles": True}, "particles = True"),
        ({"time_step": math.nan}, "time_step = nan"),
        ({"density": "heavy"}, "density = 'heavy': must be a finite float"),
        ({"engine": None}, "engine = None"),
        ({"magic": 1}, "magic"),
        ({"size": [1e-5, "large"]}, "large"),
        ({"size": [1e-5]}, "1 sizes but 2 volume fractions"),
        ({"volume_fraction": [0.5, 0.9]}, "sum to 1.4"),
    ],
)
def test_what_is_no_scene_is_refused(make_scene: MakeScene, change: dict[str, Any], says: str) -> None:
    with pytest.raises((CsdError, TypeError, ValueError), match=says):
        Scene.from_dict({**make_scene().as_dict(), **change})


@pytest.mark.parametrize("name", ["size", "volume_fraction", "friction", "engine"])
def test_what_is_missing_is_named(make_scene: MakeScene, name: str) -> None:
    with pytest.raises((TypeError, ValueError), match=name):
        Scene.from_dict({key: value for key, value in make_scene().as_dict().items() if key != name})


def test_a_time_step_follows_from_a_rayleigh_fraction(make_scene: MakeScene) -> None:
    scene = make_scene(csd=mixture([20e-6, 50e-6], [0.5, 0.5]))
    assert scene.rayleigh_time_step == contact_law.rayleigh_time_step(10e-6, 1180.0, 5e6, 0.2)
    assert scene.with_time_step(0.25).rayleigh_fraction == pytest.approx(0.25, rel=1e-14)
    stiffer = dataclasses.replace(scene, youngs_modulus=20e6)
    assert stiffer.with_time_step(0.25).time_step == pytest.approx(0.5 * scene.with_time_step(0.25).time_step)


def test_the_box_is_that_of_the_cloud(make_scene: MakeScene) -> None:
    scene = make_scene(bed_depth_factor=1.5)
    cloud = make_cloud(scene.csd, scene.particles, scene.initial_void_fraction, 1, scene.bed_depth_factor)
    assert (scene.box_length, scene.cloud_height) == (cloud.length, cloud.height)


def test_a_bed_stopped_by_its_limit_goes_on_from_its_state(make_scene: MakeScene, tmp_path: Path) -> None:
    scene = make_scene(particles=100, engine="embedded")
    (undisturbed,) = pack_replicates(scene, 1, tmp_path / "undisturbed", "code")
    (stopped,) = pack_replicates(dataclasses.replace(scene, time_limit=1e-9), 1, tmp_path / "point", "code")
    assert (stopped.status, stopped.may_pass, stopped.attempts) == ("failed", True, 1)
    assert "time limit" in stopped.reason
    (state,) = (tmp_path / "point").glob("r0.*.state.npz")
    lines: list[str] = []
    (outcome,) = pack_replicates(scene, 1, tmp_path / "point", "code", progress=lines.append)
    assert outcome.sha256 == undisturbed.sha256
    assert any(line.startswith("resumed at step") for line in lines)
    assert not state.exists()


def test_a_bed_that_failed_for_good_leaves_no_state(make_scene: MakeScene, tmp_path: Path) -> None:
    hasty = make_scene(particles=100, engine="embedded", max_fall_times=1.0, time_limit=1e-9)
    pack_replicates(hasty, 1, tmp_path, "code")
    assert list(tmp_path.glob("*.state.npz"))
    (outcome,) = pack_replicates(dataclasses.replace(hasty, time_limit=0.0), 1, tmp_path, "code")
    assert "not settled" in outcome.reason
    assert not list(tmp_path.glob("*.state.npz"))
