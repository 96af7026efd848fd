"""Every check of one trial, from markers or from joint angles, and what a report needs to show them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vsf_drake.analysis.recording import force_checks, marker_checks
from vsf_drake.analysis.recording.check import DOUBTFUL_BW, GOOD_BW, HIP_BW_PER_DEG, Check, expected_error, grade, worst
from vsf_drake.analysis.recording.foot import (
    Examined,
    FootMotion,
    MarkerEvidence,
    flat_phase,
    floor_point,
    model_motion,
    slip_velocity,
    turns_in_stance,
)
from vsf_drake.analysis.recording.force_checks import clearance, depth, foot_checks, touch_down
from vsf_drake.analysis.recording.marker_checks import high_content
from vsf_drake.motion.events import Stance, find_stances, kinematic_stances, walking_direction
from vsf_drake.motion.formats.recording import SIDES, os_to_world
from vsf_drake.motion.markers.frames import NOTE
from vsf_drake.motion.markers.schema import FootTrack, TrackedMotion
from vsf_drake.motion.plates import PlateRecording
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial_record import Trial
from vsf_drake.motion.window import on_the_belt
from vsf_drake.plants.anthropometry import scale_body
from vsf_drake.schema import to_plain
from vsf_drake.subject import PELVIS_TRANSLATIONS

GRID_S = 1e-3
EDGE_S = 0.1
"""Velocities this close to an end of a filtered recording are not its own (a choice: half a period of 6 Hz)."""
PARTIAL_S = 0.12
"""A plate that sees less of a stance than its motion tells by more than this has seen a part of it."""


def examine(trial: Trial, *, cutoff_hz: float | None = 6.0, belt_speed_m_per_s: float = 0.0,
            stated: Sequence[Check] = ()) -> Examined:
    """Looks at one trial from every side.

    Args:
        trial: as loaded, from joint angles or from markers.
        cutoff_hz: of the markers' filter; None where they were taken as filtered already.
        belt_speed_m_per_s: of the treadmill that `trial` is seen from.
        stated: checks that only the caller can make, on what was stated and what had to be estimated.

    Raises:
        InputError: the person's segments do not fit together.
    """
    markers = None
    if trial.tracked is not None and trial.calibration is not None and trial.recording is not None:
        markers = MarkerEvidence(trial.tracked, trial.calibration, trial.recording, cutoff_hz, trial.contacts)
    model = model_motion(trial.subject, trial.model, trial.trajectory, offsets=trial.offsets)
    feet = model.feet if markers is None else _tracked_feet(trial, markers.tracked, belt_speed_m_per_s)
    body = model.centre_of_mass if markers is None else _body_path(trial, markers.tracked, belt_speed_m_per_s)
    pelvis = pelvis_in_world(trial.trajectory.time_s, trial)
    measured, moving = _measured(trial), _moving(feet, pelvis, trial)
    stances = {side: [s for s in _joined(moving[side], measured.get(side, [])) if _overlaps(s, trial)]
               for side in SIDES}
    side, usual = trial.subject.prosthetic_side, _usual_duration(stances)
    if turns_in_stance(feet[side], stances[side], usual_s=usual):
        feet = {**feet, side: dataclasses.replace(feet[side], undeformed=True)}
    checks: list[Check] = list(stated)
    for side in sorted(SIDES, key=lambda side: side != trial.subject.prosthetic_side):
        cop = _cop_at(feet[side].time_s, trial.plates.get(side))
        checks += foot_checks(feet[side], stances[side], cop, usual_s=usual)
        checks += clearance(model.feet[side], stances[side])
        checks += _ground(model.feet[side], [s for s in measured.get(side, []) if _overlaps(s, trial)], trial)
        if cop is not None:
            checks += _present(force_checks.cop_under_foot(feet[side], trial.plates[side], cop))
    checks += _forces(trial, body, measured, moving) + _belt(feet, stances)
    checks += _angles(trial, markers, pelvis)
    if markers is not None:
        checks += _markers(markers)
    notes = trial.notes if markers is None else tuple(dict.fromkeys((*trial.notes, *markers.tracked.notes)))
    return Examined(trial, markers, tuple(checks), notes, feet, model.feet, measured, stances)


def weighed(trial: Trial, *, belt_speed_m_per_s: float = 0.0) -> Check:
    """The mass that the plates felt in a trial from markers, whatever the trial says it is.

    Raises:
        ValueError: the trial does not come from markers.
    """
    if trial.tracked is None:
        raise ValueError("only a trial from markers knows which foot was where")
    pelvis = pelvis_in_world(trial.trajectory.time_s, trial)
    moving = _moving(_tracked_feet(trial, trial.tracked, belt_speed_m_per_s), pelvis, trial)
    return _forces(trial, _body_path(trial, trial.tracked, belt_speed_m_per_s), _measured(trial), moving)[0]


def pelvis_in_world(time_s: np.ndarray, trial: Trial) -> np.ndarray:
    """(n, 3) m, the pelvis's origin at `time_s`."""
    names = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
    return os_to_world(trial.trajectory.ordered(names).sample(time_s)[0])


