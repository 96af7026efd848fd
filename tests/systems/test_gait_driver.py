from __future__ import annotations

import numpy as np

from vsf_drake.systems import GaitDriver

POSITION_GAIN, VELOCITY_GAIN = np.array([100.0, 200.0]), np.array([1.0, 2.0])


def make():
    return GaitDriver(num_velocities=9, velocity_indices=[5, 3], position_gain=POSITION_GAIN,
                      velocity_gain=VELOCITY_GAIN)


def test_ports_have_their_names(port_names):
    assert port_names(make()) == (["state", "desired_state"], ["generalized_force", "tracking_error"])


def test_force_is_proportional_to_the_errors_of_the_driven_joints(rig, evaluate):
    context = rig.context(3)
    q, v = rig.plant.GetPositions(context), rig.plant.GetVelocities(context)
    out = evaluate(make(), context, desired_state=[0.1, 0.2, 0.3, 0.4])
    expected = np.zeros(9)
    expected[5] = 100.0 * (0.1 - q[5]) + 1.0 * (0.3 - v[5])
    expected[3] = 200.0 * (0.2 - q[3]) + 2.0 * (0.4 - v[3])
    np.testing.assert_allclose(out["generalized_force"], expected, rtol=1e-12)
    np.testing.assert_allclose(out["tracking_error"], [0.1 - q[5], 0.2 - q[3]], rtol=1e-12)


def test_no_force_on_the_desired_motion(rig, evaluate):
    context = rig.context(3)
    q, v = rig.plant.GetPositions(context), rig.plant.GetVelocities(context)
    out = evaluate(make(), context, desired_state=[q[5], q[3], v[5], v[3]])
    np.testing.assert_array_equal(out["generalized_force"], 0.0)
