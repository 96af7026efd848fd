"""Numbers of the virtual prosthesis: what it is made of. Tuned ones come from `bench.py --tune`.

Published geometry (keel length, load point, fulcrum range, build height, foam) comes from
`vsf_drake.parameters`; everything here is a choice, unless a source is named, and differs on purpose
from the model under test.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class KeelDesign:
    """Leaf spring of `elements` rigid bars with sprung hinges at its nodes, thinner and narrower to the toe."""

    elements: int = 36
    modulus_pa: float = 18.6e9
    """G10/FR4, McGeehan 2021 (doi 10.1115/1.4050456)."""
    density_kg_m3: float = 1850.0
    """G10/FR4 data sheets."""
    thickness_rear_m: float = 6.6e-3
    thickness_tip_m: float = 4.4e-3
    thickness_from_m: float = 0.110
    """Thickness falls linearly from here (m from A) to the tip."""
    width_rear_m: float = 0.0684
    width_tip_m: float = 0.058
    width_from_m: float = 0.150
    """Width falls linearly from here to the tip."""
    damping_time_s: float = 4e-3
    """Hinge damping / stiffness: loses 7 % of the energy of a load cycle of 0.6 s."""
    fulcrum_stiffness_n_per_m: float = 151.67e3
    """Tuned on the bench (`bench.py --tune`) with the two foams below: 10.000 N/mm at 66 mm, 32.000 at 151 mm, heel
    65.000; then 13.74, 18.44 and 24.32 N/mm at 87, 108 and 129 mm."""
    fulcrum_damping_time_s: float = 1e-3


@dataclass(frozen=True)
class SoleDesign:
    """Rounded sole on foam: a long rocker with a heel radius and a toe rise, round edges, `columns` x `rows` points."""

    columns: int = 38
    rows: int = 7
    rear_m: float = -0.012
    front_m: float = 0.233
    """Ends of the sole (m from A): the published foam base of 245 mm, keel 229 mm."""
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
    foam_modulus_pa: float = 0.5477e6
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


@dataclass(frozen=True)
class SocketDesign:
    """Residual limb in the socket, hardening like soft tissue. Orders of magnitude from what limits the motion:

    30 and 18 mm, 15 degrees in gait (Childers & Siebert 2016, doi 10.1177/0309364615610660), 6 mm under a pull of
    90 N (PMC4208197), 0.3 N m/kg about the long axis (Klute & Mulcahy 2024, doi 10.3389/fresc.2024.1354144).
    """

    axial_force_n: float = 115.0
    axial_length_m: float = 4e-3
    axial_linear_n_per_m: float = 3e3
    """Along the shank force_n (exp(u / length) - 1) + linear u, u onto the limb: 800 N at 8 mm, -90 N at -5 mm."""
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
    """The whole prosthesis."""

    keel: KeelDesign = KeelDesign()
    sole: SoleDesign = SoleDesign()
    socket: SocketDesign = SocketDesign()
