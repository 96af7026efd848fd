"""The foot's .osim file: read as XML it says what Drake has, and OpenSim, in a process of its own,
computes the same rest, the same inertia and the same roll-over."""

from __future__ import annotations

import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from made_feet import UNUSUAL, loose_foot
from pydrake.geometry import Box, Cylinder
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from vsf_drake.base.errors import InputError
from vsf_drake.engines.certificate.ask import elastic, questions, write_full
from vsf_drake.engines.certificate.asked import ELASTIC, NOMINAL
from vsf_drake.engines.osim import foot_osim
from vsf_drake.laws.contact_laws import CONTACT_LAWS
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants import add_foot
from vsf_drake.plants.foot import mount_pose, sole_height
from vsf_drake.plants.rigid_foot import rigid_foot
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, keel_shape
from vsf_drake.simulation.roll_over import RollOver

USUAL = FootParameters()
CURVED = replace(
    UNUSUAL,
    zones=(
        *(replace(zone, stiffness=4e5, exponent=1.5) for zone in USUAL.zones[:3]),
        replace(USUAL.zones[3], stiffness=0.0, damping_n_s_per_m=0.0),
        replace(USUAL.zones[4], stiffness=2e5, exponent=1.7, rise_mm=(0.5,) * 13),
    ),
)
FEET = {"nominal": USUAL, "unusual": CURVED}
FULCRUM_M = 0.108
ROLL_S = 0.15
# x, y, z of OpenSim are Drake's x, z, -y
AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
needs_opensim = pytest.mark.skipif(find_spec("opensim") is None, reason="OpenSim is not installed")


@pytest.fixture(scope="module", params=FEET)
def foot(request):
    return FEET[request.param]


def read(text):
    return ET.fromstring(text.encode())


def numbers(element, tag):
    return np.array(element.findtext(tag).split(), dtype=float)


def named(tree, kind):
    return {element.get("name"): element for element in tree.iter(kind)}


def foam(tree):
    return named(tree, "ExpressionBasedPointToPointForce")


