"""Stations: the same forces as the parts they are made of, feet under a model of one's own, what is
shown of them."""

from __future__ import annotations

import re
from dataclasses import replace

import meshcat_page
import numpy as np
import pytest
from made_contact import made_contact
from made_scenario import one_of_everything
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.base.schema import dump_yaml
from vsf_drake.model.contact_file import load_contact, save_contact
from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.model.scenario import Scenario, ScenarioFoot, load_scenario
from vsf_drake.plants import station as station_module
from vsf_drake.plants.station import make_station
from vsf_drake.report.show.drawing import open_meshcat

KINDS = ("bench", "person", "leg")
SUBJECT = Subject(mass_kg=78, stature_m=1.81, sex="male", prosthetic_side="right")
FOOT = {"grf", "cop", "free_moment", "normal_force", "depth", "friction_force"}
PORTS = {
    "bench": ({"fulcrum_position", "platen"}, {"state", "load", "depth", "support_force"}),
    "person": (
        {"fulcrum_position", "desired_state"},
        {
            "state",
            "support_force",
            "joint_moment",
            "socket_wrench",
            "driver_force",
            *FOOT,
            *(f"intact_{name}" for name in FOOT),
        },
    ),
    "leg": (
        {"fulcrum_position", "desired_state", "generalized_force"},
        {
            "state",
            "support_force",
            "joint_moment",
            "body_poses",
            "body_spatial_velocities",
            "query",
            *FOOT,
        },
    ),
}
LEG = "package://vsf_drake/leg.urdf"


def names(diagram):
    inputs = {diagram.get_input_port(i).get_name() for i in range(diagram.num_input_ports())}
    return inputs, {
        diagram.get_output_port(i).get_name() for i in range(diagram.num_output_ports())
    }


@pytest.fixture(scope="module")
def leg():
    return make_station(load_scenario(resource("models/scenarios/leg.yaml")))


@pytest.mark.parametrize("kind", KINDS)
def test_shipped_scenarios_build_with_the_ports_that_the_module_lists(kind):
    scenario = load_scenario(resource(f"models/scenarios/{kind}.yaml"))
    assert names(make_station(scenario).diagram) == PORTS[kind]
    assert names(make_station(scenario).diagram.ToAutoDiffXd()) == PORTS[kind]
    drawn = make_station(scenario, visual=True)
    inputs, outputs = PORTS[kind]
    assert names(drawn.diagram) == (inputs, outputs | {"query"})
    query = drawn.diagram.GetOutputPort("query").Eval(drawn.diagram.CreateDefaultContext())
    assert query.inspector().num_geometries() > 20
    listed = set(re.findall(r"^    (\w.*?)  ", station_module.__doc__, flags=re.MULTILINE))
    listed = {name.strip() for row in listed for name in row.split(",")} - {"input", "output"}
    ports = set().union(*(inputs | outputs for inputs, outputs in PORTS.values()))
    assert listed == {name.removeprefix("intact_") for name in ports} | {"actuation"}


def test_files_of_subject_and_contact_reach_person_and_foot():
    contact = resource("data/reference_subject/exact/contact.yaml")
    station = make_station(
        Scenario(
            kind="person",
            subject=str(resource("data/reference_subject/exact/medium_1.yaml")),
            contact_file=str(contact),
        )
    )
    assert station.parts.person.subject.mass_kg == 78.0
    fitted = load_contact(contact).values
    zone = station.feet["vsf"].parameters.zones[0]
    assert (zone.stiffness, zone.exponent) == (
        fitted["contact.heel_posterior.stiffness"],
        fitted["contact.heel_posterior.exponent"],
    )


def test_a_contact_of_another_shell_brings_it_along_unless_a_model_is_named(tmp_path):
    path = tmp_path / "contact.yaml"
    save_contact(made_contact(foot_length_m=0.275), path)
    scenario = Scenario(kind="bench", contact_file=str(path))
    assert make_station(scenario).feet["vsf"].parameters.length_m == 0.275
    with pytest.raises(InputError, match=r"a foot of 275 mm.*245 mm"):
        make_station(replace(scenario, model=str(resource("models/nominal.yaml"))))


def test_a_bench_station_has_its_fulcrum_where_the_scenario_has_it():
    station = make_station(Scenario(kind="bench", fulcrum_mm=87.0))
    context = station.diagram.CreateDefaultContext()
    forces = station.parts.forces
    support = forces.GetInputPort("fulcrum_position").Eval(forces.GetMyContextFromRoot(context))[0]
    carriage = station.plant.GetJointByName("fulcrum").get_translation(
        station.plant_context(context)
    )
    np.testing.assert_allclose([support, carriage], 0.087, rtol=1e-12)


