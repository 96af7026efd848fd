from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.laws import kelvin_voigt
from vsf_drake.laws._elementwise import positive_part
from vsf_drake.laws.contact_law import LawConstants

FOAM = {"stiffness": 24120.0, "exponent": 1.0, "damping": 15635.0, "full_damping_depth": 1e-3}
HEEL = {
    "stiffness": 1034.0 * 1e15,
    "exponent": 7.66,
    "damping": 3585.0,
    "full_damping_depth": 1.3e-3,
}


def normal_force(depth, rate, **law):
    return kelvin_voigt.normal_force(depth, rate, LawConstants(**law))[0]


def test_law_is_spring_and_damper_once_damping_is_full_and_fades_the_damping_in_before():
    depth, rate = np.array([1e-3, 2e-3, 5e-3]), np.array([0.1, 0.0, 0.3])
    np.testing.assert_allclose(
        normal_force(depth, rate, **FOAM), 24120.0 * depth + 15635.0 * rate, rtol=1e-14
    )
    expected = HEEL["stiffness"] * 0.325e-3**7.66 + 3585.0 * 0.2 * (3 * 0.25**2 - 2 * 0.25**3)
    assert normal_force(0.325e-3, 0.2, **HEEL) == pytest.approx(expected, rel=1e-12)


def test_never_adhesive_and_without_damping_while_the_sphere_leaves():
    depth, rate = np.meshgrid(np.linspace(0.0, 0.02, 41), np.linspace(-10.0, 10.0, 41))
    for law in (FOAM, HEEL):
        assert np.min(normal_force(depth, rate, **law)) >= 0.0
    assert normal_force(2e-3, -5.0, **FOAM) == normal_force(2e-3, 0.0, **FOAM)


def test_gradients_equal_finite_differences_and_are_finite_at_touch_down(
    assert_gradient, autodiff_gradient
):
    def force(x):
        return normal_force(
            positive_part(0.0424 - x[0]),
            x[1],
            stiffness=1e4 * x[2],
            exponent=x[3],
            damping=1e3 * x[4],
            full_damping_depth=1e-3 * x[5],
        )

    for exponent in (1.0, 1.5, 7.66):
        for rate in (-0.3, 0.3):
            for height in (0.0418, 0.0405, 0.05):
                assert_gradient(force, [height, rate, 2.4, exponent, 15.0, 1.0])
            assert np.all(
                np.isfinite(autodiff_gradient(force, [0.0424, rate, 2.4, exponent, 15.0, 1.0]))
            )
        assert np.all(
            np.isfinite(autodiff_gradient(force, [0.0424, 0.0, 2.4, exponent, 15.0, 1.0]))
        )
