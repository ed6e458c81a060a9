"""Compiled kernels of the embedded engine: neighbours on a hierarchical grid, contact forces, integration.

All in SI. A sphere's velocity is kept at half steps, as LIGGGHTS's velocity Verlet sees it in its forces:
``v(n+1/2) = v(n-1/2) + dt f(n)/m``, ``x(n+1) = x(n) + dt v(n+1/2)``, ``f(n+1) = f(x(n+1), v(n+1/2))``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import prange
from numba.misc.special import literally

from filtercake.packing.compiled import cached_njit
from filtercake.packing.engines import pair_kernels, vector_kernels
from filtercake.packing.engines.pair_kernels import (
    COHESION,
    DAMPING,
    FUSED,
    IMAGE_SHIFT,
    INDEX_MASK,
    MASS,
    RADIUS,
    SAME_IMAGE,
    STIFFNESS,
    U,
    V,
    W,
    X,
    Y,
    Z,
)
from filtercake.packing.engines.vector_kernels import VECTOR
from filtercake.units import FloatArray, IntArray

Unsigned = np.ndarray[Any, np.dtype[np.uint64]]
Neighbours = np.ndarray[Any, np.dtype[np.uint32]]


class Grid(NamedTuple):
    """Cells of every size level, and the spheres in the order of the cells.

    Attributes
    ----------
    length : float
        Side of the periodic box, m.
    level : ndarray, shape (n,)
        Size level of each sphere of the bed, 0 the coarsest.
    columns : ndarray, shape (6, n + 8)
        Position, course (:class:`Listing`), and radius and room together, twice: of all spheres and, no number of the
        fast ones, of the others. Sorted by level and cell; a whole vector may be read at the last.
    fast : ndarray, shape (n,)
        Which of these are searched for from nowhere: they search for all others themselves.
    member : ndarray, shape (n,)
        Where each of these stands in the bed.
    place : ndarray, shape (n,)
        The inverse: where each sphere of the bed stands here.
    start : ndarray, shape (cells + 1,)
        First sphere of each cell.
    shape, offset : ndarray, shapes (levels, 3), (levels + 1,)
        Cells per axis and first cell of each level.
    largest, cell_size : ndarray, shape (levels,)
        Largest radius and cell side of each level.
    stride : ndarray, shape (2, levels)
        How far a sphere of each level may get while the list lasts, m: of all but the fast ones, and of all.
    horizon : int
        Time steps that the list lasts at most.
    """

    length: float
    level: IntArray
    columns: FloatArray
    fast: np.ndarray[Any, np.dtype[np.bool_]]
    member: IntArray
    place: IntArray
    start: IntArray
    shape: IntArray
    offset: IntArray
    largest: FloatArray
    cell_size: FloatArray
    stride: FloatArray
    horizon: int


class Pairs(NamedTuple):
    """Pairs by sphere, and apart from them, close together in memory, the near ones: the others cannot touch yet.

    Attributes
    ----------
    bounds : ndarray, shape (threads + 1,)
        The spheres whose pairs each thread works on.
    halo : ndarray, shape (threads, 2)
        First and last but one of the spheres that each thread's pairs act on.
    first, last : ndarray, shape (n,)
        ``first[i]:last[i]`` are the pairs of sphere i.
    neighbour : ndarray, shape (m,)
        The other sphere, and in the upper bits a code of its periodic image.
    constants : ndarray, shape (m, 2)
        What of the contact law takes roots and does not change while the pair lasts.
    spring : ndarray, shape (m, 3)
        Tangential springs, m; one row without friction.
    near_end : ndarray, shape (threads,)
        End of the near pairs of each thread; they begin where its pairs do.
    near_owner, near_neighbour : ndarray, shape (m,)
        The sphere that a near pair is listed with, and the other as above.
    near_constants : ndarray, shape (2, m + 8)
        As above, of the near pairs; a whole vector may be read at the last.
    near_pair : ndarray, shape (m,)
        Which pair a near one is.
    """

    bounds: IntArray
    halo: IntArray
    first: Unsigned
    last: Unsigned
    neighbour: Neighbours
    constants: FloatArray
    spring: FloatArray
    near_end: Unsigned
    near_owner: Neighbours
    near_neighbour: Neighbours
    near_constants: FloatArray
    near_pair: Neighbours


class Bodies(NamedTuple):
    """The spheres in the bed and what acts on them.

    Attributes
    ----------
    state : ndarray, shape (n, 8)
        Position, radius, velocity and mass: one sphere is one cache line.
    spin : ndarray, shape (n, 3)
        Angular velocity, rad/s.
    force, torque : ndarray, shape (layers, n, 4)
        The fourth column is nought. The first layer is the total; with several threads each has one more, for what
        acts on the others' spheres.
    """

    state: FloatArray
    spin: FloatArray
    force: FloatArray
    torque: FloatArray


class Floor(NamedTuple):
    """The contacts with the floor.

    Attributes
    ----------
    constants : ndarray, shape (n, 2)
        As a pair's, of each sphere with the floor.
    spring : ndarray, shape (n, 2)
        Tangential springs, m.
    grounded : ndarray, shape (m,)
        The spheres that may touch the floor.
    """

    constants: FloatArray
    spring: FloatArray
    grounded: IntArray


class Listing(NamedTuple):
    """How far the spheres may move before the pairs are listed anew.

    Every sphere has a straight course of its own and room to leave it: what rests needs little, what falls may go on
    or be stopped, and few that fly about need not shorten the list of all.

    Attributes
    ----------
    reference : ndarray, shape (n, 3)
        Positions at which the pairs were listed, m.
    course : ndarray, shape (n,)
        Height that each is expected to gain per time step, m.
    room : ndarray, shape (n,)
        How far each may be from where that leads, m.
    watched : ndarray, shape (m,)
        Spheres that have neighbours which are not in the list.
    horizon : int
        Time steps that the list lasts at most.
    """

    reference: FloatArray
    course: FloatArray
    room: FloatArray
    watched: IntArray
    horizon: int


class Moment(NamedTuple):
    """Where the time loop stands.

    Attributes
    ----------
    ready : bool
        Whether the forces at the positions are known.
    starting : bool
        Whether the velocities are those of the positions, not yet half a step back.
    since : int
        Time steps since the pairs were listed.
    """

    ready: bool
    starting: bool
    since: int


class Patches(NamedTuple):
    """Vertical speed of every patch of spheres, and the speed relative to it that none may exceed, m/s."""

    speed: FloatArray
    limit: FloatArray


class Law(NamedTuple):
    """What of the equations of motion is the same for all spheres and steps; SI.

    ``shear_stiffness`` and ``shear_damping`` are the tangential constants over the normal ones, ``length`` is the
    side of the periodic box. ``cohesion`` is SJKR's energy density, J/m3, ``adhesion`` the work of adhesion, J/m2.
    Coulomb's limit holds for the tangential spring, as in LIGGGHTS, and where ``capped`` for the whole tangential
    force, as in nature.
    """

    gravity: float
    cohesion: float
    friction: float
    shear_stiffness: float
    shear_damping: float
    length: float
    time_step: float
    adhesion: float = 0.0
    capped: bool = False


COURSE, REACH, SLOW_REACH = np.uint64(3), np.uint64(4), np.uint64(5)
"""Columns of the grid, behind the positions."""

NEAR_STEPS = 20
"""Time steps that the choice of near pairs lasts, unless a sphere becomes too fast for it."""
PATCH_SHIFT = 6
PATCH = 2**PATCH_SHIFT
"""Spheres, next to each other in memory and in space, that share a frame and a limit of speed."""
OWN_ROOM = 1.5
COMMON_ROOM = 0.1
"""Limit of a patch's speeds: so many times its fastest sphere's, and so many times that of the whole bed's."""
LOCAL_ROOM = 0.6
"""Part of the largest speed in its patch at which a sphere may leave its course for as long as a list lasts."""
MOST_ROOM = 0.25
"""Most room of a sphere over the side of the box: only the nearest image of another is looked for."""
SURE_ROOM = 1.25
"""Room over what a first choice of near pairs may need: a list that is new lasts at least that long."""

