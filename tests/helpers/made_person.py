"""A made person whose truth is known: segment lengths and joint angles in, marker positions out.

Forward kinematics in plain numpy, written from the conventions (x forward, y left, z up; flexion,
adduction, rotation as intrinsic rotations; adduction and internal rotation positive on both sides)
and not from the code under test.

    person = Person()
    still = markers({}, person, label_set="plug_in_gait", frames=50)
    walk = markers(walking_angles(time), person, label_set="ior")
    recording = recording_of(still)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsf_drake.motion.formats.recording import Plate, Recording

SIDES = ("right", "left")
Poses = dict[str, tuple[np.ndarray, np.ndarray]]
"""By segment: R_WS (frames, 3, 3) and p_WS (frames, 3)."""


@dataclass(frozen=True)
class Person:
    """Lengths in m. Left and right differ where two numbers (right, left) stand.

    Hip centres follow Harrington et al. (2007), full form, from these pelvis dimensions and
    `leg_length`, less the marker's radius and base plate, unless `hip` (forward, lateral, up) says
    otherwise.
    """

    thigh: tuple[float, float] = (0.43, 0.43)
    shank: tuple[float, float] = (0.42, 0.42)
    ankle_height: tuple[float, float] = (0.08, 0.08)
    foot: tuple[float, float] = (0.26, 0.26)
    heel_behind_ankle: float = 0.06
    asis_width: float = 0.25
    pelvis_depth: float = 0.16
    leg_length: float = 0.90
    knee_width: float = 0.10
    ankle_width: float = 0.07
    marker_radius: float = 0.007
    base_plate: float = 0.002
    hip: tuple[float, float, float] | None = None

    @property
    def hip_centre(self) -> np.ndarray:
        """(forward, lateral, up) of the hip centre from the pelvis origin."""
        if self.hip is not None:
            return np.array(self.hip)
        pw, pd, ll = 1e3 * self.asis_width, 1e3 * self.pelvis_depth, 1e3 * self.leg_length
        skin = 1e3 * (self.marker_radius + self.base_plate)
        return 1e-3 * np.array(
            [-0.24 * pd - 9.9 - skin, 0.28 * pd + 0.16 * pw + 7.9, -0.16 * pw - 0.04 * ll - 7.1]
        )

    def points(self, side: str) -> dict[str, tuple[str, np.ndarray]]:
        """Role -> segment and position in its frame, for markers of one side."""
        i, out = SIDES.index(side), -1.0 if side == "right" else 1.0
        knee = out * (self.knee_width / 2 + self.marker_radius)
        ankle = out * (self.ankle_width / 2 + self.marker_radius)
        thigh, shank, sole = -self.thigh[i], -self.shank[i], -self.ankle_height[i]
        rear = -self.heel_behind_ankle
        tip = rear + self.foot[i]
        local = {
            "asis": ("pelvis", (0, out * self.asis_width / 2, 0)),
            "psis": ("pelvis", (-self.pelvis_depth, out * 0.05, 0)),
            "trochanter": ("thigh", (0.01, out * 0.09, 0.01)),
            "thigh_1": ("thigh", (0.05, out * 0.06, 0.45 * thigh)),
            "thigh_2": ("thigh", (0, out * 0.10, 0.6 * thigh)),
            "thigh_3": ("thigh", (0.06, out * 0.03, 0.7 * thigh)),
            "knee_lateral": ("thigh", (0, knee, thigh)),
            "knee_medial": ("thigh", (0, -knee, thigh)),
            "shank_1": ("shank", (0.05, out * 0.02, 0.3 * shank)),
            "shank_2": ("shank", (0, out * 0.09, 0.5 * shank)),
            "shank_3": ("shank", (0.05, out * 0.03, 0.7 * shank)),
            "fibula_head": ("shank", (-0.02, out * 0.05, -0.03)),
            "tibial_tuberosity": ("shank", (0.06, 0, -0.05)),
            "ankle_lateral": ("shank", (0, ankle, shank)),
            "ankle_medial": ("shank", (0, -ankle, shank)),
            "heel": ("foot", (rear - self.marker_radius - self.base_plate, 0, sole + 0.04)),
            "toe": ("foot", (rear + 0.73 * self.foot[i], 0, sole + 0.05)),
            "met1": ("foot", (rear + 0.73 * self.foot[i], -out * 0.045, sole + 0.04)),
            "met5": ("foot", (rear + 0.62 * self.foot[i], out * 0.055, sole + 0.03)),
            "toe_tip": ("foot", (tip, 0, sole + 0.03)),
        }
        return {
            role: (
                segment if segment == "pelvis" else f"{segment}_{side}",
                np.array(p, dtype=float),
            )
            for role, (segment, p) in local.items()
        }

    def sole(self, side: str) -> np.ndarray:
        """(2, 3) rearmost point and tip of the sole in the foot's frame."""
        i = SIDES.index(side)
        rear, z = -self.heel_behind_ankle, -self.ankle_height[i]
        return np.array([[rear, 0.0, z], [rear + self.foot[i], 0.0, z]])


