"""The person's segments: masses, lengths and radii of gyration after de Leva (1996), scaled to the
subject.

P. de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters", J Biomech
29:1223-1230; "transverse" is read as the medio-lateral axis and "sagittal" as the antero-posterior
one. The pelvis carries head, arms and trunk.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from vsf_drake.base.errors import require
from vsf_drake.model.parameters import FootParameters, SocketParameters, Subject
from vsf_drake.plants.solids import frustum_taper, frustum_volume


@dataclass(frozen=True)
class SegmentTable:
    """Means of one sex: masses as fraction of body mass, lengths of the sample (m), centres of
    mass and radii of gyration (about AP, ML and long axis) as fractions of segment length."""

    stature_m: float
    thigh_mass: float
    shank_mass: float
    foot_mass: float
    thigh_length: float
    shank_length: float
    foot_length: float
    trunk_length: float
    thigh_center: float
    shank_center: float
    foot_center: float
    trunk_center: float
    trunk_gyration: tuple[float, float, float]
    foot_gyration: tuple[float, float, float]


# Shank: knee to ankle joint centre, whose mean length follows from the two centre-of-mass
# percentages that the table gives for the same segment (to the lateral malleolus and to the joint).
DE_LEVA = {
    "male": SegmentTable(
        stature_m=1.741,
        thigh_mass=0.1416,
        shank_mass=0.0433,
        foot_mass=0.0137,
        thigh_length=0.4222,
        shank_length=0.4340 * 44.59 / 43.95,
        foot_length=0.2581,
        trunk_length=0.5319,
        thigh_center=0.4095,
        shank_center=0.4395,
        foot_center=0.4415,
        trunk_center=0.4486,
        trunk_gyration=(0.372, 0.347, 0.191),
        foot_gyration=(0.257, 0.245, 0.124),
    ),
    "female": SegmentTable(
        stature_m=1.735,
        thigh_mass=0.1478,
        shank_mass=0.0481,
        foot_mass=0.0129,
        thigh_length=0.3685,
        shank_length=0.4323 * 44.16 / 43.52,
        foot_length=0.2283,
        trunk_length=0.5293,
        thigh_center=0.3612,
        shank_center=0.4352,
        foot_center=0.4014,
        trunk_center=0.4151,
        trunk_gyration=(0.357, 0.339, 0.171),
        foot_gyration=(0.299, 0.279, 0.139),
    ),
}

THIGH_RADIUS_M = 0.095
"""Proximal radius of the thigh frustum (m), from the public GaitModel_VSF scripts."""
SHANK_RADIUS_M = 0.055
"""Proximal radius of the shank frustum (m), from the same scripts."""
ANKLE_HEIGHT_RATIO = 0.039
"""Ankle height / stature: Drillis & Contini (1966) as commonly quoted; not checked against the
original."""
LEAST_PYLON_M = 0.01
"""Shortest pylon (m) that is still one: room for its adapters (a choice)."""


@dataclass(frozen=True)
class Body:
    """The subject's segments in SI units, lengths the intact leg's unless they say otherwise. Below
    the prosthetic knee: residual shank, pylon, and the foot at `placement`: `prosthesis_length` in
    all, to the sole."""

    table: SegmentTable
    pelvis_mass: float
    thigh_mass: float
    shank_mass: float
    residual_shank_mass: float
    foot_mass: float
    prosthesis_mass: float
    thigh_length: float
    prosthetic_thigh_length: float
    shank_length: float
    residual_length: float
    pylon_length: float
    prosthesis_length: float
    placement: FootPlacement
    ankle_height: float
    foot_length: float
    trunk_length: float
    hip_forward: float
    hip_up: float
    hip_lateral: float

    @property
    def leg_length(self) -> float:
        """Hip centre to sole with the intact leg straight (m)."""
        return self.thigh_length + self.shank_length + self.ankle_height

    @property
    def prosthetic_leg_length(self) -> float:
        """Hip centre to sole down the prosthetic leg's long axis, straight and unloaded (m)."""
        return self.prosthetic_thigh_length + self.prosthesis_length

    @property
    def trunk_place(self) -> np.ndarray:
        """Centre of mass of head, arms and trunk in the pelvis's frame (m): above the hips as the
        trunk's."""
        return np.array(
            [self.hip_forward, 0.0, self.hip_up + (1 - self.table.trunk_center) * self.trunk_length]
        )

    def thigh(self, *, intact: bool) -> tuple[float, float, float]:
        """Proximal radius, distal radius and length (m) of the frustum from hip to knee centre."""
        length = self.thigh_length if intact else self.prosthetic_thigh_length
        return THIGH_RADIUS_M, THIGH_RADIUS_M * frustum_taper(self.table.thigh_center), length

    def shank(self, *, intact: bool) -> tuple[float, float, float]:
        """The same of the frustum from the knee centre to the ankle, or to the end of the residual
        limb."""
        length = self.shank_length if intact else self.residual_length
        taper = 1 + (frustum_taper(self.table.shank_center) - 1) * length / self.shank_length
        return SHANK_RADIUS_M, SHANK_RADIUS_M * taper, length


