"""Compiled kernels of the pressure cell: periodic images, the servo on the box, and the averages that judge rest.

All in SI. Contacts are the embedded engine's, and so are the half steps of the velocity. Here a velocity is that
relative to the box, which shrinks or grows about its corner at ``rate`` (1/s) along each axis: the state that the
contacts see holds ``v + rate x``. A sphere with contacts across a face of the box appears again as an image, a row
behind the spheres, whose forces are the sphere's own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numba.misc.special import literally

from filtercake.packing.compiled import cached_njit
from filtercake.packing.engines import embedded_kernels as kernels
from filtercake.packing.engines import pair_kernels
from filtercake.packing.engines.pair_kernels import FUSED, INDEX_MASK, MASS, RADIUS, U, X
from filtercake.units import FloatArray, IntArray


class Motion(NamedTuple):
    """What moves, beside the state that the contacts see.

    Attributes
    ----------
    velocity : ndarray, shape (n, 3)
        Velocities relative to the box, m/s.
    drag : ndarray, shape (n,)
        Drag over mass, 1/s.
    owner : ndarray, shape (images,)
        The sphere that each image is of.
    shift : ndarray, shape (images, 3)
        Where the image lies, in sides of the box from its sphere.
    box : ndarray, shape (2, 3)
        Sides of the box, m, and their rates of growth, 1/s; both change.
    """

    velocity: FloatArray
    drag: FloatArray
    owner: IntArray
    shift: FloatArray
    box: FloatArray


class Servo(NamedTuple):
    """The stress that the box is led to, Pa, and the fastest rate at which a side grows or shrinks, 1/s."""

    stress: float
    fastest: float


class Reach(NamedTuple):
    """How far spheres may move before the pairs are listed anew.

    ``reference`` (n, 3) and ``sides`` (3,), m, are the positions and the sides of the box when they were listed; pairs
    closer than ``skin`` are listed, and ``widest`` is the largest distance of two centres that touch, m.
    """

    reference: FloatArray
    sides: FloatArray
    skin: float
    widest: float


class Averages(NamedTuple):
    """Averages over the contacts of one state.

    Attributes
    ----------
    stress : ndarray, shape (3, 3)
        Stress that the contacts carry, Pa, compression positive.
    net_force, contact_force : float
        Mean force left on a sphere and mean force of a contact, N.
    contacts : int
        Number of contacts.
    overlap : float
        Mean overlap over the sum of the radii.
    """

    stress: FloatArray
    net_force: float
    contact_force: float
    contacts: int
    overlap: float


SPEED_ROOM = 1.5
"""Limit of the speeds while a choice of near pairs lasts, over the largest speed at its beginning."""
LEAST_ROOM = 0.1
"""Share of the skin that is kept for the step in which its end is noticed."""

_compiled = cached_njit(error_model="numpy", fastmath=FUSED)


@_compiled
def place_images(bodies: kernels.Bodies, motion: Motion, frictional: bool) -> None:
    """Put what the contacts see into the state: velocities in a box that deforms, and the images."""
    state, spin, velocity, box = bodies.state, bodies.spin, motion.velocity, motion.box
    n = velocity.shape[0]
    for i in range(n):
        for k in range(3):
            state[i, U + k] = velocity[i, k] + box[1, k] * state[i, X + k]
    for g in range(motion.owner.size):
        i = motion.owner[g]
        for k in range(3):
            away = motion.shift[g, k] * box[0, k]
            state[n + g, X + k] = state[i, X + k] + away
            state[n + g, U + k] = state[i, U + k] + box[1, k] * away
            if frictional:
                spin[n + g, k] = spin[i, k]


@_compiled
def _clear(bodies: kernels.Bodies, frictional: bool) -> None:
    """Set forces and torques to nothing."""
    bodies.force[0, :, :] = 0.0
    if frictional:
        bodies.torque[0, :, :] = 0.0


@_compiled
def gather(bodies: kernels.Bodies, motion: Motion, frictional: bool) -> None:
    """Give the forces and torques on images to their spheres."""
    force, torque = bodies.force[0], bodies.torque[0]
    n = motion.velocity.shape[0]
    for g in range(motion.owner.size):
        i = motion.owner[g]
        for k in range(3):
            force[i, k] += force[n + g, k]
            if frictional:
                torque[i, k] += torque[n + g, k]


@_compiled
def _trace(bodies: kernels.Bodies) -> float:
    """Sum over spheres and images of position times force, N m: three times the volume times the pressure.

    Forces come in pairs: it is the sum over contacts of force times way between the centres.
    """
    state, force = bodies.state, bodies.force[0]
    total = 0.0
    for i in range(state.shape[0]):
        total += state[i, X] * force[i, 0] + state[i, X + 1] * force[i, 1] + state[i, X + 2] * force[i, 2]
    return total


@_compiled
def _axial(bodies: kernels.Bodies) -> float:
    """Sum over spheres and images of height times vertical force, N m: the volume times the stress along the axis."""
    total = 0.0
    for i in range(bodies.state.shape[0]):
        total += bodies.state[i, X + 2] * bodies.force[0, i, 2]
    return total


@_compiled
def move(bodies: kernels.Bodies, motion: Motion, time_step: float, frictional: bool) -> float:
    """Kick and move the spheres and the box by one step; return the largest speed in the box, m/s."""
    state, spin, force, torque = bodies.state, bodies.spin, bodies.force[0], bodies.torque[0]
    velocity, box = motion.velocity, motion.box
    fastest = 0.0
    for i in range(velocity.shape[0]):
        half = 0.5 * motion.drag[i] * time_step
        keep, kick = (1.0 - half) / (1.0 + half), time_step / (1.0 + half) / state[i, MASS]
        square = 0.0
        for k in range(3):
            v = keep * velocity[i, k] + kick * force[i, k]
            velocity[i, k] = v
            square += v * v
            state[i, X + k] += time_step * (v + box[1, k] * state[i, X + k])
        fastest = max(fastest, square)
        if frictional:
            turn = kick / (0.4 * state[i, RADIUS] * state[i, RADIUS])
            for k in range(3):
                spin[i, k] = keep * spin[i, k] + turn * torque[i, k]
    for k in range(3):
        box[0, k] *= 1.0 + box[1, k] * time_step
    return math.sqrt(fastest)


@_compiled
def room_left(state: FloatArray, sides: FloatArray, reach: Reach) -> float:
    """Way, m, by which no pair that is not listed has come too near, from how spheres have moved in the box."""
    scales = sides / reach.sides
    scale = float(min(scales[0], scales[1], scales[2]))  # no distance in the box shrinks by more
    farthest = 0.0
    for i in range(reach.reference.shape[0]):
        square = 0.0
        for k in range(3):
            moved = state[i, X + k] - scales[k] * reach.reference[i, k]
            square += moved * moved
        farthest = max(farthest, square)
    return scale * reach.skin - max(1.0 - scale, 0.0) * reach.widest - 2.0 * math.sqrt(farthest)


@_compiled
def _fastest(velocity: FloatArray) -> float:
    """Return the largest speed in the box, m/s."""
    fastest = 0.0
    for i in range(velocity.shape[0]):
        fastest = max(fastest, velocity[i, 0] ** 2 + velocity[i, 1] ** 2 + velocity[i, 2] ** 2)
    return math.sqrt(fastest)


@cache
def make_advance(attraction: int, frictional: bool, uniaxial: bool) -> Callable[..., tuple[int, bool]]:
    """Compile the time loop for one kind of scene: what it doesn't need is not in its code.

    A ``uniaxial`` box is led to a stress along z, and keeps its other sides.
    """

    @cached_njit(error_model="numpy", fastmath=FUSED)
    def advance(
        steps: int,
        bodies: kernels.Bodies,
        motion: Motion,
        pairs: kernels.Pairs,
        law: kernels.Law,
        servo: Servo,
        reach: Reach,
    ) -> tuple[int, bool]:
        """Advance up to ``steps``; return the steps done, and whether the pairs must be listed anew.

        Real distances are taken only when the sum of the largest speeds says so.
        """
        time_step, box = law.time_step, motion.box
        strained = 0.5 * servo.fastest * (reach.widest + reach.skin)  # by what the box alone brings a sphere nearer
        count = (bodies.state.shape[0] + kernels.PATCH - 1) // kernels.PATCH
        patches = kernels.Patches(np.zeros(count), np.zeros(count))
        speed = _fastest(motion.velocity)
        room, limit, picked = 0.0, 0.0, 0
        for done in range(steps):
            place_images(bodies, motion, frictional)
            if picked == 0 or speed > limit:
                picked, limit = kernels.NEAR_STEPS, SPEED_ROOM * speed
                patches.limit[:] = limit + strained
                kernels.pick_near(0, bodies.state, pairs, patches, law)
            picked -= 1
            _clear(bodies, frictional)
            pair_kernels.pair_forces(0, bodies, pairs, law, time_step, attraction, frictional)
            volume = box[0, 0] * (box[0, 1] * box[0, 2])
            pressure = _axial(bodies) / volume if uniaxial else _trace(bodies) / (3.0 * volume)
            gather(bodies, motion, frictional)
            rate = servo.fastest * min(max((pressure - servo.stress) / servo.stress, -1.0), 1.0)
            box[1, 2] = rate
            if not uniaxial:
                box[1, 0] = box[1, 1] = rate
            speed = move(bodies, motion, time_step, frictional)
            room -= time_step * (2.0 * speed + abs(rate) * (reach.widest + reach.skin))
            if not room > 0.0:
                room = room_left(bodies.state, box[0], reach)
                if not room > LEAST_ROOM * reach.skin:
                    return done + 1, True
        return steps, False

    compiled: Callable[..., tuple[int, bool]] = advance
    return compiled


@_compiled
def _contact_force(
    i: int,
    pair: int,
    bodies: kernels.Bodies,
    pairs: kernels.Pairs,
    law: kernels.Law,
    alone: kernels.Bodies,
    attraction: int,
    frictional: bool,
) -> float:
    """Magnitude of the force in one contact, N: the law applied to its two spheres ``alone``."""
    literally(attraction), literally(frictional)
    j = pairs.neighbour[pair] & INDEX_MASK
    alone.state[0], alone.state[1] = bodies.state[i], bodies.state[j]
    if frictional:
        alone.spin[0], alone.spin[1] = bodies.spin[i], bodies.spin[j]
    _clear(alone, frictional)
    here, one = np.zeros(1, dtype=np.uint64), np.ones(1, dtype=np.uint64)
    other = np.full(1, np.uint32(1) | (pair_kernels.SAME_IMAGE << pair_kernels.IMAGE_SHIFT), dtype=np.uint32)
    constants, spring = pairs.constants[pair : pair + 1], pairs.spring[:1].copy()
    if frictional:
        spring[0] = pairs.spring[pair]
    which, near = np.zeros(1, dtype=np.uint32), np.ones((2, 1 + pair_kernels.VECTOR))
    near[0, 0], near[1, 0] = constants[0, 0], constants[0, 1]
    halo = np.zeros((1, 2), dtype=np.int64)
    lone = kernels.Pairs(np.array([0, 1]), halo, here, one, other, constants, spring, one, which, other, near, which)
    pair_kernels.pair_forces(0, alone, lone, law, 0.0, attraction, frictional)
    force = alone.force[0, 0]
    return math.sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2])


@cache
def make_measure(attraction: int, frictional: bool) -> Callable[..., Averages]:
    """Compile the averages for one kind of scene."""

    @cached_njit(error_model="numpy", fastmath=FUSED)
    def measure(bodies: kernels.Bodies, motion: Motion, pairs: kernels.Pairs, law: kernels.Law) -> Averages:
        """Take the averages of the present state; it and the springs stay as they are."""
        place_images(bodies, motion, frictional)
        _clear(bodies, frictional)
        state, force, n = bodies.state, bodies.force[0], motion.velocity.shape[0]
        alone = kernels.Bodies(np.empty((2, 8)), np.zeros((2, 3)), np.zeros((1, 2, 4)), np.zeros((1, 2, 4)))
        stress, contacts, total, overlap = np.zeros((3, 3)), 0, 0.0, 0.0
        for i in range(n):
            for p in range(pairs.first[i], pairs.last[i]):
                j = pairs.neighbour[p] & INDEX_MASK
                way = state[i, X : X + 3] - state[j, X : X + 3]
                touching = state[i, RADIUS] + state[j, RADIUS]
                apart = math.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
                if apart >= touching:
                    continue
                total += _contact_force(i, p, bodies, pairs, law, alone, attraction, frictional)
                contacts += 1
                overlap += 1.0 - apart / touching
                for a in range(3):
                    force[i, a] += alone.force[0, 0, a]
                    force[j, a] += alone.force[0, 1, a]
                    for b in range(3):
                        stress[a, b] += way[a] * alone.force[0, 0, b]
        gather(bodies, motion, False)
        net = 0.0
        for i in range(n):
            net += math.sqrt(force[i, 0] * force[i, 0] + force[i, 1] * force[i, 1] + force[i, 2] * force[i, 2])
        many = max(contacts, 1)
        volume = motion.box[0, 0] * (motion.box[0, 1] * motion.box[0, 2])
        return Averages(stress / volume, net / n, total / many, contacts, overlap / many)

    compiled: Callable[..., Averages] = measure
    return compiled
