"""The bench under Drake's `Simulator`: slow, but owing nothing to the stepper."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.systems.analysis import SimulatorConfig
from pydrake.systems.framework import DiagramBuilder
from pydrake.trajectories import PiecewisePolynomial
from walk_over_ground import advance, drive

from vsf_drake.plants.bench import make_bench
from vsf_drake.simulation.bench import Bench


@dataclass(frozen=True)
class ReferencePress:
    """A platen stroke under `Simulator`: platen_m (n,) m from first touch, load_n (n,) N."""

    time_s: np.ndarray
    platen_m: np.ndarray
    load_n: np.ndarray


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
    """Raises the platen by `travel_m` (m) from first touch at constant speed, by `Simulator`."""
    end_s = travel_m / speed_m_per_s
    moments = np.linspace(0.0, end_s, samples)
    made = make_bench(bench.parameters, heel=bench.heel)
    builder = DiagramBuilder()
    builder.AddSystem(made.diagram)
    start = made.contact_height
    stroke = PiecewisePolynomial.FirstOrderHold([0.0, end_s], np.array([[start, start + travel_m]]))
    drive(builder, "platen", stroke, 1, made.diagram.GetInputPort("platen"))
    drive(
        builder,
        "fulcrum",
        PiecewisePolynomial(np.array([[fulcrum_m]])),
        0,
        made.diagram.GetInputPort("fulcrum_position"),
    )
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = made.diagram.GetMyMutableContextFromRoot(context)
    own.get_mutable_parameters().SetFrom(bench.context.get_parameters())
    plant_context = made.plant.GetMyMutableContextFromRoot(context)
    made.plant.GetJointByName(made.foot.carriage_joint_name).set_translation(
        plant_context, fulcrum_m
    )
    load = made.diagram.GetOutputPort("load")
    config = SimulatorConfig(
        integration_scheme=integrator, accuracy=accuracy, max_step_size=end_s / 20
    )
    rows, _ = advance(diagram, context, moments, lambda: load.Eval(own)[0], config, None)
    return ReferencePress(moments, speed_m_per_s * moments, np.array(rows))
