"""Stokes flow on a lattice: linear two-relaxation-time lattice Boltzmann (D3Q19), as compiled kernels.

The equilibrium is linear in the velocity, so that the steady state is Stokes flow whatever the force. What is stored is
the deviation from rest.

Walls. A link that ends at a wall, q links away, sends back what went towards it, corrected by what has changed in it
in the same collision: the change of the even part times ``1 - 2 q`` puts the wall where it is for a linear profile
(Ginzburg, Verhaeghe and d'Humieres, Commun. Comput. Phys. 3 (2008) 427), that of the odd part, less the force's, times
``(2 / rate - 1) (4 q^2 - 1)`` makes it exact for a parabola. What the corrections add is taken from what rests at the
node: no mass is lost, so that the flux is the same through every plane, and the flow is stable.

Steps come in
pairs that work in place (the AA pattern of Bailey et al., ICPP 2009): the first one within each node, the second one
between neighbours, every place being read and written by one node alone, so that threads do not change a bit of it.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numba
import numpy as np
from numba import prange
from numpy.typing import NDArray

from filtercake.packing.compiled import cached_njit
from filtercake.permeability.lattice import BLOCK, DIRECTIONS, VELOCITIES, WALL_SCALE, WEIGHTS, Lattice
from filtercake.units import FloatArray, IntArray

Numbers = NDArray[Any]

RELAXATION_TIME: Final = 1.25
"""Of the even part; the flow does not depend on it, its stability does: at 1.1 it blows up."""
MAGIC: Final = 3.0 / 16.0
"""Product of the two relaxation times, each less one half: with it, straight walls lie where they are."""
MOST_BEND: Final = 1.8
"""Bound of ``4 q^2 - 1``, which walls more than 0.84 links away would exceed: beyond 2 the flow blows up."""


class Flow:
    """Flow through a lattice under a body force along z, in lattice units.

    Parameters
    ----------
    lattice : Lattice
        Where the fluid is.
    force : ndarray, shape (nz,)
        Force on a unit of fluid in each layer.
    relaxation_time : float
        Relaxation time of the even part.
    precision : dtype
        float32, or float64 to check it.
    threads : int
        Threads to work with.
    """

    def __init__(
        self,
        lattice: Lattice,
        force: FloatArray,
        *,
        relaxation_time: float = RELAXATION_TIME,
        precision: Any = np.float32,
        threads: int = 1,
    ):
        self.lattice, self.steps = lattice, 0
        self.threads = max(1, min(threads, numba.get_num_threads()))
        self.viscosity = (relaxation_time - 0.5) / 3.0
        rate_odd = 1.0 / (0.5 + MAGIC / (relaxation_time - 0.5))
        self._rates = precision(1.0 / relaxation_time), precision(rate_odd)
        w0, w1, w2 = WEIGHTS[0], WEIGHTS[1], WEIGHTS[7]
        self._constants = tuple(
            precision(c) for c in (1.0, 0.5, w0, w1, w2, 3.0 * w1, 3.0 * w2, 1.0 / WALL_SCALE, MOST_BEND)
        )
        self._force = np.empty(lattice.layer.size, dtype=precision)
        self.push(force)
        # the momentum of a fluid that has been pushed for half a step: rest, seen from the middle of the step
        self._f = np.zeros((lattice.blocks, DIRECTIONS, BLOCK), dtype=precision)
        for q in np.flatnonzero(VELOCITIES[:, 2]):
            self._f[:, q] = -1.5 * WEIGHTS[q] * VELOCITIES[q, 2] * self._force.reshape(-1, BLOCK)
        self._f = self._f.reshape(-1)

    def push(self, force: FloatArray) -> None:
        """Drive the fluid of each layer by a force (nz,)."""
        self.force = force
        self._force[:] = np.where(self.lattice.layer >= 0, force[self.lattice.layer], 0.0)

    def start_from(self, coarse: Flow) -> None:
        """Start from the flow on a coarser lattice of the same spheres and box, under the same force."""
        here, there = self.lattice, coarse.lattice
        ratio = there.spacing / here.spacing
        pressure, velocity = coarse._fields()
        # lattice units: the same gradient drives the squared ratio of velocity, over the ratio of length pressure
        velocity *= ratio**2 * coarse.viscosity / self.viscosity
        pressure *= ratio
        _prolong(self._f, here.number, self._force, there.number, pressure, velocity, ratio, VELOCITIES, WEIGHTS)

    def run(self, steps: int) -> None:
        """Advance by an even number of steps (an odd one is rounded up)."""
        pairs = (steps + 1) // 2
        lattice = self.lattice
        arrays = self._f, lattice.source, lattice.wall, self._force
        if self.threads == 1:
            advance(*arrays, lattice.blocks, *self._rates, self._constants, pairs)
        else:
            before = numba.get_num_threads()
            numba.set_num_threads(self.threads)
            try:
                advance_together(*arrays, lattice.blocks, *self._rates, self._constants, pairs, self.threads)
            finally:
                numba.set_num_threads(before)
        self.steps += 2 * pairs

    def layers(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the mean pressure in the fluid, the superficial velocity and the flux of each layer, each (nz,).

        The velocity is the sum over the layer's nodes; the flux is what crosses the faces on both sides of it, which no
        wall distorts: the same in every layer once the flow is steady, if a little less exact.
        """
        nz, ny, nx = self.lattice.shape
        sums = np.zeros((4, nz))
        _sum_layers(self._f, self._force, self.lattice.source, self.lattice.layer, self.lattice.fluid, sums)
        pressure, velocity, up, down = sums
        flux = 0.5 * (up - down + np.roll(up - down, -1))
        return pressure / np.maximum(self.lattice.fluid_per_layer(), 1), velocity / (nx * ny), flux / (nx * ny)

    def potential(self) -> FloatArray:
        """Return what drives the flow up to the middle of each layer: the force below it less the pressure, (nz,)."""
        return np.asarray(np.cumsum(self.force) - 0.5 * self.force - self.layers()[0])

    def velocity(self) -> FloatArray:
        """Return the velocity of each fluid node, shape (fluid, 3)."""
        return self._fields()[1].astype(np.float64)

    def _fields(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Pressure and velocity of each fluid node, shapes (fluid,) and (fluid, 3)."""
        pressure = np.empty(self.lattice.fluid, dtype=np.float32)
        velocity = np.empty((self.lattice.fluid, 3), dtype=np.float32)
        _moments(self._f, self._force, VELOCITIES, pressure, velocity)
        return pressure, velocity


@cached_njit(fastmath=True, inline="never")
def _collide(
    f: Numbers,
    base: int,
    wall: NDArray[np.int8],
    wbase: int,
    force: Numbers,
    fbase: int,
    rate_even: Any,
    rate_odd: Any,
    constants: Any,
) -> None:
    """Relax a block and write what goes along q to the place of its opposite, walls allowed for."""
    block = 64
    one, half, w0, w1, w2, three_w1, three_w2, unit, cap = constants
    zero = one - one
    two = one + one
    bend = two / rate_odd - one
    push = one - half * rate_odd
    for i in range(block):
        f0 = f[base + i]
        f1 = f[base + 1 * block + i]
        f2 = f[base + 2 * block + i]
        f3 = f[base + 3 * block + i]
        f4 = f[base + 4 * block + i]
        f5 = f[base + 5 * block + i]
        f6 = f[base + 6 * block + i]
        f7 = f[base + 7 * block + i]
        f8 = f[base + 8 * block + i]
        f9 = f[base + 9 * block + i]
        f10 = f[base + 10 * block + i]
        f11 = f[base + 11 * block + i]
        f12 = f[base + 12 * block + i]
        f13 = f[base + 13 * block + i]
        f14 = f[base + 14 * block + i]
        f15 = f[base + 15 * block + i]
        f16 = f[base + 16 * block + i]
        f17 = f[base + 17 * block + i]
        f18 = f[base + 18 * block + i]
        s1 = f1 + f2
        d1 = f1 - f2
        s3 = f3 + f4
        d3 = f3 - f4
        s5 = f5 + f6
        d5 = f5 - f6
        s7 = f7 + f8
        d7 = f7 - f8
        s9 = f9 + f10
        d9 = f9 - f10
        s11 = f11 + f12
        d11 = f11 - f12
        s13 = f13 + f14
        d13 = f13 - f14
        s15 = f15 + f16
        d15 = f15 - f16
        s17 = f17 + f18
        d17 = f17 - f18
        rho = f0 + s1 + s3 + s5 + s7 + s9 + s11 + s13 + s15 + s17
        jx = d1 + d7 + d9 + d11 + d13
        jy = d3 + d7 - d9 + d15 + d17
        jz = d5 + d11 - d13 + d15 - d17
        push_z = force[fbase + i]
        gx = rate_odd * jx
        gy = rate_odd * jy
        gz = rate_odd * (jz + half * push_z) + push * push_z
        leak = zero
        even = rate_even * (half * s1 - w1 * rho)
        odd = half * (one - rate_odd) * d1 + three_w1 * (gx)
        bent = bend * (half * d1 - odd)
        c = unit * wall[wbase + 1 * block + i]
        there = c * even + min(c * (c - two), cap) * bent
        c = unit * wall[wbase + 2 * block + i]
        back = c * even - min(c * (c - two), cap) * bent
        leak += there + back
        f[base + 2 * block + i] = half * s1 - even + odd + there
        f[base + 1 * block + i] = half * s1 - even - odd + back
        even = rate_even * (half * s3 - w1 * rho)
        odd = half * (one - rate_odd) * d3 + three_w1 * (gy)
        bent = bend * (half * d3 - odd)
        c = unit * wall[wbase + 3 * block + i]
        there = c * even + min(c * (c - two), cap) * bent
        c = unit * wall[wbase + 4 * block + i]
        back = c * even - min(c * (c - two), cap) * bent
        leak += there + back
        f[base + 4 * block + i] = half * s3 - even + odd + there
        f[base + 3 * block + i] = half * s3 - even - odd + back
        even = rate_even * (half * s5 - w1 * rho)
        odd = half * (one - rate_odd) * d5 + three_w1 * (gz)
        bent = bend * (half * d5 - odd + three_w1 * push_z)
        c = unit * wall[wbase + 5 * block + i]
        there = c * even + min(c * (c - two), cap) * bent
        c = unit * wall[wbase + 6 * block + i]
        back = c * even - min(c * (c - two), cap) * bent
        leak += there + back
        f[base + 6 * block + i] = half * s5 - even + odd + there
        f[base + 5 * block + i] = half * s5 - even - odd + back
        even = rate_even * (half * s7 - w2 * rho)
        odd = half * (one - rate_odd) * d7 + three_w2 * (gx + gy)
        bent = bend * (half * d7 - odd)
        c = unit * wall[wbase + 7 * block + i]
        there = c * even + min(c * (c - two), cap) * bent
        c = unit * wall[wbase + 8 * block + i]
        back = c * even - min(c * (c - two), cap) * bent
        leak += there + back
        f[base + 8 * block + i] = half * s7 - even + odd + there
        f[base + 7 * block + i] = half * s7 - even - odd + back
        even = rate_even * (half * s9 - w2 * rho)
        odd = half * (one - rate_odd) * d9 + three_w2 * (gx - gy)
        bent = bend * (half * d9 - odd)
        c = unit * wall[wbase + 9 * block + i]
        there = c * even + min(c * (c - two), cap) * bent
        c = unit * wall[wbase + 10 * block + i]
        back = c * even - min(c * (c - two), cap) * bent
        leak += there + back
        f[base + 10 * block + i] = half * s9 - even + odd + there
        f[base + 9 * block + i] = half * s9 - even - odd + back
        even = rate_even * (half * s11 - w2 * rho)
        odd = half * (one - rate_odd) * d11 + three_w2 * (gx + gz)
        bent = bend * (half * d11 - odd + three_w2 * push_z)
        c = unit * wall[wbase + 11 * block + i]
        there = c * even + min(c * (c - two), cap) * bent
        c = unit * wall[wbase + 12 * block + i]
        back = c * even - min(c * (c - two), cap) * bent
        leak += there + back
        f[base + 12 * block + i] = half * s11 - even + odd + there
        f[base + 11 * block + i] = half * s11 - even - odd + back
        even = rate_even * (half * s13 - w2 * rho)
        odd = half * (one - rate_odd) * d13 + three_w2 * (gx - gz)
        bent = bend * (half * d13 - odd - three_w2 * push_z)
        c = unit * wall[wbase + 13 * block + i]
        there = c * even + min(c * (c - two), cap) * bent
        c = unit * wall[wbase + 14 * block + i]
        back = c * even - min(c * (c - two), cap) * bent
        leak += there + back
        f[base + 14 * block + i] = half * s13 - even + odd + there
        f[base + 13 * block + i] = half * s13 - even - odd + back
        even = rate_even * (half * s15 - w2 * rho)
        odd = half * (one - rate_odd) * d15 + three_w2 * (gy + gz)
        bent = bend * (half * d15 - odd + three_w2 * push_z)
        c = unit * wall[wbase + 15 * block + i]
        there = c * even + min(c * (c - two), cap) * bent
        c = unit * wall[wbase + 16 * block + i]
        back = c * even - min(c * (c - two), cap) * bent
        leak += there + back
        f[base + 16 * block + i] = half * s15 - even + odd + there
        f[base + 15 * block + i] = half * s15 - even - odd + back
        even = rate_even * (half * s17 - w2 * rho)
        odd = half * (one - rate_odd) * d17 + three_w2 * (gy - gz)
        bent = bend * (half * d17 - odd - three_w2 * push_z)
        c = unit * wall[wbase + 17 * block + i]
        there = c * even + min(c * (c - two), cap) * bent
        c = unit * wall[wbase + 18 * block + i]
        back = c * even - min(c * (c - two), cap) * bent
        leak += there + back
        f[base + 18 * block + i] = half * s17 - even + odd + there
        f[base + 17 * block + i] = half * s17 - even - odd + back
        f[base + i] = f0 - rate_even * (f0 - w0 * rho) - leak


@cached_njit(fastmath=True)
def _within(
    f: Numbers,
    wall: NDArray[np.int8],
    force: Numbers,
    first: int,
    last: int,
    rate_even: Any,
    rate_odd: Any,
    constants: Any,
) -> None:
    size = 19 * 64
    for b in range(first, last):
        _collide(f, b * size, wall, b * size, force, b * 64, rate_even, rate_odd, constants)


@cached_njit(fastmath=True)
def _between(
    f: Numbers,
    source: NDArray[np.int32],
    wall: NDArray[np.int8],
    force: Numbers,
    first: int,
    last: int,
    rate_even: Any,
    rate_odd: Any,
    constants: Any,
) -> None:
    size = 19 * 64
    held = np.empty(size, dtype=f.dtype)
    for b in range(first, last):
        base = b * size
        for k in range(size):
            held[k] = f[source[base + k]]
        _collide(held, 0, wall, base, force, b * 64, rate_even, rate_odd, constants)
        for k in range(size):
            f[source[base + k]] = held[k]


@cached_njit(fastmath=True)
def advance(
    f: Numbers,
    source: NDArray[np.int32],
    wall: NDArray[np.int8],
    force: Numbers,
    blocks: int,
    rate_even: Any,
    rate_odd: Any,
    constants: Any,
    pairs: int,
) -> None:
    """Take pairs of steps on one thread."""
    for _ in range(pairs):
        _within(f, wall, force, 0, blocks, rate_even, rate_odd, constants)
        _between(f, source, wall, force, 0, blocks, rate_even, rate_odd, constants)


@cached_njit(fastmath=True, parallel=True)
def advance_together(
    f: Numbers,
    source: NDArray[np.int32],
    wall: NDArray[np.int8],
    force: Numbers,
    blocks: int,
    rate_even: Any,
    rate_odd: Any,
    constants: Any,
    pairs: int,
    threads: int,
) -> None:
    """Take pairs of steps on several threads, each with blocks of its own; to the bit as on one."""
    for _ in range(pairs):
        for t in prange(threads):
            _within(f, wall, force, t * blocks // threads, (t + 1) * blocks // threads, rate_even, rate_odd, constants)
        for t in prange(threads):
            first, last = t * blocks // threads, (t + 1) * blocks // threads
            _between(f, source, wall, force, first, last, rate_even, rate_odd, constants)


@cached_njit
def _sum_layers(
    f: Numbers,
    force: Numbers,
    source: NDArray[np.int32],
    layer: NDArray[np.int32],
    fluid: int,
    sums: FloatArray,
) -> None:
    """Add up pressure, velocity, and what came into each layer through its lower face from below and from above."""
    directions, block, nz = 19, 64, sums.shape[1]
    for n in range(fluid):
        base = (n // block) * directions * block + n % block
        k = layer[n]
        sums[1, k] += 0.5 * force[n]
        for q in range(directions):
            place = base + q * block
            value = f[place]
            sums[0, k] += value / 3.0
            if q == 5 or q == 11 or q == 14 or q == 15 or q == 18:
                sums[1, k] += value
                if source[place] != place:
                    sums[2, k] += value
            elif q == 6 or q == 12 or q == 13 or q == 16 or q == 17:
                sums[1, k] -= value
                if source[place] != place:
                    sums[3, (k + 1) % nz] += value


@cached_njit
def _moments(f: Numbers, force: Numbers, velocities: IntArray, pressure: Any, velocity: NDArray[np.float32]) -> None:
    directions, block = 19, 64
    for n in range(pressure.size):
        base = (n // block) * directions * block + n % block
        rho, x, y, z = 0.0, 0.0, 0.0, 0.5 * force[n]
        for q in range(directions):
            value = f[base + q * block]
            rho += value
            x += velocities[q, 0] * value
            y += velocities[q, 1] * value
            z += velocities[q, 2] * value
        pressure[n] = rho / 3.0
        velocity[n, 0], velocity[n, 1], velocity[n, 2] = x, y, z


@cached_njit
def _prolong(
    f: Numbers,
    number: NDArray[np.int32],
    force: Numbers,
    coarse: NDArray[np.int32],
    pressure: Any,
    velocity: NDArray[np.float32],
    ratio: float,
    velocities: IntArray,
    weights: FloatArray,
) -> None:
    """Fill in the state of a coarser flow: trilinear; at rest in spheres, pressure from the fluid only."""
    nz, ny, nx = number.shape
    mz, my, mx = coarse.shape
    directions, block = 19, 64
    for k in range(nz):
        z = (k + 0.5) / ratio - 0.5
        for j in range(ny):
            y = (j + 0.5) / ratio - 0.5
            for i in range(nx):
                n = number[k, j, i]
                if n < 0:
                    continue
                x = (i + 0.5) / ratio - 0.5
                share, p, ux, uy, uz = 0.0, 0.0, 0.0, 0.0, 0.0
                for corner in range(8):
                    kk = math.floor(z) + (corner >> 2)
                    jj = math.floor(y) + ((corner >> 1) & 1)
                    ii = math.floor(x) + (corner & 1)
                    m = coarse[kk % mz, jj % my, ii % mx]
                    if m < 0:
                        continue
                    w = (1.0 - abs(z - kk)) * (1.0 - abs(y - jj)) * (1.0 - abs(x - ii))
                    share += w
                    p += w * pressure[m]
                    ux += w * velocity[m, 0]
                    uy += w * velocity[m, 1]
                    uz += w * velocity[m, 2]
                rho = 3.0 * p / share if share > 0.0 else 0.0
                uz -= 0.5 * force[n]
                base = (n // block) * directions * block + n % block
                for q in range(directions):
                    along = velocities[q, 0] * ux + velocities[q, 1] * uy + velocities[q, 2] * uz
                    f[base + q * block] = weights[q] * (rho + 3.0 * along)
