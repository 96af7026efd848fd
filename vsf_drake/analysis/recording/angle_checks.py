"""Whether joint angles and the pelvis's path are those of a person who walks forward, and not zeroed at standing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vsf_drake.analysis.recording.check import DOUBTFUL_BW, GOOD_BW, HIP_BW_PER_DEG, Check, grade
from vsf_drake.analysis.recording.marker_checks import high_content

MAIN = ("pelvis_tilt", "hip_flexion_r", "hip_flexion_l", "knee_angle_r", "knee_angle_l", "ankle_angle_r",
        "ankle_angle_l")
"""The sagittal angles, none of which is zero in a standing person."""
EXACT_RAD = 1e-9
ZERO_DEG = 0.3
"""Standing angles this close to zero, all of them, are not a person's but a subtraction's (a choice)."""
FEWEST_ANGLES = 3
ZEROED_TILT_DEG, ZEROED_HIP_DEG = 2.0, 8.0
"""Pelvic tilt is about 11-12 degrees forward in walking and in standing, and mean hip flexion about 18 (Schwartz 2008,
means); zeroed at standing they become about 0 and 3-6."""
ANKLE_DEG = 20.0
AXIS_DEG = 10.0
"""Turn of a knee's axis that its own coupling of motions, some 5 degrees, and skin do not explain (a choice)."""
LEAST_FLEXION_DEG = 30.0
"""A knee that bends less does not show its axis (a choice)."""
SPEED_M_PER_S = (0.3, 2.2)
"""Walking speed: prosthesis users 0.85 to 1.0 on average (Hermodsson 1994), able-bodied up to 2 before they run."""
HEADING_DEG = (20.0, 45.0)
"""Direction of walking against x: the model's socket and knee turn about y, forces along x are called fore-aft."""
BOB_M = (0.01, 0.10)
"""Rise and fall of the pelvis within a trial, 30-50 mm in usual walking (a choice around it)."""
JUMP_M_PER_S2 = 30.0
"""Acceleration of a pelvis that no walk reaches (a choice: three times gravity)."""
REST_M_PER_S = 0.05
BELT_M_PER_S = 0.3
"""Backward speed of standing feet that no ground allows (a choice)."""
ROUGH_DEG = (GOOD_BW / HIP_BW_PER_DEG, DOUBTFUL_BW / HIP_BW_PER_DEG)
"""Content of angles above 12 Hz: 0.4 degrees of hip are 3 % body weight."""
ROUGH_HZ = 12.0
"""Twice the usual cut-off of 6 Hz: what is above it in an angle is noise, or a stride that was cut and pasted."""


def zeroed(time_s: np.ndarray, angles_rad: Mapping[str, np.ndarray], standing_rad: Mapping[str, float] | None,
           speed_m_per_s: np.ndarray) -> Check:
    """Whether angles look as if standing had been subtracted from them.

    Args:
        time_s: (n,) s. angles_rad: (n,) by coordinate.
        standing_rad: angles at standing, where a standing trial was measured.
        speed_m_per_s: (n,) of the pelvis over the floor.
    """
    name = "angles zeroed at standing"
    known = {key: np.asarray(angles_rad[key]) for key in MAIN if key in angles_rad}
    meaning = (f"The model needs anatomical angles; 1° of hip flexion is {100 * HIP_BW_PER_DEG:.1f} % of body weight.")
    first = [key for key, values in known.items() if abs(values[0]) < EXACT_RAD and np.ptp(values) > EXACT_RAD]
    if len(first) >= FEWEST_ANGLES:
        return Check(name, "unusable", float(len(first)), "1", f"{', '.join(first)} begin at exactly zero: the angles "
                     f"are relative to the first frame. {meaning}")
    still = speed_m_per_s < REST_M_PER_S
    standing = dict(standing_rad or {})
    if not standing and still.any():
        standing = {key: float(np.mean(values[still])) for key, values in known.items()}
    main = [abs(np.degrees(standing[key])) for key in MAIN if key in standing and np.ptp(known.get(key, [0, 1])) > 0]
    if len(main) >= FEWEST_ANGLES:
        value = float(np.max(main))
        if value < ZERO_DEG:
            mark = "doubtful" if standing_rad else "unusable"
            return Check(name, mark, value, "deg", "At standing every sagittal angle is within "
                         f"{value:.2f}° of zero, which no person's are: they were subtracted. {meaning}")
        if standing_rad:
            return Check(name, "good", value, "deg", "The posture that was calibrated has angles of its own (up to "
                         f"{value:.1f}°): nothing was zeroed at standing.")
    tilt = float(np.degrees(np.mean(known["pelvis_tilt"])))
    hips = [float(np.degrees(np.mean(known[key]))) for key in ("hip_flexion_r", "hip_flexion_l") if key in known]
    if abs(tilt) < ZEROED_TILT_DEG and hips and max(map(abs, hips)) < ZEROED_HIP_DEG:
        return Check(name, "doubtful", tilt, "deg", f"Mean pelvic tilt is {tilt:.1f}° and mean hip flexion "
                     f"{' and '.join(f'{hip:.1f}°' for hip in hips)}, where walking usually has 12° and 18°: the "
                     f"angles look zeroed at standing. {meaning}")
    return Check(name, "good", tilt, "deg", f"Mean pelvic tilt is {tilt:.1f}°, mean hip flexion "
                 f"{' and '.join(f'{hip:.1f}°' for hip in hips)}: the angles do not look zeroed at standing.")


