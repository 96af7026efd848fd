"""Every physical parameter of the model, and the person as measured: default, unit, source and
range. Schema only.

SI units inside; a field in another unit says so in its name. Whatever of a person has a direction
is signed by anatomy, not by the world, so that one set of numbers means the same on either side.
Sources are abbreviated here and spelled out in docs/sources.md:

    McGeehan 2021       doi 10.1115/1.4050456, the paper that describes the Simscape model
    GaitModel_VSF       m-mcgeehan/GaitModel_VSF_LumpedParameterBuild, its authors' public scripts
    Glanzer 2018        Glanzer & Adamczyk, the prototype of the foot, PMC6289620
    derived, choice     derived from the former, or an engineering choice nobody has measured
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from vsf_drake.base.schema import UNSAID, choice, quantity
from vsf_drake.laws.contact_laws import CONTACT_LAWS, FITTED_LAW

_PAPER = "McGeehan 2021"
_PUBLIC = "GaitModel_VSF scripts"
_CHOICE = "choice, not measured"
_SOCKET = (
    "derived from Childers 2016, PMC4208197 and Klute 2024, axis by axis as SocketParameters says"
)

GRAVITY = 9.81  # m/s^2, as in Drake; what body weight means everywhere here
FOAM_DAMPING_TIME_S = 0.1 * 2 * 0.6 / math.pi**2
"""Foam damping / stiffness (s) by default: loses 10 % of the energy of a 0.6 s half-sine load cycle
when it acts in loading only (loss / stored energy = time * pi^2 / (2 * 0.6 s)), as much as the
keel's. A choice; McGeehan 2021 starts its contact fit from 0.5 s, at which the foam can hardly be
compressed within a step. Chosen after both had been tried on a public recorded walk, with which
this one also agreed better: that walk is no independent test of it."""
MID_FULCRUM_MM = 108.0
"""Where the fulcrum stands if nobody says: the middle of McGeehan's five positions, 66 to 151 mm
from the keel's posterior end (a choice)."""
SHELLS_MM = (220.0, 300.0)
"""Lengths of the shells that are made from a model's: feet are sold from 22 to 30 cm (a choice)."""
SIDES = ("left", "right")
PELVIS_TRANSLATIONS = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
PELVIS_ROTATIONS = ("pelvis_tilt", "pelvis_list", "pelvis_rotation")
PELVIS_COORDINATES = PELVIS_TRANSLATIONS + PELVIS_ROTATIONS


def leg_coordinates(side: str, intact: bool) -> tuple[str, ...]:
    """Names of the joint coordinates of the leg on `side` ("right" or "left"), hip to ankle; as in
    OpenSim."""
    joints = (("hip", "flexion"), ("knee", "angle"), ("ankle", "angle"))[: 3 if intact else 2]
    return tuple(
        f"{joint}_{motion}_{side[0]}"
        for joint, bending in joints
        for motion in (bending, "adduction", "rotation")
    )


def person_coordinates(prosthetic_side: str) -> tuple[str, ...]:
    """The 21 recorded coordinates of a person who has no ankle on `prosthetic_side` ("left" or
    "right")."""
    return PELVIS_COORDINATES + tuple(
        name
        for side in ("right", "left")
        for name in leg_coordinates(side, side != prosthetic_side)
    )


