"""Solves a tuning with a motion that adapts, by trajectory optimisation of its stride."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from vsf_drake.analysis.tuning.common import COSTS, FORMAT, OPTIMUM, RECORDED, SOFTEST, STIFFEST, WEIGHTED, Check
from vsf_drake.analysis.tuning.level1.uncertainty import contact_draws
from vsf_drake.analysis.tuning.level2.costs import LABELS
from vsf_drake.analysis.tuning.level2.search import (
    KINDS,
    DrawnStride,
    Fixed,
    Progress,
    StrideSearch,
    StrideSolution,
    StrideTuning,
    outcomes,
    swept,
    tracked,
    unless_interrupted,
)
from vsf_drake.analysis.tuning.level2.stride import MM, OWN
from vsf_drake.analysis.tuning.resimulation import (
    resimulate_prescribed,
    resimulate_with_feedback,
    solved_trajectory,
)
from vsf_drake.collocation.program import confirm
from vsf_drake.collocation.solution import Start, TrajectorySolution, resampled
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.files import plain
from vsf_drake.schema import to_plain
from vsf_drake.sentences import say
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.sagittal.model import DESIGN, SagittalModel

ANGLE_DEG, FORCE_BW = 2.0, 0.06
"""What a tracked stride may differ from its recording by, root mean square (a choice)."""
VIOLATION, STARTS_MM = 1e-6, 1.0
UNITS = ("m", "1", "rad", "1")
SURE = 2.0
"""Standard deviations over the drawn contacts by which an outcome's range must exceed to matter (a choice)."""
LITTLE = 0.01
"""Share of the cost below which what a setting gains is called little (a choice)."""


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
    began, warm = time.perf_counter(), None
    if warm_start is not None:
        if not {"tracked_z", "tracked_p"} <= warm_start.keys():
            raise InputError("holds no stride", where="warm_start", right="Give the result of a tuning at level 2")
        warm = Start(z=np.array(warm_start["tracked_z"]), p=np.array(warm_start["tracked_p"]))
    stages = tracked(tuning.stride, tuning.grid, progress, warm)
    found = StrideSolution(tuning=tuning, tracked=stages[-1], search=StrideSearch(
        tuning.stride, tuning.grid, tuning.options.stages[-1], tuning.cost, progress=progress))
    try:
        found.message = _search(found, progress)
    except KeyboardInterrupt:
        found.message = f"interrupted while {found.doing}"
    found.wall_s = time.perf_counter() - began
    return found


def _search(found: StrideSolution, progress: Progress | None) -> str:
    """Fills `found`; returns how it ended."""
    options, search = found.tuning.options, found.search
    if not unless_interrupted(found.tracked).success:
        return f"the recorded stride could not be tracked: {found.tracked.message}"
    search.sizes = {name: search.costs.of(name).value(found.tracked.y(), search.grid.weights) for name in COSTS}
    found.doing = "sweeping the fulcrum"
    swept(search, found.tracked.last, found.sweep, chains=options.confirm != ())
    good = [fixed for fixed in found.sweep if fixed.solution is not None]
    if not good:
        return "no fixed position of the fulcrum could be solved"
    found.doing = "searching with the fulcrum free"
    for i, fixed in enumerate(_spread(good, options.starts)):
        solution = search.free(fixed.solution.last, f"free from {fixed.fulcrum_mm:.0f} mm", i / options.starts)
        found.free.append((fixed.fulcrum_mm, solution))
        unless_interrupted(solution)
    if found.best is None:
        return "no search with the fulcrum free converged: " + found.free[0][1].message
    found.doing = "checking the solution"
    _check(found, found.best, progress)
    found.drawn = _drawn(found, found.best)
    for solver in options.confirm:
        if progress:
            progress(f"confirming with {solver}", 0.9, None)
        found.confirmed.append(_confirmed(found.best, solver, options.time_limit_s))
    return "first-order conditions hold"


def _spread(good: list[Fixed], count: int) -> list[Fixed]:
    """The best of a sweep, then the ones farthest from all taken."""
    taken = [min(good, key=lambda fixed: fixed.solution.last_cost)]
    while len(taken) < min(count, len(good)):
        rest = [fixed for fixed in good if fixed not in taken]
        taken.append(max(rest, key=lambda fixed: min(abs(fixed.fulcrum_mm - other.fulcrum_mm) for other in taken)))
    return taken


# Checks of an optimal stride: carried out by the full model, on a finer mesh, with softer contact, by other solvers.


