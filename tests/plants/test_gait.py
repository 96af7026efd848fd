"""The person's whole diagram: scalar conversion, derivatives, ground of patches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue

from vsf_drake.model.ground import Ground, GroundPatch
from vsf_drake.model.parameters import ModelParameters
from vsf_drake.plants.gait import make_gait

STANDING_M = 0.93
"""Pelvis height at which both feet of the subject are in the ground."""


def stood(gait):
    """A moving person with both feet in the ground, keel and socket bent, prescribed coordinates at
    rest."""
    context, random = gait.diagram.CreateDefaultContext(), np.random.default_rng(8)
    plant, plant_context = gait.plant, gait.plant_context(context)
    nq = plant.num_positions()
    plant.SetPositionsAndVelocities(
        plant_context, random.uniform(-1, 1, 2 * nq) * np.repeat([0.01, 0.05], nq)
    )
    for name, value in (("pelvis_ty", STANDING_M), ("fulcrum", 0.1)):
        plant.GetJointByName(name).set_translation(plant_context, value)
    gait.diagram.GetInputPort("fulcrum_position").FixValue(context, 0.1)
    gait.diagram.GetInputPort("desired_state").FixValue(context, np.zeros(2 * len(gait.prescribed)))
    return context


def test_free_coordinates_are_not_driven(subject):
    made = make_gait(subject, ModelParameters(), free=("pelvis_ty", "knee_angle_l"))
    assert len(made.prescribed) == 19
    assert made.diagram.GetInputPort("desired_state").size() == 38
    with pytest.raises(ValueError, match="no such coordinate: elbow"):
        make_gait(subject, ModelParameters(), free=("elbow",))


def test_gradients_of_the_whole_equal_finite_differences(gait):
    """Along random directions of the state, of the derivatives and of the ground reaction alike."""
    made = gait("right")
    context = stood(made)
    converted = made.diagram.ToAutoDiffXd()
    other = converted.CreateDefaultContext()
    other.SetTimeStateAndParametersFrom(context)
    converted.FixInputPortsFrom(made.diagram, context, other)
    x = context.get_continuous_state_vector().CopyToVector()
    directions = np.random.default_rng(6).normal(size=(len(x), 4))
    seeded = np.array([AutoDiffXd(value, row) for value, row in zip(x, directions, strict=True)])
    other.SetContinuousState(seeded)
    rates = converted.EvalTimeDerivatives(other).CopyToVector()
    known, actual = made.diagram.EvalTimeDerivatives(context).CopyToVector(), ExtractGradient(rates)
    np.testing.assert_allclose(
        ExtractValue(rates).ravel(), known, rtol=1e-9, atol=1e-11 * np.abs(known).max()
    )
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
            np.testing.assert_allclose(
                exact, difference, rtol=1e-4, atol=1e-5 * np.abs(difference).max()
            )


def test_a_patch_under_the_intact_foot_alone_raises_its_force_alone(subject):
    ground = Ground(
        patches=(GroundPatch(), GroundPatch(name="kerb", from_y_m=0.02, height_m=0.003))
    )
    model = ModelParameters()
    rubber = replace(model.intact_foot.friction, mu_static=0.9, mu_kinetic=0.7)
    model = replace(model, intact_foot=replace(model.intact_foot, friction=rubber))
    level, kerb = (make_gait(subject, model, g) for g in (Ground(), ground))
    (one, intact), (two, raised) = (
        [g.diagram.GetOutputPort(name).Eval(context) for name in ("grf", "intact_grf")]
        for g in (level, kerb)
        for context in [stood(g)]
    )
    assert raised[2] > intact[2] + 50.0
    np.testing.assert_array_equal(one, two)
    for name, friction in (("prosthetic", model.foot.friction), ("intact", rubber)):
        forces = kerb.forces[name]
        np.testing.assert_array_equal(
            forces.GetParameter(forces.CreateDefaultContext(), "mu_kinetic"),
            [friction.mu_kinetic] * 2,
        )
