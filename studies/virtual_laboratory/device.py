"""The prosthesis as arrays for the compiled step, and its state.

Frame P: the rigid part (socket, pylon, foot frame, heel block), origin at the end of the residual
limb, parallel to the keel frame K of the undeformed foot. Body 0 is P; body i = 1..N is bar i of
the keel. Frame E: origin there too, parallel to the shank's S where nothing is loaded; the foot's
placement turns P against it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from virtual_laboratory.design import Design
from virtual_laboratory.keel import make_keel
from virtual_laboratory.sole import make_sole
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.plants.anthropometry import FootPlacement


class Device(NamedTuple):
    """Constants, SI. M mass points of the rigid part, N bars, T torsional hinges, n foam cells
    (sorted by body).

    points: (n, 3) in P for cells on the rigid part; else in their bar, from its rear hinge along,
    left, up. fulcrum: x from the anchor in P. fulcrum_stiffness: 0 where there is none. socket:
    (9,) axial force, length, linear; shear stiffness, length; bending stiffness, angle; twist
    stiffness, angle. socket_damping: (6,) along and about x, y, z. R_EP: (3, 3).
    """

    mass_points: np.ndarray
    masses: np.ndarray
    anchor: np.ndarray
    lengths: np.ndarray
    hinge_stiffness: np.ndarray
    twist_bars: np.ndarray
    twist_stiffness: np.ndarray
    hinge_damping_time: float
    node_masses: np.ndarray
    fulcrum: float
    fulcrum_stiffness: float
    fulcrum_damping_time: float
    fulcrum_half_width: float
    fulcrum_one_sided: bool
    fulcrum_play: float
    bodies: np.ndarray
    points: np.ndarray
    foam_stiffness: np.ndarray
    dense_depth: np.ndarray
    hysteresis: float
    shear_stiffness: np.ndarray
    friction: float
    socket: np.ndarray
    socket_damping: np.ndarray
    R_EP: np.ndarray
    residual_length: float
    gravity: float


class State(NamedTuple):
    """What the step carries on; arrays changed in place.

    R, p: pose of P in W. q: (N + T,) hinge angles, bending (positive lifts the toe), then twist
    (about x to the toe). increment: (6 + N + T,) last step's motion (rotation and translation of P
    in P, hinge angles); before: the same of the step before. mass_x, mass_v: (M + N, 3) positions
    and velocities of the mass points. cell_x: (n, 3) cells in W. shear: (n, 2) of the anchors.
    socket: (6,) displacement. fulcrum: (2,) how far the keel is beyond the roller, left and right.
    """

    R: np.ndarray
    p: np.ndarray
    q: np.ndarray
    increment: np.ndarray
    before: np.ndarray
    mass_x: np.ndarray
    mass_v: np.ndarray
    cell_x: np.ndarray
    shear: np.ndarray
    socket: np.ndarray
    fulcrum: np.ndarray


def new_state(device: Device) -> State:
    """An unloaded prosthesis at the world's origin."""
    bars, rigid, cells = len(device.lengths), len(device.masses), len(device.bodies)
    hinges = bars + len(device.twist_bars)
    return State(
        R=np.eye(3),
        p=np.zeros(3),
        q=np.zeros(hinges),
        increment=np.zeros(6 + hinges),
        before=np.zeros(6 + hinges),
        mass_x=np.zeros((rigid + bars, 3)),
        mass_v=np.zeros((rigid + bars, 3)),
        cell_x=np.zeros((cells, 3)),
        shear=np.zeros((cells, 2)),
        socket=np.zeros(6),
        fulcrum=np.zeros(2),
    )