def _check(found: StrideSolution, best: TrajectorySolution, progress: Progress | None) -> None:
    """Fills `found.checks` and `found.simulated`."""
    tuning, search = found.tuning, found.search

    def add(name: str, label: str, value: float | None, unit: str, target: str, met: bool | None, *, part: str = "",
            **numbers: Any) -> None:
        found.checks.append(Check(name, label, value, unit, target, met, say("stride", part or name, **numbers)[0]))

    worst, force = _tracking_errors(found)
    add("tracking_motion", "tracked stride, worst angle", worst, "deg", f"<= {ANGLE_DEG:g}", worst <= ANGLE_DEG,
        worst=worst)
    add("tracking_force", "tracked stride, resultant force of the worse foot", 100.0 * force, "% body weight",
        f"<= {100.0 * FORCE_BW:g}", force <= FORCE_BW, force=force)
    add("violation", "largest violation of an equation", best.violation, "scaled", f"<= {VIOLATION:g}",
        best.violation <= VIOLATION)
    fixed = [row.solution.last_cost for row in found.sweep if row.solution is not None]
    add("fixed_positions", "against the best fixed position", best.last_cost - min(fixed), "1", "<= 0",
        best.last_cost <= min(fixed) + 1e-9, cost=best.last_cost, count=len(fixed), least=min(fixed))
    ends = [float(solution.last.p[0]) / MM for _, solution in found.free if solution.success]
    if len(found.free) > 1:
        spread = max(ends) - min(ends)
        add("starts", "where searches from several positions end", spread, "mm", f"<= {STARTS_MM:g}",
            spread <= STARTS_MM and len(ends) == len(found.free), converged=len(ends), count=len(found.free),
            spread=spread)
    if progress:
        progress("re-simulating", 0.5, None)
    trajectory = solved_trajectory(best, tuning.walker, advance=best.problem.advance, offsets=tuning.trial.offsets)
    for kind, simulate in (("prescribed", resimulate_prescribed), ("feedback", resimulate_with_feedback)):
        try:
            run = simulate(tuning.walker, trajectory)
        except SimulationError as error:
            found.checks.append(Check(f"resimulation_{kind}", f"re-simulation, {kind}", None, "% body weight", "",
                                      False, str(error)))
        else:
            found.checks.append(Check(**run.check_row()))
            found.simulated |= run.arrays()
    if not tuning.options.confirm:
        return
    finer = dataclasses.replace(search, grid=search.stride.grid(2 * search.grid.intervals))
    smoothing = dataclasses.replace(search.smoothing, depth_m=2.0 * search.smoothing.depth_m)
    softer = dataclasses.replace(search, smoothing=smoothing)
    for name, label, other in (
            ("mesh", "twice as many intervals", finer.free(resampled(best, finer.grid), "finer mesh", 0.6)),
            ("smoothing", "contact smoothed over twice the depth", softer.free(best.last, "softer contact", 0.7))):
        moved = float(other.last.p[0] - best.last.p[0]) / MM if other.success else None
        add(name, label, moved, "mm", "", None, part="change", label_of=label, moved=moved, message=other.message,
            change=other.last_cost / best.last_cost - 1.0)


def _tracking_errors(found: StrideSolution) -> tuple[float, float]:
    """Of the tracked stride: worst angle (deg), resultant force of the worse foot (body weights), RMS."""
    costs, y = found.search.costs, found.tracked.y()
    angles = np.degrees(y[:, costs.function.starting_with("q_")] - costs.reference.q)
    worst, force = max(float(np.sqrt(np.mean(angles[:, i] ** 2))) for i in (0, *range(3, angles.shape[1]))), 0.0
    for foot, known in costs.reference.force.items():
        rows = costs.reference.known[foot]
        if rows.any():
            size = np.linalg.norm(y[:, costs.function.index(f"{foot}_fx", f"{foot}_fz")], axis=1)
            difference = (size - np.linalg.norm(known, axis=1))[rows] / costs.weight_n
            force = max(force, float(np.sqrt(np.mean(difference**2))))
    return worst, force


def _confirmed(best: TrajectorySolution, solver: str, time_limit_s: float) -> dict[str, Any]:
    """The row of a solver that searches again from the optimum."""
    row: dict[str, Any] = {"solver": solver, "fulcrum_mm": None, "cost": None, "success": False, "start": "warm"}
    try:
        again = confirm(best.problem, best.last, solver, time_limit_s=time_limit_s)
    except (InputError, RuntimeError) as error:
        return row | {"message": str(error)}
    return row | {"fulcrum_mm": float(again.last.p[0]) / MM, "cost": again.last_cost, "success": again.success,
                  "message": again.message}


