"""Rows of eight numbers as the processor's vector units take them: loaded, subtracted, turned and added whole.

A compiler that is given the numbers one by one loads, subtracts and stores them one by one. These intrinsics say what
is one vector; where the processor's are narrower, the compiler makes several of it. Every number is rounded as it
would be alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.core.cgutils import get_or_insert_function
from numba.extending import intrinsic, register_jitable

from filtercake.units import FloatArray

VECTOR: Final = 8
"""Numbers that the widest vector unit takes at once: rows are worked on up to a multiple of it."""
CHUNK: Final = 64
"""Pairs that are worked on at once: the length of a row."""
FORCE: Final = 4
"""Columns of forces: three, and one that stays nought."""
RADIUS: Final = 3
"""Column of the state."""

IMAGE_SHIFT: Final = 28
INDEX_MASK: Final = 2**IMAGE_SHIFT - 1
"""Of a neighbour, the lower bits are its index, the upper ones a code of its periodic image."""

_NUMBER, _INDEX, _LANE = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
_NO_FORCE = ir.Constant(ir.VectorType(_NUMBER, FORCE), [_NUMBER(0.0)] * FORCE)
_BYTES: Final = 8


@register_jitable
def aligned(size: int) -> FloatArray:
    """Make noughts that begin where a line of memory does: a vector across two of them takes twice the time."""
    room = np.zeros(size + VECTOR)
    return room[(-room.ctypes.data % (_BYTES * VECTOR)) // _BYTES :][:size]


def _splat(builder: Any, number: Any) -> Any:
    """Take a number in every lane."""
    vector = ir.Constant(ir.VectorType(_NUMBER, VECTOR), ir.Undefined)
    return builder.shuffle_vector(builder.insert_element(vector, number, _LANE(0)), vector, _lanes([0] * VECTOR))


def _three(builder: Any, number: Any) -> Any:
    """Take a number in the lanes of a force, and nought in the last."""
    vector = _NO_FORCE
    for lane in range(FORCE - 1):
        vector = builder.insert_element(vector, number, _LANE(lane))
    return vector


def _intrinsic(function: Callable[..., Any]) -> Callable[..., Any]:
    """Make a function of the kinds of its arguments an intrinsic, which compiled code calls with those arguments."""
    made: Callable[..., Any] = intrinsic(function)
    return made


def _rows(array: Any) -> bool:
    """Whether a type is that of arrays of numbers that lie one behind the other."""
    return isinstance(array, types.Array) and array.layout == "C" and array.dtype == types.float64


def _place(context: Any, builder: Any, signature: Any, arguments: Any, k: int, at: Any) -> Any:
    """Address of number ``at`` of the array that is argument ``k``."""
    array = context.make_array(signature.args[k])(context, builder, arguments[k])
    return builder.gep(array.data, [at])


def _load(builder: Any, place: Any, count: int) -> Any:
    vector = builder.load(builder.bitcast(place, ir.VectorType(_NUMBER, count).as_pointer()))
    vector.align = _BYTES
    return vector


def _store(builder: Any, vector: Any, place: Any) -> None:
    builder.store(vector, builder.bitcast(place, vector.type.as_pointer())).align = _BYTES


def _lanes(places: list[int]) -> Any:
    return ir.Constant(ir.VectorType(_LANE, len(places)), [_LANE(place) for place in places])


def _transposed(builder: Any, rows: list[Any]) -> list[Any]:
    """Turn a square of rows: blocks of one, two and four lanes change places."""
    size, width = len(rows), 1
    while width < size:
        low = _lanes([lane if not lane & width else size + lane - width for lane in range(size)])
        high = _lanes([lane + width if not lane & width else size + lane for lane in range(size)])
        turned = list(rows)
        for i in (i for i in range(size) if not i & width):
            turned[i] = builder.shuffle_vector(rows[i], rows[i + width], low)
            turned[i + width] = builder.shuffle_vector(rows[i], rows[i + width], high)
        rows, width = turned, 2 * width
    return rows


@_intrinsic
def gather_pairs(
    typing: Any,
    state: Any,
    owner: Any,
    neighbour: Any,
    shift: Any,
    begin: Any,
    end: Any,
    apart: Any,
    rows: Any,
    c: Any,
) -> Any:
    """Take the differences of the states of eight pairs, as rows ``c`` to ``c + 8`` and turned, as columns.

    Of pairs ``begin`` to ``begin + 8``, none of them beyond ``end``: in ``apart[c]`` the state of the owner less that
    of the neighbour's image, and in the last place, instead of the difference of the masses, the sum of the radii;
    and number k of it in ``rows[k, c]``. ``shift`` (9, 8) is how far each image lies away.
    """
    if not (_rows(state) and _rows(shift) and _rows(apart) and _rows(rows)):
        return None
    signature = types.void(state, owner, neighbour, shift, types.uint64, types.uint64, apart, rows, types.uint64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def row(k: int, number: Any) -> Any:
            return _place(context, builder, signature, arguments, k, builder.mul(number, _INDEX(VECTOR)))

        begin, last, c = arguments[4], builder.sub(arguments[5], _INDEX(1)), arguments[8]
        found = []
        for lane in range(VECTOR):
            pair = builder.add(begin, _INDEX(lane))
            pair = builder.select(builder.icmp_unsigned("<", pair, last), pair, last)
            mine, named = (
                builder.zext(builder.load(_place(context, builder, signature, arguments, k, pair)), _INDEX)
                for k in (1, 2)
            )
            other = builder.and_(named, _INDEX(INDEX_MASK))
            image = builder.lshr(named, _INDEX(IMAGE_SHIFT))
            a, b, away = (_load(builder, row(k, at), VECTOR) for k, at in ((0, mine), (0, other), (3, image)))
            way = builder.fsub(builder.fsub(a, b), away)
            way = builder.shuffle_vector(way, builder.fadd(a, b), _lanes([*range(VECTOR - 1), VECTOR + RADIUS]))
            _store(builder, way, row(6, builder.add(c, _INDEX(lane))))
            found.append(way)
        for k, vector in enumerate(_transposed(builder, found)):
            at = builder.add(c, _INDEX(k * CHUNK))
            _store(builder, vector, _place(context, builder, signature, arguments, 7, at))
        return context.get_dummy_value()

    return signature, generate


@_intrinsic
def fetch_row(typing: Any, array: Any, row: Any, columns: Any) -> Any:
    """Ask for a row of an array, which is to be there when it is wanted later: nothing waits for it."""
    if not _rows(array):
        return None
    signature = types.void(array, types.uint64, types.uint64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _place(context, builder, signature, arguments, 0, builder.mul(arguments[1], arguments[2]))
        byte = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [byte, _LANE, _LANE, _LANE])
        prefetch = get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")  # type: ignore[no-untyped-call]
        builder.call(prefetch, [builder.bitcast(place, byte), _LANE(0), _LANE(3), _LANE(1)])  # read, keep, data
        return context.get_dummy_value()

    return signature, generate


@_intrinsic
def give_and_take(typing: Any, force: Any, i: Any, j: Any, push: Any, apart: Any, c: Any) -> Any:
    """Add ``push`` times the way ``apart[c, :3]`` to row ``i`` of the forces, and take it from row ``j``.

    Rows count through all layers of the forces; they have :data:`FORCE` columns.
    """
    if not (_rows(force) and _rows(apart)):
        return None
    signature = types.void(force, types.uint64, types.uint64, types.float64, apart, types.uint64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def row(k: int, number: Any, columns: int) -> Any:
            return _place(context, builder, signature, arguments, k, builder.mul(number, _INDEX(columns)))

        given = builder.fmul(_load(builder, row(4, arguments[5], VECTOR), FORCE), _three(builder, arguments[3]))
        for sphere, change in ((arguments[1], builder.fadd), (arguments[2], builder.fsub)):
            place = row(0, sphere, FORCE)
            _store(builder, change(_load(builder, place, FORCE), given), place)
        return context.get_dummy_value()

    return signature, generate


@_intrinsic
def lanes_in_reach(
    typing: Any,
    columns: Any,
    row: Any,
    begin: Any,
    end: Any,
    x: Any,
    y: Any,
    z: Any,
    reach: Any,
    course: Any,
    horizon: Any,
) -> Any:
    """Find which of eight spheres may come within reach of a point: a bit for each, none beyond ``end``.

    ``columns`` (6, n + 8) are the centres, the courses and, in the ``row`` to be used, the reaches of the spheres; a
    reach that is no number never reaches. Both move by their course, along z, for up to ``horizon`` steps.
    """
    if not _rows(columns):
        return None
    number, index = types.float64, types.uint64
    signature = index(columns, index, index, index, number, number, number, number, number, number)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        columns, row, begin, end, *point = arguments
        x, y, z, reach, course, horizon = (_splat(builder, number) for number in point)
        array = context.make_array(signature.args[0])(context, builder, columns)
        length = builder.extract_value(array.shape, 1)

        def spheres(row: Any) -> Any:
            at = builder.add(builder.mul(row, length), begin)
            return _load(builder, builder.gep(array.data, [at]), VECTOR)

        kind, whole = ir.VectorType(_NUMBER, VECTOR), ir.VectorType(_INDEX, VECTOR)
        unsigned = ir.Constant(whole, [_INDEX(2**63 - 1)] * VECTOR)
        apart = [builder.fsub(of, spheres(_INDEX(k))) for k, of in enumerate((x, y, z))]
        drift = builder.bitcast(builder.fsub(course, spheres(_INDEX(3))), whole)
        drift = builder.bitcast(builder.and_(drift, unsigned), kind)
        touching = builder.fadd(builder.fadd(reach, spheres(row)), builder.fmul(horizon, drift))
        square = ir.Constant(kind, [_NUMBER(0.0)] * VECTOR)
        for way in apart:
            square = builder.fadd(square, builder.fmul(way, way, flags=("contract",)), flags=("contract",))
        near = builder.fcmp_ordered("<", square, builder.fmul(touching, touching))
        bits = builder.zext(builder.bitcast(near, ir.IntType(VECTOR)), _INDEX)
        left = builder.sub(end, begin)
        left = builder.select(builder.icmp_unsigned("<", left, _INDEX(VECTOR)), left, _INDEX(VECTOR))
        return builder.and_(bits, builder.sub(builder.shl(_INDEX(1), left), _INDEX(1)))

    return signature, generate


@_intrinsic
def lowest_bit(typing: Any, bits: Any) -> Any:
    """Place of the lowest bit that is set; there must be one."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.cttz(arguments[0], ir.IntType(1)(1))

    return types.uint64(types.uint64), generate
