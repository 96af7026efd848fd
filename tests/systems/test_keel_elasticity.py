from __future__ import annotations

import numpy as np

from vsf_drake.systems import KeelElasticity

STIFFNESS, DAMPING = np.array([0.0, 410.0, 1160.0]), np.array([0.0, 2.5, 7.0])


def make():
    return KeelElasticity(num_velocities=9, velocity_indices=[6, 7, 8], stiffness=STIFFNESS, damping=DAMPING)


def test_ports_have_their_names(port_names):
    assert port_names(make()) == (["state"], ["generalized_force", "joint_moment"])


def test_moment_opposes_angle_and_rate_of_each_joint(rig, evaluate):
    context = rig.context(2)
    q, v = rig.plant.GetPositions(context), rig.plant.GetVelocities(context)
    out = evaluate(make(), context)
    expected = [-k * q[6 + i] - c * v[6 + i] for i, (k, c) in enumerate(zip(STIFFNESS, DAMPING, strict=True))]
    np.testing.assert_allclose(out["joint_moment"], expected, rtol=1e-12)
    np.testing.assert_allclose(out["generalized_force"], [0.0] * 6 + expected, rtol=1e-12)
    assert out["joint_moment"][0] == 0.0
