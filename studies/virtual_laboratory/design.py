"""Numbers of the virtual prosthesis: what it is made of, and how a maker makes it longer.

Everything here is a choice, unless a source is named, and differs on purpose from the model under
test. The default is the reference subject's foot, whose compliances come from `bench.py --tune`;
`people.py` holds the others. Lengths along the foot count from A, the keel's posterior end.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

SHELL_KG = 0.25
"""Of the shell of the published 245 mm, with its foam."""


@dataclass(frozen=True)
class KeelDesign:
    """Leaf spring of `elements` rigid bars with sprung hinges at its nodes, thinner and narrower to
    the toe."""

    elements: int = 36
    length_m: float = 0.229
    """Public GaitModel_VSF scripts."""
    modulus_pa: float = 7.3405e9
    """Effective, with the two foams below tuned on the bench (`bench.py --tune`) to 10.000 N/mm at
    66 mm, 32.000 at 151 mm and a heel of 65.000; then 12.57, 16.38, 22.18 and 31.44 N/mm at 87,
    108, 129 and 150 mm. The joints that the authors of the model tuned position by position (public
    GaitModel_VSF scripts: 13.839 - 0.0677 N m/deg per mm of fulcrum, every 21 mm, a cantilever from
    the fulcrum on, one spring of 62.8 N/mm in series) give 12.6, 16.7, 22.9 and 32.0. McGeehan 2021
    (doi 10.1115/1.4050456) has 18.6 GPa for the material, G10/FR4; with it the keel alone is too
    stiff at 151 mm and only a support that sinks by 10 mm makes up for it."""
    density_kg_m3: float = 1850.0
    """G10/FR4 data sheets."""
    thickness_rear_m: float = 6.6e-3
    thickness_tip_m: float = 4.6e-3
    thickness_from_m: float = 0.110
    """Thickness falls linearly from here to the tip."""
    width_rear_m: float = 0.0684
    """Public GaitModel_VSF scripts."""
    width_tip_m: float = 0.058
    width_from_m: float = 0.150
    """Width falls linearly from here to the tip."""
    damping_time_s: float = 4e-3
    """Hinge damping / stiffness: loses 7 % of the energy of a load cycle of 0.6 s."""
    twists: int = 0
    """Torsional hinges, evenly along the keel; none: the keel does not twist."""
    shear_modulus_pa: float = 4.0e9
    """Of the torsional hinges."""
    clamp_nm_per_rad: float = 0.0
    """Rotational stiffness of the anchor at A against bending; 0 is a pin. Against twist the anchor
    is rigid."""


@dataclass(frozen=True)
class SupportDesign:
    """The fulcrum: a roller above the keel that holds it down where the toe is pushed up, at both
    ends of its width."""

    stiffness_n_per_m: float = 2.0e6
    """Sinks 0.9 mm under the 1.8 kN that it carries at 66 mm when 600 N press the toe."""
    damping_time_s: float = 1e-3
    half_width_m: float = 0.025
    one_sided: bool = False
    """Whether the keel can leave the roller."""
    play_m: float = 0.0
    """Gap to the roller of a one-sided support without load."""
    rearmost_m: float = 0.066
    foremost_m: float = 0.151
    """McGeehan 2021 (doi 10.1115/1.4050456)."""
    carriage_mass_kg: float = 0.1


@dataclass(frozen=True)
class FrameDesign:
    """The rigid frame between pylon and keel, with the heel block below it."""

    build_height_m: float = 0.087
    """Pylon's end to the unloaded sole; Glanzer & Adamczyk 2018 (PMC6289620)."""
    mass_kg: float = 0.649
    """Of the whole foot, keel and carriage included; the same source."""
    pylon_x_m: float = 0.055
    block_until_m: float = 0.066
    """Foam behind this sits on the rigid heel block."""
    foam_thickness_m: float = 0.030
    """Public GaitModel_VSF scripts."""
    load_point_m: float = 0.199
    """Where the testing machine presses; McGeehan 2021."""
    patch_m: float = 0.040
    """Length of its load shoe."""


