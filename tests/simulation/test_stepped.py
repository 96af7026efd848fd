"""The stepper as a system of Drake's is the stepper, and everything of it is in the Context."""

from __future__ import annotations

import threading
from functools import cache

import numpy as np
import pytest
from leg_drop import BEND_RAD, SPRING_NM_PER_RAD, make_leg
from pydrake.autodiffutils import AutoDiffXd
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import LinearBushingRollPitchYaw, PrismaticJoint
from pydrake.systems.analysis import Simulator, Simulator_
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.base.files import resource
from vsf_drake.model.parameters import FootParameters, ModelParameters
from vsf_drake.motion.trial import load_trial
from vsf_drake.plants import add_foot, wire_foot
from vsf_drake.simulation.stepped import make_stepped_leg, make_stepped_person
from vsf_drake.simulation.stepping.runs import Inputs
from vsf_drake.simulation.stepping.stepper import Stepper
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.embedded import embedded_trials

HIGH_M, STANDING_M = 1.2, 0.85
"""Heights of the leg's hip where the foot is in the air, and where it stands."""


# A person along a recorded motion: the same as by the stepper itself.


@cache
def walked():
    """A walk over 0.2 s on the prosthetic foot."""
    trial = load_trial(embedded_trials("exact")[0])
    walker = Walker(trial.subject, trial.model)
    span = {"fulcrum_m": trial.fulcrum_m, "end_s": trial.end_s}
    whole = walker.walk(trial.trajectory, start_s=trial.start_s, **span)
    hardest = whole.record.time_s[np.argmax(whole.prosthetic.grf_W[:, 2])]
    start = round(hardest - 0.1, 3)
    return trial, walker.walk(
        trial.trajectory, fulcrum_m=trial.fulcrum_m, start_s=start, end_s=start + 0.2
    )


class Ahead(LeafSystem):
    """Gives row k + 1 during period k."""

    def __init__(self, rows, period_s):
        super().__init__()

        def give(context, out):
            out.SetFromVector(rows[min(round(context.get_time() / period_s) + 1, len(rows) - 1)])

        self.DeclareVectorOutputPort("rows", rows.shape[1], give)


@pytest.mark.parametrize("steps", [1, 5, 20])
def test_a_person_moves_as_by_the_stepper_whatever_the_period(steps):
    trial, walk = walked()
    record = walk.record
    period_s = 1e-3 * steps
    stepped = make_stepped_person(
        trial.subject, trial.model, fulcrum_m=trial.fulcrum_m, period_s=period_s
    )
    names = walk.mechanism.tree.coordinate_names
    rows = [names.index(name) for name in stepped.prescribed]
    knots = np.vstack([record.q0, record.q])[::steps][:, rows]

    # straight from knot to knot, by the stepper in one go
    at = np.arange(len(record.q) + 1) / steps
    lead = np.column_stack([np.interp(at, np.arange(len(knots)), knot) for knot in knots.T])
    fulcrum = np.full(len(lead), trial.fulcrum_m)
    inputs = Inputs(
        time_s=1e-3 * np.arange(len(lead)),
        prescribed=np.array([*rows, names.index("fulcrum")]),
        prescribed_q=np.column_stack([lead, fulcrum]),
        fulcrum=fulcrum,
        ground=np.zeros(len(lead)),
    )
    expected = Stepper(walk.mechanism).run(inputs, record.q0, record.v0)

    builder = DiagramBuilder()
    builder.AddSystem(stepped)
    source = builder.AddSystem(Ahead(knots, period_s))
    builder.Connect(source.get_output_port(), stepped.GetInputPort("desired_positions"))
    simulator = Simulator(builder.Build())
    context = stepped.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    context.SetDiscreteState(0, np.concatenate([record.q0, record.v0]))
    for k in range(len(knots) - 1):
        simulator.AdvanceTo((k + 1) * period_s)
        last = (k + 1) * steps - 1
        wrench = expected.wrench[last]
        x = stepped.GetOutputPort("state").Eval(context)
        np.testing.assert_allclose(
            x, np.concatenate([expected.q[last], expected.v[last]]), rtol=1e-9, atol=1e-11
        )
        for port, value in (
            ("grf", wrench[0, 3:]),
            ("intact_grf", wrench[1, 3:]),
            ("driver_force", expected.load[last]),
            ("support_force", expected.fulcrum[last, :1]),
        ):
            np.testing.assert_allclose(
                stepped.GetOutputPort(port).Eval(context), value, rtol=1e-9, atol=1e-7
            )
    assert stepped.GetOutputPort("grf").Eval(context)[2] > 300.0, "on the foot"
    x, y, z = stepped.GetOutputPort("cop").Eval(context)
    moment, force = wrench[0, :3], wrench[0, 3:]
    np.testing.assert_allclose(
        moment - np.cross([x, y, z], force),
        [0.0, 0.0, stepped.GetOutputPort("free_moment").Eval(context)[0]],
        atol=1e-9,
    )
    assert stepped.GetOutputPort("unconverged_steps").Eval(context)[0] == np.sum(
        ~expected.converged
    )


