"""The bench and the walking person under Drake's `Simulator`: slow, but owing nothing to the stepper but its start."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.systems.analysis import SimulatorConfig
from pydrake.systems.framework import DiagramBuilder
from pydrake.trajectories import PiecewisePolynomial

from vsf_drake.model_file import check_fulcrum
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.plants.bench import make_bench
from vsf_drake.plants.gait import make_gait
from vsf_drake.simulation.bench import Bench
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.stepping.stepper import Inputs, Stepper
from vsf_drake.simulation.walk import Walker
from vsf_drake.simulation.walk_over_ground import (
    ReferenceWalk,
    advance,
    check_integrator,
    drive,
    driven,
    recorded,
)

LOAD_STEP_S = 1e-4
"""Step (s) of the stepper that finds the load at the start."""


@dataclass(frozen=True)
class ReferencePress:
    """A platen stroke under `Simulator`: platen_m (n,) m from first touch, load_n (n,) N."""

    time_s: np.ndarray
    platen_m: np.ndarray
    load_n: np.ndarray
    steps: int
    evaluations: int
    wall_s: float


def simulate_bench_reference(
    bench: Bench,
    *,
    fulcrum_m: float,
    travel_m: float,
    speed_m_per_s: float,
    integrator: str = "radau3",
    accuracy: float = 1e-4,
    samples: int = 41,
) -> ReferencePress:
    """Raises the platen by `travel_m` (m) from first touch at constant speed, by `Simulator`.

    Raises:
        InputError: the fulcrum is out of reach, or the integrator is unknown.
        SimulationError: the integrator gives up.
    """
    check_integrator(integrator)
    check_fulcrum(fulcrum_m, bench.parameters)
    end_s = travel_m / speed_m_per_s
    moments = np.linspace(0.0, end_s, samples)
    made = make_bench(bench.parameters, heel=bench.heel)
    builder = DiagramBuilder()
    builder.AddSystem(made.diagram)
    start = made.contact_height
    stroke = PiecewisePolynomial.FirstOrderHold([0.0, end_s], np.array([[start, start + travel_m]]))
    drive(builder, "platen", stroke, 1, made.diagram.GetInputPort("platen"))
    drive(builder, "fulcrum", PiecewisePolynomial(np.array([[fulcrum_m]])), 0,
           made.diagram.GetInputPort("fulcrum_position"))
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = made.diagram.GetMyMutableContextFromRoot(context)
    own.get_mutable_parameters().SetFrom(bench.context.get_parameters())
    plant_context = made.plant.GetMyMutableContextFromRoot(context)
    made.plant.GetJointByName(made.foot.carriage_joint_name).set_translation(plant_context, fulcrum_m)
    load = made.diagram.GetOutputPort("load")
    run = advance(diagram, context, moments, lambda: load.Eval(own)[0],
                   SimulatorConfig(integration_scheme=integrator, accuracy=accuracy, max_step_size=end_s / 20), None)
    return ReferencePress(time_s=moments, platen_m=speed_m_per_s * moments, load_n=np.array(run.rows), steps=run.steps,
                          evaluations=run.evaluations, wall_s=run.wall_s)


def simulate_reference(
    walker: Walker,
    trajectory: CoordinateTrajectory,
    *,
    fulcrum_m: float | Callable[[np.ndarray], np.ndarray],
    start_s: float,
    end_s: float,
    integrator: str = "radau3",
    accuracy: float = 1e-3,
    max_step_s: float = 5e-3,
    sample_s: float = 1e-3,
    progress: Callable[[float], None] | None = None,
) -> ReferenceWalk:
    """Follows `trajectory` as `Walker.walk` does, by `Simulator` instead of the stepper.

    Builds the walker's diagram anew inside a larger one and copies the parameters out of its Context.
    """
    check_integrator(integrator)
    first = walker.walk(trajectory, fulcrum_m=fulcrum_m, start_s=start_s, end_s=min(start_s + 1e-3, end_s))
    moments = start_s + sample_s * np.arange(round((end_s - start_s) / sample_s) + 1)
    mechanism, prescribed = gait_mechanism(walker.gait, walker.context), walker.gait.prescribed
    gait = make_gait(walker.subject, walker.model, free=walker.free)
    motion, fulcrum, diagram, context = driven(gait, trajectory, fulcrum_m, start_s, end_s)
    positions = fulcrum.vector_values(moments)
    for extreme in (positions.min(), positions.max()):
        check_fulcrum(float(extreme), walker.model.foot)
    own = gait.diagram.GetMyMutableContextFromRoot(context)
    own.get_mutable_parameters().SetFrom(walker.context.get_parameters())
    q, v = (np.array(x) for x in (first.record.q0, first.record.v0))
    columns = [mechanism.tree.index(name) for name in prescribed]
    q[columns], v[columns] = motion.value(start_s)[:, 0], motion.EvalDerivative(start_s)[:, 0]
    # Unloaded servos would let the body drop and ring. The load is the stepper's, of the second of two short steps,
    # since the first still sees the change from the spline's velocity to that of the step.
    short = start_s + LOAD_STEP_S * np.arange(3)
    place = fulcrum.vector_values(short)[0]
    inputs = Inputs(
        time_s=short, prescribed=np.array([*columns, mechanism.tree.index("fulcrum")]), fulcrum=place,
        prescribed_q=np.column_stack([motion.vector_values(short).T, place]), ground=np.zeros(3))
    load = Stepper(mechanism).run(inputs, q, v).load[1, columns]
    driver = walker.gait.driver
    q[columns] -= load / driver.GetParameter(driver.GetMyContextFromRoot(walker.context), "position_gain")
    gait.plant.SetPositionsAndVelocities(gait.plant_context(context), np.concatenate((q, v)))
    config = SimulatorConfig(
        integration_scheme=integrator, accuracy=accuracy, max_step_size=max_step_s, start_time=start_s)
    return recorded(diagram, context, gait, motion, moments, config, progress)
