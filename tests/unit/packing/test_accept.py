"""Acceptance: one good bed is taken, and every kind of bad output is refused for the right reason."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from filtercake.errors import PackingRejected
from filtercake.packing.accept import _outside, accept, is_settled, overlap_limit
from filtercake.packing.result import SettledState
from filtercake.packing.settling import Trajectory

UM = 1e-6


def judge(case: SimpleNamespace, **changes: Any) -> dict[str, Any]:
    state = dataclasses.replace(case.state, **changes)
    return accept(state, case.scene, case.cloud, case.rule)


def refusal(case: SimpleNamespace, **changes: Any) -> PackingRejected:
    with pytest.raises(PackingRejected) as caught:
        judge(case, **changes)
    return caught.value


def changed(array: np.ndarray, index: Any, value: float) -> np.ndarray:
    copy = array.copy()
    copy[index] = value
    return copy


# --- the good one --------------------------------------------------------------------------------------------------


def test_a_good_bed_is_accepted_and_measured(settled_lattice: SimpleNamespace) -> None:
    found = judge(settled_lattice)
    assert found["particles"] == 150
    assert found["length_m"] == pytest.approx(200 * UM)
    assert found["bed_height_m"] == pytest.approx(240 * UM)
    assert found["steps"] == 3000
    assert found["settled"] is True
    assert found["overlap_max"] == pytest.approx(0.0, abs=1e-12)
    assert found["rms_speed_m_s"] == 0.0
    assert found["kinetic_energy_J"] < 1e-3 * found["peak_kinetic_energy_J"]
    assert len(found["trajectory"]["time_s"]) == len(found["trajectory"]["mean_height_m"]) == 30


def test_what_was_measured_is_plain_json(settled_lattice: SimpleNamespace) -> None:
    assert json.loads(json.dumps(judge(settled_lattice), allow_nan=False))["particles"] == 150


def test_contacts_are_counted_by_hand(settled_lattice: SimpleNamespace) -> None:
    # squeeze the lattice by 0.1 % of the diameter upwards only: each sphere overlaps its neighbours above and below,
    # 5 of 6 gaps per column: 2*5/6 contacts a sphere; sideways they just touch (rounding decides): stretch the box
    case = settled_lattice
    position = case.state.position * [1.001, 1.001, 0.999]
    radius, length = case.state.radius, case.state.length * 1.001
    cloud = dataclasses.replace(case.cloud, length=length)
    state = dataclasses.replace(case.state, position=position, length=length, radius=radius)
    found = accept(state, case.scene, cloud, case.rule)
    assert found["coordination"] == pytest.approx(2 * 5 / 6)
    assert found["overlap_mean"] == pytest.approx(0.001, rel=1e-6)
    assert found["overlap_max"] == pytest.approx(0.001, rel=1e-6)


def test_a_bed_without_any_contact_has_no_mean_overlap(settled_lattice: SimpleNamespace) -> None:
    case = settled_lattice
    radius = case.state.radius * 0.99
    found = accept(
        dataclasses.replace(case.state, radius=radius),
        case.scene,
        dataclasses.replace(case.cloud, radius=radius),
        case.rule,
    )
    assert (found["overlap_mean"], found["overlap_max"], found["coordination"]) == (0.0, 0.0, 0.0)


# --- incomplete ----------------------------------------------------------------------------------------------------


def test_an_empty_state_is_refused(settled_lattice: SimpleNamespace) -> None:
    error = refusal(settled_lattice, position=np.empty((0, 3)), velocity=np.empty((0, 3)), radius=np.empty(0))
    assert "holds no sphere" in str(error)
    assert error.transient


def test_missing_spheres_are_counted(settled_lattice: SimpleNamespace) -> None:
    state = settled_lattice.state
    error = refusal(
        settled_lattice, position=state.position[:-3], velocity=state.velocity[:-3], radius=state.radius[:-3]
    )
    assert "3 of 150 spheres are missing" in str(error)
    assert error.transient


def test_spheres_too_many_are_refused(settled_lattice: SimpleNamespace) -> None:
    state = settled_lattice.state
    error = refusal(
        settled_lattice,
        position=np.vstack([state.position, [[20 * UM, 20 * UM, 260 * UM]]]),
        velocity=np.vstack([state.velocity, np.zeros((1, 3))]),
        radius=np.append(state.radius, 20 * UM),
    )
    assert "of 150 spheres" in str(error)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(("name", "index"), [("position", (3, 1)), ("velocity", (7, 2)), ("radius", 5)])
def test_numbers_that_are_none_are_refused(
    settled_lattice: SimpleNamespace, name: str, index: Any, value: float
) -> None:
    error = refusal(settled_lattice, **{name: changed(getattr(settled_lattice.state, name), index, value)})
    assert f"1 {name} values of the final state are not finite" in str(error)
    assert error.transient


@pytest.mark.parametrize("name", ["mean_height", "kinetic_energy"])
def test_a_record_with_nan_is_refused(settled_lattice: SimpleNamespace, name: str) -> None:
    record = settled_lattice.state.trajectory
    broken = dataclasses.replace(record, **{name: changed(getattr(record, name), 4, np.nan)})
    assert "settling record holds values that are not finite" in str(refusal(settled_lattice, trajectory=broken))


def test_other_radii_than_the_cloud_s_are_refused(settled_lattice: SimpleNamespace) -> None:
    error = refusal(settled_lattice, radius=changed(settled_lattice.state.radius, 0, 19.999 * UM))
    assert "radii of the final state are not those of the initial cloud" in str(error)


def test_the_published_protocol_draws_its_own_radii(settled_lattice: SimpleNamespace) -> None:
    radius = changed(settled_lattice.state.radius, 0, 19.999 * UM)
    assert judge(settled_lattice, radius=radius, engine="liggghts_as_published")["particles"] == 150


# --- in the wrong place --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("index", "value", "says"),
    [
        ((0, 2), -1 * UM, "1 spheres ended below the floor"),
        ((0, 2), 0.0, "1 spheres ended below the floor"),
        ((0, 2), 421 * UM, "1 spheres ended above the region"),  # region 400 um, radius 20 um
        ((0, 0), -0.1 * UM, "1 spheres ended beside the box"),
        ((0, 1), 200.1 * UM, "1 spheres ended beside the box"),
    ],
)
def test_spheres_outside_the_region_are_refused(
    settled_lattice: SimpleNamespace, index: tuple[int, int], value: float, says: str
) -> None:
    error = refusal(settled_lattice, position=changed(settled_lattice.state.position, index, value))
    assert says in str(error)
    assert not error.transient


# --- too deep ------------------------------------------------------------------------------------------------------


def test_the_overlap_limit_by_hand(make_scene: Callable[..., Any]) -> None:
    # 1.5 times the overlap of a small sphere on a flat one, plus half a percent; d_eq/d of equal spheres at 50 kJ/m3:
    equal = (3 * np.pi * 50e3 * 0.96 / 5e6) ** 2 / 4
    # and twice the Hertz overlap of the small sphere under the weight of the large one
    small, large = 16e-6, 270e-6
    for cohesive, scene in ((3.0 * equal, make_scene(cohesion=50e3)), (0.0, make_scene(cohesion=0.0))):
        weight = scene.density * 4 / 3 * np.pi * large**3 * 9.81
        pressed = (weight * 3 * 2 * 0.96 / (4 * 5e6 * np.sqrt(small))) ** (2 / 3) / (2 * small)
        expected = pytest.approx(cohesive + 0.005 + 2 * pressed, rel=1e-12)
        assert overlap_limit(scene, np.array([small, large])) == expected


def test_a_small_sphere_still_in_flight_over_a_large_bed_is_no_reason_to_refuse(
    settled_lattice: SimpleNamespace,
) -> None:
    case = settled_lattice
    copies = 8  # 1200 spheres: one in a thousand may fly
    position = np.vstack([case.state.position + np.array([k * case.state.length, 0.0, 0.0]) for k in range(copies)])
    radius = np.tile(case.state.radius, copies)
    state = dataclasses.replace(case.state, radius=radius, expected=radius.size)
    for flying, refused in ((1, False), (2, True)):
        lifted = position.copy()
        lifted[np.argsort(position[:, 2])[-flying:], 2] = 421 * UM
        found = _outside(dataclasses.replace(state, position=lifted, length=copies * state.length), case.cloud)
        assert bool(found) == refused


@pytest.mark.parametrize(("share", "accepted"), [(0.9, True), (1.1, False)])
def test_two_spheres_that_overlap_too_deep_are_refused(
    settled_lattice: SimpleNamespace, share: float, accepted: bool
) -> None:
    limit = overlap_limit(settled_lattice.scene, settled_lattice.cloud.radius)
    top = int(np.argmax(settled_lattice.state.position[:, 2]))
    z = settled_lattice.state.position[top, 2] - share * limit * 40 * UM
    position = changed(settled_lattice.state.position, (top, 2), z)
    if accepted:
        assert judge(settled_lattice, position=position)["overlap_max"] == pytest.approx(share * limit, rel=1e-6)
    else:
        assert f"largest overlap {share * limit:.3g} of the smaller diameter is over its limit {limit:.3g}" in str(
            refusal(settled_lattice, position=position)
        )


def test_a_sphere_pressed_into_the_floor_is_refused(settled_lattice: SimpleNamespace) -> None:
    position = settled_lattice.state.position
    bottom = int(np.argmin(position[:, 2]))
    error = refusal(settled_lattice, position=changed(position, (bottom, 2), 19 * UM))  # 1 of 40 um
    assert "largest overlap 0.025 of the smaller diameter" in str(error)


# --- not at rest ---------------------------------------------------------------------------------------------------


def test_a_bed_stopped_too_early_is_refused(settled_lattice: SimpleNamespace) -> None:
    record = settled_lattice.state.trajectory
    early = Trajectory(*(getattr(record, f.name)[:8] for f in dataclasses.fields(record)))
    error = refusal(settled_lattice, trajectory=early)
    assert "not settled after 3,000 steps" in str(error)
    assert "raise packing.max_fall_times" in str(error)
    assert not error.transient


def test_a_bed_that_never_calmed_down_is_refused(settled_lattice: SimpleNamespace) -> None:
    record = settled_lattice.state.trajectory
    restless = dataclasses.replace(record, kinetic_energy=np.full(30, 1e-12))
    assert "not settled" in str(refusal(settled_lattice, trajectory=restless))


def test_a_bed_that_the_time_step_keeps_moving_is_told_apart(settled_lattice: SimpleNamespace) -> None:
    record = settled_lattice.state.trajectory
    steady = dataclasses.replace(record, kinetic_energy=np.r_[1.0, np.full(29, 0.02)] * 1e-12)
    text = str(refusal(settled_lattice, trajectory=steady))
    assert "stays at 2.0e-02 of its peak" in text
    assert "lower packing.time_step_rayleigh" in text
    assert "max_fall_times" not in text


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("engine", ["liggghts", "liggghts_as_published"])
@pytest.mark.parametrize("entries", [0, 1])
def test_an_engine_without_a_record_is_not_settled(settled_lattice: SimpleNamespace, engine: str, entries: int) -> None:
    nothing = Trajectory(*(np.ones(entries) for _ in range(4)))
    assert "not settled" in str(refusal(settled_lattice, trajectory=nothing, engine=engine))


def test_the_published_protocol_is_judged_by_its_last_tenth(settled_lattice: SimpleNamespace) -> None:
    state = dataclasses.replace(settled_lattice.state, engine="liggghts_as_published")
    restless = dataclasses.replace(state.trajectory, kinetic_energy=np.full(30, 1e-12))
    assert is_settled(dataclasses.replace(state, trajectory=restless), settled_lattice.rule)
    falling = dataclasses.replace(state.trajectory, mean_height=np.linspace(9e-4, 1e-4, 30))
    assert not is_settled(dataclasses.replace(state, trajectory=falling), settled_lattice.rule)


# --- the engine's own doubts ---------------------------------------------------------------------------------------


def test_dangerous_builds_are_refused(settled_lattice: SimpleNamespace) -> None:
    error = refusal(settled_lattice, dangerous_builds=2)
    assert "2 neighbour lists were built late; use a larger skin_um" in str(error)


def test_a_bed_too_shallow_is_refused(settled_lattice: SimpleNamespace) -> None:
    # three layers: the interior between 40 and 80 um is one diameter; two layers have none
    state: SettledState = settled_lattice.state
    low = state.position[:, 2] < 80 * UM
    case = SimpleNamespace(
        state=dataclasses.replace(
            state,
            position=state.position[low],
            velocity=state.velocity[low],
            radius=state.radius[low],
            expected=int(low.sum()),
        ),
        scene=settled_lattice.scene,
        cloud=dataclasses.replace(
            settled_lattice.cloud, position=settled_lattice.cloud.position[low], radius=state.radius[low]
        ),
        rule=settled_lattice.rule,
    )
    error = refusal(case)
    assert "too shallow: its interior is 0 um thick" in str(error)
    assert "use more particles" in str(error)


def test_all_reasons_are_given_at_once(settled_lattice: SimpleNamespace) -> None:
    error = refusal(
        settled_lattice,
        position=changed(settled_lattice.state.position, (0, 2), -1 * UM),
        dangerous_builds=1,
        trajectory=dataclasses.replace(settled_lattice.state.trajectory, kinetic_energy=np.full(30, 1e-12)),
    )
    text = str(error)
    assert len(error.reasons) == 4  # the sphere below the floor is also too deep in it
    for words in ("below the floor", "largest overlap", "not settled", "built late"):
        assert words in text
