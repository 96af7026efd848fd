"""Solves a tuning with a motion that adapts, by trajectory optimisation of its stride."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from vsf_drake.analysis.tuning.level1.uncertainty import contact_draws
from vsf_drake.analysis.tuning.level2.costs import LABELS
from vsf_drake.analysis.tuning.level2.options import COSTS
from vsf_drake.analysis.tuning.level2.search import Fixed, Progress, StrideSearch, StrideTuning, swept, tracked
from vsf_drake.analysis.tuning.level2.solution import KINDS, DrawnStride, StrideCheck, StrideSolution, outcomes
from vsf_drake.analysis.tuning.level2.stride import MM
from vsf_drake.analysis.tuning.resimulation import (
    resimulate_prescribed,
    resimulate_with_feedback,
    solved_trajectory,
)
from vsf_drake.collocation.program import confirm
from vsf_drake.collocation.solution import Start, TrajectorySolution, resampled
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.json_file import plain
from vsf_drake.schema import to_plain
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.sagittal.model import DESIGN, SagittalModel


def solve(
    tuning: StrideTuning, *, progress: Progress | None = None, warm_start: Mapping[str, np.ndarray] | None = None
) -> StrideSolution:
    """Tracks the recording, sweeps the fulcrum, frees it, and checks what comes out.

    Args:
        progress: called once an iteration. warm_start: arrays of an earlier solution of the same stride and grid;
            its stride is where the tracking starts.

    Raises:
        SimulationError: keel and socket find no balance under the recorded motion.
    """
    began = time.perf_counter()
    stages = tracked(tuning.stride, tuning.grid, progress, _start_of(warm_start))
    final = tuning.options.stages[-1]
    found = StrideSolution(tuning=tuning, tracked=stages[-1], search=StrideSearch(
        tuning.stride, tuning.grid, final, tuning.cost, progress=progress))
    try:
        _search(found, progress)
    except KeyboardInterrupt:
        found.message = f"interrupted while {found.doing}"
    found.wall_s = time.perf_counter() - began
    return found


def _search(found: StrideSolution, progress: Progress | None) -> None:
    options = found.tuning.options
    _unless_interrupted(found.tracked)
    if not found.tracked.success:
        found.message = f"the recorded stride could not be tracked: {found.tracked.message}"
        return
    search = found.search
    search.sizes = {name: search.costs.of(name).value(found.tracked.y(), search.grid.weights) for name in COSTS}
    found.doing = "sweeping the fulcrum"
    found.sweep = swept(search, found.tracked.last, chains=options.confirm != (), keep=found.sweep)
    good = [fixed for fixed in found.sweep if fixed.solution is not None]
    if not good:
        found.message = "no fixed position of the fulcrum could be solved"
        return
    found.doing = "searching with the fulcrum free"
    for i, fixed in enumerate(_spread(good, options.starts)):
        assert fixed.solution is not None
        solution = search.free(fixed.solution.last, f"free from {fixed.fulcrum_mm:.0f} mm", i / options.starts)
        found.free.append((fixed.fulcrum_mm, solution))
        _unless_interrupted(solution)
    if found.best is None:
        found.message = "no search with the fulcrum free converged: " + found.free[0][1].message
        return
    found.message = "first-order conditions hold"
    found.doing = "checking the solution"
    check_solution(found, progress)
    found.drawn = drawn_strides(found, progress)
    found.confirmed = confirmed(found, progress)


def _unless_interrupted(solution: TrajectorySolution) -> None:
    if solution.status == "interrupted":
        raise KeyboardInterrupt


def _spread(good: list[Fixed], count: int) -> list[Fixed]:
    """The best of a sweep, then the ones farthest from all taken."""
    taken = [min(good, key=lambda fixed: fixed.solution.last_cost if fixed.solution else np.inf)]
    while len(taken) < min(count, len(good)):
        rest = [fixed for fixed in good if fixed not in taken]
        taken.append(max(rest, key=lambda fixed: min(abs(fixed.fulcrum_mm - other.fulcrum_mm) for other in taken)))
    return taken


def _start_of(arrays: Mapping[str, np.ndarray] | None) -> Start | None:
    if arrays is None:
        return None
    if "tracked_z" not in arrays or "tracked_p" not in arrays:
        raise InputError("holds no stride", where="warm_start", right="Give the result of a tuning at level 2")
    return Start(z=np.array(arrays["tracked_z"]), p=np.array(arrays["tracked_p"]))


# Checks of an optimal stride: carried out by the full model, on a finer mesh, and by other solvers.


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
            again = confirm(best.problem, best.last, solver, time_limit_s=found.tuning.options.time_limit_s)
        except (InputError, RuntimeError) as error:
            rows.append({"solver": solver, "fulcrum_mm": None, "cost": None, "success": False, "start": "warm",
                         "message": str(error)})
            continue
        rows.append({"solver": solver, "fulcrum_mm": float(again.last.p[0]) / MM, "cost": again.last_cost,
                     "success": again.success, "start": "warm", "message": again.message})
    return rows


# The best stride with other contacts that the data would have allowed as well.


def drawn_strides(found: StrideSolution, progress: Progress | None) -> list[DrawnStride]:
    """Searches again from the optimum with each of the options' draws (see `level1.uncertainty` for what is drawn)."""
    tuning, search, best = found.tuning, found.search, found.stride_or_best
    drawn = contact_draws(tuning.walker, tuning.trial.subject.prosthetic_side, tuning.options.draws,
                          tuning.options.seed)
    rows = []
    for i, values in enumerate(drawn):
        model = SagittalModel(tuning.walker, offsets=tuning.trial.offsets, values=values)
        other = StrideSearch(dataclasses.replace(tuning.stride, model=model), search.grid, search.smoothing,
                             search.cost, search.sizes, progress)
        solution = other.free(best.last, f"drawn contact {i + 1} of {len(drawn)}", i / len(drawn))
        if solution.status == "interrupted":
            raise KeyboardInterrupt
        good = solution.success
        rows.append(DrawnStride(
            f"drawn contact {i + 1}", float(solution.last.p[0]) / MM if good else float("nan"),
            solution.last_cost if good else float("nan"), outcomes(solution, other.costs) if good else {}))
    return rows


