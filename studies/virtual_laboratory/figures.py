"""The achieved figures of a trial, what walking looks like, and how well one trial's curve predicts
another's."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from virtual_laboratory.body import DEVICE, HAT, INTACT_FOOT
from virtual_laboratory.motion import COORDINATES, Person
from virtual_laboratory.recording import Recorded, Truth
from virtual_laboratory.supports import DEVICE_REAR_M
from virtual_laboratory.targets import LEG_M
from vsf_drake.model.parameters import GRAVITY, PELVIS_TRANSLATIONS
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.trajectory import low_pass

CUTOFF_HZ = 40.0
PERCENT = np.linspace(0.0, 1.0, 101)
FLAT = (0.15, 0.80)
"""Parts of stance between which the foot should not slide."""
PRINT = 0.25
"""Part of stance at which a foot is where its print is taken from."""
AWAY_S = 0.1
"""From a lift-off, and until a strike: when a foot is in mid-swing."""
BANDS = Path(__file__).resolve().parents[2] / "data" / "published" / "walking_bands.csv"
FORCES = {
    "first_peak": "vgrf_peak1",
    "trough": "vgrf_trough",
    "second_peak": "vgrf_peak2",
    "braking": "braking_peak",
    "propulsion": "propulsion_peak",
}
"""Row of BANDS by figure of a foot."""
BACKWARD_MM, FREE_MOMENT_NM = 3.0, 12.0
"""How far a centre of pressure may go back, and the largest free moment (choices)."""


def stance_of(trial: Recorded, foot: str = "right") -> tuple[float, float]:
    """Start and end (s) of a foot's one whole stance, 20 N."""
    stances = find_stances(trial.force_time_s, getattr(trial, foot).force[:, 2])
    complete = [s for s in stances if s.complete]
    if len(complete) != 1:
        raise RuntimeError(
            f"{trial.draw.name}: {len(complete)} whole stances of the {foot} foot where one was "
            "wanted"
        )
    return complete[0].start_s, complete[0].end_s


def stance_curve(trial: Recorded, weight_n: float) -> np.ndarray:
    """(101,) resultant in BW over the stance, low-passed as `vsf_drake validate` does."""
    force = low_pass(trial.right.force, rate_hz=1000.0, cutoff_hz=CUTOFF_HZ)
    start, end = stance_of(trial)
    return np.interp(
        start + PERCENT * (end - start),
        trial.force_time_s,
        np.linalg.norm(force, axis=1) / weight_n,
    )


def null_error(one: np.ndarray, other: np.ndarray) -> float:
    """RMSE (BW) of one trial's stretched curve as a prediction of another's."""
    return float(np.sqrt(np.mean((one - other) ** 2)))


def trial_figures(trial: Recorded, person: Person) -> dict[str, float]:
    """Numbers of one trial; forces in body weights, low-passed at 40 Hz, lengths in mm."""
    time, weight_n = trial.force_time_s, person.subject.mass_kg * GRAVITY
    start, end = stance_of(trial)
    part = (time - start) / (end - start)
    flat = (part > FLAT[0]) & (part < FLAT[1])
    first, middle = ((part > a) & (part < b) for a, b in ((0.1, 0.4), (0.35, 0.62)))
    strikes = [s.start_s for s in find_stances(time, trial.right.force[:, 2]) if s.start_seen]
    path = trial.coordinates[:, COORDINATES.index("pelvis_tx")]
    knee = np.interp(time, trial.time_s, trial.coordinates[:, COORDINATES.index("knee_angle_r")])
    swing = ((time < start - AWAY_S) | (time > end + AWAY_S)) & (trial.right.force[:, 2] == 0.0)
    swing &= (time < strikes[-1] - AWAY_S) & (time > end - (strikes[-1] - strikes[0]) + AWAY_S)
    intact, stride = stance_of(trial, "left"), strikes[-1] - strikes[0]
    part_s = PRINT * (end - start)
    trod = [
        _heel_x(trial, person, segment, at)
        for segment, at in (
            (DEVICE, strikes[0] + part_s),
            (INTACT_FOOT, intact[0] + PRINT * (intact[1] - intact[0])),
            (DEVICE, strikes[-1] + part_s),
        )
    ]
    q, qd = trial.trajectory.sample(np.array([strikes[0], strikes[-1]]))[:2]
    turned = [k for k, name in enumerate(COORDINATES) if name not in PELVIS_TRANSLATIONS]
    return {
        "fulcrum_mm": float("nan") if trial.draw.fulcrum_m is None else 1e3 * trial.draw.fulcrum_m,
        "stance_s": end - start,
        "stride_s": stride,
        "leg_m": trial.draw.leg_m,
        "step_length_ratio": float((trod[2] - trod[1]) / (trod[1] - trod[0])),
        "speed_m_per_s": float((path[-1] - path[0]) / (trial.time_s[-1] - trial.time_s[0])),
        "gain_m_per_s": float(np.diff(qd[:, COORDINATES.index("pelvis_tx")])[0]),
        "stride_ends_deg": float(np.degrees(np.abs(np.diff(q[:, turned], axis=0)).max())),
        **_foot(trial, "right", weight_n),
        "swing_clearance_mm": 1e3 * float(trial.reaction.clearance[swing].min()),
        "slip_flat_mm": 1e3 * float(np.sum(trial.reaction.slip_speed[flat]) * 1e-3),
        "knee_loading_deg": float(knee[first].max()),
        "knee_midstance_deg": float(knee[middle].min()),
        "step_width_mm": 1e3
        * float(np.nanmean(trial.left.cop[:, 1]) - np.nanmean(trial.right.cop[flat, 1])),
        "intact_clearance_mm": _intact_clearance(trial, person, (intact[1] - stride, intact[0])),
        "intact_stance_s": intact[1] - intact[0],
        **{f"intact_{name}": value for name, value in _foot(trial, "left", weight_n).items()},
        **_balance(trial.truth, weight_n),
        "unconverged_steps": trial.reaction.unconverged,
    }


