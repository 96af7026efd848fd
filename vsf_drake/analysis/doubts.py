"""Sentences about a finished walk that should make its reader doubt it, each with the likely cause."""

from __future__ import annotations

from typing import Any

import numpy as np

from vsf_drake.analysis.comparison import Comparison
from vsf_drake.analysis.offsets import OffsetFit
from vsf_drake.motion.events import find_scuffs
from vsf_drake.simulation.results import WalkResult

USUAL_PEAK_BW = (0.8, 1.8)
"""Range of the measured peak resultant in walking (body weights); outside it the mass is the first suspect."""
FAR_COP_FL = 1.0
"""Distance between the two centres of pressure (foot lengths) at which they are not of the same foot."""
SCUFF_BW = 0.05
"""Contact of the swinging foot (body weights) that is worth a sentence."""


def doubts(result: WalkResult, comparison: Comparison, metrics: dict[str, Any], fit: OffsetFit | None) -> list[str]:
    """What in `comparison` and its `walk_metrics` does not look like one person walking over one plate.

    `fit` is that of the offsets, if there was one.
    """
    found = []
    weight, heading, r2 = metrics["body_weight_n"], metrics["heading_deg"], metrics["grf_r2"]
    whole = [s.measured for s in comparison.stances if s.inside]
    peaks = [np.linalg.norm(comparison.measured[comparison.within(s.start_s, s.end_s)], axis=1).max() for s in whole]
    if peaks and not USUAL_PEAK_BW[0] <= (peak := float(np.mean(peaks)) / weight) <= USUAL_PEAK_BW[1]:
        found.append(f"The plate's peak is {peak:.2f} body weights: is the subject's mass_kg right (kilograms, not "
                     "pounds)?")
    if abs(heading) > 90.0:
        found.append(f"The person walks at {heading:.0f} degrees to the laboratory's x axis, which should point "
                     "forward: is pelvis_tx, or the sign of belt_speed_m_per_s, the wrong way round?")
    apart = np.concatenate([np.linalg.norm(s.model_cop - s.measured_cop, axis=1) for s in comparison.stances] or [[]])
    apart = apart[np.isfinite(apart)]
    if apart.size and np.median(apart) >= FAR_COP_FL * result.foot_length_m:
        found.append(f"The plate's centre of pressure is {np.median(apart):.2f} m from the model's foot: are the "
                     "plates assigned to the right feet, is the centre of pressure in metres, do the files share "
                     "frame and clock?")
    if r2 is not None and r2 < 0.0:
        found.append(f"The predicted force is further from the plate than a constant would be (R² = {r2:.2f}): the "
                     "height or angle of the prosthesis is off (fit the offsets), or sides, signs or clock of "
                     "kinematics and forces do not belong together.")
    time, vertical, scuffs = result.time_s, result.grf_W[:, 2], []
    for contact in find_scuffs(time, vertical):
        peak = vertical[(time >= contact.start_s) & (time <= contact.end_s)].max(initial=0.0) / weight
        if peak > SCUFF_BW and contact.complete:
            scuffs.append(f"{contact.start_s:.3f} s ({peak:.2f} body weights)")
    if scuffs:
        found.append(f"The model's prosthetic foot brushes the ground outside a stance at {', '.join(scuffs)}.")
    if fit is not None:
        found += [f"The fitted offset {name} ended on its bound: the fit has not found the prosthesis's place."
                  for name in fit.at_bound]
        if not fit.success:
            found.append(f"The fit of the offsets did not converge: {fit.message}")
    return found
