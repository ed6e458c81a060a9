"""Compiled kernels of the contact forces between spheres.

Pairs are worked on in chunks: what a chunk needs is gathered into rows that lie in order in memory, the law is applied
to whole rows at once, by the processor's vector units, and the forces are given to the spheres. One by one, roots and
divisions would take most of the time.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np
from numba.misc.special import literally

from filtercake.packing.compiled import cached_njit
from filtercake.packing.engines import vector_kernels
from filtercake.units import FloatArray

if TYPE_CHECKING:
    from filtercake.packing.engines.embedded_kernels import Bodies, Law, Pairs

FUSED: Final = {"contract"}
"""Multiply and add in one instruction where the processor can; nothing else of floating-point law is relaxed."""

_compiled = cached_njit(error_model="numpy", fastmath=FUSED)

# kinds of attraction
NO_ATTRACTION, COHESION, ADHESION = range(3)

# columns of the state
X, Y, Z, RADIUS, U, V, W, MASS = range(8)

# indices are unsigned: signed ones cost a test for negative values at every access
IMAGE_SHIFT: Final = np.uint32(vector_kernels.IMAGE_SHIFT)
INDEX_MASK: Final = np.uint32(vector_kernels.INDEX_MASK)
SAME_IMAGE: Final = np.uint32(4)
"""Code of a neighbour in the box itself, not in one of its eight periodic images."""
IMAGES: Final = 9

# rows of a pair's near constants
STIFFNESS, DAMPING = range(2)

VECTOR: Final = vector_kernels.VECTOR
CHUNK: Final = vector_kernels.CHUNK
FAR: Final = 50_000
"""Spheres from which a bed fits into no memory that is near: what comes next is asked for ahead."""
_ROWS: Final = 35

# where each row begins. A loop writes no row that it reads: that would keep it from the vector units
(_DX, _DY, _DZ, _UNLIKE, _DU, _DV, _DW, _TOTAL) = (np.uint64(CHUNK * row) for row in range(8))
(_TURN_X, _TURN_Y, _TURN_Z, _SPIN_X, _SPIN_Y, _SPIN_Z) = (np.uint64(CHUNK * row) for row in range(8, 14))
(_OLD_X, _OLD_Y, _OLD_Z, _NEW_X, _NEW_Y, _NEW_Z) = (np.uint64(CHUNK * row) for row in range(14, 20))
(_INVERSE, _NORMAL, _SPRING, _DAMPER, _ARM, _OTHER_ARM) = (np.uint64(CHUNK * row) for row in range(20, 26))
(_FX, _FY, _FZ, _MX, _MY, _MZ) = (np.uint64(CHUNK * row) for row in range(26, 32))
_SPEED, _TOUCHING, _PUSH = (np.uint64(CHUNK * row) for row in range(32, 35))


@cached_njit
def _image_shifts(length: float) -> FloatArray:
    """How far each code's image lies along x and y, m, in rows of eight: shape (9, 8)."""
    shift = np.zeros((IMAGES, VECTOR))
    for code in range(IMAGES):
        shift[code, 0], shift[code, 1] = (code % 3 - 1) * length, (code // 3 - 1) * length
    return shift


@_compiled
def _fetch(begin: int, end: int, bodies: Bodies, pairs: Pairs) -> None:
    """Ask for the neighbours of near pairs that are worked on next: of large beds they are in no near memory."""
    state, force, neighbour = bodies.state, bodies.force, pairs.near_neighbour
    for p in range(begin, end):
        j = np.uint64(neighbour[p] & INDEX_MASK)
        vector_kernels.fetch_row(state, j, np.uint64(VECTOR))
        vector_kernels.fetch_row(force, j, np.uint64(vector_kernels.FORCE))


@_compiled
def _gather_turning(begin: int, end: int, bodies: Bodies, pairs: Pairs, rows: FloatArray) -> None:
    """Fill in what friction needs beside the differences of the states: spins and the tangential springs."""
    state, spin, spring = bodies.state, bodies.spin, pairs.spring
    c = np.uint64(0)
    for p in range(begin, end):
        i, j, pair = pairs.near_owner[p], pairs.near_neighbour[p] & INDEX_MASK, pairs.near_pair[p]
        ri, rj = state[i, RADIUS], state[j, RADIUS]
        rows[_TURN_X + c], rows[_SPIN_X + c] = ri * spin[i, 0] + rj * spin[j, 0], spin[i, 0] + spin[j, 0]
        rows[_TURN_Y + c], rows[_SPIN_Y + c] = ri * spin[i, 1] + rj * spin[j, 1], spin[i, 1] + spin[j, 1]
        rows[_TURN_Z + c], rows[_SPIN_Z + c] = ri * spin[i, 2] + rj * spin[j, 2], spin[i, 2] + spin[j, 2]
        rows[_OLD_X + c], rows[_OLD_Y + c], rows[_OLD_Z + c] = spring[pair, 0], spring[pair, 1], spring[pair, 2]
        c += np.uint64(1)


@_compiled
def _normal(
    begin: int, count: int, constants: FloatArray, law: Law, attraction: int, frictional: bool, rows: FloatArray
) -> None:
    """Take the normal force, N, attraction included; nought where none touch.

    Without friction it is left over the distance of the centres, N/m; with it, so is all that friction needs of it.
    """
    literally(attraction), literally(frictional)
    lens_factor, pull_factor = 0.25 * math.pi * law.cohesion, 0.375 * math.pi * law.adhesion
    stiffness, damping = constants[STIFFNESS], constants[DAMPING]
    for c in range(count):
        dx, dy, dz, total, unlike = rows[_DX + c], rows[_DY + c], rows[_DZ + c], rows[_TOTAL + c], rows[_UNLIKE + c]
        square = dx * dx + dy * dy + dz * dz
        r = math.sqrt(square)
        inverse = 1.0 / r
        overlap = max(total - r, 0.0)
        root = math.sqrt(overlap)
        damper = damping[begin + c] * math.sqrt(root)
        speed = (rows[_DU + c] * dx + rows[_DV + c] * dy + rows[_DW + c] * dz) * inverse
        normal = stiffness[begin + c] * (overlap * root) - damper * speed
        push = normal
        if attraction == COHESION:
            lens = overlap * (total + r) * (square - unlike * unlike)
            push -= lens_factor * lens * (inverse * inverse)
        if attraction == ADHESION:  # of the reduced radius, ri rj / (ri + rj)
            push -= pull_factor * (total * total - unlike * unlike) / total if overlap > 0.0 else 0.0
        if frictional:
            rows[_PUSH + c], rows[_INVERSE + c] = push, inverse
            rows[_NORMAL + c], rows[_SPEED + c] = normal, speed
            rows[_SPRING + c], rows[_DAMPER + c] = stiffness[begin + c] * root, damper
            rows[_ARM + c], rows[_OTHER_ARM + c] = 0.5 * (total + unlike - overlap), 0.5 * (total - unlike - overlap)
            rows[_TOUCHING + c] = 1.0 if overlap > 0.0 else 0.0
        else:
            rows[_PUSH + c] = push * inverse


@_compiled
def _tangential(count: int, law: Law, spring_step: float, rows: FloatArray) -> None:
    """Take the force, N, the moment of its tangential part over the arm, N, and the springs, m."""
    for c in range(count):
        inverse, speed = rows[_INVERSE + c], rows[_SPEED + c]
        nx, ny, nz = rows[_DX + c] * inverse, rows[_DY + c] * inverse, rows[_DZ + c] * inverse
        half = 0.5 * (rows[_TOTAL + c] - (rows[_ARM + c] + rows[_OTHER_ARM + c]))
        ox = rows[_TURN_X + c] - half * rows[_SPIN_X + c]
        oy = rows[_TURN_Y + c] - half * rows[_SPIN_Y + c]
        oz = rows[_TURN_Z + c] - half * rows[_SPIN_Z + c]
        sx = rows[_DU + c] - speed * nx - (nz * oy - ny * oz)
        sy = rows[_DV + c] - speed * ny - (nx * oz - nz * ox)
        sz = rows[_DW + c] - speed * nz - (ny * ox - nx * oy)
        hx = rows[_OLD_X + c] + sx * spring_step
        hy = rows[_OLD_Y + c] + sy * spring_step
        hz = rows[_OLD_Z + c] + sz * spring_step
        along = hx * nx + hy * ny + hz * nz
        hx, hy, hz = hx - along * nx, hy - along * ny, hz - along * nz
        stiffness = law.shear_stiffness * rows[_SPRING + c]
        allowed = law.friction * abs(rows[_NORMAL + c])
        stretched = stiffness * math.sqrt(hx * hx + hy * hy + hz * hz)
        slides = stretched > allowed
        scale = (allowed / stretched if slides else 1.0) * rows[_TOUCHING + c]
        hx, hy, hz = hx * scale, hy * scale, hz * scale
        rows[_NEW_X + c], rows[_NEW_Y + c], rows[_NEW_Z + c] = hx, hy, hz
        drag = 0.0 if slides else law.shear_damping * rows[_DAMPER + c]
        px, py, pz = -stiffness * hx - drag * sx, -stiffness * hy - drag * sy, -stiffness * hz - drag * sz
        square = px * px + py * py + pz * pz
        capped = law.capped and not slides and square > allowed * allowed
        ratio = allowed / math.sqrt(square) if capped else 1.0
        px, py, pz = px * ratio, py * ratio, pz * ratio
        push = rows[_PUSH + c]
        rows[_FX + c], rows[_FY + c], rows[_FZ + c] = push * nx + px, push * ny + py, push * nz + pz
        rows[_MX + c], rows[_MY + c], rows[_MZ + c] = ny * pz - nz * py, nz * px - nx * pz, nx * py - ny * px


@_compiled
def _give_push(
    part: int, begin: int, end: int, force: FloatArray, pairs: Pairs, apart: FloatArray, rows: FloatArray
) -> None:
    """Add the forces to both spheres: to the total, or, of another part's sphere, to the layer of this part."""
    owner, neighbour, bounds = pairs.near_owner, pairs.near_neighbour, pairs.bounds
    lower, upper = np.uint64(bounds[part]), np.uint64(bounds[part + 1])
    # alone, the images of a cell are its own, too
    layer = np.uint64(part + 1) * np.uint64(force.shape[1]) if force.shape[0] > 1 else np.uint64(0)
    c = np.uint64(0)
    for p in range(begin, end):
        j = np.uint64(neighbour[p] & INDEX_MASK)
        j += np.uint64(0) if lower <= j < upper else layer
        vector_kernels.give_and_take(force, owner[p], j, rows[_PUSH + c], apart, c)
        c += np.uint64(1)


@_compiled
def _give_turning(part: int, begin: int, end: int, bodies: Bodies, pairs: Pairs, rows: FloatArray) -> None:
    """As above with torques, and keep the springs."""
    other = min(part + 1, bodies.force.shape[0] - 1)
    alone = bodies.force.shape[0] == 1
    force, torque = bodies.force[0], bodies.torque[0]
    force_layer, torque_layer, spring = bodies.force[other], bodies.torque[other], pairs.spring
    lower, upper = np.uint64(pairs.bounds[part]), np.uint64(pairs.bounds[part + 1])
    c = np.uint64(0)
    for p in range(begin, end):
        i, j, pair = pairs.near_owner[p], pairs.near_neighbour[p] & INDEX_MASK, pairs.near_pair[p]
        gx, gy, gz = rows[_FX + c], rows[_FY + c], rows[_FZ + c]
        mx, my, mz = rows[_MX + c], rows[_MY + c], rows[_MZ + c]
        arm, other_arm = rows[_ARM + c], rows[_OTHER_ARM + c]
        force[i, 0] += gx
        force[i, 1] += gy
        force[i, 2] += gz
        torque[i, 0] -= arm * mx
        torque[i, 1] -= arm * my
        torque[i, 2] -= arm * mz
        if alone or lower <= j < upper:
            force[j, 0] -= gx
            force[j, 1] -= gy
            force[j, 2] -= gz
            torque[j, 0] -= other_arm * mx
            torque[j, 1] -= other_arm * my
            torque[j, 2] -= other_arm * mz
        else:
            force_layer[j, 0] -= gx
            force_layer[j, 1] -= gy
            force_layer[j, 2] -= gz
            torque_layer[j, 0] -= other_arm * mx
            torque_layer[j, 1] -= other_arm * my
            torque_layer[j, 2] -= other_arm * mz
        spring[pair, 0], spring[pair, 1], spring[pair, 2] = rows[_NEW_X + c], rows[_NEW_Y + c], rows[_NEW_Z + c]
        c += np.uint64(1)


@_compiled
def pair_forces(
    part: int, bodies: Bodies, pairs: Pairs, law: Law, spring_step: float, attraction: int, frictional: bool
) -> None:
    """Add the forces and torques of the pairs of one part's spheres.

    ``spring_step`` is the time, s, by which the tangential springs move on. Forces on this part's spheres are added
    to the total, the first layer; those on another part's to the layer of this part, ``part + 1``.
    """
    literally(attraction), literally(frictional)  # compiled for each kind: what it doesn't need is not in its code
    begin, end = pairs.bounds[part], pairs.bounds[part + 1]
    if begin == end:
        return
    rows, apart = vector_kernels.aligned(_ROWS * CHUNK), vector_kernels.aligned(VECTOR * CHUNK)
    state, owner, neighbour, shift = bodies.state, pairs.near_owner, pairs.near_neighbour, _image_shifts(law.length)
    here, last = pairs.first[begin], pairs.near_end[part]
    far = state.shape[0] >= FAR
    while here < last:
        stop = min(here + np.uint64(CHUNK), last)
        count = (stop - here + np.uint64(VECTOR - 1)) // np.uint64(VECTOR) * np.uint64(VECTOR)
        if far:
            _fetch(stop, min(stop + np.uint64(CHUNK), last), bodies, pairs)
        for c in range(np.uint64(0), count, np.uint64(VECTOR)):
            vector_kernels.gather_pairs(state, owner, neighbour, shift, here + c, stop, apart, rows, c)
        if frictional:
            _gather_turning(here, stop, bodies, pairs, rows)
        _normal(here, count, pairs.near_constants, law, attraction, frictional, rows)
        if frictional:
            _tangential(count, law, spring_step, rows)
            _give_turning(part, here, stop, bodies, pairs, rows)
        else:
            _give_push(part, here, stop, bodies.force, pairs, apart, rows)
        here = stop
