from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.tree import JacobianWrtVariable

from vsf_drake.systems import FulcrumSupport

STIFFNESS, DAMPING = 2e5, 300.0


def make(rig, **changes):
    arguments = {
        "frame_body_index": rig.frame, "X_FK": rig.X_FK, "keel_body_indices": rig.keel,
        "keel_body_starts": rig.keel_starts, "stiffness": STIFFNESS, "damping": DAMPING}
    return FulcrumSupport(**(arguments | changes))


def height(rig, q, position):
    """Height of the keel's material point at `position` in frame K, by Drake's own kinematics."""
    context = rig.plant.CreateDefaultContext()
    rig.plant.SetPositions(context, q)
    j = max(i for i, start in enumerate(rig.keel_starts) if start <= position)
    body, frame = rig.body(rig.keel[j]), rig.body(rig.frame)
    p_FP = rig.plant.CalcPointsPositions(
        context, body.body_frame(), [position - rig.keel_starts[j], 0.0, 0.0], frame.body_frame()).ravel()
    return (rig.X_FK.inverse() @ p_FP)[2]


def generalized_force(rig, context, applied):
    """J^T F of all of them, by Drake's Jacobians."""
    total, world = np.zeros(rig.plant.num_velocities()), rig.plant.world_frame()
    for a in applied:
        jacobian = rig.plant.CalcJacobianSpatialVelocity(
            context, JacobianWrtVariable.kV, rig.body(a.body_index).body_frame(), a.p_BoBq_B, world, world)
        total += jacobian.T @ a.F_Bq_W.get_coeffs()
    return total


def test_support_is_a_spring_and_damper_in_the_height_of_the_keel_point(rig, evaluate):
    context, system = rig.context(4), make(rig)
    q, v = rig.plant.GetPositions(context), rig.plant.GetVelocities(context)
    for position in (0.0, 0.02, 0.04, 0.066, 0.09, 0.12):
        rate = (height(rig, q + 1e-6 * v, position) - height(rig, q - 1e-6 * v, position)) / 2e-6
        force = evaluate(system, context, fulcrum_position=position)["support_force"][0]
        assert force == pytest.approx(-(STIFFNESS * height(rig, q, position) + DAMPING * rate), rel=1e-6, abs=1e-3)


@pytest.mark.parametrize("position", [0.02, 0.066, 0.12])
def test_action_equals_reaction_and_points_along_the_frames_vertical(rig, evaluate, position):
    """Sum of forces and of moments about the origin, hence about any point."""
    context = rig.context(5)
    out = evaluate(make(rig), context, fulcrum_position=position)
    wrenches = rig.wrench_about_origin(context, out["spatial_forces"])
    assert rig.frame in wrenches and len(wrenches) == 2
    np.testing.assert_allclose(sum(wrenches.values()), 0.0, atol=1e-9)
    z_K_W = (rig.body(rig.frame).EvalPoseInWorld(context) @ rig.X_FK).rotation().matrix()[:, 2]
    np.testing.assert_allclose(wrenches[rig.frame][3:], -out["support_force"][0] * z_K_W, rtol=1e-12)


@pytest.mark.parametrize("position", [0.02, 0.066, 0.12])
def test_support_without_damping_derives_from_a_potential(rig, evaluate, position):
    """Generalized force = -d(½ k w²)/dq, by central differences over the coordinates."""
    context = rig.context(7)
    out = evaluate(make(rig, damping=0.0), context, fulcrum_position=position)
    q = rig.plant.GetPositions(context)
    energies = np.array([[0.5 * STIFFNESS * height(rig, q + step * e, position) ** 2 for step in (1e-6, -1e-6)]
                         for e in np.eye(len(q))])
    np.testing.assert_allclose(generalized_force(rig, context, out["spatial_forces"]),
                               -(energies[:, 0] - energies[:, 1]) / 2e-6, rtol=1e-5, atol=1e-4)


def test_continuous_as_the_fulcrum_passes_a_joint(rig, evaluate):
    context = rig.context(8)
    for joint in (0.04, 0.09):
        before, after = (evaluate(make(rig), context, fulcrum_position=joint + offset) for offset in (-1e-10, 1e-10))
        assert after["support_force"][0] == pytest.approx(before["support_force"][0], abs=1e-3)
        forces = [generalized_force(rig, context, out["spatial_forces"]) for out in (before, after)]
        np.testing.assert_allclose(forces[1], forces[0], atol=1e-3)


def test_starts_must_increase_and_match_the_bodies(rig):
    for starts in ([0.0, 0.04], [0.0, 0.09, 0.04]):
        with pytest.raises(ValueError, match="3 increasing"):
            make(rig, keel_body_starts=starts)