def make_device(
    design: Design,
    *,
    fulcrum: float | None,
    residual_length: float,
    pylon_length: float,
    placement: FootPlacement | None = None,
) -> Device:
    """The device of a right leg.

    Args:
        fulcrum: m from A; None where `design` has no support.
        placement: of the foot under the pylon; standard where None.

    Raises:
        ValueError: no fulcrum for a foot with one or conversely, out of reach, or nothing that
            holds the keel.
    """
    support, frame = design.support, design.frame
    if (fulcrum is None) != (support is None):
        raise ValueError("a foot with a fulcrum takes its position, one without takes None")
    if support and fulcrum and not support.rearmost_m <= fulcrum <= support.foremost_m:
        raise ValueError(
            f"the fulcrum reaches {support.rearmost_m} to {support.foremost_m} m, not {fulcrum:g} m"
        )
    if design.keel.clamp_nm_per_rad <= 0.0 and (support is None or support.one_sided):
        raise ValueError(
            "a keel on a pin falls off a fulcrum that does not hold it, or that is not there"
        )
    keel = make_keel(design.keel)
    sole_z = -(0.5 * design.keel.thickness_rear_m + frame.foam_thickness_m)
    X_EP = (placement or FootPlacement()).pose(mirrored=False)
    R_EP = X_EP.rotation().matrix()
    mount = (X_EP.translation() - [0.0, 0.0, pylon_length]) @ R_EP
    anchor = mount + np.array([-frame.pylon_x_m, 0.0, -frame.build_height_m - sole_z])
    sole = make_sole(
        design.sole,
        sole_height=sole_z,
        foam_thickness=frame.foam_thickness_m,
        block_until=frame.block_until_m,
    )
    starts = np.concatenate(([0.0], np.cumsum(keel.lengths)[:-1]))
    bar = np.searchsorted(starts, sole.points[:, 0], side="right")
    bodies = np.where(sole.on_block, 0, bar)
    offset = np.column_stack([starts[np.maximum(bar, 1) - 1], *np.zeros((2, len(bar)))])
    points = np.where(sole.on_block[:, None], sole.points + anchor, sole.points - offset)
    order = np.argsort(bodies, kind="stable")
    on_limb, on_foot = _rigid_masses(
        design, fulcrum, residual_length, pylon_length, keel.node_masses
    )
    s = design.socket
    return Device(
        mass_points=np.vstack([on_limb[:, :3] @ R_EP, on_foot[:, :3] + anchor]),
        masses=np.concatenate([on_limb[:, 3], on_foot[:, 3]]),
        anchor=anchor,
        lengths=keel.lengths,
        hinge_stiffness=keel.stiffness,
        twist_bars=keel.twist_bars,
        twist_stiffness=keel.twist_stiffness,
        hinge_damping_time=design.keel.damping_time_s,
        node_masses=keel.node_masses[1:].copy(),
        fulcrum=float(fulcrum or 0.0),
        fulcrum_stiffness=support.stiffness_n_per_m if support else 0.0,
        fulcrum_damping_time=support.damping_time_s if support else 0.0,
        fulcrum_half_width=support.half_width_m if support else 0.0,
        fulcrum_one_sided=support.one_sided if support else False,
        fulcrum_play=support.play_m if support and support.one_sided else 0.0,
        bodies=bodies[order].astype(np.int64),
        points=np.ascontiguousarray(points[order]),
        foam_stiffness=sole.stiffness[order],
        dense_depth=sole.dense_depth[order],
        hysteresis=design.sole.hysteresis_s_per_m,
        shear_stiffness=design.sole.shear_ratio * sole.stiffness[order],
        friction=design.sole.friction,
        socket=np.array(
            [
                s.axial_force_n,
                s.axial_length_m,
                s.axial_linear_n_per_m,
                s.shear_stiffness_n_per_m,
                s.shear_length_m,
                s.bending_stiffness_nm_per_rad,
                s.bending_angle_rad,
                s.twist_stiffness_nm_per_rad,
                s.twist_angle_rad,
            ]
        ),
        socket_damping=np.array(
            [
                s.shear_damping_n_s_per_m,
                s.shear_damping_n_s_per_m,
                s.axial_damping_n_s_per_m,
                s.bending_damping_nm_s,
                s.bending_damping_nm_s,
                s.twist_damping_nm_s,
            ]
        ),
        R_EP=np.ascontiguousarray(R_EP),
        residual_length=float(residual_length),
        gravity=GRAVITY,
    )


def _rigid_masses(
    design: Design,
    fulcrum: float | None,
    residual_length: float,
    pylon_length: float,
    node_masses: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Mass points (x, y, z, kg) with the mass, centre and inertia of a thin-walled socket and a
    pylon, in E, and of the foot frame and the carriage, in K.

    Two points at the Gauss abscissae of a segment have a homogeneous rod's inertia.
    """
    gauss = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
    s, r = design.socket, design.socket.socket_radius_m
    ring = [(r, 0.0), (-r, 0.0), (0.0, r), (0.0, -r)]
    socket = [(x, y, h * residual_length, s.socket_mass_kg / 8) for h in gauss for x, y in ring]
    pylon = [(0.0, 0.0, -h * pylon_length, s.pylon_mass_kg / 2) for h in gauss]
    carriage_mass = design.support.carriage_mass_kg if design.support else 0.0
    carriage = [(fulcrum, 0.0, 0.02, carriage_mass)] if fulcrum else []
    frame_mass = design.frame.mass_kg - carriage_mass - float(np.sum(node_masses[1:]))
    size = (
        1.5 * design.frame.block_until_m,
        design.keel.width_rear_m,
        design.frame.build_height_m - design.frame.foam_thickness_m,
    )
    frame = [
        (a * size[0], (b - 0.5) * size[1], 0.5 * c * size[2], frame_mass / 8)
        for a in gauss
        for b in gauss
        for c in gauss
    ]
    return np.array([*socket, *pylon]), np.array([*frame, *carriage])
