"""What a tuning found, and the way to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.analysis.tuning.level1.checks import Check
from vsf_drake.analysis.tuning.level1.outcomes import KINDS, OutcomeKind
from vsf_drake.analysis.tuning.level1.problem import Evaluation, StiffnessTuning
from vsf_drake.analysis.tuning.level1.search import Search
from vsf_drake.analysis.tuning.level1.sweep import KINDS as SAME_LOAD
from vsf_drake.analysis.tuning.level1.sweep import (
    OPTIMUM,
    RECORDED,
    SOFTEST,
    STIFFEST,
    Compromise,
    Setting,
    Sweep,
    Task,
)
from vsf_drake.analysis.tuning.level1.uncertainty import Difference, Draw, FulcrumUncertainty, difference
from vsf_drake.errors import FitError
from vsf_drake.json_file import plain
from vsf_drake.schema import to_plain
from vsf_drake.simulation.archive import provenance

AT_BOUND = 1e-3
"""Share of a bound's width within which a variable counts as on the bound."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TuningSolution:
    """The end of a tuning. Reading `values`, `fulcrum_mm` or `cost` of one that failed raises FitError.

    What had not been reached when a tuning was interrupted is empty or None.

    Attributes:
        tuning: the problem.
        success: whether a search ended at a minimum that the sweep confirms and at which all walks converged.
        message: how it ended, in words.
        best: the best point found, whatever `success` says.
        searched: the search that `best` is from. searches: of the fulcrum's range. confirmed: by other solvers.
        coarse, sweep: the sweep that searches began from, and the fine one through the best setting.
        settings: what walks are like at the softest, best, stiffest and recorded setting.
        same_load: outcomes under one load (`sweep`) by name, (T, 4) at those settings.
        uncertainty: of the fulcrum position. draws: of the contact, and draw_failures: why some could not be walked.
        tasks, pareto, robustness: see `sweep`; robustness rows are (what, mm, cost).
        checks: what the solution was held against.
        notes: what a reader has to know. wall_s: of the whole.
    """

    tuning: StiffnessTuning
    success: bool
    message: str
    best: Evaluation
    searched: Search | None
    searches: tuple[Search, ...]
    confirmed: tuple[Search, ...]
    coarse: Sweep | None
    sweep: Sweep | None
    settings: tuple[Setting, ...]
    same_load: dict[str, np.ndarray]
    uncertainty: FulcrumUncertainty | None
    draws: tuple[Draw, ...]
    draw_failures: tuple[str, ...]
    tasks: tuple[Task, ...]
    pareto: tuple[Compromise, ...]
    robustness: tuple[tuple[str, float, float], ...]
    checks: tuple[Check, ...]
    notes: tuple[str, ...]
    wall_s: float

    def check(self) -> None:
        """Raises FitError if the tuning failed."""
        if not self.success:
            raise FitError(f"the tuning did not come to an optimum: {self.message}")

    @property
    def values(self) -> dict[str, float]:
        """What was tuned, by name, in the units of `tuning.design`. Raises FitError if the tuning failed."""
        self.check()
        return {variable.name: float(x) for variable, x in zip(self.tuning.design, self.best.x, strict=True)}

    @property
    def fulcrum_mm(self) -> float:
        """Of the best setting, from A. Raises FitError if the tuning failed."""
        self.check()
        return float(self.best.x[0])

    @property
    def cost(self) -> float:
        """Of the best setting, in the cost's unit. Raises FitError if the tuning failed."""
        self.check()
        return self.best.cost

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Names of what ended on a bound, whether the tuning failed or not."""
        u = self.tuning.to_u(self.best.x)
        return tuple(variable.name for variable, at in zip(self.tuning.design, u, strict=True)
                     if at < AT_BOUND or at > 1.0 - AT_BOUND)


# A tuning as plain numbers: what `tuning.json` and `tuning.npz` hold.


FORMAT, LEVEL = "vsf_drake tuning 1", 1


def tuning_table(solution: TuningSolution) -> dict[str, Any]:
    """The content of `tuning.json`: all keys of the format, None or empty where something is not known or reached.

    One of a tuning that failed says so with `optimal` false.
    """
    tuning, best, found = solution.tuning, solution.best, solution.uncertainty
    whole = sum(abs(term.value) for term in best.terms) or 1.0  # terms of both signs may cancel
    return plain({
        "format": FORMAT, "level": LEVEL, "cost_name": tuning.cost_name, "cost_label": tuning.combination.label,
        "cost_unit": tuning.combination.unit, "optimal": solution.success, "status": solution.message,
        "fulcrum_mm": float(best.x[0]), "cost": best.cost, "at_bound": list(solution.at_bound),
        "fulcrum_interval_mm": None if found is None else [found.low_mm, found.high_mm],
        "interval_meaning": "" if found is None else found.meaning,
        "design": [{"name": v.name, "unit": v.unit, "value": float(x), "low": v.low, "high": v.high,
                    "default": v.default} for v, x in zip(tuning.design, best.x, strict=True)],
        "terms": [{"name": term.name, "label": term.label, "value": term.value, "share": term.value / whole}
                  for term in best.terms],
        "sweep": _sweep(solution), "outcomes": _outcomes(solution), "solver": _solver(solution),
        "confirmed_by": [_confirmed(other) for other in solution.confirmed],
        "starts": [{"fulcrum_mm": float(s.start[0]), "end_mm": float(s.x[0]), "cost": s.cost, "success": s.success}
                   for s in solution.searches],
        "checks": [vars(check) for check in solution.checks],
        "tasks": [vars(task) for task in solution.tasks],
        "common_fulcrum_mm": float(best.x[0]) if solution.tasks else None,
        "pareto": [vars(row) for row in solution.pareto],
        "pareto_names": list(tuning.options.pareto) if solution.pareto else [],
        "robustness": [{"what": what, "fulcrum_mm": at, "cost": cost} for what, at, cost in solution.robustness],
        "trials": list(tuning.labels), "recorded_mm": [float(part.own[0]) for part in tuning.parts],
        "synthetic": any(trial.synthetic for trial in tuning.trials),
        "notes": list(solution.notes), "wall_s": solution.wall_s,
        "provenance": {"options": to_plain(tuning.options)} | provenance({f"{label}: {file}": digest
                                  for label, trial in zip(tuning.labels, tuning.trials, strict=True)
                                  for file, digest in trial.inputs.items()}, tuning.options.seed)})


def tuning_arrays(solution: TuningSolution) -> dict[str, np.ndarray]:
    """The content of `tuning.npz`: arrays by name.

        sweep_mm (m,), sweep_cost_trials (m, T)         the tuned cost
        sweep_term_NAME, sweep_cost_NAME, sweep_outcome_NAME (m, T)
        draw_mm (d,), draw_cost (d, D)                  of drawn contacts
        grf_time (n,) s, grf_softest, grf_optimum, grf_stiffest, grf_recorded (n, 3) N in W
                                                        of the trial whose own position is nearest to the optimum
        trial_K_time, trial_K_softest, ...              the same of every trial, K counting from 0

    T trials in the order of the table. `recorded` is the plate where there is one, else the model at the own setting.
    """
    found: dict[str, np.ndarray] = {}
    if solution.sweep is not None:
        swept = solution.sweep
        found |= {"sweep_mm": swept.fulcrum_mm, "sweep_cost_trials": swept.per_trial.T}
        for kind, rows in (("term", swept.terms), ("cost", swept.costs), ("outcome", swept.outcomes)):
            found |= {f"sweep_{kind}_{name}": value.T for name, value in rows.items()}
    if solution.draws:
        found["draw_mm"] = solution.draws[0].sweep.fulcrum_mm
        found["draw_cost"] = np.array([draw.sweep.cost for draw in solution.draws]).T
    each = [_forces(solution, i) for i in range(len(solution.tuning.parts))] if solution.settings else []
    for i, forces in enumerate(each):
        found |= {f"trial_{i}_{name}": value for name, value in forces.items()}
    if each:
        own = [abs(part.own[0] - solution.best.x[0]) for part in solution.tuning.parts]
        found |= {f"grf_{name}": value for name, value in each[int(np.argmin(own))].items()}
    return found


def _forces(solution: TuningSolution, i: int) -> dict[str, np.ndarray]:
    """Of the i-th trial: `time` and, by setting, the force; settings whose walk failed are left out."""
    frame = solution.tuning.parts[i].frame(solution.tuning.options.step_s)
    found: dict[str, np.ndarray] = {"time": frame.time_s}
    for setting in solution.settings:
        force = setting.grf_W[i]
        if force is not None:
            found[setting.name] = force
    return found | ({} if frame.plate_W is None else {RECORDED: frame.plate_W})


def _sweep(solution: TuningSolution) -> list[dict[str, Any]]:
    swept = solution.sweep
    if swept is None:
        return []
    means = {name: value.mean(axis=0) for name, value in swept.terms.items()}
    outcomes = {name: value.mean(axis=0) for name, value in swept.outcomes.items()}
    return [{"fulcrum_mm": at, "cost": swept.cost[j], "terms": {name: value[j] for name, value in means.items()},
             "outcomes": {name: value[j] for name, value in outcomes.items()}}
            for j, at in enumerate(swept.fulcrum_mm)]


def _outcomes(solution: TuningSolution) -> list[dict[str, Any]]:
    """Means over trials; `uncertainty`: standard deviation over repeated trials of an outcome's range."""
    if not solution.settings or solution.sweep is None:
        return []
    by_name = {setting.name: setting.outcomes for setting in solution.settings}
    rows = [] if solution.uncertainty is None else [_cost_row(solution, solution.uncertainty)]
    for kind in KINDS:
        at = {name: float(np.mean(by_name[name][kind.name])) for name in (SOFTEST, OPTIMUM, STIFFEST, RECORDED)}
        change = difference(solution.sweep.outcomes[kind.name], solution.tuning.groups)
        matters = change.matters(max(abs(value) for value in at.values()))
        rows.append({"name": kind.name, "label": kind.label, "unit": kind.unit, **at, "uncertainty": change.spread,
                     "matters": matters, "sentence": _told(kind, at, change, matters)})
    return rows + _same_load(solution)


