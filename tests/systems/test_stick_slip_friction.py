from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.laws.stick_slip import friction_force
from vsf_drake.systems import StickSlipFriction

LAW = {"mu_static": 0.5, "mu_kinetic": 0.3, "threshold_velocity": 0.1}
LOAD = np.array([100.0, 0.0, 250.0, 30.0, 400.0])


def make(rig, **changes):
    return StickSlipFriction(
        body_indices=rig.site_bodies, p_BS=rig.p_BS, radius=rig.radius, **(LAW | changes))


def test_ports_have_their_names(rig, port_names):
    assert port_names(make(rig)) == (
        ["body_poses", "body_spatial_velocities", "normal_force"], ["friction_force", "spatial_forces"])


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_force_equals_the_law_at_the_slip_of_the_full_radius(rig, evaluate, seed, smooth):
    """Slip (v_x - w_y R, v_y + w_x R) of each sphere."""
    context = rig.context(seed)
    _, v, w = rig.points(context)
    slip = np.stack((v[:, 0] - w[:, 1] * rig.radius, v[:, 1] + w[:, 0] * rig.radius), axis=1)
    out = evaluate(make(rig, smooth=smooth), context, normal_force=LOAD)
    force = out["friction_force"].reshape(5, 3)
    np.testing.assert_allclose(force[:, :2], friction_force(slip, LOAD, **LAW, smooth=smooth), rtol=1e-9, atol=1e-10)
    np.testing.assert_array_equal(force[:, 2], 0.0)


def test_rolling_on_the_full_radius_is_free_of_friction_at_any_depth(rig, evaluate):
    for height in (0.03, 0.02, 0.01):
        context = rig.plant.CreateDefaultContext()
        rig.plant.SetPositions(context, [0, 0, height, 0, 0, 0, 0, 0, 0])
        system = StickSlipFriction(body_indices=[rig.frame], p_BS=np.zeros((1, 3)), radius=0.03, **LAW)
        rig.plant.SetVelocities(context, [0.06, 0, 0, 0, 0, 2.0, 0, 0, 0])
        out = evaluate(system, context, normal_force=[500.0])
        np.testing.assert_allclose(out["friction_force"], 0.0, atol=1e-10)


def test_forces_act_at_the_contact_points(rig, evaluate):
    context = rig.context(1)
    p_WS, _, _ = rig.points(context)
    out = evaluate(make(rig), context, normal_force=LOAD)
    expected = {}
    for body, p, radius, f_W in zip(
            rig.site_bodies, p_WS, rig.radius, out["friction_force"].reshape(5, 3), strict=True):
        wrench = np.concatenate((np.cross(p - [0.0, 0.0, radius], f_W), f_W))
        expected[body] = expected.get(body, np.zeros(6)) + wrench
    actual = rig.wrench_about_origin(context, out["spatial_forces"])
    assert actual.keys() == expected.keys()
    for body, wrench in expected.items():
        np.testing.assert_allclose(actual[body], wrench, rtol=1e-12, atol=1e-10)


def test_no_friction_without_normal_force(rig, evaluate):
    out = evaluate(make(rig), rig.context(), normal_force=np.zeros(5))
    np.testing.assert_array_equal(out["friction_force"], 0.0)