def test_a_person_is_put_at_rest_where_it_is_told():
    trial, walk = walked()
    stepped = make_stepped_person(trial.subject, trial.model)
    context = stepped.CreateDefaultContext()
    names = walk.mechanism.tree.coordinate_names
    there = {name: walk.record.q0[names.index(name)] for name in stepped.prescribed}
    stepped.SetStart(context, there, {"pelvis_tx": 1.0})
    x = stepped.GetOutputPort("state").Eval(context)
    assert all(x[names.index(name)] == value for name, value in there.items())
    assert x[names.index("fulcrum")] == 0.108 and x[len(names) + names.index("pelvis_tx")] == 1.0
    # held there it stays at rest
    stepped.SetStart(context, there)
    simulator = Simulator(stepped, context)
    simulator.AdvanceTo(0.05)
    held = stepped.GetOutputPort("state").Eval(context)
    np.testing.assert_allclose(held[: len(names)], x[: len(names)], atol=1e-6)
    with pytest.raises(InputError, match="no coordinate 'hip'"):
        stepped.SetStart(context, {"hip": 0.0})
    with pytest.raises(InputError, match="no coordinate 'fulcrum'"):
        stepped.SetStart(context, {"fulcrum": 0.1})
    with pytest.raises(InputError, match="velocities"):
        stepped.SetStart(context, {"pelvis_tx": 0.0}, {"pelvis_ty": 0.1})


# A leg: statics, and what is in the Context.


def standing(height_m=STANDING_M, **options):
    diagram, plant, wired = make_leg()
    plant.GetJointByName("rail").set_default_translation(height_m)
    return make_stepped_leg(diagram, wired, **options), plant


def advanced(stepped, context, periods, torque=0.0):
    """The state after some periods more, with all torques at one value."""
    stepped.GetInputPort("torques").FixValue(context, torque * np.array([0.0, 1.0, -1.0]))
    simulator = Simulator(stepped, context)
    begun = round(context.get_time() / stepped.period_s)
    simulator.AdvanceTo((begun + periods) * stepped.period_s)
    return stepped.GetOutputPort("state").Eval(context).copy()


def carriage(stepped):
    return stepped.mechanism.tree.coordinate_names.index("fulcrum")


