"""A solved trajectory problem of the sagittal model as what is re-simulated."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vsf_drake.analysis.collocation.solution import TrajectorySolution
from vsf_drake.analysis.tuning.resimulation.design_values import design_values
from vsf_drake.analysis.tuning.resimulation.trajectory import FEET, PELVIS, SagittalTrajectory
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.simulation.sagittal.model import DESIGN
from vsf_drake.simulation.walk import Walker


def solved_trajectory(
    solution: TrajectorySolution, walker: Walker, *, advance: np.ndarray | None = None,
    values: Mapping[str, float] | None = None, offsets: GeometricOffsets | None = None
) -> SagittalTrajectory:
    """Motion, torques and ground reaction of a solution, with its fulcrum and its device.

    Args:
        solution: of a problem whose function has the outputs torque_COORDINATE and FOOT_fx, FOOT_fz of
            `SagittalModel`, and the parameters `DESIGN`.
        walker: whose device the design multiplies.
        advance: (8,) of the coordinates in a period, if the problem's grid is periodic.
        values, offsets: of the walk, as the sagittal model was made with them.

    Raises:
        FitError: the solution is none; see `TrajectorySolution.unsealed`.
        InputError: it misses an output, or does not close.
    """
    problem = solution.problem
    layout, grid, names, y = problem.layout, problem.grid, list(problem.function.names), solution.y()
    coordinates = tuple(layout.coordinates)

    def columns(*wanted: str) -> np.ndarray:
        return np.array(y[:, [names.index(name) for name in wanted]])

    rows = {part: np.array(solution.z[:, getattr(layout, part)]) for part in ("q", "v", "a")}
    rows["torque"] = columns(*(f"torque_{name}" for name in coordinates[len(PELVIS) :]))
    grf = {foot: columns(f"{foot}_fx", f"{foot}_fz") for foot in FEET}
    design = dict(zip(DESIGN, (float(x) for x in solution.p), strict=True))
    more = {"names": coordinates, "fulcrum_m": design.pop("fulcrum_m"), "offsets": offsets or GeometricOffsets(),
            "values": dict(values or {}) | design_values(walker, **design)}
    if not grid.periodic:
        return SagittalTrajectory(time_s=np.array(grid.times_s), grf=grf, **rows, **more)
    return SagittalTrajectory.of_period(
        np.array(grid.times_s), period_s=grid.duration_s, grf=grf, **rows, **more,
        advance=np.zeros(len(coordinates)) if advance is None else np.asarray(advance, dtype=float))