def _heel_x(trial: Recorded, person: Person, segment: int, at_s: float) -> float:
    """m, how far ahead the rear end of a foot's sole is."""
    k, body = np.searchsorted(trial.force_time_s, at_s), person.handles.body
    heel = {
        DEVICE: np.array([DEVICE_REAR_M, 0.0, person.sole_height]),
        INTACT_FOOT: np.array(
            [-person.model.intact_foot.ankle_x_ratio * body.foot_length, 0.0, -body.ankle_height]
        ),
    }[segment]
    return float((trial.truth.p_WB[k, segment] + trial.truth.R_WB[k, segment] @ heel)[0])


def _intact_clearance(trial: Recorded, person: Person, swing: tuple[float, float]) -> float:
    """Lowest place (mm) of the intact foot's contact spheres in mid-swing."""
    inside = (trial.force_time_s > swing[0] + AWAY_S) & (trial.force_time_s < swing[1] - AWAY_S)
    sites, pose = person.handles.intact_sites, (inside, INTACT_FOOT)
    places = trial.truth.p_WB[pose][:, None] + np.einsum(
        "nij,sj->nsi", trial.truth.R_WB[pose], sites.p_BS
    )
    return 1e3 * float(np.min(places[..., 2] - sites.radius))


def _foot(trial: Recorded, side: str, weight_n: float) -> dict[str, float]:
    """Of a foot's one whole stance: peaks, trough, and the way of its centre of pressure."""
    (start, end), time, foot = stance_of(trial, side), trial.force_time_s, getattr(trial, side)
    part = (time - start) / (end - start)
    inside = (part >= 0.0) & (part <= 1.0)
    first, middle, last = (
        inside & (part > a) & (part < b) for a, b in ((0.1, 0.4), (0.35, 0.62), (0.6, 0.95))
    )
    force, cop = (
        low_pass(foot.force, rate_hz=1000.0, cutoff_hz=CUTOFF_HZ) / weight_n,
        foot.cop[inside],
    )
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
        "cop_backward_mm": 1e3
        * float(
            np.max(
                np.fmax.accumulate(cop[:, 0]) - cop[:, 0], initial=0.0, where=np.isfinite(cop[:, 0])
            )
        ),
        "free_moment_nm": float(np.nanmax(np.abs(foot.free_moment[inside]))),
    }