def spread(rows: list[DrawnStride], name: str) -> float | None:
    """Standard deviation of an outcome over the draws; None of fewer than two."""
    known = [row.outcomes[name] for row in rows if name in row.outcomes]
    return float(np.std(known, ddof=1)) if len(known) > 1 else None


# A tuning with a free motion as plain numbers: what `tuning.json` and `tuning.npz` hold.


FORMAT, LEVEL = "vsf_drake tuning 1", 2
UNITS = ("m", "1", "rad", "1")
SURE = 2.0
"""Standard deviations over the drawn contacts by which an outcome's range must exceed to matter (a choice)."""
LITTLE = 0.01
"""Share of the cost below which what a setting gains is called little (a choice)."""
NOTES = (
    "The stride is solved for in the sagittal plane: out-of-plane angles are zero, so that no knee adduction moment is "
    "known, and joints are driven by torques without muscles.",
    "The cost holds the motion and the force to the recording with a weight that is a choice; how far the optimum "
    "moves depends on it.",
    "Uncertainties are standard deviations over drawn contacts; none between trials is known from one stride.",
    "How far the position may be off is told by the cost tracking, whose optimum should be the recorded "
    "position: on the embedded subject it ends some 30 mm away.")


def stride_table(found: StrideSolution) -> dict[str, Any]:
    """The content of `tuning.json`: all keys of the format; None or empty where something was not reached."""
    tuning, best, search = found.tuning, found.shown, found.search
    label = " and ".join(LABELS[name] for name in search.weights) if tuning.cost == "weighted" else LABELS[tuning.cost]
    whole = sum(abs(value) for value in best.terms.values()) or 1.0
    rows = []
    for fixed in found.sweep:
        solution = fixed.solution
        rows.append({"fulcrum_mm": fixed.fulcrum_mm, "cost": None if solution is None else solution.last_cost,
                     "terms": {} if solution is None else solution.terms,
                     "outcomes": {} if solution is None else outcomes(solution, search.costs)})
    free = tuning.options.design
    reach = tuning.stride.reach_mm
    design = [{"name": "fulcrum", "unit": "mm", "value": float(best.last.p[0]) / MM, "low": reach[0],
               "high": reach[1], "default": found.tuning.stride.own_m / MM}]
    problem = best.problem
    design += [{"name": name, "unit": UNITS[i], "value": float(best.last.p[i]), "low": float(problem.p_low[i]),
                "high": float(problem.p_high[i]), "default": (np.nan, 1.0, 0.0, 1.0)[i]}
               for i, name in enumerate(DESIGN) if name in free]
    interval = _flat(found)
    return plain({
        "format": FORMAT, "level": LEVEL, "cost_name": tuning.cost, "cost_label": label, "cost_unit": found.cost_unit,
        "optimal": found.success, "status": found.message, "fulcrum_mm": float(best.last.p[0]) / MM,
        "cost": best.last_cost, "at_bound": list(best.at_bound) if found.success else [],
        "fulcrum_interval_mm": interval,
        "interval_meaning": "" if interval is None else f"fixed positions whose cost is within {100 * LITTLE:g} % of "
                                                         "the least",
        "design": design,
        "terms": [{"name": name, "label": LABELS[name], "value": value, "share": value / whole}
                  for name, value in best.terms.items()],
        "sweep": rows, "outcomes": _outcomes(found),
        "solver": {"name": "Gauss-Newton SQP", "message": best.message, "iterations": best.iterations,
                   "evaluations": best.evaluations, "violation": best.violation, "optimality": best.optimality},
        "confirmed_by": found.confirmed,
        "starts": [{"fulcrum_mm": mm, "end_mm": float(s.last.p[0]) / MM, "cost": s.last_cost, "success": s.success}
                   for mm, s in found.free],
        "checks": [vars(check) for check in found.checks], "tasks": [], "common_fulcrum_mm": None, "pareto": [],
        "pareto_names": [],
        "robustness": [{"what": row.what, "fulcrum_mm": row.fulcrum_mm, "cost": row.cost} for row in found.drawn],
        "trials": [tuning.label],
        "recorded_mm": [tuning.stride.own_m / MM], "synthetic": tuning.trial.synthetic,
        "notes": [*NOTES, *tuning.stride.recorded.notes, *_slow_or_lost(found)], "wall_s": found.wall_s,
        "provenance": {"options": to_plain(tuning.options)} | provenance(tuning.trial.inputs)})


