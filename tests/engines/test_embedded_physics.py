"""The embedded engine against closed forms and conservation laws; no LIGGGHTS needed."""

import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from filtercake.crystals.csd import mixture
from filtercake.errors import CloudError, EngineError, PackingRejected
from filtercake.packing import contact_law
from filtercake.packing.cloud import Cloud, make_cloud
from filtercake.packing.contacts import find_contacts
from filtercake.packing.engines.base import SettleRequest
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.engines.embedded_bed import Bed
from filtercake.packing.pack import pack
from filtercake.packing.scene import Scene
from filtercake.packing.settling import StopRule

RADIUS = 10e-6
LENGTH = 600e-6
HIGH = 300e-6
CSD = mixture([20e-6, 50e-6], [0.5, 0.5])
MODULUS = contact_law.effective_modulus(5e6, 0.2)


def make(**changes):
    values = {
        "csd": CSD,
        "particles": 2,
        "initial_void_fraction": 0.65,
        "settling_velocity": 0.01,
        "density": 1180.0,
        "youngs_modulus": 5e6,
        "poisson_ratio": 0.2,
        "restitution": 0.3,
        "friction": 0.0,
        "cohesion": 0.0,
        "time_step": 0.02e-6,
        "engine": "embedded",
    }
    return Scene(**{**values, **changes})


def pair(gap, speed, scene):
    """Two equal spheres ``gap`` apart, approaching with a relative ``speed``, far from the floor."""
    half = RADIUS + 0.5 * gap
    position = np.array([[HIGH - half, HIGH, HIGH], [HIGH + half, HIGH, HIGH]])
    velocity = np.array([[0.5 * speed, 0.0, 0.0], [-0.5 * speed, 0.0, 0.0]])
    return Bed(position, velocity, np.full(2, RADIUS), LENGTH, scene, gravity=0.0)


def opening(bed):
    """Gap and opening speed of two spheres."""
    position, velocity = bed.state()
    return position[1, 0] - position[0, 0] - 2.0 * RADIUS, velocity[1, 0] - velocity[0, 0]


@pytest.mark.parametrize("restitution", [0.1, 0.3, 0.6, 0.9])
def test_restitution_of_a_collision(restitution):
    bed = pair(0.1e-6, 0.1, make(restitution=restitution, time_step=0.005e-6))
    bed.advance(16_000)
    gap, speed = opening(bed)
    assert gap > 0.0
    assert speed / 0.1 == pytest.approx(restitution, rel=5e-3)


def test_pairs_come_to_rest_at_the_equilibrium_overlap():
    bed = pair(-0.01e-6, 0.0, make(cohesion=50e3, time_step=0.1e-6))
    bed.advance(20_000)
    gap, speed = opening(bed)
    # the closed form takes 2 pi R* d for the lens; at 0.2 % overlap that is good to about as much
    assert -gap == pytest.approx(contact_law.equilibrium_overlap(50e3, 5e6, 0.2, RADIUS, RADIUS), rel=0.01)
    assert abs(speed) < 1e-6


@pytest.mark.parametrize(("factor", "escapes"), [(0.97, False), (1.03, True)])
def test_escape_speed_of_a_cohesive_pair(factor, escapes):
    cohesion, density = 100e3, 1180.0
    escape = math.sqrt(37.0 * cohesion**5 / (density * MODULUS**4))
    overlap = contact_law.equilibrium_overlap(cohesion, 5e6, 0.2, RADIUS, RADIUS)
    bed = pair(-overlap, -factor * escape, make(cohesion=cohesion, restitution=0.9999))
    bed.advance(40_000)
    gap, _ = opening(bed)
    assert (gap > 0.0) == escapes


def test_pull_off_force_is_the_largest_attraction():
    cohesion = 50e3
    strongest = 0.0
    for share in np.linspace(0.3, 0.6, 31):
        overlap = share * contact_law.equilibrium_overlap(cohesion, 5e6, 0.2, RADIUS, RADIUS)
        bed = pair(-overlap, 0.0, make(cohesion=cohesion))
        bed.advance(0)
        strongest = max(strongest, bed.force[0, np.argsort(bed.identity)[0], 0])
    assert strongest == pytest.approx(contact_law.pull_off_force(cohesion, 5e6, 0.2, RADIUS, RADIUS), rel=0.01)


