"""One setting for several motions against one for each, and the trade-off between two costs: read off a sweep."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.level1.combination import CONSISTENCY
from vsf_drake.analysis.tuning.level1.problem import StiffnessTuning
from vsf_drake.analysis.tuning.level1.sweep import Sweep, lowest

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