_compiled = cached_njit(error_model="numpy", fastmath=FUSED)


@cached_njit(error_model="numpy")
def _layer(z: float, side: float, layers: int) -> int:
    """Layer of cells that a height lies in."""
    return min(max(int(z / side), 0), layers - 1)


@cached_njit
def _by_cell(cell: IntArray, start: IntArray) -> IntArray:
    """Order by cell; ``start`` holds how many each cell has, one place further, and becomes each cell's first."""
    for c in range(start.size - 1):
        start[c + 1] += start[c]
    fill = start[:-1].copy()
    order = np.empty(cell.size, dtype=np.int64)
    for i in range(cell.size):
        order[fill[cell[i]]] = i
        fill[cell[i]] += 1
    return order


@cached_njit
def sort_into_cells(
    state: FloatArray, level: IntArray, cell_size: FloatArray, length: float, top: float
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Assign spheres to the cells of their size level and find the order that makes cells contiguous.

    Parameters
    ----------
    state : ndarray, shape (n, 8)
        Spheres; x and y in [0, length).
    level : ndarray, shape (n,)
        Size level of each sphere, 0 the coarsest.
    cell_size : ndarray, shape (levels,)
        Smallest cell side of each level.
    length, top : float
        Box side and greatest height of a centre.

    Returns
    -------
    order, shape (n,); cell_start, shape (cells + 1,); shape, (levels, 3); offset, (levels + 1,)
    """
    levels = cell_size.size
    shape = np.empty((levels, 3), dtype=np.int64)
    offset = np.zeros(levels + 1, dtype=np.int64)
    for k in range(levels):
        across = max(1, int(length / cell_size[k]))
        shape[k, 0] = across
        shape[k, 1] = across
        shape[k, 2] = max(1, int(top / cell_size[k]) + 1)
        offset[k + 1] = offset[k] + across * across * shape[k, 2]
    n = level.size
    cell = np.empty(n, dtype=np.int64)
    start = np.zeros(offset[levels] + 1, dtype=np.int64)
    for i in range(n):
        k = level[i]
        across = shape[k, 0]
        cx = min(int(state[i, X] / length * across), across - 1)
        cy = min(int(state[i, Y] / length * across), across - 1)
        cz = _layer(state[i, Z], cell_size[k], shape[k, 2])
        cell[i] = offset[k] + (cz * across + cy) * across + cx
        start[cell[i] + 1] += 1
    return _by_cell(cell, start), start, shape, offset


def in_cells(
    index: IntArray, state: FloatArray, course: FloatArray, reach: FloatArray, fast: np.ndarray[Any, np.dtype[np.bool_]]
) -> FloatArray:
    """Make the columns of a :class:`Grid`, in the order ``index`` of its cells.

    ``reach`` (n,), m, is how far from where its course leads a sphere may touch something.
    """
    columns = np.zeros((6, index.size + VECTOR))
    found = (state[:, X], state[:, Y], state[:, Z], course, reach, np.where(fast, np.nan, reach))
    for column, of in zip(columns, found, strict=True):
        column[: index.size] = of[index]
    return columns


@_compiled
def _find_pairs(part: int, state: FloatArray, grid: Grid, pairs: Pairs) -> int:
    """List the pairs of one part's spheres in its share of the list; return how many they are."""
    bounds, first, last, neighbour = pairs.bounds, pairs.first, pairs.last, pairs.neighbour
    level, columns, fast, member, place, start = (
        grid.level,
        grid.columns,
        grid.fast,
        grid.member,
        grid.place,
        grid.start,
    )
    length, shape, offset, largest, cell_size = grid.length, grid.shape, grid.offset, grid.largest, grid.cell_size
    parts = bounds.size - 1
    room = neighbour.size // parts
    begin_at, last_slot, horizon = part * room, room - 1, float(grid.horizon)
    count = 0
    for i in range(bounds[part], bounds[part + 1]):
        first[i] = begin_at + count
        x, y, z = state[i, X], state[i, Y], state[i, Z]
        own, here = level[i], place[i]
        is_fast, own_reach, course = fast[here], columns[REACH, here], columns[COURSE, here]
        wanted = REACH if is_fast else SLOW_REACH
        stride = own_reach + horizon * abs(course)
        for k in range(shape.shape[0] if is_fast else own + 1):
            reach = stride + largest[k] + grid.stride[1 if is_fast else 0, k]
            across, layers = shape[k, 0], shape[k, 2]
            inverse = across / length
            # one periodic image to either side: the next is a sphere's own width away and never touches
            x0 = max(math.floor((x - reach) * inverse), -across)
            x1 = min(math.floor((x + reach) * inverse), 2 * across - 1)
            y0 = max(math.floor((y - reach) * inverse), -across)
            y1 = min(math.floor((y + reach) * inverse), 2 * across - 1)
            # what lies in lower layers of the own level comes earlier and has listed the pair
            z0 = _layer(z if k == own and not is_fast else z - reach, cell_size[k], layers)
            z1 = _layer(z + reach, cell_size[k], layers)
            for cz in range(z0, z1 + 1):
                for cy in range(y0, y1 + 1):
                    wrap_y = -1 if cy < 0 else (1 if cy >= across else 0)
                    ys = y - wrap_y * length
                    row = offset[k] + (cz * across + cy - wrap_y * across) * across
                    for wrap_x in range(-1 if x0 < 0 else 0, 2 if x1 >= across else 1):
                        # the cells of one image in a row lie one behind the other, and so do their spheres
                        left, right = max(x0, wrap_x * across), min(x1, wrap_x * across + across - 1)
                        xs = x - wrap_x * length
                        begin, end = start[row + left - wrap_x * across], start[row + right - wrap_x * across + 1]
                        if k == own and not is_fast:
                            begin = max(begin, here + 1)  # each pair once
                        code = np.uint32((wrap_y + 1) * 3 + wrap_x + 1) << IMAGE_SHIFT
                        for j in range(np.uint64(begin), np.uint64(end), np.uint64(VECTOR)):
                            found = vector_kernels.lanes_in_reach(
                                columns, wanted, j, end, xs, ys, z, own_reach, course, horizon
                            )
                            while found:
                                other = j + vector_kernels.lowest_bit(found)
                                found &= found - np.uint64(1)
                                neighbour[begin_at + min(count, last_slot)] = np.uint32(member[other]) | code
                                count += not (is_fast and fast[other] and other <= here)
        last[i] = begin_at + count
    return count


@cache
def make_find_pairs(threaded: bool) -> Callable[..., int]:
    """Compile the search for pairs, for one thread or several."""

    @cached_njit(parallel=threaded)
    def find_pairs(state: FloatArray, grid: Grid, pairs: Pairs) -> int:
        """List in ``pairs`` those that may touch within the horizon, each once, by sphere (spheres sorted into cells).

        Each part of the spheres (``pairs.bounds``) has an equal share of the list to itself. Returns the largest number
        of pairs in one part: when it is more than a share holds, the list holds only a part of them.
        """
        parts = pairs.bounds.size - 1 if threaded else 1  # named here, or the cache mixes up the two kinds
        counts = np.zeros(parts, dtype=np.int64)
        for t in prange(parts):
            counts[t] = _find_pairs(t, state, grid, pairs)
        return int(counts.max())

    compiled: Callable[..., int] = find_pairs
    return compiled


@cached_njit
def find_halos(pairs: Pairs) -> None:
    """Note the first and the last but one of the spheres that each part's pairs act on."""
    for part in range(pairs.bounds.size - 1):
        low, high = int(pairs.bounds[-1]), 0
        for i in range(pairs.bounds[part], pairs.bounds[part + 1]):
            for p in range(pairs.first[i], pairs.last[i]):
                j = int(pairs.neighbour[p] & INDEX_MASK)
                low, high = int(min(low, j)), int(max(high, j + 1))
        pairs.halo[part, 0], pairs.halo[part, 1] = low, high


@cached_njit
def _pair_constants(part: int, state: FloatArray, pairs: Pairs, modulus: float, damping_ratio: float) -> None:
    """Fill the constants of the pairs of one part's spheres."""
    first, last, neighbour, constants = pairs.first, pairs.last, pairs.neighbour, pairs.constants
    damping = 2.0 * math.sqrt(5.0 / 6.0) * damping_ratio
    for i in range(pairs.bounds[part], pairs.bounds[part + 1]):
        for p in range(first[i], last[i]):
            j = neighbour[p] & INDEX_MASK
            a, b = state[i, RADIUS], state[j, RADIUS]
            root = math.sqrt(a * b / (a + b))
            reduced = state[i, MASS] * state[j, MASS] / (state[i, MASS] + state[j, MASS])
            constants[p, STIFFNESS] = 4.0 / 3.0 * modulus * root
            constants[p, DAMPING] = damping * math.sqrt(2.0 * modulus * root * reduced)


@cache
def make_pair_constants(threaded: bool) -> Callable[..., None]:
    """Compile the filling in of each pair's constants, for one thread or several."""

    @cached_njit(parallel=threaded)
    def pair_constants(state: FloatArray, pairs: Pairs, modulus: float, damping_ratio: float) -> None:
        """Fill each pair's constants, from the effective modulus, Pa, and the damping ratio."""
        parts = pairs.bounds.size - 1 if threaded else 1  # named here, or the cache mixes up the two kinds
        for t in prange(parts):
            _pair_constants(t, state, pairs, modulus, damping_ratio)

    compiled: Callable[..., None] = pair_constants
    return compiled


@cached_njit
def carry_springs(order: IntArray, old: Pairs, new: Pairs) -> None:
    """Carry tangential springs over to a new pair list; ``order[i]`` is where sphere i stood before, -1 if new."""
    old_first, old_last, old_neighbour, old_spring = old.first, old.last, old.neighbour, old.spring
    first, last, neighbour, spring = new.first, new.last, new.neighbour, new.spring
    for i in range(first.size):
        old_i = order[i]
        for p in range(first[i], last[i]):
            spring[p, 0] = spring[p, 1] = spring[p, 2] = 0.0
            old_j = order[neighbour[p] & INDEX_MASK]
            if old_i < 0 or old_j < 0:
                continue
            for q in range(old_first[old_i], old_last[old_i]):
                if (old_neighbour[q] & INDEX_MASK) == old_j:
                    for k in range(3):
                        spring[p, k] = old_spring[q, k]
            for q in range(old_first[old_j], old_last[old_j]):
                if (old_neighbour[q] & INDEX_MASK) == old_i:
                    for k in range(3):
                        spring[p, k] = -old_spring[q, k]


@_compiled
def _limit_speeds(state: FloatArray, patches: Patches) -> None:
    """Give every patch of spheres a vertical speed of its own, and the speed relative to it that none may exceed."""
    patch_speed, patch_limit = patches.speed, patches.limit
    n = state.shape[0]
    fastest = 0.0
    for b in range(patch_speed.size):
        begin, end = b * PATCH, min(b * PATCH + PATCH, n)
        mean = 0.0
        for i in range(begin, end):
            mean += state[i, W]
        mean /= end - begin
        largest = 0.0
        for i in range(begin, end):
            w = state[i, W] - mean
            largest = max(largest, state[i, U] * state[i, U] + state[i, V] * state[i, V] + w * w)
        patch_speed[b] = mean
        patch_limit[b] = math.sqrt(largest)
        fastest = max(fastest, patch_limit[b])
    for b in range(patch_speed.size):
        patch_limit[b] = OWN_ROOM * patch_limit[b] + COMMON_ROOM * fastest


@_compiled
def give_room(state: FloatArray, law: Law, least: float, listing: Listing) -> None:
    """Give every sphere a course and room to leave it, from how fast it and its neighbours are.

    Half its present speed is the course of what may go on or be stopped. Nobody gets less room than ``least``, m, or
    than the first choice of near pairs may need.
    """
    course, room = listing.course, listing.room
    count = (state.shape[0] + PATCH - 1) // PATCH
    patches = Patches(np.zeros(count), np.zeros(count))
    _limit_speeds(state, patches)
    lasts, first = listing.horizon * law.time_step, NEAR_STEPS * law.time_step
    for i in range(state.shape[0]):
        u, v, half = state[i, U], state[i, V], 0.5 * state[i, W]
        limit, astray = patches.limit[i // PATCH], abs(patches.speed[i // PATCH] - half)
        needed = lasts * (math.sqrt(u * u + v * v + half * half) + LOCAL_ROOM * limit)
        course[i] = half * law.time_step
        room[i] = max(min(least + needed, MOST_ROOM * law.length), SURE_ROOM * first * (astray + limit))


@_compiled
def _within_room(state: FloatArray, patches: Patches, listing: Listing, since: int, time_step: float) -> bool:
    """Whether the list holds every pair that may touch before near pairs are chosen the next time."""
    reference, course, room = listing.reference, listing.course, listing.room
    if since + NEAR_STEPS > listing.horizon:
        return False
    within = True
    for i in range(state.shape[0]):
        x, y = state[i, X] - reference[i, 0], state[i, Y] - reference[i, 1]
        z = state[i, Z] - reference[i, 2] - since * course[i]
        astray = abs(patches.speed[i // PATCH] * time_step - course[i]) + patches.limit[i // PATCH] * time_step
        left = max(room[i] - NEAR_STEPS * astray, 0.0)
        within &= x * x + y * y + z * z <= left * left
    return within


@_compiled
def pick_near(part: int, state: FloatArray, pairs: Pairs, patches: Patches, law: Law) -> None:
    """Copy those of one part's pairs that may touch within ``NEAR_STEPS`` to the near ones."""
    first, last, neighbour, constants = pairs.first, pairs.last, pairs.neighbour, pairs.constants
    near_owner, near_neighbour = pairs.near_owner, pairs.near_neighbour
    near_constants, near_pair = pairs.near_constants, pairs.near_pair
    patch_speed, patch_limit = patches.speed, patches.limit
    length, duration = law.length, NEAR_STEPS * law.time_step
    begin, end = pairs.bounds[part], pairs.bounds[part + 1]
    if begin == end:
        return
    q = first[begin]
    for i in range(begin, end):
        x, y, z = state[i, X], state[i, Y], state[i, Z]
        own_speed = patch_speed[i // PATCH]
        r = state[i, RADIUS] + duration * patch_limit[i // PATCH]
        for p in range(first[i], last[i]):
            j, code = neighbour[p] & INDEX_MASK, neighbour[p] >> IMAGE_SHIFT
            dx, dy, dz = x - state[j, X], y - state[j, Y], z - state[j, Z]
            if code != SAME_IMAGE:
                dx -= (np.int64(code) % 3 - 1) * length
                dy -= (np.int64(code) // 3 - 1) * length
            patch = j >> PATCH_SHIFT
            approach = patch_limit[patch] + abs(own_speed - patch_speed[patch])
            touching = r + state[j, RADIUS] + duration * approach
            # written in any case and kept if near: a branch here is too often guessed wrongly
            near_pair[q] = p
            near_owner[q] = i
            q += np.uint64(dx * dx + dy * dy + dz * dz < touching * touching)
    pairs.near_end[part] = q
    for k in range(first[begin], q):
        near_neighbour[k] = neighbour[near_pair[k]]
        near_constants[0, k] = constants[near_pair[k], STIFFNESS]
        near_constants[1, k] = constants[near_pair[k], DAMPING]


@_compiled
def _limit_spring(
    hx: float, hy: float, hz: float, stiffness: float, allowed: float
) -> tuple[float, float, float, bool]:
    """Shorten a tangential spring to the Coulomb limit; say whether the contact slides."""
    stretched = stiffness * math.sqrt(hx * hx + hy * hy + hz * hz)
    if stretched <= allowed:
        return hx, hy, hz, False
    ratio = allowed / stretched
    return hx * ratio, hy * ratio, hz * ratio, True


@_compiled
def _limit_force(px: float, py: float, pz: float, allowed: float) -> tuple[float, float, float]:
    """Shorten a tangential force to the Coulomb limit; it seldom needs a root."""
    square = px * px + py * py + pz * pz
    if square <= allowed * allowed:
        return px, py, pz
    ratio = allowed / math.sqrt(square)
    return px * ratio, py * ratio, pz * ratio


@cached_njit
def _clear(part: int, bodies: Bodies, pairs: Pairs, gravity: float, frictional: bool) -> None:
    """Set the forces and torques on one part's spheres to nothing but their weight."""
    force, torque = bodies.force[0], bodies.torque[0]
    for i in range(pairs.bounds[part], pairs.bounds[part + 1]):
        force[i, 0] = force[i, 1] = 0.0
        force[i, 2] = -gravity * bodies.state[i, MASS]
        if frictional:
            torque[i, 0] = torque[i, 1] = torque[i, 2] = 0.0


@cached_njit
def _add_layers(part: int, bodies: Bodies, pairs: Pairs, frictional: bool) -> None:
    """Move the forces and torques on one part's spheres from the other parts' layers to the first."""
    force, torque, bounds, halo = bodies.force, bodies.torque, pairs.bounds, pairs.halo
    for other in range(bounds.size - 1):
        if other == part:
            continue
        layer = other + 1
        for i in range(max(bounds[part], halo[other, 0]), min(bounds[part + 1], halo[other, 1])):
            for k in range(3):
                force[0, i, k] += force[layer, i, k]
                force[layer, i, k] = 0.0
                if frictional:
                    torque[0, i, k] += torque[layer, i, k]
                    torque[layer, i, k] = 0.0


@_compiled
def _floor_forces(
    floor: Floor, bodies: Bodies, law: Law, spring_step: float, attraction: int, frictional: bool
) -> None:
    """Add the floor's forces and torques to the total; it may be cohesive, not adhesive."""
    literally(attraction), literally(frictional)
    state, spin, force, torque = bodies.state, bodies.spin, bodies.force[0], bodies.torque[0]
    constants, spring, grounded = floor.constants, floor.spring, floor.grounded
    for k in range(grounded.size):
        i = grounded[k]
        z, radius = state[i, Z], state[i, RADIUS]
        overlap = radius - z
        if overlap <= 0.0:
            if frictional:
                spring[i, 0] = spring[i, 1] = 0.0
            continue
        root = math.sqrt(overlap)
        quarter = math.sqrt(root)
        normal = constants[i, STIFFNESS] * overlap * root - constants[i, DAMPING] * quarter * state[i, W]
        force[i, 2] += normal
        if attraction == COHESION:
            force[i, 2] -= math.pi * law.cohesion * overlap * (radius + z)
        if frictional:
            arm = z + 0.5 * overlap
            sx, sy = state[i, U] - arm * spin[i, 1], state[i, V] + arm * spin[i, 0]
            stiffness = law.shear_stiffness * constants[i, STIFFNESS] * root
            allowed = law.friction * abs(normal)
            hx, hy, _, slides = _limit_spring(
                spring[i, 0] + sx * spring_step, spring[i, 1] + sy * spring_step, 0.0, stiffness, allowed
            )
            drag = 0.0 if slides else law.shear_damping * constants[i, DAMPING] * quarter
            px, py = -stiffness * hx - drag * sx, -stiffness * hy - drag * sy
            if law.capped and not slides:
                px, py, _ = _limit_force(px, py, 0.0, allowed)
            spring[i, 0], spring[i, 1] = hx, hy
            force[i, 0] += px
            force[i, 1] += py
            torque[i, 0] += arm * py
            torque[i, 1] -= arm * px


@_compiled
def _move(
    part: int, bodies: Bodies, bounds: IntArray, patches: Patches, kick: float, law: Law, frictional: bool
) -> bool:
    """Kick and move one part's spheres, and leave their weight in the total force for the next step to add to.

    ``kick`` is the time, s, that the force has acted. Returns whether a sphere was faster than its patch may be.
    """
    literally(frictional)
    state, spin, force, torque = bodies.state, bodies.spin, bodies.force[0], bodies.torque[0]
    gravity, time_step = law.gravity, law.time_step
    too_fast = False
    for i in range(bounds[part], bounds[part + 1]):
        patch = i // PATCH
        scale = kick / state[i, MASS]
        u = state[i, U] + scale * force[i, 0]
        v = state[i, V] + scale * force[i, 1]
        w = state[i, W] + scale * force[i, 2]
        state[i, U], state[i, V], state[i, W] = u, v, w
        state[i, X] += time_step * u
        state[i, Y] += time_step * v
        state[i, Z] += time_step * w
        force[i, 0], force[i, 1], force[i, 2] = 0.0, 0.0, -gravity * state[i, MASS]
        if frictional:
            turn = scale / (0.4 * state[i, RADIUS] * state[i, RADIUS])
            for k in range(3):
                spin[i, k] += turn * torque[i, k]
                torque[i, k] = 0.0
        own = w - patches.speed[patch]
        # not the other way round: what is no number is too fast
        too_fast |= not u * u + v * v + own * own <= patches.limit[patch] * patches.limit[patch]
    return too_fast


@cached_njit
def _disturbed(state: FloatArray, watched: IntArray) -> bool:
    """Whether one of the watched spheres was touched: until then it falls straight down, to the last bit."""
    disturbed = False
    for i in watched:
        disturbed |= state[i, U] != 0.0 or state[i, V] != 0.0
    return disturbed


@cache
def make_advance(attraction: int, frictional: bool, threaded: bool) -> Callable[..., tuple[int, bool]]:
    """Compile the time loop for one kind of scene: what it doesn't need is not in its code.

    A threaded loop gives each thread a share of the pairs and a force buffer of its own. It binds plain numbers
    alone: a loop that binds compiled functions is in no other process's cache.
    """

    @cached_njit(error_model="numpy", fastmath=FUSED, parallel=threaded)
    def advance(
        steps: int, moment: Moment, bodies: Bodies, floor: Floor, pairs: Pairs, listing: Listing, law: Law
    ) -> tuple[int, bool]:
        """Advance up to ``steps``.

        It stops early, forces unknown, when a pair may soon touch that is not listed, or when one of the ``watched``
        spheres has been touched.

        Returns
        -------
        Steps done, and whether the forces at the new positions are known.
        """
        ready, starting, since = moment
        state, bounds, time_step = bodies.state, pairs.bounds, law.time_step
        parts = bounds.size - 1 if threaded else 1  # named here, or the cache mixes up the two kinds
        too_fast = np.zeros(parts, dtype=np.bool_)
        count = (state.shape[0] + PATCH - 1) // PATCH
        patches = Patches(np.zeros(count), np.full(count, np.inf))
        done, picked = 0, 0  # picked: steps that the choice of near pairs will last yet
        if not ready:
            for t in prange(parts):
                _clear(t, bodies, pairs, law.gravity, frictional)
        while True:
            if not ready:
                if picked == 0:
                    picked = NEAR_STEPS
                    _limit_speeds(state, patches)
                    if not _within_room(state, patches, listing, since, time_step):
                        return done, ready
                    for t in prange(parts):
                        pick_near(t, state, pairs, patches, law)
                spring_step = 0.0 if starting else time_step  # at the start the springs know the positions
                for t in prange(parts):
                    pair_kernels.pair_forces(t, bodies, pairs, law, spring_step, attraction, frictional)
                if parts > 1:
                    for t in prange(parts):
                        _add_layers(t, bodies, pairs, frictional)
                _floor_forces(floor, bodies, law, spring_step, attraction, frictional)
                ready = True
            if done == steps:
                return done, ready
            kick = 0.5 * time_step if starting else time_step
            starting = False
            for t in prange(parts):
                too_fast[t] = _move(t, bodies, bounds, patches, kick, law, frictional)
            picked = 0 if too_fast.any() else max(picked - 1, 0)
            done += 1
            since += 1
            ready = False
            if _disturbed(state, listing.watched):
                return done, ready

    compiled: Callable[..., tuple[int, bool]] = advance
    return compiled