def _measured(trial: Trial) -> dict[str, list[Stance]]:
    return {side: find_stances(plate.time_s, plate.force_W[:, 2]) for side, plate in trial.plates.items()}


def _body_path(trial: Trial, tracked: TrackedMotion, belt_m_per_s: float) -> CoordinateTrajectory:
    """The body's centre of mass with the pelvis where its own markers show it, seen from the belt as the trial is."""
    motion = tracked.trajectory(trial.trajectory.names, source=trial.trajectory.source)
    motion, _, _ = on_the_belt(motion, {}, speed_m_per_s=belt_m_per_s)
    return model_motion(trial.subject, trial.model, motion).centre_of_mass


def _tracked_feet(trial: Trial, tracked: TrackedMotion, belt_m_per_s: float) -> dict[str, FootMotion]:
    """The feet as markers saw them, seen from the belt as the trial is."""
    shift = np.outer(belt_m_per_s * tracked.time_s, [1.0, 0.0, 0.0])
    feet = {}
    for side, track in tracked.feet.items():
        feet[side] = FootMotion(side, tracked.time_s, heel_W=track.heel_W + shift, toe_W=track.toe_W + shift,
                                ankle_W=track.ankle_W + shift, prosthetic=side == trial.subject.prosthetic_side,
                                lowest_m=np.minimum(track.heel_W[:, 2], track.toe_W[:, 2]))
    return feet


def _moving(feet: Mapping[str, FootMotion], pelvis: np.ndarray, trial: Trial) -> dict[str, list[Stance]]:
    tracks = {side: FootTrack(foot.heel_W, foot.toe_W, foot.ankle_W) for side, foot in feet.items()}
    paths = {side: _at(foot.time_s, trial.trajectory.time_s, pelvis) for side, foot in feet.items()}
    forward = walking_direction(tracks, pelvis)
    return {side: kinematic_stances(foot.time_s, tracks[side], paths[side], forward_W=forward)
            for side, foot in feet.items()}


def _joined(moving: Sequence[Stance], measured: Sequence[Stance]) -> list[Stance]:
    """All stances; where a plate saw the whole of one, its instants."""
    found = []
    for stance in moving:
        whole = [m for m in measured if _common(m, stance) > 0.5 * m.duration_s
                 and abs(m.start_s - stance.start_s) + abs(m.end_s - stance.end_s) < 2 * PARTIAL_S and m.complete]
        found.append(whole[0] if whole else stance)
    found += [m for m in measured if not any(_common(m, s) > 0.0 for s in found)]
    return sorted(found, key=lambda s: s.start_s)


def _usual_duration(stances: Mapping[str, list[Stance]]) -> float | None:
    durations = [s.duration_s for of_foot in stances.values() for s in of_foot if s.complete]
    return float(np.mean(durations)) if durations else None


def _ground(foot: FootMotion, stances: Sequence[Stance], trial: Trial) -> list[Check]:
    return [*_present(touch_down(foot, stances)),
            *_present(depth(foot, stances, mass_kg=trial.subject.mass_kg, fulcrum_m=trial.fulcrum_m))]