@dataclass(frozen=True, kw_only=True)
class KeelParameters:
    """The leaf-spring keel as a chain of elements: rigid half, sprung revolute joint, rigid
    half."""

    element_lengths_m: tuple[float, ...] = quantity(  # of the keel's elements, from A to the toe
        (0.066,) + (0.163 / 7,) * 7,
        unit="m",
        low=1e-4,
        high=1.0,
        source=(
            f"derived from {_PAPER}: the only layout of rigid half, joint, rigid half with 16 "
            "pieces, 8 joints, pieces of 11.64 mm, a posterior element of 66 mm (with a joint in "
            "it) and a keel of 229 mm"
        ),
    )
    width_m: float = quantity(0.0684, unit="m", low=1e-3, high=0.5, source=_PUBLIC)
    """of the keel, medial to lateral"""
    thickness_m: float = quantity(0.00635, unit="m", low=1e-4, high=0.05, source=_PUBLIC)
    """of the keel"""
    flexural_modulus_pa: float = quantity(  # effective bending modulus of the keel
        7.8e9,
        unit="Pa",
        low=1e6,
        high=1e12,
        source=(
            f"effective, not the laminate's 18.6 GPa ({_PAPER}: G10/FR4): "
            "studies/calibrate_device.py, published 10 and 32 N/mm and, between them, the tuned "
            f"joints of the {_PUBLIC}"
        ),
    )
    density_kg_m3: float = quantity(  # of the keel's laminate
        1850.0,
        unit="kg/m^3",
        low=100.0,
        high=2e4,
        source="G10/FR4 data sheets: specific gravity 1.80-1.85",
    )
    damping_time_s: float = quantity(  # damping / stiffness of the keel's joints
        6.1e-3,
        unit="s",
        low=0.0,
        high=1.0,
        source=(
            "choice: joint damping / joint stiffness that loses 10 % of the energy of a 0.6 s load "
            "cycle"
        ),
    )
    taper_from_m: float = quantity(  # distance from A at which the keel begins to thin
        0.0,
        unit="m",
        low=0.0,
        high=1.0,
        source=f"{_CHOICE}: of no account where `tip_stiffness` is 1",
        unsaid="yes",
    )
    tip_stiffness: float = quantity(  # bending stiffness at the keel's tip / at A
        1.0,
        unit="1",
        low=1e-3,
        high=10.0,
        source=f"derived from {_PAPER}: one thickness; see `laws.beam.taper`",
        unsaid="yes",
    )
    """Drawn and weighed is a keel of one thickness."""


@dataclass(frozen=True, kw_only=True)
class FulcrumParameters:
    """The fulcrum, which bears on the keel from above, and the carriage that moves it."""

    stiffness_n_per_m: float = quantity(  # of the fulcrum's support on the keel
        2e6,
        unit="N/m",
        low=1e3,
        high=1e9,
        source=(
            f"{_CHOICE}: sinks 0.9 mm under the 1.81 kN that the bench's 600 N put on it at 66 mm"
        ),
    )
    damping_time_s: float = quantity(  # damping / stiffness of the fulcrum's support
        1e-4,
        unit="s",
        low=0.0,
        high=1.0,
        source=f"{_CHOICE}: half of critical for a keel piece of 20 g",
    )
    carriage_mass_kg: float = quantity(  # of the carriage that holds the fulcrum
        0.1, unit="kg", low=1e-3, high=2.0, source=_CHOICE
    )
    rearmost_m: float = quantity(  # smallest distance of the fulcrum from A
        0.066, unit="m", low=0.0, high=1.0, source=f"{_PAPER}: 66 mm"
    )
    foremost_m: float = quantity(  # largest distance of the fulcrum from A
        0.151, unit="m", low=0.0, high=1.0, source=f"{_PAPER}: 151 mm"
    )


@dataclass(frozen=True, kw_only=True)
class ActuatorParameters:
    """Motor, gear, lead screw and rail that move the fulcrum's carriage; its mass and travel are
    the fulcrum's.

    Glanzer 2018 moves the fulcrum in swing, through its whole range within three strides; its motor
    and screw were not available to us. All else is a choice, sized so that three times 0.3 s
    suffice, of swings of 0.4 s.
    """

    screw_lead_m: float = quantity(
        2e-3, unit="m", low=1e-5, high=0.1, source=f"{_CHOICE}: travel a turn"
    )
    screw_mean_diameter_m: float = quantity(
        7e-3, unit="m", low=1e-4, high=0.1, source=f"{_CHOICE}: as of a Tr 8 x 2"
    )
    thread_flank_angle_rad: float = quantity(
        math.radians(15.0),
        unit="rad",
        low=0.0,
        high=1.0,
        source=f"{_CHOICE}: half the angle of a trapezoidal thread",
    )
    thread_friction: float = quantity(
        0.15, unit="1", low=0.0, high=1.0, source=f"{_CHOICE}: keeps the screw locked"
    )
    screw_inertia_kg_m2: float = quantity(
        3e-7, unit="kg m^2", low=0.0, high=1e-2, source=f"{_CHOICE}: steel, 0.1 m"
    )
    rail_friction: float = quantity(
        0.1, unit="1", low=0.0, high=2.0, source=f"{_CHOICE}: drag / support force"
    )
    rail_drag_n: float = quantity(
        5.0, unit="N", low=0.0, high=1e3, source=f"{_CHOICE}: drag without load"
    )
    gear_ratio: float = quantity(
        3.0, unit="1", low=0.01, high=1e4, source=f"{_CHOICE}: motor turns a screw turn"
    )
    torque_constant_n_m_per_a: float = quantity(
        6e-3, unit="N m/A", low=1e-5, high=10.0, source=_CHOICE
    )
    winding_resistance_ohm: float = quantity(3.0, unit="ohm", low=1e-3, high=1e4, source=_CHOICE)
    rotor_inertia_kg_m2: float = quantity(1e-7, unit="kg m^2", low=0.0, high=1e-2, source=_CHOICE)
    motor_friction_n_m: float = quantity(
        4e-4, unit="N m", low=0.0, high=1.0, source=f"{_CHOICE}: brushes and gear"
    )
    supply_voltage_v: float = quantity(
        7.4, unit="V", low=0.1, high=100.0, source=f"{_CHOICE}: two lithium cells"
    )
    speed_limit_m_per_s: float = quantity(
        0.13, unit="m/s", low=1e-4, high=10.0, source=f"{_CHOICE}: driver's limit"
    )
    servo_band_m: float = quantity(
        2e-3,
        unit="m",
        low=1e-6,
        high=0.1,
        source=f"{_CHOICE}: error from which on the voltage is close to full",
    )
    tolerance_m: float = quantity(
        1e-4, unit="m", low=0.0, high=0.01, source=f"{_CHOICE}: error without voltage"
    )
    creep_speed_m_per_s: float = quantity(
        2e-4,
        unit="m/s",
        low=1e-6,
        high=0.1,
        source=f"{_CHOICE}: regularises friction, 76 % of which acts there",
    )
    stop_stiffness_n_per_m: float = quantity(
        1e5, unit="N/m", low=1e2, high=1e9, source=f"{_CHOICE}: ends of travel"
    )
    stop_dissipation_s_per_m: float = quantity(
        10.0, unit="s/m", low=0.0, high=1e3, source=f"{_CHOICE}: of the stops"
    )


