"""Stations: the same forces as the parts they are made of, alone, twice, converted and under Simulator."""

from __future__ import annotations

import gc
import re
from dataclasses import replace

import numpy as np
import psutil
import pytest
from made_scenario import one_of_everything
from pydrake.autodiffutils import AutoDiffXd, InitializeAutoDiff
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.contact_file import load_contact
from vsf_drake.errors import InputError
from vsf_drake.files import resource
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.plants import station as station_module
from vsf_drake.plants.bench import make_bench
from vsf_drake.plants.station import make_station
from vsf_drake.scenario import Scenario, ScenarioFoot, load_scenario

KINDS = ("bench", "person", "leg")
SUBJECT = Subject(mass_kg=78, stature_m=1.81, sex="male", prosthetic_side="right")
FOOT = {"grf", "cop", "free_moment", "normal_force", "depth", "friction_force"}
PORTS = {
    "bench": ({"fulcrum_position", "platen"}, {"state", "load", "depth", "support_force"}),
    "person": ({"fulcrum_position", "desired_state"},
               {"state", "support_force", "joint_moment", "socket_wrench", "driver_force", *FOOT,
                *(f"intact_{name}" for name in FOOT)}),
    "leg": ({"fulcrum_position", "desired_state", "generalized_force"},
            {"state", "support_force", "joint_moment", "body_poses", "body_spatial_velocities", "query", *FOOT}),
}
LEG = "package://vsf_drake/leg.urdf"


def names(diagram):
    inputs = {diagram.get_input_port(i).get_name() for i in range(diagram.num_input_ports())}
    return inputs, {diagram.get_output_port(i).get_name() for i in range(diagram.num_output_ports())}


def values(diagram, context, ports=("state", "support_force", "depth")):
    return {name: diagram.GetOutputPort(name).Eval(context) for name in ports}


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


def test_every_port_stands_in_the_modules_table():
    listed = set(re.findall(r"^    (\w.*?)  ", station_module.__doc__, flags=re.MULTILINE))
    listed = {name.strip() for row in listed for name in row.split(",")} - {"input", "output"}
    ports = set().union(*(inputs | outputs for inputs, outputs in PORTS.values()))
    assert listed == {name.removeprefix("intact_") for name in ports} | {"actuation"}


def test_files_of_subject_and_contact_reach_person_and_foot():
    contact = resource("data/reference_subject/exact/contact.yaml")
    station = make_station(Scenario(
        kind="person", subject=str(resource("data/reference_subject/exact/medium_1.yaml")), contact_file=str(contact)))
    assert station.parts.person.subject.mass_kg == 78.0
    fitted = load_contact(contact).values
    zone = station.feet["vsf"].parameters.zones[0]
    assert (zone.stiffness, zone.exponent) == (fitted["contact.heel_posterior.stiffness"],
                                               fitted["contact.heel_posterior.exponent"])


@pytest.mark.slow
def test_legs_built_again_and_again_do_not_grow_the_process(leg):
    """A diagram that is kept alive costs a quarter of a megabyte each time."""
    resident = []
    for builds in (15, 40):
        for _ in range(builds):
            make_station(leg.scenario).diagram.CreateDefaultContext()
        gc.collect()
        resident.append(psutil.Process().memory_info().rss)
    assert resident[1] - resident[0] < 4e6


def test_a_bench_station_is_the_bench_with_its_fulcrum_where_the_scenario_has_it():
    station = make_station(Scenario(kind="bench", fulcrum_mm=87.0))
    bench = make_bench(ModelParameters().foot)
    contexts = [station.diagram.CreateDefaultContext(), bench.diagram.CreateDefaultContext()]
    bench.diagram.GetInputPort("fulcrum_position").FixValue(contexts[1], 1e-3 * 87.0)
    q = np.linspace(-0.01, 0.02, 20)
    for diagram, plant, context in ((station.diagram, station.plant, contexts[0]),
                                    (bench.diagram, bench.plant, contexts[1])):
        diagram.GetInputPort("platen").FixValue(context, [bench.contact_height + 0.002, 0.01])
        plant.SetPositionsAndVelocities(plant.GetMyContextFromRoot(context), q)
    one, two = (values(d, c, ("state", "support_force", "depth", "load")) for d, c in
                ((station.diagram, contexts[0]), (bench.diagram, contexts[1])))
    for name, value in one.items():
        np.testing.assert_array_equal(value, two[name])
    assert one["load"][0] > 0.0
    carriage = station.plant.GetJointByName("fulcrum").get_translation(
        station.plant_context(station.diagram.CreateDefaultContext()))
    assert carriage == pytest.approx(0.087)


def test_under_simulator_the_bench_settles_to_the_balance_of_moments_about_the_keels_end():
    """Load at 199 mm from A, support at 108 mm, nothing else off A: a lever, but for the keel's slope."""
    station = make_station(load_scenario(resource("models/scenarios/bench.yaml")))
    simulator = Simulator(station.diagram)
    context = simulator.get_mutable_context()
    station.diagram.GetInputPort("platen").FixValue(context, [station.parts.contact_height + 0.002, 0.0])
    ApplySimulatorConfig(station.simulator_config(), simulator)
    simulator.AdvanceTo(0.3)
    load, support = (station.diagram.GetOutputPort(name).Eval(context)[0] for name in ("load", "support_force"))
    assert load > 10.0
    assert support == pytest.approx(-load * 0.199 / 0.108, rel=2e-3)