def _balance(truth: Truth, weight_n: float) -> dict[str, float]:
    """What both plates leave unexplained of the whole person's motion, and how the trunk moves.

    Of the three components of each instant together; forces in body weights, moments about the
    centre of mass in body weights times metres. `lumped_...`: with the trunk fixed in the pelvis,
    low-passed at 40 Hz.
    """
    found = {}
    for name, left in (("residual", truth.missing), ("lumped", truth.lumped)):
        for kind, unit, values in (("force", "bw", left.force), ("moment", "bwm", left.moment)):
            kept = (
                values
                if name == "residual"
                else low_pass(values, rate_hz=1000.0, cutoff_hz=CUTOFF_HZ)
            )
            size = np.linalg.norm(kept, axis=1) / weight_n
            found |= {
                f"{name}_{kind}_{unit}": float(size.max()),
                f"{name}_{kind}_rms_{unit}": float(np.sqrt(np.mean(size**2))),
            }
    lumped = low_pass(truth.lumped.force, rate_hz=1000.0, cutoff_hz=CUTOFF_HZ) / weight_n
    for axis, name in ((0, "fore_aft"), (2, "vertical")):
        found[f"lumped_{name}_rms_bw"] = float(np.sqrt(np.mean(lumped[:, axis] ** 2)))
    angles = np.degrees(Rotation.from_matrix(truth.R_WB[:, HAT]).as_euler("ZYX")[:, ::-1])
    for axis, angle in zip(
        ("list", "pitch", "turn"), (angles - angles.mean(axis=0)).T, strict=True
    ):
        found[f"trunk_{axis}_rms_deg"] = float(np.sqrt(np.mean(angle**2)))
    apart = 1e3 * np.linalg.norm(truth.shift - truth.shift.mean(axis=0), axis=1)
    return found | {
        "trunk_shift_mm": float(apart.max()),
        "trunk_shift_rms_mm": float(np.sqrt(np.mean(apart**2))),
    }


@cache
def _bands() -> list[dict[str, str]]:
    lines = [
        line for line in BANDS.read_text(encoding="utf-8").splitlines() if not line.startswith("#")
    ]
    return list(csv.DictReader(lines))


def force_band(quantity: str, side: str, speed_m_per_s: float) -> tuple[float, float]:
    """BW, linear between the speeds of BANDS, of the "prosthetic" or "intact" side."""
    rows = [
        row for row in _bands() if row["quantity"] == quantity and row["side"] in (side, "each")
    ]
    speeds, low, high = (
        np.array([float(row[name]) for row in rows]) for name in ("speed_m_per_s", "low", "high")
    )
    return float(np.interp(speed_m_per_s, speeds, low)), float(
        np.interp(speed_m_per_s, speeds, high)
    )


def stride_band(speed_m_per_s: float, leg_m: float) -> tuple[float, float]:
    """s, of the slow and normal groups of adults of BANDS, linear between the middles of their
    speeds; of shorter legs shorter at a relatively higher speed, both by the square root of the
    length (dynamic similarity)."""
    rows = [
        row for row in _bands() if row["quantity"] == "stride_time" and row["side"] == "able-bodied"
    ]
    middle = [np.mean([float(v) for v in row["speed_m_per_s"].split(" to ")]) for row in rows]
    root = np.sqrt(LEG_M / leg_m)
    low, high = (
        float(np.interp(speed_m_per_s * root, middle, [float(row[name]) for row in rows])) / root
        for name in ("low", "high")
    )
    return low, high


def band_of_person(quantity: str) -> tuple[float, float]:
    """The band of BANDS of what is one number of a person at all speeds."""
    (row,) = [
        row
        for row in _bands()
        if row["quantity"] == quantity and row["low"] and row["side"] == "person"
    ]
    return float(row["low"]), float(row["high"])


def against_bands(
    figures: Mapping[str, float], speed_m_per_s: float
) -> dict[str, tuple[float, float, float]]:
    """What a trial has, and the band's ends, by what it is; `figures` of `trial_figures`, forces in
    BW."""
    stride = stride_band(speed_m_per_s, figures["leg_m"])
    stance_ratio = figures["stance_s"] / figures["intact_stance_s"]
    found = {
        "stride, s": (figures["stride_s"], *stride),
        "stance, prosthetic / intact": (stance_ratio, *band_of_person("stance_ratio")),
        "step length, prosthetic / intact": (
            figures["step_length_ratio"],
            *band_of_person("step_length_ratio"),
        ),
        "step width, mm": (
            figures["step_width_mm"],
            *(1e3 * np.array(band_of_person("step_width"))),
        ),
    }
    for side, prefix in (("prosthetic", ""), ("intact", "intact_")):
        for name, quantity in FORCES.items():
            found[f"{side} {name.replace('_', ' ')}, BW"] = (
                figures[f"{prefix}{name}_bw"],
                *force_band(quantity, side, speed_m_per_s),
            )
        clearance = figures["intact_clearance_mm" if prefix else "swing_clearance_mm"]
        found[f"{side} sole in mid-swing, mm"] = (clearance, 0.0, np.inf)
        found[f"{side} centre of pressure goes back, mm"] = (
            figures[f"{prefix}cop_backward_mm"],
            0.0,
            BACKWARD_MM,
        )
        found[f"{side} free moment, N m"] = (
            figures[f"{prefix}free_moment_nm"],
            0.0,
            FREE_MOMENT_NM,
        )
    return found