def test_bodies_have_the_masses_and_inertias_of_drake(foot):
    bodies = named(read(foot_osim(foot, fulcrum_m=FULCRUM_M)), "Body")
    total = sum(float(body.findtext("mass")) for body in bodies.values())
    assert total == pytest.approx(foot.mass_kg, rel=1e-11)
    plant = MultibodyPlant(0.0)
    handles = add_foot(plant, plant.world_frame(), foot)
    plant.Finalize()
    for index in plant.GetBodyIndices(handles.instance):
        body = plant.get_body(index)
        known = body.default_spatial_inertia()
        moments = known.Shift(known.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
        written = bodies.pop(body.name())
        assert float(written.findtext("mass")) == pytest.approx(known.get_mass(), rel=1e-11)
        np.testing.assert_allclose(
            numbers(written, "mass_center"), AXES @ known.get_com(), atol=1e-13
        )
        xx, yy, zz, xy, xz, yz = numbers(written, "inertia")
        np.testing.assert_allclose(
            [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], AXES @ moments @ AXES.T, atol=1e-15
        )
    assert not bodies


def value(expression, **known):
    """Of an expression, whose intermediate ones stand behind semicolons, the innermost last."""
    text, *rest = expression.split(";")
    for part in reversed(rest):
        name, inner = part.split("=")
        known[name] = value(inner, **known)
    functions = {"__builtins__": {}, "min": min, "max": max}
    return eval(text.replace("^", "**"), functions, known)


@pytest.mark.parametrize("law", CONTACT_LAWS)
def test_every_sphere_is_pressed_off_the_ground_as_in_drake(foot, law):
    """At random heights and rates: the law's own value, but for the rounding of a height that is
    measured from 1000 km below. A positive expression would attract."""
    forces = foam(read(foot_osim(foot, fulcrum_m=FULCRUM_M, law=law)))
    loose = loose_foot(parameters=foot, contact=law)
    sites = loose.foot.sites
    rng = np.random.default_rng(5)
    loaded = 0
    for _ in range(8):
        q = np.append(rng.uniform(-0.01, 0.01, len(loose.foot.keel)), FULCRUM_M)
        tilt = RollPitchYaw(0.0, rng.uniform(-0.02, 0.02), 0.0)
        up = -sole_height(foot) - 2e-3
        X_WK = RigidTransform(tilt, [0.0, 0.0, up])
        loose.place(X_WK, rng.normal(scale=0.1, size=6), q, rng.normal(scale=0.3, size=len(q)))
        known = loose.output("normal_force")
        for i, (index, p_BS) in enumerate(zip(sites.body_indices, sites.p_BS, strict=True)):
            body = loose.plant.get_body(index)
            X_WB = body.EvalPoseInWorld(loose.plant_context)
            velocity = body.EvalSpatialVelocityInWorld(loose.plant_context)
            rate = velocity.Shift(X_WB.rotation() @ p_BS).translational()[2]
            force = forces.get(f"foam_{i}")
            if force is None:
                assert sites.stiffness[i] == known[i] == 0.0
                continue
            assert force.findtext("body1") == "ground"
            assert force.findtext("body2") == body.name()
            np.testing.assert_allclose(numbers(force, "point2"), AXES @ p_BS, atol=1e-12)
            far = -numbers(force, "point1")[1]
            pull = value(force.findtext("expression"), d=far + (X_WB @ p_BS)[2], ddot=rate)
            assert pull == pytest.approx(-known[i], rel=1e-8, abs=1e-4)
            loaded += known[i] > 1.0
    assert loaded > 50


@pytest.mark.parametrize("law", CONTACT_LAWS)
def test_expressions_have_neither_blanks_nor_a_minus_in_front(law):
    """OpenSim's reader of expressions refuses both."""
    texts = [
        force.findtext("expression")
        for force in foam(read(foot_osim(USUAL, fulcrum_m=FULCRUM_M, law=law))).values()
    ]
    assert len(texts) == 24
    for text in texts:
        assert not re.search(r"\s", text)
        assert not re.search(r"(^|[(,=;*/^+])-", text)


def test_spheres_without_damping_are_springs(foot):
    text = foot_osim(elastic(foot), fulcrum_m=FULCRUM_M)
    assert "ddot" not in "".join(
        force.findtext("expression") for force in foam(read(text)).values()
    )


def test_keel_and_support_have_their_springs_and_dampers(foot):
    tree = read(foot_osim(foot, fulcrum_m=FULCRUM_M))
    handles, _ = rigid_foot(foot)
    springs = named(tree, "SpringGeneralizedForce")
    assert "spring_keel_pin" not in springs, "the pin at A is free"
    assert len(springs) == len(foot.keel.element_lengths_m)
    for name, k, c in zip(
        handles.keel_joint_names, handles.joint_stiffness, handles.joint_damping, strict=True
    ):
        if k:
            spring = springs[f"spring_{name}"]
            assert spring.findtext("coordinate") == name
            assert float(spring.findtext("stiffness")) == pytest.approx(k, rel=1e-11)
            assert float(spring.findtext("viscosity")) == pytest.approx(c, rel=1e-11)
    support = tree.find(".//BushingForce[@name='vsf_support']")
    k = foot.fulcrum.stiffness_n_per_m
    np.testing.assert_allclose(numbers(support, "translational_stiffness"), [0.0, k, 0.0])
    np.testing.assert_allclose(
        numbers(support, "translational_damping"), [0.0, k * foot.fulcrum.damping_time_s, 0.0]
    )


def half_extents(kind, size, R):
    """Half of a solid's extents along the axes in which R (3, 3) has its own as columns."""
    if kind == "Sphere":
        return np.full(3, size)
    if kind == "Brick":
        return np.abs(R) @ size
    radius, half, axis = size
    return half * np.abs(R[:, axis]) + radius * np.sqrt(1.0 - np.minimum(R[:, axis] ** 2, 1.0))


def test_drawings_are_drakes_in_the_axes_of_opensim(foot):
    bodies = named(read(foot_osim(foot, fulcrum_m=FULCRUM_M)), "Body")
    _, links = rigid_foot(foot)
    for link in links:
        frames = bodies[link["name"]].iter("PhysicalOffsetFrame")
        for drawing, frame in zip(link["drawings"], frames, strict=True):
            shape = drawing["shape"]
            X_BG = drawing["X_BG"]
            if isinstance(shape, Box):
                known = "Brick", 0.5 * shape.size()
            elif isinstance(shape, Cylinder):
                known = "Cylinder", (shape.radius(), 0.5 * shape.length(), 2)
            else:
                known = "Sphere", shape.radius()
            (solid,) = frame.find("attached_geometry")
            assert (solid.tag, solid.get("name")) == (known[0], drawing["name"])
            if solid.tag == "Brick":
                size = numbers(solid, "half_lengths")
            elif solid.tag == "Cylinder":
                size = float(solid.findtext("radius")), float(solid.findtext("half_height")), 1
            else:
                size = float(solid.findtext("radius"))
            turned = Rotation.from_euler("XYZ", numbers(frame, "orientation")).as_matrix()
            np.testing.assert_allclose(
                half_extents(solid.tag, size, turned),
                np.abs(AXES) @ half_extents(*known, X_BG.rotation().matrix()),
                atol=1e-9,
            )
            np.testing.assert_allclose(
                numbers(frame, "translation"), AXES @ X_BG.translation(), atol=1e-12
            )


def test_what_cannot_be_written_is_refused():
    with pytest.raises(InputError, match=r"'sticky' is not known.*kelvin_voigt, smooth"):
        foot_osim(USUAL, fulcrum_m=FULCRUM_M, law="sticky")
    with pytest.raises(InputError, match="160 mm is out of the carriage's reach"):
        foot_osim(USUAL, fulcrum_m=0.160)


def in_opensim(folder, *arguments):
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def answered(foot, tmp_path_factory):
    """(foot, what is asked, what OpenSim answers)."""
    folder = tmp_path_factory.mktemp("certificate")
    time_s = np.linspace(0.0, ROLL_S, 61)
    # from rest to rest, as the stepper's mount starts at rest
    share = time_s / ROLL_S
    turned = share**2 * (3.0 - 2.0 * share)
    pitch = np.radians(-15.0 + 33.0 * turned)
    travel = 6e-3 * np.sin(np.pi * share) ** 2
    touch = RollOver(foot, friction=False).touch_height(pitch)
    path = np.column_stack([0.05 * turned, touch - travel, pitch])
    write_full(folder, foot)
    asked = replace(questions(foot), time_s=time_s, mount=path)
    asked.write(folder)
    in_opensim(folder, "-m", "vsf_drake.engines.certificate.in_opensim", str(folder))
    with np.load(folder / "opensim.npz") as stored:
        return foot, asked, dict(stored)


@needs_opensim
def test_loaded_keel_rests_in_opensim_where_the_bench_has_it(answered):
    foot, asked, answer = answered
    known = [
        [
            keel_shape(foot, fulcrum_m=fulcrum_m, load_n=load).load_point_K[1]
            for load in asked.load_n
        ]
        for fulcrum_m in PUBLISHED_FULCRUMS_M
    ]
    np.testing.assert_allclose(answer["rise_m"], known, rtol=1e-6)


@needs_opensim
def test_mass_matrix_and_gravity_are_those_of_drake(answered):
    foot, asked, answer = answered
    plant = MultibodyPlant(0.0)
    handles = add_foot(plant, plant.world_frame(), foot)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    joints = [plant.GetJointByName(name, handles.instance) for name in asked.hinges]
    at = [joint.velocity_start() for joint in joints]
    for pose, mass, torque in zip(
        asked.poses_rad, answer["mass_matrix_kg_m2"], answer["gravity_torque_nm"], strict=True
    ):
        for joint, angle in zip(joints, pose, strict=True):
            joint.set_angle(context, angle)
        known = plant.CalcMassMatrix(context)[np.ix_(at, at)]
        np.testing.assert_allclose(mass, known, rtol=1e-9, atol=1e-9 * known.max())
        known = plant.CalcGravityGeneralizedForces(context)[at]
        np.testing.assert_allclose(torque, known, rtol=1e-9, atol=1e-9 * np.abs(known).max())


@needs_opensim
@pytest.mark.parametrize("law", [NOMINAL, ELASTIC])
def test_ground_presses_a_rolling_foot_in_opensim_as_in_the_stepper(answered, law):
    """The stepper is of first order: two steps, one half of the other, tell where it tends to."""
    foot, asked, answer = answered
    machine = RollOver(elastic(foot) if law == ELASTIC else foot, friction=False)
    path = CubicSpline(asked.time_s, asked.mount, bc_type="natural")
    coarse, fine = (pressed(machine, path, asked.time_s[1:], step) for step in (25e-6, 12.5e-6))
    known = 2.0 * fine - coarse
    assert known.max() > 500.0
    np.testing.assert_allclose(answer[f"roll_{law}_n"][1:], known, atol=1e-4 * known.max(), rtol=0)


def pressed(machine, path, at_s, step_s):
    moments = np.linspace(0.0, ROLL_S, round(ROLL_S / step_s) + 1)
    run = machine.follow(fulcrum_m=FULCRUM_M, time_s=moments, mount=path(moments))
    return np.interp(at_s, run.time_s, run.grf_W[:, 2])


HANG = """
import opensim

opensim.Logger.setLevelString("error")
opensim.Logger.removeFileSink()
model = opensim.Model("leg.osim")
state = model.initSystem()
model.realizePosition(state)
at = model.getBodySet().get("vsf_frame").getPositionInGround(state)
print(model.getNumCoordinates(), *(at[i] for i in range(3)))
"""


@needs_opensim
def test_joint_in_the_head_of_the_file_hangs_the_foot_under_a_leg(tmp_path):
    text = foot_osim(USUAL, fulcrum_m=FULCRUM_M)
    weld = ET.fromstring(re.search(r"<WeldJoint.*?</WeldJoint>", text, flags=re.DOTALL)[0])
    tree = read(text)
    joints = tree.find("./Model/JointSet/objects")
    joints.remove(joints.find("PlanarJoint"))
    joints.append(weld)
    joints.append(
        ET.fromstring(
            '<WeldJoint name="knee"><socket_parent_frame>/ground</socket_parent_frame>'
            "<socket_child_frame>/bodyset/tibia_r</socket_child_frame></WeldJoint>"
        )
    )
    tree.find("./Model/BodySet/objects").append(
        ET.fromstring('<Body name="tibia_r"><mass>3</mass><inertia>1 1 1 0 0 0</inertia></Body>')
    )
    ET.ElementTree(tree).write(tmp_path / "leg.osim")
    count, *at = in_opensim(tmp_path, "-c", HANG).split()
    assert int(count) == 1 + len(USUAL.keel.element_lengths_m)
    known = [0.0, -0.4, 0.0] - AXES @ mount_pose(USUAL).translation()
    np.testing.assert_allclose(np.array(at, dtype=float), known, atol=1e-12)
