"""The pelvis where the model's own prosthetic leg reaches the measured foot.

Every segment's pose comes from its own markers, so that segments come apart at the joints by a centimetre or two (skin
motion, joint centres). The model's do not: hung from the measured pelvis, its foot would slide and bob by the sum of
these errors, and 1 mm of height is 3 % of body weight in the force (a sensitivity found in this model). What counts for
the force is where the foot is; so the pelvis's path is moved by as much as puts the prosthetic ankle where the foot's
markers show it. Angles stay as measured.

Known weakness: markers of a prosthesis lie below its socket and move with what the socket gives under load, which the
model's own socket gives once more. What the load changes in stance is therefore flattened, by about the share that
the socket has in the compliance of the whole. A nearly rigid socket instead was tried on two walks of able-bodied
people: the resultant's error changed by -0.04 to +0.02 body weights, that of the fore-aft force tripled.
"""

from __future__ import annotations

import numpy as np

from vsf_drake.motion.kinematics import PELVIS_TRANSLATIONS
from vsf_drake.motion.markers.joint_angles import COORDINATES, orientations_of
from vsf_drake.motion.markers.schema import Calibration, TrackedMotion
from vsf_drake.motion.plates import world_to_os
from vsf_drake.parameters import Subject

LARGE_M = 0.05
"""A pelvis that has to move farther (RMS) than this does not belong to the leg: lengths or joint centres are wrong."""


def reaching_pelvis(tracked: TrackedMotion, calibration: Calibration,
                    subject: Subject) -> tuple[np.ndarray, tuple[str, ...]]:
    """`tracked.values` with another pelvis translation, and a note that says how far it was moved.

    Args:
        subject: the model's person, with lengths as they will be used.
    """
    ankle = model_ankle(tracked, calibration, subject)
    moved = tracked.feet[subject.prosthetic_side].ankle_W - ankle
    values = np.array(tracked.values)
    values[:, [tracked.names.index(name) for name in PELVIS_TRANSLATIONS]] += world_to_os(moved)
    mean, spread = 1e3 * moved.mean(axis=0), 1e3 * moved.std(axis=0)
    note = (f"The pelvis was moved so that the model's {subject.prosthetic_side} (prosthetic) ankle is where its "
            "markers show it: forward, left, up by "
            + ", ".join(f"{m:+z.0f} ± {s:.0f}" for m, s in zip(mean, spread, strict=True)) + " mm.")
    if np.sqrt(np.mean(np.sum(moved**2, axis=1))) > LARGE_M:
        note += " That is much: the lengths of the leg or the joint centres are doubtful."
    return values, (note,)


def model_ankle(tracked: TrackedMotion, calibration: Calibration, subject: Subject) -> np.ndarray:
    """(n, 3) m, where the prosthetic ankle would be under the measured pelvis with the subject's lengths."""
    side = subject.prosthetic_side
    R_W, p_WPelvis = orientations_of(tracked.values[:, [tracked.names.index(name) for name in COORDINATES]])
    outward = -1.0 if side == "right" else 1.0
    measured = calibration.segments[f"thigh_{side}"].p_PB
    forward, lateral, up = (stated if stated is not None else found for stated, found in zip(
        (subject.hip_forward_m, subject.hip_lateral_m, subject.hip_up_m),
        (measured[0], outward * measured[1], measured[2]), strict=True))
    thigh = subject.prosthetic_thigh_length_m or subject.thigh_length_m or float(
        np.linalg.norm(calibration.segments[f"shank_{side}"].p_PB))
    hip = p_WPelvis + R_W["pelvis"] @ np.array([forward, outward * lateral, up])
    knee = hip + R_W[f"thigh_{side}"] @ np.array([0.0, 0.0, -thigh])
    return knee + R_W[f"shank_{side}"] @ calibration.segments[f"foot_{side}"].p_PB
