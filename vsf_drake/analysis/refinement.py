"""A trial from markers with the angles of global inverse kinematics instead of the segments' own."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from vsf_drake.analysis.inverse_kinematics import solve_inverse_kinematics
from vsf_drake.errors import InputError
from vsf_drake.motion.markers.gaps import LONGEST_GAP_S
from vsf_drake.motion.markers.tracking import CUTOFF_HZ
from vsf_drake.motion.pelvis_path import reaching_pelvis
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial import Trial


def refined(trial: Trial, *, cutoff_hz: float | None = CUTOFF_HZ, longest_gap_s: float = LONGEST_GAP_S,
            weights: Mapping[str, float] | None = None) -> Trial:
    """`trial` with the joint angles that fit all its markers best with joints that hold.

    The feet stay where their own markers show them, and the pelvis is moved so that the prosthetic ankle is there, as
    for any trial from markers. What is said of the markers' quality (residuals, motion of clusters, joints that come
    apart) stays that of the segments' own poses, since joints that hold hide it.

    Args:
        trial: made from markers (`from_markers`), with the same cut-off and longest gap.
        cutoff_hz, longest_gap_s, weights: see `solve_inverse_kinematics`.

    Raises:
        InputError: the trial has no markers; see `solve_inverse_kinematics`; a frame was not solved.
    """
    tracked, calibration, recording = trial.tracked, trial.calibration, trial.recording
    if tracked is None or calibration is None or recording is None:
        raise InputError("inverse kinematics needs markers, and this trial has joint angles only", file=trial.path)
    calibration = dataclasses.replace(calibration, subject=trial.subject)
    solution = solve_inverse_kinematics(recording, calibration, trial.model, cutoff_hz=cutoff_hz,
                                        longest_gap_s=longest_gap_s, weights=weights)
    motion = solution.motion
    distances = motion.residual_rms_m
    worst = max(distances, key=lambda label: distances[label])
    note = (f"Angles are from global inverse kinematics, which leaves the markers "
            f"{1e3 * np.sqrt(np.mean(np.square(list(distances.values())))):.1f} mm (RMS) from the model, "
            f"most {worst} with {1e3 * distances[worst]:.1f} mm.")
    limits = tuple(f"{name} lies at the limit of inverse kinematics." for name in solution.at_limit)
    fitted = dataclasses.replace(tracked, values=motion.values, notes=(*tracked.notes, note, *limits))
    names = trial.trajectory.names
    columns = [tracked.names.index(name) for name in names]
    before, after = (reaching_pelvis(one, calibration, trial.subject)[0][:, columns] for one in (tracked, fitted))
    on_belt = trial.trajectory.values - before
    trajectory = CoordinateTrajectory(trial.trajectory.time_s, after + on_belt, names, source=trial.trajectory.source)
    return dataclasses.replace(trial, trajectory=trajectory, tracked=fitted, notes=(*trial.notes, note, *limits))
