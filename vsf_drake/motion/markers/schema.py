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

PARENTS = {"pelvis": None, "thigh_right": "pelvis", "shank_right": "thigh_right", "foot_right": "shank_right",
           "thigh_left": "pelvis", "shank_left": "thigh_left", "foot_left": "shank_left"}
"""The segment from which each hangs, parents first."""
SEGMENTS = tuple(PARENTS)


@dataclass(frozen=True, eq=False)
class SegmentMarkers:
    """Markers that a rigid segment carries, in its own frame B."""

    labels: tuple[str, ...]  # (k,) as in the recordings
    p_BM: np.ndarray  # (k, 3) m
    p_PB: np.ndarray
    """(3,) m, the segment's origin (its proximal joint centre) in the parent's frame; zero for the pelvis. The model's
    person, whose segments hang straight under each other, need not have exactly these."""


@dataclass(frozen=True, eq=False)
class FootPoints:
    """Heel (rearmost) and toe (tip) of a foot's sole in its segment's frame (m).

    Both have z = the height of the sole: the ankle stands at -z above the floor when the foot is flat.
    """

    p_FHeel: np.ndarray
    p_FToe: np.ndarray


@dataclass(frozen=True, eq=False)
class Calibration:
    """A person's markers on segments, from a standing trial."""

    subject: Subject  # mass, stature and every measured length
    segments: dict[str, SegmentMarkers]  # all seven of `SEGMENTS`
    feet: dict[str, FootPoints]  # by side ("right", "left")
    angles_rad: dict[str, float]
    """The coordinates at standing, by name, both ankles included (nothing is zeroed); the pelvis's translations in m.
    """
    lengths_m: dict[str, float]  # for the report: thigh_right, ankle_height_left, hip_width, ...
    method: tuple[str, ...] = ()  # sentences on how each joint centre and axis was found
    notes: tuple[str, ...] = ()  # sentences on what was assumed or looks doubtful


@dataclass(frozen=True, eq=False)
class FootTrack:
    """Where a foot was, from its markers: the points of `FootPoints` and the ankle centre, (frames, 3) m in W."""

    heel_W: np.ndarray
    toe_W: np.ndarray
    ankle_W: np.ndarray


@dataclass(frozen=True, eq=False)
class Gap:
    """A stretch in which a marker was not seen, and how it was filled."""

    label: str
    start_s: float
    end_s: float
    how: str  # "rigid cluster", "rigid cluster and joint centre" or "spline"


@dataclass(frozen=True, eq=False)
class TrackedMotion:
    """Joint coordinates of a walk, from its markers."""

    time_s: np.ndarray  # (frames,) evenly spaced
    names: tuple[str, ...]  # pelvis and both legs, *both* ankles included, as in OpenSim (`ankle_angle_r`, ...)
    values: np.ndarray  # (frames, m) m and rad, filtered once
    feet: dict[str, FootTrack]  # by side
    residual_rms_m: dict[str, float]  # by label, RMS distance of a marker from where its segment's pose puts it
    cluster_motion_m: dict[str, float]  # by segment, RMS over time of the markers' departure from a rigid body
    joint_gap_m: dict[str, float]  # by joint, RMS distance between the two segments' ideas of the joint's centre
    gaps: tuple[Gap, ...] = ()
    start_frame: int = 0  # first frame of the recording that is used
    notes: tuple[str, ...] = ()  # sentences on what was assumed, filled or looks doubtful

    def trajectory(self, names: tuple[str, ...], *, source: str | None = None) -> CoordinateTrajectory:
        """The C2 (quintic) splines through the coordinates `names`."""
        return CoordinateTrajectory(self.time_s, self.values, self.names, source=source).ordered(names)
