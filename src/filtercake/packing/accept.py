"""Whether a settled state is a packing: every check that stands between an engine's output and a result."""

from __future__ import annotations

from typing import Any

import numpy as np

from filtercake.errors import PackingRejected
from filtercake.packing import contact_law
from filtercake.packing.cloud import Cloud
from filtercake.packing.contacts import Contacts, find_contacts, floor_overlap, relative_overlap
from filtercake.packing.engines import kind_of
from filtercake.packing.result import SettledState
from filtercake.packing.scene import Scene
from filtercake.packing.settling import ENERGY_FRACTION, StopRule, stopped_falling
from filtercake.packing.slab import bed_height, interior_slab, why_too_thin
from filtercake.units import GRAVITY, FloatArray

OVERLAP_FACTOR = 1.5
"""Largest overlap allowed, over the equilibrium overlap of a small sphere on a much larger one."""
OVERLAP_ALLOWANCE = 0.005
"""Overlap of the smaller diameter allowed on top, for the load a contact carries."""
LOAD_FACTOR = 2.0
"""Overlap allowed on top of that in a wide distribution, over that of the largest sphere at rest on the smallest."""
IN_FLIGHT = 1e-3
"""Share of the spheres that may still fly over the region: small ones are thrown up when large ones land."""
FIXED_LENGTH_TOLERANCE = 1e-3
"""Fall of porosity allowed over the last tenth of a run of fixed length."""

STEADY_ENERGY = 0.8
"""Kinetic energy of the last tenth over that of the last half above which it is no longer falling."""


def overlap_limit(scene: Scene, radius: FloatArray) -> float:
    """Largest overlap of an acceptable packing of spheres (radii in m) over the diameter of the smaller sphere."""
    smallest, largest = float(radius.min()), float(radius.max())
    modulus = contact_law.effective_modulus(scene.youngs_modulus, scene.poisson_ratio)
    weight = scene.density * 4.0 / 3.0 * np.pi * largest**3 * GRAVITY
    pressed = (weight / (4.0 / 3.0 * modulus * np.sqrt(smallest))) ** (2.0 / 3.0) / (2.0 * smallest)
    return float(OVERLAP_FACTOR * 2.0 * scene.relative_overlap + OVERLAP_ALLOWANCE + LOAD_FACTOR * pressed)


def accept(state: SettledState, scene: Scene, cloud: Cloud, rule: StopRule) -> dict[str, Any]:
    """Check a settled state and return what was measured on the way.

    Parameters
    ----------
    state : SettledState
        Result of the engine.
    scene : Scene
        What was asked for.
    cloud : Cloud
        The initial cloud.
    rule : StopRule
        Stop rule.

    Raises
    ------
    PackingRejected
        With every reason that was found.
    """
    reasons = _incomplete(state, cloud)
    if reasons:  # geometry that is not whole cannot be measured
        raise PackingRejected(reasons, transient=True, outcome="exploded")
    outside = _outside(state, cloud)
    reasons += outside
    contacts = find_contacts(state.position, state.radius, state.length)
    deepest = _deepest(state, contacts)
    limit = overlap_limit(scene, cloud.radius)
    if deepest > limit:
        reasons.append(
            f"largest overlap {deepest:.3g} of the smaller diameter is over its limit {limit:.3g}: "
            "the contacts are too soft or the time step too long"
        )
    settled = is_settled(state, rule)
    if not settled:
        reasons.append(f"not settled after {state.steps:,} steps: {_why_unsettled(state)}")
    if state.dangerous_builds and not kind_of(state.engine).fixed_steps:
        reasons.append(f"{state.dangerous_builds} neighbour lists were built late; use a larger skin_um")
    too_thin = why_too_thin(interior_slab(state.position, state.radius), state.radius)
    if too_thin:
        reasons.append(too_thin)
    if reasons:
        raise PackingRejected(reasons, outcome="exploded" if outside else "refused" if settled else "unsettled")
    return measurements(state, contacts, deepest)


def is_settled(state: SettledState, rule: StopRule) -> bool:
    """Whether the bed had come to rest, from the engine's record (never from its word)."""
    if state.trajectory.time.size < 2:
        return False
    if kind_of(state.engine).fixed_steps:
        return stopped_falling(state.trajectory, FIXED_LENGTH_TOLERANCE)
    return rule.settled_at(state.trajectory) is not None


