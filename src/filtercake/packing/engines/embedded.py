"""The embedded engine: the same contact law as LIGGGHTS, compiled on the spot, from pip alone.

Only what moves is computed: spheres still in free fall follow one known parabola and join the bed, with its
pairs and forces, when they come near it.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numba import get_num_threads, set_num_threads

from filtercake import __version__, contact
from filtercake.errors import EngineError
from filtercake.packing.cloud import Cloud
from filtercake.packing.engines import embedded_kernels as kernels
from filtercake.packing.engines.base import SettleRequest, parallelism
from filtercake.packing.pictures import write_vtk
from filtercake.packing.result import SettledState
from filtercake.packing.settling import Trajectory
from filtercake.packing.spec import PackingSpec
from filtercake.units import GRAVITY, FloatArray, IntArray

SKIN_DIAMETERS = 0.15
"""Neighbour skin over the smallest diameter."""
HORIZON_STEPS = 64
"""Most time steps between two listings of pairs; how far ahead airborne spheres are woken."""
PROGRESS_SECONDS = 20.0
CHECKS_PER_PICTURE = 4


class Embedded:
    """Numba kernels for the Hertz + SJKR contact law with optional friction, in double precision."""

    name = "embedded"

    def why_missing(self) -> str | None:
        """Never missing: it comes with the package."""
        return None

    def settle(self, request: SettleRequest) -> SettledState:
        """Let the cloud settle (see :class:`filtercake.packing.engines.base.Engine`)."""
        started = time.monotonic()
        threads = parallelism(request.spec)
        if threads > 1:
            set_num_threads(min(threads, get_num_threads()))
        bed = Bed.from_cloud(request.cloud, request.spec, threads)
        trajectory = _settle(bed, request, started)
        position, velocity = bed.state()
        return SettledState(
            position=position,
            velocity=velocity,
            radius=request.cloud.radius,
            length=bed.length,
            trajectory=trajectory,
            steps=bed.step,
            expected=request.cloud.radius.size,
            dangerous_builds=0,
            engine=self.name,
            engine_version=__version__,
            wall_time=time.monotonic() - started,
        )


def _settle(bed: Bed, request: SettleRequest, started: float) -> Trajectory:
    """Advance from check to check until the stop rule holds or its patience ends."""
    rule, spec = request.rule, request.spec
    records = [bed.record()]
    peak, calm, reported = 0.0, 0, started
    for check in range(rule.max_checks):
        if spec.write_vtk and check % CHECKS_PER_PICTURE == 0:
            write_vtk(request.folder / f"packing_{bed.step}.vtk", *bed.state(), request.cloud.radius)
        bed.advance(rule.check_steps)
        records.append(bed.record())
        (_, before, _, _), (_, after, energy, _) = records[-2:]
        if not math.isfinite(after + energy):
            raise EngineError("the bed exploded: positions are no longer finite; use a shorter time step")
        peak = max(peak, energy)
        calm = calm + 1 if rule.is_calm(before, after, energy, peak) else 0
        if calm >= rule.calm_checks:
            break
        now = time.monotonic()
        if spec.time_limit > 0.0 and now - started > spec.time_limit:
            raise EngineError(f"time limit of {spec.time_limit:g} s reached; the packing was stopped", transient=True)
        if now - reported > PROGRESS_SECONDS:
            reported = now
            request.progress(f"step {bed.step:,}, {bed.count:,} of {bed.total:,} spheres down")
    return Trajectory(*np.array(records, dtype=np.float64).T)


@dataclass
class Pairs:
    """Pair list of the spheres in the bed; arrays as :mod:`embedded_kernels` describes them."""

    first: IntArray
    neighbour: np.ndarray[tuple[int], np.dtype[np.int32]]
    image: np.ndarray[tuple[int], np.dtype[np.int8]]
    constants: FloatArray
    spring: FloatArray

    @classmethod
    def empty(cls, capacity: int, frictional: bool) -> Pairs:
        """Make an empty list with room for ``capacity`` pairs."""
        return cls(
            np.zeros(1, dtype=np.int64),
            np.empty(capacity, dtype=np.int32),
            np.empty(capacity, dtype=np.int8),
            np.empty((capacity, 6 if frictional else 4)),
            np.zeros((capacity if frictional else 1, 3)),
        )


class Bed:
    """Spheres in the bed, spheres still in free fall, and the time loop.

    The first ``count`` rows of the arrays are the bed, sorted into cells; the rest is airborne, lowest first.
    Airborne rows hold the state at release.
    """

    def __init__(
        self,
        position: FloatArray,
        velocity: FloatArray,
        radius: FloatArray,
        length: float,
        spec: PackingSpec,
        gravity: float = GRAVITY,
        threads: int = 1,
    ):
        """Start from positions (n, 3) m, velocities (n, 3) m/s and radii (n,) m; every sphere is in the bed."""
        self.gravity = gravity
        n = radius.size
        self.spec, self.length, self.total = spec, length, n
        self.frictional = spec.friction > 0.0
        self.position, self.velocity = position.copy(), velocity.copy()
        self.radius = radius.copy()
        self.mass = spec.density * 4.0 / 3.0 * np.pi * radius**3
        self.spin = np.zeros((n, 3))
        self.threads = threads
        self.force = np.zeros((threads, n, 3))
        self.torque = np.zeros((threads, n if self.frictional else 1, 3))
        self.bounds = np.zeros(threads + 1, dtype=np.int64)
        self.floor_spring = np.zeros((n, 2))
        self.reference = np.zeros((n, 3))
        self.identity = np.arange(n)
        self.level = np.floor(np.log2(radius.max() / radius) + 1e-12).astype(np.int64)
        self.largest = np.array(
            [radius[self.level == k].max(initial=0.0) for k in range(int(self.level.max()) + 1)], dtype=np.float64
        )
        self.skin = spec.skin or SKIN_DIAMETERS * 2.0 * float(radius.min())
        self.cell_size = np.maximum(2.0 * self.largest, 2.0 * float(radius.min())) + self.skin
        self.ceiling = 5.0 * max(length, float(position[:, 2].max(initial=0.0)))
        self.count = n
        self.step = 0
        self.ready, self.starting, self.listed = False, True, False
        self.horizon = 0  # step at which airborne spheres are looked at again
        self.evaluated = -1  # step whose positions the forces and springs belong to
        self.pairs = Pairs.empty(8 * n + 64, self.frictional)
        self.kernel = kernels.make_advance(spec.cohesion > 0.0, self.frictional, threads > 1)
        self._set_material()

    @classmethod
    def from_cloud(cls, cloud: Cloud, spec: PackingSpec, threads: int = 1) -> Bed:
        """Start from a cloud of spheres falling together: all airborne."""
        bottom = cloud.position[:, 2] - cloud.radius
        order = np.argsort(bottom, kind="stable")
        velocity = np.zeros_like(cloud.position)
        velocity[:, 2] = -spec.settling_velocity
        bed = cls(cloud.position[order], velocity, cloud.radius[order], cloud.length, spec, threads=threads)
        bed.identity = order
        bed.count = 0
        bed.starting = False
        return bed

    def _set_material(self) -> None:
        spec = self.spec
        self.modulus = contact.effective_modulus(spec.youngs_modulus, spec.poisson_ratio)
        shear = contact.shear_modulus(spec.youngs_modulus, spec.poisson_ratio)
        self.shear_modulus = shear / (2.0 * (2.0 - spec.poisson_ratio))
        self.damping_ratio = contact.damping_ratio(spec.restitution)
        damping = 2.0 * math.sqrt(5.0 / 6.0) * self.damping_ratio
        root = np.sqrt(self.radius)
        self.floor = np.column_stack(
            [
                4.0 / 3.0 * self.modulus * root,
                damping * np.sqrt(2.0 * self.modulus * root * self.mass),
                8.0 * self.shear_modulus * root,
                damping * np.sqrt(8.0 * self.shear_modulus * root * self.mass),
            ]
        )

    def fallen(self, step: int) -> float:
        """Distance an airborne sphere has fallen after ``step`` steps, m."""
        t = step * self.spec.time_step
        return self.spec.settling_velocity * t + 0.5 * self.gravity * t * t

    def advance(self, steps: int) -> None:
        """Advance by ``steps`` time steps; afterwards the forces at the positions are known."""
        end = self.step + steps
        while self.step < end or (self.count and not self.ready):
            if not self.listed:
                self._wake(self.step + HORIZON_STEPS)
                if self.count == 0:
                    self.step = min(end, self._first_wake(end))
                    continue
                self._list_pairs()
            if self.count < self.total and self.step >= self.horizon:
                self.listed = False
                continue
            until = min(end, self.horizon) if self.count < self.total else end
            done = self._run(until - self.step)
            self.step += done

    def _run(self, steps: int) -> int:
        n, pairs, spec = self.count, self.pairs, self.spec
        done, self.ready = self.kernel(
            steps,
            self.ready,
            self.starting,
            not self.ready and (self.starting or self.evaluated == self.step),
            self.position[:n],
            self.velocity[:n],
            self.spin[:n],
            self.force,
            self.torque,
            self.radius[:n],
            self.mass[:n],
            self.floor[:n],
            self.floor_spring[:n],
            self.bounds,
            pairs.first,
            pairs.neighbour,
            pairs.image,
            pairs.constants,
            pairs.spring,
            self.reference[:n],
            self.length,
            self.gravity,
            spec.cohesion,
            spec.friction,
            spec.time_step,
            0.5 * self.skin,
        )
        self.starting = self.starting and done == 0
        self.evaluated = self.step + done if self.ready else -1
        self.listed = self.ready
        return int(done)

    def _wake(self, until: int) -> None:
        """Move airborne spheres that may touch the bed before step ``until`` into the bed."""
        first = self.count
        if first == self.total:
            return
        top = float((self.position[:first, 2] + self.radius[:first]).max()) if first else 0.0
        bottom = self.position[first:, 2] - self.radius[first:] - self.fallen(until)
        last = first + int(np.searchsorted(bottom, top + self.skin))
        if last == first:
            return
        self.position[first:last, 2] -= self.fallen(self.step)
        # velocities are kept half a step back
        self.velocity[first:last, 2] -= self.gravity * (self.step - 0.5) * self.spec.time_step
        self.count = last
        self.ready = False

    def _first_wake(self, end: int) -> int:
        """First step at which a sphere comes near the floor, at most ``end``, at least one further."""
        lowest = float(self.position[0, 2] - self.radius[0])
        low, high = self.step + 1, end
        if self.fallen(high + HORIZON_STEPS) < lowest - self.skin:
            return end
        while low < high:
            middle = (low + high) // 2
            if self.fallen(middle + HORIZON_STEPS) >= lowest - self.skin:
                high = middle
            else:
                low = middle + 1
        return low

    def _list_pairs(self) -> None:
        """Sort the bed into cells and list its pairs anew; tangential springs are carried over."""
        n = self.count
        self.position[:n, :2] %= self.length
        top = float(self.position[:n, 2].max())
        if not top < self.ceiling:
            raise EngineError("the bed exploded: spheres fly far above where they started; use a shorter time step")
        order, start, shape, offset = kernels.sort_into_cells(
            self.position[:n], self.level[:n], self.cell_size, self.length, max(top, 0.0)
        )
        for array in self._arrays():
            array[:n] = array[:n][order]  # forces are not carried along: pairs are listed when they are unknown
        old = self.pairs
        new = Pairs.empty(old.neighbour.size, self.frictional) if self.frictional else old
        first = np.empty(n + 1, dtype=np.int64)
        grid = kernels.Grid(start, shape, offset, self.largest, self.cell_size)
        count = self._find_pairs(grid, first, new)
        if count > new.neighbour.size:
            new = Pairs.empty(int(1.5 * count), self.frictional)
            self._find_pairs(grid, first, new)
        new.first = first
        kernels.pair_constants(
            self.radius[:n],
            self.mass[:n],
            first,
            new.neighbour,
            self.modulus,
            self.shear_modulus,
            self.damping_ratio,
            new.constants,
        )
        if self.frictional:
            known = old.first.size - 1
            origin = np.where(order < known, order, -1)
            kernels.carry_springs(origin, old.first, old.neighbour, old.spring, first, new.neighbour, new.spring)
        self.pairs = new
        self.bounds[:] = np.searchsorted(first, np.linspace(0, first[-1], self.threads + 1))
        self.bounds[0], self.bounds[-1] = 0, n
        self.ready = False
        self.reference[:n] = self.position[:n]
        self.listed = True
        self.horizon = self.step + HORIZON_STEPS

    def _find_pairs(self, grid: kernels.Grid, first: IntArray, pairs: Pairs) -> int:
        n = self.count
        return int(
            kernels.find_pairs(
                self.position[:n],
                self.radius[:n],
                self.level[:n],
                grid,
                self.length,
                self.skin,
                first,
                pairs.neighbour,
                pairs.image,
            )
        )

    def _arrays(self) -> tuple[np.ndarray[tuple[int, ...], np.dtype[np.generic]], ...]:
        return (
            self.position,
            self.velocity,
            self.spin,
            self.radius,
            self.mass,
            self.floor,
            self.floor_spring,
            self.identity,
            self.level,
        )

    def _now(self) -> tuple[FloatArray, FloatArray]:
        """Positions and full-step velocities in the engine's own order."""
        n = self.count
        position, velocity = self.position.copy(), self.velocity.copy()
        half = 0.0 if self.starting else 0.5 * self.spec.time_step
        velocity[:n] += half * self.force[0, :n] / self.mass[:n, None]
        position[n:, 2] -= self.fallen(self.step)
        velocity[n:, 2] -= self.gravity * self.step * self.spec.time_step
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
            spin[: self.count] += (0.5 * self.spec.time_step * self.torque[0] / inertia[:, None])[: self.count]
        return spin[np.argsort(self.identity)]

    def record(self) -> tuple[float, float, float, float]:
        """Time s, mean height m, kinetic energy J, and the paper's sample porosity."""
        position, velocity = self._now()
        height = float(np.average(position[:, 2], weights=self.mass))
        energy = float(0.5 * np.sum(self.mass * np.sum(velocity**2, axis=1)))
        sampled = (position[:, 2] >= 0.0) & (position[:, 2] <= self.length)
        porosity = 1.0 - float(self.mass[sampled].sum()) / self.spec.density / self.length**3
        return self.step * self.spec.time_step, height, energy, porosity
