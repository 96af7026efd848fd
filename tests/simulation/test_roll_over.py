"""The foot pressed and rolled alone: closed forms, statics, Drake's own Simulator, and honest
failure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import SimulatorConfig
from pydrake.systems.framework import DiagramBuilder
from pydrake.trajectories import PiecewisePolynomial
from walk_over_ground import advance, drive

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.model.parameters import ContactZone, FootParameters
from vsf_drake.simulation.roll_over import (
    FOLLOWS_WITHIN,
    Rolling,
    RollOver,
    in_mount_frame,
    line_of_force,
    mount_path,
)
from vsf_drake.simulation.stepping.stepper import run_side_by_side

FOOT = FootParameters()
SLOW = 0.05 / 60.0


@pytest.fixture(scope="module")
def machine():
    return RollOver(FOOT, friction=False)


def press(machine, degrees, fulcrum=0.108, **changes):
    given = {"max_load_n": 600.0, "speed_m_per_s": SLOW, "steps_per_mm": 80.0} | changes
    return machine.press(fulcrum_m=fulcrum, pitch_rad=np.radians(degrees), **given)


def stance(n=600, largest_n=700.0):
    """A made-up profile: two humps, -15 to +25 degrees."""
    time = np.linspace(0.0, 0.6, n + 1)
    s = time / 0.6
    return (
        time,
        np.radians(-15.0 + 40.0 * s),
        largest_n * np.sin(np.pi * s) ** 1.5 * (1.0 - 0.2 * np.sin(np.pi * s)),
    )


def test_mount_over_level_ground_is_the_fixed_line_over_a_tilting_platform():
    """Against poses: the platform turns about the axis, its front down where the tilt is below
    zero."""
    for tilt, height in ((-0.3, 0.1), (0.0, 0.09), (0.5, 0.12)):
        X_TestPlatform = RigidTransform(RotationMatrix.MakeYRotation(-tilt), [0.0, 0.0, 0.0])
        front = X_TestPlatform @ np.array([0.2, 0.0, 0.0])
        assert np.sign(front[2]) == np.sign(tilt)
        X_PlatformMount = X_TestPlatform.inverse() @ RigidTransform([0.0, 0.0, height])
        x, z, pitch = mount_path(np.array([tilt]), np.array([height]))[0]
        np.testing.assert_allclose(X_PlatformMount.translation(), [x, 0.0, z], atol=1e-15)
        np.testing.assert_allclose(
            X_PlatformMount.rotation().matrix(),
            RotationMatrix.MakeYRotation(-pitch).matrix(),
            atol=1e-15,
        )
        up_W = X_PlatformMount.rotation() @ np.array([0.0, 0.0, 1.0])
        np.testing.assert_allclose(line_of_force(np.array([pitch]))[0], up_W, atol=1e-15)
        seen = X_PlatformMount.inverse() @ np.array([0.11, 0.0, 0.0])
        np.testing.assert_allclose(
            in_mount_frame(np.array([[0.11, 0.0, 0.0]]), np.array([[x, z, pitch]]))[0],
            seen[[0, 2]],
            atol=1e-15,
        )


def test_heel_at_15_degrees_is_its_spheres_in_parallel(machine):
    """Closed form: the spheres behind the rearmost fulcrum sit on the rigid frame; each bears k
    times its depth."""
    run = press(machine, 15.0)
    depth = machine.touch_height(np.radians(15.0))[0] - run.mount[:, 1]
    points = [
        (1e-3 * x, 1e-3 * rise + zone.radius_m, zone)
        for zone in FOOT.zones
        for x, rise in zip(zone.x_mm, zone.rise_mm, strict=True)
        if x < 66.0
    ]
    bottoms = np.array(
        [
            x * np.sin(np.radians(15.0)) + z * np.cos(np.radians(15.0)) - zone.radius_m
            for x, z, zone in points
        ]
    )
    expected = sum(
        zone.stiffness * np.maximum(depth - gap, 0.0) ** zone.exponent
        for gap, (*_, zone) in zip(bottoms - bottoms.min(), points, strict=True)
    )
    loading = np.arange(len(depth)) <= np.argmax(run.grf_W[:, 2])
    np.testing.assert_allclose(run.grf_W[loading, 2], expected[loading], rtol=1e-3, atol=0.5)
    assert expected.max() == pytest.approx(600.0, abs=3.0)


@pytest.mark.parametrize("degrees", [15.0, -20.0])
def test_drive_bears_the_moment_of_the_ground_about_the_mount(machine, degrees):
    run = press(machine, degrees)
    loaded = np.isfinite(run.cop_W[:, 0])
    force = run.grf_W[loaded]
    arm, height = run.cop_W[loaded, 0] - run.mount[loaded, 0], run.mount[loaded, 1]
    toe_up = arm * force[:, 2] + height * force[:, 0]
    np.testing.assert_allclose(run.load[loaded, 2], -toe_up, atol=0.02 * np.abs(toe_up).max())
    assert np.abs(run.load[loaded, 2] + toe_up).max() < 0.1
    np.testing.assert_allclose(run.load[loaded, 1], -force[:, 2], atol=0.1)


def test_simulator_gives_the_same_force():
    """Drake's own Simulator with error control, 12 mm of forefoot loading at 0.1 m/s, with the
    machine's own servos."""
    machine = RollOver(FOOT, friction=True)
    pitch, speed, travel, fulcrum = np.radians(-20.0), 0.1, 0.012, 0.108
    top = float(machine.touch_height(pitch)[0])
    time = np.linspace(0.0, travel / speed, 1201)
    run = machine.follow(
        fulcrum_m=fulcrum,
        time_s=time,
        mount=np.column_stack([0.3 * speed * time, top - speed * time, np.full_like(time, pitch)]),
    )
    made, builder = machine.machine, DiagramBuilder()
    builder.AddSystem(made.diagram)
    ends = np.array([[0.0, 0.3 * travel], [top, top - travel], [pitch, pitch]])
    drive(
        builder,
        "mount",
        PiecewisePolynomial.FirstOrderHold([0.0, time[-1]], ends),
        1,
        made.diagram.GetInputPort("desired_state"),
    )
    drive(
        builder,
        "fulcrum",
        PiecewisePolynomial(np.array([[fulcrum]])),
        0,
        made.diagram.GetInputPort("fulcrum_position"),
    )
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own, plant = made.plant.GetMyMutableContextFromRoot(context), made.plant
    for name, value, rate in (
        ("mount_forward", 0.0, 0.3 * speed),
        ("mount_up", top, -speed),
        (made.foot.carriage_joint_name, fulcrum, 0.0),
    ):
        plant.GetJointByName(name).set_translation(own, value)
        plant.GetJointByName(name).set_translation_rate(own, rate)
    plant.GetJointByName("mount_pitch").set_angle(own, pitch)
    grf = made.diagram.GetOutputPort("grf")
    inner = made.diagram.GetMyContextFromRoot(context)
    moments = np.array([0.04, 0.08, 0.12])
    config = SimulatorConfig(integration_scheme="radau3", accuracy=1e-4, max_step_size=2e-3)
    found, _ = advance(diagram, context, moments, lambda: grf.Eval(inner).copy(), config, None)
    mine = np.column_stack([np.interp(moments, run.time_s, column) for column in run.grf_W.T])
    np.testing.assert_allclose(mine, np.array(found), atol=0.01 * mine[-1, 2])
    assert abs(mine[-1, 0]) > 1.0


