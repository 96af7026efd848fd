"""The prosthesis as arrays for the compiled step, and its state.

Frame P: the rigid part (socket, pylon, foot frame, heel block), origin at the end of the residual limb,
parallel to the keel frame K of the undeformed foot. Body 0 is P; body i = 1..N is bar i of the keel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from virtual_laboratory.design import Design
from virtual_laboratory.keel import make_keel
from virtual_laboratory.sole import make_sole
from vsf_drake.parameters import GRAVITY, FootParameters


class Device(NamedTuple):
    """Constants, SI. M mass points of the rigid part, N bars, n foam cells (sorted by body).

    points: (n, 3) in P for cells on the rigid part; else in their bar, from its rear hinge along, left, up.
    socket: (9,) axial force, length, linear; shear stiffness, length; bending stiffness, angle; twist stiffness,
    angle. socket_damping: (6,) along and about x, y, z.
    """

    mass_points: np.ndarray
    masses: np.ndarray
    anchor: np.ndarray
    lengths: np.ndarray
    hinge_stiffness: np.ndarray
    hinge_damping_time: float
    node_masses: np.ndarray
    fulcrum: float
    fulcrum_stiffness: float
    fulcrum_damping_time: float
    bodies: np.ndarray
    points: np.ndarray
    foam_stiffness: np.ndarray
    dense_depth: np.ndarray
    hysteresis: float
    shear_stiffness: np.ndarray
    friction: float
    socket: np.ndarray
    socket_damping: np.ndarray
    residual_length: float
    gravity: float


class State(NamedTuple):
    """What the step carries on; arrays changed in place.

    R, p: pose of P in W. q: (N,) hinge angles, positive lifts the toe. increment: (6 + N,) last step's
    motion (rotation and translation of P in P, hinge angles). mass_x, mass_v: (M + N, 3) positions and
    velocities of the mass points. cell_x: (n, 3) cells in W. shear: (n, 2) of the anchors.
    socket: (6,) displacement. fulcrum: (1,) gap.
    """

    R: np.ndarray
    p: np.ndarray
    q: np.ndarray
    increment: np.ndarray
    mass_x: np.ndarray
    mass_v: np.ndarray
    cell_x: np.ndarray
    shear: np.ndarray
    socket: np.ndarray
    fulcrum: np.ndarray


def new_state(device: Device) -> State:
    """An unloaded prosthesis at the world's origin."""
    bars, rigid, cells = len(device.lengths), len(device.masses), len(device.bodies)
    return State(
        R=np.eye(3), p=np.zeros(3), q=np.zeros(bars), increment=np.zeros(6 + bars), mass_x=np.zeros((rigid + bars, 3)),
        mass_v=np.zeros((rigid + bars, 3)), cell_x=np.zeros((cells, 3)), shear=np.zeros((cells, 2)),
        socket=np.zeros(6), fulcrum=np.zeros(1))


def make_device(
    design: Design, foot: FootParameters, *, fulcrum: float, residual_length: float, pylon_length: float
) -> Device:
    """The device with the published geometry of `foot` and everything else from `design`."""
    length = float(sum(foot.keel.element_lengths_m))
    keel = make_keel(design.keel, length)
    sole_z = -(0.5 * foot.keel.thickness_m + foot.foam_thickness_m)
    anchor = np.array([-foot.pylon_x_m, 0.0, -pylon_length - foot.build_height_m - sole_z])
    sole = make_sole(design.sole, sole_height=sole_z, foam_thickness=foot.foam_thickness_m,
                     block_until=foot.fulcrum.rearmost_m)
    starts = np.concatenate(([0.0], np.cumsum(keel.lengths)[:-1]))
    bar = np.searchsorted(starts, sole.points[:, 0], side="right")
    bodies = np.where(sole.on_block, 0, bar)
    offset = np.column_stack([starts[np.maximum(bar, 1) - 1], *np.zeros((2, len(bar)))])
    points = np.where(sole.on_block[:, None], sole.points + anchor, sole.points - offset)
    order = np.argsort(bodies, kind="stable")
    mass_points, masses = _rigid_masses(design, foot, fulcrum, residual_length, pylon_length, anchor, keel.node_masses)
    s = design.socket
    return Device(
        mass_points=mass_points, masses=masses, anchor=anchor, lengths=keel.lengths, hinge_stiffness=keel.stiffness,
        hinge_damping_time=design.keel.damping_time_s, node_masses=keel.node_masses[1:].copy(), fulcrum=float(fulcrum),
        fulcrum_stiffness=design.keel.fulcrum_stiffness_n_per_m,
        fulcrum_damping_time=design.keel.fulcrum_damping_time_s,
        bodies=bodies[order].astype(np.int64), points=np.ascontiguousarray(points[order]),
        foam_stiffness=sole.stiffness[order], dense_depth=sole.dense_depth[order],
        hysteresis=design.sole.hysteresis_s_per_m, shear_stiffness=design.sole.shear_ratio * sole.stiffness[order],
        friction=design.sole.friction,
        socket=np.array([s.axial_force_n, s.axial_length_m, s.axial_linear_n_per_m, s.shear_stiffness_n_per_m,
                         s.shear_length_m, s.bending_stiffness_nm_per_rad, s.bending_angle_rad,
                         s.twist_stiffness_nm_per_rad, s.twist_angle_rad]),
        socket_damping=np.array([s.shear_damping_n_s_per_m, s.shear_damping_n_s_per_m, s.axial_damping_n_s_per_m,
                                 s.bending_damping_nm_s, s.bending_damping_nm_s, s.twist_damping_nm_s]),
        residual_length=float(residual_length), gravity=GRAVITY)


def _rigid_masses(
    design: Design, foot: FootParameters, fulcrum: float, residual_length: float, pylon_length: float,
    anchor: np.ndarray, node_masses: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Mass points with the mass, centre and inertia of a thin-walled socket, a pylon, the foot frame and the carriage.

    Two points at the Gauss abscissae of a segment have a homogeneous rod's inertia.
    """
    gauss = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
    r = design.socket.socket_radius_m
    ring = [(r, 0.0), (-r, 0.0), (0.0, r), (0.0, -r)]
    socket = [(x, y, h * residual_length) for h in gauss for x, y in ring]
    pylon = [(0.0, 0.0, -h * pylon_length) for h in gauss]
    rear, width = foot.fulcrum.rearmost_m, foot.keel.width_m
    height = foot.build_height_m - foot.foam_thickness_m
    corners = np.array([(a, b - 0.5, 0.5 * c) for a in gauss for b in gauss for c in gauss])
    frame = anchor + corners * np.array([1.5 * rear, width, height])
    carriage = anchor + np.array([[fulcrum, 0.0, 0.02]])
    carriage_mass = foot.fulcrum.carriage_mass_kg
    frame_mass = foot.mass_kg - carriage_mass - float(np.sum(node_masses[1:]))
    masses = ([design.socket.socket_mass_kg / 8] * 8 + [design.socket.pylon_mass_kg / 2] * 2
              + [frame_mass / 8] * 8 + [carriage_mass])
    return np.array([*socket, *pylon, *frame, *carriage], dtype=float), np.array(masses)