def _label_sets() -> dict[str, dict[str, str]]:
    """Label set -> role -> label with S for the side's letter."""
    return {
        "plug_in_gait": {
            "asis": "SASI",
            "psis": "SPSI",
            "thigh_2": "STHI",
            "knee_lateral": "SKNE",
            "shank_2": "STIB",
            "ankle_lateral": "SANK",
            "heel": "SHEE",
            "toe": "STOE",
            "knee_medial": "SKNM",
            "ankle_medial": "SMED",
        },
        "rajagopal": {
            "asis": "SASI",
            "psis": "SPSI",
            "thigh_1": "STH1",
            "thigh_2": "STH2",
            "thigh_3": "STH3",
            "knee_lateral": "SLFC",
            "knee_medial": "SMFC",
            "shank_1": "STB1",
            "shank_2": "STB2",
            "shank_3": "STB3",
            "ankle_lateral": "SLMAL",
            "ankle_medial": "SMMAL",
            "heel": "SCAL",
            "toe": "SMT2",
            "met5": "SMT5",
        },
        "opensim": {
            "asis": "S.ASIS",
            "psis": "S.PSIS",
            "thigh_1": "S.TH1",
            "thigh_2": "S.TH2",
            "thigh_3": "S.TH3",
            "knee_lateral": "S.Knee",
            "knee_medial": "S.Knee.Med",
            "shank_1": "S.SH1",
            "shank_2": "S.SH2",
            "shank_3": "S.SH3",
            "ankle_lateral": "S.Ankle",
            "ankle_medial": "S.Ankle.Med",
            "heel": "S.Heel",
            "toe_tip": "S.Toe",
            "met5": "S.MT5",
        },
        "ior": {
            "asis": "SASIS",
            "psis": "SPSIS",
            "trochanter": "SGT",
            "knee_lateral": "SLE",
            "knee_medial": "SME",
            "fibula_head": "SHF",
            "tibial_tuberosity": "STT",
            "ankle_lateral": "SLM",
            "ankle_medial": "SMM",
            "heel": "SCA",
            "met1": "SFM",
            "toe": "SSM",
            "met5": "SVM",
        },
    }


def poses(angles: Mapping[str, object], person: Person | None = None, *, frames: int = 1) -> Poses:
    """Poses of the seven segments in W.

    Args:
        angles: joint coordinates by the model's names (rad, m), numbers or (frames,); what is
            absent is zero. Without `pelvis_ty` the pelvis stands, frame by frame, so high that the
            lowest point of the two soles is at z = 0.
        frames: how many, where every angle is a number.
    """
    person = person or Person()
    n = max([frames, *(len(np.atleast_1d(v)) for v in angles.values())])
    q = {
        name: np.broadcast_to(np.asarray(value, dtype=float), (n,))
        for name, value in angles.items()
    }

    def at(name: str) -> np.ndarray:
        return q.get(name, np.zeros(n))

    found: Poses = {}
    R_pelvis = (
        _turn((0, -1, 0), at("pelvis_tilt"))
        @ _turn((1, 0, 0), at("pelvis_list"))
        @ _turn((0, 0, 1), at("pelvis_rotation"))
    )
    origin = np.stack([at("pelvis_tx"), -at("pelvis_tz"), at("pelvis_ty")], axis=1)
    found["pelvis"] = (R_pelvis, origin)
    for i, side in enumerate(SIDES):
        s, m, out = side[0], (1 if side == "right" else -1), (-1 if side == "right" else 1)
        forward, lateral, up = person.hip_centre
        R, p = R_pelvis, origin + R_pelvis @ np.array([forward, out * lateral, up])
        R = R @ _joint(
            at(f"hip_flexion_{s}"), at(f"hip_adduction_{s}"), at(f"hip_rotation_{s}"), m, -1
        )
        found[f"thigh_{side}"] = (R, p)
        p = p + R @ np.array([0, 0, -person.thigh[i]])
        R = R @ _joint(
            at(f"knee_angle_{s}"), at(f"knee_adduction_{s}"), at(f"knee_rotation_{s}"), m, 1
        )
        found[f"shank_{side}"] = (R, p)
        p = p + R @ np.array([0, 0, -person.shank[i]])
        R = R @ _joint(
            at(f"ankle_angle_{s}"), at(f"ankle_adduction_{s}"), at(f"ankle_rotation_{s}"), m, -1
        )
        found[f"foot_{side}"] = (R, p)
    if "pelvis_ty" not in angles:
        soles = [found[f"foot_{side}"] for side in SIDES]
        heights = [
            (p[:, None] + np.einsum("fij,kj->fki", R, person.sole(side)))[..., 2].min(axis=1)
            for side, (R, p) in zip(SIDES, soles, strict=True)
        ]
        lift = np.zeros((n, 3))
        lift[:, 2] = -np.min(heights, axis=0)
        found = {name: (R, p + lift) for name, (R, p) in found.items()}
    return found


