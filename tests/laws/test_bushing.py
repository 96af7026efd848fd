from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsf_drake.laws import bushing

AXIS = {
    "stiffness": 1e5,
    "stiffness_negative": 1.5e4,
    "damping": 1e3,
    "limit": 0.015,
    "rate_limit": 0.5,
    "stop_ratio": 10.0,
}


def axis_force(displacement, rate, **axis):
    return bushing.axis_force(displacement, rate, **axis)[0]


def test_inside_the_limits_it_is_a_spring_and_damper_and_softer_when_pulled():
    assert axis_force(0.01, -0.2, **AXIS) == pytest.approx(-1e5 * 0.01 + 1e3 * 0.2)
    assert axis_force(-0.006, 0.0, **AXIS) == pytest.approx(90.0)


def test_beyond_a_limit_stiffness_and_damping_are_eleven_times_as_large():
    for side in (1.0, -1.0):
        force = axis_force(side * np.array([0.02, 0.021]), 0.0, **AXIS)
        assert force[1] - force[0] == pytest.approx(
            -11.0 * (1e5 if side > 0.0 else -1.5e4) * 1e-3, rel=1e-8
        )
        force = axis_force(0.0, side * np.array([0.7, 0.8]), **AXIS)
        assert force[1] - force[0] == pytest.approx(-side * 11e3 * 0.1, rel=1e-8)


def test_continuous_at_the_limits_and_at_zero():
    for q in (-0.015, 0.0, 0.015):
        below, above = axis_force(np.array([q - 1e-12, q + 1e-12]), 0.0, **AXIS)
        assert below == pytest.approx(above, abs=1e-5)
    for v in (-0.5, 0.5):
        below, above = axis_force(0.0, np.array([v - 1e-12, v + 1e-12]), **AXIS)
        assert below == pytest.approx(above, abs=1e-6)


def test_gradients_equal_finite_differences_and_are_finite_at_the_kinks(
    assert_gradient, autodiff_gradient
):
    for q in (-0.03, -0.01, 0.01, 0.03):
        for v in (-0.8, -0.1, 0.1, 0.8):
            assert_gradient(
                lambda x: axis_force(*x[:2], **dict(zip(AXIS, x[2:], strict=True))),
                [q, v, *AXIS.values()],
            )
    for q in (-0.015, 0.0, 0.015):
        assert np.all(
            np.isfinite(autodiff_gradient(lambda x: axis_force(x[0], x[1], **AXIS), [q, 0.5]))
        )


@given(q=st.floats(-0.03, 0.03), v=st.floats(-1.0, 1.0))
def test_its_derivatives_are_those_of_the_force_and_at_a_corner_of_one_side(q, v):
    _, by_q, by_v = bushing.axis_force(q, v, **AXIS)
    for slope, q_step, v_step in ((by_q, 1e-7, 0.0), (by_v, 0.0, 1e-6)):
        step = q_step + v_step
        low, mid, high = (
            axis_force(q + side * q_step, v + side * v_step, **AXIS) for side in (-1.0, 0.0, 1.0)
        )
        bend = abs(high - 2.0 * mid + low) / step
        assert slope == pytest.approx((high - low) / (2.0 * step), rel=1e-6, abs=0.51 * bend)