def test_rolled_foot_follows_a_profile(machine):
    time, tilt, force = stance()
    run, following = machine.roll(fulcrum_m=0.066, time_s=time, tilt_rad=tilt, force_n=force)
    assert following.follows
    assert following.residual_n < FOLLOWS_WITHIN * 700.0
    along = np.sum(run.grf_W * line_of_force(-tilt[1:]), axis=1)
    np.testing.assert_allclose(along, force[1:], atol=following.residual_n + 1e-9)
    np.testing.assert_allclose(run.mount[:, 2], -tilt[1:], atol=1e-12)
    assert run.unconverged_steps == 0


def test_feet_rolled_side_by_side_are_to_the_bit_what_each_is_alone_and_one_that_fails_fails_alone(
    machine,
):
    time, tilt, force = stance(300)
    cases = [
        Rolling(fulcrum_m=fulcrum, time_s=time, tilt_rad=tilt, force_n=share * force)
        for fulcrum, share in ((0.066, 1.0), (0.108, 1e3), (0.151, 0.6))
    ]
    together = machine.roll_side_by_side(cases)
    assert isinstance(together[1], SimulationError)
    for k in (0, 2):
        (alone,) = machine.roll_side_by_side([cases[k]])
        for of_all, own in zip(together[k], alone, strict=True):
            for name, value in vars(own).items():
                np.testing.assert_equal(getattr(of_all, name), value, err_msg=name)


