"""An exported packing: stands alone, reruns to the same bed, and never reaches outside its folders."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.cli.commands import main
from filtercake.crystals.csd import to_table
from filtercake.packing.pack import pack_replicates
from filtercake.packing.result import Packing
from filtercake.run.provenance import packing_code
from filtercake.study import engine_choice
from filtercake.study.loading import load_study
from filtercake.study.points import Point, expand

STUDY = """
csds: {mine: {mixture: [{size_um: 30, volume_fraction: 0.5}, {size_um: 50, volume_fraction: 0.5}]}}
material: {density_kg_m3: 1180}
packing: {particles: 200, replicates: 2, engine: %s}
sweeps: [{csd: [mine]}]
"""

Capture = pytest.CaptureFixture[str]


def write_study(folder: Path, engine: str) -> tuple[Path, Point]:
    path = folder / "tiny.yaml"
    path.write_text(STUDY % engine, encoding="utf-8")
    (point,) = expand(load_study(path), engine_choice.choose)
    return path, point


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Point]:
    """A study that was run: one packing accepted, one made out to have failed, and a log."""
    home = tmp_path_factory.mktemp("made")
    path, point = write_study(home, "embedded")
    csd, results = load_study(path).csds["mine"], home / "results" / "tiny"
    folder = results / "packings" / point.name
    pack_replicates(point.scene, 1, folder, packing_code("embedded"))
    manifest = json.loads((folder / "replicates.json").read_text())
    lost = {"replicate": 1, "status": "failed", "reason": "the bed exploded", "seed": 3, "sha256": "", "attempts": 1}
    manifest["replicates"].append(lost)
    (folder / "replicates.json").write_text(json.dumps(manifest))
    (folder / "r1.failed").mkdir()
    (folder / "r1.failed" / "screen.log").write_text("ERROR")
    (folder / "r1.failed" / "packing.in").symlink_to("/etc/passwd")
    (results / "logs" / "packing").mkdir(parents=True)
    (results / "logs" / "packing" / f"{point.name}.log").write_text("packed")
    (results / "csd").mkdir()
    to_table(csd.full, csd.truncated).to_csv(results / "csd" / "mine.csv", index=False)
    return path, point


def run(made: tuple[Path, Point], output: Path, *more: str) -> int:
    path, point = made
    results = ["--results", str(path.parent / "results")]
    return main(["export", str(path), point.name, *results, "--output", str(output), *more])


def test_an_export_reruns_to_the_same_bed(made: tuple[Path, Point], tmp_path: Path, capsys: Capture) -> None:
    assert run(made, tmp_path / "out", "--replicate", "0") == 0
    capsys.readouterr()
    assert main(["rerun", str(tmp_path / "out"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["porosity"] == found["first_porosity"]
    first, again = (Packing.load(tmp_path / "out" / place / "r0.npz") for place in ("as_run", "rerun"))
    np.testing.assert_array_equal(first.position, again.position)
    assert first.diagnostics["seed"] == again.diagnostics["seed"]


def test_an_export_holds_all_that_a_report_needs(made: tuple[Path, Point], tmp_path: Path) -> None:
    assert run(made, tmp_path / "out") == 0  # the first that failed
    names = {str(path.relative_to(tmp_path / "out")) for path in (tmp_path / "out").rglob("*") if path.is_file()}
    log = f"as_run/{made[1].name}.log"
    own = {"README.md", "packing.json", "versions.json", "study.yaml", "distribution.csv", "cloud.npz"}
    assert names == {*own, log, "as_run/replicates.json", "as_run/failed/screen.log"}
    text = (tmp_path / "out" / "README.md").read_text()
    assert "replicate 1" in text
    assert "the bed exploded" in text
    assert "filtercake rerun ." in text
    assert json.loads((tmp_path / "out" / "versions.json").read_text())["versions"]["numpy"] == np.__version__


@pytest.mark.parametrize("engine", ["liggghts", "liggghts_as_published"])
def test_an_export_for_liggghts_holds_the_deck(engine: str, tmp_path: Path) -> None:
    path, point = write_study(tmp_path, engine)
    out = tmp_path / "out"
    assert main(["export", str(path), point.name, "--results", str(tmp_path), "--output", str(out)]) == 0
    assert "run" in (out / "packing.in").read_text()
    assert (out / "cloud.data").exists() == (engine == "liggghts")
    assert "liggghts -echo screen -in packing.in" in (out / "README.md").read_text()


@pytest.mark.parametrize("replaced", ["study", "point", "replicate", "output"])
@pytest.mark.parametrize("name", ["../../etc", "/etc/passwd", "a/b", "..", ".", "", "$(id)", "no\nsuch", "tiny"])
def test_names_that_leave_the_folder_are_refused(
    replaced: str, name: str, made: tuple[Path, Point], tmp_path: Path, capsys: Capture
) -> None:
    path, point = made
    words = {"study": str(path), "point": point.name, "replicate": "0", "output": str(tmp_path)}
    words[replaced] = str(tmp_path) if replaced == "output" else name
    if replaced != "output":
        words["output"] = str(tmp_path / "out")
    options = [f"--replicate={words['replicate']}", f"--output={words['output']}"]
    assert main(["export", words["study"], words["point"], f"--results={path.parent / 'results'}", *options]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@given(key=st.sampled_from(["scene", "replicate", "size", "volume_fraction", "engine", "particles"]), value=VALUES)
def test_a_spoiled_export_is_refused_or_fails_in_one_line(
    made: tuple[Path, Point], tmp_path_factory: pytest.TempPathFactory, key: str, value: object
) -> None:
    folder = tmp_path_factory.mktemp("spoiled") / "out"
    assert run(made, folder, "--replicate", "0") == 0
    found = json.loads((folder / "packing.json").read_text())
    (found if key in found else found["scene"])[key] = value
    found["scene"] = {**found["scene"], "particles": "many"} if isinstance(found["scene"], dict) else found["scene"]
    (folder / "packing.json").write_text(json.dumps(found))
    assert main(["rerun", str(folder)]) == 2


def test_a_folder_without_an_export_is_refused(tmp_path: Path, capsys: Capture) -> None:
    assert main(["rerun", str(tmp_path)]) == 2
    assert "packing.json: cannot be read" in capsys.readouterr().err