def _why_unsettled(state: SettledState) -> str:
    """Tell a bed that needs more time from one that the time step keeps moving."""
    energy = state.trajectory.kinetic_energy
    if energy.size == 0:
        return "the engine left no record of the settling"
    earlier, last = energy[-energy.size // 2 :].mean(), energy[-max(1, energy.size // 10) :].mean()
    if energy.size >= 20 and last > STEADY_ENERGY * earlier and last > ENERGY_FRACTION * energy.max():
        return (
            f"the kinetic energy stays at {last / energy.max():.1e} of its peak, which a too long time step feeds; "
            "lower packing.time_step_rayleigh"
        )
    return "porosity or kinetic energy was still falling; raise packing.max_fall_times"


def measurements(state: SettledState, contacts: Contacts, deepest: float) -> dict[str, Any]:
    """Plain numbers that describe an accepted packing."""
    n = state.radius.size
    touching = np.bincount(contacts.pairs.ravel(), minlength=n)
    mass_weight = state.radius**3
    speed2 = np.sum(state.velocity**2, axis=1)
    return {
        "particles": n,
        "length_m": state.length,
        "bed_height_m": bed_height(state.position, state.radius),
        "steps": state.steps,
        "settled": True,
        "overlap_max": deepest,
        "overlap_mean": float(relative_overlap(contacts, state.radius).mean()) if len(contacts.overlap) else 0.0,
        "coordination": float(touching.mean()),
        "rms_speed_m_s": float(np.sqrt(np.average(speed2, weights=mass_weight))),
        "kinetic_energy_J": float(state.trajectory.kinetic_energy[-1]),
        "peak_kinetic_energy_J": float(state.trajectory.kinetic_energy.max()),
        "dangerous_builds": state.dangerous_builds,
        "engine": state.engine,
        "engine_version": state.engine_version,
        "warnings": list(state.warnings),
        "wall_s": state.wall_time,
        "trajectory": {
            "time_s": state.trajectory.time.tolist(),
            "mean_height_m": state.trajectory.mean_height.tolist(),
            "kinetic_energy_J": state.trajectory.kinetic_energy.tolist(),
            "porosity_sample": state.trajectory.porosity_sample.tolist(),
        },
    }


def _incomplete(state: SettledState, cloud: Cloud) -> list[str]:
    """Spheres missing, numbers that are none, or radii that are not the cloud's."""
    n = state.radius.size
    if n == 0:
        return ["the final state holds no sphere"]
    reasons = []
    if n != state.expected:
        reasons.append(f"{state.expected - n} of {state.expected} spheres are missing from the final state")
    for name, values in (("position", state.position), ("velocity", state.velocity), ("radius", state.radius)):
        bad = int(np.count_nonzero(~np.isfinite(values)))
        if bad:
            reasons.append(f"{bad} {name} values of the final state are not finite")
    recorded = np.concatenate([state.trajectory.mean_height, state.trajectory.kinetic_energy])
    if not np.isfinite(recorded).all():
        reasons.append("the settling record holds values that are not finite")
    from_cloud = not kind_of(state.engine).own_spheres
    if not reasons and from_cloud and not np.allclose(state.radius, cloud.radius, rtol=1e-9, atol=0.0):
        reasons.append("the radii of the final state are not those of the initial cloud")
    return reasons


def _outside(state: SettledState, cloud: Cloud) -> list[str]:
    z, side = state.position[:, 2], state.position[:, :2]
    below = int(np.count_nonzero(z <= 0.0))
    above = int(np.count_nonzero(z > cloud.height + state.radius))
    beside = int(np.count_nonzero((side < 0.0).any(axis=1) | (side > state.length).any(axis=1)))
    if above <= IN_FLIGHT * state.radius.size:
        above = 0
    reasons = []
    for count, where in ((below, "below the floor"), (above, "above the region"), (beside, "beside the box")):
        if count:
            reasons.append(f"{count} spheres ended {where}")
    return reasons


def _deepest(state: SettledState, contacts: Contacts) -> float:
    between = relative_overlap(contacts, state.radius)
    with_floor = floor_overlap(state.position, state.radius)
    return float(max(between.max(initial=0.0), with_floor.max(initial=0.0)))
