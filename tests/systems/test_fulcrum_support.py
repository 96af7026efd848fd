from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces

from vsf_drake.systems import FulcrumSupport

STIFFNESS, DAMPING = 2e5, 300.0


def make(rig, **changes):
    arguments = {
        "frame_body_index": rig.frame, "X_FK": rig.X_FK, "keel_body_indices": rig.keel,
        "keel_body_starts": rig.keel_starts, "stiffness": STIFFNESS, "damping": DAMPING}
    return FulcrumSupport(**(arguments | changes))


def height(rig, context, position):
    """Height of the keel's material point at `position` in frame K, by Drake's own kinematics."""
    j = max(i for i, start in enumerate(rig.keel_starts) if start <= position)
    body, frame = rig.body(rig.keel[j]), rig.body(rig.frame)
    p_FP = rig.plant.CalcPointsPositions(
        context, body.body_frame(), [position - rig.keel_starts[j], 0.0, 0.0], frame.body_frame()).ravel()
    return (rig.X_FK.inverse() @ p_FP)[2]


def generalized_force(rig, context, applied):
    forces = MultibodyForces(rig.plant)
    for a in applied:
        body = rig.body(a.body_index)
        body.AddInForceInWorld(context, a.F_Bq_W, forces)
    J = rig.plant.num_velocities()
    total = np.zeros(J)
    for a in applied:
        body = rig.body(a.body_index)
        jacobian = rig.plant.CalcJacobianSpatialVelocity(
            context, JacobianWrtVariable.kV, body.body_frame(), a.p_BoBq_B, rig.plant.world_frame(),
            rig.plant.world_frame())
        total += jacobian.T @ a.F_Bq_W.get_coeffs()
    return total


def test_ports_have_their_names(rig, port_names):
    assert port_names(make(rig)) == (
        ["body_poses", "body_spatial_velocities", "fulcrum_position"], ["spatial_forces", "support_force"])


@pytest.mark.parametrize("position", [0.0, 0.02, 0.04, 0.066, 0.09, 0.12])
def test_support_is_a_spring_and_damper_in_the_height_of_the_keel_point(rig, evaluate, position):
    context = rig.context(4)
    step, moved = 1e-6, rig.plant.CreateDefaultContext()
    q, v = rig.plant.GetPositions(context), rig.plant.GetVelocities(context)
    heights = []
    for sign in (1.0, -1.0):
        rig.plant.SetPositions(moved, q + sign * step * v)
        heights.append(height(rig, moved, position))
    rate = (heights[0] - heights[1]) / (2 * step)
    force = evaluate(make(rig), context, fulcrum_position=position)["support_force"][0]
    assert force == pytest.approx(-(STIFFNESS * height(rig, context, position) + DAMPING * rate), rel=1e-6, abs=1e-3)


@pytest.mark.parametrize("position", [0.02, 0.066, 0.12])
def test_action_equals_reaction(rig, evaluate, position):
    """Sum of forces and of moments about the origin, hence about any point."""
    context = rig.context(5)
    out = evaluate(make(rig), context, fulcrum_position=position)
    wrenches = rig.wrench_about_origin(context, out["spatial_forces"])
    assert rig.frame in wrenches and len(wrenches) == 2
    np.testing.assert_allclose(sum(wrenches.values()), 0.0, atol=1e-9)
    assert np.linalg.norm(wrenches[rig.frame][3:]) == pytest.approx(abs(out["support_force"][0]), rel=1e-12)


def test_force_on_the_keel_points_along_the_frames_vertical(rig, evaluate):
    context = rig.context(6)
    out = evaluate(make(rig), context, fulcrum_position=0.066)
    X_WF = rig.body(rig.frame).EvalPoseInWorld(context)
    z_K_W = (X_WF @ rig.X_FK).rotation().matrix()[:, 2]
    wrench = rig.wrench_about_origin(context, out["spatial_forces"])[rig.keel[1]]
    np.testing.assert_allclose(wrench[3:], out["support_force"][0] * z_K_W, rtol=1e-12)


@pytest.mark.parametrize("position", [0.02, 0.066, 0.12])
def test_support_without_damping_derives_from_a_potential(rig, evaluate, position):
    """Generalized force = -d(½ k w²)/dq, by central differences over the coordinates."""
    context = rig.context(7)
    out = evaluate(make(rig, damping=0.0), context, fulcrum_position=position)
    q, step, gradient = rig.plant.GetPositions(context), 1e-6, []
    moved = rig.plant.CreateDefaultContext()
    for i in range(len(q)):
        energies = []
        for sign in (1.0, -1.0):
            rig.plant.SetPositions(moved, q + sign * step * np.eye(len(q))[i])
            energies.append(0.5 * STIFFNESS * height(rig, moved, position) ** 2)
        gradient.append((energies[0] - energies[1]) / (2 * step))
    actual = generalized_force(rig, context, out["spatial_forces"])
    np.testing.assert_allclose(actual, -np.array(gradient), rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("joint", [0.04, 0.09])
def test_continuous_as_the_fulcrum_passes_a_joint(rig, evaluate, joint):
    context = rig.context(8)
    before, after = (
        evaluate(make(rig), context, fulcrum_position=joint + offset) for offset in (-1e-10, 1e-10))
    assert after["support_force"][0] == pytest.approx(before["support_force"][0], abs=1e-3)
    forces = [generalized_force(rig, context, out["spatial_forces"]) for out in (before, after)]
    np.testing.assert_allclose(forces[1], forces[0], atol=1e-3)


def test_no_force_on_an_undeformed_keel(rig, evaluate):
    context = rig.plant.CreateDefaultContext()
    q = np.concatenate((rig.plant.GetPositions(rig.context(9))[:6], np.zeros(3)))
    v = np.concatenate((rig.plant.GetVelocities(rig.context(9))[:6], np.zeros(3)))
    rig.plant.SetPositions(context, q)
    rig.plant.SetVelocities(context, v)
    for position in (0.0, 0.066, 0.12):
        assert evaluate(make(rig), context, fulcrum_position=position)["support_force"][0] == pytest.approx(
            0.0, abs=1e-9)


def test_starts_must_increase_and_match_the_bodies(rig):
    for starts in ([0.0, 0.04], [0.0, 0.09, 0.04]):
        with pytest.raises(ValueError, match="3 increasing"):
            make(rig, keel_body_starts=starts)
