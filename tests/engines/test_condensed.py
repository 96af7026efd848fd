"""The condensed foot against the full one: at rest, as it is rolled over, and in MuJoCo."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest
from made_condensed import MADE_ERROR
from scipy.interpolate import CubicSpline
from scipy.optimize import fsolve

from vsf_drake.base.errors import InputError
from vsf_drake.device.roll_over import iso_22675
from vsf_drake.engines.condensed import PIECE_OF_STATION, PIECES, condense
from vsf_drake.engines.condensed_error import error_against_full
from vsf_drake.engines.condensed_files import condensed_csv, condensed_mjcf
from vsf_drake.engines.sagittal_foot import at_rest
from vsf_drake.model.parameters import GRAVITY, FootParameters
from vsf_drake.mujoco import calibrate
from vsf_drake.plants.rigid_foot import rigid_foot
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, keel_shape

NOMINAL = FootParameters()
BETWEEN_M = (0.076, 0.119, 0.14)
"""Positions at which nothing was fitted."""


def bent(at, load_n, x_m):
    """(2,) angles, and the rise (m), under a load along z_K on the point at `x_m` of the toe."""
    arms = np.array([at.hinge_m[1] - at.hinge_m[0], x_m - at.hinge_m[1]])

    def moments(q):
        levers = np.cumsum((arms * np.cos(np.cumsum(q)))[::-1])[::-1]
        return at.stiffness_nm_per_rad * q - load_n * levers

    q = fsolve(moments, np.zeros(2), xtol=1e-10)
    return q, float(np.sum(arms * np.sin(np.cumsum(q))))


@pytest.mark.parametrize("fulcrum_m", PUBLISHED_FULCRUMS_M)
def test_the_rise_of_the_load_point_equals_that_of_the_full_keel(condensed, fulcrum_m):
    """Within the 3 % that are asked of the force, at 100 to 600 N, the load of the bench."""
    for load in (100.0, 300.0, 600.0):
        full = keel_shape(NOMINAL, fulcrum_m=fulcrum_m, load_n=load).load_point_K[1]
        assert bent(condensed.at(fulcrum_m), load, NOMINAL.load_point_m)[1] == pytest.approx(
            full, rel=0.03
        )


def test_stations_touch_flat_ground_together_and_are_damped_as_their_spheres(condensed):
    sole = -(0.5 * NOMINAL.keel.thickness_m + NOMINAL.foam_thickness_m)
    zone = NOMINAL.zones[0]
    for station in condensed.stations:
        assert station.z_m - station.radius_m == pytest.approx(sole)
        damping = station.damping_n_s_per_m / station.stiffness
        assert damping == pytest.approx(zone.damping_n_s_per_m / zone.stiffness)


def test_hinges_move_forward_and_stiffen_with_the_fulcrum_and_keep_their_order(condensed):
    settings = [condensed.at(x) for x in np.linspace(0.066, 0.151, 40)]
    places = np.array([at.hinge_m for at in settings])
    stiffness = np.array([at.stiffness_nm_per_rad for at in settings])
    damping = np.array([at.damping_nm_s_per_rad for at in settings])
    assert (np.diff(places, axis=0) > 0.0).all()
    assert (np.diff(stiffness, axis=0) > 0.0).all()
    assert (places[:, 1] - places[:, 0] > 5e-3).all()
    assert (places[:, 1] < sum(NOMINAL.keel.element_lengths_m)).all()
    np.testing.assert_allclose(damping, NOMINAL.keel.damping_time_s * stiffness)


@pytest.mark.parametrize("fulcrum_m", [0.066, 0.151])
def test_it_weighs_what_the_full_foot_weighs_and_has_its_centre_of_mass(condensed, fulcrum_m):
    pieces = condensed.at(fulcrum_m).pieces
    mass = np.array([piece.mass_kg for piece in pieces])
    centre = mass @ np.array([piece.centre_m for piece in pieces]) / mass.sum()
    _, links = rigid_foot(NOMINAL)
    links[-1]["p_KB"] = np.array([fulcrum_m, 0.0, 0.0])  # the carriage
    full_mass = np.array([link["mass"] for link in links])
    full_centre = full_mass @ np.array([link["p_KB"] + link["p_BBcm"] for link in links])
    assert mass.sum() == pytest.approx(NOMINAL.mass_kg)
    np.testing.assert_allclose(centre, full_centre / full_mass.sum(), atol=1e-12)


def test_rolled_over_it_is_as_near_to_the_full_foot_as_is_asked(condensed):
    """Root mean squares within 3 % of the peak and 5 mm, energy within 5 %, also between the
    positions that it was fitted at. At one instant the centre of pressure is up to 8 mm off, when
    it runs forward by 10 mm in 1 ms; the force 7 % of a light person's, when the toe leaves."""
    error = error_against_full(condensed, fulcrums_m=BETWEEN_M, masses_kg=(40.0, 110.0))
    assert len(error.each) == 6
    for one in error.each:
        assert one.force_rms < 0.03
        assert one.centre_rms_m < 5e-3
        assert one.stored < 0.05
        assert one.returned < 0.05
    assert error.worst.force_largest < 0.08
    assert error.worst.centre_largest_m < 8e-3