def cluster(n=60, seed=5, friction=0.0, cohesion=50e3, gravity=0.0, shift=0.0):
    """Spheres of two sizes flying at each other, far from the floor."""
    rng = np.random.default_rng(seed)
    radius = np.where(np.arange(n) < 8, 25e-6, 10e-6)
    position = np.empty((0, 3))
    for r in radius:
        while True:
            p = rng.uniform(0.0, 130e-6, 3) + np.array([0.0, 0.0, HIGH])
            if all(np.linalg.norm(p - q) > r + s for q, s in zip(position, radius, strict=False)):
                break
        position = np.vstack([position, p])
    centre = position.mean(axis=0)
    velocity = 0.1 * (centre - position) / np.linalg.norm(centre - position, axis=1)[:, None]
    position[:, 0] = (position[:, 0] + shift) % LENGTH
    scene = make(friction=friction, cohesion=cohesion, time_step=0.1e-6)
    return Bed(position, velocity, radius, LENGTH, scene, gravity=gravity)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_momentum_is_conserved(friction):
    bed = cluster(friction=friction)
    mass = bed.mass[:, None].copy()
    before = (mass * bed.state()[1]).sum(axis=0)
    scale = (mass * np.abs(bed.state()[1])).sum()
    for _ in range(10):
        bed.advance(300)
    order = np.argsort(bed.identity)
    after = (bed.mass[order][:, None] * bed.state()[1]).sum(axis=0)
    assert np.abs(after - before).max() < 1e-13 * scale
    assert len(find_contacts(*bed_geometry(bed)).overlap) > 30  # they did collide


def bed_geometry(bed):
    order = np.argsort(bed.identity)
    return bed.state()[0], bed.radius[order], bed.length


def energy(bed, gravity):
    """Kinetic, gravitational and elastic energy of a bed without cohesion and friction, J."""
    position, velocity = bed.state()
    radius = bed_geometry(bed)[1]
    mass = bed.mass[np.argsort(bed.identity)]
    contacts = find_contacts(position, radius, bed.length)
    a, b = radius[contacts.pairs[:, 0]], radius[contacts.pairs[:, 1]]
    elastic = 8.0 / 15.0 * MODULUS * np.sum(np.sqrt(a * b / (a + b)) * contacts.overlap**2.5)
    pressed = np.maximum(radius - position[:, 2], 0.0)
    floor = 8.0 / 15.0 * MODULUS * np.sum(np.sqrt(radius) * pressed**2.5)
    return 0.5 * np.sum(mass * np.sum(velocity**2, axis=1)) + gravity * np.sum(mass * position[:, 2]) + elastic + floor


def test_energy_only_falls():
    scene = make(particles=300, time_step=0.1e-6)
    bed = Bed.from_cloud(make_cloud(CSD, 300, 0.65, 1), scene)
    record = []
    for _ in range(60):
        bed.advance(1500)
        record.append(energy(bed, 9.81))
    assert record[-1] < 0.8 * record[0]
    assert np.diff(record).max() < 1e-6 * record[0]


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_periodic_images_are_equal(friction):
    still, moved = cluster(friction=friction), cluster(friction=friction, shift=517e-6)
    for bed in (still, moved):
        bed.advance(400)
    apart = moved.state()[0] - still.state()[0]
    apart[:, 0] -= 517e-6
    apart[:, :2] -= LENGTH * np.round(apart[:, :2] / LENGTH)
    assert np.abs(apart).max() < 1e-9 * RADIUS * 1e3
    assert np.abs(moved.state()[1] - still.state()[1]).max() < 1e-8


@pytest.mark.parametrize(("given", "kept"), [(None, "3000"), ("17", "17")])
def test_threads_that_wait_soon_sleep(given, kept):
    environment = {name: value for name, value in os.environ.items() if name != "GOMP_SPINCOUNT"}
    if given is not None:
        environment["GOMP_SPINCOUNT"] = given
    code = "import os, filtercake.packing.engines.embedded_bed; print(os.environ['GOMP_SPINCOUNT'])"
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == kept


def test_two_threads_agree_with_one():
    cloud = make_cloud(CSD, 500, 0.65, 1)
    for friction in (0.0, 0.3):
        scene = make(particles=500, cohesion=50e3, friction=friction, time_step=0.1e-6)
        one, two = Bed.from_cloud(cloud, scene), Bed.from_cloud(cloud, scene, threads=2)
        for bed in (one, two):
            bed.advance(16_000)
        assert one.count > 50
        # sums in another order: equal to round-off until chaos has had its time
        assert np.abs(one.state()[0] - two.state()[0]).max() < 1e-4 * RADIUS


def settle(cloud, scene):
    rule = StopRule.for_bed(scene, cloud.length)
    return Embedded().settle(SettleRequest(scene, cloud, rule, 1, None, lambda _: None)), rule


def test_one_sphere_comes_to_rest_on_the_floor():
    cloud = Cloud(np.array([[50e-6, 50e-6, 60e-6]]), np.array([RADIUS]), 100e-6, 200e-6)
    state, rule = settle(cloud, make(particles=1, cohesion=50e3, time_step=0.1e-6))
    assert rule.settled_at(state.trajectory) is not None
    resting = RADIUS - contact_law.equilibrium_overlap(50e3, 5e6, 0.2, RADIUS, math.inf)
    assert state.position[0, 2] == pytest.approx(resting, rel=1e-3)


