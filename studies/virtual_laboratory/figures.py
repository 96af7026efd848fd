"""The achieved figures of a trial, and how well one trial's curve predicts another's."""

from __future__ import annotations

import numpy as np

from virtual_laboratory.motion import COORDINATES
from virtual_laboratory.recording import Recorded
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.trajectory import low_pass

CUTOFF_HZ = 40.0
PERCENT = np.linspace(0.0, 1.0, 101)
FLAT = (0.15, 0.80)
"""Parts of stance between which the foot should not slide."""


def stance_of(trial: Recorded) -> tuple[float, float]:
    """Start and end (s) of the prosthetic stance, 20 N."""
    stances = find_stances(trial.force_time_s, trial.right.force[:, 2])
    complete = [s for s in stances if s.complete]
    if len(complete) != 1:
        raise RuntimeError(f"{trial.draw.name}: {len(complete)} complete prosthetic stances where one was wanted")
    return complete[0].start_s, complete[0].end_s


def stance_curve(trial: Recorded, weight_n: float) -> np.ndarray:
    """(101,) resultant in BW over the stance, low-passed as `vsf_drake validate` does."""
    force = low_pass(trial.right.force, rate_hz=1000.0, cutoff_hz=CUTOFF_HZ)
    start, end = stance_of(trial)
    return np.interp(start + PERCENT * (end - start), trial.force_time_s, np.linalg.norm(force, axis=1) / weight_n)


def null_error(one: np.ndarray, other: np.ndarray) -> float:
    """RMSE (BW) of one trial's stretched curve as a prediction of another's."""
    return float(np.sqrt(np.mean((one - other) ** 2)))


def trial_figures(trial: Recorded, weight_n: float) -> dict[str, float]:
    """Numbers of one trial; forces in body weights, low-passed at 40 Hz, lengths in mm."""
    start, end = stance_of(trial)
    time = trial.force_time_s
    force = low_pass(trial.right.force, rate_hz=1000.0, cutoff_hz=CUTOFF_HZ) / weight_n
    intact = low_pass(trial.left.force, rate_hz=1000.0, cutoff_hz=CUTOFF_HZ) / weight_n
    part = (time - start) / (end - start)
    inside = (part >= 0.0) & (part <= 1.0)
    flat = (part > FLAT[0]) & (part < FLAT[1])
    first, middle, last = (inside & (part > a) & (part < b) for a, b in ((0.1, 0.4), (0.35, 0.62), (0.6, 0.95)))
    path = trial.coordinates[:, COORDINATES.index("pelvis_tx")]
    knee = np.interp(time, trial.time_s, trial.coordinates[:, COORDINATES.index("knee_angle_r")])
    cop = trial.right.cop[inside]
    left_y = trial.left.cop[:, 1]
    swing = (time < start - 0.1) | (time > end + 0.1)
    alone = flat & (trial.left.force[:, 2] == 0.0)
    return {
        "fulcrum_mm": 1e3 * trial.draw.fulcrum_m,
        "stance_s": end - start,
        "speed_m_per_s": float((path[-1] - path[0]) / (trial.time_s[-1] - trial.time_s[0])),
        "first_peak_bw": force[first, 2].max(),
        "trough_bw": force[middle, 2].min(),
        "second_peak_bw": force[last, 2].max(),
        "braking_bw": force[inside, 0].min(),
        "propulsion_bw": force[inside, 0].max(),
        "medial_peak_bw": force[inside, 1].max(),
        "lateral_peak_bw": force[inside, 1].min(),
        "cop_travel_mm": 1e3 * float(np.nanmax(cop[:, 0]) - np.nanmin(cop[:, 0])),
        "cop_backward_mm": 1e3 * float(np.max(np.fmax.accumulate(cop[:, 0]) - cop[:, 0], initial=0.0,
                                              where=np.isfinite(cop[:, 0]))),
        "swing_clearance_mm": 1e3 * float(trial.reaction.clearance[swing].min()),
        "slip_flat_mm": 1e3 * float(np.sum(trial.reaction.slip_speed[flat]) * 1e-3),
        "knee_loading_deg": float(knee[first].max()),
        "knee_midstance_deg": float(knee[middle].min()),
        "step_width_mm": 1e3 * float(np.nanmean(left_y) - np.nanmean(trial.right.cop[flat, 1])),
        "intact_peak_bw": intact[:, 2].max(),
        "unexplained_vertical_bw": float(np.sqrt(np.mean(trial.unexplained_n[alone, 2] ** 2))) / weight_n,
        "unexplained_fore_aft_bw": float(np.sqrt(np.mean(trial.unexplained_n[alone, 0] ** 2))) / weight_n,
        "unexplained_lateral_bw": float(np.sqrt(np.mean(trial.unexplained_n[alone, 1] ** 2))) / weight_n,
        "unconverged_steps": trial.reaction.unconverged,
    }
