"""Global inverse kinematics: the pose of the whole model that fits all markers of a frame best.

In each frame n, over the 24 coordinates q of pelvis and both legs with the model's own joints and
segment lengths:

    minimise    sum_m w_m |p_m(q) - x_m(n)|^2        p_m: marker m on its segment of the model, x_m:
                                                     where it was seen
    subject to  q_low <= q <= q_high                 wide: what no joint reaches, against mirrored
                                                     solutions

(Lu & O'Connor 1999, doi 10.1016/S0021-9290(98)00158-4). Unlike `motion.markers.tracking`, whose
segments may come apart, the joints hold here, and skin motion of one segment is shared out to its
neighbours. Markers are filled, checked and filtered as there, and its angles start the search: the
first frame at them, every next one at the last solution plus their change.

Markers of the intact foot count double, since the foot's height above the floor decides the contact
force. Those of the prosthetic foot count a tenth: it bends, and the skeleton gives it an ankle of
its own, so it hardly informs the shank.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from scipy.optimize import least_squares

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.sentences import say
from vsf_drake.model.parameters import ModelParameters
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.markers.joints import COORDINATES, orientations_of
from vsf_drake.motion.markers.segments import (
    PARENTS,
    Calibration,
    RigidPoses,
    SegmentMarkers,
    TrackedMotion,
    rolls_with_shank,
)
from vsf_drake.motion.markers.tracking import CUTOFF_HZ, LONGEST_GAP_S, describe, smooth_poses
from vsf_drake.motion.trial import Trial, reaching_pelvis
from vsf_drake.plants.anthropometry import scale_body

INTACT_FOOT_WEIGHT = 2.0
PROSTHETIC_FOOT_WEIGHT = 0.1
LIMITS_DEG = {
    "pelvis_tilt": (-90, 90),
    "pelvis_list": (-60, 60),
    "hip_flexion": (-60, 150),
    "hip_adduction": (-70, 70),
    "hip_rotation": (-80, 80),
    "knee_angle": (-40, 170),
    "knee_adduction": (-40, 40),
    "knee_rotation": (-70, 70),
    "ankle_angle": (-80, 60),
    "ankle_adduction": (-70, 70),
    "ankle_rotation": (-70, 70),
}
"""Beyond any joint's range (a choice); pelvis translations and rotation (the heading) have none."""
LOW, HIGH = np.radians(
    [
        LIMITS_DEG.get(name.removesuffix("_r").removesuffix("_l"), (-np.inf, np.inf))
        for name in COORDINATES
    ]
).T
BESIDE_M = np.array([0.0, 0.05, 0.0])
"""In a foot's frame: what its own pose says of this point is one more marker of a foot whose
markers do not show its roll, as far from them as the fifth metatarsal head is (a choice)."""
MOST_EVALUATIONS = 100
AT_LIMIT_RAD = 1e-4  # a solution this near to a limit lies on it
STEP = 1e-5  # m, rad: central differences over it are exact to 1e-10


def refined(
    trial: Trial, *, cutoff_hz: float | None = CUTOFF_HZ, longest_gap_s: float = LONGEST_GAP_S
) -> Trial:
    """`trial`, made from markers with this cut-off and longest gap, with the joint angles that fit
    all of them best.

    The feet stay where their own markers show them, and the pelvis is moved so that the prosthetic
    ankle is there, as for any trial from markers. What is said of the markers' quality (residuals,
    motion of clusters, joints that come apart) stays that of the segments' own poses, since joints
    that hold hide it. Refused where a frame is not solved.
    """
    tracked = trial.tracked
    calibration = trial.calibration
    recording = trial.recording
    if tracked is None or calibration is None or recording is None:
        raise InputError(
            "inverse kinematics needs markers, and this trial has joint angles only",
            file=trial.path,
        )
    calibration = dataclasses.replace(calibration, subject=trial.subject)
    motion, at_limit = solve_inverse_kinematics(
        recording, calibration, trial.model, cutoff_hz=cutoff_hz, longest_gap_s=longest_gap_s
    )
    distances = motion.residual_rms_m
    worst = max(distances, key=lambda label: distances[label])
    notes = say(
        "import",
        "inverse_kinematics",
        rms_m=np.sqrt(np.mean(np.square(list(distances.values())))),
        worst=worst,
        worst_m=distances[worst],
        at_limit=at_limit,
    )
    fitted = dataclasses.replace(tracked, values=motion.values, notes=(*tracked.notes, *notes))
    columns = [tracked.names.index(name) for name in trial.trajectory.names]
    before, after = (
        reaching_pelvis(one, calibration, trial.subject)[0][:, columns] for one in (tracked, fitted)
    )
    on_belt = trial.trajectory.values - before
    return dataclasses.replace(
        trial,
        trajectory=trial.trajectory.with_values(after + on_belt),
        tracked=fitted,
        notes=(*trial.notes, *notes),
    )


