"""Random sequential placement, compiled; a module of its own, so that who plans a study need not wait for numba."""

from __future__ import annotations

import numpy as np

from filtercake.packing.compiled import cached_njit
from filtercake.units import FloatArray, IntArray


@cached_njit
def place(
    position: FloatArray,
    radius: FloatArray,
    height: float,
    level: IntArray,
    cells: IntArray,
    rng: np.random.Generator,
    max_attempts: int,
    periodic: bool,
) -> int:
    """Fill ``position`` (box side 1) and return how many spheres found a place; ``periodic`` is the box's height."""
    n = radius.size
    start = np.zeros(cells.shape[0] + 1, dtype=np.int64)
    for k in range(cells.shape[0]):
        start[k + 1] = start[k] + cells[k, 0] * cells[k, 1] * cells[k, 2]
    head = np.full(start[-1], -1, dtype=np.int64)
    following = np.full(n, -1, dtype=np.int64)
    reach = np.zeros(cells.shape[0])  # largest radius present on each level
    for i in range(n):
        r = radius[i]
        found = False
        for _ in range(max_attempts):
            x = rng.random()
            y = rng.random()
            z = rng.random() * height if periodic else r + rng.random() * (height - 2.0 * r)
            if _is_free(x, y, z, r, position, radius, height, cells, start, head, following, reach, periodic):
                found = True
                break
        if not found:
            return i
        position[i, 0], position[i, 1], position[i, 2] = x, y, z
        k = level[i]
        reach[k] = max(reach[k], r)
        cell = start[k] + _cell(x, y, z, height, cells[k])
        following[i] = head[cell]
        head[cell] = i
    return n


@cached_njit
def _cell(x: float, y: float, z: float, height: float, cells: IntArray) -> int:
    cx = min(int(x * cells[0]), cells[0] - 1)
    cy = min(int(y * cells[1]), cells[1] - 1)
    cz = min(int(z / height * cells[2]), cells[2] - 1)
    return int((cz * cells[1] + cy) * cells[0] + cx)


@cached_njit
def _is_free(
    x: float,
    y: float,
    z: float,
    r: float,
    position: FloatArray,
    radius: FloatArray,
    height: float,
    cells: IntArray,
    start: IntArray,
    head: IntArray,
    following: IntArray,
    reach: FloatArray,
    periodic: bool,
) -> bool:
    """Whether a sphere at (x, y, z) overlaps none of those placed so far."""
    for k in range(cells.shape[0]):
        if reach[k] == 0.0:
            continue
        span = r + reach[k]
        nx, ny, nz = cells[k, 0], cells[k, 1], cells[k, 2]
        x0, x1 = int(np.floor((x - span) * nx)), int(np.floor((x + span) * nx))
        y0, y1 = int(np.floor((y - span) * ny)), int(np.floor((y + span) * ny))
        z0 = max(0, int((z - span) / height * nz)) if z > span else 0
        z1 = min(nz - 1, int((z + span) / height * nz))
        x1, y1 = min(x1, x0 + nx - 1), min(y1, y0 + ny - 1)
        if periodic:
            z0 = int(np.floor((z - span) / height * nz))
            z1 = min(int(np.floor((z + span) / height * nz)), z0 + nz - 1)
        for cz in range(z0, z1 + 1):
            for cy in range(y0, y1 + 1):
                row = start[k] + (cz % nz * ny + cy % ny) * nx
                for cx in range(x0, x1 + 1):
                    j = head[row + cx % nx]
                    while j >= 0:
                        dx, dy = x - position[j, 0], y - position[j, 1]
                        dx -= np.round(dx)
                        dy -= np.round(dy)
                        dz = z - position[j, 2]
                        if periodic:
                            dz -= height * np.round(dz / height)
                        gap = r + radius[j]
                        if dx * dx + dy * dy + dz * dz < gap * gap:
                            return False
                        j = following[j]
    return True