def ankle_offset(angles_rad: Mapping[str, np.ndarray], intact_side: str) -> Check | None:
    """Whether the intact ankle's mean is that of an ankle measured from a right angle."""
    key = f"ankle_angle_{intact_side[0]}"
    if key not in angles_rad:
        return None
    value = float(np.degrees(np.mean(angles_rad[key])))
    name, found = "ankle's zero", f"The intact ankle's mean is {value:.1f}°"
    if abs(value) < ANKLE_DEG:
        return Check(name, "good", value, "deg", f"{found}: measured from a right angle between shank and sole.",
                     intact_side)
    return Check(name, "doubtful", value, "deg", f"{found}; the model measures from a right angle between shank and "
                 "sole, from which walking ankles keep within some 20°.", intact_side)


def knee_axis(angles_rad: Mapping[str, np.ndarray], side: str) -> Check | None:
    """Whether the knee bends about the axis from which its angles are measured.

    A hinge that bends by theta about an axis turned by phi (about the thigh's length) from the measured one shows
    sin(adduction) = sin(phi) sin(theta), by geometry: cross-talk. phi is the slope of the one sine against the other.
    None where the knee bends too little or the angles are not known.
    """
    names = f"knee_angle_{side[0]}", f"knee_adduction_{side[0]}"
    if any(name not in angles_rad for name in names):
        return None
    flexion, adduction = (np.asarray(angles_rad[name]) for name in names)
    if np.degrees(np.ptp(flexion)) < LEAST_FLEXION_DEG:
        return None
    slope = float(np.polyfit(np.sin(flexion), np.sin(adduction), 1)[0])
    value = float(np.degrees(np.arcsin(np.clip(slope, -1.0, 1.0))))
    found = f"Adduction of the {side} knee goes with its flexion as if its axis were turned by {abs(value):.0f}°"
    if abs(value) < AXIS_DEG:
        return Check("knee's axis", "good", value, "deg", f"{found}: as knees and skin move.", side)
    return Check("knee's axis", "doubtful", value, "deg", f"{found} about the thigh's length: are the medial, lateral "
                 "or thigh markers of the standing trial in their places? Hip rotation is off by as much.", side)