@dataclass(frozen=True, kw_only=True)
class ContactZone:
    """Contact spheres that share one foam: where they sit in the keel frame K and their law.

    Normal force stiffness * depth**exponent + damping that is full from `full_damping_depth_m` on.
    """

    name: str  # of the zone, by which a fit knows it
    x_mm: tuple[float, ...] = quantity(unit="mm", low=-200.0, high=500.0, source=_PUBLIC)
    """of each sphere, forward"""
    y_mm: tuple[float, ...] = quantity(  # of each sphere, to the left
        unit="mm", low=-200.0, high=200.0, source="derived from the published count of 24"
    )
    rise_mm: tuple[float, ...] = quantity(  # of each sphere's bottom over the flat sole
        unit="mm", low=-100.0, high=100.0, source=_CHOICE
    )
    radius_m: float = quantity(unit="m", low=1e-4, high=0.2, source=_PUBLIC)  # of each sphere
    stiffness: float = quantity(  # of each sphere
        unit="N/m^exponent",
        low=0.0,
        high=1e30,
        source=(
            f"derived from {_PAPER}'s 65 N/mm (heel) and studies/calibrate_device.py (midfoot, "
            "forefoot)"
        ),
    )
    exponent: float = quantity(  # of the depth in the normal force
        1.0, unit="1", low=1.0, high=20.0, source=f"{_PAPER}: first guess 1"
    )
    damping_n_s_per_m: float = quantity(  # of each sphere
        unit="N s/m", low=0.0, high=1e7, source="choice: see FOAM_DAMPING_TIME_S"
    )
    full_damping_depth_m: float = quantity(  # depth from which on the damping is full
        1e-3, unit="m", low=1e-6, high=0.1, source=f"{_PAPER}: first guess 1 mm"
    )


@dataclass(frozen=True, kw_only=True)
class FrictionParameters:
    """Stick-slip friction between the spheres of a foot and the ground."""

    mu_static: float = quantity(0.5, unit="1", low=0.0, high=5.0, source=_PAPER)
    """coefficient of static friction"""
    mu_kinetic: float = quantity(0.3, unit="1", low=0.0, high=5.0, source=_PAPER)
    """coefficient of kinetic friction"""
    threshold_velocity_m_per_s: float = quantity(  # sliding speed at which friction is mu_static
        0.1, unit="m/s", low=1e-6, high=10.0, source=_PAPER
    )


def _zone(
    name: str, x: tuple[float, ...], y: tuple[float, ...], radius: float, stiffness: float
) -> ContactZone:
    return ContactZone(
        name=name,
        x_mm=x,
        y_mm=y,
        rise_mm=(0.0,) * len(x),
        radius_m=radius,
        stiffness=stiffness,
        damping_n_s_per_m=stiffness * FOAM_DAMPING_TIME_S,
    )


