"""Drake's convex integrator "cenic" on this model's diagrams: where it runs, where it is right.

It asks for a continuous plant called "plant" in the outermost diagram, with a geometry query connected, and for mass
in every body that a joint carries. Forces on a plant's ports enter each step as b - K v with K the *diagonal* of their
gradient in the velocities and only where that damps (Drake 1.51, icf_external_systems_linearizer.h). A spring in each
joint is of that form: the keel alone is a valid problem. A force on a point of a chain is not, since it couples
all joints up to there; what is left out grows with the step, and error control does not keep the step short enough.
"""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import SceneGraph
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context
from table import Row
from walks import the_trial

from vsf_drake.plants.bench import make_bench
from vsf_drake.plants.gait import make_gait

FULCRUM_M = 0.066
ACCURACY, EXACT_ACCURACY = 1e-3, 1e-4
SHORT_STEP_S = 1e-4
BENT_RAD, RING_S = 0.05, 0.02
PRESSED_M, PRESS_S = 5e-3, 0.1
SAMPLES = 10


def rows() -> list[Row]:
    """The person, and the bench twice: without support and load, and pressed at once."""
    return [_person(), *_keel_alone(), *_pressed()]


def simulator(diagram, plant, context: Context, *, scheme: str, accuracy: float, max_step_s: float) -> Simulator:
    """A simulator of a diagram without geometry, with an empty answer to the geometry query that cenic asks for."""
    scene = SceneGraph()
    query = scene.get_query_output_port().Eval(scene.CreateDefaultContext())
    plant.get_geometry_query_input_port().FixValue(plant.GetMyContextFromRoot(context), Value(query))
    made = Simulator(diagram, context)
    ApplySimulatorConfig(
        SimulatorConfig(integration_scheme=scheme, accuracy=accuracy, max_step_size=max_step_s), made)
    return made


def _person() -> Row:
    """Fails at the first step; else the millisecond is reported."""
    gait = make_gait(the_trial().subject, the_trial().model)
    context = gait.diagram.CreateDefaultContext()
    gait.diagram.GetInputPort("fulcrum_position").FixValue(context, [FULCRUM_M])
    gait.diagram.GetInputPort("desired_state").FixValue(context, np.zeros(2 * len(gait.prescribed)))
    run = simulator(gait.diagram, gait.plant, context, scheme="cenic", accuracy=1e-3, max_step_s=1e-3)
    started = time.perf_counter()
    try:
        run.AdvanceTo(1e-3)
    except RuntimeError as error:
        return Row("person, Simulator cenic", None, None, f"does not run: {error}")
    return Row("person, Simulator cenic", 1e-3, time.perf_counter() - started, "runs now; accuracy not measured")


def _keel_alone() -> list[Row]:
    """The keel without support and load, let go bent: only forces that cenic takes as they are."""
    exact = _respond("radau3", EXACT_ACCURACY, RING_S, alone=True)
    made = []
    for step_s in (RING_S, SHORT_STEP_S):
        run = _respond("cenic", ACCURACY, step_s, alone=True)
        error = np.abs(run.angles - exact.angles).max() / BENT_RAD
        made.append(Row(f"keel let go, Simulator cenic{_limit(step_s, RING_S)}", RING_S, run.wall_s,
                        f"{100 * error:.2g} % of the first angle from radau3 {EXACT_ACCURACY:g}; {run.steps} steps"))
    return made


def _pressed() -> list[Row]:
    """The bench with the platen PRESSED_M up from the start: support and platen press on points of the chain."""
    exact = _respond("radau3", EXACT_ACCURACY, PRESS_S, alone=False)
    made = []
    for scheme, step_s in (("implicit_euler", PRESS_S), ("cenic", PRESS_S), ("cenic", SHORT_STEP_S)):
        run = _respond(scheme, ACCURACY, step_s, alone=False)
        made.append(Row(f"bench, pressed at once, Simulator {scheme}{_limit(step_s, PRESS_S)}", PRESS_S, run.wall_s, (
            f"{np.abs(run.load - exact.load).max():.2g} N of {exact.load[-1]:.0f} N from radau3 {EXACT_ACCURACY:g}; "
            f"{run.steps} steps")))
    return made


class _Response(NamedTuple):
    """Keel angles (SAMPLES, joints) rad and load (SAMPLES,) N at even intervals."""

    angles: np.ndarray
    load: np.ndarray
    steps: int
    wall_s: float


def _respond(scheme: str, accuracy: float, max_step_s: float, *, alone: bool) -> _Response:
    bench = make_bench(the_trial().model.foot)
    context = bench.diagram.CreateDefaultContext()
    plant_context = bench.plant.GetMyMutableContextFromRoot(context)
    bench.plant.GetJointByName(bench.foot.carriage_joint_name).set_translation(plant_context, FULCRUM_M)
    joints = [bench.plant.GetJointByName(name) for name in bench.foot.keel_joint_names]
    if alone:
        forces = bench.forces
        forces.SetParameters(forces.GetMyMutableContextFromRoot(context), fulcrum_stiffness=0.0, fulcrum_damping=0.0)
        for joint in joints[1:]:
            joint.set_angle(plant_context, BENT_RAD)
    lift = -1.0 if alone else PRESSED_M
    bench.diagram.GetInputPort("fulcrum_position").FixValue(context, [FULCRUM_M])
    bench.diagram.GetInputPort("platen").FixValue(context, [bench.contact_height + lift, 0.0])
    run = simulator(bench.diagram, bench.plant, context, scheme=scheme, accuracy=accuracy, max_step_s=max_step_s)
    angles, load, started = [], [], time.perf_counter()
    for moment in np.linspace(0.0, RING_S if alone else PRESS_S, SAMPLES + 1)[1:]:
        run.AdvanceTo(moment)
        angles.append([joint.get_angle(plant_context) for joint in joints])
        load.append(bench.diagram.GetOutputPort("load").Eval(context)[0])
    return _Response(np.array(angles), np.array(load), run.get_integrator().get_num_steps_taken(),
                     time.perf_counter() - started)


def _limit(step_s: float, whole_s: float) -> str:
    return "" if step_s == whole_s else f", steps of {1e3 * step_s:g} ms"
