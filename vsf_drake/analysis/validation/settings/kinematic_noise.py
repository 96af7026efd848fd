"""Errors that a gait laboratory makes in joint angles, drawn at random and added to a recording.

Their sizes are a choice: those with which the embedded laboratory tier was made (data/reference_subject/README.md),
which are of the order that laboratories report for placing markers anew and for repeating a trial with the markers left
on. They come in two parts:

- of the session, the same in all its recordings: a constant error of each hip and knee angle of the prosthetic side
  (misplaced markers) and a smooth one over the gait cycle (sliding skin, crosstalk), a periodic cubic spline with
  SPLINES coefficients whose mean over the cycle is zero;
- of the recording: a constant error of each of these angles and of the pelvis's, and of the pelvis's place.

Angles of the other leg do not move the prosthetic foot and stay as they are. All draws are independent and normal.
Nothing is calibrated away afterwards: a laboratory that fits offsets in each session leaves less.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from vsf_drake.motion.gait_cycle import gait_phase, periodic_bsplines
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial_record import Trial

SPLINES = 8
PELVIS_ANGLES = ("pelvis_tilt", "pelvis_list", "pelvis_rotation")
PELVIS_PLACE = ("pelvis_tx", "pelvis_ty", "pelvis_tz")


@dataclass(frozen=True, kw_only=True)
class NoiseSizes:
    """Standard deviations.

    Attributes:
        session_deg: constant error of an angle in a session. session_smooth_deg: root mean square, expected, of the
            smooth one.
        recording_deg, recording_mm: constant errors of one recording.
    """

    session_deg: float = 1.2
    session_smooth_deg: float = 0.5
    recording_deg: float = 0.1
    recording_mm: float = 0.4


class KinematicNoise:
    """Noise of one recording; its draws depend on the numbers given to `perturbed` alone.

    Raises:
        InputError: the recording has no whole stance, so that its gait cycle is unknown.
    """

    def __init__(self, trial: Trial, sizes: NoiseSizes | None = None) -> None:
        self.trial, self.sizes = trial, sizes or NoiseSizes()
        side = trial.subject.prosthetic_side[0]
        names = trial.trajectory.names
        limb = [f"{joint}_{side}" for joint in ("hip_flexion", "hip_adduction", "hip_rotation", "knee_angle",
                                                "knee_adduction", "knee_rotation")]
        self.limb = [names.index(name) for name in limb if name in names]
        self.angles = self.limb + [names.index(name) for name in PELVIS_ANGLES if name in names]
        self.place = [names.index(name) for name in PELVIS_PLACE if name in names]
        self._smooth = smooth_basis(gait_phase(trial)(trial.trajectory.time_s))

    def session(self, random: np.random.Generator) -> np.ndarray:
        """(n, m) rad: one session's error of every sample, as all recordings of this motion would have it."""
        constant = np.radians(self.sizes.session_deg) * random.standard_normal(len(self.limb))
        waves = np.radians(self.sizes.session_smooth_deg) * random.standard_normal((SPLINES, len(self.limb)))
        error = np.zeros(self.trial.trajectory.values.shape)
        error[:, self.limb] = constant + self._smooth @ waves
        return error

    def recording(self, random: np.random.Generator) -> np.ndarray:
        """(m,) rad and m: one recording's own error."""
        error = np.zeros(self.trial.trajectory.values.shape[1])
        error[self.angles] = np.radians(self.sizes.recording_deg) * random.standard_normal(len(self.angles))
        error[self.place] = 1e-3 * self.sizes.recording_mm * random.standard_normal(len(self.place))
        return error

    def perturbed(self, error: np.ndarray) -> Trial:
        """The trial with an error, (n, m) or (m,), added to its samples."""
        motion = self.trial.trajectory
        moved = CoordinateTrajectory(motion.time_s, motion.values + error, motion.names, source=motion.source)
        return dataclasses.replace(self.trial, trajectory=moved)


def smooth_basis(phase: np.ndarray) -> np.ndarray:
    """(n, SPLINES): times independent standard normal coefficients it is a periodic curve with mean zero over the cycle
    whose mean square over a cycle is 1, expected."""
    basis = periodic_bsplines(SPLINES)
    cycle = basis(np.linspace(0.0, 1.0, 801)[:-1])
    centred = cycle - cycle.mean(axis=1, keepdims=True)
    size = np.sqrt(np.mean(np.sum(centred**2, axis=1)))
    own = basis(phase)
    return np.asarray((own - own.mean(axis=1, keepdims=True)) / size)
