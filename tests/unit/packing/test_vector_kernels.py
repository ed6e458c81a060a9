"""Rows of eight numbers at once: what the intrinsics do, against numpy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from numba.core.errors import TypingError

from filtercake.packing.engines import pair_kernels, vector_kernels
from filtercake.packing.engines.vector_kernels import CHUNK, FORCE, INDEX_MASK, VECTOR

SPHERES = 40


@njit
def gathered(state, owner, neighbour, shift, begin, end, c):
    apart, rows = np.zeros((CHUNK, VECTOR)), np.zeros(CHUNK * VECTOR)
    vector_kernels.gather_pairs(state, owner, neighbour, shift, begin, end, apart, rows, c)
    return apart, rows


@njit
def given_and_taken(force, i, j, push, apart, c):
    vector_kernels.give_and_take(force, i, j, push, apart, c)


@njit
def in_reach(columns, row, begin, end, point, reach, course, horizon):
    return vector_kernels.lanes_in_reach(columns, row, begin, end, point[0], point[1], point[2], reach, course, horizon)


@njit
def bits_of(bits):
    found = []
    while bits:
        found.append(vector_kernels.lowest_bit(bits))
        bits &= bits - np.uint64(1)
    return found


@njit
def fetched(array, row):
    vector_kernels.fetch_row(array, row, np.uint64(VECTOR))
    return array.sum()


@settings(max_examples=50, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1), begin=st.integers(0, 20), pairs=st.integers(1, 20), c=st.sampled_from([0, 8, 56])
)
def test_differences_are_gathered_to_the_last_bit(seed, begin, pairs, c):
    rng = np.random.default_rng(seed)
    state = rng.normal(size=(SPHERES, VECTOR))
    owner = rng.integers(0, SPHERES, begin + pairs).astype(np.uint32)
    other, code = rng.integers(0, SPHERES, begin + pairs), rng.integers(0, 9, begin + pairs)
    neighbour = (other | code << vector_kernels.IMAGE_SHIFT).astype(np.uint32)
    shift = pair_kernels._image_shifts(3.0)
    apart, rows = gathered(state, owner, neighbour, shift, begin, begin + pairs, c)
    pair = np.minimum(begin + np.arange(VECTOR), begin + pairs - 1)  # none beyond the end
    i, j = owner[pair], other[pair]
    expected = state[i] - state[j] - shift[code[pair]]
    expected[:, 7] = state[i, 3] + state[j, 3]
    assert np.array_equal(apart[c : c + VECTOR], expected)
    assert np.array_equal(rows.reshape(VECTOR, CHUNK)[:, c : c + VECTOR], expected.T)
    apart[c : c + VECTOR], rows.reshape(VECTOR, CHUNK)[:, c : c + VECTOR] = 0.0, 0.0
    assert not apart.any() and not rows.any()  # nothing else was written


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), i=st.integers(0, 5), j=st.integers(0, 11))
def test_what_one_sphere_is_given_is_taken_from_the_other(seed, i, j):
    rng = np.random.default_rng(seed)
    force = rng.normal(size=(2, 6, FORCE))  # the rows of two layers
    force[..., 3] = 0.0
    apart, push = rng.normal(size=(CHUNK, VECTOR)), rng.normal()
    expected = force.copy().reshape(-1, FORCE)
    expected[i, :3] += push * apart[7, :3]
    expected[j, :3] -= push * apart[7, :3]
    given_and_taken(force, i, j, push, apart, 7)
    assert np.array_equal(force.reshape(-1, FORCE), expected)


@settings(max_examples=100, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    begin=st.integers(0, 20),
    count=st.integers(1, 20),
    row=st.sampled_from([4, 5]),
    horizon=st.sampled_from([0.0, 200.0]),
)
def test_those_in_reach_are_those_that_may_touch_while_both_move(seed, begin, count, row, horizon):
    rng = np.random.default_rng(seed)
    columns = rng.uniform(0.0, 1.0, size=(6, 40 + VECTOR))
    columns[3] *= 1e-3
    columns[5, rng.random(columns.shape[1]) < 0.3] = np.nan
    point, reach, course = rng.uniform(0.0, 1.0, 3), 0.1, 5e-4
    found = int(in_reach(columns, row, begin, begin + count, point, reach, course, horizon))
    distance = np.sqrt(((columns[:3].T - point) ** 2).sum(axis=1))
    near = distance < reach + columns[row] + horizon * abs(course - columns[3])
    expected = [lane for lane in range(min(VECTOR, count)) if near[begin + lane]]
    assert [int(lane) for lane in bits_of(np.uint64(found))] == expected if found else not expected


@pytest.mark.parametrize("bits", [1, 0b10110, 1 << 63 | 1])
def test_the_lowest_bits_are_those_that_are_set(bits):
    assert [int(place) for place in bits_of(np.uint64(bits))] == [k for k in range(64) if bits >> k & 1]


def test_fetching_a_row_changes_nothing_even_beyond_the_array():
    array = np.ones((4, VECTOR))
    assert fetched(array, np.uint64(2)) == array.size
    assert fetched(array, np.uint64(INDEX_MASK)) == array.size
    assert (array == 1.0).all()


@pytest.mark.parametrize("size", [1, 8, 513])
def test_room_begins_with_a_line_of_memory(size):
    for make in (vector_kernels.aligned, njit(lambda count: vector_kernels.aligned(count))):
        room = make(size)
        assert room.shape == (size,) and not room.any()
        assert room.ctypes.data % 64 == 0


def test_rows_that_do_not_lie_one_behind_the_other_are_refused():
    apart = np.zeros((CHUNK, VECTOR))
    with pytest.raises(TypingError):
        given_and_taken(np.zeros((8, FORCE), order="F"), 0, 1, 1.0, apart, 0)
    with pytest.raises(TypingError):
        given_and_taken(np.zeros((8, FORCE), dtype=np.float32), 0, 1, 1.0, apart, 0)