def markers(
    angles: Mapping[str, object],
    person: Person | None = None,
    *,
    label_set: str = "plug_in_gait",
    medial: bool = True,
    frames: int = 1,
) -> dict[str, np.ndarray]:
    """Label -> (frames, 3) m in W. See `poses` for `angles`; `medial` gives the medial knee and
    ankle markers."""
    person = person or Person()
    where = poses(angles, person, frames=frames)
    labels = _label_sets()[label_set]
    found = {}
    for side in SIDES:
        points = person.points(side)
        for role, pattern in labels.items():
            if role.endswith("_medial") and not medial:
                continue
            segment, p = points[role]
            R_WS, p_WS = where[segment]
            found[side_label(pattern, side)] = p_WS + R_WS @ p
    return found


def label_of(role: str, side: str, label_set: str) -> str:
    """What `label_set` calls the marker of `role` on `side`."""
    return side_label(_label_sets()[label_set][role], side)


def side_label(pattern: str, side: str) -> str:
    """`pattern` with its leading S replaced by R or L."""
    return side[0].upper() + pattern[1:]


def walking_angles(
    time: np.ndarray, *, speed: float = 1.2, cadence_hz: float = 0.9
) -> dict[str, np.ndarray]:
    """A cartoon of walking along +x: smooth, periodic, left half a cycle after right. No feet on
    any floor."""
    time = np.asarray(time, dtype=float)
    angles = {
        "pelvis_tx": speed * time,
        "pelvis_tilt": np.full_like(time, 0.1),
        "pelvis_list": 0.05 * np.sin(2 * np.pi * cadence_hz * time),
        "pelvis_rotation": 0.06 * np.cos(2 * np.pi * cadence_hz * time),
    }
    for side, shift in (("r", 0.0), ("l", np.pi)):
        phase = 2 * np.pi * cadence_hz * time + shift
        angles |= {
            f"hip_flexion_{side}": 0.15 + 0.38 * np.cos(phase),
            f"hip_adduction_{side}": 0.06 * np.sin(phase),
            f"hip_rotation_{side}": 0.04 * np.sin(phase + 0.5),
            f"knee_angle_{side}": 0.45 - 0.4 * np.cos(phase + 0.9) + 0.1 * np.cos(2 * phase),
            f"ankle_angle_{side}": 0.15 * np.sin(phase + 2.0) + 0.08 * np.sin(2 * phase),
            f"ankle_adduction_{side}": 0.03 * np.sin(phase),
            f"ankle_rotation_{side}": np.full_like(time, -0.05),
        }
    return angles


def recording_of(
    labelled: Mapping[str, np.ndarray],
    *,
    rate_hz: float = 100.0,
    plates: tuple[Plate, ...] = (),
    force_rate_hz: float | None = None,
    path: str = "made.c3d",
) -> Recording:
    """The recording that holds these markers."""
    return Recording(
        path=Path(path),
        markers=dict(labelled),
        marker_rate_hz=rate_hz,
        plates=plates,
        force_rate_hz=force_rate_hz,
    )


def _turn(axis: tuple[float, float, float], angle: np.ndarray) -> np.ndarray:
    """(frames, 3, 3) rotation about a unit axis by Rodrigues' formula."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=float)
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * K + (1 - c) * (K @ K)


def _joint(
    flexion: np.ndarray, adduction: np.ndarray, rotation: np.ndarray, m: int, left: int
) -> np.ndarray:
    """Flexion about y (left = 1) or -y, adduction about x, rotation about z; m = -1 mirrors the
    last two."""
    return _turn((0, left, 0), flexion) @ _turn((m, 0, 0), adduction) @ _turn((0, 0, m), rotation)