def test_two_touching_spheres_stand_on_each_other_or_fall_over():
    position = np.array([[50e-6, 50e-6, RADIUS], [50e-6, 50e-6, 3.0 * RADIUS]])
    cloud = Cloud(position, np.full(2, RADIUS), 100e-6, 200e-6)
    state, rule = settle(cloud, make(cohesion=50e3, time_step=0.1e-6))
    assert rule.settled_at(state.trajectory) is not None
    assert np.linalg.norm(state.position[1] - state.position[0]) == pytest.approx(2.0 * RADIUS, rel=0.01)


def test_spheres_as_wide_as_the_box_pile_up():
    position = np.array([[0.0, 0.0, 11e-6], [5e-6, 5e-6, 40e-6], [10e-6, 3e-6, 70e-6]])
    cloud = Cloud(position, np.full(3, RADIUS), 2.0 * RADIUS, 80e-6)
    state, rule = settle(cloud, make(particles=3, time_step=0.1e-6))
    assert rule.settled_at(state.trajectory) is not None
    # each lies in a hollow of the layer below: one sphere per layer of a square lattice
    assert np.sort(state.position[:, 2]) == pytest.approx(RADIUS * (1.0 + math.sqrt(2.0) * np.arange(3)), rel=0.01)


def test_without_gravity_nothing_moves():
    bed = pair(1e-6, 0.0, make())
    bed.advance(10_000)
    assert opening(bed) == (pytest.approx(1e-6), 0.0)


def test_a_far_too_long_time_step_is_refused(tmp_path):
    with pytest.raises((EngineError, PackingRejected)) as refusal:
        pack(make(particles=300, cohesion=50e3, time_step=2.5e-6), 0, tmp_path)
    assert any(word in str(refusal.value) for word in ("exploded", "time step"))


@pytest.mark.parametrize(
    "cloud",
    [
        lambda: Cloud(np.empty((0, 3)), np.empty(0), 1e-4, 2e-4),
        lambda: Cloud(np.array([[np.nan, 0.0, 1e-5]]), np.array([RADIUS]), 1e-4, 2e-4),
    ],
)
def test_no_engine_sees_a_bad_cloud(cloud):
    with pytest.raises(CloudError):
        cloud()


def test_a_bed_too_small_to_measure_is_refused_with_a_reason(tmp_path):
    with pytest.raises(PackingRejected, match="too shallow"):
        pack(make(particles=30, time_step=0.2e-6), 0, tmp_path)


def test_same_seed_same_packing(tmp_path):
    scene = make(csd=mixture([30e-6, 50e-6], [0.5, 0.5]), particles=300, cohesion=50e3, time_step=0.4e-6)
    first, again = (pack(scene, 0, tmp_path) for _ in range(2))
    assert np.array_equal(first.position, again.position)
    other = pack(replace(scene, seed=2), 0, tmp_path)
    assert not np.array_equal(first.position, other.position)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_no_contact_is_missed_between_two_choices_of_near_pairs(friction):
    """A fast sphere flies into a quiet lattice: asked for at every step, the near pairs are chosen anew each time.

    Many steps in one call must give the same to the last bit, although spheres become fast in between.
    """
    speed, step = 1.0, 0.3e-6
    gap = 4.5 * speed * step  # further than quiet spheres are expected to move, nearer than those that are hit do
    pitch = 2.0 * RADIUS + gap
    grid = np.array([(x, y, z) for z in range(3) for y in range(10) for x in range(10)], dtype=float)
    position = 100e-6 + pitch * grid
    # from below, so that it shares a patch with the first rows of the lowest layer, and flies at the last
    bullet = position[95] + [0.3 * RADIUS, 0.1 * RADIUS, -(2.0 * RADIUS + 2.5 * speed * step)]
    position = np.vstack([position, bullet])
    velocity = np.zeros_like(position)
    velocity[-1, 2] = speed
    scene = make(particles=len(position), time_step=step, skin=18e-6, friction=friction, restitution=0.9)
    at_once, one_by_one = (
        Bed(position, velocity, np.full(len(position), RADIUS), LENGTH, scene, gravity=0.0) for _ in range(2)
    )
    at_once.advance(90)
    for _ in range(90):
        one_by_one.advance(1)
    for found, expected in zip(at_once.state(), one_by_one.state(), strict=True):
        assert np.array_equal(found, expected)
    moving = np.linalg.norm(at_once.state()[1], axis=1) > 1e-3
    assert moving.sum() > 5  # the blow has gone through the lattice
