"""Every law of the table: its derivatives are those of its force, and it is one function for
floats, arrays, AutoDiffXd and compiled code, of one walk and of eight."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from laned import lanes
from pydrake.autodiffutils import AutoDiffXd

from vsf_drake.laws import contact
from vsf_drake.laws.compiled import compiled
from vsf_drake.laws.contact import FIRST_COLUMN, LAWS
from vsf_drake.laws.contact_law import LAW_COLUMNS, LawConstants, constants_of
from vsf_drake.laws.contact_laws import CONTACT_LAWS
from vsf_drake.laws.lanes import WIDTH

EACH = pytest.mark.parametrize("law", range(len(LAWS)), ids=tuple(CONTACT_LAWS))
CONSTANTS = [3e4, 1.5, 300.0, 1e-3, 0.5, 0.3, 0.1, 0.8, 5e-4, 0.02]
FRICTION = ("mu_static", "mu_kinetic", "threshold_velocity")

SITES = st.builds(
    lambda **each: np.array([[0.0] * FIRST_COLUMN + [each[name] for name in LAW_COLUMNS]]),
    stiffness=st.floats(1e3, 1e6),
    exponent=st.one_of(st.just(1.0), st.floats(1.0, 4.0)),
    damping=st.floats(10.0, 1e4),
    full_damping_depth=st.floats(3e-4, 1e-2),
    mu_static=st.floats(0.1, 1.0),
    mu_kinetic=st.floats(0.1, 1.0),
    threshold_velocity=st.floats(0.01, 1.0),
    dissipation=st.floats(0.1, 3.0),
    depth_width=st.floats(1e-4, 2e-3),
    rate_width=st.floats(0.005, 0.1),
)
DEPTHS = st.floats(-3e-3, 8e-3)
RATES = st.floats(-0.5, 0.5)
SPEEDS = st.floats(0.0, 3.0)  # over the threshold


def around(function, x, step):
    """Central difference, and by how much the two one-sided ones differ: small but at a corner."""
    low, mid, high = (function(x + d) for d in (-step, 0.0, step))
    return (high - low) / (2.0 * step), abs((high - 2.0 * mid + low) / step)


def assert_slope(slope, function, x, step, scale):
    """Where the difference is taken over a corner, the slope is between those of both sides."""
    central, bend = around(function, x, step)
    assert slope == pytest.approx(central, rel=1e-6, abs=0.51 * bend + 1e-6 * scale)


def shifted(sites, column, value):
    other = sites.copy()
    other[0, column] = value
    return other


@EACH
@settings(max_examples=200, deadline=None)
@given(sites=SITES, depth=DEPTHS, rate=RATES)
def test_derivatives_of_the_normal_force(law, sites, depth, rate):
    def force(depth=depth, rate=rate, sites=sites):
        return contact.normal_force(law, depth, rate, sites, 0)[0]

    normal, by_depth, by_rate = contact.normal_force(law, depth, rate, sites, 0)
    assert normal >= 0.0
    stiffness, exponent, damping = sites[0, FIRST_COLUMN : FIRST_COLUMN + 3]
    scale = stiffness * exponent * 1e-2 ** (exponent - 1.0) + damping / 3e-4
    assert_slope(by_depth, force, depth, 1e-8, scale)
    assert_slope(by_rate, lambda x: force(rate=x), rate, 1e-7, damping + stiffness * 0.03)
    for column, name in enumerate(LAW_COLUMNS, start=FIRST_COLUMN):
        value = sites[0, column]
        slope = contact.normal_by_constant(law, column, depth, rate, sites, 0)
        if name not in LAWS[law].constants:
            assert slope == 0.0
            assert force(sites=shifted(sites, column, 1.5 * value)) == normal
            continue
        assert_slope(
            slope,
            lambda x, column=column: force(sites=shifted(sites, column, x)),
            value,
            1e-5 * value,
            1e-4 * (normal + damping * 0.5) / value,
        )


@EACH
@settings(max_examples=200, deadline=None)
@given(sites=SITES, share=SPEEDS)
def test_derivatives_of_the_friction(law, sites, share):
    threshold = sites[0, FIRST_COLUMN + LAW_COLUMNS.index("threshold_velocity")]
    speed = share * threshold

    def ratio(speed=speed, sites=sites):
        return contact.friction_per_speed(law, speed, sites, 0)[0]

    _, slope = contact.friction_per_speed(law, speed, sites, 0)
    step = 1e-6 * threshold
    assert_slope(slope, lambda v: ratio(v) * v, speed, step, 10.0 / threshold)
    for column, name in enumerate(LAW_COLUMNS, start=FIRST_COLUMN):
        value = sites[0, column]
        slope = contact.friction_by_constant(law, column, speed, sites, 0)
        if name not in FRICTION:
            assert slope == 0.0
            continue
        assert_slope(
            slope,
            lambda x, column=column: ratio(sites=shifted(sites, column, x)),
            value,
            1e-6 * value,
            10.0 / threshold / value,
        )


@compiled
def _columns(law, given, sites, out):
    """All that the table has of one site, depths, rates and speeds in the rows of `given`."""
    fill(law, given, sites, out)


@compiled
def _columns_of_lanes(law, given, sites, out):
    fill(law, lanes(given), lanes(sites), lanes(out))


@contact.generic
def fill(law, given, sites, out):
    out[0], out[1], out[2] = contact.normal_force(law, given[0], given[1], sites, 0)
    out[3], out[4] = contact.friction_per_speed(law, given[2], sites, 0)
    for column in range(4, 14):
        out[1 + column] = contact.normal_by_constant(law, column, given[0], given[1], sites, 0)
        out[11 + column] = contact.friction_by_constant(law, column, given[2], sites, 0)


@EACH
def test_one_function_for_floats_arrays_lanes_and_compiled_code(law):
    rng = np.random.default_rng(law)
    count = 64 * WIDTH
    given = np.stack(
        [
            rng.uniform(-2e-3, 6e-3, count),
            rng.uniform(-0.4, 0.4, count),
            rng.uniform(0.0, 0.4, count),
        ]
    )
    given[:, :8] = 0.0
    sites = np.ones((1, 14, count)) * np.array([0.0] * FIRST_COLUMN + CONSTANTS)[:, None]
    sites[0, 5, ::3] = 1.0
    sites[0, 10] = 0.1
    arrays = np.zeros((25, count))
    fill(law, given, sites, arrays)
    assert np.isfinite(arrays).all()
    for walk in range(count):
        alone = np.zeros((2, 25))
        fill(law, *(np.ascontiguousarray(x[..., walk]) for x in (given, sites)), alone[0])
        _columns(law, *(np.ascontiguousarray(x[..., walk]) for x in (given, sites)), alone[1])
        np.testing.assert_allclose(alone[0], arrays[:, walk], rtol=1e-14, atol=1e-300)
        np.testing.assert_allclose(alone[1], arrays[:, walk], rtol=1e-13, atol=1e-300)
        if walk % WIDTH == 0:
            block = slice(walk, walk + WIDTH)
            together = np.zeros((25, WIDTH))
            _columns_of_lanes(
                law, *(np.ascontiguousarray(x[..., block]) for x in (given, sites)), together
            )
        np.testing.assert_array_equal(together[:, walk % WIDTH], alone[1])


@EACH
def test_slow_foam_bears_what_the_testing_machine_takes_it_for(law):
    """Stiffness · depthⁿ, once a rounded corner is behind: a bench is the same under every law."""
    depths = np.linspace(1e-3, 8e-3, 8)
    site = LawConstants(*CONSTANTS)
    elastic, _ = LAWS[law].strain(depths, site)
    np.testing.assert_allclose(elastic, site.stiffness * depths**site.exponent, rtol=1e-12)
    slow, _, _ = LAWS[law].force(depths, -1e-6 + 0.0 * depths, site)
    np.testing.assert_allclose(slow, elastic, rtol=1e-5, atol=0.2 * site.damping * site.rate_width)


@EACH
def test_gradients_of_autodiff_are_the_laws_own_derivatives(law):
    for depth, rate, speed in (
        (2e-3, 0.1, 0.02),
        (2e-4, -0.005, 0.12),
        (1e-4, 0.01, 0.5),
        (-2e-4, 0.3, 0.0),
        (0.0, 0.0, 0.1),
    ):
        unit = np.eye(13)
        depth_ad, rate_ad, speed_ad, *own = map(AutoDiffXd, [depth, rate, speed, *CONSTANTS], unit)
        sites = np.array([[0.0] * FIRST_COLUMN + own], dtype=object)
        plain = np.array([[0.0] * FIRST_COLUMN + CONSTANTS])
        of_normal = partial(contact.normal_by_constant, law)
        of_friction = partial(contact.friction_by_constant, law)
        expected = np.zeros((2, 13))
        _, expected[0, 0], expected[0, 1] = contact.normal_force(law, depth, rate, plain, 0)
        for i in range(len(LAW_COLUMNS)):
            expected[0, 3 + i] = of_normal(FIRST_COLUMN + i, depth, rate, plain, 0)
            expected[1, 3 + i] = of_friction(FIRST_COLUMN + i, speed, plain, 0)
        ratio, slope = contact.friction_per_speed(law, speed, plain, 0)
        normal_ad = contact.normal_force(law, depth_ad, rate_ad, sites, 0)[0]
        ratio_ad = contact.friction_per_speed(law, speed_ad, sites, 0)[0]
        got = [x.derivatives() if isinstance(x, AutoDiffXd) else 0.0 for x in (normal_ad, ratio_ad)]
        np.testing.assert_allclose(got[0], expected[0], rtol=1e-12, atol=1e-12)
        if speed > 0.0:
            expected[1, 2] = (slope - ratio) / speed
        np.testing.assert_allclose(got[1], expected[1], rtol=1e-12, atol=1e-9)


def test_columns_are_the_constants_by_name():
    rows = np.arange(20.0).reshape(2, 10)
    assert constants_of(rows)._fields == LAW_COLUMNS
    for s in (0, 1):
        sites = np.hstack([np.zeros((2, FIRST_COLUMN)), rows])
        assert contact.law_constants(sites, s) == LawConstants(*rows[s])
    assert {name for law in LAWS for name in law.constants} | set(FRICTION) == set(LAW_COLUMNS)
