"""Sentences about a finished walk that should make its reader doubt it, each with the likely cause."""

from __future__ import annotations

from typing import Any

import numpy as np

from vsf_drake.analysis.comparison import Comparison
from vsf_drake.analysis.offsets import OffsetFit
from vsf_drake.motion.events import find_scuffs
from vsf_drake.sentences import say
from vsf_drake.simulation.results import WalkResult

USUAL_PEAK_BW = (0.8, 1.8)
"""Range of the measured peak resultant in walking (body weights); outside it the mass is the first suspect."""
FAR_COP_FL = 1.0  # distance between the two centres of pressure (foot lengths) at which they are not of the same foot
SCUFF_BW = 0.05  # contact of the swinging foot (body weights) that is worth a sentence


def doubts(result: WalkResult, comparison: Comparison, metrics: dict[str, Any], fit: OffsetFit | None) -> list[str]:
    """What in `comparison` and its `walk_metrics` does not look like one person walking over one plate.

    `fit` is that of the offsets, if there was one.
    """
    weight, time, vertical = metrics["body_weight_n"], result.time_s, result.grf_W[:, 2]
    peaks = [np.linalg.norm(comparison.measured[comparison.within(s.measured.start_s, s.measured.end_s)], axis=1).max()
             for s in comparison.stances if s.inside]
    apart = np.concatenate([np.linalg.norm(s.model_cop - s.measured_cop, axis=1) for s in comparison.stances] or [[]])
    apart = apart[np.isfinite(apart)]
    scuffs = [{"start_s": scuff.start_s, "peak_bw": vertical[
        (time >= scuff.start_s) & (time <= scuff.end_s)].max(initial=0.0) / weight}
        for scuff in find_scuffs(time, vertical) if scuff.complete]
    return say("doubts", peak_bw=float(np.mean(peaks)) / weight if peaks else None, usual_bw=USUAL_PEAK_BW,
               heading_deg=metrics["heading_deg"], apart_m=np.median(apart) if apart.size else None,
               far_m=FAR_COP_FL * result.foot_length_m, r2=metrics["grf_r2"], fit=fit,
               scuffs=[scuff for scuff in scuffs if scuff["peak_bw"] > SCUFF_BW])
