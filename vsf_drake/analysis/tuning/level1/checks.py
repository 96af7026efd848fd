"""What a solution is held against: differences, the sweep, other solvers, another step, no smoothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.level1.costs import CONSISTENCY, TRACKING
from vsf_drake.analysis.tuning.level1.problem import Evaluation, StiffnessTuning
from vsf_drake.analysis.tuning.level1.search import Search, search
from vsf_drake.analysis.tuning.level1.sweep import Sweep, lowest
from vsf_drake.errors import SimulationError

NEAR_MM, NEAR_COST, SAME_COST, GRADIENT = 1.0, 5e-3, 1e-3, 0.01
"""Agreement asked for: with the sweep in mm and in sizes of the cost, of solvers in sizes, of the gradient with central
differences."""
FORCE_BW = 0.1
"""Error of the force at the recorded setting beyond which a model tells little of other settings (a choice)."""
AT = (0.31, 0.67)
"""Shares of the bounds' widths at which the gradient is tried: at the optimum it is zero and tells nothing."""
DIFFERENCE = 1e-4
"""Step of the central differences, share of a bound's width."""


@dataclass(frozen=True)
class Check:
    """One check: its value and what was asked for, and what it says; `met` None where it could not be made."""

    name: str
    label: str
    value: float | None
    unit: str
    target: float | None
    met: bool | None
    sentence: str


def sweep_checks(best: Evaluation, found: Sweep, size: float) -> list[Check]:
    """Position and cost against the lowest of the sweep, by a parabola between its positions.

    A sweep that is coarser than a millimetre can only tell whether one of its positions is better.
    """
    where, least = lowest(found.fulcrum_mm, found.cost)
    step = found.fulcrum_mm[1] - found.fulcrum_mm[0]
    fine = step <= NEAR_MM + 1e-9
    away = abs(best.x[0] - where)
    worse = (best.cost - (least if fine else float(np.nanmin(found.cost)))) / size
    return [
        Check("brute_force_position", "distance from the sweep's minimum", float(away), "mm", NEAR_MM,
              bool(away <= NEAR_MM),
              f"The sweep in steps of {step:.2g} mm is lowest at {where:.1f} mm, the search ends at "
              f"{best.x[0]:.1f} mm."),
        Check("brute_force_cost", "difference from the sweep's minimum", float(worse), "size of the cost", NEAR_COST,
              bool((-NEAR_COST if fine else -np.inf) <= worse <= NEAR_COST),
              f"The cost of the search's end is the sweep's least {worse:+.2%} of the cost's size.")]


def solver_checks(best: Evaluation, confirmed: Sequence[Search], size: float) -> list[Check]:
    """Where other solvers end that began where the best search did."""
    found = []
    for other in confirmed:
        away, apart = abs(other.x[0] - best.x[0]), abs(other.cost - best.cost) / size
        met = bool(other.success and away <= NEAR_MM and apart <= SAME_COST)
        name = other.solver.upper()
        found.append(Check(f"solver_{other.solver}", f"difference of the cost where {name} ends", float(apart),
                           "size of the cost", SAME_COST, met,
                           f"{name} ends at {other.x[0]:.1f} mm, {away:.2g} mm away ({other.message})."))
    return found


def gradient_check(tuning: StiffnessTuning) -> Check:
    """Exact derivatives against central differences, each variable at two settings away from the optimum."""
    worst, told = 0.0, ""
    width = tuning.high - tuning.low
    try:
        for share in AT:
            x = tuning.low + share * width
            exact = tuning.evaluate(x, step_s=tuning.options.search_step_s).gradient * width
            for p, variable in enumerate(tuning.design):
                step = np.zeros(len(x))
                step[p] = DIFFERENCE * width[p]
                ends = [tuning.evaluate(x + s * step, derivatives=False, step_s=tuning.options.search_step_s).cost
                        for s in (1.0, -1.0)]
                central = (ends[0] - ends[1]) / (2.0 * DIFFERENCE)
                error = abs(exact[p] - central) / max(abs(central), 1e-3 * tuning.combination.size)
                if error >= worst:
                    worst, told = error, f"{variable.label} at {x[p]:.4g} {variable.unit}"
    except SimulationError as error:
        return Check("gradient", "error of the gradient", None, "1", GRADIENT, None, f"It could not be tried: {error}")
    return Check("gradient", "largest error of the gradient against central differences", float(worst), "1", GRADIENT,
                 bool(worst <= GRADIENT), f"The largest, {worst:.2g}, is that of the {told}.")


