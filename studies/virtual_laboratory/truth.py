"""The true values of what a contact fit calls errors of motion, on a trial of a session; no walk is
made again.

Two kinds have one. How the foot sits (`offset.*`): the true foot's place in the true shank against
the written one in the written shank, but for what it is off to the side, which no parameter moves.
A constant error of a joint angle (`coordinate.*`): true less recorded, mean over stance. Both are
of the true segments' axes: corrected by them, a person whose pelvis, lengths and other angles are
true too stands on the true foot.

Or both `as_found`: of the axes and the knee that the session found. A session lays the pelvis's
path so that the recorded ankle is right, and measures the foot in the shank as found: what it gets
wrong in all trials alike is in both again, and then the recorded motion, as it is, carries the true
foot if it sits as found. What remains is what markers got wrong on the foot, and of an angle the
trial's own error and soft tissue's.

What cannot be had: hip rotation, whose mean the session took off. What has none: contact, socket,
friction and keel, which are of other laws in the model; curves and heights of trials, which share
their mean with the constants.

The session's errors are drawn again, as `session_tier` draws them, and applied to the recording in
place of the true motion: as turns of a few degrees commute but for their product, what that gets
wrong is 0.1 degrees or so.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from virtual_laboratory.motion import COORDINATES
from virtual_laboratory.recording import Foot, Recorded, in_degrees, in_radians
from virtual_laboratory.session import Session, foot_in_shank, session_tier
from virtual_laboratory.writing import mirrored
from vsf_drake.model.parameters import FootParameters
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trial import Trial
from vsf_drake.plants.foot import mount_pose

ANGLES = ("hip_flexion", "knee_angle", "hip_adduction")
"""Of the prosthetic side: those whose error has a truth."""
PASSES = 2
"""The errors are applied to the recording, then to that less them."""


def true_offsets(session: Session, *, as_found: bool = False) -> GeometricOffsets:
    """The mount that puts the foot of the written subject where the true foot is in its shank, but
    for what it is off to the side; signed by anatomy, the same of a person with the prosthesis on
    the left."""
    X_SP = foot_in_shank(session.person)
    if as_found:
        R_SF = RotationMatrix(Rotation.from_rotvec(session.turned["shank_right"]).as_matrix())
        X_SP = (
            RigidTransform(R_SF, session.true_ankle - R_SF.multiply(session.ankle)).inverse() @ X_SP
        )
    X_PW = X_SP.inverse() @ foot_in_shank(session.written)  # true place, written place
    foot = FootParameters()
    X_KM = mount_pose(foot) @ X_PW
    R, moved = X_KM.rotation().matrix(), X_KM.translation() - mount_pose(foot).translation()
    # R = Rz(toe_out) Rx(-inversion) Ry(alignment), as `mount_pose` makes it of a right foot
    return GeometricOffsets(
        height_m=-float(moved[2]),
        fore_aft_m=-float(moved[0]),
        alignment_rad=float(np.arctan2(-R[2, 0], R[2, 2])),
        inversion_rad=-float(np.arcsin(R[2, 1])),
        toe_out_rad=float(np.arctan2(-R[0, 1], R[1, 1])),
    )


def angle_errors(
    session: Session, trial: Trial, stride_s: float, index: tuple[int, ...]
) -> dict[str, float]:
    """Mean over the prosthetic stances of true less recorded, rad, by name of ANGLES.

    Args:
        trial: of the session, as it is read. stride_s: that it was made with. index: as
            `session_tier` had it.
    """
    left = trial.subject.prosthetic_side == "left"
    names = mirrored(np.zeros((1, len(COORDINATES))))[0] if left else COORDINATES
    values = np.array(trial.trajectory.ordered(names).values)
    recorded = in_degrees(mirrored(values)[1] if left else values)
    time_s, plate = trial.trajectory.time_s, trial.prosthetic_plate
    inside = [
        (time_s >= stance.start_s) & (time_s <= stance.end_s)
        for stance in find_stances(plate.time_s, plate.force_W[:, 2])
        if stance.start_s >= trial.start_s and stance.end_s <= trial.end_s
    ]
    none = Foot(np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1))
    true = recorded
    for _ in range(PASSES):
        walked = SimpleNamespace(
            time_s=time_s,
            coordinates=true,
            right=none,
            left=none,
            draw=SimpleNamespace(stride_s=stride_s),
        )
        again = session_tier(
            cast(Recorded, walked), replace(session, zeroed=()), "", index
        ).coordinates
        true = true + recorded - again
    off = in_radians(true - recorded)[np.any(inside, axis=0)].mean(axis=0)
    return {name: float(off[COORDINATES.index(f"{name}_r")]) for name in ANGLES}


def true_values(
    session: Session, trials: list[tuple[Trial, float, tuple[int, ...]]], *, as_found: bool = False
) -> dict[str, float]:
    """By name of a fit's parameter, of a fit of these trials: each with its stride (s) and index. m
    and rad."""
    side = trials[0][0].subject.prosthetic_side[0]
    own = replace(session, turned={name: 0.0 * turned for name, turned in session.turned.items()})
    errors: list[dict[str, Any]] = [
        angle_errors(own if as_found else session, *trial) for trial in trials
    ]
    offsets = {
        f"offset.{name.rsplit('_', 1)[0]}": value
        for name, value in vars(true_offsets(session, as_found=as_found)).items()
    }
    return offsets | {
        f"coordinate.{name}_{side}": float(np.mean([error[name] for error in errors]))
        for name in ANGLES
    }