def test_the_table_has_the_torques_of_both_hinges(condensed):
    text = condensed_csv(condensed, MADE_ERROR)
    lines = text.splitlines()
    head = [line for line in lines if line.startswith("#")]
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert "2.4 % of its peak root mean square, 7.0 % at one instant" in text
    assert sum(line.count(f",{piece},") for line in head for piece in PIECES) == len(
        PIECE_OF_STATION
    )
    assert {row["hinge"] for row in rows} == {"1", "2"}
    assert len({row["fulcrum_mm"] for row in rows}) == 18
    for row in rows[:: len(rows) // 50]:
        hinge = int(row["hinge"]) - 1
        at = condensed.at(1e-3 * float(row["fulcrum_mm"]))
        angle, rate = np.radians([float(row["angle_deg"]), float(row["rate_deg_per_s"])])
        torque = -at.stiffness_nm_per_rad[hinge] * angle - at.damping_nm_s_per_rad[hinge] * rate
        assert float(row["torque_nm"]) == pytest.approx(torque, rel=1e-4, abs=1e-4)
        assert float(row["hinge_mm"]) == pytest.approx(1e3 * at.hinge_m[hinge], abs=1e-3)


@pytest.mark.parametrize("fulcrum_m", [0.066, 0.151])
def test_in_mujoco_the_toe_rises_under_a_load_as_the_hinges_have_it(condensed, fulcrum_m):
    mujoco = pytest.importorskip("mujoco")
    text = condensed_mjcf(condensed, MADE_ERROR, fulcrum_m=fulcrum_m)
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    at = condensed.at(fulcrum_m)
    load = 400.0
    toe = model.body("vsf_toe").id
    for _ in range(round(0.5 / model.opt.timestep)):
        data.qfrc_applied[:] = 0.0
        mujoco.mj_forward(model, data)
        place = data.xpos[toe] + data.xmat[toe].reshape(3, 3) @ np.array(
            [NOMINAL.load_point_m - at.hinge_m[1], 0.0, 0.0]
        )
        mujoco.mj_applyFT(
            model, data, np.array([0.0, 0.0, load]), np.zeros(3), place, toe, data.qfrc_applied
        )
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(data.qpos, bent(at, load, NOMINAL.load_point_m)[0], rtol=1e-6)
    # 12 digits are written; the mount stands at the origin
    assert model.body_mass.sum() == pytest.approx(NOMINAL.mass_kg, rel=1e-10)
    np.testing.assert_allclose(data.site("vsf_mount").xpos, 0.0, atol=1e-12)


def test_in_mujoco_slowly_rolled_over_the_ground_bears_the_load_of_the_path(condensed):
    """The path is that of the massless foot at rest under the profile of ISO 22675; MuJoCo, ten
    times slower and without damping in the foam, finds the load again within 1 % of its peak."""
    mujoco = pytest.importorskip("mujoco")
    fulcrum_m = 0.129
    profile = iso_22675(5e-3)
    load = np.maximum(75.0 * GRAVITY * profile.force_bw, 20.0)
    rest = at_rest(
        condensed.sagittal(np.full(len(load), fulcrum_m)), pitch_rad=-profile.tilt_rad, load_n=load
    )
    spec = mujoco.MjSpec.from_string(condensed_mjcf(condensed, MADE_ERROR, fulcrum_m=fulcrum_m))
    frame = spec.body("vsf_frame")
    slide, turn = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    for kind, axis in ((slide, [1, 0, 0]), (slide, [0, 0, 1]), (turn, [0, -1, 0])):
        frame.add_joint(type=kind, axis=axis, pos=-frame.pos)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1])
    model = spec.compile()
    model.opt.gravity[:] = 0.0
    model.geom_condim[:] = 1  # no friction
    model.dof_armature[:3] = 1e9  # the mount does not mind
    model.body_invweight0[frame.id] = 1.0
    calibrate(model, damping=0.0)
    slow = 10.0
    path = CubicSpline(slow * profile.time_s, rest.mount)
    data = mujoco.MjData(model)
    force = []
    for time in np.arange(0.0, slow * profile.duration_s, model.opt.timestep):
        data.qpos[:3] = path(time)
        data.qvel[:3] = path(time, 1)
        mujoco.mj_step(model, data)
        force.append(data.efc_force[: data.nefc].sum())
    wanted = np.interp(np.arange(len(force)) * model.opt.timestep, slow * profile.time_s, load)
    begun = len(force) // 20
    np.testing.assert_allclose(force[begun:], wanted[begun:], atol=0.01 * load.max())


