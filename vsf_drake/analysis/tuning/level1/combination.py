"""A cost as a sum of the costs of one walk, each with a factor that is fixed before the search."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.level1.costs.force_change import consistency, tracking
from vsf_drake.analysis.tuning.level1.costs.joint_load import joint_load
from vsf_drake.analysis.tuning.level1.costs.metabolic import metabolic
from vsf_drake.analysis.tuning.level1.costs.push_off import push_off
from vsf_drake.analysis.tuning.level1.costs.term import CostTerm
from vsf_drake.analysis.tuning.level1.frame import StanceFrame
from vsf_drake.analysis.tuning.level1.loads import WalkLoads
from vsf_drake.analysis.tuning.level1.options import COSTS, WEIGHTED, TuningOptions

CONSISTENCY = "consistency"
TRACKING = "tracking"
LABELS = {"joint_load": "load on the prosthetic leg and residual limb", "metabolic": "joint-work estimate of energy",
          "push_off": "push-off work, with a minus", "tracking": "deviation from the recorded ground reaction force",
          WEIGHTED: "weighted sum of costs"}
UNITS = {"joint_load": "1", "metabolic": "J/kg", "push_off": "J/kg", "tracking": "BW²", WEIGHTED: "1"}
LEAST_TRACKING = 0.01**2
"""BW²: a recorded force is not known better than 1 % of body weight, so that tracking is not divided by less."""

Terms = dict[str, tuple[CostTerm, ...]]
"""Terms of one walk by cost, those of CONSISTENCY too."""


@dataclass(frozen=True)
class Combination:
    """J = sum over costs of factor times cost.

    Attributes:
        name, label, unit: of the whole. factors: by cost, CONSISTENCY among them.
        size: of J without the consistency at the trials' own settings, positive.
    """

    name: str
    label: str
    unit: str
    factors: Mapping[str, float]
    size: float

    def terms(self, walk: Terms) -> tuple[CostTerm, ...]:
        """What it is the sum of, for one walk: parts of a single cost, or the costs of a weighted one."""
        found: list[CostTerm] = []
        for name, factor in self.factors.items():
            if self.name == WEIGHTED and name != CONSISTENCY:
                found.append(total(name, LABELS[name], walk[name]).times(factor))
            else:
                found += [term.times(factor) for term in walk[name]]
        return tuple(found)


def total(name: str, label: str, terms: tuple[CostTerm, ...]) -> CostTerm:
    """The sum of terms as one."""
    return CostTerm(name, label, sum(term.value for term in terms), np.sum([term.by for term in terms], axis=0))


def walk_terms(frame: StanceFrame, loads: WalkLoads, options: TuningOptions) -> Terms:
    """All costs of one walk; `tracking` only where the trial has a plate."""
    found: Terms = {"joint_load": joint_load(frame, loads, socket_weight=options.socket_weight),
                    "metabolic": metabolic(frame, loads), "push_off": push_off(frame, loads)}
    if frame.plate_W is not None:
        found[TRACKING] = tracking(frame, loads)
    return found | {CONSISTENCY: (consistency(frame, loads),)}


def sizes(own: list[Terms]) -> dict[str, float]:
    """Size of each cost that every trial has: its mean over the trials' own settings, without sign."""
    found = {}
    for name in COSTS:
        if all(name in terms for terms in own):
            mean = float(np.mean([sum(term.value for term in terms[name]) for terms in own]))
            found[name] = max(abs(mean), LEAST_TRACKING if name == TRACKING else 1e-12)
    return found


def combine(name: str, size: Mapping[str, float], options: TuningOptions) -> Combination:
    """The cost `name` of COSTS, or the weighted one, with its consistency.

    A change of force of `consistency_bw` counts `consistency_weight` of the cost's size; tracking has no such part.

    Args:
        size: see `sizes`; of every cost that is needed.
    """
    if name == TRACKING:
        return Combination(name, LABELS[name], UNITS[name], {TRACKING: 1.0}, size[TRACKING])
    share = options.consistency_weight / options.consistency_bw**2
    if name != WEIGHTED:
        return Combination(name, LABELS[name], UNITS[name], {name: 1.0, CONSISTENCY: share * size[name]}, size[name])
    whole = sum(options.weights.values())
    factors = {cost: weight / whole / size[cost] for cost, weight in options.weights.items() if weight > 0.0}
    return Combination(name, LABELS[name], UNITS[name], factors | {CONSISTENCY: share}, 1.0)
