"""What calibration and tracking hand on. Schema only.

Segment frames are the model's body frames, parallel to W (x forward, y left, z up) in the anatomical zero pose:
pelvis at the midpoint of the anterior superior iliac spines, thigh at the hip centre, shank at the knee centre, foot at
the ankle centre. Segments are called pelvis, thigh_right, shank_right, foot_right, thigh_left, shank_left, foot_left;
joints hip_right, knee_right, ankle_right and so on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import Subject

SEGMENTS = ("pelvis", "thigh_right", "shank_right", "foot_right", "thigh_left", "shank_left", "foot_left")
PARENTS = {"pelvis": None, "thigh_right": "pelvis", "shank_right": "thigh_right", "foot_right": "shank_right",
           "thigh_left": "pelvis", "shank_left": "thigh_left", "foot_left": "shank_left"}
"""The segment from which each hangs."""


@dataclass(frozen=True, eq=False)
class SegmentMarkers:
    """Markers that a rigid segment carries, in its own frame B.

    Attributes:
        labels: (k,) as in the recordings.
        p_BM: (k, 3) m.
        p_PB: (3,) m, the segment's origin (its proximal joint centre) in the parent's frame; zero for the pelvis. The
            model's person, whose segments hang straight under each other, need not have exactly these.
    """

    labels: tuple[str, ...]
    p_BM: np.ndarray
    p_PB: np.ndarray


@dataclass(frozen=True, eq=False)
class FootPoints:
    """Heel (rearmost) and toe (tip) of a foot's sole in its segment's frame (m).

    Both have z = the height of the sole: the ankle stands at -z above the floor when the foot is flat.
    """

    p_FHeel: np.ndarray
    p_FToe: np.ndarray


@dataclass(frozen=True, eq=False)
class Calibration:
    """A person's markers on segments, from a standing trial.

    Attributes:
        subject: mass, stature and every measured length.
        segments, feet: by name, all seven of `SEGMENTS`, and by side ("right", "left").
        angles_rad: the coordinates at standing, by name, both ankles included (nothing is zeroed); the pelvis's
            translations among them in m.
        lengths_m: what was measured, by name and side, for the report: thigh_right, shank_right, foot_right,
            ankle_height_right, hip_width, ... with the same for left.
        method: sentences on how each joint centre and axis was found.
        notes: sentences on what was assumed or looks doubtful.
    """

    subject: Subject
    segments: dict[str, SegmentMarkers]
    feet: dict[str, FootPoints]
    angles_rad: dict[str, float]
    lengths_m: dict[str, float]
    method: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class FootTrack:
    """Where a foot was, from its markers: the points of `FootPoints` and the ankle centre, (frames, 3) m in W."""

    heel_W: np.ndarray
    toe_W: np.ndarray
    ankle_W: np.ndarray


@dataclass(frozen=True, eq=False)
class Gap:
    """A stretch in which a marker was not seen, and how it was filled.

    `how` is "rigid cluster", "rigid cluster and joint centre" or "spline".
    """

    label: str
    start_s: float
    end_s: float
    how: str


@dataclass(frozen=True, eq=False)
class TrackedMotion:
    """Joint coordinates of a walk, from its markers.

    Attributes:
        time_s: (frames,) s, evenly spaced.
        names: pelvis and both legs, *both* ankles included, as in OpenSim (`ankle_angle_r`, `ankle_angle_l`, ...).
        values: (frames, m) m and rad, filtered once.
        feet: by side.
        residual_rms_m: by label, RMS distance of a marker from where its segment's pose puts it.
        cluster_motion_m: by segment, RMS over time of the markers' departure from a rigid body.
        joint_gap_m: by joint, RMS distance between the two segments' ideas of the joint's centre.
        gaps: what was filled.
        start_frame: first frame of the recording that is used.
        notes: sentences on what was assumed, filled or looks doubtful.
    """

    time_s: np.ndarray
    names: tuple[str, ...]
    values: np.ndarray
    feet: dict[str, FootTrack]
    residual_rms_m: dict[str, float]
    cluster_motion_m: dict[str, float]
    joint_gap_m: dict[str, float]
    gaps: tuple[Gap, ...] = ()
    start_frame: int = 0
    notes: tuple[str, ...] = ()

    def trajectory(self, names: tuple[str, ...], *, source: str | None = None) -> CoordinateTrajectory:
        """The C2 (quintic) splines through the coordinates `names`."""
        return CoordinateTrajectory(self.time_s, self.values, self.names, source=source).ordered(names)
