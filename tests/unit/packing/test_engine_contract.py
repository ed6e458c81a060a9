"""A new engine is one module and one line of the registry: everything else follows from what it says of itself."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path

import pandas as pd
import pytest
from matplotlib.figure import Figure

from filtercake import api
from filtercake.cli.commands import main
from filtercake.errors import ConfigError
from filtercake.figures import style
from filtercake.packing.engines import ENGINES, Engine, SettleRequest
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.result import SettledState
from filtercake.packing.scene import Scene
from filtercake.report.words import readable
from filtercake.study import engine_choice
from filtercake.study.config.packing import AUTO, Packing
from filtercake.study.estimate import fall_steps, packing_seconds
from filtercake.study.limits import refusals
from filtercake.study.loading import LoadedStudy, load_study
from filtercake.study.points import expand

SCENE = "packing: {particles: 200, replicates: 1, engine: toy}\n"


class Toy(Engine):
    """Settles as the embedded engine does, and reads an input of its own."""

    name = "toy"
    label = "toy engine"
    sphere_step = (1e-6, 3e-6)
    evidence = ("toy.txt",)
    by_hand = "toy toy.txt"

    def write_input(self, request: SettleRequest) -> None:
        (request.folder / "toy.txt").write_text(f"{request.scene.particles} spheres")

    def settle(self, request: SettleRequest) -> SettledState:
        self.write_input(request)
        return dataclasses.replace(Embedded().settle(request), engine=self.name)


@pytest.fixture(autouse=True)
def as_they_were() -> Iterator[None]:
    """Leave the engines in the order in which they were."""
    known = dict(ENGINES)
    yield
    ENGINES.clear()
    ENGINES.update(known)


@pytest.fixture(autouse=True)
def _registered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ENGINES, Toy.name, Toy)


@pytest.fixture
def toy_scene(study_from: Callable[..., LoadedStudy], good_study: str) -> Scene:
    """The scene of a study that names the toy."""
    (point,) = expand(study_from(good_study + SCENE), engine_choice.choose)
    return point.scene


def test_the_configuration_takes_it(
    toy_scene: Scene, study_from: Callable[..., LoadedStudy], good_study: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert toy_scene.engine == "toy"
    monkeypatch.delitem(ENGINES, Toy.name)
    with pytest.raises(ConfigError, match=r"packing\.engine = 'toy': allowed: 'auto', 'embedded', 'liggghts'"):
        study_from(good_study + SCENE)
    assert Packing.model_json_schema()["properties"]["engine"]["enum"] == [AUTO, *ENGINES]


def test_auto_takes_it_only_where_it_says_so(make_scene: Callable[..., Scene], monkeypatch: pytest.MonkeyPatch) -> None:
    scene = make_scene(engine=AUTO)
    monkeypatch.setenv("FILTERCAKE_LIGGGHTS", "/no/such/liggghts")
    ENGINES["embedded"] = ENGINES.pop("embedded")  # now after the toy
    assert engine_choice.choose(scene) == "embedded"
    monkeypatch.setattr(Toy, "suits", classmethod(lambda _cls, scene: scene.particles < 1000))
    assert engine_choice.choose(scene) == "toy"
    assert engine_choice.choose(make_scene(particles=1000)) == "embedded"
    monkeypatch.setattr(Toy, "why_missing", lambda _self: "lost")
    assert engine_choice.choose(scene) == "embedded"


def test_it_is_estimated_from_its_own_cost(toy_scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    usual = packing_seconds(dataclasses.replace(toy_scene, engine="embedded"))
    assert packing_seconds(toy_scene) == pytest.approx(usual * Toy.sphere_step[0] / Embedded.sphere_step[0])
    monkeypatch.setattr(Toy, "fixed_steps", 1000)
    assert fall_steps(toy_scene) == 1000
    assert packing_seconds(toy_scene) == pytest.approx(1e-6 * 200 * 1000)


def test_the_fence_knows_its_limit(toy_scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    assert not list(refusals(toy_scene))
    monkeypatch.setattr(Toy, "least_restitution", 0.5)
    (finding,) = refusals(toy_scene)
    assert "toy engine takes only more than 0.5" in finding.text


def test_an_engine_with_a_box_of_its_own_takes_no_other(
    study_from: Callable[..., LoadedStudy], good_study: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = good_study + SCENE.replace("engine", "bed_depth_factor: 2, engine")
    study_from(text)
    monkeypatch.setattr(Toy, "own_spheres", True)
    with pytest.raises(ConfigError, match="the engine toy has the paper's own box"):
        study_from(text)


def test_it_packs_and_is_shown_by_its_name(tmp_path: Path) -> None:
    source = api.distribution(mixture={30: 0.5, 50: 0.5})
    bed = api.pack(
        source, tmp_path / "bed", density_kg_m3=1180, particles=200, replicates=1, engine="toy", protocol="gravity"
    )
    assert (bed.failures, bed.summary["engine"]) == ((), "toy")
    assert api.porosity(bed.files[0]).engine == "toy"
    figure = Figure()
    style.footer(figure, pd.DataFrame({"engine": ["toy"], "n": [1], "n_failed": [0]}))
    assert "toy engine" in figure.get_supxlabel()
    assert readable(pd.DataFrame({"engine": ["toy"]}))[1] == [["toy engine"]]


def test_its_input_is_exported(write_study: Callable[..., Path], good_study: str, tmp_path: Path) -> None:
    study, out = write_study(good_study + SCENE), tmp_path / "out"
    (point,) = expand(load_study(study), engine_choice.choose)
    assert main(["export", str(study), point.name, "--results", str(tmp_path), "--output", str(out)]) == 0
    assert (out / "toy.txt").read_text() == "200 spheres"
    text = (out / "README.md").read_text()
    assert "`toy toy.txt`" in text and "| `toy.txt` | what the engine reads |" in text