def stride_arrays(found: StrideSolution) -> dict[str, np.ndarray]:
    """The content of `tuning.npz`, by name.

    Motion, torque (N m) and force (N) over the phase, recorded and, where it was, re-simulated.
    """
    costs, grid, best = found.search.costs, found.search.grid, found.shown.unsealed()
    y, reference, index = best.y(), costs.reference, costs.function.index
    torque = costs.function.starting_with("torque_")
    arrays = {"phase": grid.times_s / grid.duration_s, "names": np.array(costs.function.layout.coordinates),
              "q": best.z[:, costs.function.layout.q], "q_recorded": reference.q, "torque": y[:, torque],
              "torque_recorded": found.tracked.unsealed().y()[:, torque], "tracked_z": found.tracked.last.z,
              "tracked_p": found.tracked.last.p, "best_z": best.z, "best_p": best.p}
    for foot, force in reference.force.items():
        arrays[f"grf_{foot}"] = y[:, index(f"{foot}_fx", f"{foot}_fz")]
        if reference.known[foot].all():
            arrays[f"grf_{foot}_recorded"] = force
    count = grid.instants
    return arrays | {name: value[:count] for name, value in found.simulated.items()}


def _outcomes(found: StrideSolution) -> list[dict[str, Any]]:
    solved = [row.solution for row in found.sweep if row.solution is not None]
    if not solved:
        return []
    costs = found.search.costs
    at = {"softest": outcomes(solved[0], costs), "optimum": outcomes(found.shown, costs),
          "stiffest": outcomes(solved[-1], costs), "recorded": outcomes(found.tracked, costs)}
    rows = []
    for name, (label, unit) in KINDS.items():
        values = {setting: found_at[name] for setting, found_at in at.items()}
        shown = "" if unit == "1" else f" {unit}"
        over = [outcomes(solution, costs)[name] for solution in solved]
        error = spread(found.drawn, name)
        matters = None if error is None else bool(max(over) - min(over) > SURE * error)
        rows.append({"name": name, "label": label, "unit": unit, **values, "uncertainty": error, "matters": matters,
                     "sentence": f"{label[0].upper()}{label[1:]}: {values['softest']:.3g} at the softest, "
                                 f"{values['optimum']:.3g} at the best, {values['stiffest']:.3g}{shown} at the "
                                 f"stiffest setting; {values['recorded']:.3g} in the tracked recording."})
    return rows


def _flat(found: StrideSolution) -> list[float] | None:
    costs = [(row.fulcrum_mm, row.solution.last_cost) for row in found.sweep if row.solution is not None]
    if not costs or found.best is None:
        return None
    least = found.best.last_cost
    near = [mm for mm, cost in costs if cost <= least + LITTLE * abs(least)] + [float(found.best.last.p[0]) / MM]
    return [min(near), max(near)]


def _slow_or_lost(found: StrideSolution) -> list[str]:
    said = []
    lost = [f"{row.fulcrum_mm:.0f}" for row in found.sweep if row.solution is None and row.tried]
    if lost:
        said.append(f"No stride was found with the fulcrum fixed at {', '.join(lost)} mm.")
    other = [row for row in found.sweep if len({f"{cost:.4g}" for cost in row.tried.values() if np.isfinite(cost)}) > 1]
    if other:
        said.append(f"At {len(other)} of {len(found.sweep)} fixed positions different starts end at different strides; "
                    "the best counts.")
    return said
