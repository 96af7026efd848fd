from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.laws.kelvin_voigt import normal_force
from vsf_drake.systems import KelvinVoigtContact

LAW = {"stiffness": np.array([2e4, 3e4, 2e4, 1e4, 5e4]), "exponent": np.array([1.0, 1.5, 1.0, 1.2, 1.0]),
       "damping": np.full(5, 1e3), "full_damping_depth": np.full(5, 2e-3)}


def make(rig, **changes):
    return KelvinVoigtContact(
        body_indices=rig.site_bodies, p_BS=rig.p_BS, radius=rig.radius, **(LAW | changes))


def test_ports_have_their_names(rig, port_names):
    assert port_names(make(rig)) == (
        ["body_poses", "body_spatial_velocities"], ["normal_force", "depth", "depth_rate", "spatial_forces"])


@pytest.mark.parametrize("seed", range(5))
def test_outputs_equal_the_law_applied_to_each_sphere_by_hand(rig, evaluate, seed):
    context = rig.context(seed)
    p_WS, v_WS, _ = rig.points(context)
    out = evaluate(make(rig), context)
    depth = np.array([max(0.0, r - p[2]) for r, p in zip(rig.radius, p_WS, strict=True)])
    assert np.any(depth > 0)
    np.testing.assert_allclose(out["depth"], depth, atol=1e-15)
    np.testing.assert_allclose(out["depth_rate"], -v_WS[:, 2], atol=1e-14)
    expected = [
        float(normal_force(depth[i], -v_WS[i, 2], **{name: value[i] for name, value in LAW.items()}))
        for i in range(5)]
    np.testing.assert_allclose(out["normal_force"], expected, rtol=1e-10, atol=1e-10)


def test_forces_act_upward_at_the_contact_points(rig, evaluate):
    context = rig.context(1)
    p_WS, _, _ = rig.points(context)
    out = evaluate(make(rig), context)
    expected = {}
    for body, p, radius, force in zip(rig.site_bodies, p_WS, rig.radius, out["normal_force"], strict=True):
        f_W = np.array([0.0, 0.0, force])
        wrench = np.concatenate((np.cross(p - [0.0, 0.0, radius], f_W), f_W))
        expected[body] = expected.get(body, np.zeros(6)) + wrench
    actual = rig.wrench_about_origin(context, out["spatial_forces"])
    assert actual.keys() == expected.keys()
    for body, wrench in expected.items():
        np.testing.assert_allclose(actual[body], wrench, rtol=1e-12, atol=1e-10)


def test_raised_ground_is_the_same_as_a_lowered_foot(rig, evaluate):
    lowered = evaluate(make(rig), rig.context(2, height=0.01))
    raised = evaluate(make(rig, ground_height=0.01), rig.context(2, height=0.02))
    np.testing.assert_allclose(raised["normal_force"], lowered["normal_force"], rtol=1e-9, atol=1e-9)


def test_scalars_stand_for_equal_values_at_all_sites(rig, evaluate):
    context = rig.context()
    one = evaluate(make(rig, stiffness=2e4), context)
    all_ = evaluate(make(rig, stiffness=np.full(5, 2e4)), context)
    np.testing.assert_array_equal(one["normal_force"], all_["normal_force"])


def test_printed_unloading_branch_is_an_option(rig, evaluate):
    context = rig.context(1)
    _, v_WS, _ = rig.points(context)
    out = evaluate(make(rig, exponent=2.0, unloading="printed"), context)
    leaving = v_WS[:, 2] > 0
    assert np.any(leaving & (out["depth"] > 0))
    np.testing.assert_allclose(
        out["normal_force"][leaving], (LAW["stiffness"] * out["depth"])[leaving], rtol=1e-12)


def test_wrong_arguments_are_refused(rig):
    with pytest.raises(ValueError, match="stiffness must have shape"):
        make(rig, stiffness=np.ones(3))
    with pytest.raises(ValueError, match="unloading"):
        make(rig, unloading="none")


def test_settled_contact_force_equals_weight():
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    ball = plant.AddRigidBody("ball", SpatialInertia(2.0, [0, 0, 0], UnitInertia.SolidSphere(0.05)))
    plant.AddJoint(PrismaticJoint("z", plant.world_frame(), ball.body_frame(), [0, 0, 1]))
    plant.Finalize()
    contact = builder.AddSystem(KelvinVoigtContact(
        body_indices=[ball.index()] * 3, p_BS=np.zeros((3, 3)), radius=0.05, stiffness=[1e4, 2e4, 4e6],
        exponent=[1.0, 1.0, 2.0], damping=200.0, full_damping_depth=1e-3))
    for name in ("body_poses", "body_spatial_velocities"):
        builder.Connect(plant.GetOutputPort(name), contact.GetInputPort(name))
    builder.Connect(contact.GetOutputPort("spatial_forces"), plant.get_applied_spatial_force_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    ResetIntegratorFromFlags(simulator, "implicit_euler", 0.01)
    context = simulator.get_mutable_context()
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), [0.06])
    simulator.AdvanceTo(3.0)
    force = contact.GetOutputPort("normal_force").Eval(contact.GetMyContextFromRoot(context))
    assert force.sum() == pytest.approx(2.0 * 9.81, rel=1e-4)
    assert force.min() > 0.0
