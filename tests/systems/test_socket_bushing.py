from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.laws.bushing import axis_force
from vsf_drake.systems import SocketBushing

LAW = {
    "stiffness": np.array([4e4, 4e4, 1e5, 1000.0, 1000.0, 300.0]),
    "stiffness_negative": np.array([4e4, 4e4, 1.5e4, 1000.0, 1000.0, 300.0]),
    "damping": np.array([400.0, 400.0, 1000.0, 10.0, 10.0, 3.0]),
    "limit": np.array([0.009, 0.009, 0.015, 0.13, 0.087, 0.17]),
    "rate_limit": np.array([0.2, 0.2, 0.2, 0.2, 0.2, 0.2]),
    "stop_ratio": 10.0,
}
AXES = [2, 0, 1, 5, 3, 4]


def make(**changes):
    return SocketBushing(**({"num_velocities": 9, "velocity_indices": AXES} | LAW | changes))


def test_ports_have_their_names(port_names):
    assert port_names(make()) == (["state"], ["generalized_force", "wrench"])


@pytest.mark.parametrize("seed", range(3))
def test_wrench_is_the_law_on_each_axis_and_goes_to_its_coordinate(rig, evaluate, seed):
    context = rig.context(seed)
    q, v = rig.plant.GetPositions(context), rig.plant.GetVelocities(context)
    out = evaluate(make(), context)
    expected = np.zeros(9)
    for i, at in enumerate(AXES):
        constants = {name: value[i] for name, value in LAW.items() if name != "stop_ratio"}
        force = float(axis_force(q[at], v[at], **constants, stop_ratio=10.0))
        assert out["wrench"][i] == pytest.approx(force, rel=1e-12)
        expected[at] = force
    np.testing.assert_allclose(out["generalized_force"], expected, rtol=1e-12)


def test_six_axes_are_demanded():
    with pytest.raises(ValueError, match="must be 6"):
        make(velocity_indices=[0, 1, 2])