def smoothing_check(tuning: StiffnessTuning, best: Evaluation) -> list[Check]:
    """What the smoothing of the support changes: the cost at the optimum, and the optimum; none without smoothing."""
    if tuning.options.support_width_m == 0.0:
        return []
    sharp = tuning.without_smoothing()
    size = tuning.combination.size
    try:
        there = sharp.evaluate(best.x, derivatives=False).cost
        ended = search(sharp, best.x, step_s=tuning.options.step_s)
    except SimulationError as error:
        return [Check("smoothing", "change of the cost without smoothing", None, "size of the cost", NEAR_COST, None,
                      f"It could not be tried: {error}")]
    change, away = abs(there - best.cost) / size, abs(ended.x[0] - best.x[0])
    return [Check("smoothing", "change of the cost without smoothing", float(change), "size of the cost",
                  NEAR_COST, bool(change <= NEAR_COST),
                  f"Without it the cost at the optimum differs by {change:.2%} of its size."),
            Check("smoothing_shift", "shift of the optimum without smoothing", float(away), "mm", NEAR_MM,
                  bool(away <= NEAR_MM), f"A search without it ends {away:.2g} mm away ({ended.message}).")]


def step_check(best: Evaluation, searched: Search) -> Check:
    """How far the optimum moves from the step of the search to that of the numbers."""
    away = abs(best.x[0] - searched.x[0])
    return Check("step", "shift of the optimum between the two steps", float(away), "mm", NEAR_MM,
                 bool(away <= NEAR_MM),
                 f"In steps of {1e3 * searched.step_s:g} ms the optimum is at {searched.x[0]:.1f} mm, of "
                 f"{1e3 * best.step_s:g} ms at {best.x[0]:.1f} mm.")


def force_check(best: Evaluation, allowed_bw: float) -> Check:
    """How much of the given motion the optimum contradicts: the change of force from the recorded settings."""
    change = float(np.mean([np.sqrt(walk.terms[CONSISTENCY][0].value) for walk in best.walks]))
    return Check("force_change", "change of the ground reaction force from the recorded setting", change, "BW",
                 allowed_bw, bool(change <= allowed_bw),
                 f"At the optimum the force differs by {change:.1%} body weight (root mean square over stance) from "
                 "that at the recorded setting, though the motion is the same: "
                 + ("little enough to be read." if change <= allowed_bw else "nobody would walk so."))


def recorded_check(tuning: StiffnessTuning) -> list[Check]:
    """How far the model's force at the recorded settings is from the plates'; none without plates."""
    if not all(TRACKING in terms for terms in tuning.own):
        return []
    errors = [np.sqrt(sum(term.value for term in terms[TRACKING])) for terms in tuning.own]
    worst = int(np.argmax(errors))
    return [Check("recorded_force", "error of the ground reaction force at the recorded setting", float(errors[worst]),
                  "BW", FORCE_BW, bool(errors[worst] <= FORCE_BW),
                  f"At the recorded setting the force is {errors[worst]:.1%} body weight off the plate (root mean "
                  f"square over stance, all components; {tuning.labels[worst]}, the worst trial).")]


def convergence_check(best: Evaluation) -> Check:
    """Steps of the optimum's walks that did not converge."""
    count = best.unconverged
    return Check("convergence", "steps of the walks that did not converge", float(count), "1", 0.0, count == 0,
                 "Every step of the walks at the optimum converged." if count == 0 else
                 f"{count} steps of the walks at the optimum did not converge: the cost there is not to be trusted.")
