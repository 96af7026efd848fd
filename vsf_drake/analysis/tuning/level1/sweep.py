"""The cost over the whole range of the fulcrum, position by position: what every search is judged by."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.level1.combination import CONSISTENCY, Combination
from vsf_drake.analysis.tuning.level1.outcomes import NAMES, outcomes
from vsf_drake.analysis.tuning.level1.problem import StiffnessTuning
from vsf_drake.errors import SimulationError

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
