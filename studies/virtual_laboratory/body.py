"""The synthetic person's masses: every segment as six mass points that have its mass, centre and
inertia.

Not the model's table (de Leva 1996): Winter (2009, Biomechanics and Motor Control of Human
Movement, 4th ed., Table 4.1, after Dempster). Head, arms and trunk are one segment (HAT) of its own
above the pelvis; arms do not swing by themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.model.parameters import IntactFootParameters
from vsf_drake.plants.person import PersonHandles

SEGMENTS = (
    "pelvis",
    "thigh_right",
    "shank_right",
    "vsf_frame",
    "thigh_left",
    "shank_left",
    "foot_left",
    "hat",
)
PELVIS, SHANK, DEVICE, INTACT_FOOT, HAT = (
    SEGMENTS.index(name) for name in ("pelvis", "shank_right", "vsf_frame", "foot_left", "hat")
)
THIGH_MASS, SHANK_MASS, FOOT_MASS, PELVIS_MASS = 0.100, 0.0465, 0.0145, 0.142
"""Of body mass (Winter). The residual limb has the shank's in proportion to its length, as in the
public GaitModel_VSF scripts; what is left is head, arms and trunk."""
CENTRE, FOOT_CENTRE = 0.433, 0.5
"""Centre of mass of thigh and shank from the proximal joint, of the foot from the ankle to the
second metatarsal head, in lengths (Winter)."""
THIGH_RADIUS, SHANK_RADIUS, FOOT_RADIUS = 0.323, 0.302, 0.475
"""Radius of gyration across, in the same lengths (Winter)."""
THIGH_ROUND, SHANK_ROUND = 0.15, 0.10
"""The same about the long axis, in lengths (choices)."""
METATARSAL = 0.72
"""Second metatarsal head, in foot lengths from the heel (a choice)."""
PELVIS_UP_M, PELVIS_RADIUS_M = 0.057, 0.080
"""Centre of the pelvis above the hips, and its radius of gyration, as in de Leva's lower trunk;
about every axis (a choice)."""
LUMBAR_UP_M = 0.11
"""Lumbar joint, about which the trunk turns, above the hips (a choice)."""
HAT_UP, HAT_RADIUS, HAT_ROUND = 0.226, 0.137, 0.072
"""Of head, arms and trunk without the pelvis, in statures: centre of mass above the hips and radius
of gyration across, what is left of Winter's HAT (0.678 of body mass, centre 0.626 and radius
0.496 of the 0.288 statures from hip to shoulder) without the pelvis above; radius about the long
axis with hanging arms (a choice)."""


@dataclass(frozen=True)
class MassPoints:
    """P mass points: segment (P,) as index into `SEGMENTS`, p_B (P, 3) m in its frame, mass (P,)
    kg."""

    segment: np.ndarray
    p_B: np.ndarray
    mass: np.ndarray

    def together(self, other: MassPoints) -> MassPoints:
        return MassPoints(
            *(
                np.concatenate(pair)
                for pair in zip(
                    (self.segment, self.p_B, self.mass),
                    (other.segment, other.p_B, other.mass),
                    strict=True,
                )
            )
        )

    def places(self, R_WB: np.ndarray, p_WB: np.ndarray) -> np.ndarray:
        """(N, P, 3) m in W for poses R_WB (N, S, 3, 3), p_WB (N, S, 3) m of all segments."""
        lever = np.einsum("npij,pj->npi", R_WB[:, self.segment], self.p_B)
        return np.asarray(p_WB[:, self.segment] + lever)


def _six(
    segment: int, mass: float, centre: np.ndarray, radii: tuple[float, float, float]
) -> MassPoints:
    """Two points on each of the axes x, y, z about the centre (3,) m; radii of gyration (m) about
    these."""
    squares = np.square(radii)
    apart = np.sqrt(np.maximum(1.5 * (squares.sum() - 2.0 * squares), 0.0))
    p_B = centre + np.concatenate([np.diag(apart), -np.diag(apart)])
    return MassPoints(np.full(6, segment), p_B, np.full(6, mass / 6.0))


def body_points(
    person: PersonHandles, intact_foot: IntactFootParameters, prosthesis_kg: float
) -> MassPoints:
    """Of all but the prosthesis, whose mass is part of the subject's; the frame of "hat" is at the
    lumbar joint."""
    subject, body = person.subject, person.body
    mass, residual = subject.mass_kg, body.residual_length / body.shank_length

    def limb(name: str, share: float, length: float, across: float, around: float) -> MassPoints:
        return _six(
            SEGMENTS.index(name),
            share * mass,
            np.array([0.0, 0.0, -CENTRE * length]),
            (across * length, across * length, around * length),
        )

    hips = np.array([body.hip_forward, 0.0, body.hip_up])
    ball = np.array(
        [(METATARSAL - intact_foot.ankle_x_ratio) * body.foot_length, 0.0, -body.ankle_height]
    )
    foot = FOOT_RADIUS * float(np.linalg.norm(ball))
    parts = [
        _six(
            PELVIS,
            PELVIS_MASS * mass,
            hips + np.array([0.0, 0.0, PELVIS_UP_M]),
            (PELVIS_RADIUS_M,) * 3,
        ),
        limb("thigh_right", THIGH_MASS, body.prosthetic_thigh_length, THIGH_RADIUS, THIGH_ROUND),
        limb("thigh_left", THIGH_MASS, body.thigh_length, THIGH_RADIUS, THIGH_ROUND),
        limb(
            "shank_right",
            SHANK_MASS * residual,
            body.residual_length,
            SHANK_RADIUS,
            SHANK_ROUND / residual,
        ),
        limb("shank_left", SHANK_MASS, body.shank_length, SHANK_RADIUS, SHANK_ROUND),
        _six(INTACT_FOOT, FOOT_MASS * mass, FOOT_CENTRE * ball, (0.4 * foot, foot, foot)),
    ]
    rest = mass - prosthesis_kg - sum(float(part.mass.sum()) for part in parts)
    height = subject.stature_m
    parts.append(
        _six(
            HAT,
            rest,
            np.array([0.0, 0.0, HAT_UP * height - LUMBAR_UP_M]),
            (HAT_RADIUS * height, HAT_RADIUS * height, HAT_ROUND * height),
        )
    )
    total = parts[0]
    for part in parts[1:]:
        total = total.together(part)
    return total