def test_two_stations_in_one_diagram_have_the_forces_of_one_alone(leg):
    builder = DiagramBuilder()
    both = [make_station(replace(leg.scenario, name=name)) for name in "ab"]
    for station in both:
        builder.AddSystem(station.diagram)
    whole = builder.Build()
    root, alone = whole.CreateDefaultContext(), leg.diagram.CreateDefaultContext()
    both[0].plant.GetJointByName("hip_flexion").set_angle(both[0].plant_context(root), 0.2)
    own = both[1].diagram.GetMyContextFromRoot(root)
    for name in ("grf", "cop", "depth", "support_force"):
        np.testing.assert_array_equal(
            both[1].diagram.GetOutputPort(name).Eval(own),
            leg.diagram.GetOutputPort(name).Eval(alone),
        )
    rates = whole.EvalTimeDerivatives(root).CopyToVector()
    np.testing.assert_allclose(
        rates[len(rates) // 2 :], leg.diagram.EvalTimeDerivatives(alone).CopyToVector()
    )


def test_several_feet_have_their_names_before_their_ports(tmp_path):
    station = make_station(load_scenario(one_of_everything(tmp_path)))
    inputs, outputs = names(station.diagram)
    assert {"left_fulcrum_position", "right_fulcrum_position"} <= inputs
    assert {f"{side}_{name}" for side in ("left", "right") for name in FOOT} <= outputs
    assert station.feet["right"].parameters.mass_kg == 0.7
    assert (station.feet["left"].contact, station.feet["right"].contact) == (
        "smooth",
        "hunt_crossley",
    )
    context = station.diagram.CreateDefaultContext()
    hips = [
        station.plant.GetBodyByName("hip", station.plant.GetModelInstanceByName(name))
        for name in "ab"
    ]
    leans = [
        hip.EvalPoseInWorld(station.plant_context(context)).rotation().matrix()[0, 2]
        for hip in hips
    ]
    np.testing.assert_allclose(leans, [0.0, np.sin(np.radians(3.0))], atol=1e-12)
    for name, place in (("left", 0.066), ("right", 0.087)):
        joint = station.plant.GetJointByName("fulcrum", station.feet[name].instance)
        assert joint.get_translation(station.plant_context(context)) == pytest.approx(place)
        assert station.diagram.GetOutputPort(f"{name}_grf").Eval(context)[2] > 100.0


MOTORED = """
<robot name="motored">
  <link name="base"/>
  <link name="shank">
    <inertial><mass value="3"/><inertia ixx="0.04" ixy="0" ixz="0" iyy="0.04" iyz="0" izz="0.01"/></inertial>
  </link>
  <joint name="knee" type="revolute">
    <parent link="base"/><child link="shank"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="100" velocity="20"/>
  </joint>
  <transmission type="SimpleTransmission">
    <joint name="knee"/><actuator name="knee_motor"/>
  </transmission>
</robot>
"""  # noqa: E501


def test_a_motors_torque_acts_as_the_same_generalized_force(tmp_path):
    (tmp_path / "motored.urdf").write_text(MOTORED)
    station = make_station(
        Scenario(
            kind="leg",
            feet=(ScenarioFoot(parent_frame="m::shank"),),
            gravity_m_per_s2=0.0,
            directives=(
                {"add_model": {"name": "m", "file": (tmp_path / "motored.urdf").as_uri()}},
                {
                    "add_weld": {
                        "parent": "world",
                        "child": "m::base",
                        "X_PC": {"translation": [0.0, 0.0, 2.0]},
                    }
                },
            ),
        )
    )
    inputs = {
        station.diagram.get_input_port(i).get_name()
        for i in range(station.diagram.num_input_ports())
    }
    assert inputs == {"fulcrum_position", "generalized_force", "actuation"}
    rates = []
    force = np.zeros(station.plant.num_velocities())
    force[station.plant.GetJointByName("knee").velocity_start()] = 7.0
    for port, value in ((None, None), ("actuation", [7.0]), ("generalized_force", force)):
        context = station.diagram.CreateDefaultContext()
        if port:
            station.diagram.GetInputPort(port).FixValue(context, value)
        rates.append(station.diagram.EvalTimeDerivatives(context).CopyToVector())
    assert np.abs(rates[0]).max() < 1e-9
    np.testing.assert_allclose(rates[1], rates[2], rtol=1e-9, atol=1e-9)
    assert np.abs(rates[1]).max() > 10.0


TWO_LEGS = tuple(
    directive
    for name, y in (("a", 0.2), ("b", -0.2))
    for directive in (
        {"add_model": {"name": name, "file": LEG}},
        {
            "add_weld": {
                "parent": "world",
                "child": f"{name}::hip",
                "X_PC": {"translation": [0.0, y, 0.84]},
            }
        },
    )
)


def test_guides_pull_by_stiffness_and_damping_under_the_gravity_that_the_scenario_has():
    scenario = load_scenario(resource("models/scenarios/leg.yaml"))
    station = make_station(replace(scenario, gravity_m_per_s2=1.62))
    np.testing.assert_array_equal(station.plant.gravity_field().gravity_vector(), [0.0, 0.0, -1.62])
    context = station.diagram.CreateDefaultContext()
    plant_context = station.plant_context(context)
    guide, driver = station.scenario.guides[0], station.diagram.GetSubsystemByName("guides")
    joint = station.plant.GetJointByName(guide.joint.split("::")[-1])
    joint.set_angle(plant_context, joint.get_angle(plant_context) + 0.1)
    joint.set_angular_rate(plant_context, 0.7)
    force = driver.GetOutputPort("generalized_force").Eval(driver.GetMyContextFromRoot(context))
    known = np.zeros(station.plant.num_velocities())
    known[joint.velocity_start()] = -(0.1 * guide.stiffness + 0.7 * guide.damping)
    np.testing.assert_allclose(force, known, rtol=1e-12, atol=1e-12)


def test_two_feet_of_different_friction_are_refused_one_ground_of_drakes_own(tmp_path):
    """Drake takes the harmonic mean of both sides, so one ground cannot give each its own
    coefficient."""
    foot = ModelParameters().foot
    slippery = replace(foot, friction=replace(foot.friction, mu_static=0.1, mu_kinetic=0.1))
    (tmp_path / "slippery.yaml").write_text(dump_yaml(replace(ModelParameters(), foot=slippery)))
    feet = (
        ScenarioFoot(name="left", parent_frame="a::pylon_end"),
        ScenarioFoot(
            name="right", parent_frame="b::pylon_end", model=str(tmp_path / "slippery.yaml")
        ),
    )
    scenario = Scenario(kind="leg", directives=TWO_LEGS, feet=feet, contact="drake_point")
    with pytest.raises(
        InputError, match=r"feet\[1\].model: 'right' has another friction than 'left'"
    ):
        make_station(scenario)
    make_station(replace(scenario, contact="hunt_crossley"))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"feet": (ScenarioFoot(parent_frame="pylon_fin"),)},
            r"feet\[0\].parent_frame: 'pylon_fin' is not in the model",
        ),
        ({"feet": (ScenarioFoot(name="vsf"),)}, "has no model instance 'vsf'"),
        (
            {"feet": (ScenarioFoot(parent_frame="pylon_end", fulcrum_mm=300.0),)},
            r"feet\[0\].fulcrum_mm: .*reach",
        ),
        (
            {"robot": None, "directives": ({"add_wedl": {}},)},
            "directives: Drake cannot follow them",
        ),
        (
            {"kind": "person", "subject": SUBJECT, "free": ("tail",), "robot": None, "feet": ()},
            "free: no such coordinate",
        ),
    ],
)
def test_what_is_not_in_the_model_is_refused_by_its_key(changes, words):
    right = {"kind": "leg", "robot": LEG, "feet": (ScenarioFoot(parent_frame="pylon_end"),)}
    with pytest.raises(InputError, match=words):
        make_station(Scenario(**(right | changes)))


def test_meshcat_shows_every_body_of_the_foot_where_it_is():
    meshcat = open_meshcat()
    station = make_station(load_scenario(resource("models/scenarios/person.yaml")), meshcat=meshcat)
    context, plant = station.diagram.CreateDefaultContext(), station.plant
    plant.SetPositions(
        station.plant_context(context), np.linspace(-0.2, 0.2, plant.num_positions())
    )
    station.diagram.ForcedPublish(context)
    shown = {
        command["path"]: np.reshape(command["matrix"], (4, 4), order="F")
        for command in meshcat_page.commands(meshcat.StaticHtml())
        if command["type"] == "set_transform"
    }
    bodies = [plant.get_body(index) for index in plant.GetBodyIndices(station.feet["vsf"].instance)]
    assert len(bodies) == len(station.feet["vsf"].keel) + 2  # frame and carriage
    for body in bodies:
        pose = body.EvalPoseInWorld(station.plant_context(context)).GetAsMatrix4()
        np.testing.assert_allclose(shown[f"/drake/visualizer/vsf/{body.name()}"], pose, atol=1e-6)
