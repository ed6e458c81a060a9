"""The bed of the embedded engine: spheres that have met something, spheres still falling, and the time loop.

Only what moves relative to something is computed: spheres in free fall follow one known parabola and join the bed,
with its pairs and forces, when something that has left the parabola comes near them.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from typing import Any

import numba
import numpy as np

from filtercake.errors import EngineError
from filtercake.packing import contact_law
from filtercake.packing.cloud import Cloud, size_levels
from filtercake.packing.engines import embedded_kernels as kernels
from filtercake.packing.engines import pair_kernels
from filtercake.packing.engines.vector_kernels import FORCE, VECTOR, aligned
from filtercake.packing.scene import Scene
from filtercake.units import GRAVITY, FloatArray, IntArray

LISTING_STEPS = 200
"""Time steps that a list of pairs lasts, unless a sphere leaves the room it was given."""
LEAST_ROOM = 0.04
"""Least room of a sphere, over the smallest diameter."""
FAST_DIAMETERS, FAST_SHARE = 0.3, 0.03
"""Spheres that find their neighbours themselves, so that the others need not look as far: they may get farther than
this over the smallest diameter while the list lasts, and are no more than this share of all."""
CELL_DIAMETERS = 1.1
"""Least side of a grid's cells, over the largest diameter of its level."""
WAKING_FALLS = 2.5
"""Height over the bed up to which falling spheres join it, over what they fall while a list lasts.

What lies there rises as they come down: it meets them from 2.2 falls above.
"""
CEILING_BOXES = 5.0
"""Height over the box side, or over the cloud's, at which a bed counts as exploded."""


SIZED_ARRAYS = ("watched", "grounded")
"""Arrays whose size changes."""
STATE_ARRAYS = (
    "spheres",
    "floor",
    "identity",
    "level",
    "touched",
    "spin",
    "floor_spring",
    "reference",
    "course",
    "room",
    *SIZED_ARRAYS,
)
STATE_NUMBERS = ("count", "step", "ready", "starting", "listed", "listed_at")


def _no_pairs(threads: int, capacity: int, frictional: bool) -> kernels.Pairs:
    """Make an empty pair list with room for ``capacity`` pairs."""
    return kernels.Pairs(
        bounds=np.zeros(threads + 1, dtype=np.int64),
        halo=np.zeros((threads, 2), dtype=np.int64),
        first=np.empty(0, dtype=np.uint64),
        last=np.empty(0, dtype=np.uint64),
        neighbour=np.empty(capacity, dtype=np.uint32),
        constants=np.empty((capacity, 2)),
        spring=np.zeros((capacity if frictional else 1, 3)),
        near_end=np.zeros(threads, dtype=np.uint64),
        near_owner=np.empty(capacity, dtype=np.uint32),
        near_neighbour=np.empty(capacity, dtype=np.uint32),
        near_constants=np.empty((2, capacity + VECTOR)),
        near_pair=np.empty(capacity, dtype=np.uint32),
    )


# a thread that waits for another soon sleeps: on a busy machine the other may then have its core
os.environ.setdefault("GOMP_SPINCOUNT", "3000")
# of the thread pools, the one with the least cost per parallel part of a time step comes first
numba.config.THREADING_LAYER_PRIORITY = ["omp", "tbb", "workqueue"]  # type: ignore[attr-defined]


def use_threads(count: int) -> None:
    """Let the kernels take up to ``count`` threads."""
    numba.set_num_threads(min(count, numba.get_num_threads()))