def _same_load(solution: TuningSolution) -> list[dict[str, Any]]:
    rows = []
    for kind in SAME_LOAD:
        if kind.name in solution.same_load:
            each = solution.same_load[kind.name]
            at = dict(zip((SOFTEST, OPTIMUM, STIFFEST, RECORDED), map(float, each.mean(axis=0)), strict=True))
            change = difference(each, solution.tuning.groups)
            matters = change.matters(float(np.abs(list(at.values())).max())) if np.isfinite(each).all() else None
            rows.append({"name": kind.name, "label": kind.label, "unit": kind.unit, **at, "uncertainty": change.spread,
                         "matters": matters, "sentence": _told(kind, at, change, matters)})
    return rows


def _cost_row(solution: TuningSolution, known: FulcrumUncertainty) -> dict[str, Any]:
    """The cost itself among the outcomes; at the recorded setting it is the mean of each trial at its own."""
    tuning, swept = solution.tuning, solution.sweep
    assert swept is not None
    return {"name": "cost", "label": tuning.combination.label, "unit": tuning.combination.unit,
            SOFTEST: float(swept.cost[0]), OPTIMUM: solution.best.cost, STIFFEST: float(swept.cost[-1]),
            RECORDED: tuning.own_cost, "uncertainty": known.spread, "matters": known.matters,
            "sentence": known.sentence}


