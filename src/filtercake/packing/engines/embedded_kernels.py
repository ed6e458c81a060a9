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
from numba import njit, prange

from filtercake.units import FloatArray, IntArray

Unsigned = np.ndarray[Any, np.dtype[np.uint64]]
Neighbours = np.ndarray[Any, np.dtype[np.uint32]]


class Grid(NamedTuple):
    """Cells of every size level, and the spheres in the order of the cells.

    Attributes
    ----------
    spheres : ndarray, shape (n, 4)
        Position and radius, sorted by level and cell.
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
    """

    spheres: FloatArray
    member: IntArray
    place: IntArray
    start: IntArray
    shape: IntArray
    offset: IntArray
    largest: FloatArray
    cell_size: FloatArray


class Pairs(NamedTuple):
    """Pairs by sphere, and apart from them, close together in memory, the near ones: the others cannot touch yet.

    Attributes
    ----------
    first, last : ndarray, shape (n,)
        ``first[i]:last[i]`` are the pairs of sphere i.
    neighbour : ndarray, shape (m,)
        The other sphere, and in the upper bits a code of its periodic image.
    constants : ndarray, shape (m, 2)
        What of the contact law takes roots and does not change while the pair lasts.
    spring : ndarray, shape (m, 3)
        Tangential springs, m; one row without friction.
    near_last : ndarray, shape (n,)
        End of each sphere's near pairs; they begin where the sphere's before it end.
    near_neighbour, near_constants : ndarray, shapes (m,), (m, 2)
        As above, of the near pairs.
    near_pair : ndarray, shape (m,)
        Which pair a near one is.
    """

    first: Unsigned
    last: Unsigned
    neighbour: Neighbours
    constants: FloatArray
    spring: FloatArray
    near_last: Unsigned
    near_neighbour: Neighbours
    near_constants: FloatArray
    near_pair: Neighbours


class Law(NamedTuple):
    """The contact law's numbers that are the same for all pairs, and gravity; SI.

    ``shear_stiffness`` and ``shear_damping`` are the tangential constants over the normal ones.
    """

    gravity: float
    cohesion: float
    friction: float
    shear_stiffness: float
    shear_damping: float


# columns of the state: one sphere is one cache line
X, Y, Z, RADIUS, U, V, W, MASS = range(8)

NEAR_STEPS = 20
"""Time steps that the choice of near pairs lasts, unless a sphere becomes too fast for it."""
PATCH_SHIFT = 6
PATCH = 2**PATCH_SHIFT
"""Spheres, next to each other in memory and in space, that share a frame and a limit of speed."""
OWN_ROOM = 1.5
COMMON_ROOM = 0.1
"""Limit of a patch's speeds: so many times its fastest sphere's, and so many times that of the whole bed's."""
CLOSE_TO_LIMIT = 0.95
"""Share of half a skin at which pairs are listed anew."""
FUSED = {"contract"}
"""Multiply and add in one instruction where the processor can; nothing else of floating-point law is relaxed."""

# indices are unsigned: signed ones cost a test for negative values at every access
IMAGE_SHIFT = np.uint32(28)
INDEX_MASK = np.uint32(2**28 - 1)
SAME_IMAGE = np.uint32(4)
"""Code of a neighbour in the box itself, not in one of its eight periodic images."""

# columns of a pair's constants
STIFFNESS, DAMPING = range(2)


@njit(cache=True)
def sort_in_space(state: FloatArray, side: float, length: float, top: float) -> IntArray:
    """Order in which spheres of any size that are close in space are close in memory: layers of rows of small cubes.

    Parameters
    ----------
    state : ndarray, shape (n, 8)
        Spheres; x and y in [0, length).
    side : float
        Side of the cubes.
    length, top : float
        Box side and greatest height of a centre.
    """
    n = state.shape[0]
    across = max(1, int(length / side))
    layers = max(1, int(top / side) + 1)
    cell = np.empty(n, dtype=np.int64)
    start = np.zeros(across * across * layers + 1, dtype=np.int64)
    for i in range(n):
        cx = min(int(state[i, X] / length * across), across - 1)
        cy = min(int(state[i, Y] / length * across), across - 1)
        cz = min(max(int(state[i, Z] / side), 0), layers - 1)
        cell[i] = (cz * across + cy) * across + cx
        start[cell[i] + 1] += 1
    return _by_cell(cell, start)


