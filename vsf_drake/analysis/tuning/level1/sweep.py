"""The cost over the whole range of the fulcrum, position by position: what every search is judged by."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.level1.costs import CONSISTENCY, Combination
from vsf_drake.analysis.tuning.level1.outcomes import NAMES, OutcomeKind, TrialTuning, outcomes
from vsf_drake.analysis.tuning.level1.problem import StiffnessTuning
from vsf_drake.analysis.validation.energy_same_load import ProsthesisEnergy, prosthesis_energy, walk_with_same_load
from vsf_drake.analysis.validation.energy_section import stance_energy
from vsf_drake.errors import SimulationError
from vsf_drake.motion.events import Stance, find_stances

ENERGY_EVERY = 5
"""Positions from one with energies to the next: they take long and vary smoothly (a choice)."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """Costs of T trials at m positions of the fulcrum.

    Attributes:
        fulcrum_mm: (m,). x: (m, P) the settings. step_s: of the walks.
        costs: by name of a cost, the consistency among them, (T, m); NaN where a walk failed.
        terms: of the tuned cost, by name, (T, m). labels: of the terms.
        outcomes: by name, (T, m); empty where they were not asked for. Stored and returned energy are known at every
            ENERGY_EVERY-th position and the last, NaN between.
        failures: why a walk failed, in words. unconverged: walks with steps that did not converge.
    """

    fulcrum_mm: np.ndarray
    x: np.ndarray
    step_s: float
    costs: dict[str, np.ndarray]
    terms: dict[str, np.ndarray]
    labels: dict[str, str]
    outcomes: dict[str, np.ndarray]
    failures: tuple[str, ...]
    unconverged: int

    @property
    def per_trial(self) -> np.ndarray:
        """(T, m) the tuned cost."""
        found: np.ndarray = np.sum([*self.terms.values()], axis=0)
        return found

    @property
    def cost(self) -> np.ndarray:
        """(m,) the tuned cost, the mean over trials."""
        found: np.ndarray = self.per_trial.mean(axis=0)
        return found

    @property
    def force_change(self) -> np.ndarray:
        """(m,) body weights, change of the ground reaction force from the recorded settings, mean over trials."""
        found: np.ndarray = np.sqrt(self.costs[CONSISTENCY]).mean(axis=0)
        return found

    def believable(self, allowed_bw: float) -> np.ndarray:
        """(m,) whether the force changes by no more than that: farther off nobody would walk the given motion."""
        found: np.ndarray = self.force_change <= allowed_bw
        return found

    def combined(self, combination: Combination) -> np.ndarray:
        """(T, m) another cost of the same walks."""
        found: np.ndarray = np.sum([factor * self.costs[name] for name, factor in combination.factors.items()], axis=0)
        return found


def positions(tuning: StiffnessTuning, spacing_mm: float) -> np.ndarray:
    """(m,) mm over the bounds at most `spacing_mm` apart, both ends included."""
    low, high = tuning.low[0], tuning.high[0]
    count = max(2, int(np.ceil((high - low) / spacing_mm - 1e-9)) + 1)
    return np.linspace(low, high, count)


def sweep(
    tuning: StiffnessTuning, fulcrum_mm: np.ndarray, x: np.ndarray, *, step_s: float, with_outcomes: bool = False,
    base: Mapping[str, float] | None = None, progress: Callable[[float], None] | None = None
) -> Sweep:
    """Walks every trial at every position, the rest of the setting as in x (P,); a walk that fails leaves NaN.

    Args:
        base: values of the walks' variables in place of the model's.
        progress: called with the finished fraction.
    """
    settings = np.tile(x, (len(fulcrum_mm), 1))
    settings[:, 0] = fulcrum_mm
    jobs = [(i, j) for j in range(len(settings)) for i in range(len(tuning.parts))]
    shape = (len(tuning.parts), len(settings))
    costs: dict[str, np.ndarray] = {}
    terms: dict[str, np.ndarray] = {}
    found = {name: np.full(shape, np.nan) for name in NAMES} if with_outcomes else {}
    labels: dict[str, str] = {}
    failures: list[str] = []
    unconverged = 0
    for part in tuning.parts:
        part.frame(step_s, base)  # made here: what threads share is not made by them

    def one(job: tuple[int, int]) -> tuple[dict, list, dict, bool] | str:
        part = tuning.parts[job[0]]
        try:
            walk = part.at(settings[job[1]], step_s=step_s, base=base)
        except SimulationError as error:
            return f"{part.label} at {settings[job[1], 0]:g} mm: {error}"
        return ({name: sum(term.value for term in own) for name, own in walk.terms.items()},
                [(term.name, term.label, term.value) for term in tuning.combination.terms(walk.terms)],
                outcomes(part, walk, energies=job[1] % ENERGY_EVERY == 0 or job[1] == len(settings) - 1)
                if with_outcomes else {}, bool(walk.walk.record.converged.all()))

    pool = ThreadPoolExecutor(tuning.workers)
    try:
        for k, (job, result) in enumerate(zip(jobs, pool.map(one, jobs), strict=True)):
            if isinstance(result, str):
                failures.append(result)
            else:
                for name, value in result[0].items():
                    costs.setdefault(name, np.full(shape, np.nan))[job] = value
                for name, label, value in result[1]:
                    labels[name] = label
                    terms.setdefault(name, np.full(shape, np.nan))[job] = value
                unconverged += not result[3]
                for name, value in result[2].items():
                    found[name][job] = value
            if progress:
                progress((k + 1) / len(jobs))
    finally:
        pool.shutdown(cancel_futures=True)
    return Sweep(fulcrum_mm=np.array(fulcrum_mm), x=settings, step_s=step_s, costs=costs, terms=terms, labels=labels,
                 outcomes=found, failures=tuple(failures), unconverged=unconverged)


def lowest(fulcrum_mm: np.ndarray, cost: np.ndarray) -> tuple[float, float]:
    """Where a curve (m,) is lowest and its value there, by a parabola through the lowest point and its neighbours.

    NaN where nothing is known.
    """
    if np.isnan(cost).all():
        return float("nan"), float("nan")
    i = int(np.nanargmin(cost))
    if not 0 < i < len(cost) - 1 or np.isnan(cost[i - 1 : i + 2]).any():
        return float(fulcrum_mm[i]), float(cost[i])
    a, b, c = np.polyfit(fulcrum_mm[i - 1 : i + 2] - fulcrum_mm[i], cost[i - 1 : i + 2], 2)
    if a <= 0.0:
        return float(fulcrum_mm[i]), float(cost[i])
    shift = float(np.clip(-b / (2.0 * a), fulcrum_mm[i - 1] - fulcrum_mm[i], fulcrum_mm[i + 1] - fulcrum_mm[i]))
    return float(fulcrum_mm[i]) + shift, float(a * shift**2 + b * shift + c)


def local_minima(cost: np.ndarray) -> list[int]:
    """Indices of the minima of a curve (m,), the ends among them, the lowest first."""
    filled = np.where(np.isnan(cost), np.inf, cost)
    padded = np.concatenate([[np.inf], filled, [np.inf]])
    found = [i for i in range(len(cost)) if np.isfinite(filled[i])
             and padded[i + 1] <= padded[i] and padded[i + 1] <= padded[i + 2]]
    return sorted(found, key=lambda i: filled[i])


# Walks at the settings that a reader compares: the softest, the best, the stiffest, and the one of the recording.


SOFTEST, OPTIMUM, STIFFEST, RECORDED = "softest", "optimum", "stiffest", "recorded"


@dataclass(frozen=True, eq=False)
class Setting:
    """Walks of T trials at one setting.

    Attributes:
        name: SOFTEST, OPTIMUM, STIFFEST (of the fulcrum's bounds, the rest as at the optimum) or RECORDED (each trial's
            own, the device as it is).
        x: (T, P). outcomes: by name, (T,); NaN where a walk failed.
        grf_W: by trial, (n, 3) N on the instants of the trial's frame, low-passed; None where the walk failed.
    """

    name: str
    x: np.ndarray
    outcomes: dict[str, np.ndarray]
    grf_W: tuple[np.ndarray | None, ...]


def compared_settings(tuning: StiffnessTuning, best: np.ndarray) -> tuple[Setting, ...]:
    """All four, with the optimum at best (P,)."""
    low, high = np.array(best), np.array(best)
    low[0], high[0] = tuning.low[0], tuning.high[0]
    own = np.array([part.own for part in tuning.parts])
    count = len(tuning.parts)
    return tuple(_setting(tuning, name, x) for name, x in (
        (SOFTEST, np.tile(low, (count, 1))), (OPTIMUM, np.tile(best, (count, 1))),
        (STIFFEST, np.tile(high, (count, 1))), (RECORDED, own)))


def _setting(tuning: StiffnessTuning, name: str, x: np.ndarray) -> Setting:
    numbers = {key: np.full(len(x), np.nan) for key in NAMES}
    force: list[np.ndarray | None] = []
    for i, part in enumerate(tuning.parts):
        try:
            walk = part.at(x[i], step_s=tuning.options.step_s)
        except SimulationError:
            force.append(None)
            continue
        for key, value in outcomes(part, walk).items():
            numbers[key][i] = value
        force.append(walk.loads.grf.value)
    return Setting(name=name, x=x, outcomes=numbers, grf_W=tuple(force))


# One setting for several motions against one for each, and the trade-off between two costs: read off a sweep.


WEIGHTS = tuple(np.linspace(0.0, 1.0, 11))


@dataclass(frozen=True)
class Task:
    """One motion: its own best position (mm) and cost, and the cost at the position that is best for all."""

    label: str
    fulcrum_mm: float
    cost: float
    cost_common: float


@dataclass(frozen=True)
class Compromise:
    """The position (mm) that is best for a weight of the first cost, and both costs there."""

    weight: float
    fulcrum_mm: float
    first: float
    second: float


def tasks(found: Sweep, names: Sequence[str], common_mm: float) -> tuple[Task, ...]:
    """By name of a motion, trials (T,) of one name together; none for a single motion."""
    labels = list(dict.fromkeys(names))
    if len(labels) < 2:
        return ()
    rows = []
    for label in labels:
        cost = found.per_trial[[i for i, name in enumerate(names) if name == label]].mean(axis=0)
        where, least = lowest(found.fulcrum_mm, cost)
        rows.append(Task(label, where, least, max(float(np.interp(common_mm, found.fulcrum_mm, cost)), least)))
    return tuple(rows)


def pareto(tuning: StiffnessTuning, found: Sweep) -> tuple[Compromise, ...]:
    """Best positions for weights of the options' two costs, each over its size; the consistency goes with every weight.

    None if a trial lacks one of the costs.
    """
    names = tuning.options.pareto
    if not names or any(name not in found.costs or name not in tuning.size for name in names):
        return ()
    first, second = (found.costs[name].mean(axis=0) for name in names)
    share = tuning.options.consistency_weight / tuning.options.consistency_bw**2
    rows = []
    for weight in WEIGHTS:
        factors = {names[0]: weight / tuning.size[names[0]], names[1]: (1.0 - weight) / tuning.size[names[1]],
                   CONSISTENCY: share}
        cost = found.combined(dataclasses.replace(tuning.combination, factors=factors)).mean(axis=0)
        where, _ = lowest(found.fulcrum_mm, cost)
        at = [float(np.interp(where, found.fulcrum_mm, curve)) for curve in (first, second)]
        rows.append(Compromise(float(weight), where, *at))
    return tuple(rows)


def consistency_effect(tuning: StiffnessTuning, found: Sweep) -> tuple[tuple[str, float, float], ...]:
    """Where the cost is least with other weights of the consistency: (what, mm, cost); none for tracking."""
    factors = dict(tuning.combination.factors)
    if CONSISTENCY not in factors:
        return ()
    rows = []
    for factor, what in ((0.0, "without"), (0.5, "with half"), (2.0, "with twice")):
        other = dataclasses.replace(tuning.combination, factors={**factors, CONSISTENCY: factor * factors[CONSISTENCY]})
        where, cost = lowest(found.fulcrum_mm, found.combined(other).mean(axis=0))
        rows.append((f"{what} the weight of the force's change", where, cost))
    return tuple(rows)


# What the settings do under the load of the recorded setting, rather than under its motion.
#
# With the motion given a stiffer foot is pressed as far and bears more. Experiments compare settings under about the
# same load: people carry the same weight on any foot. Here the pelvis rises and sinks by what keeps the vertical force
# that of the trial's own setting (`analysis.validation.energy_same_load`); everything else of the motion stays. It is
# no prediction of how a person adapts, and no cost counts it; it tells the direction in which the device works.


KINDS = (
    OutcomeKind("stored_energy_same_load", "energy stored under the recorded setting's load", "J"),
    OutcomeKind("returned_energy_same_load", "energy returned under the recorded setting's load", "J"),
    OutcomeKind("push_off_work_same_load", "push-off work under the recorded setting's load", "J/kg"))


def same_load_outcomes(
    tuning: StiffnessTuning, fulcrum_mm: np.ndarray, progress: Callable[[float], None] | None = None
) -> dict[str, np.ndarray]:
    """KINDS of every trial at positions (T, k) of the fulcrum, the device otherwise as it is: by name, (T, k).

    NaN where no height of the pelvis keeps the load, or a walk fails.

    Args:
        progress: called with the finished fraction.
    """
    found = {kind.name: np.full(fulcrum_mm.shape, np.nan) for kind in KINDS}
    jobs = [(i, float(at)) for i, row in enumerate(fulcrum_mm) for at in dict.fromkeys(row)]
    with ThreadPoolExecutor(tuning.workers) as pool:
        walked = pool.map(lambda job: _one(tuning.parts[job[0]], job[1]), jobs)
        for k, ((i, at), values) in enumerate(zip(jobs, walked, strict=True)):
            for kind, value in zip(KINDS, values, strict=True):
                found[kind.name][i, fulcrum_mm[i] == at] = value
            if progress:
                progress((k + 1) / len(jobs))
    return found


def _one(part: TrialTuning, fulcrum_mm: float) -> tuple[float, ...]:
    trial, options, none = part.trial, part.options, (float("nan"),) * len(KINDS)
    try:
        same = walk_with_same_load(part.walker, trial, fulcrum_m=1e-3 * fulcrum_mm, step_s=options.step_s,
                                   search_step_s=options.search_step_s)
    except SimulationError:
        return none
    energy = prosthesis_energy(part.walker, same.walk)
    stances = [stance for stance in find_stances(energy.time_s, energy.vertical_n) if stance.complete]
    if not same.kept or not stances:
        return none
    rows = [stance_energy(energy, stance, foot=trial.model.foot, fulcrum_m=1e-3 * fulcrum_mm).row
            for stance in stances]
    push_off = [_push_off(energy, stance, options.late_share) / trial.subject.mass_kg for stance in stances]
    return tuple(float(np.mean(values)) for values in (
        [row["stored_j"] for row in rows], [row["returned_j"] for row in rows], push_off))


def _push_off(energy: ProsthesisEnergy, stance: Stance, late_share: float) -> float:
    """J, positive work on the residual shank in late stance."""
    late = (energy.time_s >= stance.start_s + late_share * stance.duration_s) & (energy.time_s <= stance.end_s)
    step = energy.time_s[1] - energy.time_s[0]
    return float(np.sum(np.maximum(energy.shank_power[late], 0.0)) * step)