def _pairs(*x: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return tuple(v for v in x for _ in "lr"), (25.0, -25.0) * len(x)


def _foot_zones() -> tuple[ContactZone, ...]:
    # Three spheres of the rigid heel block share the heel's 65 N/mm (McGeehan 2021), eight the
    # bench's foam patch.
    heel = 65e3 / 3
    foam = 58.8e3 / 8
    anterior = _pairs(71.2)
    midfoot = _pairs(144.7, 155.7)
    forefoot = _pairs(166.2, 176.7, 187.2, 197.7, 208.2, 218.7)
    return (
        _zone("heel_posterior", *_pairs(3.0), 0.0424, heel),
        _zone("heel", (21.0,), (0.0,), 0.0424, heel),
        _zone("heel_anterior", anterior[0] + (82.2,), anterior[1] + (0.0,), 0.0424, heel),
        _zone("midfoot", (130.0,) + midfoot[0], (0.0,) + midfoot[1], 0.0011, foam),
        _zone("forefoot", forefoot[0] + (229.0,), forefoot[1] + (0.0,), 0.0011, foam),
    )


@dataclass(frozen=True, kw_only=True)
class FootParameters:
    """The variable-stiffness foot. Keel frame K: origin at the keel's posterior end A, x to the
    toe, z up.

    The foam that the bench finds between platen and keel bears series_stiffness_n_per_m *
    depth**series_exponent, in N/m where the exponent is 1.
    """

    name: str = field(  # tells a passive foot from others; where none is given, its file's
        default="", metadata={"source": "choice", UNSAID: "yes"}
    )
    keel: KeelParameters = field(default_factory=KeelParameters)
    fulcrum: FulcrumParameters = field(default_factory=FulcrumParameters)
    friction: FrictionParameters = field(default_factory=FrictionParameters)
    zones: tuple[ContactZone, ...] = field(default_factory=_foot_zones)
    series_stiffness_n_per_m: float = quantity(  # of the foam between platen and keel
        58.8e3,
        unit="N/m^series_exponent",
        low=1e3,
        high=1e30,
        source="foam under the load; studies/calibrate_device.py, as the keel's modulus",
    )
    series_exponent: float = quantity(  # of the depth in that foam's force
        1.0, unit="1", low=1.0, high=20.0, source="choice: as the contact zones'"
    )
    series_patch_m: float = quantity(  # length of the loaded foam, centred at C
        0.040,
        unit="m",
        low=1e-3,
        high=0.2,
        source="choice: length of the foam patch that the bench loads",
    )
    load_point_m: float = quantity(  # distance of the load point C from A
        0.199, unit="m", low=0.0, high=1.0, source=f"{_PAPER}: 30 mm behind the keel tip"
    )
    mass_kg: float = quantity(  # of the whole prosthetic foot
        0.649, unit="kg", low=0.05, high=5.0, source="Glanzer 2018, with battery"
    )
    build_height_m: float = quantity(  # height of the mount M above the sole
        0.087, unit="m", low=0.01, high=0.5, source="Glanzer 2018"
    )
    foam_thickness_m: float = quantity(0.030, unit="m", low=0.0, high=0.2, source=_PUBLIC)
    """of the foam below the keel"""
    length_m: float = quantity(  # of the foam base, taken as foot length
        0.245, unit="m", low=0.05, high=0.5, source=f"{_PUBLIC}: foam base"
    )
    shell_ratio: float = quantity(  # length of the shell / length that patch and heel block are of
        1.0,
        unit="1",
        low=0.1,
        high=10.0,
        source="derived: 1 in the shell that the foot was made with; see `model_file.in_shell`",
        unsaid="yes",
    )
    heel_x_m: float = quantity(  # x of the foam base's rear end in K
        -0.012,
        unit="m",
        low=-0.1,
        high=0.1,
        source=(
            f"{_CHOICE}: rear end of the foam base, which then ends 4 mm ahead of the keel; "
            "lengths count from it"
        ),
    )
    pylon_x_m: float = quantity(  # pylon axis ahead of A
        0.055, unit="m", low=-0.1, high=0.3, source=f"{_CHOICE}: pylon axis ahead of A"
    )
    side: str = choice(  # body side that the foot is made for
        "either", options=("either", *SIDES), source="choice: the nominal foot is symmetric"
    )


@dataclass(frozen=True, kw_only=True)
class BushingAxis:
    """One direction of the socket bushing; force (N or N m) opposes displacement (m or rad)."""

    stiffness: float = quantity(  # where the displacement is positive
        unit="N/m or N m/rad", low=0.0, high=1e9, source=_SOCKET
    )
    stiffness_negative: float = quantity(  # where it is negative
        unit="N/m or N m/rad", low=0.0, high=1e9, source=_SOCKET
    )
    damping: float = quantity(  # of the bushing along or about this axis
        unit="N s/m or N m s/rad", low=0.0, high=1e9, source=f"{_CHOICE}: stiffness times 10 ms"
    )
    limit: float = quantity(  # displacement at which the stop begins
        unit="m or rad", low=1e-6, high=1.0, source=_SOCKET
    )
    rate_limit: float = quantity(  # rate at which the stop begins
        unit="m/s or rad/s", low=1e-6, high=100.0, source=_CHOICE
    )


def _axis(
    source: str, stiffness: float, limit: float, rate_limit: float, negative: float | None = None
) -> Any:
    axis = BushingAxis(
        stiffness=stiffness,
        stiffness_negative=stiffness if negative is None else negative,
        damping=0.01 * stiffness,
        limit=limit,
        rate_limit=rate_limit,
    )
    return field(default=axis, metadata={"source": source})


@dataclass(frozen=True, kw_only=True)
class SocketParameters:
    """Socket, pylon and the six-axis bushing between residual shank and socket.

    Displacements are of the socket in the frame of the residual shank (x forward, y left, z up):
    positive tz is the socket pressed onto the limb, negative tz the socket pulled off. All are
    orders of magnitude: McGeehan 2021 only says that the bushing is stiff and has limits, and what
    others measured of sockets fixes a stiffness within a factor of two or so.
    """

    tx: BushingAxis = _axis(
        "shear of 200-300 N over the 18 mm range of Childers 2016, halved", 4e4, 0.009, 0.5
    )
    ty: BushingAxis = _axis("as tx", 4e4, 0.009, 0.5)
    tz: BushingAxis = _axis(
        "pressing: 800 N over 8 mm, the stiff end of what the 30 mm range of Childers 2016 "
        "allows; pulling: 90 N over 6 mm, PMC4208197; limit: half that range",
        1e5,
        0.015,
        0.5,
        negative=1.5e4,
    )
    flexion: BushingAxis = _axis(
        "stiff end of 40-60 N m over the 15 degrees of Childers 2016",
        1000.0,
        math.radians(7.5),
        5.0,
    )
    adduction: BushingAxis = _axis(
        f"stiffness as flexion; limit: {_CHOICE}", 1000.0, math.radians(5.0), 5.0
    )
    rotation: BushingAxis = _axis(
        f"0.32 N m/kg (Klute 2024) over 5 degrees; limit: {_CHOICE}", 300.0, math.radians(10.0), 5.0
    )
    stop_ratio: float = quantity(  # added beyond a limit / stiffness or damping of the axis
        10.0,
        unit="1",
        low=0.0,
        high=1e4,
        source=(
            f"{_CHOICE}: stiffness and damping added beyond a limit, as multiples of the axis's own"
        ),
    )
    socket_mass_kg: float = quantity(  # of the socket
        0.8, unit="kg", low=0.05, high=10.0, source=f"{_CHOICE}: typical, unverified"
    )
    pylon_mass_kg: float = quantity(  # of the pylon
        0.4, unit="kg", low=0.05, high=10.0, source=f"{_CHOICE}: typical, unverified"
    )
    pylon_radius_m: float = quantity(0.015, unit="m", low=1e-3, high=0.1, source=_PUBLIC)
    """of the pylon"""
    residual_length_ratio: float = quantity(  # length of residual shank / intact shank
        0.66, unit="1", low=0.1, high=0.95, source=f"{_PUBLIC}: residual shank / intact shank"
    )


def _intact_zones() -> tuple[ContactZone, ...]:
    """A choice, not measured: body weight (765 N) sinks ten spheres of equal stiffness by 3 mm."""
    k = 765.0 / (10 * 3e-3)
    return (
        _zone("heel", (25.0, 45.0, 45.0), (0.0, 20.0, -20.0), 0.03, k),
        _zone("lateral", (110.0,), (-35.0,), 0.02, k),
        _zone("metatarsal", (180.0, 185.0, 165.0), (30.0, 0.0, -35.0), 0.015, k),
        _zone("forefoot", (223.0, 213.0, 193.0), (30.0, 0.0, -30.0), 0.01, k),
    )


@dataclass(frozen=True, kw_only=True)
class IntactFootParameters:
    """Contact of the intact (right-foot layout) foot, in a foot of 268.3 mm; scales with foot
    length.

    Sphere x from the heel, y to the left, rise of the sphere's bottom above the flat sole. The foot
    has no toe joint, so its contact ends where a foot bends, at 0.83 of its length (a choice; the
    effective foot length usually quoted for able-bodied walking, unverified). Chosen after spheres
    at the very tip had made the synthetic walk push off from there, whose force then agreed better.
    """

    zones: tuple[ContactZone, ...] = field(default_factory=_intact_zones)
    friction: FrictionParameters = field(default_factory=FrictionParameters)
    reference_length_m: float = quantity(  # length of the foot that the zones describe
        0.2683, unit="m", low=0.1, high=0.5, source="de Leva 1996, male foot scaled to 1.81 m"
    )
    ankle_x_ratio: float = quantity(  # ankle centre ahead of the heel / foot length
        0.25,
        unit="1",
        low=0.0,
        high=1.0,
        source=f"{_CHOICE}: ankle ahead of the heel / foot length",
    )


@dataclass(frozen=True, kw_only=True)
class ModelParameters:
    """Everything about the devices and the contact; the person is a `Subject`."""

    foot: FootParameters = field(default_factory=FootParameters)
    socket: SocketParameters = field(default_factory=SocketParameters)
    intact_foot: IntactFootParameters = field(default_factory=IntactFootParameters)
    contact_law: str = choice(
        FITTED_LAW, options=tuple(CONTACT_LAWS), source="McGeehan 2021", **{UNSAID: "yes"}
    )
    """of both feet, in walks"""


def _measured(low: float, high: float, what: str, *, unit: str = "m") -> Any:
    return quantity(None, unit=unit, low=low, high=high, source=f"measured: {what}")


@dataclass(frozen=True, kw_only=True)
class Subject:
    """The person: measured where known, scaled from the stature (de Leva 1996) where None.

    Thigh, shank, ankle height and foot length are the intact leg's; the prosthetic thigh is as long
    unless measured. Below the knee the prosthesis is as long as shank and ankle height unless
    measured, and the foot sits under the pylon in its standard place: pylon axis `foot.pylon_x_m`
    ahead of the keel's posterior end, in the middle of its width, foot and shank at right angles,
    toes forward; signs are those of the ankle's coordinates (inversion: medial edge up) but for
    toe_out.
    """

    mass_kg: float = quantity(  # of the body with the prosthesis
        unit="kg", low=20.0, high=250.0, source="measured, prosthesis included"
    )
    stature_m: float = quantity(unit="m", low=0.8, high=2.5, source="measured")  # standing height
    sex: str = choice(options=("male", "female"), source="stated")
    """selects the table of segment masses and lengths"""
    prosthetic_side: str = choice(options=SIDES, source="stated")  # side of the prosthesis
    name: str = "subject"  # of the person, for results
    thigh_length_m: float | None = _measured(0.1, 0.8, "hip to knee centre")
    shank_length_m: float | None = _measured(0.1, 0.8, "knee to ankle centre")
    ankle_height_m: float | None = _measured(0.02, 0.2, "ankle centre to sole")
    foot_length_m: float | None = _measured(0.1, 0.4, "heel to toe tip")
    hip_forward_m: float | None = _measured(-0.2, 0.2, "hip centre ahead of the pelvis origin")
    hip_up_m: float | None = _measured(-0.3, 0.2, "hip centre above the pelvis origin")
    hip_lateral_m: float | None = _measured(0.03, 0.2, "hip centre beside the pelvis origin")
    prosthetic_thigh_length_m: float | None = _measured(
        0.1, 0.8, "hip to knee centre on the prosthetic side"
    )
    prosthesis_length_m: float | None = _measured(
        0.15, 0.9, "prosthetic knee centre to sole along the shank"
    )
    prosthesis_fore_aft_m: float | None = _measured(
        -0.1, 0.1, "foot forward of its standard place under the pylon"
    )
    prosthesis_lateral_m: float | None = _measured(
        -0.1, 0.1, "foot away from the midline, from under the pylon"
    )
    prosthesis_alignment_rad: float | None = _measured(
        -0.5, 0.5, "foot turned toe up against the pylon", unit="rad"
    )
    prosthesis_inversion_rad: float | None = _measured(
        -0.5, 0.5, "foot inverted against the pylon", unit="rad"
    )
    prosthesis_toe_out_rad: float | None = _measured(
        -0.7, 0.7, "foot turned outward about the pylon", unit="rad"
    )
