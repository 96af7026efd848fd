"""How far the ground reaction force is from another, over stance: the cost `tracking`, and what keeps other costs sane.

    T = 1/T int |F - F_0|^2 / (m g)^2 dt            body weights squared

With the recorded force as F_0 it is the tracking cost. With that of the model at the trial's own setting it measures
how much a setting makes of the force that nothing in the given motion pays for: the pelvis is carried along by what
records the motion, and would be carried by it just as well with no foot at all.
"""

from __future__ import annotations

import numpy as np

from vsf_drake.analysis.tuning.level1.costs.term import CostTerm, mean_square
from vsf_drake.analysis.tuning.level1.frame import StanceFrame
from vsf_drake.analysis.tuning.level1.loads import WalkLoads

AXES = (("fore_aft", "fore-aft force"), ("lateral", "lateral force"), ("vertical", "vertical force"))


def tracking(frame: StanceFrame, loads: WalkLoads) -> tuple[CostTerm, ...]:
    """Terms by component of the force in W, against the plate.

    Raises:
        ValueError: the trial has no plate.
    """
    if frame.plate_W is None:
        raise ValueError("there is no plate to track")
    return _deviation(frame, loads, frame.plate_W)


def consistency(frame: StanceFrame, loads: WalkLoads) -> CostTerm:
    """The change of the force from the trial's own setting, all components together."""
    parts = _deviation(frame, loads, frame.own.grf.value)
    return CostTerm("consistency", "change of the ground reaction force", sum(part.value for part in parts),
                    np.sum([part.by for part in parts], axis=0))


def _deviation(frame: StanceFrame, loads: WalkLoads, from_W: np.ndarray) -> tuple[CostTerm, ...]:
    away, by = (loads.grf.value - from_W) / frame.weight_n, loads.grf.by / frame.weight_n
    return tuple(CostTerm(name, label, *mean_square(away[:, i : i + 1], by[:, i : i + 1], frame.inside,
                                                    frame.duration_s))
                 for i, (name, label) in enumerate(AXES))
