"""Contact, friction and reaction of spheres on the plane against the laws by hand; the machine's platen; a plant's own
contact results."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.ground import Ground, GroundPatch
from vsf_drake.laws.kelvin_voigt import normal_force
from vsf_drake.laws.stick_slip import friction_force
from vsf_drake.parameters import FootParameters
from vsf_drake.plants import add_foot, add_ground_geometry, wire_foot
from vsf_drake.systems import GroundReaction, KelvinVoigtContact, StickSlipFriction, TestingMachine

FOAM = {"stiffness": np.array([2e4, 3e4, 2e4, 1e4, 5e4]), "exponent": np.array([1.0, 1.5, 1.0, 1.2, 1.0]),
        "damping": np.full(5, 1e3), "full_damping_depth": np.full(5, 2e-3)}
SLIP = {"mu_static": 0.5, "mu_kinetic": 0.3, "threshold_velocity": 0.1}
BALL = {"stiffness": 54.8e3, "exponent": 1.0, "damping": 100.0, "full_damping_depth": 1e-4}
LOAD = np.array([100.0, 0.0, 250.0, 30.0, 400.0])
Z = np.array([0.0, 0.0, 1.0])
HEIGHT_M = 0.2


def made(kind, rig, **changes):
    balls = {} if kind is TestingMachine else {"radius": rig.radius}
    return kind(**({"body_indices": rig.site_bodies, "p_BS": rig.p_BS} | balls | changes))


def assert_applied(rig, context, applied, points, forces):
    """The spatial forces are `forces` at `points` in W, summed over each body."""
    expected = {}
    for body, p, f_W in zip(rig.site_bodies, points, forces, strict=True):
        expected[body] = expected.get(body, np.zeros(6)) + np.concatenate((np.cross(p, f_W), f_W))
    actual = rig.wrench_about_origin(context, applied)
    assert actual.keys() == expected.keys()
    for body, wrench in expected.items():
        np.testing.assert_allclose(actual[body], wrench, rtol=1e-10, atol=1e-9)


@pytest.mark.parametrize("height", [0.0, 0.3])
def test_normal_forces_are_the_law_of_each_sphere_at_its_contact_point(rig, evaluate, height):
    system = made(KelvinVoigtContact, rig, **FOAM, ground_height=height)
    for seed in range(3):
        context = rig.context(seed, height=0.02 + height)
        p_WS, v_WS, _ = rig.points(context)
        out = evaluate(system, context)
        depth = np.maximum(0.0, rig.radius + height - p_WS[:, 2])
        assert np.any(depth > 0)
        np.testing.assert_allclose(out["depth"], depth, atol=1e-15)
        np.testing.assert_allclose(out["depth_rate"], -v_WS[:, 2], atol=1e-14)
        expected = [float(normal_force(depth[i], -v_WS[i, 2], **{name: value[i] for name, value in FOAM.items()}))
                    for i in range(5)]
        np.testing.assert_allclose(out["normal_force"], expected, rtol=1e-10, atol=1e-10)
        points = p_WS - rig.radius[:, None] * Z
        assert_applied(rig, context, out["spatial_forces"], points, out["normal_force"][:, None] * Z)


def test_printed_unloading_branch_is_an_option_and_wrong_arguments_are_refused(rig, evaluate):
    context = rig.context(1)
    leaving = rig.points(context)[1][:, 2] > 0
    out = evaluate(made(KelvinVoigtContact, rig, **FOAM | {"exponent": 2.0}, unloading="printed"), context)
    assert np.any(leaving & (out["depth"] > 0))
    np.testing.assert_allclose(out["normal_force"][leaving], (FOAM["stiffness"] * out["depth"])[leaving], rtol=1e-12)
    for change, message in (({"stiffness": np.ones(3)}, "stiffness must have shape"), ({"unloading": "no"}, "unload")):
        with pytest.raises(ValueError, match=message):
            made(KelvinVoigtContact, rig, **FOAM | change)


@pytest.mark.parametrize("smooth", [False, True])
def test_friction_is_the_law_at_the_slip_of_the_full_radius(rig, evaluate, smooth):
    """Slip (v_x - w_y R, v_y + w_x R) of each sphere; it acts at the contact points."""
    for seed in range(3):
        context = rig.context(seed)
        p, v, w = rig.points(context)
        slip = np.stack((v[:, 0] - w[:, 1] * rig.radius, v[:, 1] + w[:, 0] * rig.radius), axis=1)
        out = evaluate(made(StickSlipFriction, rig, **SLIP, smooth=smooth), context, normal_force=LOAD)
        expected = np.column_stack((friction_force(slip, LOAD, **SLIP, smooth=smooth), np.zeros(5)))
        np.testing.assert_allclose(out["friction_force"].reshape(5, 3), expected, rtol=1e-9, atol=1e-10)
        assert_applied(rig, context, out["spatial_forces"], p - rig.radius[:, None] * Z, expected)


def loads(seed):
    rng = np.random.default_rng(seed)
    normal, friction = rng.uniform(0.0, 300.0, 5), np.zeros((5, 3))
    friction[:, :2] = 0.3 * normal[:, None] * rng.uniform(-1.0, 1.0, (5, 2))
    return normal, friction


@pytest.mark.parametrize("ground_height", [0.0, 0.3])
def test_moment_of_all_forces_about_the_centre_of_pressure_is_the_free_moment(rig, evaluate, ground_height):
    for seed in range(4):
        context, (normal, friction) = rig.context(seed), loads(seed)
        out = evaluate(made(GroundReaction, rig, ground_height=ground_height), context, normal_force=normal,
                       friction_force=friction.ravel())
        force, points = friction + normal[:, None] * Z, rig.points(context)[0] - rig.radius[:, None] * Z
        moment = sum(np.cross(p - out["cop"], f) for p, f in zip(points, force, strict=True))
        np.testing.assert_allclose(moment, [0.0, 0.0, out["free_moment"][0]], atol=1e-10)
        np.testing.assert_allclose(out["grf"], force.sum(axis=0), rtol=1e-12)
        assert out["cop"][2] == ground_height
        mean = normal @ points[:, :2] / normal.sum()  # from which it is at most friction coefficient times depth
        deepest = np.abs(points[:, 2] - ground_height).max()
        assert np.linalg.norm(out["cop"][:2] - mean) <= 0.3 * np.sqrt(2) * deepest
    out = evaluate(made(GroundReaction, rig), rig.context(), normal_force=np.zeros(5), friction_force=np.zeros(15))
    assert not any(np.any(value) for value in out.values())


def test_platen_is_a_spring_and_damper_to_each_site_and_pushes_it_upwards(rig, evaluate):
    machine = made(TestingMachine, rig, **BALL)
    for seed, speed in ((1, 0.0), (2, 0.2)):
        context = rig.context(seed)
        p_WS, v_WS, _ = rig.points(context)
        top = p_WS[:, 2].max() + 1e-3
        out = evaluate(machine, context, platen=[top, speed])
        force = 54.8e3 * (top - p_WS[:, 2]) + 100.0 * np.maximum(speed - v_WS[:, 2], 0.0)
        assert out["load"][0] == pytest.approx(force.sum(), rel=1e-10)
        assert_applied(rig, context, out["spatial_forces"], p_WS, force[:, None] * Z)
        middle = float(np.median(p_WS[:, 2]))
        np.testing.assert_allclose(evaluate(machine, context, platen=[middle, speed])["depth"],
                                   np.maximum(0.0, middle - p_WS[:, 2]), atol=1e-15)
    assert evaluate(machine, rig.context(), platen=[-1.0, 5.0])["load"][0] == 0.0


@pytest.mark.parametrize("contact", ["drake_point", "hydroelastic"])
def test_reaction_read_from_drakes_contact_results_is_the_rate_of_momentum_beside_the_weight(contact):
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
    F, cop, (free_moment,) = (reaction.GetOutputPort(name).Eval(reaction.GetMyContextFromRoot(root))
                              for name in ("grf", "cop", "free_moment"))
    weight = plant.CalcTotalMass(own) * plant.gravity_field().gravity_vector()
    arm = plant.CalcCenterOfMassPositionInWorld(own)
    state, rates = root.get_continuous_state_vector().CopyToVector(), diagram.EvalTimeDerivatives(root).CopyToVector()

    def momentum(seconds):
        root.SetContinuousState(state + seconds * rates)
        return plant.CalcSpatialMomentumInWorldAboutPoint(own, np.zeros(3)).get_coeffs()

    rate = (momentum(1e-6) - momentum(-1e-6)) / 2e-6
    np.testing.assert_allclose(F, rate[3:] - weight, atol=1e-5 * F[2])
    about_origin = np.cross(cop, F) + np.array([0.0, 0.0, free_moment])
    np.testing.assert_allclose(about_origin, rate[:3] - np.cross(arm, weight), atol=1e-5 * F[2])
    assert cop[2] == pytest.approx(HEIGHT_M, abs=1e-6)
    assert F[2] > 50.0 and np.hypot(F[0], F[1]) > 10.0 and abs(free_moment) > 0.1