@dataclass(frozen=True)
class SoleDesign:
    """Rounded sole on foam: a long rocker with a heel radius and a toe rise, round edges, `columns`
    x `rows` points."""

    columns: int = 38
    rows: int = 7
    rear_m: float = -0.012
    front_m: float = 0.233
    """Ends of the sole: the foam base of 245 mm of the public GaitModel_VSF scripts."""
    rocker_radius_m: float = 3.0
    rocker_centre_m: float = 0.090
    """Where the unloaded sole is lowest, at the nominal sole's height."""
    heel_radius_m: float = 0.035
    heel_from_m: float = 0.016
    toe_radius_m: float = 0.40
    toe_from_m: float = 0.175
    half_width_heel_m: float = 0.028
    half_width_fore_m: float = 0.034
    edge_radius_m: float = 0.010
    end_length_m: float = 0.020
    """Over this length the outline rounds off at heel and toe."""
    foam_modulus_pa: float = 0.39912e6
    """Under the keel; tuned on the bench."""
    heel_modulus_pa: float = 0.32094e6
    """Under the heel block; tuned on the bench."""
    densification: float = 0.8
    """Strain at which the foam would be solid."""
    hysteresis_s_per_m: float = 2.5
    """Hunt-Crossley damping: share of the elastic force per speed of compression."""
    shear_ratio: float = 0.6
    """Shear stiffness of a foam cell / its stiffness under small compression."""
    friction: float = 0.6
    """Coulomb's coefficient."""
    unsupported_from_m: float = math.inf
    """Ahead of this no keel bears the foam (`sole.UNSUPPORTED`)."""


@dataclass(frozen=True)
class SocketDesign:
    """Residual limb in the socket, hardening like soft tissue. Orders of magnitude from what limits
    the motion:

    30 and 18 mm, 15 degrees in gait (Childers & Siebert 2016, doi 10.1177/0309364615610660), 6 mm
    under a pull of 90 N (PMC4208197), 0.3 N m/kg about the long axis (Klute & Mulcahy 2024, doi
    10.3389/fresc.2024.1354144).
    """

    axial_force_n: float = 115.0
    axial_length_m: float = 4e-3
    axial_linear_n_per_m: float = 3e3
    """Along the shank force_n (exp(u / length) - 1) + linear u, u onto the limb: 800 N at 8 mm,
    -90 N at -5 mm."""
    shear_stiffness_n_per_m: float = 3e4
    shear_length_m: float = 6e-3
    bending_stiffness_nm_per_rad: float = 800.0
    bending_angle_rad: float = 0.09
    twist_stiffness_nm_per_rad: float = 250.0
    twist_angle_rad: float = 0.15
    """On the other axes k a sinh(u / a)."""
    axial_damping_n_s_per_m: float = 300.0
    shear_damping_n_s_per_m: float = 250.0
    bending_damping_nm_s: float = 5.0
    twist_damping_nm_s: float = 1.0
    socket_mass_kg: float = 0.8
    pylon_mass_kg: float = 0.4
    socket_radius_m: float = 0.048


@dataclass(frozen=True)
class Design:
    """The whole prosthesis; without a support its keel is a plain cantilever from A."""

    keel: KeelDesign = KeelDesign()
    support: SupportDesign | None = SupportDesign()
    frame: FrameDesign = FrameDesign()
    sole: SoleDesign = SoleDesign()
    socket: SocketDesign = SocketDesign()


ALONG_SOLE = (
    "rear_m",
    "front_m",
    "rocker_centre_m",
    "toe_from_m",
    "toe_radius_m",
    "half_width_heel_m",
    "half_width_fore_m",
)
"""Lengths of a sole that go with its size."""


def longer(design: Design, scale: float) -> Design:
    """The same foot in another size.

    Frame, carriage and its travel, heel block, build height, foam thickness and the keel's section
    serve all sizes; keel and sole are longer, the sole is wider, and the taper, the rocker, the toe
    and the point of load go along.
    """
    keel, frame, sole = design.keel, design.frame, design.sole
    return dataclasses.replace(
        design,
        keel=dataclasses.replace(
            keel,
            **{
                name: scale * getattr(keel, name)
                for name in ("length_m", "thickness_from_m", "width_from_m")
            },
        ),
        frame=dataclasses.replace(frame, load_point_m=scale * frame.load_point_m),
        sole=dataclasses.replace(
            sole, **{name: scale * getattr(sole, name) for name in ALONG_SOLE}
        ),
    )


def in_shell(design: Design, length_m: float) -> Design:
    """The same device in a shell of `length_m`: the sole is longer and wider about A and weighs as
    much more; keel, support, frame and the point of load are of one size."""
    sole = design.sole
    scale = length_m / (sole.front_m - sole.rear_m)
    return dataclasses.replace(
        design,
        frame=dataclasses.replace(
            design.frame, mass_kg=design.frame.mass_kg + (scale - 1.0) * SHELL_KG
        ),
        sole=dataclasses.replace(
            sole,
            unsupported_from_m=design.keel.length_m,
            **{name: scale * getattr(sole, name) for name in ALONG_SOLE},
        ),
    )
