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


class Grid(NamedTuple):
    """Cells of every size level: first sphere of each cell, cells per axis, first cell, largest radius, cell side."""

    start: IntArray
    shape: IntArray
    offset: IntArray
    largest: FloatArray
    cell_size: FloatArray


SAME_IMAGE = 4
"""Code of a neighbour in the box itself, not in one of its eight periodic images."""

# columns of a pair's constants
RADIUS_SUM, RADIUS_DIFFERENCE_SQUARED, STIFFNESS, DAMPING, SHEAR_STIFFNESS, SHEAR_DAMPING = range(6)


@njit(cache=True)
def sort_into_cells(
    position: FloatArray, level: IntArray, cell_size: FloatArray, length: float, top: float
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Assign spheres to the cells of their size level and find the order that makes cells contiguous.

    Parameters
    ----------
    position : ndarray, shape (n, 3)
        Centres, x and y in [0, length).
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
        cx = min(int(position[i, 0] / length * across), across - 1)
        cy = min(int(position[i, 1] / length * across), across - 1)
        cz = min(max(int(position[i, 2] / cell_size[k]), 0), shape[k, 2] - 1)
        cell[i] = offset[k] + (cz * across + cy) * across + cx
        start[cell[i] + 1] += 1
    for c in range(offset[levels]):
        start[c + 1] += start[c]
    fill = start[:-1].copy()
    order = np.empty(n, dtype=np.int64)
    for i in range(n):
        order[fill[cell[i]]] = i
        fill[cell[i]] += 1
    return order, start, shape, offset


@njit(cache=True)
def find_pairs(
    position: FloatArray,
    radius: FloatArray,
    level: IntArray,
    grid: Grid,
    length: float,
    skin: float,
    first: IntArray,
    neighbour: np.ndarray[Any, np.dtype[np.int32]],
    image: np.ndarray[Any, np.dtype[np.int8]],
) -> int:
    """List pairs closer than ``skin``, each once, by sphere (spheres sorted into cells); return how many.

    ``first[i]:first[i + 1]`` are sphere i's neighbours; ``image`` codes the neighbour's periodic image. When
    the arrays are too short, the number returned is larger than their size and they hold only a part.
    """
    start, shape, offset, largest, cell_size = grid
    n = radius.size
    capacity = neighbour.size
    count = 0
    for i in range(n):
        first[i] = count
        x, y, z, r = position[i, 0], position[i, 1], position[i, 2], radius[i]
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
            for cz in range(z0, z1 + 1):
                for cy in range(y0, y1 + 1):
                    wrap_y = -1 if cy < 0 else (1 if cy >= across else 0)
                    ys = y - wrap_y * length
                    row = offset[k] + (cz * across + cy - wrap_y * across) * across
                    for cx in range(x0, x1 + 1):
                        wrap_x = -1 if cx < 0 else (1 if cx >= across else 0)
                        xs = x - wrap_x * length
                        c = row + cx - wrap_x * across
                        begin = start[c]
                        if k == own:
                            begin = max(begin, i + 1)  # each pair once
                        for j in range(begin, start[c + 1]):
                            dx = xs - position[j, 0]
                            dy = ys - position[j, 1]
                            dz = z - position[j, 2]
                            near = r + radius[j] + skin
                            if dx * dx + dy * dy + dz * dz < near * near:
                                if count < capacity:
                                    neighbour[count] = j
                                    image[count] = (wrap_y + 1) * 3 + wrap_x + 1
                                count += 1
    first[n] = count
    return count


@njit(cache=True)
def pair_constants(
    radius: FloatArray,
    mass: FloatArray,
    first: IntArray,
    neighbour: np.ndarray[Any, np.dtype[np.int32]],
    modulus: float,
    shear_modulus: float,
    damping_ratio: float,
    constants: FloatArray,
) -> None:
    """Fill each pair's constants: all of the contact law that does not change while the pair lasts."""
    damping = 2.0 * math.sqrt(5.0 / 6.0) * damping_ratio
    for i in range(radius.size):
        for p in range(first[i], first[i + 1]):
            j = neighbour[p]
            root = math.sqrt(radius[i] * radius[j] / (radius[i] + radius[j]))
            reduced = mass[i] * mass[j] / (mass[i] + mass[j])
            constants[p, RADIUS_SUM] = radius[i] + radius[j]
            constants[p, RADIUS_DIFFERENCE_SQUARED] = (radius[i] - radius[j]) ** 2
            constants[p, STIFFNESS] = 4.0 / 3.0 * modulus * root
            constants[p, DAMPING] = damping * math.sqrt(2.0 * modulus * root * reduced)
            if constants.shape[1] > SHEAR_STIFFNESS:
                constants[p, SHEAR_STIFFNESS] = 8.0 * shear_modulus * root
                constants[p, SHEAR_DAMPING] = damping * math.sqrt(8.0 * shear_modulus * root * reduced)


@njit(cache=True)
def carry_springs(
    order: IntArray,
    old_first: IntArray,
    old_neighbour: np.ndarray[Any, np.dtype[np.int32]],
    old_spring: FloatArray,
    first: IntArray,
    neighbour: np.ndarray[Any, np.dtype[np.int32]],
    spring: FloatArray,
) -> None:
    """Carry tangential springs over to a new pair list; ``order[i]`` is where sphere i stood before, -1 if new."""
    for i in range(first.size - 1):
        old_i = order[i]
        for p in range(first[i], first[i + 1]):
            spring[p, 0] = spring[p, 1] = spring[p, 2] = 0.0
            old_j = order[neighbour[p]]
            if old_i < 0 or old_j < 0:
                continue
            for q in range(old_first[old_i], old_first[old_i + 1]):
                if old_neighbour[q] == old_j:
                    for k in range(3):
                        spring[p, k] = old_spring[q, k]
            for q in range(old_first[old_j], old_first[old_j + 1]):
                if old_neighbour[q] == old_i:
                    for k in range(3):
                        spring[p, k] = -old_spring[q, k]


@cache
def make_advance(cohesive: bool, frictional: bool, threaded: bool) -> Callable[..., tuple[int, bool]]:
    """Compile the time loop for one kind of scene: what it doesn't need is not in its code.

    A threaded loop gives each thread a share of the pairs and a force buffer of its own.
    """

    @njit(cache=True, error_model="numpy", parallel=threaded)
    def advance(
        steps: int,
        ready: bool,
        starting: bool,
        hold_springs: bool,
        position: FloatArray,
        velocity: FloatArray,
        spin: FloatArray,
        force: FloatArray,
        torque: FloatArray,
        radius: FloatArray,
        mass: FloatArray,
        floor: FloatArray,
        floor_spring: FloatArray,
        bounds: IntArray,
        first: IntArray,
        neighbour: np.ndarray[Any, np.dtype[np.int32]],
        image: np.ndarray[Any, np.dtype[np.int8]],
        constants: FloatArray,
        spring: FloatArray,
        reference: FloatArray,
        length: float,
        gravity: float,
        cohesion: float,
        friction: float,
        time_step: float,
        drift_limit: float,
    ) -> tuple[int, bool]:
        """Advance up to ``steps``; return the steps done and whether the forces at the new positions are known.

        It stops early, forces unknown, when a sphere has moved by ``drift_limit`` since the pairs were listed.
        ``hold_springs`` says that the springs already know these positions (at the start, or when the forces
        are asked for a second time). ``force`` and ``torque`` have one layer per thread, shape (threads, n, 3);
        the first ends as the total. ``bounds`` (threads + 1,) are the spheres whose pairs each thread works on.
        """
        n = radius.size
        parts = bounds.size - 1
        done = 0
        limit = drift_limit * drift_limit
        area_factor = 0.25 * math.pi * cohesion
        drift = np.zeros(parts)
        while True:
            if not ready:
                spring_step = 0.0 if hold_springs else time_step
                hold_springs = False
                for t in prange(parts):
                    for i in range(n):
                        force[t, i, 0] = force[t, i, 1] = force[t, i, 2] = 0.0
                        if frictional:
                            torque[t, i, 0] = torque[t, i, 1] = torque[t, i, 2] = 0.0
                    for i in range(bounds[t], bounds[t + 1]):
                        xi, yi, zi = position[i, 0], position[i, 1], position[i, 2]
                        ui, vi, wi = velocity[i, 0], velocity[i, 1], velocity[i, 2]
                        fx, fy, fz = 0.0, 0.0, 0.0
                        tx, ty, tz = 0.0, 0.0, 0.0
                        for p in range(first[i], first[i + 1]):
                            j = neighbour[p]
                            code = image[p]
                            dx = xi - position[j, 0]
                            dy = yi - position[j, 1]
                            dz = zi - position[j, 2]
                            if code != SAME_IMAGE:
                                dx -= (code % 3 - 1) * length
                                dy -= (code // 3 - 1) * length
                            square = dx * dx + dy * dy + dz * dz
                            total = constants[p, RADIUS_SUM]
                            if square >= total * total:
                                if frictional:
                                    spring[p, 0] = spring[p, 1] = spring[p, 2] = 0.0
                                continue
                            r = math.sqrt(square)
                            inverse = 1.0 / r
                            nx, ny, nz = dx * inverse, dy * inverse, dz * inverse
                            overlap = total - r
                            root = math.sqrt(overlap)
                            quarter = math.sqrt(root)
                            du, dv, dw = ui - velocity[j, 0], vi - velocity[j, 1], wi - velocity[j, 2]
                            normal_speed = du * nx + dv * ny + dw * nz
                            elastic = constants[p, STIFFNESS] * overlap * root
                            normal = elastic - constants[p, DAMPING] * quarter * normal_speed
                            push = normal
                            if cohesive:
                                lens = overlap * (total + r) * (square - constants[p, RADIUS_DIFFERENCE_SQUARED])
                                push -= area_factor * lens * (inverse * inverse)
                            gx, gy, gz = push * nx, push * ny, push * nz
                            if frictional:
                                arm_i = radius[i] - 0.5 * overlap
                                arm_j = radius[j] - 0.5 * overlap
                                ox = arm_i * spin[i, 0] + arm_j * spin[j, 0]
                                oy = arm_i * spin[i, 1] + arm_j * spin[j, 1]
                                oz = arm_i * spin[i, 2] + arm_j * spin[j, 2]
                                sx = du - normal_speed * nx - (nz * oy - ny * oz)
                                sy = dv - normal_speed * ny - (nx * oz - nz * ox)
                                sz = dw - normal_speed * nz - (ny * ox - nx * oy)
                                hx = spring[p, 0] + sx * spring_step
                                hy = spring[p, 1] + sy * spring_step
                                hz = spring[p, 2] + sz * spring_step
                                along = hx * nx + hy * ny + hz * nz
                                hx -= along * nx
                                hy -= along * ny
                                hz -= along * nz
                                stiffness = constants[p, SHEAR_STIFFNESS] * root
                                stretched = stiffness * math.sqrt(hx * hx + hy * hy + hz * hz)
                                allowed = friction * abs(normal)
                                if stretched > allowed:
                                    ratio = allowed / stretched
                                    hx *= ratio
                                    hy *= ratio
                                    hz *= ratio
                                    px, py, pz = -stiffness * hx, -stiffness * hy, -stiffness * hz
                                else:
                                    drag = constants[p, SHEAR_DAMPING] * quarter
                                    px = -stiffness * hx - drag * sx
                                    py = -stiffness * hy - drag * sy
                                    pz = -stiffness * hz - drag * sz
                                spring[p, 0], spring[p, 1], spring[p, 2] = hx, hy, hz
                                gx += px
                                gy += py
                                gz += pz
                                mx, my, mz = ny * pz - nz * py, nz * px - nx * pz, nx * py - ny * px
                                tx -= arm_i * mx
                                ty -= arm_i * my
                                tz -= arm_i * mz
                                torque[t, j, 0] -= arm_j * mx
                                torque[t, j, 1] -= arm_j * my
                                torque[t, j, 2] -= arm_j * mz
                            fx += gx
                            fy += gy
                            fz += gz
                            force[t, j, 0] -= gx
                            force[t, j, 1] -= gy
                            force[t, j, 2] -= gz
                        force[t, i, 0] += fx
                        force[t, i, 1] += fy
                        force[t, i, 2] += fz
                        if frictional:
                            torque[t, i, 0] += tx
                            torque[t, i, 1] += ty
                            torque[t, i, 2] += tz
                for t in prange(parts):
                    for i in range(t * n // parts, (t + 1) * n // parts):
                        for other in range(1, parts):
                            for k in range(3):
                                force[0, i, k] += force[other, i, k]
                                if frictional:
                                    torque[0, i, k] += torque[other, i, k]
                        force[0, i, 2] -= mass[i] * gravity
                        overlap = radius[i] - position[i, 2]
                        if overlap <= 0.0:
                            if frictional:
                                floor_spring[i, 0] = floor_spring[i, 1] = 0.0
                            continue
                        root = math.sqrt(overlap)
                        quarter = math.sqrt(root)
                        normal = floor[i, 0] * overlap * root - floor[i, 1] * quarter * velocity[i, 2]
                        force[0, i, 2] += normal
                        if cohesive:
                            force[0, i, 2] -= 4.0 * area_factor * overlap * (radius[i] + position[i, 2])
                        if frictional:
                            arm = position[i, 2] + 0.5 * overlap
                            sx = velocity[i, 0] - arm * spin[i, 1]
                            sy = velocity[i, 1] + arm * spin[i, 0]
                            hx = floor_spring[i, 0] + sx * spring_step
                            hy = floor_spring[i, 1] + sy * spring_step
                            stiffness = floor[i, 2] * root
                            stretched = stiffness * math.sqrt(hx * hx + hy * hy)
                            allowed = friction * abs(normal)
                            if stretched > allowed:
                                ratio = allowed / stretched
                                hx *= ratio
                                hy *= ratio
                                px, py = -stiffness * hx, -stiffness * hy
                            else:
                                drag = floor[i, 3] * quarter
                                px = -stiffness * hx - drag * sx
                                py = -stiffness * hy - drag * sy
                            floor_spring[i, 0], floor_spring[i, 1] = hx, hy
                            force[0, i, 0] += px
                            force[0, i, 1] += py
                            torque[0, i, 0] += arm * py
                            torque[0, i, 1] -= arm * px
                ready = True
            if done == steps:
                return done, ready
            kick = 0.5 * time_step if starting else time_step
            starting = False
            for t in prange(parts):
                farthest = 0.0
                for i in range(t * n // parts, (t + 1) * n // parts):
                    scale = kick / mass[i]
                    away = 0.0
                    for k in range(3):
                        velocity[i, k] += scale * force[0, i, k]
                        position[i, k] += time_step * velocity[i, k]
                        moved = position[i, k] - reference[i, k]
                        away += moved * moved
                    if frictional:
                        turn = scale / (0.4 * radius[i] * radius[i])
                        for k in range(3):
                            spin[i, k] += turn * torque[0, i, k]
                    if not away <= farthest:  # keeps what is not a number, too
                        farthest = away
                drift[t] = farthest
            done += 1
            ready = False
            for t in range(parts):
                if not drift[t] < limit:
                    return done, ready

    compiled: Callable[..., tuple[int, bool]] = advance
    return compiled
