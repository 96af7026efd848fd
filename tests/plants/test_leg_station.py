"""Feet under a model of one's own: its motors, its guides, one ground for several feet, and what the model lacks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.files import resource
from vsf_drake.ground import Ground, GroundPatch
from vsf_drake.parameters import ModelParameters
from vsf_drake.plants.station import make_station
from vsf_drake.scenario import Scenario, ScenarioFoot, load_scenario
from vsf_drake.schema import dump_yaml

LEG = "package://vsf_drake/leg.urdf"
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
"""


def test_a_motors_torque_acts_as_the_same_generalized_force(tmp_path):
    (tmp_path / "motored.urdf").write_text(MOTORED)
    station = make_station(Scenario(kind="leg", feet=(ScenarioFoot(parent_frame="m::shank"),), gravity_m_per_s2=0.0,
                                    directives=({"add_model": {
                                        "name": "m", "file": (tmp_path / "motored.urdf").as_uri()}},
                                        {"add_weld": {"parent": "world", "child": "m::base", "X_PC": {
                                            "translation": [0.0, 0.0, 2.0]}}})))
    inputs = {station.diagram.get_input_port(i).get_name() for i in range(station.diagram.num_input_ports())}
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
    directive for name, y in (("a", 0.2), ("b", -0.2)) for directive in (
        {"add_model": {"name": name, "file": LEG}},
        {"add_weld": {"parent": "world", "child": f"{name}::hip", "X_PC": {"translation": [0.0, y, 0.84]}}}))


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
    """Drake takes the harmonic mean of both sides, so one ground cannot give each its own coefficient."""
    foot = ModelParameters().foot
    slippery = replace(foot, friction=replace(foot.friction, mu_static=0.1, mu_kinetic=0.1))
    (tmp_path / "slippery.yaml").write_text(dump_yaml(replace(ModelParameters(), foot=slippery)))
    feet = (ScenarioFoot(name="left", parent_frame="a::pylon_end"),
            ScenarioFoot(name="right", parent_frame="b::pylon_end", model=str(tmp_path / "slippery.yaml")))
    scenario = Scenario(kind="leg", directives=TWO_LEGS, feet=feet, contact="drake_point")
    with pytest.raises(InputError, match=r"feet\[1\].model: 'right' has another friction than 'left'"):
        make_station(scenario)
    make_station(replace(scenario, contact="hunt_crossley"))


def test_soft_ground_is_refused_where_any_foot_has_pads():
    feet = (ScenarioFoot(name="left", parent_frame="a::pylon_end", contact="drake_point"),
            ScenarioFoot(name="right", parent_frame="b::pylon_end", contact="hydroelastic"))
    soft = Ground(patches=(GroundPatch(stiffness_n_per_m=1e4),))
    with pytest.raises(InputError, match="hydroelastic pads take the ground for rigid"):
        make_station(Scenario(kind="leg", directives=TWO_LEGS, feet=feet, ground=soft))


WRONG = (
    ({"feet": (ScenarioFoot(parent_frame="pylon_fin"),)}, r"feet\[0\].parent_frame: 'pylon_fin' is not in the model"),
    ({"feet": (ScenarioFoot(name="vsf"),)}, "has no model instance 'vsf'"),
    ({"feet": (ScenarioFoot(parent_frame="pylon_end", fulcrum_mm=300.0),)}, r"feet\[0\].fulcrum_mm: .*reach"),
    ({"robot": None, "directives": ({"add_wedl": {}},)}, "directives: Drake cannot follow them"),
    ({"robot": None, "directives": ({"add_model": {"name": "leg", "file": LEG}, "add_weld": {
        "parent": "world", "child": "leg::hip"}},)}, "directives: Drake cannot follow them"),  # two keys in one
)


@pytest.mark.parametrize(("changes", "words"), WRONG)
def test_what_is_not_in_the_model_is_refused_by_its_key(changes, words):
    right = {"robot": LEG, "feet": (ScenarioFoot(parent_frame="pylon_end"),)}
    with pytest.raises(InputError, match=words):
        make_station(Scenario(kind="leg", **(right | changes)))
