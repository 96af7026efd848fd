"""Every check of one trial, from markers or from joint angles, and what a report needs to show them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from vsf_drake.analysis.recording import angle_checks, force_checks, ground_checks, marker_checks
from vsf_drake.analysis.recording.check import Check
from vsf_drake.analysis.recording.evidence import Examined, MarkerEvidence
from vsf_drake.analysis.recording.foot import FootMotion, flat_phase, floor_point, slip_velocity, turns_in_stance
from vsf_drake.analysis.recording.foot_checks import clearance, foot_checks
from vsf_drake.analysis.recording.model_feet import model_motion
from vsf_drake.motion.events import Stance, find_stances
from vsf_drake.motion.kinematic_events import kinematic_stances, walking_direction
from vsf_drake.motion.markers.handedness import NOTE
from vsf_drake.motion.markers.schema import FootTrack, TrackedMotion
from vsf_drake.motion.plates import SIDES, PlateRecording, os_to_world
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.treadmill import on_the_belt
from vsf_drake.motion.trial import Trial

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
    return [*_present(ground_checks.touch_down(foot, stances)),
            *_present(ground_checks.depth(foot, stances, mass_kg=trial.subject.mass_kg, fulcrum_m=trial.fulcrum_m))]


def _belt(feet: Mapping[str, FootMotion], stances: Mapping[str, list[Stance]]) -> list[Check]:
    usual = _usual_duration(stances)
    flats = [(foot, rows) for side, foot in feet.items() for stance in stances[side]
             if (rows := flat_phase(foot, stance, usual_s=usual)) is not None]
    return _present(angle_checks.belt([float(slip_velocity(foot, floor_point(foot))[rows, 0].mean())
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
    found = [angle_checks.zeroed(motion.time_s, angles, standing, speed)]
    found += _present(angle_checks.ankle_offset(angles, next(s for s in SIDES if s != trial.subject.prosthetic_side)))
    for side in SIDES:
        found += _present(angle_checks.knee_axis(angles, side))
    found += _present(angle_checks.smoothness(motion.time_s, angles))
    return found + angle_checks.walking(motion.time_s, pelvis)


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