def _told(kind: OutcomeKind, at: dict[str, float], change: Difference, matters: bool | None) -> str:
    unit = "" if kind.unit == "1" else f" {kind.unit}"
    text = (f"{kind.label[0].upper()}{kind.label[1:]}: {at[SOFTEST]:.3g} at the softest, {at[OPTIMUM]:.3g} at the "
            f"best, {at[STIFFEST]:.3g}{unit} at the stiffest setting")
    if not np.isfinite(list(at.values())).all():
        return f"{kind.label[0].upper()}{kind.label[1:]}: not known at every setting."
    if change.spread is None:
        return f"{text}; {'the setting hardly matters to it' if matters is False else 'repeated trials are missing'}."
    told = f"it differs by up to {change.range:.2g}{unit}, from trial to trial that varies by {change.spread:.2g}{unit}"
    return f"{text}; {told}{'' if matters else ': the setting hardly matters to it'}."


def _solver(solution: TuningSolution) -> dict[str, Any]:
    searched = solution.searched
    if searched is None:
        return {"name": None, "message": solution.message, "iterations": None,
                "evaluations": solution.tuning.evaluations, "violation": 0.0, "optimality": None}
    return {"name": searched.solver, "message": searched.message, "iterations": searched.iterations,
            "evaluations": solution.tuning.evaluations, "violation": 0.0, "optimality": searched.optimality}


def _confirmed(other: Search) -> dict[str, Any]:
    return {"solver": other.solver, "fulcrum_mm": float(other.x[0]), "cost": other.cost, "success": other.success,
            "start": float(other.start[0]), "message": other.message}
