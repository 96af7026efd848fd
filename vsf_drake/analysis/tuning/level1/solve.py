"""Finds the setting with the least cost: a coarse sweep, searches from its minima, a fine sweep to judge them by."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import qmc

from vsf_drake.analysis.tuning.level1.checks import (
    NEAR_COST,
    Check,
    convergence_check,
    force_check,
    gradient_check,
    recorded_check,
    smoothing_check,
    solver_checks,
    step_check,
    sweep_checks,
)
from vsf_drake.analysis.tuning.level1.costs import CONSISTENCY, TRACKING
from vsf_drake.analysis.tuning.level1.problem import Evaluation, StiffnessTuning
from vsf_drake.analysis.tuning.level1.search import WORSE, Search, Tried, search
from vsf_drake.analysis.tuning.level1.solution import TuningSolution
from vsf_drake.analysis.tuning.level1.sweep import (
    Sweep,
    compared_settings,
    consistency_effect,
    local_minima,
    pareto,
    positions,
    same_load_outcomes,
    sweep,
    tasks,
)
from vsf_drake.analysis.tuning.level1.uncertainty import drawn_optima, fulcrum_uncertainty
from vsf_drake.errors import FitError, InputError
from vsf_drake.motion.fitted_trial import APPLIED

COARSE_MM = 5.0
"""Of the sweep that searches begin from (a choice)."""


@dataclass(frozen=True)
class TuningProgress:
    """Where a tuning is.

    Attributes:
        stage: what is being done, in words. fraction: of the stage, where it is known.
        evaluations: settings so far. cost, fulcrum_mm: the lowest of the running search; None elsewhere.
        elapsed_s: since the tuning began.
    """

    stage: str
    fraction: float | None
    evaluations: int
    cost: float | None
    fulcrum_mm: float | None
    elapsed_s: float


@dataclass(eq=False)
class _Found:
    """What has been reached so far; an interrupt leaves it as it is."""

    tried: Tried
    searches: list[Search] = field(default_factory=list)
    polished: Search | None = None
    coarse: Sweep | None = None
    fine: Sweep | None = None
    confirmed: list[Search] = field(default_factory=list)
    checks: list[Check] = field(default_factory=list)
    later: dict[str, Any] = field(default_factory=dict)
    stage: str = ""


def solve(
    tuning: StiffnessTuning, *, progress: Callable[[TuningProgress], None] | None = None,
    warm_start: Mapping[str, Any] | None = None
) -> TuningSolution:
    """Tunes. An interrupt (Ctrl-C) ends it early: the best point so far comes back in a solution that failed.

    Args:
        progress: called after each walk of a sweep and each evaluation of a search.
        warm_start: the content of a `tuning.json`, from whose setting one more search begins.

    Raises:
        InputError: `warm_start` is of other variables.
        FitError: the walks fail at every setting.
    """
    began = time.perf_counter()
    warm = _warm(tuning, warm_start)
    found = _Found(tried=Tried(tuning, tuning.options.search_step_s))

    def told(fraction: float | None = None, cost: float | None = None, fulcrum: float | None = None) -> None:
        if progress:
            progress(TuningProgress(found.stage, fraction, tuning.evaluations, cost, fulcrum,
                                    time.perf_counter() - began))

    message = ""
    try:
        _search(tuning, found, warm, told)
        if found.polished is not None and np.isfinite(found.polished.cost):
            _judge(tuning, found, told)
    except KeyboardInterrupt:
        if found.tried.best is None:
            raise
        message = f"it was interrupted during: {found.stage}"
    return _solution(tuning, found, message, began)


def _search(tuning: StiffnessTuning, found: _Found, warm: list[np.ndarray], told: Callable[..., None]) -> None:
    """Coarse sweep, searches from it, the best once more in the step of the numbers."""
    options = tuning.options
    found.stage = "coarse sweep"
    found.coarse = sweep(tuning, positions(tuning, COARSE_MM), tuning.start, step_s=options.search_step_s,
                         progress=told)
    minima = local_minima(found.coarse.cost)[: options.starts]
    if not minima:
        raise FitError(f"the walks fail at every position: {found.coarse.failures[0]}")
    starts = [found.coarse.x[i] for i in minima] + _scattered(tuning) + warm
    for k, start in enumerate(starts):
        found.stage = f"search {k + 1} of {len(starts)}"
        found.searches.append(search(tuning, start, step_s=options.search_step_s, tried=found.tried,
                                     progress=lambda count, cost, at: told(None, cost, at)))
    best = min(found.searches, key=lambda s: (not s.success, s.cost))
    found.stage = "search in the step of the numbers"
    found.polished = search(tuning, best.x, step_s=options.step_s, tried=found.tried,
                            progress=lambda count, cost, at: told(None, cost, at))


def _judge(tuning: StiffnessTuning, found: _Found, told: Callable[..., None]) -> None:
    """The fine sweep, again the search if that is better, other solvers, and what the optimum is worth."""
    options, size = tuning.options, tuning.combination.size
    assert found.polished is not None
    for _ in range(2):
        found.stage = "sweep"
        found.fine = sweep(tuning, positions(tuning, options.sweep_mm), found.polished.x, step_s=options.step_s,
                           with_outcomes=True, progress=told)
        i = int(np.nanargmin(found.fine.cost))
        if found.fine.cost[i] >= found.polished.cost - WORSE * size:
            break
        found.stage = "search from the sweep's lowest position"
        found.polished = search(tuning, found.fine.x[i], step_s=options.step_s, tried=found.tried,
                                progress=lambda count, cost, at: told(None, cost, at))
        if len(tuning.design) == 1:
            break
    fine, best = found.fine, tuning.evaluate(found.polished.x)
    assert fine is not None
    found.later["settings"] = compared_settings(tuning, best.x)
    if options.same_load:
        found.stage = "settings under one load"
        ends = np.tile([tuning.low[0], best.x[0], tuning.high[0], np.nan], (len(tuning.parts), 1))
        ends[:, 3] = [part.own[0] for part in tuning.parts]
        found.later["same_load"] = same_load_outcomes(tuning, ends, told)
    first = min(found.searches, key=lambda s: (not s.success, s.cost))
    for name in options.confirm:
        found.stage = f"confirming with {name.upper()}"
        found.confirmed.append(search(tuning, first.start, solver=name, step_s=options.step_s, tried=found.tried,
                                      progress=lambda count, cost, at: told(None, cost, at)))
    found.stage = "draws of the contact"
    draws, failures = drawn_optima(tuning, best.x, told) if options.draws else ((), ())
    found.later |= {"draws": draws, "draw_failures": failures}
    found.later["uncertainty"] = fulcrum_uncertainty(fine, float(best.x[0]), draws, tuning.groups,
                                                     size=size, unit=tuning.combination.unit,
                                                     allowed_bw=options.consistency_bw,
                                                     gain=(tuning.own_cost - best.cost) / size)
    found.later |= {"tasks": tasks(fine, tuning.tasks, float(best.x[0])), "pareto": pareto(tuning, fine)}
    found.later["robustness"] = (
        *consistency_effect(tuning, fine),
        *((f"draw {k + 1} of the contact", draw.fulcrum_mm, draw.cost) for k, draw in enumerate(draws)))
    found.stage = "checks"
    found.checks = [*sweep_checks(best, fine, size), *solver_checks(best, found.confirmed, size),
                    gradient_check(tuning), step_check(best, first), *smoothing_check(tuning, best),
                    convergence_check(best),
                    force_check(best, options.consistency_bw), *recorded_check(tuning)]


def _scattered(tuning: StiffnessTuning) -> list[np.ndarray]:
    """Seeded starts over all bounds, for a setting of several variables."""
    count = tuning.options.more_starts if len(tuning.design) > 1 else 0
    if not count:
        return []
    rng = np.random.default_rng([tuning.options.seed, 1])
    return [tuning.from_u(u) for u in qmc.LatinHypercube(len(tuning.design), rng=rng).random(count)]


def _warm(tuning: StiffnessTuning, table: Mapping[str, Any] | None) -> list[np.ndarray]:
    if table is None:
        return []
    try:
        named = {row["name"]: float(row["value"]) for row in table["design"]} | {"fulcrum": float(table["fulcrum_mm"])}
        x = np.array([named[variable.name] for variable in tuning.design])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"does not hold {', '.join(v.name for v in tuning.design)}", where="warm_start",
                         right="Give the content of a tuning.json of the same variables") from error
    return [np.clip(x, tuning.low, tuning.high)]


def _solution(tuning: StiffnessTuning, found: _Found, message: str, began: float) -> TuningSolution:
    best: Evaluation | None = found.tried.best
    if found.polished is not None and np.isfinite(found.polished.cost):
        best = tuning.evaluate(found.polished.x)
    if best is None:
        raise FitError("the walks fail wherever a search starts")
    message = message or _fault(tuning, found, best)
    success = not message
    later: dict[str, Any] = {
        "settings": (), "same_load": {}, "draws": (), "draw_failures": (), "uncertainty": None, "tasks": (),
        "pareto": (), "robustness": ()} | found.later
    return TuningSolution(
        tuning=tuning, success=success, message=message or (found.polished.message if found.polished else ""),
        best=best, searched=found.polished, searches=tuple(found.searches), confirmed=tuple(found.confirmed),
        coarse=found.coarse, sweep=found.fine, checks=tuple(found.checks),
        notes=notes(tuning, best, found.fine, later["draw_failures"], success=success),
        wall_s=time.perf_counter() - began, **later)


def _fault(tuning: StiffnessTuning, found: _Found, best: Evaluation) -> str:
    """Why this is no optimum; nothing if it is one."""
    if found.polished is None or found.fine is None or not found.polished.success:
        return f"the search did not converge: {found.polished.message if found.polished else 'it never ended'}"
    if best.unconverged:
        return f"{best.unconverged} steps of the walks at the best setting did not converge"
    i = int(np.nanargmin(found.fine.cost))
    if best.cost - found.fine.cost[i] > NEAR_COST * tuning.combination.size:
        return (f"the sweep is lower at {found.fine.fulcrum_mm[i]:.1f} mm than the search's end at {best.x[0]:.1f} mm")
    return ""


# What a reader of a tuning has to know before believing it.


_APART_MM = 1.0


def notes(
    tuning: StiffnessTuning, best: Evaluation, found: Sweep | None, draw_failures: tuple[str, ...], *, success: bool
) -> tuple[str, ...]:
    """Sentences; the first says so if the result is not optimal."""
    options, told = tuning.options, []
    if not success:
        told.append("NOT OPTIMAL: the tuning ended before its end, and these are the numbers where it stopped.")
    told += [
        "The motion is given: the person does not adapt. Under the same motion a stiffer foot is pressed as far and "
        "bears and stores more; under the same load, as experiments have it, a softer one stores and returns more. "
        "Which of the two a person would do, the tuning with free motion asks.",
        "With the motion given the intact leg is the recording's at every setting: no cost counts it.",
        f"Walks are in steps of {1e3 * options.step_s:g} ms, those that look for starts and those of drawn contacts in "
        f"steps of {1e3 * options.search_step_s:g} ms."]
    if options.support_width_m > 0.0:
        width = 1e3 * tuning.parts[0].support_width_m
        told.append(f"The support passes a joint of the keel over {width:.3g} mm on either side, so that the cost has "
                    "a derivative there.")
    if CONSISTENCY in tuning.combination.factors:
        told.append(_share(tuning, best))
    if found is not None:
        told.append(_believable(found, options.consistency_bw))
    if "keel_thickness" in options.design:
        told.append("A thicker keel is stiffer by the cube of its thickness; that it is heavier too is left out.")
    own = [part.own[0] for part in tuning.parts]
    if np.ptp(own) > _APART_MM and tuning.cost_name != TRACKING:
        told.append(f"The trials were walked with the fulcrum from {min(own):.0f} to {max(own):.0f} mm. Each motion "
                    "belongs to its own setting, and one setting for all is a compromise between them.")
    if tuning.cost_name == TRACKING:
        told.append("Tracking is a test, no aim: its optimum tells where the model believes the fulcrum to have stood. "
                    "It stood at " + ", ".join(f"{value:.0f}" for value in sorted(set(own))) + " mm.")
    general = [part.label for part in tuning.parts
               if not any(note.startswith(APPLIED) for note in part.trial.notes)]
    if general:
        told.append(f"No contact was fitted for {', '.join(general)}: the forces are those of a foot and a fit to the "
                    "limb in general.")
    if found is not None and found.failures:
        told.append(f"{len(found.failures)} walks of the sweep failed, the first of {found.failures[0]}")
    if found is not None and found.unconverged:
        told.append(f"{found.unconverged} walks of the sweep have steps that did not converge.")
    if draw_failures:
        told.append(f"{len(draw_failures)} draws of the contact could not be walked: {draw_failures[0]}")
    synthetic = sum(trial.synthetic for trial in tuning.trials)
    if synthetic:
        told.append(f"{synthetic} of {len(tuning.trials)} trials are synthetic: nobody walked them.")
    return tuple(told)


def _believable(found: Sweep, allowed_bw: float) -> str:
    near = found.believable(allowed_bw)
    most = f"over the whole range it changes by up to {np.nanmax(found.force_change):.0%}"
    if not near.any():
        return (f"Nowhere does the ground reaction force stay within {allowed_bw:.0%} body weight of that at the "
                f"recorded settings ({most}): these motions do not go together.")
    low, high = found.fulcrum_mm[near][[0, -1]]
    return (f"From {low:.0f} to {high:.0f} mm the ground reaction force stays within {allowed_bw:.0%} body weight of "
            f"that at the recorded setting; {most}. Farther away the given motion is none that anybody would walk, and "
            "the numbers there say no more than that.")


def _share(tuning: StiffnessTuning, best: Evaluation) -> str:
    options = tuning.options
    part = next(term.value for term in best.terms if term.name == CONSISTENCY)
    return (f"A change of the ground reaction force by {options.consistency_bw:.0%} body weight (root mean square over "
            f"stance, against the recorded setting) adds {options.consistency_weight:.0%} of the cost's size: nothing "
            f"in the given motion pays for it. At the optimum that part is {part / tuning.combination.size:.1%} of the "
            "size. The weight is a choice, and with the motion given it decides how far the optimum may go from the "
            "recorded setting: see what other weights would choose.")
