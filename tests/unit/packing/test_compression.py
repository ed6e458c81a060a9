"""Pressed cakes: the loads of one cell, and the porosity between them."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.errors import PackingRejected
from filtercake.packing import contact_law
from filtercake.packing.compression import LOADS, CompressionCurve, press_cake, stages
from filtercake.packing.pack import pack
from filtercake.packing.porosity import measure
from filtercake.packing.result import Packing
from filtercake.packing.scene import Scene

PRESSED = {"protocol": "filtration", "pressure": 5e4, "crystal_modulus": 3e9, "particles": 150, "cohesion": 0.0}


@pytest.mark.parametrize("kind", [{"adhesion": 1e-2}, {"cohesion": 5e4}])
def test_each_stage_has_its_load_and_is_rigid(make_scene: Callable[..., Scene], kind: dict[str, float]) -> None:
    scene = make_scene(**{**PRESSED, **kind}).as_packed()
    found = stages(scene, LOADS, 7)
    for load, cell in zip(LOADS, found, strict=True):
        held = cell.strength
        assert (cell.stress / held if held else math.inf) == pytest.approx(load, rel=1e-9)
        assert cell.stress <= 3.5e-5 * cell.modulus * (1.0 + 1e-9)
        assert (cell.adhesion > 0.0) == ("adhesion" in kind and math.isfinite(load))
        assert (cell.cohesion > 0.0) == ("cohesion" in kind and math.isfinite(load))
    stress = [cell.stress for cell in found]
    assert stress == sorted(stress)
    assert {cell.seed for cell in found} == {7}


class TestCurve:
    CURVE = CompressionCurve(np.array(LOADS), np.linspace(0.45, 0.36, len(LOADS)))

    def test_goes_through_what_was_found(self) -> None:
        assert np.allclose(self.CURVE.at(self.CURVE.load), self.CURVE.porosity, atol=1e-14)

    def test_is_flat_below_the_first_load(self) -> None:
        assert self.CURVE.at(np.array([0.01, 0.5, 1.0])) == pytest.approx([0.45] * 3)

    @given(st.lists(st.floats(1.0, 1e9), min_size=2, max_size=9))
    def test_falls_as_its_points_do(self, loads: list[float]) -> None:
        found = self.CURVE.at(np.sort(loads))
        assert (np.diff(found) <= 1e-12).all()
        assert ((found >= 0.36 - 1e-12) & (found <= 0.45 + 1e-12)).all()

    def test_a_load_left_out_is_found_again(self) -> None:
        """The curve of a fit of pressed PMMA: 0.3354 + 0.1453 / (1 + (x/1.54)^0.911)."""

        def fit(x: np.ndarray) -> np.ndarray:
            return 0.3354 + 0.1453 / (1.0 + (x / 1.54) ** 0.911)

        curve = CompressionCurve(np.array(LOADS), fit(np.array(LOADS)))
        between = np.geomspace(1.0, 4096.0, 200)
        assert np.abs(curve.at(between) - fit(between)).max() < 6e-4

    def test_a_settled_packing_has_none(self) -> None:
        with pytest.raises(PackingRejected, match="no loads"):
            CompressionCurve.of({"engine": "embedded"})


def test_a_cake_is_packed_measured_and_read_back(make_scene: Callable[..., Scene], tmp_path: Path) -> None:
    scene = make_scene(**{**PRESSED, "adhesion": 1e-2}).as_packed()
    made = pack(scene, 0, tmp_path)
    made.save(tmp_path / "r0.npz")
    read = Packing.load(tmp_path / "r0.npz")
    curve = CompressionCurve.of(read.diagnostics)
    assert curve.load.tolist() == list(LOADS)
    assert curve.porosity[0] > curve.porosity[-1]
    assert ((curve.porosity > 0.2) & (curve.porosity < 0.6)).all()
    assert measure(read, scene).interior == curve.porosity[-1]
    # the geometry is that of the last load; its spheres overlap a little
    solids = 4.0 / 3.0 * np.pi * np.sum(read.radius**3)
    touching = read.diagnostics["overlap_mean"]
    rigid = 1.0 - solids / read.length**3
    assert curve.porosity[-1] == pytest.approx(rigid + 3.0 * (1.0 - rigid) * touching, abs=1e-12)
    assert ((read.position >= 0.0) & (read.position < read.length)).all()
    assert read.diagnostics["protocol"] == "filtration"


def test_without_attraction_one_load_is_enough(make_scene: Callable[..., Scene]) -> None:
    found = press_cake(make_scene(**PRESSED).as_packed(), 0, 3)
    curve = CompressionCurve.of(found.diagnostics)
    assert curve.load.tolist() == [math.inf]
    assert np.array_equal(curve.at(np.array([2.0, 1e5, math.inf])), np.full(3, curve.porosity[0]))


def test_a_cell_that_does_not_come_to_rest_says_at_which_load(
    make_scene: Callable[..., Scene], monkeypatch: pytest.MonkeyPatch
) -> None:
    from filtercake.packing import compression

    def impatient(scene: Scene, loads: tuple[float, ...], seed: int) -> list[object]:
        from dataclasses import replace

        return [replace(cell, patience=1000) for cell in stages(scene, loads, seed)]

    monkeypatch.setattr(compression, "stages", impatient)
    with pytest.raises(PackingRejected, match=r"load 1: .*"):
        press_cake(make_scene(**{**PRESSED, "adhesion": 1e-2}).as_packed(), 0, 3)


def test_strength_is_that_of_the_attraction(make_scene: Callable[..., Scene]) -> None:
    sticky = make_scene(**{**PRESSED, "adhesion": 1e-2})
    assert sticky.strength == pytest.approx(3.0 * math.pi / 8.0 * 1e-2 / sticky.csd.sauter_mean)
    assert sticky.load_over_strength == pytest.approx(5e4 / sticky.strength)
    cohesive = make_scene(**{**PRESSED, "cohesion": 5e4})
    assert cohesive.strength == contact_law.cohesive_strength(5e4, cohesive.youngs_modulus, cohesive.poisson_ratio)
    assert make_scene(**PRESSED).load_over_strength == math.inf