@njit(cache=True)
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


@njit(cache=True)
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
        cz = min(max(int(state[i, Z] / cell_size[k]), 0), shape[k, 2] - 1)
        cell[i] = offset[k] + (cz * across + cy) * across + cx
        start[cell[i] + 1] += 1
    return _by_cell(cell, start), start, shape, offset


@njit(cache=True, error_model="numpy", fastmath=FUSED)
def _find_pairs(
    part: int,
    bounds: IntArray,
    state: FloatArray,
    level: IntArray,
    grid: Grid,
    length: float,
    skin: float,
    first: Unsigned,
    last: Unsigned,
    neighbour: Neighbours,
) -> int:
    """List the pairs of one part's spheres in its share of the list; return how many they are."""
    spheres, member, place, start = grid.spheres, grid.member, grid.place, grid.start
    shape, offset, largest, cell_size = grid.shape, grid.offset, grid.largest, grid.cell_size
    room = neighbour.size // (bounds.size - 1)
    begin_at, last_slot = part * room, room - 1
    count = 0
    for i in range(bounds[part], bounds[part + 1]):
        first[i] = begin_at + count
        x, y, z, r = state[i, X], state[i, Y], state[i, Z], state[i, RADIUS]
        own = level[i]
        for k in range(own + 1):
            reach = r + largest[k] + skin
            across, layers = shape[k, 0], shape[k, 2]
            inverse = across / length
            # one periodic image to either side: the next is a sphere's own width away and never touches
            x0 = max(math.floor((x - reach) * inverse), -across)
            x1 = min(math.floor((x + reach) * inverse), 2 * across - 1)
            y0 = max(math.floor((y - reach) * inverse), -across)
            y1 = min(math.floor((y + reach) * inverse), 2 * across - 1)
            z0 = min(max(math.floor((z - reach) / cell_size[k]), 0), layers - 1)
            z1 = min(max(math.floor((z + reach) / cell_size[k]), 0), layers - 1)
            if k == own:  # what lies in lower layers comes earlier and has listed the pair
                z0 = min(max(int(z / cell_size[k]), 0), layers - 1)
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
                        if k == own:
                            begin = max(begin, place[i] + 1)  # each pair once
                        code = np.uint32((wrap_y + 1) * 3 + wrap_x + 1) << IMAGE_SHIFT
                        for j in range(np.uint64(begin), np.uint64(end)):
                            dx, dy, dz = xs - spheres[j, X], ys - spheres[j, Y], z - spheres[j, Z]
                            near = r + spheres[j, RADIUS] + skin
                            # written in any case and kept if near: a branch here is too often guessed wrongly
                            neighbour[begin_at + min(count, last_slot)] = np.uint32(member[j]) | code
                            count += dx * dx + dy * dy + dz * dz < near * near
        last[i] = begin_at + count
    return count


@cache
def make_find_pairs(threaded: bool) -> Callable[..., int]:
    """Compile the search for pairs, for one thread or several."""

    @njit(cache=True, parallel=threaded)
    def find_pairs(
        bounds: IntArray,
        state: FloatArray,
        level: IntArray,
        grid: Grid,
        length: float,
        skin: float,
        first: Unsigned,
        last: Unsigned,
        neighbour: Neighbours,
    ) -> int:
        """List pairs closer than ``skin``, each once, by sphere (spheres sorted into cells).

        ``first[i]:last[i]`` are sphere i's neighbours, the periodic image in the upper bits. The spheres
        of part t, ``bounds[t]:bounds[t + 1]``, have the t-th share of the list to themselves. Returns the largest
        number of pairs in one part: when it is more than a share holds, the list holds only a part of them.
        """
        parts = bounds.size - 1 if threaded else 1  # named here, or the cache mixes up the two kinds
        counts = np.zeros(parts, dtype=np.int64)
        for t in prange(parts):
            counts[t] = _find_pairs(t, bounds, state, level, grid, length, skin, first, last, neighbour)
        return int(counts.max())

    compiled: Callable[..., int] = find_pairs
    return compiled