def _belt(feet: Mapping[str, FootMotion], stances: Mapping[str, list[Stance]]) -> list[Check]:
    usual = _usual_duration(stances)
    flats = [(foot, rows) for side, foot in feet.items() for stance in stances[side]
             if (rows := flat_phase(foot, stance, usual_s=usual)) is not None]
    return _present(belt([float(slip_velocity(foot, floor_point(foot))[rows, 0].mean())
                                       for foot, rows in flats]))


def _forces(trial: Trial, motion: CoordinateTrajectory, measured: Mapping[str, list[Stance]],
            moving: Mapping[str, list[Stance]]) -> list[Check]:
    start = max([motion.start_s, *(float(plate.time_s[0]) for plate in trial.plates.values())])
    end = min([motion.end_s, *(float(plate.time_s[-1]) for plate in trial.plates.values())])
    time = np.arange(start, end, GRID_S)
    if len(time) < 3:
        raise ValueError(f"forces and motion of {trial.name} do not overlap")
    vertical = force_checks.total_vertical(time, trial.plates)
    known = force_checks.covered(time, trial.plates, measured, moving)
    known &= (time >= motion.start_s + EDGE_S) & (time <= motion.end_s - EDGE_S)
    for start, end in (span for spans in trial.unmeasured.values() for span in spans):
        known &= (time < start) | (time > end)
    _, velocity, acceleration = motion.sample(time)
    found = [force_checks.mass(time, vertical, velocity[:, 2], known, mass_kg=trial.subject.mass_kg,
                               feet=len(trial.plates))]
    for side, plate in trial.plates.items():
        if plate.has_cop:
            path = np.column_stack([np.interp(plate.time_s, motion.time_s, column, left=np.nan, right=np.nan)
                                    for column in motion.values.T])
            found += _present(force_checks.shear(plate, path, side))
    lag = force_checks.lag(time, vertical, acceleration[:, 2], known) or force_checks.event_lag(measured, moving)
    return found + _present(lag)


def _angles(trial: Trial, markers: MarkerEvidence | None, pelvis: np.ndarray) -> list[Check]:
    motion = trial.trajectory
    angles = dict(zip(motion.names, motion.values.T, strict=True))
    speed = np.linalg.norm(np.gradient(pelvis[:, :2], motion.time_s, axis=0), axis=1)
    standing = None if markers is None else markers.calibration.angles_rad
    found = [zeroed(motion.time_s, angles, standing, speed)]
    found += _present(ankle_offset(angles, next(s for s in SIDES if s != trial.subject.prosthetic_side)))
    for side in SIDES:
        found += _present(knee_axis(angles, side))
    found += _present(smoothness(motion.time_s, angles))
    return found + walking(motion.time_s, pelvis)


def _markers(markers: MarkerEvidence) -> list[Check]:
    tracked, recording = markers.tracked, markers.recording
    used = {label for segment in markers.calibration.segments.values() for label in segment.labels}
    raw = {label: values for label, values in recording.markers.items() if label in used} or recording.markers
    found = [marker_checks.residuals(tracked.residual_rms_m), marker_checks.cluster_motion(tracked.cluster_motion_m),
             marker_checks.joint_gaps(tracked.joint_gap_m), marker_checks.gaps_filled(tracked.gaps),
             marker_checks.filtered_before(raw, recording.marker_rate_hz or 0.0, cutoff_hz=markers.cutoff_hz)]
    checks = [check for check in found if check is not None]
    checks += [Check("plate and foot", "doubtful", c.start_s, "s", f"Plate {c.plate} from {c.start_s:.3f} to "
                     f"{c.end_s:.3f} s: {c.doubt}.", c.side) for c in markers.contacts if c.doubt]
    if NOTE in recording.notes:
        checks.append(Check("left and right", "doubtful", None, "", NOTE))
    return checks + marker_checks.leg_lengths(markers.calibration.lengths_m)


