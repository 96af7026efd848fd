"""Feet under a model of one's own: its motors, and what the scenario names that the model lacks."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.plants.station import make_station
from vsf_drake.scenario import Scenario, ScenarioFoot

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
