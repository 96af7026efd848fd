"""One fit of the study, judged, as plain values."""

from __future__ import annotations

import dataclasses
import os
import time
from typing import Any

from contact_fit_study.cases import KEEL_SPREAD, PAPER, WRONG_KEEL, Case, transfer
from contact_fit_study.floors import floor_bw
from contact_fit_study.inputs import bench, trial
from vsf_drake.base.errors import FitError, SimulationError
from vsf_drake.base.files import plain
from vsf_drake.fit.assessment import Assessment, BenchRow, TrialScore, assess, bench_score
from vsf_drake.fit.options import RESULTANT, ContactFitOptions, PaperOptions
from vsf_drake.fit.paper import PaperEnd
from vsf_drake.fit.problem import ContactFit
from vsf_drake.fit.solution import ContactFitSolution, JointEnd, solve
from vsf_drake.fit.table import bench_json
from vsf_drake.walks.fulcrum_sweep import SWEEP_STEP_S

SEED = 0
KEEL, FULCRUM = "keel.flexural_modulus", "fulcrum.stiffness"
METRICS = (
    "grf_rmse_bw",
    "grf_r2",
    "vertical_rmse_bw",
    "fore_aft_rmse_bw",
    "medio_lateral_rmse_bw",
    "cop_rmse_fl",
    "impulse_rmse_bws",
    "null_model_grf_rmse_bw",
    "stretched_null_grf_rmse_bw",
    "stance_measured_s",
    "stance_model_s",
    "heel_strike_error_s",
    "toe_off_error_s",
    "unconverged_steps",
)
"""What is kept of `walk_metrics`."""
BENCH = (
    "rmse_n_per_mm",
    "fulcrum_mm",
    "measured_n_per_mm",
    "model_n_per_mm",
    "heel_measured_n_per_mm",
    "heel_model_n_per_mm",
    "mid_range",
)


def run(case: Case) -> dict[str, Any]:
    """Fits and judges; a fit that fails is told as such."""
    judged_by = {
        name: floor_bw(case.tier, name, fitted=name in case.fitted)
        for name in (*case.fitted, *case.held_out)
    }
    told: dict[str, Any] = {
        "tier": case.tier,
        "strategy": case.strategy,
        "fitted": list(case.fitted),
        "held_out": list(case.held_out),
        "bench_fitted": case.bench and case.strategy != PAPER,
        "seed": SEED,
    }
    load, wall, cpu = os.getloadavg()[0], time.perf_counter(), time.process_time()
    try:
        solution = _solve(case)
        times = {
            "wall_s": time.perf_counter() - wall,
            "cpu_s": time.process_time() - cpu,
            "load_before": load,
        }
        found = assess(
            solution,
            [trial(case.tier, name) for name in case.held_out],
            leave_out=case.leave_out,
            angle_errors=False,
            layers=False,
            floors=judged_by,
        )
    except (FitError, SimulationError) as error:
        return {**told, "failed": str(error)}
    told |= {
        "time": times,
        "ended": solution.message,
        "left_out": _left_out(found),
        "trials": {score.label: _trial(score) for score in found.scores},
    }
    told |= _paper(solution.end, case) if isinstance(solution.end, PaperEnd) else _joint(solution)
    measured = bench_json(found.bench or _bench_of(solution))
    return {**told, "bench": {name: measured.get(name) for name in BENCH}}


def warm_up(tier: str) -> None:
    """Compiles, or loads, everything that the timed fits need."""
    case = transfer(tier)
    fit = ContactFit([trial(tier, name) for name in case.fitted], bench=bench())
    fit.evaluate(fit.parameters.start)
    fit.evaluate(fit.parameters.start, derivatives=False)
    held = trial(tier, case.held_out[0])
    fit.terms_of(held, None).walk(fit.parameters.start, step_s=SWEEP_STEP_S)


def _solve(case: Case) -> ContactFitSolution:
    trials = [trial(case.tier, name) for name in case.fitted]
    if case.strategy == PAPER:
        return solve(
            ContactFit(trials, bench=bench(), options=PaperOptions(seed=SEED, settled=case.settled))
        )
    options = ContactFitOptions(starts=case.starts, seed=SEED)
    if case.resultant:
        options = dataclasses.replace(options, series=(RESULTANT,))
    fit = ContactFit(trials, bench=bench() if case.bench else None, options=options)
    if not case.keel_known:
        keel = fit.parameters.by_name[KEEL].start * WRONG_KEEL
        unknown = fit.parameters.changed([KEEL, FULCRUM], frozen=False, scale=KEEL_SPREAD).changed(
            [KEEL], start=keel, mean=keel
        )
        fit = ContactFit(
            trials, bench=fit.bench, parameters=unknown, options=options, walker=fit.walker
        )
    return solve(fit)


def _trial(score: TrialScore) -> dict[str, Any]:
    kept = {name: getattr(score.metrics, name) for name in METRICS}
    times = kept["stance_model_s"], kept["stance_measured_s"]
    assert score.sweep is not None
    return {
        "role": score.role,
        "fulcrum_mm": score.sweep.true_mm,
        **kept,
        "stance_time_error_s": None if None in times else times[0] - times[1],
        "floor_grf_rmse_bw": score.floor_grf_rmse_bw,
        "sweep": {
            name: getattr(score.sweep, name)
            for name in ("fulcrum_mm", "grf_rmse_bw", "best_mm", "right")
        },
    }


def _left_out(found: Assessment) -> list[dict[str, Any]]:
    return [plain(row) for row in found.left_out]


def _joint(solution: ContactFitSolution) -> dict[str, Any]:
    assert isinstance(solution.end, JointEnd)
    told, searches = solution.end.uncertainty, solution.end.searches
    return {
        "starts": len(searches),
        "series": list(solution.fit.options.series),
        "values": solution.values,
        "standard_errors": dict(zip(told.names, map(float, told.standard_error), strict=True)),
        "not_identified": list(told.unidentified),
        "at_bound": list(told.at_bound),
        "searches": [
            {
                "start_cost": s.start_cost,
                "cost": s.cost,
                "converged": s.success,
                "message": s.message,
                "evaluations": s.evaluations,
                "failed": s.failed,
            }
            for s in searches
        ],
    }


def _paper(end: PaperEnd, case: Case) -> dict[str, Any]:
    state = end.state
    return {
        "values": end.values,
        "initial_values": end.initial_values,
        "rms_n": state.rms_n(state.objective_n2),
        "initial_rms_n": state.rms_n(state.initial_objective_n2),
        "iterations": len(state.history),
        "simulations": state.simulations,
        "failed_simulations": state.failed_simulations,
        "settled": case.settled,
        "history": [list(row) for row in state.history],
    }


def _bench_of(solution: ContactFitSolution) -> BenchRow:
    """Of a fit that was not given the bench: it judges it all the same."""
    fit = solution.fit
    found = bench_score(
        dataclasses.replace(
            solution,
            fit=ContactFit(
                fit.trials,
                bench=bench(),
                parameters=fit.parameters,
                options=fit.options,
                walker=fit.walker,
            ),
        )
    )
    assert found is not None
    return found
