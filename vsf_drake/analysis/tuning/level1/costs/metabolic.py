"""Joint work of the prosthetic leg as an estimate of metabolic energy.

    E = (W+ / 0.25 + W- / 1.2) / m          J/kg and stance

with the positive and negative work of each prosthetic joint over stance, W- counted positive. The efficiencies are
Margaria's for muscle; applied to joints they leave out co-contraction, tendons and muscles over two joints, so that
differences between settings mean more than the number. Only the prosthetic leg changes while the motion is given.
"""

from __future__ import annotations

import numpy as np

from vsf_drake.analysis.tuning.level1.costs.term import CostTerm, positive_part
from vsf_drake.analysis.tuning.level1.frame import StanceFrame
from vsf_drake.analysis.tuning.level1.loads import WalkLoads

POSITIVE_EFFICIENCY, NEGATIVE_EFFICIENCY = 0.25, 1.2
SMOOTH_W_PER_KG = 0.01
"""Nearer to zero than this powers are part positive and part negative, so that work has a derivative (a choice)."""


def metabolic(frame: StanceFrame, loads: WalkLoads) -> tuple[CostTerm, ...]:
    """Terms "positive_work" and "negative_work", over their efficiencies."""
    power, by = loads.joints.value * frame.rates, loads.joints.by * frame.rates[:, :, None]
    found = []
    for name, sign, efficiency in (("positive_work", 1.0, POSITIVE_EFFICIENCY),
                                   ("negative_work", -1.0, NEGATIVE_EFFICIENCY)):
        part, slope = positive_part(sign * power, SMOOTH_W_PER_KG * frame.mass_kg)
        scale = frame.inside[:, None] / (efficiency * frame.mass_kg * frame.count)
        label = f"{name.replace('_', ' ')} of the prosthetic joints / {efficiency:g}"
        found.append(CostTerm(name, label, float(np.sum(scale * part)),
                              np.einsum("nj,njp->p", scale * sign * slope, by)))
    return tuple(found)