def test_one_foot_is_rolled_without_the_loop_of_walks_side_by_side(machine, monkeypatch):
    """Which takes as long again to compile."""
    time, tilt, force = stance(300)
    taken = []

    def counted(runs, **more):
        taken.append(len(runs))
        return run_side_by_side(runs, **more)

    monkeypatch.setattr("vsf_drake.simulation.roll_over.run_side_by_side", counted)
    machine.roll(fulcrum_m=0.108, time_s=time, tilt_rad=tilt, force_n=force)
    assert max(taken) == 1


def test_feet_are_rolled_side_by_side_for_as_many_instants(machine):
    cases = []
    for steps in (300, 200):
        time, tilt, force = stance(steps)
        cases.append(Rolling(fulcrum_m=0.1, time_s=time, tilt_rad=tilt, force_n=force))
    with pytest.raises(InputError, match="cases: have from 201 to 301 instants"):
        machine.roll_side_by_side(cases)


@pytest.mark.parametrize("fulcrum", [0.066, 0.151])
def test_a_light_load_that_passes_from_heel_to_toe_is_followed_there_too(machine, fulcrum):
    """In mid-stance such a load leaves the heel within some milliseconds."""
    time, tilt, force = stance(largest_n=400.0)
    _, following = machine.roll(fulcrum_m=fulcrum, time_s=time, tilt_rad=tilt, force_n=force)
    assert following.follows


def test_rigid_sphere_rolls_on_an_arc_of_its_own_radius():
    """One stiff sphere of 0.2 m on the rigid frame: seen from the mount its contact runs along its
    own surface."""
    radius, stiffness = 0.2, 5e6
    ball = ContactZone(
        name="ball",
        x_mm=(50.0,),
        y_mm=(0.0,),
        rise_mm=(0.0,),
        radius_m=radius,
        stiffness=stiffness,
        damping_n_s_per_m=1e3,
    )
    machine = RollOver(replace(FOOT, zones=(ball,)), friction=False)
    time, tilt, force = stance(300)
    run, following = machine.roll(fulcrum_m=0.108, time_s=time, tilt_rad=tilt, force_n=force)
    assert following.follows
    seen = in_mount_frame(run.cop_W, run.mount)
    centre = np.array([0.05 - FOOT.pylon_x_m, radius - FOOT.build_height_m])
    loaded = np.isfinite(seen[:, 0])
    depth = run.grf_W[loaded, 2] / stiffness
    np.testing.assert_allclose(
        np.linalg.norm(seen[loaded] - centre, axis=1), radius - depth, atol=2e-5
    )


def test_foot_that_gives_way_is_a_failure_and_no_curve():
    soft = tuple(replace(zone, stiffness=1e-3 * zone.stiffness) for zone in FOOT.zones)
    with pytest.raises(SimulationError, match="gave way"):
        press(RollOver(replace(FOOT, zones=soft), friction=False), 15.0, steps_per_mm=5.0)


@pytest.mark.parametrize(
    ("name", "value"), [("max_load_n", np.nan), ("speed_m_per_s", -1.0), ("steps_per_mm", 0.0)]
)
def test_numbers_out_of_range_are_refused_by_name(machine, name, value):
    with pytest.raises(InputError, match=name):
        press(machine, 15.0, **{name: value})


def test_carriage_that_slides_under_a_foot_in_the_air_takes_its_own_inertia_alone(machine):
    """Nothing hangs on the carriage: m a along the keel, which is level. The mount bears that, too;
    the machine has no gravity."""
    time = 1e-3 * np.arange(101.0)
    high = np.column_stack([np.zeros(101), np.full(101, 0.5), np.zeros(101)])
    run = machine.along(0.108, time, high)
    acceleration = 3.0
    path = run.inputs.prescribed_q.copy()
    path[:, 3] += 0.5 * acceleration * time**2
    moved = replace(run, inputs=replace(run.inputs, prescribed_q=path))
    (record,) = run_side_by_side([moved])
    forward, _, _, carriage = machine.driven
    tree = machine.mechanism.tree
    mass = tree.inertias[tree.coordinate_bodies[carriage], 0]
    late = slice(60, None)
    np.testing.assert_allclose(record.load[late, carriage], mass * acceleration, rtol=1e-6)
    np.testing.assert_allclose(record.load[late, forward].mean(), mass * acceleration, rtol=0.05)
