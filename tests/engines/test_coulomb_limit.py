"""Coulomb's limit of the tangential force: what holds where it is of the whole force, and what LIGGGHTS's leaves."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.crystals.csd import mixture
from filtercake.packing import contact_law
from filtercake.packing.cell import CellScene
from filtercake.packing.cell_box import CellBox
from filtercake.packing.engines.embedded_bed import Bed
from filtercake.packing.scene import Scene

RADIUS = np.array([25e-6, 10e-6])
LENGTH, HIGH = 600e-6, 300e-6
FRICTION, RESTITUTION, DENSITY = 0.3, 0.3, 1180.0
SPEED = st.floats(-0.1, 0.1)
VECTOR = st.tuples(SPEED, SPEED, SPEED)


def bed_of(position, velocity, radius, *, capped, spin=None, friction=FRICTION, restitution=RESTITUTION):
    scene = Scene(
        csd=mixture([20e-6, 50e-6], [0.5, 0.5]),
        particles=2,
        initial_void_fraction=0.65,
        settling_velocity=0.01,
        density=DENSITY,
        youngs_modulus=5e6,
        poisson_ratio=0.2,
        restitution=restitution,
        friction=friction,
        cohesion=0.0,
        time_step=0.02e-6,
        engine="embedded",
    )
    bed = Bed(np.array(position), np.array(velocity), np.array(radius), LENGTH, scene, gravity=0.0)
    bed.law = bed.law._replace(capped=capped)
    if spin is not None:
        bed.spin[:] = spin
    return bed


def pair_forces(velocity, spin, steps, *, capped):
    """Normal force of two touching spheres and the length of the tangential one, N, after some steps."""
    position = [[HIGH, HIGH, HIGH], [HIGH, HIGH, HIGH + 0.99 * RADIUS.sum()]]
    bed = bed_of(position, [velocity, np.zeros(3)], RADIUS, capped=capped, spin=[spin / RADIUS[0], np.zeros(3)])
    bed.advance(steps)
    found, _ = bed.state()
    force = bed.force[0][np.argsort(bed.identity)][0, :3]
    normal = (found[0] - found[1]) / np.linalg.norm(found[0] - found[1])
    push = float(force @ normal)
    return push, float(np.linalg.norm(force - push * normal))


@given(velocity=VECTOR, spin=VECTOR, steps=st.integers(0, 60))
def test_no_tangential_force_exceeds_friction_times_the_normal_one(velocity, spin, steps):
    push, rub = pair_forces(np.array(velocity), np.array(spin), steps, capped=True)
    assert rub <= FRICTION * abs(push) * (1.0 + 1e-9) + 1e-18


@given(velocity=VECTOR, spin=VECTOR)
def test_at_first_touch_the_damper_is_cut_to_the_limit_and_no_further(velocity, spin):
    push, rub = pair_forces(np.array(velocity), np.array(spin), 0, capped=True)
    same, damper = pair_forces(np.array(velocity), np.array(spin), 0, capped=False)
    assert push == pytest.approx(same, rel=1e-9)
    assert rub == pytest.approx(min(damper, FRICTION * abs(push)), rel=1e-9, abs=1e-18)


def impulse(angle_deg, *, capped):
    """Tangential impulse of an oblique impact on the floor, over the integral of the normal force's magnitude."""
    radius = float(RADIUS[1])
    speed = np.array([math.tan(math.radians(angle_deg)), 0.0, -1.0]) * 0.01
    bed = bed_of([[HIGH, HIGH, 1.001 * radius]], [speed], [radius], capped=capped)
    velocity = [bed.state()[1][0]]
    for _ in range(1500):
        bed.advance(1)
        velocity.append(bed.state()[1][0])
    assert velocity[-1][2] == pytest.approx(RESTITUTION * 0.01, rel=0.01)  # it has bounced
    return (speed[0] - velocity[-1][0]) / float(np.abs(np.diff(velocity, axis=0)[:, 2]).sum())


def test_what_slides_all_along_loses_friction_times_the_normal_impulse():
    # above atan(3.5 mu (1 + e)), 54 degrees
    assert impulse(70.0, capped=True) == pytest.approx(FRICTION, rel=0.002)
    assert impulse(70.0, capped=False) > 1.15 * FRICTION  # the damper adds to a spring below its limit


def test_a_steep_impact_sticks_alike():
    # the limit is met at first touch only
    assert impulse(10.0, capped=True) == pytest.approx(impulse(10.0, capped=False), rel=0.02)


@pytest.mark.parametrize("capped", [False, True])
def test_a_sphere_thrown_along_the_floor_slides_and_then_rolls(capped):
    # it slows by mu g, faster where the damper comes on top, and ends rolling at 5/7 of its speed in any case
    radius, speed, gravity = float(RADIUS[1]), 0.05, 2000.0
    mass = DENSITY * 4.0 / 3.0 * math.pi * radius**3
    modulus = contact_law.effective_modulus(5e6, 0.2)
    overlap = (0.75 * mass * gravity / (modulus * math.sqrt(radius))) ** (2.0 / 3.0)
    bed = bed_of([[HIGH, HIGH, radius - overlap]], [[speed, 0.0, 0.0]], [radius], capped=capped)
    bed.law = bed.law._replace(gravity=gravity)
    bed.advance(600)
    sliding = speed - bed.state()[1][0, 0]
    expected = FRICTION * gravity * 600 * 0.02e-6
    if capped:
        assert sliding == pytest.approx(expected, rel=0.005)
    else:
        assert sliding > 1.1 * expected
    bed.advance(10_000)
    assert bed.state()[1][0, 0] == pytest.approx(5.0 / 7.0 * speed, rel=0.005)
    assert bed.full_spin()[0, 1] * radius == pytest.approx(5.0 / 7.0 * speed, rel=0.005)


def test_the_pressure_cell_limits_the_whole_force():
    radius, side = np.full(2, 10e-6), 100e-6
    scene = CellScene(radius, stress=88.0, density=DENSITY, friction=FRICTION, drag=0.0)
    box = CellBox(scene, np.array([[4e-5, 5e-5, 5e-5], [4e-5 + 0.99 * 2e-5, 5e-5, 5e-5]]), side)
    box.velocity[0] = [0.0, 0.09, 0.0]
    before = box.velocity.copy()
    box.advance(1)
    gained = box.velocity - before
    assert gained[0, 0] == pytest.approx(-gained[1, 0])
    assert abs(gained[0, 0]) > 0.0
    # the spring of one step is below the limit, with the damper beside it above
    assert abs(gained[0, 1]) == pytest.approx(FRICTION * abs(gained[0, 0]), rel=1e-6)