def test_two_stations_in_one_diagram_have_the_forces_of_one_alone(leg):
    builder = DiagramBuilder()
    both = [make_station(replace(leg.scenario, name=name)) for name in "ab"]
    for station in both:
        builder.AddSystem(station.diagram)
    whole = builder.Build()
    root, alone = whole.CreateDefaultContext(), leg.diagram.CreateDefaultContext()
    ports = ("grf", "cop", "depth", "support_force")
    for station in both:
        own = station.diagram.GetMyContextFromRoot(root)
        for name, value in values(station.diagram, own, ports).items():
            np.testing.assert_array_equal(value, leg.diagram.GetOutputPort(name).Eval(alone))
    both[0].plant.GetJointByName("hip_flexion").set_angle(both[0].plant_context(root), 0.2)
    own = both[1].diagram.GetMyContextFromRoot(root)
    np.testing.assert_array_equal(both[1].diagram.GetOutputPort("grf").Eval(own),
                                  leg.diagram.GetOutputPort("grf").Eval(alone))
    rates = whole.EvalTimeDerivatives(root).CopyToVector()
    np.testing.assert_allclose(rates[len(rates) // 2:], leg.diagram.EvalTimeDerivatives(alone).CopyToVector())


def test_a_leg_converts_and_its_derivatives_are_central_differences(leg):
    converted = leg.diagram.ToAutoDiffXd()
    context, plain = converted.CreateDefaultContext(), leg.diagram.CreateDefaultContext()
    x = plain.get_continuous_state_vector().CopyToVector()
    x[0] += 0.01
    i = leg.plant.GetJointByName("knee_flexion").position_start()
    seeds = np.zeros((len(x), 1))
    seeds[i] = 1.0
    context.SetContinuousState(InitializeAutoDiff(x, gradient=seeds).ravel())
    grf = converted.GetOutputPort("grf").Eval(context)
    assert all(isinstance(force, AutoDiffXd) for force in grf)

    def at(step):
        plain.SetContinuousState(x + step * seeds[:, 0])
        return leg.diagram.GetOutputPort("grf").Eval(plain)

    slope = (at(1e-6) - at(-1e-6)) / 2e-6
    np.testing.assert_allclose([force.derivatives()[0] for force in grf], slope, rtol=1e-4, atol=1.0)
    assert abs(slope[2]) > 100.0


def test_several_feet_have_their_names_before_their_ports(tmp_path):
    station = make_station(load_scenario(one_of_everything(tmp_path)))
    inputs, outputs = names(station.diagram)
    assert {"left_fulcrum_position", "right_fulcrum_position"} <= inputs
    assert {f"{side}_{name}" for side in ("left", "right") for name in FOOT} <= outputs
    assert station.feet["right"].parameters.mass_kg == 0.7
    assert (station.feet["left"].contact, station.feet["right"].contact) == ("smooth", "hunt_crossley")
    context = station.diagram.CreateDefaultContext()
    hips = [station.plant.GetBodyByName("hip", station.plant.GetModelInstanceByName(name)) for name in "ab"]
    leans = [hip.EvalPoseInWorld(station.plant_context(context)).rotation().matrix()[0, 2] for hip in hips]
    np.testing.assert_allclose(leans, [0.0, np.sin(np.radians(3.0))], atol=1e-12)
    for name, place in (("left", 0.066), ("right", 0.087)):
        joint = station.plant.GetJointByName("fulcrum", station.feet[name].instance)
        assert joint.get_translation(station.plant_context(context)) == pytest.approx(place)
        assert station.diagram.GetOutputPort(f"{name}_grf").Eval(context)[2] > 100.0


def test_a_leg_held_over_the_floor_comes_to_rest_on_it_under_simulator(leg):
    simulator = Simulator(leg.diagram)
    ApplySimulatorConfig(leg.simulator_config(), simulator)
    simulator.AdvanceTo(0.4)
    context = simulator.get_context()
    assert simulator.get_integrator().get_num_steps_taken() > 10
    grf = leg.diagram.GetOutputPort("grf").Eval(context)
    assert grf[2] > 50.0
    assert np.hypot(grf[0], grf[1]) <= 0.5 * grf[2]
    rates = leg.diagram.EvalTimeDerivatives(context).CopyToVector()
    v, acceleration = np.split(rates, 2)
    hip, knee = (leg.plant.GetJointByName(name).velocity_start() for name in ("hip_flexion", "knee_flexion"))
    assert np.abs(v[[hip, knee]]).max() < 0.05
    assert np.abs(acceleration[[hip, knee]]).max() < 5.0


def test_drakes_own_contact_in_a_plant_with_a_time_step_bears_the_same_load(leg):
    """Guides hold the hip and knee, so the load follows from the stiffness of the foot, which is matched."""
    scenario = replace(leg.scenario, robot=None, ground=None, directives=(
        {"add_model": {"name": "leg", "file": LEG}}, *leg.scenario.directives),
        feet=(ScenarioFoot(parent_frame="leg::pylon_end"),))
    loads = []
    for changes in ({}, {"contact": "drake_point", "time_step_s": 1e-3}):
        station = make_station(replace(scenario, **changes))
        simulator = Simulator(station.diagram)
        if not changes:
            ApplySimulatorConfig(station.simulator_config(), simulator)
        simulator.AdvanceTo(0.2)
        loads.append(station.diagram.GetOutputPort("grf").Eval(simulator.get_context())[2])
    assert loads[0] > 200.0
    assert loads[1] == pytest.approx(loads[0], rel=0.03)


def test_a_coordinate_that_the_person_lacks_is_refused():
    with pytest.raises(InputError, match="free: no such coordinate: tail"):
        make_station(Scenario(kind="person", subject=SUBJECT, free=("tail",)))