def test_joint_springs_and_torques_balance_gravity_and_the_rail_bears_the_weight():
    stepped, plant = standing(HIGH_M, prescribed=["rail"])
    context = stepped.CreateDefaultContext()
    torques = np.array([7.0, -4.0])
    assert stepped.free == ("hip_flexion", "knee_flexion")
    stepped.GetInputPort("torques").FixValue(context, torques)
    Simulator(stepped, context).AdvanceTo(20.0)
    n = plant.num_positions()
    q = stepped.GetOutputPort("state").Eval(context)[:n]
    own = plant.CreateDefaultContext()
    plant.SetPositions(own, q)
    gravity = plant.CalcGravityGeneralizedForces(own)
    at = [plant.GetJointByName(name).velocity_start() for name in stepped.free]
    np.testing.assert_allclose(
        gravity[at] + torques, SPRING_NM_PER_RAD * (q[at] - BEND_RAD), atol=1e-6
    )
    rail = plant.GetJointByName("rail").velocity_start()
    driver = stepped.GetOutputPort("driver_force").Eval(context)
    assert driver[rail] == pytest.approx(-gravity[rail], rel=1e-6)
    assert q[rail] == HIGH_M
    for port in ("grf", "cop", "free_moment"):
        assert not stepped.GetOutputPort(port).Eval(context).any(), "in the air"


def test_a_leg_comes_to_stand_on_its_weight_with_the_fulcrum_where_it_is_asked():
    stepped, plant = standing()
    context = stepped.CreateDefaultContext()
    stepped.GetInputPort("fulcrum_position").FixValue(context, [0.12])
    x = advanced(stepped, context, 300)
    weight = 9.81 * plant.CalcTotalMass(plant.CreateDefaultContext())
    assert stepped.GetOutputPort("grf").Eval(context)[2] == pytest.approx(weight, rel=1e-4)
    assert x[carriage(stepped)] == 0.12


def test_a_context_that_is_set_back_repeats_itself_and_a_copy_goes_on_alike():
    stepped, _ = standing()
    context = stepped.CreateDefaultContext()
    start = context.Clone()
    middle = advanced(stepped, context, 20, 5.0)
    copied = context.Clone()
    end = advanced(stepped, context, 20, 5.0)
    assert (middle != end).any()
    np.testing.assert_array_equal(advanced(stepped, copied, 20, 5.0), end)
    context.SetTimeStateAndParametersFrom(start)
    np.testing.assert_array_equal(advanced(stepped, context, 20, 5.0), middle)
    np.testing.assert_array_equal(advanced(stepped, context, 20, 5.0), end)

    builder = DiagramBuilder()
    builder.AddNamedSystem("leg", stepped)
    clone = builder.Build().Clone()
    other = clone.GetSubsystemByName("leg")
    root = clone.CreateDefaultContext()
    own = other.GetMyMutableContextFromRoot(root)
    other.GetInputPort("torques").FixValue(own, [0.0, 5.0, -5.0])
    Simulator(clone, root).AdvanceTo(40 * stepped.period_s)
    np.testing.assert_array_equal(other.GetOutputPort("state").Eval(own), end)


def test_contexts_do_not_see_each_other_one_after_the_other():
    stepped, _ = standing()
    alone = {
        torque: advanced(stepped, stepped.CreateDefaultContext(), 40, torque)
        for torque in (-5.0, 5.0)
    }
    contexts = {torque: stepped.CreateDefaultContext() for torque in alone}
    for _ in range(40):
        in_turn = {
            torque: advanced(stepped, context, 1, torque) for torque, context in contexts.items()
        }
    for torque, x in alone.items():
        np.testing.assert_array_equal(in_turn[torque], x)


def test_copies_of_a_context_may_advance_on_threads_at_a_time():
    stepped, _ = standing(period_s=0.2)
    first = stepped.CreateDefaultContext()
    advanced(stepped, first, 1)
    copies = {torque: first.Clone() for torque in (-5.0, 0.0, 5.0)}
    alone = {torque: advanced(stepped, first.Clone(), 5, torque) for torque in copies}
    at_once = {}

    def advance(torque):
        at_once[torque] = advanced(stepped, copies[torque], 5, torque)

    threads = [threading.Thread(target=advance, args=(torque,)) for torque in copies]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for torque, x in alone.items():
        np.testing.assert_array_equal(at_once[torque], x)


