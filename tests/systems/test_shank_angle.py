"""The sensor on the shank: angle against the vertical, its exact rate, whatever the heading."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RigidTransform_, RollPitchYaw_, RotationMatrix
from pydrake.multibody.math import SpatialVelocity, SpatialVelocity_

from vsf_drake.systems.swing_controller import ShankAngle


def angle(R_WB, w_WB_W=(0.0, 0.0, 0.0)):
    sensor = ShankAngle(body_index=1)
    context = sensor.CreateDefaultContext()
    poses = [RigidTransform(), RigidTransform(R_WB, [1.0, 2.0, 3.0])]
    velocities = [SpatialVelocity.Zero(), SpatialVelocity(np.array(w_WB_W), np.ones(3))]
    sensor.GetInputPort("body_poses").FixValue(context, AbstractValue.Make(poses))
    sensor.GetInputPort("body_spatial_velocities").FixValue(context, AbstractValue.Make(velocities))
    return sensor.get_output_port().Eval(context)


@pytest.mark.parametrize("lean", [-0.6, 0.0, 0.9, 2.0])
@pytest.mark.parametrize("heading", [0.0, 1.3, -2.5])
def test_leaning_forward_is_positive_whatever_the_heading(lean, heading):
    R_WB = RotationMatrix.MakeZRotation(heading) @ RotationMatrix.MakeYRotation(lean)
    leftward = RotationMatrix.MakeZRotation(heading).col(1)
    np.testing.assert_allclose(angle(R_WB, 2.5 * leftward), [lean, 2.5], atol=1e-14)
    np.testing.assert_allclose(angle(R_WB, [0.0, 0.0, 3.0]), [lean, 0.0], atol=1e-14)  # turning on the spot


def test_rate_is_the_derivative_of_the_angle_in_any_motion():
    rng = np.random.default_rng(3)
    for _ in range(20):
        R_WB = RotationMatrix(RollPitchYaw_[float](rng.uniform(-0.7, 0.7, 3)).ToRotationMatrix().matrix())
        w = rng.normal(size=3)

        def turned(h, R_WB=R_WB, w=w):
            axis = w / np.linalg.norm(w)
            return angle(RotationMatrix(AngleAxis(h * np.linalg.norm(w), axis)) @ R_WB)[0]

        assert angle(R_WB, w)[1] == pytest.approx((turned(1e-6) - turned(-1e-6)) / 2e-6, abs=1e-8)


def test_derivatives_are_exact():
    converted = ShankAngle(body_index=0).ToAutoDiffXd()
    context = converted.CreateDefaultContext()
    x = InitializeAutoDiff(np.array([0.1, 0.4, -0.2])).ravel()
    T = type(x[0])
    pose = RigidTransform_[T](RollPitchYaw_[T](x).ToRotationMatrix(), [T(0.0)] * 3)
    converted.GetInputPort("body_poses").FixValue(context, AbstractValue.Make([pose]))
    velocity = SpatialVelocity_[T](np.array([T(0.3), T(-0.5), T(0.2)]), np.array([T(0.0)] * 3))
    converted.GetInputPort("body_spatial_velocities").FixValue(context, AbstractValue.Make([velocity]))
    out = converted.get_output_port().Eval(context)

    def plain(rpy):
        return np.array(angle(RotationMatrix(RollPitchYaw_[float](rpy).ToRotationMatrix().matrix()), [0.3, -0.5, 0.2]))

    point = np.array([0.1, 0.4, -0.2])
    expected = np.stack([(plain(point + 1e-6 * e) - plain(point - 1e-6 * e)) / 2e-6 for e in np.eye(3)], axis=1)
    np.testing.assert_allclose(ExtractValue(out).ravel(), plain(point), atol=1e-14)
    np.testing.assert_allclose(ExtractGradient(out), expected, atol=1e-8)