def _drawn(found: StrideSolution, best: TrajectorySolution) -> list[DrawnStride]:
    """The best stride with each drawn contact that the data would have allowed as well, see `level1.uncertainty`."""
    tuning, search, rows = found.tuning, found.search, []
    drawn = contact_draws(tuning.walker, tuning.trial.subject.prosthetic_side, tuning.options.draws,
                          tuning.options.seed)
    for i, values in enumerate(drawn):
        model = SagittalModel(tuning.walker, offsets=tuning.trial.offsets, values=values)
        other = dataclasses.replace(search, stride=dataclasses.replace(tuning.stride, model=model))
        solution = unless_interrupted(
            other.free(best.last, f"drawn contact {i + 1} of {len(drawn)}", i / len(drawn)))
        rows.append(DrawnStride(
            f"drawn contact {i + 1}", float(solution.last.p[0]) / MM if solution.success else float("nan"),
            solution.last_cost if solution.success else float("nan"),
            outcomes(solution, other.costs) if solution.success else {}))
    return rows


# A tuning with a free motion as plain numbers: what `tuning.json` and `tuning.npz` hold.


def stride_table(found: StrideSolution) -> dict[str, Any]:
    """The content of `tuning.json`: all `common.KEYS`; None or empty where something was not reached."""
    tuning, best, search = found.tuning, found.shown, found.search
    label = " and ".join(LABELS[name] for name in search.weights) if tuning.cost == WEIGHTED else LABELS[tuning.cost]
    whole = sum(abs(value) for value in best.terms.values()) or 1.0
    rows = []
    for fixed in found.sweep:
        solution = fixed.solution
        rows.append({"fulcrum_mm": fixed.fulcrum_mm, "cost": None if solution is None else solution.last_cost,
                     "terms": {} if solution is None else solution.terms,
                     "outcomes": {} if solution is None else outcomes(solution, search.costs)})
    reach, problem, own_mm = tuning.stride.reach_mm, best.problem, tuning.stride.own_m / MM
    design = [{"name": "fulcrum", "unit": "mm", "value": float(best.last.p[0]) / MM, "low": reach[0],
               "high": reach[1], "default": own_mm}]
    design += [{"name": name, "unit": UNITS[i], "value": float(best.last.p[i]), "low": float(problem.p_low[i]),
                "high": float(problem.p_high[i]), "default": float(OWN[i])}
               for i, name in enumerate(DESIGN) if name in tuning.options.design]
    near = _as_good(found)
    lost = [row.fulcrum_mm for row in found.sweep if row.solution is None and row.tried]
    other = [row for row in found.sweep if len({f"{cost:.4g}" for cost in row.tried.values() if np.isfinite(cost)}) > 1]
    notes = [*say("stride", "limits"), *tuning.stride.recorded.notes,
             *say("stride", "sweep", lost=lost, different=len(other), count=len(found.sweep))]
    return plain({
        "format": FORMAT, "level": 2, "cost_name": tuning.cost, "cost_label": label, "cost_unit": "1",
        "optimal": found.success, "status": found.message, "fulcrum_mm": float(best.last.p[0]) / MM,
        "cost": best.last_cost, "at_bound": list(best.at_bound) if found.success else [], "fulcrum_interval_mm": near,
        "interval_meaning": say("stride", "interval", little=LITTLE)[0] if near else "", "design": design,
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
        "trials": [tuning.label], "recorded_mm": [own_mm], "synthetic": tuning.trial.synthetic, "notes": notes,
        "wall_s": found.wall_s, "provenance": {"options": to_plain(tuning.options)} | provenance(tuning.trial.inputs)})


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
    """At four settings; `uncertainty`: standard deviation over the drawn contacts, None of fewer than two."""
    solved = [row.solution for row in found.sweep if row.solution is not None]
    if not solved:
        return []
    costs, rows = found.search.costs, []
    swept_outcomes = [outcomes(solution, costs) for solution in solved]
    at = {SOFTEST: swept_outcomes[0], OPTIMUM: outcomes(found.shown, costs), STIFFEST: swept_outcomes[-1],
          RECORDED: outcomes(found.tracked, costs)}
    for name, (label, unit) in KINDS.items():
        values = {setting: found_at[name] for setting, found_at in at.items()}
        over = [each[name] for each in swept_outcomes]
        drawn = [row.outcomes[name] for row in found.drawn if row.outcomes]
        error = float(np.std(drawn, ddof=1)) if len(drawn) > 1 else None
        matters = None if error is None else bool(max(over) - min(over) > SURE * error)
        rows.append({"name": name, "label": label, "unit": unit, **values, "uncertainty": error, "matters": matters,
                     "sentence": say("stride", "outcome", label=label, unit=unit, **values)[0]})
    return rows


def _as_good(found: StrideSolution) -> list[float] | None:
    """Between which fixed positions the cost is as good as the least."""
    costs = [(row.fulcrum_mm, row.solution.last_cost) for row in found.sweep if row.solution is not None]
    if not costs or found.best is None:
        return None
    least = found.best.last_cost
    near = [mm for mm, cost in costs if cost <= least + LITTLE * abs(least)] + [float(found.best.last.p[0]) / MM]
    return [min(near), max(near)]