def smoothness(time_s: np.ndarray, angles_rad: Mapping[str, np.ndarray]) -> Check | None:
    """The roughest sagittal angle: what it holds above 12 Hz. None if the sampling cannot tell."""
    rate = 1.0 / float(np.median(np.diff(time_s)))
    known = {key: values for key, values in angles_rad.items() if key in MAIN}
    sizes = {key: high_content(values[:, None], rate, ROUGH_HZ) for key, values in known.items()}
    told = {key: float(np.degrees(size)) for key, size in sizes.items() if size is not None}
    if not told or rate <= 2.5 * ROUGH_HZ:
        return None
    worst_key = max(told, key=told.__getitem__)
    value = told[worst_key]
    mark = grade(value, *ROUGH_DEG)
    sentence = f"The roughest angle, {worst_key}, holds {value:.3f}° above {ROUGH_HZ:.0f} Hz"
    sentence += ": smooth enough to prescribe." if mark == "good" else ": noise that shakes the model; filter it."
    return Check("smoothness of angles", mark, value, "deg", sentence, cost_bw=HIP_BW_PER_DEG * value)


def belt(feet_m_per_s: Sequence[float]) -> Check | None:
    """Whether both feet slide backward alike while they stand flat, as on a belt; velocities (m/s) along x, forward +.

    None if they do not.
    """
    speed = -float(np.median(feet_m_per_s)) if len(feet_m_per_s) > 1 else 0.0
    if speed < BELT_M_PER_S or np.ptp(feet_m_per_s) > 0.5 * speed:
        return None
    return Check("treadmill", "unusable", speed, "m/s", f"Every foot slides backward at {speed:.2f} m/s while it "
                 "stands: this is a treadmill, and the model's ground stands still. Give --belt-speed-m-per-s "
                 f"{speed:.2f} (or belt_speed_m_per_s in the manifest).")


def walking(time_s: np.ndarray, pelvis_W: np.ndarray, *, belt_m_per_s: float = 0.0) -> list[Check]:
    """Speed, direction and path of the pelvis.

    Args:
        time_s: (n,) s. pelvis_W: (n, 3) m, on the laboratory's floor or, on a treadmill, on its belt.
        belt_m_per_s: belt speed that `pelvis_W` already includes, for the sentence.
    """
    duration = float(time_s[-1] - time_s[0])
    travel = (pelvis_W[-1] - pelvis_W[0])[:2]
    speed = float(np.hypot(*travel)) / duration
    usual = SPEED_M_PER_S[0] <= speed <= SPEED_M_PER_S[1]
    on_belt = f" (belt {belt_m_per_s:.2f} m/s)" if belt_m_per_s else ""
    found = [Check("walking speed", "good" if usual else "doubtful", speed, "m/s",
                   f"The pelvis travels at {speed:.2f} m/s{on_belt}: " + (
                       "a usual walking speed." if usual else "unusual for walking; is this a treadmill whose "
                       "belt_speed_m_per_s is missing, another unit, or no walk?"))]
    if speed >= SPEED_M_PER_S[0]:
        heading = float(np.degrees(np.arctan2(travel[1], travel[0])))
        mark = "good" if abs(heading) < HEADING_DEG[0] else "doubtful" if abs(heading) < HEADING_DEG[1] else "unusable"
        found.append(Check("direction of walking", mark, heading, "deg", f"The walk goes {abs(heading):.0f}° to the "
                           f"{'left' if heading >= 0 else 'right'} of x" + (
                               "." if mark == "good" else "; x must point forward: turn the laboratory (--forward).")))
    bob = float(np.ptp(_detrended(time_s, pelvis_W[:, 2])))
    fits = BOB_M[0] <= bob <= BOB_M[1]
    found.append(Check("rise and fall of the pelvis", "good" if fits else "doubtful", bob, "m",
                       f"The pelvis rises and falls by {1e3 * bob:.0f} mm" + (
                           ", as in walking." if fits else ", where walking has some 30 to 50 mm.")))
    acceleration = np.gradient(np.gradient(pelvis_W, time_s, axis=0), time_s, axis=0)
    peak = float(np.linalg.norm(acceleration, axis=1).max())
    if peak > JUMP_M_PER_S2:
        when = float(time_s[int(np.argmax(np.linalg.norm(acceleration, axis=1)))])
        found.append(Check("path of the pelvis", "doubtful", peak, "m/s^2", f"The pelvis is jerked at {when:.2f} s by "
                           f"{peak:.0f} m/s²: a jump in the recording? It acts on the whole body's mass."))
    return found


def _detrended(time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    return values - np.polyval(np.polyfit(time_s, values, 1), time_s)
