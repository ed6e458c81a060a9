"""Columns under raised gravity: the deck, what is read off them, and one that LIGGGHTS makes."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from filtercake.errors import EngineError, EngineMissing
from filtercake.packing import contact_law
from filtercake.packing.cell import FRICTIONAL_STEP, FRICTIONLESS_STEP
from filtercake.packing.cloud import make_cloud
from filtercake.packing.engines.base import SettleRequest
from filtercake.packing.result import SettledState
from filtercake.packing.settling import StopRule, Trajectory
from filtercake.units import GRAVITY, FloatArray
from filtercake.validation import pressure, pressure_column
from filtercake.validation.pressure_column import (
    BALANCE,
    CHECK_STEPS,
    EDGES,
    FLOOR_LOAD,
    RISE,
    SLICES,
    Column,
    ColumnEngine,
    floor_stress,
    heights,
    press_column,
    refusals,
    slices,
)

UM = 1e-6
LAYERS, ACROSS = 60, 4
SOFT = 5e-3
"""Overlap of the lattice's spheres over their diameter."""


def column_of(sizes: dict[float, float], particles: int, friction: float = 0.0, **options: Any) -> Column:
    scene = pressure.bed({"mixture": sizes}, friction=friction, particles=particles, **options)
    share = FRICTIONAL_STEP if friction else FRICTIONLESS_STEP
    return Column(replace(scene, engine="liggghts").with_time_step(share)).without_impact()


def lattice(**changed: Any) -> tuple[Column, SettledState]:
    """A simple cubic lattice of 20 um spheres, 60 layers high, every two of which make one more of x."""
    column, pitch = column_of({20.0: 1.0}, LAYERS * ACROSS**2), 20.0 * UM * (1.0 - SOFT)
    index = np.stack(np.meshgrid(np.arange(ACROSS), np.arange(ACROSS), np.arange(LAYERS), indexing="ij"), axis=-1)
    position = (index.reshape(-1, 3) + 0.5) * pitch
    nothing = np.zeros(1)
    values = {
        "position": position,
        "velocity": np.zeros_like(position),
        "radius": np.full(len(position), 10.0 * UM),
        "length": ACROSS * pitch,
        "trajectory": Trajectory(nothing, nothing, nothing, nothing),
        "steps": 1,
        "expected": len(position),
        "dangerous_builds": 0,
        "engine": "liggghts",
        "engine_version": "3.8",
        **changed,
    }
    return column, SettledState(**values)


def test_a_lattice_has_its_loads_at_its_layers() -> None:
    column, state = lattice()
    per_layer = FLOOR_LOAD / LAYERS
    found = heights(column, state, np.array(EDGES))
    # hardly anything lies at the edge of a layer: its height is not sharp to the last digit
    assert found / (state.length / ACROSS) == pytest.approx(LAYERS - np.array(EDGES) / per_layer, abs=0.02)


def test_a_lattice_is_corrected_to_rigid_spheres_as_a_cell_is() -> None:
    column, state = lattice()
    found = slices(column, state)
    solids = math.pi / 6.0 / (1.0 - SOFT) ** 3
    assert [row["load"] for row in found] == list(SLICES)
    assert [row["stress_Pa"] for row in found] == pytest.approx([load * column.strength for load in SLICES])
    assert [row["porosity"] for row in found] == pytest.approx([1.0 - solids + 3.0 * solids * SOFT] * 3, abs=1e-3)
    assert [row["coordination"] for row in found] == [6.0] * 3
    # a third of the correction would be missed
    assert solids * SOFT > 2.5e-3


def test_the_floor_balances_cohesion_at_the_closed_forms_overlap() -> None:
    given, state = lattice()
    scene = replace(given.scene, cohesion=20e3)
    column = replace(given, scene=scene)
    material = scene.youngs_modulus, scene.poisson_ratio
    balance = contact_law.equilibrium_overlap(scene.cohesion, *material, 10.0 * UM, 1e3)

    def stress(depth: float) -> float:
        place = state.position.copy()
        place[:, 2] += 10.0 * UM
        place[0, 2] = 10.0 * UM - depth
        return floor_stress(column, replace(state, position=place)) * state.length**2

    pull_off = contact_law.pull_off_force(scene.cohesion, *material, 10.0 * UM, 1e3)
    assert abs(stress(balance)) < 0.01 * pull_off
    assert stress(4.0 / 9.0 * balance) == pytest.approx(-pull_off, rel=5e-3)
    assert stress(-1e-9) == 0.0


def carrying(column: Column, state: SettledState) -> SettledState:
    """The lattice lowered until the floor carries its weight."""
    low, high = 0.0, 0.5 * UM
    for _ in range(60):
        depth = 0.5 * (low + high)
        moved = replace(state, position=state.position - [0.0, 0.0, depth - SOFT * 10.0 * UM])
        low, high = (depth, high) if floor_stress(column, moved) < column.load * column.strength else (low, depth)
    return moved


def test_a_column_at_rest_is_accepted() -> None:
    column, state = lattice()
    assert refusals(column, carrying(column, state)) == []


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"dangerous_builds": 2}, "2 neighbour lists were built late"),
        ({"position": np.full((LAYERS * ACROSS**2, 3), math.nan)}, "not all at finite places"),
        ({"radius": np.full(7, 10.0 * UM)}, "960 spheres were put in, and 7 came out"),
    ],
)
def test_a_column_that_is_none_is_refused(changed: dict[str, Any], said: str) -> None:
    column, state = lattice()
    (found,) = refusals(column, replace(carrying(column, state), **changed))
    assert said in found


