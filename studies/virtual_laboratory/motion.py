"""The synthetic person's body as the model has it, and the motion that everything starts from.

Coordinates, in this order everywhere: `person_coordinates("right")` of
`vsf_drake.model.parameters`, m and rad. Poses, Jacobians and the centre of mass come from the very
plant that `vsf_drake` walks with, the prosthesis undeformed, so that what is written as joint
angles is what the virtual prosthesis was driven by.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

from virtual_laboratory.body import DEVICE, HAT, LUMBAR_UP_M, PELVIS, SEGMENTS, SHANK
from virtual_laboratory.targets import LEG_M, Draw
from vsf_drake.model.parameters import ModelParameters, Subject, person_coordinates
from vsf_drake.plants.foot import sole_height
from vsf_drake.plants.person import add_person

ANGLES = (
    Path(__file__).resolve().parents[2] / "data" / "published" / "able_bodied_angles_1p1mps.csv"
)
LEG = {
    "hip_flexion": "hip_flexion",
    "hip_adduction": "hip_adduction",
    "hip_rotation": "hip_rotation",
    "knee_angle": "knee_flexion",
    "knee_adduction": "knee_adduction",
    "knee_rotation": "knee_rotation",
}
COORDINATES = person_coordinates("right")
TRUNK = ("trunk_tx", "trunk_ty", "trunk_tz", "trunk_list", "trunk_pitch", "trunk_turn")
"""Of head, arms and trunk: the lumbar joint's shift from its place in the pelvis (m, along W's
axes), then the angles about x, y and z of R = Rz Ry Rx in W (rad)."""
MOVING = len(COORDINATES) + len(TRUNK)
PUBLISHED_STRIDE_M = 1.1 * 1.26
"""Stride (m) at the 1.1 m/s of the published angles: on this subject's legs the soles then rest if
it lasts 1.26 s."""
LOADING_PEAK, LOADING_WIDTH = 0.14, 0.055
"""Phase of the published knee's flexion under load and the width of the bump that is taken from
it."""
KNEE_DEG_PER_SPEED = 15.7
"""How that flexion rises per m/s in the published groups."""
SWAY_M = 0.022
"""The pelvis goes so far to the side of the standing leg (a choice)."""
DEGREE, KNOT_SPACING_S = 5, 0.04
"""Corrections are quintic splines; knots every 40 ms let them reach about 10 Hz."""


@dataclass(frozen=True)
class Linearised:
    """The body over N instants, S segments (`SEGMENTS`) and the 27 functions that move it: 21
    coordinates, `TRUNK`.

    Attributes:
        R_WB, p_WB: (N, S, 3, 3) and (N, S, 3) m.
        J_WB: (N, S, 6, 27) rotation (rad) and translation of the origin (m) per function, in W.
    """

    R_WB: np.ndarray
    p_WB: np.ndarray
    J_WB: np.ndarray

    def point(self, segment: int, p_B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A point fixed in a segment, p_B (N, 3) or (3,) m: where it is (N, 3) m in W, and its (N,
        3, 27) Jacobian."""
        lever = np.einsum(
            "nij,nj->ni", self.R_WB[:, segment], np.broadcast_to(p_B, self.p_WB[:, segment].shape)
        )
        return self.p_WB[:, segment] + lever, self.forward(segment, lever)

    def forward(self, segment: int, lever_W: np.ndarray) -> np.ndarray:
        """(N, 3, 27) Jacobian of the segment's material point at `lever_W` (N, 3) m from its
        origin."""
        turn, shift = self.J_WB[:, segment, :3], self.J_WB[:, segment, 3:]
        return shift + cross(turn, lever_W[:, :, None])


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a x b along the last axis but one, of shapes that broadcast."""
    return np.stack(
        [
            a[..., 1, :] * b[..., 2, :] - a[..., 2, :] * b[..., 1, :],
            a[..., 2, :] * b[..., 0, :] - a[..., 0, :] * b[..., 2, :],
            a[..., 0, :] * b[..., 1, :] - a[..., 1, :] * b[..., 0, :],
        ],
        axis=-2,
    )


class Person:
    """Kinematics of the subject, the legs by Drake."""

    def __init__(self, subject: Subject, model: ModelParameters) -> None:
        self.subject, self.model = subject, model
        self._plant = MultibodyPlant(0.0)
        self.handles = add_person(self._plant, subject, model)
        self._plant.Finalize()
        self._context = self._plant.CreateDefaultContext()
        self._bodies = [self._plant.GetBodyByName(name) for name in SEGMENTS[:HAT]]
        joints = [self._plant.GetJointByName(name) for name in COORDINATES]
        self._position = np.array([joint.position_start() for joint in joints])
        self._velocity = np.array([joint.velocity_start() for joint in joints])
        body = self.handles.body
        self.p_PL = np.array([body.hip_forward, 0.0, body.hip_up + LUMBAR_UP_M])
        """(3,) m, lumbar joint in the pelvis."""
        rest = self.leg_poses(np.zeros((1, len(COORDINATES))))
        self.p_SK = rest[1][0, DEVICE] - rest[1][0, SHANK]
        """(3,) m, origin of the keel frame in the shank's, the prosthesis undeformed."""
        self.sole_height = sole_height(model.foot)

    def _set(self, q: np.ndarray) -> None:
        full = np.zeros(self._plant.num_positions())
        full[self._position] = q
        self._plant.SetPositions(self._context, full)

    def leg_poses(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """R_WB (N, S - 1, 3, 3) and p_WB (N, S - 1, 3) m of all but the trunk for coordinates q (N,
        21)."""
        X = np.empty((len(q), len(self._bodies), 3, 4))
        for k, row in enumerate(q):
            self._set(row)
            X[k] = [body.EvalPoseInWorld(self._context).GetAsMatrix34() for body in self._bodies]
        return X[..., :3], X[..., 3]

    def with_trunk(
        self, R_WB: np.ndarray, p_WB: np.ndarray, R_WH: np.ndarray, shift: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The legs' poses and the trunk's, turned R_WH (N, 3, 3) and shifted (N, 3) m from its
        place in the pelvis."""
        lumbar = p_WB[:, PELVIS] + R_WB[:, PELVIS] @ self.p_PL + shift
        return np.concatenate([R_WB, R_WH[:, None]], axis=1), np.concatenate(
            [p_WB, lumbar[:, None]], axis=1
        )

    def linearise(self, u: np.ndarray) -> Linearised:
        """Poses and their Jacobians for coordinates and trunk u (N, 27)."""
        world, count = self._plant.world_frame(), len(COORDINATES)
        R_WB, p_WB = self.leg_poses(u[:, :count])
        R_WB, p_WB = self.with_trunk(
            R_WB, p_WB, trunk_turn(u[:, count + 3 :]).as_matrix(), u[:, count : count + 3]
        )
        J_WB = np.zeros((len(u), len(SEGMENTS), 6, MOVING))
        for k, row in enumerate(u):
            self._set(row[:count])
            for i, body in enumerate(self._bodies):
                J_WB[k, i, :, :count] = self._plant.CalcJacobianSpatialVelocity(
                    self._context,
                    JacobianWrtVariable.kV,
                    body.body_frame(),
                    np.zeros(3),
                    world,
                    world,
                )[:, self._velocity]
        lever = R_WB[:, PELVIS] @ self.p_PL
        J_WB[:, HAT, 3:] = J_WB[:, PELVIS, 3:] + cross(J_WB[:, PELVIS, :3], lever[:, :, None])
        J_WB[:, HAT, 3:, count : count + 3] = np.eye(3)
        turn, pitch = u[:, -1], u[:, -2]
        J_WB[:, HAT, :3, -3] = np.column_stack(
            [np.cos(turn) * np.cos(pitch), np.sin(turn) * np.cos(pitch), -np.sin(pitch)]
        )
        J_WB[:, HAT, :3, -2] = np.column_stack([-np.sin(turn), np.cos(turn), np.zeros(len(u))])
        J_WB[:, HAT, 2, -1] = 1.0
        return Linearised(R_WB, p_WB, J_WB)


def trunk_turn(angles: np.ndarray) -> Rotation:
    """The trunk's rotation in W by its angles (N, 3) rad."""
    return Rotation.from_euler("ZYX", angles[:, ::-1])


@dataclass(frozen=True)
class Splines:
    """Smooth functions over `time_s` (N,): values (N, K), and what their roughness costs.

    Attributes:
        values: (N, K) of the K splines; each row has DEGREE + 1 non-zero ones from `first` (N,) on.
        roughness: (K, K) mean over time of products of third derivatives.
        change: (M, K) over one stride, from each instant that is followed by another a stride
            later.
    """

    time_s: np.ndarray
    values: np.ndarray
    first: np.ndarray
    roughness: np.ndarray
    change: np.ndarray


def make_splines(time_s: np.ndarray, stride_s: float) -> Splines:
    """Clamped splines over the span of `time_s` (N,) s, evenly spaced knots."""
    start, end = float(time_s[0]), float(time_s[-1])
    inner = np.linspace(start, end, round((end - start) / KNOT_SPACING_S) + 1)
    knots = np.concatenate([np.full(DEGREE, start), inner, np.full(DEGREE, end)])
    count = len(knots) - DEGREE - 1
    values = BSpline.design_matrix(np.clip(time_s, start, end), knots, DEGREE).toarray()
    early = time_s <= end - stride_s
    later = BSpline.design_matrix(time_s[early] + stride_s, knots, DEGREE).toarray()
    third = BSpline(knots, np.eye(count), DEGREE).derivative(3)(time_s)
    first = np.clip(np.searchsorted(inner, time_s, side="right") - 1, 0, len(inner) - 2)
    return Splines(time_s, values, first, third.T @ third / len(time_s), later - values[early])


def base_motion(draw: Draw, time_s: np.ndarray) -> np.ndarray:
    """(N, 27) published curves with the trial's own speed, cadence and amplitudes; heel strike of
    the right at 0 s.

    The right knee gives way less under load. The pelvis goes at a steady speed at height zero:
    placing it over the feet is up to the fit. The trunk is upright and turns against the pelvis.
    """
    series = _read_series()
    right, left = time_s / draw.stride_s, (time_s - draw.intact_strike_s) / draw.stride_s
    stretch = draw.speed_m_per_s * draw.stride_s / (PUBLISHED_STRIDE_M * draw.leg_m / LEG_M)

    def wave(name: str, phase: np.ndarray, scale: float = 1.0) -> np.ndarray:
        a = series[name]
        turn = 2 * np.pi * np.multiply.outer(phase, np.arange(1, (len(a) + 1) // 2))
        return a[0] + scale * (np.cos(turn) @ a[1::2] + np.sin(turn) @ a[2::2])

    angles = {
        "pelvis_tilt": -wave("pelvis_anterior_tilt", right) - draw.tilt_deg,
        "pelvis_list": -wave("pelvis_up", right, draw.list_scale),
        "pelvis_rotation": wave("pelvis_forward", right, draw.rotation_scale),
    }
    for side, phase in (("r", right), ("l", left)):
        angles |= {
            f"{name}_{side}": wave(published, phase, stretch if name == "hip_flexion" else 1.0)
            for name, published in LEG.items()
        }
        angles[f"hip_flexion_{side}"] += draw.tilt_deg
    published_peak = float(wave("knee_flexion", np.array([LOADING_PEAK]))[0])
    for side, phase, higher in (
        ("r", right, draw.knee_loading_deg - published_peak),
        ("l", left, KNEE_DEG_PER_SPEED * draw.faster_m_per_s),
    ):
        off = ((phase - LOADING_PEAK + 0.5) % 1.0 - 0.5) / LOADING_WIDTH
        angles[f"knee_angle_{side}"] += higher * np.exp(-0.5 * off**2)
    angles["ankle_angle_l"] = wave("ankle_dorsiflexion", left)
    values = {name: np.radians(curve) for name, curve in angles.items()}
    values["pelvis_tx"] = draw.speed_m_per_s * (time_s - 0.5 * draw.stance_s)
    values["pelvis_tz"] = SWAY_M * np.cos(
        2.0 * np.pi * (time_s - 0.5 * draw.stance_s) / draw.stride_s
    )
    values["trunk_turn"] = -values["pelvis_rotation"]
    return np.column_stack(
        [values.get(name, np.zeros(len(time_s))) for name in COORDINATES + TRUNK]
    )


def _read_series() -> dict[str, np.ndarray]:
    """Angle -> (1 + 2 * harmonics,) coefficients a0, a1, b1, a2, ... in degrees."""
    rows = list(
        csv.reader(line for line in ANGLES.read_text().splitlines() if not line.startswith("#"))
    )
    return {row[0]: np.array(row[1:-1], dtype=float) for row in rows[1:]}
