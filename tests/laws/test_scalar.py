"""The compiled scalar forces are the laws, and their derivatives those of the laws."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.laws import kelvin_voigt
from vsf_drake.laws.bushing import axis_force
from vsf_drake.laws.scalar import friction_per_speed, normal_force, spring_force
from vsf_drake.laws.stick_slip import friction_coefficient

COUNT = 400


def slopes(function, x, step):
    """Central difference of a scalar function of the vector x, by each of its first two entries."""
    e = np.eye(len(x))
    return [
        (function(*(x + step[i] * e[i])) - function(*(x - step[i] * e[i]))) / (2 * step[i])
        for i in (0, 1)
    ]


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def test_normal_force_and_its_derivatives(rng):
    for _ in range(COUNT):
        x = np.array(
            [
                rng.uniform(-2e-3, 8e-3),
                rng.uniform(-0.5, 0.5),
                10 ** rng.uniform(3, 6),
                rng.choice([1.0, rng.uniform(1.0, 8.0)]),
                10 ** rng.uniform(1, 4),
                10 ** rng.uniform(-3.5, -2),
            ]
        )
        depth, rate, k, n, b, full = x
        law = kelvin_voigt.normal_force(
            max(depth, 0.0), rate, stiffness=k, exponent=n, damping=b, full_damping_depth=full
        )
        np.testing.assert_allclose(normal_force(*x)[0], law, rtol=1e-12)
        if min(abs(depth), abs(rate), abs(depth - full)) > 1e-5:
            expected = slopes(lambda *a: normal_force(*a)[0], x, (1e-8, 1e-6))
            np.testing.assert_allclose(normal_force(*x)[1:], expected, rtol=2e-5, atol=1e-6 * k)


def test_friction_per_speed_and_its_slope(rng):
    assert friction_per_speed(0.0, 0.5, 0.3, 0.1) == (5.0, 5.0)
    for _ in range(COUNT):
        mu_s, mu_k, threshold = rng.uniform(0.1, 1, 3)
        speed = rng.uniform(1e-9, 3.5) * threshold
        law = {"mu_static": mu_s, "mu_kinetic": mu_k, "threshold_velocity": threshold}
        ratio, slope = friction_per_speed(speed, mu_s, mu_k, threshold)
        np.testing.assert_allclose(ratio * speed, friction_coefficient(speed, **law), rtol=1e-12)
        if min(abs(speed / threshold - u) for u in (1.0, 1.5)) > 1e-4:
            near = [friction_coefficient(speed + d, **law) for d in (-1e-7, 1e-7)]
            np.testing.assert_allclose(slope, (near[1] - near[0]) / 2e-7, rtol=1e-5, atol=1e-6)


def test_spring_force_and_its_derivatives(rng):
    for _ in range(COUNT):
        x = np.array(
            [
                rng.uniform(-0.03, 0.03),
                rng.uniform(-1, 1),
                10 ** rng.uniform(2, 5),
                10 ** rng.uniform(2, 5),
                10 ** rng.uniform(0, 3),
                0.015,
                0.5,
                rng.uniform(0, 20),
            ]
        )
        names = ("stiffness", "stiffness_negative", "damping", "limit", "rate_limit", "stop_ratio")
        law = axis_force(x[0], x[1], **dict(zip(names, x[2:], strict=True)))
        np.testing.assert_allclose(spring_force(*x)[0], law, rtol=1e-12)
        if min(abs(x[0]), abs(abs(x[0]) - x[5]), abs(abs(x[1]) - x[6])) > 1e-4:
            expected = slopes(lambda *a: spring_force(*a)[0], x, (1e-7, 1e-6))
            np.testing.assert_allclose(
                spring_force(*x)[1:], expected, rtol=1e-5, atol=1e-5 * max(x[2:5])
            )
