from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.systems import TestingMachine

LAW = {"stiffness": 54.8e3, "exponent": 1.0, "damping": 100.0, "full_damping_depth": 1e-4}


def make(rig, **changes):
    return TestingMachine(body_indices=rig.site_bodies, p_BS=rig.p_BS, **(LAW | changes))


def test_ports_have_their_names(rig, port_names):
    assert port_names(make(rig)) == (
        ["body_poses", "body_spatial_velocities", "platen"], ["load", "depth", "spatial_forces"])


def test_load_is_a_spring_between_platen_and_sites(rig, evaluate):
    context = rig.context(1)
    rig.plant.SetVelocities(context, np.zeros(9))
    p_WS, _, _ = rig.points(context)
    top = float(np.median(p_WS[:, 2]))
    out = evaluate(make(rig), context, platen=[top, 0.0])
    depth = np.array([max(0.0, top - p[2]) for p in p_WS])
    np.testing.assert_allclose(out["depth"], depth, atol=1e-15)
    assert out["load"][0] == pytest.approx(54.8e3 * depth.sum(), rel=1e-12)


def test_damping_follows_the_closing_speed_of_platen_and_site(rig, evaluate):
    context = rig.context(2)
    p_WS, v_WS, _ = rig.points(context)
    top = p_WS[:, 2].max() + 1e-3
    out = evaluate(make(rig), context, platen=[top, 0.2])
    expected = 54.8e3 * (top - p_WS[:, 2]) + 100.0 * np.maximum(0.2 - v_WS[:, 2], 0.0)
    assert out["load"][0] == pytest.approx(expected.sum(), rel=1e-10)


def test_load_stays_vertical_and_at_the_sites(rig, evaluate):
    context = rig.context(3)
    rig.plant.SetVelocities(context, np.zeros(9))
    p_WS, _, _ = rig.points(context)
    top = p_WS[:, 2].max()
    out = evaluate(make(rig), context, platen=[top, 0.0])
    expected = {}
    for body, p in zip(rig.site_bodies, p_WS, strict=True):
        f_W = np.array([0.0, 0.0, 54.8e3 * (top - p[2])])
        expected[body] = expected.get(body, np.zeros(6)) + np.concatenate((np.cross(p, f_W), f_W))
    actual = rig.wrench_about_origin(context, out["spatial_forces"])
    for body, wrench in expected.items():
        np.testing.assert_allclose(actual[body], wrench, rtol=1e-10, atol=1e-9)


def test_no_load_before_the_platen_reaches_the_foot(rig, evaluate):
    out = evaluate(make(rig), rig.context(), platen=[-1.0, 5.0])
    assert out["load"][0] == 0.0
