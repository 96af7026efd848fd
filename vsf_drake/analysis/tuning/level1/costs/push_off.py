"""Push-off: the work that the prosthesis does on the residual shank in late stance, as a cost with a minus.

    J = -1/m int max(F . V, 0) dt           J/kg and stance

over the later part of stance, with the ground's wrench F on the foot and the spatial velocity V of the residual shank,
both about one point. It is the power of the unified deformable segment (Takahashi 2012; see
`analysis.validation.energy.segment_power`): what passes from all that is distal of the shank into it, if that had no
mass. The shank's motion is given, so that only the force changes with a setting.
"""

from __future__ import annotations

import numpy as np

from vsf_drake.analysis.tuning.level1.costs.metabolic import SMOOTH_W_PER_KG
from vsf_drake.analysis.tuning.level1.costs.term import CostTerm, positive_part
from vsf_drake.analysis.tuning.level1.frame import StanceFrame
from vsf_drake.analysis.tuning.level1.loads import WalkLoads


def push_off(frame: StanceFrame, loads: WalkLoads) -> tuple[CostTerm, ...]:
    """The term "push_off_work", negative."""
    power = np.sum(loads.ground.value * frame.twist, axis=1)
    part, slope = positive_part(power, SMOOTH_W_PER_KG * frame.mass_kg)
    scale = -frame.late / (frame.mass_kg * frame.count)
    by = np.einsum("n,nk,nkp->p", scale * slope, frame.twist, loads.ground.by)
    return (CostTerm("push_off_work", "minus the work on the shank in late stance", float(scale @ part), by),)
