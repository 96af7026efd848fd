from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import trapezoid

from vsf_drake.laws.kelvin_voigt import normal_force, penetration_depth, smooth_step

FOAM = {"stiffness": 24120.0, "exponent": 1.0, "damping": 15635.0, "full_damping_depth": 1e-3}
HEEL = {"stiffness": 1034.0 * 1e15, "exponent": 7.66, "damping": 3585.0, "full_damping_depth": 1.3e-3}
BRANCHES = pytest.mark.parametrize("unloading", ["continuous", "printed"])


def test_smooth_step_is_the_cubic_between_its_flat_ends(autodiff_gradient):
    u = np.array([-3.0, 0.0, 0.25, 0.5, 0.75, 1.0, 7.0])
    expected = [0.0, 0.0, 3 * 0.25**2 - 2 * 0.25**3, 0.5, 3 * 0.75**2 - 2 * 0.75**3, 1.0, 1.0]
    np.testing.assert_allclose(smooth_step(u), expected, atol=1e-15)
    for flat in (-1.0, 0.0, 1.0, 2.0):
        assert autodiff_gradient(smooth_step, [flat]).ravel() == pytest.approx([0.0], abs=1e-15)


def test_penetration_is_radius_less_height_also_of_a_centre_below_the_ground_and_never_negative():
    np.testing.assert_allclose(
        penetration_depth([0.05, 0.04, 0.03, 0.0, -0.01], 0.04), [0.0, 0.0, 0.01, 0.04, 0.05], atol=1e-17)


def test_law_is_spring_and_damper_once_damping_is_full_and_fades_the_damping_in_before():
    depth, rate = np.array([1e-3, 2e-3, 5e-3]), np.array([0.1, 0.0, 0.3])
    np.testing.assert_allclose(normal_force(depth, rate, **FOAM), 24120.0 * depth + 15635.0 * rate, rtol=1e-14)
    expected = HEEL["stiffness"] * 0.65e-3**7.66 + 3585.0 * 0.2 * 0.5
    assert normal_force(0.65e-3, 0.2, **HEEL) == pytest.approx(expected, rel=1e-12)


def test_linear_law_of_the_library_is_the_limit_of_a_vanishing_full_damping_depth():
    law = FOAM | {"full_damping_depth": 1e-12}
    assert normal_force(1e-6, 0.1, **law) == pytest.approx(24120.0 * 1e-6 + 15635.0 * 0.1, rel=1e-14)
    assert normal_force(0.0, 100.0, **law) == 0.0


@BRANCHES
def test_never_adhesive_and_without_damping_while_the_sphere_leaves(unloading):
    depth, rate = np.meshgrid(np.linspace(0.0, 0.02, 41), np.linspace(-10.0, 10.0, 41))
    for law in (FOAM, HEEL):
        assert np.min(normal_force(depth, rate, **law, unloading=unloading)) >= 0.0
    resting = normal_force(2e-3, 0.0, **FOAM, unloading=unloading)
    assert normal_force(2e-3, -5.0, **FOAM, unloading=unloading) == resting


def test_continuous_at_touch_down_and_where_the_depth_rate_changes_sign():
    """The force grows no faster than depth · (k + 3 b v / d²) · depth near touch-down."""
    depth = np.array([1e-6, 1e-8, 1e-10])
    for law in (FOAM, HEEL):
        force = normal_force(depth, 1.0, **law)
        ramp = 3 * law["damping"] * (depth / law["full_damping_depth"]) ** 2
        assert np.all(force <= (law["stiffness"] * depth ** law["exponent"] + ramp) * (1 + 1e-12))
    before, after = normal_force(2e-3, np.array([-1e-9, 1e-9]), **(FOAM | {"exponent": 1.5}))
    assert after == pytest.approx(before, abs=1e-4)


def test_loss_of_a_cycle_comes_from_the_loading_branch_alone():
    """Depth a (1 - cos wt) / 2: the loss is b times the integral of s · rate² over the loading half."""
    a, w = 5e-3, 2.0
    t = np.linspace(0.0, 2 * np.pi / w, 20001)
    depth, rate = 0.5 * a * (1 - np.cos(w * t)), 0.5 * a * w * np.sin(w * t)
    loss = trapezoid(normal_force(depth, rate, **FOAM) * rate, t)
    half = t <= np.pi / w
    u = np.minimum(depth / 1e-3, 1.0)
    expected = trapezoid((15635.0 * rate**2 * u**2 * (3 - 2 * u))[half], t[half])
    assert loss == pytest.approx(expected, rel=1e-6)


def test_printed_unloading_branch_jumps_unless_the_exponent_is_one():
    for exponent, jumps in ((1.0, False), (1.5, True), (7.66, True)):
        law = FOAM | {"exponent": exponent}
        leaving, entering = normal_force(2e-3, np.array([-1e-12, 0.0]), **law, unloading="printed")
        assert leaving == pytest.approx(24120.0 * 2e-3)
        assert (abs(leaving - entering) > 1.0) == jumps
    with pytest.raises(ValueError, match="continuous, printed"):
        normal_force(1e-3, 0.0, **FOAM, unloading="as_printed")


@BRANCHES
def test_gradients_equal_finite_differences(assert_gradient, unloading):
    for exponent in (1.0, 1.5, 3.0, 7.66):
        def force(x, exponent=exponent):
            return normal_force(penetration_depth(x[0], 0.0424), x[1], **(FOAM | {"exponent": exponent}),
                                unloading=unloading)

        for rate in (-0.3, 0.3):
            for height in (0.0418, 0.0405, 0.05):
                assert_gradient(force, [height, rate])


def test_gradients_with_respect_to_the_constants_equal_finite_differences(assert_gradient):
    def force(x):
        return normal_force(np.array([0.6e-3, 2e-3]), 0.1, stiffness=1e4 * x[0], exponent=x[1], damping=1e3 * x[2],
                            full_damping_depth=1e-3 * x[3])

    for exponent in (1.0, 1.5, 7.66):
        assert_gradient(force, [2.4, exponent, 15.0, 1.0])


def test_gradient_is_finite_at_touch_down(autodiff_gradient):
    for exponent in (1.0, 1.5, 2.0, 7.66):
        def by_height(x, exponent=exponent):
            return normal_force(penetration_depth(x[0], 0.04), x[1], **(FOAM | {"exponent": exponent}))

        for rate in (-0.3, 0.0, 0.3):
            assert np.all(np.isfinite(autodiff_gradient(by_height, [0.04, rate])))
            assert np.all(np.isfinite(autodiff_gradient(
                lambda x: normal_force(x[0], x[1], **(FOAM | {"exponent": x[2]})), [0.0, rate, exponent])))
