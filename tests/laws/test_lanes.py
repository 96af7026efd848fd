"""Numbers of eight walks are to the bit what they are of each walk alone, and numpy's where numpy
has them."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
import pytest
from laned import lanes

from vsf_drake.laws.compiled import compiled
from vsf_drake.laws.lanes import (
    WIDTH,
    every,
    first,
    negated,
    power,
    select,
    sine_cosine,
    some,
)

SPECIAL = (0.0, -0.0, 1.0, -1.0, np.nan, np.inf, -np.inf, 5e-324, 1e-310, 1e308, -2.5, 1.0 / 3.0)


def assert_bits_equal(found, wanted):
    """Every number and the sign of every zero; a NaN is as good as another."""
    found, wanted = np.broadcast_arrays(np.asarray(found), np.asarray(wanted))
    numbers = ~np.isnan(wanted)
    np.testing.assert_array_equal(np.isnan(found), ~numbers)
    np.testing.assert_array_equal(
        found[numbers].view(np.uint64), wanted[numbers].copy().view(np.uint64)
    )


def together(function, *columns):
    """What `function` of one walk's arrays and an array of results writes, of WIDTH walks in lanes
    and of each alone; columns (n, walks) are taken WIDTH by WIDTH."""
    in_lanes, alone = [], []
    for k in range(0, columns[0].shape[-1], WIDTH):
        parts = [np.ascontiguousarray(column[..., k : k + WIDTH]) for column in columns]
        out = np.full((RESULTS, WIDTH), -7.0)
        function.lanes(*parts, out)
        in_lanes.append(out)
        for walk in range(WIDTH):
            single = np.full(RESULTS, -7.0)
            function.alone(*(np.ascontiguousarray(part[..., walk]) for part in parts), single)
            alone.append(single)
    return np.concatenate(in_lanes, axis=1), np.stack(alone, axis=1)


RESULTS = 24


class Both(NamedTuple):
    """One function of arrays of numbers, compiled for one walk and for WIDTH."""

    alone: object
    lanes: object


def both_of(function, count):
    """Of `count` arrays beside the results."""
    alone = compiled(function)
    if count == 1:
        return Both(alone, compiled(lambda x, out: alone(lanes(x), lanes(out))))
    return Both(alone, compiled(lambda x, y, out: alone(lanes(x), lanes(y), lanes(out))))


def _operations(x, y, out):
    a = x[0]
    b = y[0]
    out[0] = a + b
    out[1] = a - b
    out[2] = a * b
    out[3] = a / b
    out[4] = -a
    out[5] = math.sqrt(a)
    out[6] = math.fabs(a)
    out[7] = abs(b)
    out[8] = math.copysign(a, b)
    out[9] = a * b + a
    out[10] = 2.0 - a
    out[11] = a / 3
    out[12] = b
    out[12] += a
    out[12] -= 0.5
    out[12] *= b
    out[12] /= a


def _choices(x, y, out):
    a = x[0]
    b = y[0]
    out[0] = select(a < b, a, b)
    out[1] = select(a <= b, 1.0, 0.0)
    out[2] = select(a > b, a, 0.0)
    out[3] = select(a >= b, 1.0, b)
    out[4] = select((a < b) & (b > 0.0), 1.0, 0.0)
    out[5] = select((a < b) | (b > 0.0), 1.0, 0.0)
    out[6] = select(negated(a < b), a, b)
    out[7] = select(a < 1, 2, 3)
    held = a < b
    held &= b < 1.0
    held |= a > 2.0
    out[8] = select(held, 1.0, 0.0)


def _powers(x, y, out):
    out[0] = power(x[0], y[0])


def _angles(x, out):
    sine, cosine = sine_cosine(x[0])
    out[0] = sine
    out[1] = cosine


@pytest.fixture(scope="module")
def operations():
    return both_of(_operations, 2)


@pytest.fixture(scope="module")
def choices():
    return both_of(_choices, 2)


@pytest.fixture(scope="module")
def powers():
    return both_of(_powers, 2)


@pytest.fixture(scope="module")
def angles():
    return both_of(_angles, 1)


def pairs(seed):
    """x, y (1, n): all pairs of special numbers, and some of every size."""
    rng = np.random.default_rng(seed)
    special = np.array(list(itertools.product(SPECIAL, SPECIAL))).T
    drawn = rng.normal(size=(2, 400)) * 10.0 ** rng.uniform(-12.0, 12.0, (2, 400))
    return np.hstack([special, drawn])[:, None]


@np.errstate(all="ignore")
def test_arithmetic_is_numpys_in_every_lane_and_nothing_is_contracted(operations):
    x, y = pairs(0)
    found, alone = together(operations, x, y)
    a, b = x[0], y[0]
    wanted = np.array(
        [
            a + b,
            a - b,
            a * b,
            a / b,
            -a,
            np.sqrt(a),
            np.abs(a),
            np.abs(b),
            np.copysign(a, b),
            a * b + a,
            2.0 - a,
            a / 3.0,
            ((b + a) - 0.5) * b / a,
        ]
    )
    for results in (found, alone):
        assert_bits_equal(results[: len(wanted)], wanted)
        assert np.all(results[len(wanted) :] == -7.0)


def test_choices_are_numpys_in_every_lane_also_where_nothing_compares(choices):
    x, y = pairs(1)
    found, alone = together(choices, x, y)
    a, b = x[0], y[0]
    wanted = np.array(
        [
            np.where(a < b, a, b),
            a <= b,
            np.where(a > b, a, 0.0),
            np.where(a >= b, 1.0, b),
            (a < b) & (b > 0.0),
            (a < b) | (b > 0.0),
            np.where(a < b, b, a),
            np.where(a < 1.0, 2.0, 3.0),
            ((a < b) & (b < 1.0)) | (a > 2.0),
        ]
    )
    for results in (found, alone):
        assert_bits_equal(results[: len(wanted)], wanted)


@pytest.mark.parametrize("exponents", ["all 1", "one not 1", "any"])
def test_power_is_that_of_one_walk(powers, exponents):
    rng = np.random.default_rng(2)
    n = 80 * WIDTH
    x = np.abs(np.concatenate([np.resize(SPECIAL, n // 2), 10.0 ** rng.uniform(-12, 6, n // 2)]))
    y = np.ones(n)
    if exponents == "one not 1":
        y[3::WIDTH] = rng.uniform(0.5, 3.0, n // WIDTH)
    if exponents == "any":
        y = np.where(rng.random(n) < 0.5, rng.choice(SPECIAL, n), rng.uniform(-3.0, 8.0, n))
    found, alone = together(powers, x[None], y[None])
    assert_bits_equal(found, alone)
    assert_bits_equal(found[0][y == 1.0], x[y == 1.0])
    with np.errstate(all="ignore"):
        wanted = x**y
    usual = np.isfinite(wanted) & np.isfinite(x) & np.isfinite(y)
    assert usual.sum() > n // 4
    np.testing.assert_allclose(found[0][usual], wanted[usual], rtol=1e-14)


def test_sine_and_cosine_are_right_to_the_last_digits_of_1_up_to_a_million_radians(angles):
    """Also next to multiples of pi / 2, where one of them vanishes."""
    rng = np.random.default_rng(3)
    near = rng.integers(-636_000, 636_000, 4000) * (0.5 * np.pi)
    x = np.concatenate(
        [
            np.linspace(-10.0, 10.0, 4000),
            near,
            np.nextafter(near, np.inf),
            near + rng.uniform(-1e-6, 1e-6, 4000),
            rng.uniform(-1e6, 1e6, 4000),
            10.0 ** rng.uniform(-300.0, 0.0, 4000),
        ]
    )
    found, alone = together(angles, x[None])
    assert_bits_equal(found, alone)
    wanted = np.array([[math.sin(a) for a in x], [math.cos(a) for a in x]])
    assert np.abs(found[:2] - wanted).max() <= 2.0 * np.spacing(1.0)
    small = np.abs(x) < 1e-3
    np.testing.assert_allclose(found[0, small], wanted[0, small], rtol=2.0 * np.spacing(1.0))


def test_angle_that_is_no_number_spoils_no_other_lane(angles):
    x = np.array([0.3, np.nan, np.inf, -np.inf, 1e300, -2.0, -0.0, 4.0])
    found, alone = together(angles, x[None])
    assert_bits_equal(found, alone)
    assert np.isnan(found[:2, 1:4]).all()
    usual = np.array([0, 5, 6, 7])
    np.testing.assert_allclose(
        found[:2, usual], [np.sin(x[usual]), np.cos(x[usual])], atol=2.0 * np.spacing(1.0)
    )


@compiled
def _asked(x, out, answers):
    where = lanes(x)[0] > 0.0
    answers[0] = some(where)
    answers[1] = every(where)
    lanes(out)[0] = select(first(where), 1.0, 0.0)
    lanes(out)[1] = select(negated(first(where)), 1.0, 0.0)


def test_some_every_and_first_of_all_masks():
    for bits in itertools.product((False, True), repeat=WIDTH):
        out, answers = np.zeros((2, WIDTH)), np.zeros(2, dtype=bool)
        _asked(np.where(bits, 1.0, -1.0)[None], out, answers)
        assert answers.tolist() == [any(bits), all(bits)]
        only = np.arange(WIDTH) == (bits.index(True) if any(bits) else -1)
        np.testing.assert_array_equal(out, [only, ~only])


@compiled
def _asked_alone(x, out):
    where = x > 0.0
    out[0] = some(where)
    out[1] = every(where)
    out[2] = first(where)
    out[3] = negated(where)


@pytest.mark.parametrize(("x", "holds"), [(1.0, True), (-1.0, False), (np.nan, False)])
def test_of_one_walk_some_every_and_first_are_what_is_asked(x, holds):
    out = np.zeros(4, dtype=bool)
    _asked_alone(x, out)
    assert out.tolist() == [holds, holds, holds, not holds]
    assert [some(holds), every(holds), first(holds), negated(holds)] == out.tolist()
    assert select(holds, 2.0, 3.0) == (2.0 if holds else 3.0)


@compiled
def _half(x):
    return 0.5 * x


@compiled
def _unified(x, flag, out):
    total = 0.0
    for i in range(x.shape[0]):
        total = total + x[i]
    where = True
    if flag:
        total = 2
    else:
        where = total < 1.0
    out[0] = total
    out[1] = 3
    out[2] = select(where, _half(total), 1.0)
    out[3] = 1.5
    out[4] = max(1.0, 2.0) + _half(7)


@compiled
def _unified_lanes(x, flag, out):
    _unified(lanes(x), flag, lanes(out))


@pytest.mark.parametrize("flag", [False, True])
def test_a_number_may_stand_for_one_of_each_walk(flag):
    """Where a variable is a number on one way and eight on another, in arrays and as an
    argument."""
    x = np.random.default_rng(5).uniform(-1.0, 1.0, (4, WIDTH))
    out = np.zeros((5, WIDTH))
    _unified_lanes(x, flag, out)
    total = np.full(WIDTH, 2.0) if flag else ((x[0] + x[1]) + x[2]) + x[3]
    half = 0.5 * total if flag else np.where(total < 1.0, 0.5 * total, 1.0)
    wanted = [total, np.full(WIDTH, 3.0), half, np.full(WIDTH, 1.5), np.full(WIDTH, 5.5)]
    assert_bits_equal(out, np.array(wanted))
    for walk in range(WIDTH):
        single = np.zeros(5)
        _unified(x[:, walk].copy(), flag, single)
        assert_bits_equal(single, out[:, walk])