@pytest.mark.parametrize("step_s", [1e-3, 2e-3])
def test_in_mujoco_a_loaded_foot_comes_to_rest_at_every_position(condensed, step_s):
    """60 kg on the mount, which slides upright, dropped from 5 mm on the stations' own contact: at
    rest it bears its weight."""
    mujoco = pytest.importorskip("mujoco")
    for fulcrum_m in PUBLISHED_FULCRUMS_M:
        spec = mujoco.MjSpec.from_string(condensed_mjcf(condensed, MADE_ERROR, fulcrum_m=fulcrum_m))
        frame = spec.body("vsf_frame")
        frame.pos[2] += NOMINAL.build_height_m + 0.005
        frame.add_joint(name="up", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0.0, 0.0, 1.0])
        rider = frame.add_body(name="rider", pos=[0.055, 0.0, 0.1])
        rider.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.05, 0, 0], mass=60.0, contype=0)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1])
        model = spec.compile()
        model.opt.timestep = step_s
        calibrate(model)
        data = mujoco.MjData(model)
        for _ in range(round(2.0 / step_s)):
            mujoco.mj_step(model, data)
        assert np.abs(data.qvel).max() < 1e-3
        forces = [np.zeros(6) for _ in range(data.ncon)]
        for i, force in enumerate(forces):
            mujoco.mj_contactForce(model, data, i, force)
        weight = model.body_mass.sum() * 9.81
        assert sum(force[0] for force in forces) == pytest.approx(weight, rel=1e-3)


def test_a_foot_without_a_forefoot_is_refused_with_what_would_be_right():
    heels = tuple(zone for zone in NOMINAL.zones if zone.name.startswith("heel"))
    with pytest.raises(InputError, match=r"foot\.zones") as refused:
        condense(replace(NOMINAL, zones=heels))
    assert "rolls over both" in str(refused.value)


def test_a_part_of_the_sole_that_bears_nothing_is_named():
    soft = tuple(
        replace(zone, stiffness=0.0) if zone.name == "heel_anterior" else zone
        for zone in NOMINAL.zones
    )
    with pytest.raises(InputError, match=r"no sphere bears from 66 to 108 mm.*heel_front"):
        condense(replace(NOMINAL, zones=soft))


def test_a_passive_foot_is_refused():
    fixed = replace(NOMINAL.fulcrum, rearmost_m=0.1, foremost_m=0.1)
    with pytest.raises(InputError, match=r"this foot has no fulcrum.*Export the full foot"):
        condense(replace(NOMINAL, fulcrum=fixed))


def test_a_fulcrum_out_of_reach_is_refused(condensed):
    with pytest.raises(InputError, match=r"fulcrum_m.*out of the carriage's reach"):
        condensed.at(0.2)


@pytest.mark.slow
def test_a_foot_with_a_softer_keel_and_stiffening_foam_is_condensed_as_well():
    foam = tuple(
        replace(zone, exponent=1.3, stiffness=zone.stiffness / 7e-3**0.3) for zone in NOMINAL.zones
    )
    foot = replace(NOMINAL, zones=foam, keel=replace(NOMINAL.keel, flexural_modulus_pa=6e9))
    worst = error_against_full(condense(foot)).worst
    assert worst.force_rms < 0.03
    assert worst.centre_rms_m < 5e-3
    assert worst.stored < 0.05
    assert worst.returned < 0.05
