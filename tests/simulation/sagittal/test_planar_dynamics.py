"""The planar tree against the plant that it is read from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.tree import BodyIndex, MultibodyForces

from vsf_drake.errors import InputError
from vsf_drake.laws.kelvin_voigt import normal_force
from vsf_drake.laws.stick_slip import friction_force
from vsf_drake.parameters import ModelParameters
from vsf_drake.simulation.sagittal.model import SagittalModel, Smoothing
from vsf_drake.simulation.walk import Walker

SHARP = Smoothing(depth_m=1e-6, rate_m_per_s=1e-6, friction_velocity_m_per_s=1e-6)


def spheres_of(walker, foot):
    return walker.gait.person.foot.sites if foot == "prosthetic" else walker.gait.person.intact_sites


def test_inverse_dynamics_are_the_plants(person, drawn, plant_state):
    """Gravity included; nothing else acts."""
    walker, model = person
    at = drawn(model, 12, seed=1)
    motion = model.motion(*at.all)
    found = model.dynamics.joint_forces(motion, model.dynamics.of_carried(model.dynamics.inertial(motion)))
    plant = walker.gait.plant
    for i in range(12):
        context, indices = plant_state(walker, model, at, i)
        forces, acceleration = MultibodyForces(plant), np.zeros(plant.num_velocities())
        plant.CalcForceElementsContribution(context, forces)
        acceleration[indices[:8]] = at.a[:, i]
        known = plant.CalcInverseDynamics(context, acceleration, forces)
        np.testing.assert_allclose(found[:20, i], known[indices], atol=1e-12 * np.abs(known).max())


def test_ground_acts_as_the_laws_say_on_the_plants_spheres(person, drawn, plant_state):
    """Slow enough that friction sticks: its fall beyond the threshold is not in the smooth law."""
    walker, model = person
    at = drawn(model, 12, seed=2, speed=0.01)
    at.p[1] = 1.0
    y = dict(zip(model.outputs, model.evaluate(*at.all, SHARP), strict=True))
    plant, loaded = walker.gait.plant, 0
    for i in range(12):
        context, _ = plant_state(walker, model, at, i)
        for foot in ("prosthetic", "intact"):
            sites = spheres_of(walker, foot)
            wrench = np.zeros(3)
            for index, p, radius, k, n, b, full in zip(
                    sites.body_indices, sites.p_BS, sites.radius, sites.stiffness, sites.exponent, sites.damping,
                    sites.full_damping_depth, strict=True):
                body = plant.get_body(BodyIndex(int(index)))
                X_WB, V_WB = body.EvalPoseInWorld(context), body.EvalSpatialVelocityInWorld(context)
                x, _, z = X_WB @ p
                velocity = V_WB.translational() + np.cross(V_WB.rotational(), X_WB.rotation() @ p)
                slip = velocity[0] - V_WB.rotational()[1] * radius
                fz = float(normal_force(max(radius - z, 0.0), -velocity[2], stiffness=k, exponent=n, damping=b,
                                        full_damping_depth=full))
                assert abs(slip) < 0.08 or fz == 0.0
                fx = friction_force(np.array([slip, 0.0]), fz, mu_static=0.5, mu_kinetic=0.3, threshold_velocity=0.1)[0]
                wrench += [fx, fz, (z - radius) * fx - x * fz]
            found = np.array([y[f"{foot}_{part}"][i] for part in ("fx", "fz", "my")])
            # A micrometre at some 1e6 N/m in all.
            np.testing.assert_allclose(found, wrench, atol=1.0)
            loaded += wrench[1] > 100.0
    assert loaded >= 8


def test_power_below_the_shank_is_that_of_the_ground_at_the_shanks_point_over_it(person, drawn, plant_state):
    """At the centre of pressure the ground has a force and no moment."""
    walker, model = person
    at = drawn(model, 12, seed=3)
    y = dict(zip(model.outputs, model.evaluate(*at.all, Smoothing()), strict=True))
    shank = walker.gait.plant.GetBodyByName(f"shank_{walker.subject.prosthetic_side}")
    tested = 0
    for i in range(12):
        fx, fz, my = (y[f"prosthetic_{part}"][i] for part in ("fx", "fz", "my"))
        if fz < 50.0:
            continue
        context, _ = plant_state(walker, model, at, i)
        X_WS, V_WS = shank.EvalPoseInWorld(context), shank.EvalSpatialVelocityInWorld(context)
        cop = np.array([-my / fz, 0.0, 0.0])
        v = V_WS.translational() + np.cross(V_WS.rotational(), cop - X_WS.translation())
        assert y["prosthesis_power"][i] == pytest.approx(fx * v[0] + fz * v[2], rel=1e-9, abs=1e-9)
        tested += 1
    assert tested >= 5


def test_prosthesis_turned_out_of_the_plane_is_refused(walker):
    subject = replace(walker("right").subject, prosthesis_toe_out_rad=0.1)
    with pytest.raises(InputError, match=r"turned out of the sagittal plane by 5\.7 deg"):
        SagittalModel(Walker(subject, ModelParameters()))


def test_shift_of_a_coordinate_is_refused(walker):
    with pytest.raises(InputError, match="shifts no coordinate"):
        SagittalModel(walker("right"), values={"coordinate.knee_angle_r": 0.01})
