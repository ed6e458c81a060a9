"""Spheres of a user's own: what is read, and that every mistake is named with file, key, value and what is allowed."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from filtercake.errors import ConfigError
from filtercake.packing.own_spheres import check_spheres, read_spheres

UM = 1e-6
NAN = float("nan")


def lattice(layers: int = 5, side: int = 3, radius: float = 20 * UM) -> dict[str, Any]:
    """A simple cubic bed of touching spheres on the floor."""
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in (side, side, layers)), indexing="ij"), axis=-1).reshape(-1, 3)
    position = (2.0 * grid + 1.0) * radius
    return {"position": position, "radius": np.full(len(position), radius), "length": 2.0 * side * radius}


def cell() -> dict[str, Any]:
    return {"position": np.full((1, 3), 20 * UM), "radius": np.array([18 * UM]), "box": np.full(3, 40 * UM)}


def refused(arrays: dict[str, Any]) -> str:
    with pytest.raises(ConfigError) as caught:
        check_spheres(arrays, "mine.npz")
    return str(caught.value)


def changed(arrays: dict[str, Any], key: str, place: Any, value: float) -> dict[str, Any]:
    array = np.array(arrays[key])
    array[place] = value
    return {**arrays, key: array}


def test_a_bed_and_a_cell_are_taken_as_they_are(tmp_path: Path) -> None:
    for arrays, is_bed in ((lattice(), True), (cell(), False)):
        np.savez(tmp_path / "mine.npz", **arrays, velocity=arrays["position"])
        found = read_spheres(tmp_path / "mine.npz")
        assert np.array_equal(found.position, arrays["position"]) and np.array_equal(found.radius, arrays["radius"])
        assert (found.box is None) == is_bed
        assert found.length == (arrays["length"] if is_bed else arrays["box"][0])
        assert found.density is None and found.origin.endswith("mine.npz")


def test_lists_and_narrow_floats_are_numbers() -> None:
    assert check_spheres({key: value.tolist() for key, value in cell().items()}, "x").length == 40 * UM
    narrow = {key: np.asarray(value, dtype=np.float32) for key, value in cell().items()}
    assert check_spheres(narrow, "x").position.dtype == np.float64


@pytest.mark.parametrize(
    ("arrays", "said"),
    [
        ({}, "position = (missing): must be given, shape (n, 3), in m; there is nothing"),
        ({"positions": [], "radius": [1.0]}, "there is positions, radius; did you mean positions?"),
        ({**cell(), "length": 1.0}, "length = (both): must be exactly one of length"),
        ({key: cell()[key] for key in ("position", "radius")}, "length = (missing): must be exactly one of length"),
        ({**cell(), "radius": ["a"]}, "radius = ['a']: must be numbers"),
        ({**cell(), "radius": [[1.0], [1.0, 2.0]]}, "must be numbers"),
        ({**cell(), "radius": np.array([1j])}, "must be numbers"),
        ({**cell(), "position": np.zeros((3, 1))}, "position = array of shape (3, 1): must be (n, 3), n at least 1"),
        ({**cell(), "position": np.zeros((0, 3))}, "position = array of shape (0, 3): must be (n, 3), n at least 1"),
        ({**cell(), "radius": 1.0}, "radius = array of shape (): must be (n,), n at least 1"),
        ({**cell(), "box": 1.0}, "box = array of shape (): must be (3,)"),
        ({**lattice(), "length": [1.0, 1.0]}, "length = array of shape (2,): must be one number"),
        ({**cell(), "radius": [1e-5, 1e-5]}, "radius = 2 values: must be as many as positions: 1"),
        (changed(lattice(), "position", (4, 1), NAN), "position[4][1] = nan: must be a finite number"),
        (changed(lattice(), "radius", 3, NAN), "radius[3] = nan: must be above 0 and at most 0.1 m"),
        (changed(lattice(), "radius", 3, -1e-5), "radius[3] = -1e-05: must be above 0 and at most 0.1 m"),
        ({**lattice(), "radius": np.full(45, 20.0)}, "at most 0.1 m; is it in um or mm? (45 such values)"),
        ({**lattice(), "length": -1.0}, "length = -1: must be at least the largest sphere's diameter"),
        ({**lattice(), "length": NAN}, "length = nan: must be"),
        (changed(cell(), "box", 1, np.inf), "box[1] = inf: must be"),
        (
            changed(cell(), "box", 1, 30 * UM),
            "box[1] = 3e-05: must be at least the largest sphere's diameter, 3.6e-05 m",
        ),
        (changed(cell(), "box", 2, 60 * UM), "box[2] = 6e-05: must be a whole multiple of the first side, 4e-05 m"),
        (
            changed(cell(), "position", (0, 2), 41 * UM),
            "position[0][2] = 4.1e-05: must be in the box, 0 to 4e-05 x 4e-05",
        ),
        (changed(lattice(), "position", (7, 0), -UM), "position[7][0] = -1e-06: must be in the box, 0 to 0.00012 x"),
        ({**lattice(), "position": lattice()["position"] + [0, 0, 1e-3]}, "must lie on a floor at z = 0"),
        ({**lattice(), "position": lattice()["position"] - [0, 0, 1e-4]}, "must lie on a floor at z = 0"),
        (lattice(layers=2), "position: the bed is too shallow"),
        ({**cell(), "box": np.full(3, 1.0)}, "box = 1: spheres of 2.44e-14 of the volume: must be 0.001 to 0.95"),
        ({**lattice(), "radius": lattice()["radius"] * 1.45}, "length = 0.00012: spheres of"),
    ],
)
def test_a_mistake_is_named(arrays: dict[str, Any], said: str) -> None:
    text = refused(arrays)
    assert said in text
    assert all(line.startswith("mine.npz: ") and len(line) < 300 for line in text.splitlines())


def test_all_problems_of_a_kind_are_said_at_once() -> None:
    text = refused({"radius": [1.0]})
    assert "position = (missing)" in text and "length = (missing)" in text
    text = refused(changed(changed(lattice(), "radius", 1, 0.0), "position", (2, 2), NAN))
    assert "radius[1]" in text and "position[2][2]" in text


def test_files_that_are_none_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def said(name: str) -> str:
        with pytest.raises(ConfigError) as caught:
            read_spheres(tmp_path / name)
        assert str(tmp_path / name) in str(caught.value)
        return str(caught.value)

    monkeypatch.setattr("filtercake.packing.own_spheres.LARGEST_FILE", 1_000_000)
    (tmp_path / "text.npz").write_text("position,radius\n")
    np.save(tmp_path / "array.npy", np.zeros(3))
    np.savez(tmp_path / "pickled.npz", position=np.array([{}]), radius=np.zeros(1), box=np.ones(3))
    os.mkfifo(tmp_path / "pipe.npz")
    np.savez(tmp_path / "whole.npz", **lattice())
    content = (tmp_path / "whole.npz").read_bytes()
    (tmp_path / "half.npz").write_bytes(content[: len(content) // 2])
    (tmp_path / "spoilt.npz").write_bytes(content[:200] + b"spoilt" + content[206:])
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("radius.npy", bytes(1_000_001))
    with zipfile.ZipFile(tmp_path / "header.npz", "w") as archive:
        archive.writestr("radius.npy", b"\x93NUMPY\x01\x00\x10\x00nonsense {{{{{{\n")
    assert "must be an .npz file" in said("text.npz")
    assert "must be an .npz file" in said("array.npy")
    assert "must be an .npz file" in said("half.npz")
    assert "must unpack to at most 1 MB" in said("bomb.npz")
    assert "not a device or a pipe" in said("pipe.npz")
    for name in ("pickled.npz", "spoilt.npz", "header.npz", "none.npz"):
        assert "cannot be read" in said(name)