def test_parameters_are_the_contexts_own():
    stepped, _ = standing()
    soft = stepped.CreateDefaultContext()
    hard = stepped.CreateDefaultContext()
    stepped.SetParameters(soft, stiffness=0.5 * stepped.GetParameter(soft, "stiffness"))
    sunk, stood = (advanced(stepped, context, 200)[0] for context in (soft, hard))
    assert 1e-4 < stood - sunk < 0.02
    stepped.SetParameters(hard, fulcrum_m=0.07)
    assert advanced(stepped, hard, 1)[carriage(stepped)] == 0.07


# What cannot be.


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"period_s": 0.0105}, "no whole multiple"),
        ({"period_s": 0.0005}, "no whole multiple"),
        ({"period_s": np.inf}, "no whole multiple"),
        ({"period_s": np.nan}, "no whole multiple"),
        ({"step_s": 1.0, "period_s": 1.0}, "not a usable step"),
        ({"step_s": 0.0}, "not a usable step"),
        ({"prescribed": ["hip"]}, "not names of joints"),
        ({"prescribed": "rail"}, "not names of joints"),
    ],
)
def test_options_that_do_not_fit_are_told(options, message):
    diagram, _, wired = make_leg()
    with pytest.raises(InputError, match=message):
        make_stepped_leg(diagram, wired, **options)


def leg_with(change, time_step=0.0, contact="kelvin_voigt"):
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(time_step))
    Parser(plant).AddModels(str(resource("models/leg.urdf")))
    hip = plant.GetFrameByName("hip")
    plant.AddJoint(PrismaticJoint("rail", plant.world_frame(), hip, [0.0, 0.0, 1.0]))
    change(plant)
    foot = add_foot(plant, plant.GetFrameByName("pylon_end"), FootParameters(), contact=contact)
    plant.Finalize()
    wired = wire_foot(builder, plant, foot)
    return builder.Build(), wired


def add_bushing(plant):
    frames = plant.world_frame(), plant.GetFrameByName("thigh")
    plant.AddForceElement(LinearBushingRollPitchYaw(*frames, *np.ones((4, 3))))


def add_rotor(plant):
    plant.AddJointActuator("motor", plant.GetJointByName("rail")).set_default_rotor_inertia(0.1)


def add_second_foot(plant):
    add_foot(plant, plant.GetFrameByName("hip"), FootParameters(), name="other")


@pytest.mark.parametrize(
    ("change", "time_step", "message"),
    [
        (add_bushing, 0.0, "LinearBushingRollPitchYaw"),
        (add_rotor, 0.0, "rotor of 'motor'"),
        (lambda plant: None, 1e-3, "time step"),
        (add_second_foot, 0.0, "two joints have one name"),
    ],
)
def test_a_plant_with_what_the_stepper_does_not_know_is_refused(change, time_step, message):
    with pytest.raises(InputError, match=message):
        make_stepped_leg(*leg_with(change, time_step))


def test_a_leg_that_is_thrown_says_when_and_derivatives_are_refused():
    stepped, _ = standing()
    context = stepped.CreateDefaultContext()
    stepped.GetInputPort("torques").FixValue(context, [0.0, 1e9, 0.0])
    context.SetTime(2.0)
    with pytest.raises(SimulationError, match="diverged") as raised:
        Simulator(stepped, context).AdvanceTo(2.1)
    assert 2.0 < raised.value.time_s <= 2.01
    converted = stepped.ToAutoDiffXd()
    with pytest.raises(InputError, match="no derivatives"):
        Simulator_[AutoDiffXd](converted).AdvanceTo(0.01)


def test_a_person_needs_a_fulcrum_within_reach():
    trial, _ = walked()
    with pytest.raises(InputError, match="reach"):
        make_stepped_person(trial.subject, ModelParameters(), fulcrum_m=0.3)
