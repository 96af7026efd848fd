"""The reaction read from Drake's contact results is what changes the momentum of leg and foot, beside their weight."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.ground import Ground, GroundPatch
from vsf_drake.parameters import FootParameters
from vsf_drake.plants import add_foot, add_ground_geometry, wire_foot

HEIGHT_M = 0.2


@pytest.mark.parametrize("contact", ["drake_point", "hydroelastic"])
def test_force_at_the_centre_of_pressure_and_free_moment_are_the_rate_of_momentum(contact):
    """A foot slides and spins, pitched and rolled, on ground 0.2 m above the origin about which moments are taken."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.0)
    shank = plant.AddRigidBody("shank", SpatialInertia.SolidBoxWithMass(5.0, 0.1, 0.1, 0.4))
    foot = add_foot(plant, shank.body_frame(), FootParameters(), contact=contact)
    add_ground_geometry(plant, Ground(patches=(GroundPatch(height_m=HEIGHT_M),)), contact=contact)
    plant.Finalize()
    reaction = wire_foot(builder, plant, foot).reaction
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(root)
    X_KS = foot.frame.EvalPoseInWorld(own).inverse() @ shank.EvalPoseInWorld(own)
    X_WK = RigidTransform(RollPitchYaw(0.04, 0.08, 0.5), [0.3, -0.2, HEIGHT_M + 0.037])
    plant.SetFreeBodyPose(own, shank, X_WK @ X_KS)
    v, start = np.zeros(plant.num_velocities()), shank.floating_velocities_start_in_v()
    v[start:start + 6] = 0.0, 0.0, 4.0, 0.3, -0.2, -0.1
    plant.SetVelocities(own, v)
    F, cop, (free_moment,) = (
        reaction.GetOutputPort(name).Eval(reaction.GetMyContextFromRoot(root))
        for name in ("grf", "cop", "free_moment"))
    mass = plant.CalcTotalMass(own)
    weight = mass * plant.gravity_field().gravity_vector()
    arm = plant.CalcCenterOfMassPositionInWorld(own)
    state, rates = root.get_continuous_state_vector().CopyToVector(), diagram.EvalTimeDerivatives(root).CopyToVector()

    def momentum(seconds):
        root.SetContinuousState(state + seconds * rates)
        return plant.CalcSpatialMomentumInWorldAboutPoint(own, np.zeros(3)).get_coeffs()

    rate = (momentum(1e-6) - momentum(-1e-6)) / 2e-6
    np.testing.assert_allclose(F, rate[3:] - weight, atol=1e-5 * F[2])
    moment = rate[:3] - np.cross(arm, weight)
    about_origin = np.cross(cop, F) + np.array([0.0, 0.0, free_moment])
    np.testing.assert_allclose(about_origin, moment, atol=1e-5 * F[2])
    assert cop[2] == pytest.approx(HEIGHT_M, abs=1e-6)
    assert F[2] > 50.0
    assert np.hypot(F[0], F[1]) > 10.0
    assert abs(free_moment) > 0.1
