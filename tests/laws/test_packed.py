"""Compiled code reads and writes the arrays of a packed tuple where they are."""

from __future__ import annotations

import copy
import pickle
from typing import NamedTuple

import numba
import numpy as np
import pytest

from vsf_drake.laws.compiled import compiled
from vsf_drake.laws.lanes import SHARED, WIDTH
from vsf_drake.laws.packed import call, code_of, packed

COMPILED_ONLY = pytest.mark.skipif(
    numba.config.DISABLE_JIT, reason="in Python a lane is a row of numbers"
)


class Inner(NamedTuple):
    """Held by `Outer`."""

    matrix: np.ndarray
    numbers: np.ndarray  # whole ones
    gravity: np.ndarray  # one of SHARED


class Outer(NamedTuple):
    """What compiled code looks through."""

    inner: Inner
    vector: np.ndarray
    flags: np.ndarray
    factor: float
    offset: int
    wanted: bool


@compiled
def _changed(outer):
    inner = outer.inner
    for i in range(inner.matrix.shape[0]):
        row = inner.matrix[i]
        for j in range(inner.matrix.shape[1]):
            if outer.flags[j] and outer.wanted:
                row[j] = row[j] * outer.factor + (
                    inner.gravity[j] * outer.vector[inner.numbers[i] + outer.offset]
                )
    outer.vector[-1] = inner.matrix[-1, 0]


def tuple_and_result(rng, *walks):
    """A tuple, and what its matrix and vector are when `_changed` has gone over it."""
    matrix, vector = (rng.normal(size=(*n, *walks)) for n in ((3, 2), (5,)))
    numbers, gravity = np.array([3, 0, 2]), rng.normal(size=2)
    wanted = matrix.copy()
    wanted[:, 1] = matrix[:, 1] * 2.5 + gravity[1] * vector[numbers + 1]
    inner = Inner(matrix, numbers, gravity)
    outer = Outer(inner, vector, np.array([False, True]), 2.5, 1, True)
    return outer, wanted, np.concatenate([vector[:-1], wanted[-1:, 0]])


def test_what_compiled_code_writes_is_in_the_arrays():
    outer, matrix, vector = tuple_and_result(np.random.default_rng(3))
    _changed(packed(outer))
    np.testing.assert_array_equal(outer.inner.matrix, matrix)
    np.testing.assert_array_equal(outer.vector, vector)


@COMPILED_ONLY
def test_of_walks_the_last_axis_is_the_walks():
    """Also of what inner tuples hold; whole numbers, truth values, single numbers and what walks
    share stay what they are."""
    assert "gravity" in SHARED
    outer, matrix, vector = tuple_and_result(np.random.default_rng(4), WIDTH)
    _changed(packed(outer, walks=True))
    np.testing.assert_array_equal(outer.inner.matrix, matrix)
    np.testing.assert_array_equal(outer.vector, vector)


@COMPILED_ONLY
def test_an_array_with_gaps_is_refused():
    outer, _, _ = tuple_and_result(np.random.default_rng(5))
    with pytest.raises(TypeError, match="vector is not contiguous"):
        packed(outer._replace(vector=np.zeros(10)[::2]))


@COMPILED_ONLY
def test_an_array_that_is_not_of_all_walks_is_refused():
    """Compiled code would read on beyond its end."""
    outer, _, _ = tuple_and_result(np.random.default_rng(5), WIDTH)
    with pytest.raises(TypeError, match=f"last axis of vector is 5, not {WIDTH} walks"):
        packed(outer._replace(vector=np.zeros(5)), walks=True)


class Pair(NamedTuple):
    """Numbers of any kind."""

    x: float
    n: int


@compiled
def _read(pair, result):
    result[0] = pair.x
    result[1] = pair.n


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_numbers_of_few_bits_are_read_as_what_they_are(kind):
    result = np.zeros(2)
    _read(packed(Pair(kind(-1.5), np.int32(-3))), result)
    np.testing.assert_array_equal(result, [-1.5, -3.0])


@COMPILED_ONLY
@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_copy_that_would_hold_addresses_of_others_arrays_is_refused(copied):
    with pytest.raises(TypeError, match="address"):
        copied(packed(Pair(1.5, 2)))


@COMPILED_ONLY
def test_tuples_of_one_class_with_other_members_have_types_of_other_names():
    """By it the linker finds machine code on disk: of one name it would take that of the other."""
    names = {
        numba.typeof(packed(pair)).name
        for pair in (Pair(1.5, 2), Pair(2.5, 3), Pair(1, 2), Pair(np.zeros(1), 2))
    }
    assert len(names) == 3


class Calling(NamedTuple):
    """A function and what it takes, as addresses."""

    code: int
    given: object


@compiled
def _call_it(calling):
    call(calling.code, (calling.given,))


def test_compiled_code_calls_what_is_at_an_address():
    outer, matrix, _ = tuple_and_result(np.random.default_rng(6))
    given = packed(outer)
    _call_it(packed(Calling(code_of(_changed, given), given)))
    np.testing.assert_array_equal(outer.inner.matrix, matrix)


@compiled
def _refuse(pair):
    if pair.n < 0:
        raise ValueError("a negative number")


def test_what_is_raised_at_an_address_goes_on():
    given = packed(Pair(1.5, -2))
    with pytest.raises(ValueError, match="a negative number"):
        _call_it(packed(Calling(code_of(_refuse, given), given)))
