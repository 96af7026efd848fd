"""Normal forces on the plane and the machine's platen against the laws by hand. Friction and
reaction are in test_foot_forces, where one system does the same in another way."""

from __future__ import annotations

import numpy as np
import pytest
from foot_forces_apart import KelvinVoigtContact
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialVelocity

from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.laws.kelvin_voigt import normal_force
from vsf_drake.systems import TestingMachine
from vsf_drake.systems.contact import _on_plane

X_WB = RigidTransform(RollPitchYaw(0.1, -0.2, 0.5), [0.3, 0.1, 0.02])
w_WB, v_WB = np.array([0.4, -1.0, 0.3]), np.array([0.1, 0.05, -0.06])
p_BS = np.array([[0.02, 0.01, 0.0], [-0.03, 0.02, 0.01], [0.0, 0.0, 0.5]])
RADIUS = np.array([0.03, 0.05, 0.02])
FOAM = {
    "stiffness": np.array([2e4, 3e4, 5e4]),
    "exponent": np.array([1.0, 1.5, 2.0]),
    "damping": np.full(3, 1e3),
    "full_damping_depth": np.full(3, 2e-3),
}


def evaluate(system, v=v_WB, **inputs):
    """Every output by name; the sites are on one body, with the moment and force at its origin
    summed."""
    context = system.CreateDefaultContext()
    for name, value in (
        ("body_poses", X_WB),
        ("body_spatial_velocities", SpatialVelocity(w_WB, v)),
    ):
        system.GetInputPort(name).FixValue(context, AbstractValue.Make([value]))
    for name, value in inputs.items():
        system.GetInputPort(name).FixValue(context, value)
    ports = [system.get_output_port(i) for i in range(system.num_output_ports())]
    out = {port.get_name(): port.Eval(context) for port in ports}
    return out | {"wrench": sum(force.F_Bq_W.get_coeffs() for force in out["spatial_forces"])}


def kinematics(v=v_WB):
    """p_BoS_W, and z and its rate of each site."""
    arms = p_BS @ X_WB.rotation().matrix().T
    return arms, X_WB.translation()[2] + arms[:, 2], v[2] + np.cross(w_WB, arms)[:, 2]


def about_origin(arms, force):
    upward = np.outer(force, [0.0, 0.0, 1.0])
    return np.append(np.cross(arms, upward).sum(axis=0), upward.sum(axis=0))


@pytest.mark.parametrize("rise", [-0.06, 0.3])
def test_normal_forces_are_the_law_of_each_sphere(rise):
    v = np.array([0.1, 0.05, rise])
    arms, z, rate = kinematics(v)
    depth = np.maximum(0.0, RADIUS + 0.01 - z)
    assert (depth > 0).tolist() == [True, True, False] and (rate[:2] * rise > 0).all()
    system = KelvinVoigtContact(
        body_indices=[0] * 3,
        p_BS=p_BS,
        radius=RADIUS,
        **FOAM,
        ground_height=0.01,
    )
    out, force = evaluate(system, v), normal_force(depth, -rate, LawConstants(**FOAM))[0]
    for name, value in (
        ("depth", depth),
        ("depth_rate", -rate),
        ("normal_force", force),
        ("wrench", about_origin(arms, force)),
    ):
        np.testing.assert_allclose(out[name], value, rtol=1e-12, atol=1e-12, err_msg=name)
    for change, message in (({"stiffness": np.ones(2)}, "stiffness must have shape"),):
        with pytest.raises(ValueError, match=message):
            KelvinVoigtContact(
                **{"body_indices": [0] * 3, "p_BS": p_BS, "radius": RADIUS} | FOAM | change
            )


@pytest.mark.parametrize("speed", [0.0, 0.2])
def test_platen_is_a_spring_and_damper_to_each_site_and_pushes_it_upwards(speed):
    machine = TestingMachine(
        body_indices=[0] * 3,
        p_BS=p_BS,
        stiffness=54.8e3,
        exponent=1.0,
        damping=100.0,
        full_damping_depth=1e-4,
    )
    arms, z, rate = kinematics()
    out, depth = evaluate(machine, platen=[0.04, speed]), np.maximum(0.04 - z, 0.0)
    force = 54.8e3 * depth + 100.0 * np.maximum(speed - rate, 0.0) * (depth > 0)
    assert (depth > 0).sum() == 2
    np.testing.assert_allclose(out["depth"], depth, atol=1e-15)
    assert out["load"][0] == pytest.approx(force.sum(), rel=1e-12)
    np.testing.assert_allclose(out["wrench"], about_origin(arms, force), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("pull", [1.0, -1.0])
def test_a_plate_has_a_centre_of_pressure_under_a_force_that_pulls_too(pull):
    """The point of the plane through which the force goes; none where the force goes along it."""
    point = np.array([0.3, -0.2, 0.1])
    force = pull * np.array([40.0, 10.0, 200.0])
    out = _on_plane(force, np.cross(point, force), 0.1)
    np.testing.assert_allclose(out["cop"], point, atol=1e-12)
    np.testing.assert_allclose(out["free_moment"], 0.0, atol=1e-12)


def test_no_load_and_a_level_force_have_no_centre_of_pressure_and_are_told_apart():
    nothing = _on_plane(np.zeros(3), np.zeros(3), 0.0)
    np.testing.assert_array_equal(np.concatenate([*nothing.values()]), 0.0)
    level = _on_plane(np.array([40.0, 0.0, 0.0]), np.array([0.0, 4.0, 0.0]), 0.1)
    assert level["grf"][0] == 40.0 and np.isnan(level["cop"]).all()
    assert np.isnan(level["free_moment"]).all()
