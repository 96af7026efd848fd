"""Checks of an optimal stride: carried out by the full model, on a finer mesh, and by other solvers."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from vsf_drake.analysis.collocation.program import ConfirmOptions, confirm
from vsf_drake.analysis.collocation.solution import TrajectorySolution, resampled
from vsf_drake.analysis.tuning.level2.search import Progress, StrideSearch
from vsf_drake.analysis.tuning.level2.solution import StrideCheck, StrideSolution
from vsf_drake.analysis.tuning.level2.stride import MM
from vsf_drake.analysis.tuning.resimulation import (
    resimulate_prescribed,
    resimulate_with_feedback,
    solved_trajectory,
)
from vsf_drake.errors import InputError, SimulationError

ANGLE_DEG, FORCE_BW = 2.0, 0.06
"""What a tracked stride may differ from its recording by, root mean square (a choice)."""
VIOLATION = 1e-6


def check_solution(found: StrideSolution, progress: Progress | None) -> None:
    """Fills `found.checks` and `found.simulated`."""
    best, tuning = found.stride_or_best, found.tuning
    found.checks += _tracking(found)
    if found.sweep:
        fixed = [row.solution.last_cost for row in found.sweep if row.solution is not None]
        met = best.last_cost <= min(fixed) + 1e-9
        found.checks.append(StrideCheck(
            "fixed_positions", "against the best fixed position", best.last_cost - min(fixed), found.cost_unit,
            "<= 0", met, f"With the fulcrum free the cost is {best.last_cost:.6g}, at the best of {len(fixed)} fixed "
                         f"positions {min(fixed):.6g}."))
    ends = [float(solution.last.p[0]) / MM for _, solution in found.free if solution.success]
    if len(found.free) > 1:
        spread = max(ends) - min(ends)
        found.checks.append(StrideCheck(
            "starts", "where searches from several positions end", spread, "mm", "<= 1",
            spread <= 1.0 and len(ends) == len(found.free),
            f"{len(ends)} of {len(found.free)} searches converged and ended within {spread:.2f} mm."))
    if progress:
        progress("re-simulating", 0.5, None)
    trajectory = solved_trajectory(best, tuning.walker, advance=best.problem.advance, offsets=tuning.trial.offsets)
    for simulate in (resimulate_prescribed, resimulate_with_feedback):
        try:
            run = simulate(tuning.walker, trajectory)
        except SimulationError as error:
            kind = "prescribed" if simulate is resimulate_prescribed else "feedback"
            found.checks.append(StrideCheck(f"resimulation_{kind}", f"re-simulation, {kind}", None, "% body weight",
                                            "", False, str(error)))
        else:
            found.checks.append(StrideCheck(**run.check_row()))
            found.simulated |= run.arrays()
    if tuning.options.confirm:
        found.checks += [_finer(found, best, progress), _softer(found, best, progress)]


def _tracking(found: StrideSolution) -> list[StrideCheck]:
    costs, solution = found.search.costs, found.tracked
    y, reference = solution.y(), costs.reference
    angles = np.degrees(y[:, costs.function.starting_with("q_")] - reference.q)
    worst = max(float(np.sqrt(np.mean(angles[:, i] ** 2))) for i in (0, *range(3, angles.shape[1])))
    force = 0.0
    for foot, known in reference.force.items():
        rows = reference.known[foot]
        if rows.any():
            size = np.linalg.norm(y[:, costs.function.index(f"{foot}_fx", f"{foot}_fz")], axis=1)
            difference = (size - np.linalg.norm(known, axis=1))[rows] / costs.weight_n
            force = max(force, float(np.sqrt(np.mean(difference**2))))
    return [
        StrideCheck("tracking_motion", "tracked stride, worst angle", worst, "deg", f"<= {ANGLE_DEG:g}",
                    worst <= ANGLE_DEG, f"Tracked, the stride's angles are within {worst:.2f} deg of the recording."),
        StrideCheck("tracking_force", "tracked stride, resultant force of the worse foot", 100.0 * force,
                    "% body weight", f"<= {100.0 * FORCE_BW:g}", force <= FORCE_BW,
                    f"Its ground reaction is within {100.0 * force:.1f} % of body weight of the plates."),
        StrideCheck("violation", "largest violation of an equation", found.stride_or_best.violation, "scaled",
                    f"<= {VIOLATION:g}", found.stride_or_best.violation <= VIOLATION,
                    "Forces are scaled by body weight, moments by body weight at the length of a leg.")]


def _finer(found: StrideSolution, best: TrajectorySolution, progress: Progress | None) -> StrideCheck:
    old = found.search
    grid = old.stride.grid(2 * old.grid.intervals)
    search = StrideSearch(old.stride, grid, old.smoothing, old.cost, old.sizes, progress)
    return _change("mesh", "twice as many intervals", search.free(resampled(best, grid), "finer mesh", 0.6), best)


def _softer(found: StrideSolution, best: TrajectorySolution, progress: Progress | None) -> StrideCheck:
    old = found.search
    soft = dataclasses.replace(old.smoothing, depth_m=2.0 * old.smoothing.depth_m)
    search = StrideSearch(old.stride, old.grid, soft, old.cost, old.sizes, progress)
    return _change("smoothing", "contact smoothed over twice the depth", search.free(best.last, "softer contact", 0.7),
                   best)


def _change(name: str, label: str, other: TrajectorySolution, best: TrajectorySolution) -> StrideCheck:
    if not other.success:
        return StrideCheck(name, label, None, "mm", "", None, f"With {label} it did not converge: {other.message}.")
    moved = float(other.last.p[0] - best.last.p[0]) / MM
    return StrideCheck(name, label, moved, "mm", "", None,
                       f"With {label} the optimum moves by {moved:+.2f} mm and the cost by "
                       f"{100.0 * (other.last_cost / best.last_cost - 1.0):+.2f} %.")


def confirmed(found: StrideSolution, progress: Progress | None) -> list[dict[str, Any]]:
    """Rows of the solvers that search again from the optimum."""
    best, rows = found.stride_or_best, []
    for solver in found.tuning.options.confirm:
        if progress:
            progress(f"confirming with {solver}", 0.9, None)
        try:
            again = confirm(best.problem, best.last, solver,
                            ConfirmOptions(time_limit_s=found.tuning.options.time_limit_s))
        except (InputError, RuntimeError) as error:
            rows.append({"solver": solver, "fulcrum_mm": None, "cost": None, "success": False, "start": "warm",
                         "message": str(error)})
            continue
        rows.append({"solver": solver, "fulcrum_mm": float(again.last.p[0]) / MM, "cost": again.last_cost,
                     "success": again.success, "start": "warm", "message": again.message})
    return rows