def scale_body(subject: Subject, foot: FootParameters, socket: SocketParameters) -> Body:
    """Segments of `subject`: measured lengths where given, else stature times the table's ratio.

    The pylon is what residual shank and placed foot leave of the prosthesis, knee to sole. Masses
    go by body mass, not by length; whatever limbs and prosthesis leave is head, arms and trunk. The
    residual shank is the proximal part of the intact one, cut at `residual_length_ratio`. The hip
    centre, relative to the midpoint of the anterior superior iliac spines, follows Hara et al.
    (2016, doi 10.1038/srep37707) from the intact leg's length unless measured.
    """
    table = DE_LEVA[subject.sex]
    scale = subject.stature_m / table.stature_m
    thigh = subject.thigh_length_m or scale * table.thigh_length
    shank = subject.shank_length_m or scale * table.shank_length
    ankle = subject.ankle_height_m or ANKLE_HEIGHT_RATIO * subject.stature_m
    residual = socket.residual_length_ratio * shank
    prosthesis_length = subject.prosthesis_length_m or shank + ankle
    placement = foot_placement(subject)
    foot_height = placement.sole_below(foot.build_height_m)
    pylon = prosthesis_length - residual - foot_height
    require(
        pylon >= LEAST_PYLON_M,
        f"no room for the pylon: knee to sole {prosthesis_length:.3f} m less residual "
        f"shank {residual:.3f} m and foot {foot_height:.3f} m leaves {pylon:.3f} m",
        "subject",
        f"It takes {LEAST_PYLON_M:g} m. Lower socket.residual_length_ratio of the model, or "
        "correct "
        f"{'shank_length_m' if subject.prosthesis_length_m is None else 'prosthesis_length_m'}",
    )

    mass = subject.mass_kg
    shank_mass = mass * table.shank_mass
    prosthesis = foot.mass_kg + socket.socket_mass_kg + socket.pylon_mass_kg
    residual_mass = shank_mass * residual_volume_ratio(table, socket.residual_length_ratio)
    limbs = (
        mass * (2 * table.thigh_mass + table.foot_mass) + shank_mass + residual_mass + prosthesis
    )
    require(
        limbs <= 0.75 * mass,
        f"legs and prosthesis weigh {limbs:.1f} kg of {mass:.1f} kg",
        "subject.mass_kg",
        "Check the masses of foot, socket and pylon",
    )

    # Hara's leg length goes from the spine to the malleolus: LL = 9 mm + 0.078 LL above the hip,
    # thigh and shank below
    leg = (0.009 + thigh + shank) / (1 - 0.078)
    hara = {
        "hip_forward": 0.011 - 0.063 * leg,
        "hip_up": -0.009 - 0.078 * leg,
        "hip_lateral": 0.008 + 0.086 * leg,
    }
    measured = {name: getattr(subject, f"{name}_m") for name in hara}
    hip = {
        name: value if measured[name] is None else measured[name] for name, value in hara.items()
    }
    return Body(
        table=table,
        pelvis_mass=mass - limbs,
        thigh_mass=mass * table.thigh_mass,
        shank_mass=shank_mass,
        residual_shank_mass=residual_mass,
        foot_mass=mass * table.foot_mass,
        prosthesis_mass=prosthesis,
        thigh_length=thigh,
        prosthetic_thigh_length=subject.prosthetic_thigh_length_m or thigh,
        shank_length=shank,
        residual_length=residual,
        pylon_length=pylon,
        prosthesis_length=prosthesis_length,
        placement=placement,
        ankle_height=ankle,
        foot_length=subject.foot_length_m or scale * table.foot_length,
        trunk_length=scale * table.trunk_length,
        **hip,
    )