def test_a_column_whose_weight_is_not_on_its_contacts_is_refused() -> None:
    column, state = lattice()
    resting = carrying(column, state)
    drag = pressure_column.DRAG * column.rate(SLICES[-1])
    terminal = column.gravity(FLOOR_LOAD, state.radius, state.length) / drag
    for share, count in ((0.9 * BALANCE, 0), (1.1 * BALANCE, 1)):
        velocity = np.zeros_like(state.velocity)
        velocity[:, 2] = -share * terminal
        found = refusals(column, replace(resting, velocity=velocity))
        assert len(found) == count and all(text.startswith("drag carries") for text in found)
    (found,) = refusals(column, state)
    assert found.startswith("the floor's contacts miss")


def test_slices_at_the_ends_are_refused() -> None:
    column, state = lattice()
    wide = replace(state, radius=state.radius * np.where(np.arange(state.radius.size) == 0, 8.0, 1.0))
    assert any(text.startswith("the slices lie at") for text in refusals(column, wide))


def test_gravity_rises_by_no_more_than_a_factor_to_the_load_on_the_floor() -> None:
    column = column_of({20.0: 0.5, 50.0: 0.5}, 300)
    loads = np.array(column.loads())
    assert loads[-1] == FLOOR_LOAD and loads[0] <= 1.0 + 1e-12
    assert loads[1:] / loads[:-1] == pytest.approx(np.full(loads.size - 1, RISE))
    radius = np.full(100, 10.0 * UM)
    mass = 100 * column.scene.density * 4.0 / 3.0 * math.pi * (10.0 * UM) ** 3
    stress = mass * column.gravity(6.0, radius, 1e-4) / 1e-4**2
    assert stress == pytest.approx(6.0 * column.strength)
    assert column.scene.density * column.scene.settling_velocity**2 < 0.11 * column.strength


def deck_of(column: Column, folder: Path) -> tuple[list[str], FloatArray]:
    scene = column.scene
    cloud = make_cloud(scene.csd, scene.particles, scene.initial_void_fraction, 1, scene.bed_depth_factor)
    rule = StopRule.for_bed(scene, cloud.length)
    ColumnEngine(column).write_input(SettleRequest(scene, cloud, rule, 1, folder, lambda _: None))
    assert (folder / "cloud.data").exists()
    return (folder / "packing.in").read_text(encoding="utf-8").splitlines(), cloud.radius


def test_the_deck_drags_every_sphere_by_its_mass_and_raises_gravity(tmp_path: Path) -> None:
    column = column_of({20.0: 0.5, 50.0: 0.5}, 300)
    lines, radius = deck_of(column, tmp_path)
    groups = [line.split()[-1].split(":") for line in lines if line.startswith("group ")]
    sizes = [radius[int(first) - 1 : int(last)] for first, last in groups]
    assert sum(part.size for part in sizes) == 300 and all(np.ptp(part) == 0.0 for part in sizes)
    drags = np.array([float(line.split()[-1]) for line in lines if line.startswith("fix drag")]).reshape(-1, len(sizes))
    assert drags[:, 0] / drags[:, 1] == pytest.approx((sizes[0][0] / sizes[1][0]) ** 3)
    gravity = np.array([float(line.split()[4]) for line in lines if line.startswith("fix gravity")])
    # um/us2
    assert gravity[0] == pytest.approx(GRAVITY * 1e-6)
    assert gravity[1:] == pytest.approx(gravity[-1] * np.array(column.loads()) / FLOOR_LOAD)
    # under drag, spheres of all sizes settle at one speed: pg um/us2 over pg/us
    mass = column.scene.density * 1e-3 * 4.0 / 3.0 * math.pi * (sizes[0][0] / UM) ** 3
    assert mass * gravity[0] / drags[0, 0] == pytest.approx(column.scene.settling_velocity)
    assert sum(line.startswith("unfix") for line in lines) == 3 * (gravity.size - 1)


def test_a_deck_that_fails_is_a_row_for_each_slice_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: Any, **__: Any) -> None:
        raise EngineError("LIGGGHTS: no such pair style")

    column = column_of({20.0: 1.0}, 100)
    monkeypatch.setattr(pressure_column, "settle", fails)
    found = press_column(column)
    assert [(row["load"], row["porosity"]) for row in found] == [(load, None) for load in SLICES]
    assert {row["reason"] for row in found} == {"LIGGGHTS: no such pair style"}

    def is_missing(*_: Any, **__: Any) -> None:
        raise EngineMissing("LIGGGHTS is not installed")

    monkeypatch.setattr(pressure_column, "settle", is_missing)
    with pytest.raises(EngineMissing):
        press_column(column)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_column_of_one_size_is_randomly_packed(liggghts: str, friction: float) -> None:
    assert liggghts
    found = press_column(column_of({30.0: 1.0}, 400, friction, bed_depth_factor=3.0))
    assert all(row["reason"] == "" for row in found), found
    assert found[-1]["steps"] > 2 * CHECK_STEPS and found[-1]["seconds"] > 0.0
    # 0.36 and 0.43 without cohesion: at x = 10 a little more, in slices of a hundred spheres
    assert found[-1]["porosity"] == pytest.approx(0.45 if friction else 0.37, abs=0.03)
    assert found[0]["coordination"] > 3.5