class Bed:
    """Spheres in the bed, spheres still in free fall, and the time loop.

    The first ``count`` rows of the arrays are in the bed, sorted into cells; the rest is airborne, lowest first.
    Airborne rows hold the state at release. Spheres in the bed that nothing has touched yet still fall on the
    parabola; they are there because the touched ones may soon reach them.
    """

    def __init__(
        self,
        position: FloatArray,
        velocity: FloatArray,
        radius: FloatArray,
        length: float,
        scene: Scene,
        gravity: float = GRAVITY,
        threads: int = 1,
    ):
        """Start from positions (n, 3) m, velocities (n, 3) m/s and radii (n,) m; every sphere is in the bed."""
        n = radius.size
        self.gravity, self.threads = gravity, threads
        self.scene, self.length, self.total = scene, length, n
        self.frictional = scene.friction > 0.0
        self.spheres = aligned(n * VECTOR).reshape(n, VECTOR)
        mass = scene.density * 4.0 / 3.0 * np.pi * radius**3
        self.spheres[...] = np.column_stack([position, radius, velocity, mass])
        self.position, self.velocity = self.spheres[:, :3], self.spheres[:, 4:7]
        self.radius, self.mass = self.spheres[:, 3], self.spheres[:, 7]
        self.spin = np.zeros((n, 3))
        self.touched = np.ones(n, dtype=np.bool_)
        self.identity = np.arange(n)
        self.floor_spring = np.zeros((n, 2))
        self.level = size_levels(radius)
        self.largest = np.array(
            [radius[self.level == k].max(initial=0.0) for k in range(int(self.level.max()) + 1)], dtype=np.float64
        )
        self.smallest = 2.0 * float(radius.min())
        self.bottom = position[:, 2] - radius  # at release; rows of airborne spheres count
        self.ceiling = CEILING_BOXES * max(length, float(position[:, 2].max(initial=0.0)))
        self._set_material()
        layers = threads + 1 if threads > 1 else 1  # memory that is never written to is never taken
        self.force = aligned(layers * n * FORCE).reshape(layers, n, FORCE)
        self.torque = np.zeros((layers, n if self.frictional else 1, FORCE))
        self.reference, self.course, self.room = np.zeros((n, 3)), np.zeros(n), np.zeros(n)
        self.watched = np.empty(0, dtype=np.int64)
        self.grounded = np.empty(0, dtype=np.int64)
        self.pairs = _no_pairs(threads, 8 * n + 64 * threads, self.frictional)
        self.count = n
        self.step = 0
        self.ready, self.starting, self.listed = False, True, False
        self.listed_at = 0  # step of the last listing
        attraction = pair_kernels.COHESION if scene.cohesion > 0.0 else pair_kernels.NO_ATTRACTION
        self.kernel = kernels.make_advance(attraction, self.frictional, threads > 1)
        self.find_pairs = kernels.make_find_pairs(threads > 1)
        self.pair_constants = kernels.make_pair_constants(threads > 1)

    @classmethod
    def from_cloud(cls, cloud: Cloud, scene: Scene, threads: int = 1) -> Bed:
        """Start from a cloud of spheres falling together: all airborne."""
        order = np.argsort(cloud.position[:, 2] - cloud.radius, kind="stable")
        velocity = np.zeros_like(cloud.position)
        velocity[:, 2] = -scene.settling_velocity
        bed = cls(cloud.position[order], velocity, cloud.radius[order], cloud.length, scene, threads=threads)
        bed.identity = order
        bed.touched[:] = False
        bed.count = 0
        bed.starting = False
        return bed

    def _set_material(self) -> None:
        scene = self.scene
        self.modulus = contact_law.effective_modulus(scene.youngs_modulus, scene.poisson_ratio)
        self.damping_ratio = contact_law.damping_ratio(scene.restitution)
        self.law = kernels.Law(
            float(self.gravity),
            float(scene.cohesion),
            float(scene.friction),
            contact_law.shear_stiffness_ratio(scene.youngs_modulus, scene.poisson_ratio),
            contact_law.shear_damping_ratio(scene.youngs_modulus, scene.poisson_ratio),
            float(self.length),
            float(scene.time_step),
        )
        damping = 2.0 * math.sqrt(5.0 / 6.0) * self.damping_ratio
        root = np.sqrt(self.radius)
        self.floor = np.column_stack(
            [4.0 / 3.0 * self.modulus * root, damping * np.sqrt(2.0 * self.modulus * root * self.mass)]
        )

    def saved(self) -> dict[str, Any]:
        """Everything that decides how the bed goes on, to the last bit."""
        arrays = {name: getattr(self, name) for name in STATE_ARRAYS}
        pairs = {f"pairs_{name}": value for name, value in self.pairs._asdict().items()}
        totals = np.stack([self.force[0], self.torque[0] if self.frictional else np.zeros_like(self.force[0])])
        numbers = np.array([getattr(self, name) for name in STATE_NUMBERS], dtype=np.float64)
        return {**arrays, **pairs, "totals": totals, "numbers": numbers}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on from what :meth:`saved` returned for a bed of the same cloud, scene and number of threads.

        Raises
        ------
        KeyError, ValueError
            If it is not such a state.
        """
        for name in STATE_ARRAYS:
            own = getattr(self, name)
            if name in SIZED_ARRAYS:
                setattr(self, name, np.array(saved[name], dtype=own.dtype))
            else:
                own[...] = saved[name]
        self.pairs = kernels.Pairs(*(np.array(saved[f"pairs_{name}"]) for name in kernels.Pairs._fields))
        if self.pairs.bounds.size != self.threads + 1:
            raise ValueError("the state is of a bed with another number of threads")
        self.force[0] = saved["totals"][0]
        if self.frictional:
            self.torque[0] = saved["totals"][1]
        for name, value in zip(STATE_NUMBERS, saved["numbers"], strict=True):
            setattr(self, name, type(getattr(self, name))(value))

    @property
    def down(self) -> int:
        """Number of spheres that have met the floor or another sphere."""
        return int(self.touched[: self.count].sum())

    def fallen(self, step: int) -> float:
        """Distance an airborne sphere has fallen after ``step`` steps, m."""
        t = step * self.scene.time_step
        return self.scene.settling_velocity * t + 0.5 * self.gravity * t * t

    def falling_speed(self, step: float) -> float:
        """Speed of an airborne sphere after ``step`` steps, m/s."""
        return self.scene.settling_velocity + self.gravity * step * self.scene.time_step

    def advance(self, steps: int) -> None:
        """Advance by ``steps`` time steps; afterwards the forces at the positions are known."""
        end = self.step + steps
        while self.step < end or (self.count and not self.ready):
            if not self.listed:
                self._prepare()
                if self.count == 0:
                    self.step = min(end, self._first_wake(end))
                    continue
            self.step += self._run(end - self.step)

    def _run(self, steps: int) -> int:
        n = self.count
        moment = kernels.Moment(self.ready, self.starting, self.step - self.listed_at)
        bodies = kernels.Bodies(self.spheres[:n], self.spin[:n], self.force, self.torque)
        floor = kernels.Floor(self.floor[:n], self.floor_spring[:n], self.grounded)
        done, self.ready = self.kernel(steps, moment, bodies, floor, self.pairs, self._listing(), self.law)
        self.starting = self.starting and done == 0
        self.listed = self.ready
        return int(done)

    def _listing(self) -> kernels.Listing:
        n = self.count
        return kernels.Listing(self.reference[:n], self.course[:n], self.room[:n], self.watched, LISTING_STEPS)

    def _prepare(self) -> None:
        """Wake the airborne spheres that the bed may reach, and list the pairs."""
        order = self._sort()
        self._give_room()
        while self._wake():  # what was woken may be about to meet the floor itself
            self._give_room()
        if self.count:
            self._list_pairs(order)
            self._watch()

    def _sort(self) -> IntArray:
        """Sort the bed so that spheres close in space are close in memory; return where each stood before."""
        n = self.count
        if n == 0:
            return np.empty(0, dtype=np.int64)
        sideways = self.position[:n, :2]
        away = (sideways < 0.0) | (sideways >= self.length)
        sideways[away] %= self.length
        if not float(self.position[:n, 2].max()) < self.ceiling:
            raise EngineError(
                "the bed exploded: spheres fly far above where they started; use a shorter time step",
                outcome="exploded",
            )
        # spheres of any size together: by small cubes
        order = self._by_cell(self.spheres[:n], np.zeros(n, dtype=np.int64), self.largest[:1])[0]
        for array in self._arrays():
            array[:n] = array[:n].take(order, axis=0)
        return order

    def _by_cell(
        self, spheres: FloatArray, level: IntArray, cell_size: FloatArray
    ) -> tuple[IntArray, IntArray, IntArray, IntArray]:
        top = max(float(spheres[:, 2].max()), 0.0)
        return kernels.sort_into_cells(spheres, level, cell_size, self.length, top)

    def _give_room(self) -> None:
        """Give each sphere a course and room to leave it, and note which have left the parabola, or may yet.

        A sphere that another has touched moves sideways; until then its sideways velocity is nothing to the last bit.
        One that may meet the floor before the next look counts as touched.
        """
        n = self.count
        least = 0.5 * self.scene.skin if self.scene.skin > 0.0 else LEAST_ROOM * self.smallest
        kernels.give_room(self.spheres[:n], self.law, least, self._listing())
        self.touched[:n] |= (self.velocity[:n, 0] != 0.0) | (self.velocity[:n, 1] != 0.0)
        self.touched[:n] |= self._may_land()

    def _may_land(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Whether each sphere may meet the floor while the list lasts."""
        n = self.count
        falls = LISTING_STEPS * np.maximum(-self.course[:n], 0.0) + self.room[:n]
        return np.asarray(self.position[:n, 2] - self.radius[:n] < falls)

    def _tops(self) -> FloatArray:
        """Greatest height that each sphere may reach while the list lasts, m."""
        n = self.count
        rise = LISTING_STEPS * np.maximum(self.course[:n], 0.0) + self.room[:n]
        return np.asarray(self.position[:n, 2] + self.radius[:n] + rise)

    def _fall(self, step: int) -> float:
        """Distance that an airborne sphere falls while a list of this step lasts, m."""
        return self.fallen(step + LISTING_STEPS) - self.fallen(step)

    def _line(self, step: int, top: float) -> float:
        """Height at release, m, below which spheres join a bed of height ``top`` (m) at a step."""
        return top + WAKING_FALLS * self._fall(step) + self.fallen(step)

    def _wake(self) -> bool:
        """Move the airborne spheres that the touched ones may reach soon into the bed; say whether there were any."""
        first = self.count
        if first == self.total:
            return False
        top = float(self._tops()[self.touched[:first]].max(initial=0.0))
        last = first + int(np.searchsorted(self.bottom[first:], self._line(self.step, top)))
        self.position[first:last, 2] -= self.fallen(self.step)
        # velocities are kept half a step back
        self.velocity[first:last, 2] = -self.falling_speed(self.step - 0.5)
        self.force[0, first:last] = 0.0
        self.force[0, first:last, 2] = -self.gravity * self.mass[first:last]
        self.count = last
        return last > first

    def _first_wake(self, end: int) -> int:
        """First step at which a sphere comes near the floor, at most ``end``, at least one further."""
        low, high = self.step + 1, end
        while low < high:
            middle = (low + high) // 2
            if self.bottom[0] < self._line(middle, 0.0):
                high = middle
            else:
                low = middle + 1
        return low

    def _watch(self) -> None:
        """Note the spheres that may meet the floor, and those that may have airborne neighbours.

        The time loop stops when one of the latter is touched: until then it falls as they do.
        """
        n = self.count
        self.grounded = np.flatnonzero(self._may_land())
        if n == self.total:
            self.watched = np.empty(0, dtype=np.int64)
            return
        lowest = self.bottom[n] - self.fallen(self.step)
        self.watched = np.flatnonzero(self._tops() + self._fall(self.step) > lowest)

    def _list_pairs(self, order: IntArray) -> None:
        """List the bed's pairs anew; tangential springs are carried over from where the spheres stood (``order``)."""
        n = self.count
        pairs = self._find_pairs(self._grid())
        self._share_work(pairs)
        self.pair_constants(self.spheres[:n], pairs, self.modulus, self.damping_ratio)
        if self.frictional:
            origin = np.full(n, -1)
            origin[: order.size] = np.where(order < self.pairs.first.size, order, -1)  # the first list has none before
            kernels.carry_springs(origin, self.pairs, pairs)
        self.pairs = pairs
        self.reference[:n] = self.position[:n]
        self.listed, self.listed_at = True, self.step

    def _grid(self) -> kernels.Grid:
        """Sort the spheres into the cells of their size levels."""
        n, levels = self.count, self.largest.size
        spheres, level = self.spheres[:n], self.level[:n]
        cell_size = CELL_DIAMETERS * np.maximum(2.0 * self.largest, self.smallest)
        index, start, shape, offset = self._by_cell(spheres, level, cell_size)
        place = np.empty_like(index)
        place[index] = np.arange(n)
        stride = self.room[:n] + LISTING_STEPS * np.abs(self.course[:n])
        fast = stride > max(FAST_DIAMETERS * self.smallest, float(np.quantile(stride, 1.0 - FAST_SHARE)))
        strides = np.zeros((2, levels))
        np.maximum.at(strides[0], level[~fast], stride[~fast])
        np.maximum.at(strides[1], level, stride)
        return kernels.Grid(
            length=self.length,
            level=level,
            columns=kernels.in_cells(index, spheres, self.course[:n], self.radius[:n] + self.room[:n], fast),
            fast=fast[index],
            member=index,
            place=place,
            start=start,
            shape=shape,
            offset=offset,
            largest=self.largest,
            cell_size=cell_size,
            stride=strides,
            horizon=LISTING_STEPS,
        )

    def _find_pairs(self, grid: kernels.Grid) -> kernels.Pairs:
        n, capacity = self.count, self.pairs.neighbour.size
        # without springs to carry over, the old list's room serves again
        pairs = _no_pairs(self.threads, capacity, True) if self.frictional else self.pairs
        bounds = np.linspace(0, n, self.threads + 1).astype(np.int64)
        first, last = np.empty(n, dtype=np.uint64), np.empty(n, dtype=np.uint64)
        while True:
            pairs = pairs._replace(bounds=bounds, first=first, last=last)
            count = self.find_pairs(self.spheres[:n], grid, pairs)
            if count < pairs.neighbour.size // self.threads:
                return pairs
            pairs = _no_pairs(self.threads, int(1.3 * count) * self.threads, self.frictional)

    def _share_work(self, pairs: kernels.Pairs) -> None:
        """Give every thread as many pairs as the others, and note whose spheres they act on."""
        if self.threads == 1:
            return
        done = np.cumsum(pairs.last - pairs.first)
        shares = np.arange(1, self.threads) * (done[-1] / self.threads)
        pairs.bounds[1:-1] = np.searchsorted(done, shares)
        kernels.find_halos(pairs)

    def _arrays(self) -> tuple[np.ndarray[tuple[int, ...], np.dtype[np.generic]], ...]:
        arrays = [self.spheres, self.floor, self.force[0], self.identity, self.level, self.touched]
        return (*arrays, self.spin, self.torque[0], self.floor_spring) if self.frictional else tuple(arrays)

    def _now(self) -> tuple[FloatArray, FloatArray]:
        """Positions and full-step velocities in the engine's own order."""
        n = self.count
        position, velocity = self.position.copy(), self.velocity.copy()
        half = 0.0 if self.starting else 0.5 * self.scene.time_step
        velocity[:n] += half * self.force[0, :n, :3] / self.mass[:n, None]
        position[n:, 2] -= self.fallen(self.step)
        velocity[n:, 2] = -self.falling_speed(self.step)
        return position, velocity

    def state(self) -> tuple[FloatArray, FloatArray]:
        """Positions (n, 3) m and velocities (n, 3) m/s in the order of the cloud, x and y in the box."""
        position, velocity = self._now()
        position[:, :2] %= self.length
        back = np.argsort(self.identity)
        return position[back], velocity[back]

    def full_spin(self) -> FloatArray:
        """Full-step angular velocities (n, 3), rad/s, in the order of the cloud."""
        spin = self.spin.copy()
        if self.frictional and not self.starting:
            inertia = 0.4 * self.mass * self.radius**2
            spin[: self.count] += (0.5 * self.scene.time_step * self.torque[0, :, :3] / inertia[:, None])[: self.count]
        return spin[np.argsort(self.identity)]

    def record(self) -> tuple[float, float, float, float]:
        """Time s, mean height m, kinetic energy J, and the paper's sample porosity."""
        position, velocity = self._now()
        height = float(np.average(position[:, 2], weights=self.mass))
        energy = float(0.5 * np.sum(self.mass * np.sum(velocity**2, axis=1)))
        sampled = (position[:, 2] >= 0.0) & (position[:, 2] <= self.length)
        porosity = 1.0 - float(self.mass[sampled].sum()) / self.scene.density / self.length**3
        return self.step * self.scene.time_step, height, energy, porosity
