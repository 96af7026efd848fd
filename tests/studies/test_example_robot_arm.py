"""The robot arm's test of the foot: forces by a second integrator, work by energies, the arm's yielding by statics."""

from __future__ import annotations

import numpy as np
import pytest
import robot_arm
import robot_arm_emulator as example
from pydrake.multibody.tree import JacobianWrtVariable

pytestmark = pytest.mark.slow
SOFT, MIDDLE = example.FULCRUMS_M


@pytest.fixture(scope="module")
def tests(tmp_path_factory):
    return example.main(tmp_path_factory.mktemp("arm"), quick=True)


@pytest.mark.parametrize("fulcrum_m", [SOFT, MIDDLE])
def test_the_implicit_stepper_finds_the_same_force_and_centre_of_pressure_on_the_same_path(tests, fulcrum_m):
    """Other wiring, other integrator, 1 ms: within 2 % of the peak but where spheres leave the ground."""
    run, stepper = tests[fulcrum_m], tests[fulcrum_m]["stepper"]
    inner = (stepper.time_s > 0.02) & (stepper.time_s < 0.65)
    grf = np.column_stack([np.interp(stepper.time_s, run["time"], run["grf"][:, k]) for k in (0, 2)])
    assert np.abs(grf - stepper.grf_W[:, [0, 2]])[inner].max() < 0.02 * run["peak"]
    cop = np.interp(stepper.time_s, run["time"], run["cop"][:, 0])
    assert np.abs(cop - stepper.cop_W[:, 0])[inner].max() < 3e-3


@pytest.mark.parametrize("fulcrum_m", [SOFT, MIDDLE])
def test_the_work_in_the_mount_is_what_the_foot_holds_and_loses(tests, fulcrum_m):
    run = tests[fulcrum_m]
    assert run["unaccounted_j"] < 0.01 * run["stored_j"]
    assert 0.0 < run["returned_j"] < run["stored_j"]
    assert all(lost[-1] > 0.0 for lost in run["lost"].values())


def test_the_load_goes_from_heel_to_toe_in_two_humps_and_a_softer_foot_bears_and_returns_less_at_the_toe(tests):
    for run in tests.values():
        cop, time = run["cop"][run["loaded"], 0], run["time"][run["loaded"]]
        assert np.diff(np.interp(np.arange(0.05, 0.65, 0.02), time, cop)).min() > 0.0
        up = np.interp([0.15, 0.32, 0.55], run["time"], run["grf"][:, 2])
        assert up[1] < 0.95 * min(up[0], up[2])
    late = {fulcrum_m: np.interp(0.55, run["time"], run["grf"][:, 2]) for fulcrum_m, run in tests.items()}
    assert late[SOFT] < 0.7 * late[MIDDLE]
    assert tests[SOFT]["returned_j"] < tests[MIDDLE]["returned_j"]


def test_the_arm_yields_by_its_load_over_inertia_and_squared_frequency(tests):
    """Inverse dynamics leaves M (e'' + 2 w e' + w² e) = J' F: slow at the second hump, hence e = M⁻¹ J' F / w²."""
    run = tests[MIDDLE]
    arm, late = run["arm"], run["time"] > 0.4
    i = int(np.argmax(np.where(late, run["grf"][:, 2], 0.0)))
    plant, context = arm.plant, arm.plant.CreateDefaultContext()
    plant.SetPositions(context, arm.arm, arm.joints.value(run["time"][i]).ravel())
    tool, world = plant.GetFrameByName("tool"), plant.world_frame()
    axes = [plant.GetJointByName(f"axis_{k}").velocity_start() for k in range(1, 7)]
    inertia = plant.CalcMassMatrix(context)[np.ix_(axes, axes)]

    def jacobian(p_WP):
        point = tool.CalcPoseInWorld(context).inverse().multiply(p_WP).reshape(3, 1)
        return plant.CalcJacobianTranslationalVelocity(
            context, JacobianWrtVariable.kV, tool, point, world, world)[:, axes]

    torque = jacobian(run["cop"][i]).T @ run["grf"][i]
    angles = np.linalg.solve(inertia, torque) / (2.0 * np.pi * robot_arm.SERVO_HZ) ** 2
    mount = jacobian(arm.wired.foot.mount.CalcPoseInWorld(context).translation()) @ angles
    assert run["error"][i, 1] == pytest.approx(mount[2], rel=0.1)