def solve_inverse_kinematics(
    recording: Recording,
    calibration: Calibration,
    model: ModelParameters,
    *,
    cutoff_hz: float | None,
    longest_gap_s: float,
) -> tuple[TrackedMotion, tuple[str, ...]]:
    """The model's motion that fits all markers of `recording` best, and the coordinates that lie at
    a limit.

    Arguments as for `tracking.track`; the model's lengths enter the prosthetic leg.
    """
    filled, markers, poses, start = smooth_poses(
        recording, calibration, cutoff_hz=cutoff_hz, longest_gap_s=longest_gap_s
    )
    segments = dict(filled.segments)
    for name, segment in filled.segments.items():
        if rolls_with_shank(name, segment.p_BM):
            beside = f"beside the {name}"
            markers = {**markers, beside: poses[name].points(BESIDE_M)}
            segments[name] = dataclasses.replace(
                segment,
                labels=(*segment.labels, beside),
                p_BM=np.vstack([segment.p_BM, BESIDE_M]),
            )
    skeleton = Skeleton(calibration, segments, model)
    seen = np.stack([markers[label] for label in skeleton.labels], axis=1)
    values = np.empty_like(start)
    for n, x in enumerate(seen):
        guess = start[n] if n == 0 else values[n - 1] + start[n] - start[n - 1]
        solution = least_squares(
            skeleton.residuals,
            np.clip(guess, LOW, HIGH),
            skeleton.jacobian,
            (LOW, HIGH),
            "dogbox",
            ftol=None,
            gtol=None,
            xtol=1e-9,
            max_nfev=MOST_EVALUATIONS,
            args=(x,),
        )
        require(
            solution.success,
            f"inverse kinematics failed at {filled.time_s[n]:.3f} s",
            right="Look at the markers there, or use the segments' own poses",
            file=recording.path,
        )
        values[n] = solution.x
    away = np.minimum(values - LOW, HIGH - values).min(axis=0)
    at_limit = tuple(
        name for name, least in zip(COORDINATES, away, strict=True) if least < AT_LIMIT_RAD
    )
    return describe(
        calibration, filled, markers, skeleton.rigid_poses(values, markers), values
    ), at_limit


class Skeleton:
    """The calibration's subject as the model has it, with the markers of `segments` on it; q
    (..., 24) `COORDINATES`.
    """

    def __init__(
        self,
        calibration: Calibration,
        segments: Mapping[str, SegmentMarkers],
        model: ModelParameters,
    ) -> None:
        side = calibration.subject.prosthetic_side
        body = scale_body(calibration.subject, model.foot, model.socket)
        self.segments = segments
        self.labels = tuple(label for name in PARENTS for label in segments[name].labels)
        weights = [
            1.0
            if not name.startswith("foot")
            else PROSTHETIC_FOOT_WEIGHT
            if name.endswith(side)
            else INTACT_FOOT_WEIGHT
            for name in PARENTS
        ]
        self.root = np.sqrt(np.repeat(weights, [len(segments[name].labels) for name in PARENTS]))[
            :, None
        ]
        self._p_PB = {"pelvis": np.zeros(3)}  # each segment's origin in its parent's frame
        for leg, out in (("right", -1.0), ("left", 1.0)):
            self._p_PB |= {
                f"thigh_{leg}": np.array([body.hip_forward, out * body.hip_lateral, body.hip_up]),
                f"shank_{leg}": np.array([0.0, 0.0, -body.thigh(intact=leg != side)[-1]]),
                # No marker set resolves how socket, pylon and foot bend: a shank of the measured
                # length, with an ankle.
                f"foot_{leg}": (
                    calibration.segments[f"foot_{leg}"].p_PB
                    if leg == side
                    else np.array([0.0, 0.0, -body.shank_length])
                ),
            }

    def poses(self, q: np.ndarray) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """R_WB (..., 3, 3) and p_WB (..., 3) by segment."""
        R, pelvis = orientations_of(q)
        p = {"pelvis": pelvis}
        for name, parent in PARENTS.items():
            if parent is not None:
                p[name] = p[parent] + R[parent] @ self._p_PB[name]
        return R, p

    def markers(self, q: np.ndarray) -> np.ndarray:
        """(..., M, 3) m in W, in the order of `labels`."""
        R, p = self.poses(q)
        return np.concatenate(
            [
                self.segments[name].p_BM @ R[name].swapaxes(-1, -2) + p[name][..., None, :]
                for name in PARENTS
            ],
            axis=-2,
        )

    def residuals(self, q: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """(3M,) weighted distances from the markers as seen, (M, 3)."""
        return np.asarray(self.root * (self.markers(q) - seen)).ravel()

    def jacobian(self, q: np.ndarray, _: np.ndarray) -> np.ndarray:
        """(3M, 24), of `residuals`."""
        steps = STEP * np.eye(len(q))
        change = (self.markers(q + steps) - self.markers(q - steps)) / (2.0 * STEP)
        return np.asarray(self.root * change).reshape(len(q), -1).T

    def rigid_poses(
        self, values: np.ndarray, markers: Mapping[str, np.ndarray]
    ) -> dict[str, RigidPoses]:
        """The model's segments over the frames (n, 24), with the distances of their markers."""
        R, p = self.poses(values)
        poses = {}
        for name, segment in self.segments.items():
            seen = np.stack([markers[label] for label in segment.labels], axis=1)
            fitted = segment.p_BM @ R[name].transpose(0, 2, 1) + p[name][:, None]
            poses[name] = RigidPoses(
                R[name],
                p[name],
                np.linalg.norm(fitted - seen, axis=2),
                np.ones(len(values), dtype=bool),
            )
        return poses