def residual_volume_ratio(table: SegmentTable, length_ratio: float) -> float:
    """Volume of the proximal part of the shank frustum, as a fraction of the whole."""
    taper = frustum_taper(table.shank_center)
    cut = 1.0 + (taper - 1.0) * length_ratio
    return frustum_volume(1.0, cut, length_ratio) / frustum_volume(1.0, taper, 1.0)


# How the prosthetic foot sits under the pylon, as measured on the person.
#
#     D    the pylon's lower end: origin on the pylon's axis, x forward, y left, z up along the
#          pylon
#     P    the foot's place: where the foot's mount M goes (`foot.add_foot`)
#
# P is D moved forward and away from the midline (in D's axes), then turned about its own origin,
# the pylon's end, `build_height_m` above the sole: first toe up about the axis to the right, then
# into inversion about the forward axis that this has turned, then outward about the upright axis
# that both have turned: the order of the ankle's coordinates (flexion, adduction, rotation; Wu et
# al. 2002, doi 10.1016/S0021-9290(01)00222-6), so that alignment, inversion and minus toe-out are
# the ankle angles of the prosthesis. What a trial's manifest adds (`foot.set_mount`) acts after P.


@dataclass(frozen=True, kw_only=True)
class FootPlacement:
    """Metres and radians, signed by anatomy: forward, away from the midline, toe up, inverted, toe
    out."""

    fore_aft: float = 0.0
    lateral: float = 0.0
    alignment: float = 0.0
    inversion: float = 0.0
    toe_out: float = 0.0

    def pose(self, *, mirrored: bool) -> RigidTransform:
        """X_DP; `mirrored` on the left side."""
        right = -1.0 if mirrored else 1.0
        # Toe up is a turn about -y; inversion about +x and toe-out about -z on the right, opposite
        # on the left.
        R_DP = (
            RotationMatrix.MakeYRotation(-self.alignment)
            @ RotationMatrix.MakeXRotation(right * self.inversion)
            @ RotationMatrix.MakeZRotation(-right * self.toe_out)
        )
        return RigidTransform(R_DP, np.array([self.fore_aft, -right * self.lateral, 0.0]))

    def sole_below(self, build_height: float) -> float:
        """Distance (m) from the pylon's end down its axis to the plane of the unloaded sole,
        `build_height` under P's origin, normal to P's z."""
        X_DP = self.pose(mirrored=False)
        normal = X_DP.rotation().matrix()[:, 2]
        return float((build_height - normal @ X_DP.translation()) / normal[2])


def foot_placement(subject: Subject) -> FootPlacement:
    """What is known of it; standard where nothing is."""
    return FootPlacement(
        fore_aft=subject.prosthesis_fore_aft_m or 0.0,
        lateral=subject.prosthesis_lateral_m or 0.0,
        alignment=subject.prosthesis_alignment_rad or 0.0,
        inversion=subject.prosthesis_inversion_rad or 0.0,
        toe_out=subject.prosthesis_toe_out_rad or 0.0,
    )