@njit(cache=True)
def pair_constants(state: FloatArray, pairs: Pairs, modulus: float, damping_ratio: float) -> None:
    """Fill each pair's constants."""
    first, last, neighbour, constants = pairs.first, pairs.last, pairs.neighbour, pairs.constants
    damping = 2.0 * math.sqrt(5.0 / 6.0) * damping_ratio
    for i in range(first.size):
        for p in range(first[i], last[i]):
            j = neighbour[p] & INDEX_MASK
            a, b = state[i, RADIUS], state[j, RADIUS]
            root = math.sqrt(a * b / (a + b))
            reduced = state[i, MASS] * state[j, MASS] / (state[i, MASS] + state[j, MASS])
            constants[p, STIFFNESS] = 4.0 / 3.0 * modulus * root
            constants[p, DAMPING] = damping * math.sqrt(2.0 * modulus * root * reduced)


@njit(cache=True)
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


@njit(cache=True, error_model="numpy", fastmath=FUSED)
def _limit_speeds(state: FloatArray, patch_speed: FloatArray, patch_limit: FloatArray) -> None:
    """Give every patch of spheres a vertical speed of its own, and the speed relative to it that none may exceed."""
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


@njit(cache=True, error_model="numpy", fastmath=FUSED)
def _pick_near(
    begin: int,
    end: int,
    state: FloatArray,
    pairs: Pairs,
    patch_speed: FloatArray,
    patch_limit: FloatArray,
    length: float,
    duration: float,
) -> None:
    """Copy the pairs of spheres ``begin`` to ``end`` that may touch within ``duration`` (s) to the near ones."""
    first, last, neighbour, constants = pairs.first, pairs.last, pairs.neighbour, pairs.constants
    near_last, near_neighbour = pairs.near_last, pairs.near_neighbour
    near_constants, near_pair = pairs.near_constants, pairs.near_pair
    if begin == end:
        return
    q = first[begin]
    for i in range(begin, end):
        x, y, z = state[i, X], state[i, Y], state[i, Z]
        own_speed = patch_speed[i // PATCH]
        r = state[i, RADIUS] + duration * patch_limit[i // PATCH]
        for p in range(first[i], last[i]):
            j = neighbour[p] & INDEX_MASK
            code = neighbour[p] >> IMAGE_SHIFT
            dx, dy, dz = x - state[j, X], y - state[j, Y], z - state[j, Z]
            if code != SAME_IMAGE:
                dx -= (np.int64(code) % 3 - 1) * length
                dy -= (np.int64(code) // 3 - 1) * length
            patch = j >> PATCH_SHIFT
            approach = patch_limit[patch] + abs(own_speed - patch_speed[patch])
            touching = r + state[j, RADIUS] + duration * approach
            # written in any case and kept if near: a branch here is too often guessed wrongly
            near_pair[q] = p
            q += np.uint64(dx * dx + dy * dy + dz * dz < touching * touching)
        near_last[i] = q
    for k in range(first[begin], q):
        near_neighbour[k] = neighbour[near_pair[k]]
        near_constants[k, STIFFNESS] = constants[near_pair[k], STIFFNESS]
        near_constants[k, DAMPING] = constants[near_pair[k], DAMPING]


@njit(cache=True, error_model="numpy", fastmath=FUSED)
def _farthest(state: FloatArray, reference: FloatArray, frame: float) -> float:
    """Return the largest distance from the reference in a frame that has risen by ``frame``, m."""
    farthest = 0.0
    for i in range(state.shape[0]):
        x, y, z = state[i, X] - reference[i, 0], state[i, Y] - reference[i, 1], state[i, Z] - reference[i, 2] - frame
        farthest = max(farthest, x * x + y * y + z * z)
    return math.sqrt(farthest)


@njit(cache=True, error_model="numpy", fastmath=FUSED)
def _limit_spring(
    hx: float, hy: float, hz: float, stiffness: float, allowed: float
) -> tuple[float, float, float, bool]:
    """Shorten a tangential spring to the Coulomb limit; say whether the contact slides."""
    stretched = stiffness * math.sqrt(hx * hx + hy * hy + hz * hz)
    if stretched <= allowed:
        return hx, hy, hz, False
    ratio = allowed / stretched
    return hx * ratio, hy * ratio, hz * ratio, True


@cache
def _make_pair_forces(cohesive: bool, frictional: bool) -> Callable[..., None]:
    """Compile the forces between spheres for one kind of scene."""

    @njit(cache=True, error_model="numpy", fastmath=FUSED)
    def pair_forces(
        begin: int,
        end: int,
        state: FloatArray,
        spin: FloatArray,
        force: FloatArray,
        torque: FloatArray,
        pairs: Pairs,
        law: Law,
        length: float,
        spring_step: float,
    ) -> None:
        """Add the forces and torques of the pairs of spheres ``begin`` to ``end``; ``force`` has shape (n, 3)."""
        last, neighbour, constants = pairs.near_last, pairs.near_neighbour, pairs.near_constants
        spring, pair = pairs.spring, pairs.near_pair
        lens_factor = 0.25 * math.pi * law.cohesion
        stop = pairs.first[begin] if begin < end else np.uint64(0)
        for i in range(begin, end):
            start, stop = stop, last[i]
            xi, yi, zi, ri = state[i, X], state[i, Y], state[i, Z], state[i, RADIUS]
            ui, vi, wi = state[i, U], state[i, V], state[i, W]
            fx, fy, fz = 0.0, 0.0, 0.0
            tx, ty, tz = 0.0, 0.0, 0.0
            for q in range(start, stop):
                j = neighbour[q] & INDEX_MASK
                code = neighbour[q] >> IMAGE_SHIFT
                dx, dy, dz = xi - state[j, X], yi - state[j, Y], zi - state[j, Z]
                if code != SAME_IMAGE:
                    dx -= (np.int64(code) % 3 - 1) * length
                    dy -= (np.int64(code) // 3 - 1) * length
                square = dx * dx + dy * dy + dz * dz
                rj = state[j, RADIUS]
                total = ri + rj
                if square >= total * total:
                    if frictional:
                        spring[pair[q], 0] = spring[pair[q], 1] = spring[pair[q], 2] = 0.0
                    continue
                r = math.sqrt(square)
                inverse = 1.0 / r
                overlap = total - r
                root = math.sqrt(overlap)
                quarter = math.sqrt(root)
                du, dv, dw = ui - state[j, U], vi - state[j, V], wi - state[j, W]
                normal_speed = (du * dx + dv * dy + dw * dz) * inverse
                normal = constants[q, STIFFNESS] * overlap * root - constants[q, DAMPING] * quarter * normal_speed
                push = normal
                if cohesive:
                    lens = overlap * (total + r) * (square - (ri - rj) * (ri - rj))
                    push -= lens_factor * lens * (inverse * inverse)
                push *= inverse
                gx, gy, gz = push * dx, push * dy, push * dz
                if frictional:
                    nx, ny, nz = dx * inverse, dy * inverse, dz * inverse
                    arm_i, arm_j = ri - 0.5 * overlap, rj - 0.5 * overlap
                    ox = arm_i * spin[i, 0] + arm_j * spin[j, 0]
                    oy = arm_i * spin[i, 1] + arm_j * spin[j, 1]
                    oz = arm_i * spin[i, 2] + arm_j * spin[j, 2]
                    sx = du - normal_speed * nx - (nz * oy - ny * oz)
                    sy = dv - normal_speed * ny - (nx * oz - nz * ox)
                    sz = dw - normal_speed * nz - (ny * ox - nx * oy)
                    hx = spring[pair[q], 0] + sx * spring_step
                    hy = spring[pair[q], 1] + sy * spring_step
                    hz = spring[pair[q], 2] + sz * spring_step
                    along = hx * nx + hy * ny + hz * nz
                    stiffness = law.shear_stiffness * constants[q, STIFFNESS] * root
                    hx, hy, hz, slides = _limit_spring(
                        hx - along * nx, hy - along * ny, hz - along * nz, stiffness, law.friction * abs(normal)
                    )
                    drag = 0.0 if slides else law.shear_damping * constants[q, DAMPING] * quarter
                    px, py, pz = -stiffness * hx - drag * sx, -stiffness * hy - drag * sy, -stiffness * hz - drag * sz
                    spring[pair[q], 0], spring[pair[q], 1], spring[pair[q], 2] = hx, hy, hz
                    gx += px
                    gy += py
                    gz += pz
                    mx, my, mz = ny * pz - nz * py, nz * px - nx * pz, nx * py - ny * px
                    tx -= arm_i * mx
                    ty -= arm_i * my
                    tz -= arm_i * mz
                    torque[j, 0] -= arm_j * mx
                    torque[j, 1] -= arm_j * my
                    torque[j, 2] -= arm_j * mz
                fx += gx
                fy += gy
                fz += gz
                force[j, 0] -= gx
                force[j, 1] -= gy
                force[j, 2] -= gz
            force[i, 0] += fx
            force[i, 1] += fy
            force[i, 2] += fz
            if frictional:
                torque[i, 0] += tx
                torque[i, 1] += ty
                torque[i, 2] += tz

    compiled: Callable[..., None] = pair_forces
    return compiled


@cache
def _make_floor_forces(cohesive: bool, frictional: bool) -> Callable[..., None]:
    """Compile the forces of the floor for one kind of scene."""

    @njit(cache=True, error_model="numpy", fastmath=FUSED)
    def floor_forces(
        grounded: IntArray,
        state: FloatArray,
        spin: FloatArray,
        force: FloatArray,
        torque: FloatArray,
        floor: FloatArray,
        floor_spring: FloatArray,
        law: Law,
        spring_step: float,
    ) -> None:
        """Add the floor's forces and torques on the spheres listed in ``grounded``."""
        for k in range(grounded.size):
            i = grounded[k]
            z, radius = state[i, Z], state[i, RADIUS]
            overlap = radius - z
            if overlap <= 0.0:
                if frictional:
                    floor_spring[i, 0] = floor_spring[i, 1] = 0.0
                continue
            root = math.sqrt(overlap)
            quarter = math.sqrt(root)
            normal = floor[i, STIFFNESS] * overlap * root - floor[i, DAMPING] * quarter * state[i, W]
            force[i, 2] += normal
            if cohesive:
                force[i, 2] -= math.pi * law.cohesion * overlap * (radius + z)
            if frictional:
                arm = z + 0.5 * overlap
                sx, sy = state[i, U] - arm * spin[i, 1], state[i, V] + arm * spin[i, 0]
                stiffness = law.shear_stiffness * floor[i, STIFFNESS] * root
                hx, hy, _, slides = _limit_spring(
                    floor_spring[i, 0] + sx * spring_step,
                    floor_spring[i, 1] + sy * spring_step,
                    0.0,
                    stiffness,
                    law.friction * abs(normal),
                )
                drag = 0.0 if slides else law.shear_damping * floor[i, DAMPING] * quarter
                px, py = -stiffness * hx - drag * sx, -stiffness * hy - drag * sy
                floor_spring[i, 0], floor_spring[i, 1] = hx, hy
                force[i, 0] += px
                force[i, 1] += py
                torque[i, 0] += arm * py
                torque[i, 1] -= arm * px

    compiled: Callable[..., None] = floor_forces
    return compiled


@cache
def _make_move(frictional: bool) -> Callable[..., tuple[float, bool]]:
    """Compile one step of the equations of motion."""

    @njit(cache=True, error_model="numpy", fastmath=FUSED)
    def move(
        begin: int,
        end: int,
        state: FloatArray,
        spin: FloatArray,
        force: FloatArray,
        torque: FloatArray,
        patch_speed: FloatArray,
        patch_limit: FloatArray,
        kick: float,
        time_step: float,
        frame_speed: float,
        gravity: float,
    ) -> tuple[float, bool]:
        """Kick and move spheres ``begin`` to ``end``, and leave their weight in ``force`` for the next step to add to.

        Returns the largest squared speed in the frame, and whether a sphere was faster than its patch may be.
        """
        fastest, too_fast = 0.0, False
        for i in range(begin, end):
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
            sideways = u * u + v * v
            rising, own = w - frame_speed, w - patch_speed[patch]
            fastest = max(fastest, sideways + rising * rising)
            too_fast |= sideways + own * own > patch_limit[patch] * patch_limit[patch]
        return fastest, too_fast

    compiled: Callable[..., tuple[float, bool]] = move
    return compiled


@njit(cache=True)
def _disturbed(state: FloatArray, watched: IntArray) -> bool:
    """Whether one of the watched spheres was touched: until then it falls straight down, to the last bit."""
    disturbed = False
    for i in watched:
        disturbed |= state[i, U] != 0.0 or state[i, V] != 0.0
    return disturbed


@cache
def make_advance(cohesive: bool, frictional: bool, threaded: bool) -> Callable[..., tuple[int, bool]]:
    """Compile the time loop for one kind of scene: what it doesn't need is not in its code.

    A threaded loop gives each thread a share of the pairs and a force buffer of its own.
    """
    pair_forces = _make_pair_forces(cohesive, frictional)
    floor_forces = _make_floor_forces(cohesive, frictional)
    move = _make_move(frictional)

    @njit(cache=True, error_model="numpy", fastmath=FUSED, parallel=threaded)
    def advance(
        steps: int,
        ready: bool,
        starting: bool,
        state: FloatArray,
        spin: FloatArray,
        force: FloatArray,
        torque: FloatArray,
        floor: FloatArray,
        floor_spring: FloatArray,
        pairs: Pairs,
        bounds: IntArray,
        reference: FloatArray,
        watched: IntArray,
        grounded: IntArray,
        law: Law,
        length: float,
        time_step: float,
        skin: float,
        frame: float,
        frame_step: float,
    ) -> tuple[int, bool]:
        """Advance up to ``steps``.

        It stops early, forces unknown, when a sphere may have moved by half a skin since the pairs were listed (at
        ``reference``; real distances are taken only when the sum of the largest speeds says so), or when
        one of the ``watched`` spheres, which have neighbours that are not in the list, has been touched. Movement
        is seen from a frame that has risen by ``frame`` and rises by ``frame_step`` per step: only relative
        movement opens or closes a pair.

        ``force`` and ``torque`` have one layer per thread, shape (threads, n, 3); the first ends as the total.
        ``bounds`` (threads + 1,) are the spheres whose pairs each thread works on, ``grounded`` the spheres that
        may touch the floor.

        Returns
        -------
        Steps done, and whether the forces at the new positions are known.
        """
        n = state.shape[0]
        parts = bounds.size - 1 if threaded else 1  # named here, or the cache mixes up the two kinds
        done = 0
        limit = 0.5 * skin
        drift, speed, too_fast = _farthest(state, reference, frame), np.zeros(parts), np.zeros(parts, dtype=np.bool_)
        patches = (n + PATCH - 1) // PATCH
        patch_speed, patch_limit = np.zeros(patches), np.full(patches, np.inf)
        picked = 0  # steps that the choice of near pairs will last yet
        near_enough = True
        frame_speed = frame_step / time_step
        if not ready:
            for t in prange(parts):
                for i in range(n):
                    force[t, i, 0] = force[t, i, 1] = 0.0
                    force[t, i, 2] = -law.gravity * state[i, MASS] if t == 0 else 0.0
                    if frictional:
                        torque[t, i, 0] = torque[t, i, 1] = torque[t, i, 2] = 0.0
        while True:
            if not ready:
                if picked == 0:
                    _limit_speeds(state, patch_speed, patch_limit)
                    duration = NEAR_STEPS * time_step
                    for t in prange(parts):
                        _pick_near(bounds[t], bounds[t + 1], state, pairs, patch_speed, patch_limit, length, duration)
                    picked = NEAR_STEPS
                spring_step = 0.0 if starting else time_step  # at the start the springs know the positions
                for t in prange(parts):
                    pair_forces(
                        bounds[t], bounds[t + 1], state, spin, force[t], torque[t], pairs, law, length, spring_step
                    )
                if parts > 1:
                    for t in prange(parts):
                        for i in range(t * n // parts, (t + 1) * n // parts):
                            for other in range(1, parts):
                                for k in range(3):
                                    force[0, i, k] += force[other, i, k]
                                    force[other, i, k] = 0.0
                                    if frictional:
                                        torque[0, i, k] += torque[other, i, k]
                                        torque[other, i, k] = 0.0
                floor_forces(grounded, state, spin, force[0], torque[0], floor, floor_spring, law, spring_step)
                ready = True
            if done == steps:
                return done, ready
            kick = 0.5 * time_step if starting else time_step
            starting = False
            frame += frame_step
            for t in prange(parts):
                speed[t], too_fast[t] = move(
                    t * n // parts,
                    (t + 1) * n // parts,
                    state,
                    spin,
                    force[0],
                    torque[0],
                    patch_speed,
                    patch_limit,
                    kick,
                    time_step,
                    frame_speed,
                    law.gravity,
                )
            path = math.sqrt(speed.max()) * time_step
            picked = 0 if too_fast.any() else max(picked - 1, 0)
            drift += path  # none has moved farther
            if not drift < limit:
                drift = _farthest(state, reference, frame)
                near_enough = drift < CLOSE_TO_LIMIT * limit
            done += 1
            ready = False
            if not near_enough or not abs(frame) < limit or _disturbed(state, watched):
                return done, ready

    compiled: Callable[..., tuple[int, bool]] = advance
    return compiled
