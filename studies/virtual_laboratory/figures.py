"""The achieved figures of a trial, and how well one trial's curve predicts another's."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from virtual_laboratory.body import HAT
from virtual_laboratory.motion import COORDINATES
from virtual_laboratory.recording import Recorded, Truth
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.parameters import PELVIS_TRANSLATIONS

CUTOFF_HZ = 40.0
PERCENT = np.linspace(0.0, 1.0, 101)
FLAT = (0.15, 0.80)
"""Parts of stance between which the foot should not slide."""


def stance_of(trial: Recorded, foot: str = "right") -> tuple[float, float]:
    """Start and end (s) of a foot's one whole stance, 20 N."""
    stances = find_stances(trial.force_time_s, getattr(trial, foot).force[:, 2])
    complete = [s for s in stances if s.complete]
    if len(complete) != 1:
        raise RuntimeError(f"{trial.draw.name}: {len(complete)} whole stances of the {foot} foot where one was wanted")
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
    time = trial.force_time_s
    start, end = stance_of(trial)
    part = (time - start) / (end - start)
    flat = (part > FLAT[0]) & (part < FLAT[1])
    first, middle = ((part > a) & (part < b) for a, b in ((0.1, 0.4), (0.35, 0.62)))
    strikes = [s.start_s for s in find_stances(time, trial.right.force[:, 2]) if s.start_seen]
    path = trial.coordinates[:, COORDINATES.index("pelvis_tx")]
    knee = np.interp(time, trial.time_s, trial.coordinates[:, COORDINATES.index("knee_angle_r")])
    swing = ((time < start - 0.1) | (time > end + 0.1)) & (trial.right.force[:, 2] == 0.0)
    swing &= (time < strikes[-1] - 0.1) & (time > end - (strikes[-1] - strikes[0]) + 0.1)
    q, qd = trial.trajectory.sample(np.array([strikes[0], strikes[-1]]))[:2]
    turned = [k for k, name in enumerate(COORDINATES) if name not in PELVIS_TRANSLATIONS]
    return {
        "fulcrum_mm": float("nan") if trial.draw.fulcrum_m is None else 1e3 * trial.draw.fulcrum_m,
        "stance_s": end - start,
        "stride_s": strikes[-1] - strikes[0],
        "speed_m_per_s": float((path[-1] - path[0]) / (trial.time_s[-1] - trial.time_s[0])),
        "gain_m_per_s": float(np.diff(qd[:, COORDINATES.index("pelvis_tx")])[0]),
        "stride_ends_deg": float(np.degrees(np.abs(np.diff(q[:, turned], axis=0)).max())),
        **_foot(trial, "right", weight_n),
        "swing_clearance_mm": 1e3 * float(trial.reaction.clearance[swing].min()),
        "slip_flat_mm": 1e3 * float(np.sum(trial.reaction.slip_speed[flat]) * 1e-3),
        "knee_loading_deg": float(knee[first].max()),
        "knee_midstance_deg": float(knee[middle].min()),
        "step_width_mm": 1e3 * float(np.nanmean(trial.left.cop[:, 1]) - np.nanmean(trial.right.cop[flat, 1])),
        "intact_stance_s": float(np.subtract(*stance_of(trial, "left")[::-1])),
        **{f"intact_{name}": value for name, value in _foot(trial, "left", weight_n).items()},
        **_balance(trial.truth, weight_n),
        "unconverged_steps": trial.reaction.unconverged,
    }


def _foot(trial: Recorded, side: str, weight_n: float) -> dict[str, float]:
    """Of a foot's one whole stance: peaks, trough, and the way of its centre of pressure."""
    (start, end), time, foot = stance_of(trial, side), trial.force_time_s, getattr(trial, side)
    part = (time - start) / (end - start)
    inside = (part >= 0.0) & (part <= 1.0)
    first, middle, last = (inside & (part > a) & (part < b) for a, b in ((0.1, 0.4), (0.35, 0.62), (0.6, 0.95)))
    force, cop = low_pass(foot.force, rate_hz=1000.0, cutoff_hz=CUTOFF_HZ) / weight_n, foot.cop[inside]
    medial = force[inside, 1] * (1.0 if side == "right" else -1.0)
    return {
        "first_peak_bw": force[first, 2].max(),
        "trough_bw": force[middle, 2].min(),
        "second_peak_bw": force[last, 2].max(),
        "braking_bw": force[inside, 0].min(),
        "propulsion_bw": force[inside, 0].max(),
        "medial_peak_bw": medial.max(),
        "lateral_peak_bw": medial.min(),
        "cop_travel_mm": 1e3 * float(np.nanmax(cop[:, 0]) - np.nanmin(cop[:, 0])),
        "cop_backward_mm": 1e3 * float(np.max(np.fmax.accumulate(cop[:, 0]) - cop[:, 0], initial=0.0,
                                              where=np.isfinite(cop[:, 0]))),
        "free_moment_nm": float(np.nanmax(np.abs(foot.free_moment[inside]))),
    }


def _balance(truth: Truth, weight_n: float) -> dict[str, float]:
    """What both plates leave unexplained of the whole person's motion, and how the trunk moves.

    Of the three components of each instant together; forces in body weights, moments about the centre of mass in body
    weights times metres. `lumped_...`: with the trunk fixed in the pelvis, low-passed at 40 Hz.
    """
    found = {}
    for name, left in (("residual", truth.missing), ("lumped", truth.lumped)):
        for kind, unit, values in (("force", "bw", left.force), ("moment", "bwm", left.moment)):
            kept = values if name == "residual" else low_pass(values, rate_hz=1000.0, cutoff_hz=CUTOFF_HZ)
            size = np.linalg.norm(kept, axis=1) / weight_n
            found |= {f"{name}_{kind}_{unit}": float(size.max()),
                      f"{name}_{kind}_rms_{unit}": float(np.sqrt(np.mean(size**2)))}
    lumped = low_pass(truth.lumped.force, rate_hz=1000.0, cutoff_hz=CUTOFF_HZ) / weight_n
    for axis, name in ((0, "fore_aft"), (2, "vertical")):
        found[f"lumped_{name}_rms_bw"] = float(np.sqrt(np.mean(lumped[:, axis] ** 2)))
    angles = np.degrees(Rotation.from_matrix(truth.R_WB[:, HAT]).as_euler("ZYX")[:, ::-1])
    for axis, angle in zip(("list", "pitch", "turn"), (angles - angles.mean(axis=0)).T, strict=True):
        found[f"trunk_{axis}_rms_deg"] = float(np.sqrt(np.mean(angle**2)))
    apart = 1e3 * np.linalg.norm(truth.shift - truth.shift.mean(axis=0), axis=1)
    return found | {"trunk_shift_mm": float(apart.max()), "trunk_shift_rms_mm": float(np.sqrt(np.mean(apart**2)))}
