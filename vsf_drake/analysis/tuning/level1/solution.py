"""What a tuning found, the way to it, and both as plain numbers: what `tuning.json` and `tuning.npz` hold."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsf_drake.analysis.tuning.common import FORMAT, OPTIMUM, RECORDED, SETTINGS, SOFTEST, STIFFEST, Check
from vsf_drake.analysis.tuning.level1.costs import LABELS
from vsf_drake.analysis.tuning.level1.problem import Evaluation, StiffnessTuning
from vsf_drake.analysis.tuning.level1.sweep import KINDS, SAME_LOAD, Sweep
from vsf_drake.analysis.tuning.level1.uncertainty import difference
from vsf_drake.errors import FitError
from vsf_drake.files import plain
from vsf_drake.schema import to_plain
from vsf_drake.sentences import say
from vsf_drake.simulation.archive import provenance

AT_BOUND = 1e-3  # share of a bound's width within which a variable counts as on the bound


@dataclass(frozen=True, eq=False)
class Search:
    """How one search from `start` to x (P,) ended."""

    solver: str
    step_s: float
    start: np.ndarray
    x: np.ndarray
    cost: float  # inf where the walk fails
    success: bool  # whether it ended at a minimum
    message: str
    iterations: int  # evaluations by the solver
    optimality: float  # largest component of the projected gradient, in sizes of the cost over a bound's width


@dataclass(kw_only=True, eq=False)
class TuningSolution:
    """The end of a tuning. Reading `values`, `fulcrum_mm` or `cost` of one that failed raises FitError.

    What had not been reached when a tuning was interrupted is empty or None.
    """

    tuning: StiffnessTuning
    success: bool = False  # whether a search ended at a minimum that the sweep confirms, where all walks converged
    message: str = ""  # how it ended, in words
    best: Evaluation = field(init=False)  # the best point found, whatever `success` says
    searched: Search | None = None  # the search that `best` is from
    searches: list[Search] = field(default_factory=list)  # of the fulcrum's range
    confirmed: list[Search] = field(default_factory=list)  # by other solvers
    sweep: Sweep | None = None  # through the best setting
    compared: Sweep | None = None  # of SETTINGS, the recorded one each trial's own, the device as it is
    same_load: dict[str, np.ndarray] = field(default_factory=dict)  # SAME_LOAD by name, (T, 4)
    interval_mm: list[float] | None = None  # of the fulcrum position
    interval_meaning: str = ""  # what it holds
    worth: dict[str, Any] = field(default_factory=dict)  # of the cost's range: uncertainty, matters, sentence
    draws: list[Sweep] = field(default_factory=list)  # by draw of the contact
    draw_failures: list[str] = field(default_factory=list)  # why some could not be walked
    tasks: list[dict[str, Any]] = field(default_factory=list)  # this and the next two as the table has them
    pareto: list[dict[str, Any]] = field(default_factory=list)
    robustness: list[dict[str, Any]] = field(default_factory=list)
    checks: list[Check] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)  # what a reader has to know
    wall_s: float = 0.0

    @property
    def values(self) -> dict[str, float]:
        """What was tuned, by name, in the units of `tuning.design`. Raises FitError if the tuning failed."""
        if not self.success:
            raise FitError(f"the tuning did not come to an optimum: {self.message}")
        return {variable.name: float(x) for variable, x in zip(self.tuning.design, self.best.x, strict=True)}

    @property
    def fulcrum_mm(self) -> float:
        """Of the best setting, from A. Raises FitError if the tuning failed."""
        return self.values["fulcrum"]

    @property
    def cost(self) -> float:
        """Of the best setting, in the cost's unit. Raises FitError if the tuning failed."""
        return self.best.cost if self.values else float("nan")

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Names of what ended on a bound, whether the tuning failed or not."""
        u = self.tuning.to_u(self.best.x)
        return tuple(variable.name for variable, at in zip(self.tuning.design, u, strict=True)
                     if at < AT_BOUND or at > 1.0 - AT_BOUND)


def tuning_table(solution: TuningSolution) -> dict[str, Any]:
    """The content of `tuning.json`: all `common.KEYS`, None or empty where something is not known or reached.

    One of a tuning that failed says so with `optimal` false.
    """
    tuning, best, swept = solution.tuning, solution.best, solution.sweep
    searched, combination = solution.searched, tuning.combination
    terms = {name: float(term[0]) for name, term in best.terms.items()}
    whole = sum(map(abs, terms.values())) or 1.0  # terms of both signs may cancel
    rows = [] if swept is None else [
        {"fulcrum_mm": mm, "cost": swept.cost[j], **{
            part: {name: each[:, j].mean() for name, each in values.items()}
            for part, values in (("terms", swept.terms), ("outcomes", swept.outcomes))}}
        for j, mm in enumerate(swept.fulcrum_mm)]
    inputs = {f"{label}: {file}": digest for label, trial in zip(tuning.labels, tuning.trials, strict=True)
              for file, digest in trial.inputs.items()}
    return plain({
        "format": FORMAT, "level": 1, "cost_name": tuning.cost_name, "cost_label": combination.label,
        "cost_unit": combination.unit, "optimal": solution.success, "status": solution.message,
        "fulcrum_mm": float(best.x[0]), "cost": best.cost, "at_bound": list(solution.at_bound),
        "fulcrum_interval_mm": solution.interval_mm, "interval_meaning": solution.interval_meaning,
        "design": [{"name": v.name, "unit": v.unit, "value": float(x), "low": v.low, "high": v.high,
                    "default": v.default} for v, x in zip(tuning.design, best.x, strict=True)],
        "terms": [{"name": name, "label": LABELS[name], "value": value, "share": value / whole}
                  for name, value in terms.items()],
        "sweep": rows, "outcomes": _outcomes(solution),
        "solver": {"name": searched and searched.solver, "message": searched.message if searched else solution.message,
                   "iterations": searched and searched.iterations, "evaluations": tuning.evaluations,
                   "violation": 0.0, "optimality": searched and searched.optimality},
        "confirmed_by": [{"solver": other.solver, "fulcrum_mm": float(other.x[0]), "cost": other.cost,
                          "success": other.success, "start": float(other.start[0]), "message": other.message}
                         for other in solution.confirmed],
        "starts": [{"fulcrum_mm": float(s.start[0]), "end_mm": float(s.x[0]), "cost": s.cost, "success": s.success}
                   for s in solution.searches],
        "checks": [vars(check) for check in solution.checks], "tasks": solution.tasks,
        "common_fulcrum_mm": float(best.x[0]) if solution.tasks else None, "pareto": solution.pareto,
        "pareto_names": tuning.options.pareto if solution.pareto else [], "robustness": solution.robustness,
        "trials": tuning.labels, "recorded_mm": [float(part.own[0]) for part in tuning.parts],
        "synthetic": any(trial.synthetic for trial in tuning.trials), "notes": solution.notes,
        "wall_s": solution.wall_s,
        "provenance": {"options": to_plain(tuning.options)} | provenance(inputs, tuning.options.seed)})


def _outcomes(solution: TuningSolution) -> list[dict[str, Any]]:
    """Means over trials; `uncertainty`: standard deviation over repeated trials of an outcome's range."""
    tuning, swept = solution.tuning, solution.sweep
    rows: list[dict[str, Any]] = []
    if swept is not None and solution.worth:
        rows.append({"name": "cost", "label": tuning.combination.label, "unit": tuning.combination.unit,
                     SOFTEST: float(swept.cost[0]), OPTIMUM: solution.best.cost, STIFFEST: float(swept.cost[-1]),
                     RECORDED: tuning.own_cost, **solution.worth})
    for name, each in (solution.compared.outcomes | solution.same_load if solution.compared else {}).items():
        label, unit = (KINDS | SAME_LOAD)[name]
        at = dict(zip(SETTINGS, each.mean(axis=0).tolist(), strict=True))
        change = difference(swept.outcomes.get(name, each) if swept else each, tuning.groups)
        finite = bool(np.isfinite(each).all())
        matters = change.matters(max(map(abs, at.values()))) if finite or name in KINDS else None
        told = say("level1", "outcome", label=label, unit=unit, known=finite, range=change.range, spread=change.spread,
                   matters=matters, softest=at[SOFTEST], optimum=at[OPTIMUM], stiffest=at[STIFFEST])
        rows.append({"name": name, "label": label, "unit": unit, **at, "uncertainty": change.spread,
                     "matters": matters, "sentence": told[0]})
    return rows


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
    tuning, swept = solution.tuning, solution.sweep
    found: dict[str, np.ndarray] = {}
    if swept is not None:
        found |= {"sweep_mm": swept.fulcrum_mm, "sweep_cost_trials": swept.per_trial.T}
        for kind, rows in (("term", swept.terms), ("cost", swept.costs), ("outcome", swept.outcomes)):
            found |= {f"sweep_{kind}_{name}": value.T for name, value in rows.items()}
    if solution.draws:
        found["draw_mm"] = solution.draws[0].fulcrum_mm
        found["draw_cost"] = np.array([draw.cost for draw in solution.draws]).T
    nearest = int(np.argmin([abs(part.own[0] - solution.best.x[0]) for part in tuning.parts]))
    forces = solution.compared.forces if solution.compared else {}
    for i, part in enumerate(tuning.parts if forces else ()):
        frame = part.frame(tuning.options.step_s)
        shown = {"time": frame.time_s} | {name: forces[i, s] for s, name in enumerate(SETTINGS) if (i, s) in forces}
        shown |= {} if frame.plate_W is None else {RECORDED: frame.plate_W}
        for prefix in (f"trial_{i}_", *(["grf_"] if i == nearest else [])):
            found |= {f"{prefix}{name}": force for name, force in shown.items()}
    return found
