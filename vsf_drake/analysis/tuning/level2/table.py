"""A tuning with a free motion as plain numbers: what `tuning.json` and `tuning.npz` hold."""

from __future__ import annotations

from typing import Any

import numpy as np

from vsf_drake.analysis.tuning.level2.costs import LABELS
from vsf_drake.analysis.tuning.level2.outcomes import KINDS, outcomes
from vsf_drake.analysis.tuning.level2.robustness import spread
from vsf_drake.analysis.tuning.level2.solution import StrideSolution
from vsf_drake.analysis.tuning.level2.stride import MM
from vsf_drake.json_file import plain
from vsf_drake.schema import to_plain
from vsf_drake.simulation.provenance import provenance
from vsf_drake.simulation.sagittal.model import DESIGN

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