def _cop_at(time_s: np.ndarray, plate: PlateRecording | None) -> np.ndarray | None:
    """(n, 3) centre of pressure at `time_s`, NaN where unknown."""
    if plate is None or not plate.has_cop:
        return None
    return np.column_stack([np.interp(time_s, plate.time_s, plate.cop_W[:, k], left=np.nan, right=np.nan)
                            for k in range(3)])


def _at(time_s: np.ndarray, known_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(time_s, known_s, column) for column in values.T])


def _overlaps(stance: Stance, trial: Trial) -> bool:
    return min(stance.end_s, trial.end_s) > max(stance.start_s, trial.start_s)


def _common(a: Stance, b: Stance) -> float:
    return min(a.end_s, b.end_s) - max(a.start_s, b.start_s)


def _present(check: Check | None) -> list[Check]:
    return [] if check is None else [check]


# Whether joint angles and the pelvis's path are those of a person who walks forward, and not zeroed at standing.


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


# An examined trial in numbers, for import.json and check.json.


def trial_table(item: Examined) -> dict[str, Any]:
    """Everything that was found about one trial; units are in the names, or beside the value."""
    trial = item.trial
    table: dict[str, Any] = {
        "name": trial.name, "synthetic": trial.synthetic, "mark": item.mark,
        "expected_error_bw": expected_error(item.checks),
        "checks": [dataclasses.asdict(check) for check in item.checks], "notes": list(item.notes),
        "window_s": [trial.start_s, trial.end_s], "fulcrum_mm": 1e3 * trial.fulcrum_m,
        "prosthetic_side": trial.subject.prosthetic_side, "feet_from": "markers" if item.markers else "model",
        "stances": {side: [_stance(s) for s in stances] for side, stances in item.stances.items()},
        "measured_stances": {side: [_stance(s) for s in stances] for side, stances in item.measured.items()},
        "inputs_sha256": dict(trial.inputs),
        "contacts": [dataclasses.asdict(contact) for contact in trial.contacts],
        "unmeasured_s": {side: [list(span) for span in spans] for side, spans in trial.unmeasured.items()},
    }
    if item.markers is not None:
        tracked = item.markers.tracked
        table |= {
            "marker_cutoff_hz": item.markers.cutoff_hz,
            "residual_rms_m": dict(tracked.residual_rms_m), "cluster_motion_m": dict(tracked.cluster_motion_m),
            "joint_gap_m": dict(tracked.joint_gap_m), "gaps": [dataclasses.asdict(gap) for gap in tracked.gaps]}
    return table


def overall_mark(items: Sequence[Examined]) -> str:
    """The worst mark of all trials."""
    return worst(item.mark for item in items)


def person_table(item: Examined) -> dict[str, Any]:
    """The subject, the masses of the model's segments, and what the standing trial told where there was one.

    Raises:
        InputError: the person's segments do not fit together.
    """
    trial = item.trial
    table: dict[str, Any] = {"subject": to_plain(trial.subject), "mass_budget_kg": mass_budget(trial)}
    if item.markers is not None:
        calibration = item.markers.calibration
        standing = calibration.angles_rad
        table["calibration"] = {
            "lengths_m": dict(calibration.lengths_m), "method": list(calibration.method),
            "notes": list(calibration.notes),
            "standing_angles_deg": {name: float(np.degrees(value)) for name, value in standing.items()
                                    if name not in PELVIS_TRANSLATIONS},
            "standing_pelvis_m": {name: standing[name] for name in PELVIS_TRANSLATIONS}}
    return table


def mass_budget(trial: Trial) -> dict[str, float]:
    """Masses (kg) of the model's segments by name; they add up to the body mass.

    Raises:
        InputError: the person's segments do not fit together.
    """
    body = scale_body(trial.subject, trial.model.foot, trial.model.socket)
    return {"pelvis, head, arms and trunk": body.pelvis_mass, "two thighs": 2 * body.thigh_mass,
            "intact shank": body.shank_mass, "intact foot": body.foot_mass,
            "residual shank": body.residual_shank_mass, "prosthesis": body.prosthesis_mass}


def _stance(stance: Stance) -> dict[str, Any]:
    return dataclasses.asdict(stance)
