"""The foot's MJCF, compiled by MuJoCo: the same rigid parts as `add_foot` in Drake, the same keel,
and a support."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_feet import UNUSUAL
from pressed_keel import (
    chain_stiffness,
    keel_names,
    rise_in_mujoco,
    stated_step_s,
    stepped_in_mujoco,
)
from pydrake.multibody.plant import MultibodyPlant

from vsf_drake.engines.mjcf import IMPRATIO, foot_mjcf
from vsf_drake.model.parameters import GRAVITY, FootParameters
from vsf_drake.mujoco import calibrate
from vsf_drake.plants import add_foot
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, keel_shape
from vsf_drake.simulation.roll_over import RollOver

mujoco = pytest.importorskip("mujoco")

NOMINAL = FootParameters()
FULCRUMS_M = (0.066, 0.108, 0.151)
AT_REST = 1e-9
"""Speed (rad/s) of a joint."""


def compiled(parameters, fulcrum_m, weight=False):
    model = mujoco.MjModel.from_xml_string(foot_mjcf(parameters, fulcrum_m=fulcrum_m))
    if not weight:
        model.opt.gravity[:] = 0.0
    return model


@pytest.fixture(params=[NOMINAL, UNUSUAL], ids=["nominal", "unusual"])
def posed(request):
    """(model, data, plant, context, names): one foot in MuJoCo and in Drake at the same random
    coordinates."""
    plant = MultibodyPlant(0.0)
    handles = add_foot(plant, plant.world_frame(), request.param)
    plant.Finalize()
    context, model = plant.CreateDefaultContext(), compiled(request.param, 0.108)
    data, rng, q = mujoco.MjData(model), np.random.default_rng(3), np.zeros(plant.num_positions())
    names = (*handles.keel_joint_names, handles.carriage_joint_name)
    for name, value in zip(names, [*rng.uniform(-0.3, 0.3, len(names) - 1), 0.141], strict=True):
        q[plant.GetJointByName(name).position_start()] = value
        data.qpos[model.joint(name).qposadr[0]] = value
    plant.SetPositions(context, q)
    mujoco.mj_forward(model, data)
    return model, data, plant, context, names


def matrix(quaternion):
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, quaternion)
    return R.reshape(3, 3)


def test_frames_masses_and_inertias_are_those_of_drake(posed):
    """Body by body, also the frame's moments, which no joint of this file feels; and as the joints
    feel all of it."""
    model, data, plant, context, names = posed
    for i in plant.GetBodyIndices(plant.GetModelInstanceByName("vsf")):
        body = plant.get_body(i)
        X_WB, inertia = body.EvalPoseInWorld(context), body.default_spatial_inertia()
        placed, known = data.body(body.name()), model.body(body.name())
        np.testing.assert_allclose(placed.xpos, X_WB.translation(), atol=1e-11, err_msg=body.name())
        np.testing.assert_allclose(placed.xmat.reshape(3, 3), X_WB.rotation().matrix(), atol=1e-11)
        assert known.mass[0] == pytest.approx(inertia.get_mass(), rel=1e-11)
        np.testing.assert_allclose(known.ipos, inertia.get_com(), atol=1e-12)
        moments = inertia.Shift(inertia.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
        R = matrix(known.iquat)
        np.testing.assert_allclose(R @ np.diag(known.inertia) @ R.T, moments, atol=1e-14)
    np.testing.assert_allclose(data.site("vsf_mount").xpos, 0.0, atol=1e-11)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    at = [model.joint(name).dofadr[0] for name in names]
    order = [plant.GetJointByName(name).velocity_start() for name in names]
    known = plant.CalcMassMatrix(context)[np.ix_(order, order)]
    np.testing.assert_allclose(full[np.ix_(at, at)], known, rtol=1e-8, atol=1e-12)


def test_dampers_foam_and_servo_have_their_numbers():
    model = compiled(NOMINAL, 0.108)
    joints = [model.joint(name) for name in keel_names(NOMINAL)[0]]
    stiffness, damping = (
        np.array([np.ravel(getattr(joint, name))[0] for joint in joints])
        for name in ("stiffness", "damping")
    )
    assert stiffness[0] == damping[0] == 0.0, "the pin at A is free"
    assert np.all(stiffness[1:] > 0)
    np.testing.assert_allclose(damping, NOMINAL.keel.damping_time_s * stiffness, rtol=1e-10)
    for name, field in (
        ("stiffness", "stiffness"),
        ("exponent", "exponent"),
        ("damping", "damping_n_s_per_m"),
    ):
        known = [getattr(zone, field) for zone in NOMINAL.zones for _ in zone.x_mm]
        np.testing.assert_allclose(model.numeric(f"sphere_{name}").data, known, rtol=1e-11)
    assert np.ravel(model.tendon_damping)[0] == pytest.approx(
        (NOMINAL.fulcrum.damping_time_s + model.opt.timestep) * NOMINAL.fulcrum.stiffness_n_per_m,
        rel=1e-10,
    )
    _, stiffness, damping = -model.actuator("fulcrum").biasprm[:3]
    assert damping**2 == pytest.approx(
        4.0 * stiffness * NOMINAL.fulcrum.carriage_mass_kg, rel=1e-10
    )


@pytest.mark.parametrize("fulcrum_m", PUBLISHED_FULCRUMS_M)
def test_held_keel_is_at_rest_after_a_second_where_the_bench_has_it(fulcrum_m):
    """At the file's own step and at twice that, with the spring and damper that it has there; after
    a strike."""
    model = compiled(NOMINAL, fulcrum_m)
    assert model.opt.timestep == stated_step_s(foot_mjcf(NOMINAL, fulcrum_m=fulcrum_m)) == 1e-3
    for load in (0.0, 400.0, 600.0):
        known = (
            keel_shape(NOMINAL, fulcrum_m=fulcrum_m, load_n=load).load_point_K[1] if load else 0.0
        )
        for model.opt.timestep in (1e-3, 2e-3):
            rise, speed = stepped_in_mujoco(model, NOMINAL, load)
            assert rise == pytest.approx(known, rel=5e-5, abs=1e-9), (load, model.opt.timestep)
            assert speed < AT_REST, (load, model.opt.timestep)


@pytest.mark.parametrize(
    "foot",
    [
        UNUSUAL,
        replace(NOMINAL, keel=replace(NOMINAL.keel, damping_time_s=2e-4)),
        replace(
            NOMINAL, fulcrum=replace(NOMINAL.fulcrum, stiffness_n_per_m=1e9, damping_time_s=0.0)
        ),
    ],
    ids=["unusual", "hardly damped keel", "rigid support"],
)
def test_another_foot_gets_the_step_that_it_needs(foot):
    """Its keel, struck and unloaded, comes to rest. That may take longer than a second, but it
    never grows."""
    model, step = compiled(foot, 0.108), stated_step_s(foot_mjcf(foot, fulcrum_m=0.108))
    assert model.opt.timestep == pytest.approx(step, rel=1e-9)
    for model.opt.timestep in (step, 2.0 * step):
        rise, speed = stepped_in_mujoco(model, foot, 0.0)
        assert abs(rise) < 1e-5
        assert speed < 1e-3


def dropped(fulcrum_m, step):
    """A leg of 60 kg on a rail, the foot under it, 20 mm above a floor."""
    spec = mujoco.MjSpec.from_string(foot_mjcf(NOMINAL, fulcrum_m=fulcrum_m))
    spec.delete(spec.key("rest"))  # without the rail's coordinate
    spec.option.timestep = step
    frame = spec.body("vsf_frame")
    frame.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    frame.add_body().add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.05, 0.05, 0.2],
        pos=[0.05, 0, 0.3],
        mass=60,
        contype=0,
        conaffinity=0,
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[1, 1, 0.1],
        pos=[0, 0, -NOMINAL.build_height_m - 0.02],
    )
    return spec.compile()


@pytest.mark.parametrize("calibrated", [False, True], ids=["MuJoCo's softness", "the foam's"])
@pytest.mark.parametrize("fulcrum_m", PUBLISHED_FULCRUMS_M)
def test_leg_of_sixty_kilograms_dropped_on_it_is_borne_at_every_step_alike(fulcrum_m, calibrated):
    """Its weight in the end, at rest; one peak whatever the step; and never more energy than it was
    let go with, that of the foam counted where it is known."""
    peaks = []
    for step in (1e-3, 2e-3):
        model = dropped(fulcrum_m, step)
        model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
        foam = np.zeros(model.ngeom)
        if calibrated:
            calibrate(model)
            spheres = [model.geom(f"foam_{i}").id for i in range(len(model.numeric(0).data))]
            foam[spheres] = model.numeric("sphere_stiffness").data
        data, total, energy = mujoco.MjData(model), [], []
        data.ctrl[:] = data.qpos[model.joint("fulcrum").qposadr[0]] = fulcrum_m
        for _ in range(round(1.5 / step)):
            mujoco.mj_step(model, data)
            total.append(data.efc_force[data.contact.efc_address].sum())  # the normal ones
            strain = 0.5 * foam[data.contact.geom].sum(axis=1) @ data.contact.dist**2
            energy.append(data.energy.sum() + strain)
        weight = (60.0 + NOMINAL.mass_kg) * GRAVITY
        assert np.abs(np.array(total[-100:]) - weight).max() < 1e-4 * weight
        assert max(energy) <= energy[0]
        peaks.append(max(total))
    assert max(peaks) == pytest.approx(min(peaks), rel=0.05)


@pytest.mark.parametrize("fulcrum_m", FULCRUMS_M)
def test_calibrated_foot_bears_a_fall_alike_with_every_integrator(fulcrum_m):
    """At twice the file's step, and within what another step changes: not calibrated, it bursts
    with Euler and with RK4."""
    peaks = []
    for integrator in ("mjINT_IMPLICITFAST", "mjINT_EULER", "mjINT_RK4"):
        model = dropped(fulcrum_m, 2e-3)
        model.opt.integrator = getattr(mujoco.mjtIntegrator, integrator)
        calibrate(model)
        data = mujoco.MjData(model)
        data.ctrl[:] = data.qpos[model.joint("fulcrum").qposadr[0]] = fulcrum_m
        total = []
        for _ in range(500):
            mujoco.mj_step(model, data)
            total.append(data.efc_force[data.contact.efc_address].sum())
        assert not sum(warning.number for warning in data.warning)
        assert total[-1] == pytest.approx((60.0 + NOMINAL.mass_kg) * GRAVITY, rel=1e-2)
        peaks.append(max(total))
    assert max(peaks) == pytest.approx(min(peaks), rel=0.05)


@pytest.mark.parametrize("fulcrum_m", FULCRUMS_M)
def test_small_loads_meet_the_stiffness_of_the_chain_and_large_ones_lift_the_toe_as_on_the_bench(
    fulcrum_m,
):
    """Between bench and file is the lean of a tendon of 10 m, whose end strays by some millimetres:
    its square."""
    known = chain_stiffness(NOMINAL, fulcrum_m, NOMINAL.load_point_m)
    model = compiled(NOMINAL, fulcrum_m)
    assert 1e-2 / rise_in_mujoco(model, NOMINAL, 1e-2) == pytest.approx(known, rel=1e-7)
    loads = np.array([200.0, 600.0])
    known = [
        keel_shape(NOMINAL, fulcrum_m=fulcrum_m, load_n=load).load_point_K[1] for load in loads
    ]
    np.testing.assert_allclose(
        [rise_in_mujoco(model, NOMINAL, load) for load in loads], known, rtol=5e-5
    )


@pytest.mark.parametrize("fulcrum_m", FULCRUMS_M)
def test_with_the_files_impratio_a_foot_creeps_as_with_its_own_friction_in_the_mean(fulcrum_m):
    """Of a roll-over under half a sine; its whole number is within 10 %."""
    time_s = np.linspace(0.0, 0.8, 201)
    share = time_s / 0.8
    run, _ = RollOver(NOMINAL, friction=False).roll(
        fulcrum_m=fulcrum_m,
        time_s=time_s,
        tilt_rad=np.radians(-17.0 + 37.0 * share),
        force_n=1138.0 * np.sin(np.pi * share),
    )
    load = run.sphere_normal_n
    both_ways = [0.5 * zone.damping_n_s_per_m for zone in NOMINAL.zones for _ in zone.x_mm]
    friction = NOMINAL.friction
    own = friction.mu_static / friction.threshold_velocity_m_per_s * load.sum()
    damping = ((load > 0.0) * both_ways).sum()
    assert IMPRATIO * damping == pytest.approx(own, rel=0.1)
    model = compiled(NOMINAL, fulcrum_m)
    assert model.opt.impratio == IMPRATIO


def test_spheres_meet_the_floor_and_not_one_another():
    """The foot free in a world with a floor 87 mm below the mount, less 1 mm: all spheres of the
    flat sole touch."""
    spec = mujoco.MjSpec.from_string(foot_mjcf(NOMINAL, fulcrum_m=0.108))
    spec.delete(spec.key("rest"))  # without the free joint's coordinates
    spec.body("vsf_frame").add_freejoint()
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[1, 1, 0.1],
        pos=[0, 0, -NOMINAL.build_height_m + 1e-3],
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    floor = model.geom("floor").id
    pairs = {tuple(contact.geom) for contact in data.contact}
    assert all(floor in pair for pair in pairs)
    assert len(pairs) == sum(len(zone.x_mm) for zone in NOMINAL.zones)


def test_of_a_passive_foot_nothing_moves_but_the_keel():
    """A carriage with a servo whose range is one place is one that MuJoCo does not limit."""
    clamp = replace(NOMINAL.fulcrum, rearmost_m=0.108, foremost_m=0.108)
    model = compiled(replace(NOMINAL, fulcrum=clamp), 0.108)
    joints = [model.joint(i).name for i in range(model.njnt)]
    assert joints == keel_names(NOMINAL)[0] and model.nu == 0
    assert model.key("rest").qpos == pytest.approx(0.0)
    total_kg = compiled(NOMINAL, 0.108).body_mass.sum()
    assert model.body_mass.sum() == pytest.approx(total_kg), "with what the carriage weighs"
