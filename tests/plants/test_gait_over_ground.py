"""The person over a ground of patches, and on the plane as separate systems have it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vsf_drake.ground import Ground, GroundPatch
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.plants.gait import make_gait
from vsf_drake.systems import GroundReaction, KelvinVoigtContact, StickSlipFriction

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


def separate_systems(gait, context, sites, friction):
    """The outputs of one foot on the plane z = 0 by a system for each force, at the plant's state."""
    place = {"body_indices": sites.body_indices, "p_BS": sites.p_BS, "radius": sites.radius}
    contact = KelvinVoigtContact(**place, **sites.law)
    slip = StickSlipFriction(**place, mu_static=friction.mu_static, mu_kinetic=friction.mu_kinetic,
                             threshold_velocity=friction.threshold_velocity_m_per_s)
    inputs = dict(outputs(gait.plant, gait.plant_context(context), ("body_poses", "body_spatial_velocities")))
    found = {}
    for system, names in ((contact, ("normal_force", "depth")), (slip, ("friction_force",)),
                          (GroundReaction(**place), ("grf", "cop", "free_moment"))):
        own = system.CreateDefaultContext()
        for i in range(system.num_input_ports()):
            port = system.get_input_port(i)
            port.FixValue(own, found[port.get_name()] if port.get_name() in found else inputs[port.get_name()])
        found |= dict(outputs(system, own, names))
    return found


def outputs(system, context, names):
    return ((name, system.GetOutputPort(name).Eval(context)) for name in names)


def test_a_person_has_on_the_plane_the_forces_of_the_separate_systems():
    model = ModelParameters()
    rubber = replace(model.intact_foot.friction, mu_static=0.9, mu_kinetic=0.7)
    model = replace(model, intact_foot=replace(model.intact_foot, friction=rubber))
    gait = make_gait(SUBJECT, model)
    context = standing(gait)
    for prefix, sites, friction in (("", gait.person.foot.sites, model.foot.friction),
                                    ("intact_", gait.person.intact_sites, rubber)):
        expected = separate_systems(gait, context, sites, friction)
        assert expected["grf"][2] > 100.0
        for name in FOOT:
            found = gait.diagram.GetOutputPort(prefix + name).Eval(context)
            np.testing.assert_allclose(found, expected[name], rtol=1e-9, atol=1e-9, err_msg=name)


def test_a_patch_under_the_intact_foot_alone_raises_its_force_alone():
    ground = Ground(patches=(GroundPatch(), GroundPatch(name="kerb", from_y_m=0.02, height_m=0.003)))
    level, kerb = (make_gait(SUBJECT, ModelParameters(), g) for g in (Ground(), ground))
    one, two = (values(g.diagram, standing(g), ("grf", "intact_grf")) for g in (level, kerb))
    assert two["intact_grf"][2] > one["intact_grf"][2] + 50.0
    np.testing.assert_array_equal(one["grf"], two["grf"])
