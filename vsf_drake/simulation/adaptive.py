"""Runs any diagram under Drake's `Simulator` with error control."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, InputPort
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from vsf_drake.errors import InputError, SimulationError

INTEGRATORS = ("implicit_euler", "radau1", "radau3", "velocity_implicit_euler")
"""Schemes of Drake that bear the stiffness of the foam; explicit ones would need steps of microseconds."""


@dataclass(frozen=True)
class AdaptiveRun:
    """What `advance` leaves: a row per instant, integrator steps, evaluations of all derivatives, seconds it took."""

    rows: list[Any]
    steps: int
    evaluations: int
    wall_s: float


def advance(
    diagram: Diagram, context: Context, moments: np.ndarray, record: Callable[[], Any], config: SimulatorConfig,
    progress: Callable[[float], None] | None
) -> AdaptiveRun:
    """Advances to each of `moments` (n,) s and keeps what `record` returns there.

    `config` must start at the first of them: applying it resets the Context's time.

    Raises:
        SimulationError: the integrator gives up.
    """
    simulator = Simulator(diagram, context)
    ApplySimulatorConfig(config, simulator)
    rows, started = [], time.perf_counter()
    for moment in moments:
        try:
            simulator.AdvanceTo(float(moment))
        except RuntimeError as error:
            raise SimulationError(f"{config.integration_scheme} gave up: {error}",
                                  time_s=simulator.get_context().get_time()) from error
        rows.append(record())
        if progress:
            progress(float((moment - moments[0]) / max(moments[-1] - moments[0], 1e-12)))
    integrator = simulator.get_integrator()
    return AdaptiveRun(rows=rows, steps=integrator.get_num_steps_taken(),
                       evaluations=integrator.get_num_derivative_evaluations(), wall_s=time.perf_counter() - started)


def check_integrator(name: str) -> None:
    """Raises InputError unless `name` is one of INTEGRATORS."""
    if name not in INTEGRATORS:
        raise InputError(f"{name!r} does not suit this system", where="integrator",
                         right=f"Choose one of {', '.join(INTEGRATORS)}")


def drive(builder: DiagramBuilder, name: str, path: PiecewisePolynomial, order: int, port: InputPort) -> None:
    """Feeds `port` from `path` and its first `order` derivatives."""
    source = builder.AddNamedSystem(name, TrajectorySource(path, output_derivative_order=order))
    builder.Connect(source.get_output_port(), port)
