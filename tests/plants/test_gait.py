"""The person's whole diagram: scalar conversion, derivatives, ground of patches; on the plane as separate systems."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue
from pydrake.multibody.tree import JointIndex

from vsf_drake.ground import Ground, GroundPatch
from vsf_drake.parameters import ModelParameters
from vsf_drake.plants.gait import make_gait

STANDING_M = 0.93
"""Pelvis height at which both feet of the subject are in the ground."""
FOOT = ("grf", "cop", "free_moment", "normal_force", "depth", "friction_force")

@pytest.fixture
def standing(gait):
    """(gait, context) on both feet, sinking slowly and sliding a little, the keel and socket bent."""
    made = gait("right")
    context = made.diagram.CreateDefaultContext()
    rng = np.random.default_rng(4)
    n = made.plant.num_positions()
    q, v = rng.uniform(-0.01, 0.01, n), rng.uniform(-0.02, 0.02, n)
    index = {made.plant.get_joint(JointIndex(i)).name(): made.plant.get_joint(JointIndex(i)).position_start()
             for i in range(made.plant.num_joints()) if made.plant.get_joint(JointIndex(i)).num_positions()}
    body = made.person.body
    q[index["pelvis_ty"]] = body.leg_length - body.hip_up - 0.012
    q[index["fulcrum"]], v[index["pelvis_ty"]] = 0.1, -0.1
    made.plant.SetPositionsAndVelocities(made.plant_context(context), np.concatenate((q, v)))
    made.diagram.GetInputPort("fulcrum_position").FixValue(context, [0.1])
    made.diagram.GetInputPort("desired_state").FixValue(context, np.zeros(2 * len(made.prescribed)))
    return made, context


def autodiff(diagram, context):
    converted = diagram.ToAutoDiffXd()
    other = converted.CreateDefaultContext()
    other.SetTimeStateAndParametersFrom(context)
    converted.FixInputPortsFrom(diagram, context, other)
    return converted, other


def test_free_coordinates_are_not_driven(subject):
    made = make_gait(subject, ModelParameters(), free=("pelvis_ty", "knee_angle_l"))
    assert len(made.prescribed) == 19
    assert made.diagram.GetInputPort("desired_state").size() == 38
    with pytest.raises(ValueError, match="no such coordinate: elbow"):
        make_gait(subject, ModelParameters(), free=("elbow",))


def test_gradients_of_the_whole_equal_finite_differences(standing):
    """Along random directions of the state, of the derivatives and of the ground reaction alike."""
    made, context = standing
    converted, other = autodiff(made.diagram, context)
    x = context.get_continuous_state_vector().CopyToVector()
    directions = np.random.default_rng(6).normal(size=(len(x), 4))
    seeded = np.array([AutoDiffXd(value, row) for value, row in zip(x, directions, strict=True)])
    other.SetContinuousState(seeded)
    rates = converted.EvalTimeDerivatives(other).CopyToVector()
    known, actual = made.diagram.EvalTimeDerivatives(context).CopyToVector(), ExtractGradient(rates)
    np.testing.assert_allclose(ExtractValue(rates).ravel(), known, rtol=1e-9, atol=1e-11 * np.abs(known).max())
    for name in ("grf", "intact_grf"):
        assert made.diagram.GetOutputPort(name).Eval(context)[2] > 50.0
    force = ExtractGradient(converted.GetOutputPort("grf").Eval(other))
    step = 1e-8
    for i, d in enumerate(directions.T):
        rates, reactions = [], []
        for sign in (1, -1):
            context.SetContinuousState(x + sign * step * d)
            rates.append(made.diagram.EvalTimeDerivatives(context).CopyToVector())
            reactions.append(made.diagram.GetOutputPort("grf").Eval(context))
        for exact, ends in ((actual[:, i], rates), (force[:, i], reactions)):
            difference = (ends[0] - ends[1]) / (2 * step)
            np.testing.assert_allclose(exact, difference, rtol=1e-4, atol=1e-5 * np.abs(difference).max())


def values(diagram, context, ports):
    return {name: diagram.GetOutputPort(name).Eval(context) for name in ports}


def stood(gait):
    """A moving person with both feet in the ground, fulcrum and prescribed coordinates at rest."""
    context, random = gait.diagram.CreateDefaultContext(), np.random.default_rng(8)
    plant, plant_context = gait.plant, gait.plant_context(context)
    nq = plant.num_positions()
    plant.SetPositionsAndVelocities(plant_context, random.uniform(-1, 1, 2 * nq) * np.repeat([0.01, 0.05], nq))
    for name, value in (("pelvis_ty", STANDING_M), ("fulcrum", 0.1)):
        plant.GetJointByName(name).set_translation(plant_context, value)
    gait.diagram.GetInputPort("fulcrum_position").FixValue(context, 0.1)
    gait.diagram.GetInputPort("desired_state").FixValue(context, np.zeros(2 * len(gait.prescribed)))
    return context


def test_a_patch_under_the_intact_foot_alone_raises_its_force_alone(subject):
    ground = Ground(patches=(GroundPatch(), GroundPatch(name="kerb", from_y_m=0.02, height_m=0.003)))
    model = ModelParameters()
    rubber = replace(model.intact_foot.friction, mu_static=0.9, mu_kinetic=0.7)
    model = replace(model, intact_foot=replace(model.intact_foot, friction=rubber))
    level, kerb = (make_gait(subject, model, g) for g in (Ground(), ground))
    one, two = (values(g.diagram, stood(g), ("grf", "intact_grf")) for g in (level, kerb))
    assert two["intact_grf"][2] > one["intact_grf"][2] + 50.0
    np.testing.assert_array_equal(one["grf"], two["grf"])
    for name, friction in (("prosthetic", model.foot.friction), ("intact", rubber)):
        forces = kerb.forces[name]
        np.testing.assert_array_equal(forces.GetParameter(forces.CreateDefaultContext(), "mu_kinetic"),
                                      [friction.mu_kinetic] * 2)
