"""The person over a ground of patches: on the plane it is the person of the separate systems."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vsf_drake.ground import Ground, GroundPatch
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.plants.gait import make_gait, make_gait_over

SUBJECT = Subject(mass_kg=78, stature_m=1.81, sex="male", prosthetic_side="right")
STANDING_M = 0.93
"""Pelvis height at which both feet of SUBJECT are in the ground."""
FOOT = ("grf", "cop", "free_moment", "normal_force", "depth", "friction_force")


def values(diagram, context, ports):
    return {name: diagram.GetOutputPort(name).Eval(context) for name in ports}


def standing(gait):
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


def test_a_person_over_patches_has_on_the_plane_the_forces_of_the_separate_systems():
    ports = (*FOOT, *(f"intact_{name}" for name in FOOT), "support_force", "socket_wrench", "driver_force")
    model = ModelParameters()
    rubber = replace(model.intact_foot.friction, mu_static=0.9, mu_kinetic=0.7)
    model = replace(model, intact_foot=replace(model.intact_foot, friction=rubber))
    plane, patches = make_gait(SUBJECT, model), make_gait_over(SUBJECT, model, Ground())
    contexts = standing(plane), standing(patches)
    one, two = values(plane.diagram, contexts[0], ports), values(patches.diagram, contexts[1], ports)
    assert one["grf"][2] > 100.0
    assert one["intact_grf"][2] > 100.0
    for name, value in one.items():
        np.testing.assert_allclose(two[name], value, rtol=1e-9, atol=1e-9, err_msg=name)
    rates = [gait.diagram.EvalTimeDerivatives(context).CopyToVector() for gait, context in
             zip((plane, patches), contexts, strict=True)]
    np.testing.assert_allclose(rates[1], rates[0], rtol=1e-9, atol=1e-9 * np.abs(rates[0]).max())


def test_a_patch_under_the_intact_foot_alone_raises_its_force_alone():
    ground = Ground(patches=(GroundPatch(), GroundPatch(name="kerb", from_y_m=0.02, height_m=0.003)))
    level, kerb = (make_gait_over(SUBJECT, ModelParameters(), g) for g in (Ground(), ground))
    one, two = (values(g.diagram, standing(g), ("grf", "intact_grf")) for g in (level, kerb))
    assert two["intact_grf"][2] > one["intact_grf"][2] + 50.0
    np.testing.assert_array_equal(one["grf"], two["grf"])
