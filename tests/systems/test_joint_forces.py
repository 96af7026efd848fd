"""Socket and driver: the law of each joint in its place among the generalized forces; the keel's
are in test_foot_forces."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.laws.bushing import axis_force
from vsf_drake.systems import GaitDriver, SocketBushing

SOCKET = {
    "stiffness": np.array([4e4, 4e4, 1e5, 1000.0, 1000.0, 300.0]),
    "stiffness_negative": np.array([4e4, 4e4, 1.5e4, 1000.0, 1000.0, 300.0]),
    "damping": np.array([400.0, 400.0, 1000.0, 10.0, 10.0, 3.0]),
    "limit": np.array([0.009, 0.009, 0.015, 0.13, 0.087, 0.17]),
    "rate_limit": np.array([0.2, 0.2, 0.2, 0.2, 0.2, 0.2]),
}
AXES = [2, 0, 1, 5, 3, 4]
q, v = np.random.default_rng(1).normal(scale=[[0.1], [0.3]], size=(2, 9))


def evaluate(system, **inputs):
    context = system.CreateDefaultContext()
    for name, value in ({"state": np.append(q, v)} | inputs).items():
        system.GetInputPort(name).FixValue(context, value)
    ports = [system.get_output_port(i) for i in range(system.num_output_ports())]
    return {port.get_name(): port.Eval(context) for port in ports}


def test_driver_is_proportional_to_the_errors_of_the_driven_joints():
    out, expected = (
        evaluate(
            GaitDriver(
                num_velocities=9,
                velocity_indices=[5, 3],
                position_gain=[100.0, 200.0],
                velocity_gain=[1.0, 2.0],
            ),
            desired_state=[0.1, 0.2, 0.3, 0.4],
        ),
        np.zeros(9),
    )
    expected[5] = 100.0 * (0.1 - q[5]) + 1.0 * (0.3 - v[5])
    expected[3] = 200.0 * (0.2 - q[3]) + 2.0 * (0.4 - v[3])
    np.testing.assert_allclose(out["generalized_force"], expected, rtol=1e-12)
    np.testing.assert_allclose(out["tracking_error"], [0.1 - q[5], 0.2 - q[3]], rtol=1e-12)


def test_socket_wrench_is_the_law_on_each_axis_and_goes_to_its_coordinate():
    out, expected = (
        evaluate(SocketBushing(num_velocities=9, velocity_indices=AXES, **SOCKET, stop_ratio=10.0)),
        {},
    )
    for i, at in enumerate(AXES):
        constants = {name: value[i] for name, value in SOCKET.items()}
        expected[at] = axis_force(q[at], v[at], **constants, stop_ratio=10.0)[0]
    np.testing.assert_allclose(out["wrench"], [expected[at] for at in AXES], rtol=1e-12)
    np.testing.assert_allclose(
        out["generalized_force"], [expected.get(at, 0.0) for at in range(9)], rtol=1e-12
    )
    with pytest.raises(ValueError, match="must be 6"):
        SocketBushing(num_velocities=9, velocity_indices=[0, 1, 2], **SOCKET, stop_ratio=10.0)
