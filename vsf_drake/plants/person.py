"""The person: pelvis with head, arms and trunk, two thighs, intact shank and foot, residual shank,
socket and pylon.

Frames: x forward, y left, z up, all parallel to W when every coordinate is zero. Pelvis: origin at
the midpoint of the anterior superior iliac spines; thigh at the hip centre; shank at the knee
centre; foot at the ankle centre. Coordinates are named and signed as in OpenSim's gait models, knee
flexion positive; order of rotations: flexion (tilt), adduction (list), rotation, after Wu et al.
(2002, doi 10.1016/S0021-9290(01)00222-6) and Grood & Suntay (1983, doi 10.1115/1.3138397).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, Frame, ModelInstanceIndex, RigidBody, WeldJoint

from vsf_drake.model.parameters import (
    PELVIS_COORDINATES,
    BushingAxis,
    IntactFootParameters,
    ModelParameters,
    SocketParameters,
    Subject,
    leg_coordinates,
)
from vsf_drake.plants import solids
from vsf_drake.plants.anthropometry import Body, scale_body
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_handles import ContactSites, FootHandles, zone_sites

SOCKET_COORDINATES = (
    "socket_tx",
    "socket_ty",
    "socket_tz",
    "socket_flexion",
    "socket_adduction",
    "socket_rotation",
)
SOCKET_RADIUS_M = 0.055
"""Outer radius of the socket's top (m): the public GaitModel_VSF scripts' radius of the shank
there."""


@dataclass(frozen=True)
class SocketHandles:
    """Socket and pylon in the plant, body frames at their upper ends, z up."""

    parameters: SocketParameters
    socket: RigidBody
    pylon: RigidBody
    distal: Frame  # at the pylon's lower end, where the foot goes
    coordinate_names: tuple[str, ...]  # the six joints of the bushing
    axes: tuple[BushingAxis, ...]  # parameters of the bushing, in that order


@dataclass(frozen=True)
class PersonHandles:
    """What `add_person` put into the plant."""

    subject: Subject
    body: Body  # the scaled segments
    coordinate_names: tuple[str, ...]  # the 21 anatomical coordinates, pelvis first
    pelvis: RigidBody
    segments: dict[str, RigidBody]  # every anatomical body by name
    intact_sites: ContactSites
    socket: SocketHandles
    foot: FootHandles


def add_person(plant: MultibodyPlant, subject: Subject, model: ModelParameters) -> PersonHandles:
    """Adds the person with the prosthesis on `subject.prosthetic_side`: 28 degrees of freedom
    (pelvis 6, hips 3 + 3, knees 3 + 3, intact ankle 3, socket 6, fulcrum carriage 1) and the keel's
    own on top."""
    body = scale_body(subject, model.foot, model.socket)
    instance = plant.AddModelInstance("person")
    sound = "left" if subject.prosthetic_side == "right" else "right"
    # the ellipsoid that has the trunk's radii of gyration about AP, ML and long axis
    moments = body.pelvis_mass * np.square(np.array(body.table.trunk_gyration) * body.trunk_length)
    pelvis = plant.AddRigidBody(
        "pelvis", instance, solids.from_central(body.pelvis_mass, body.trunk_place, moments)
    )
    solids.add_chain(
        plant,
        instance,
        plant.world_frame(),
        np.zeros(3),
        pelvis,
        [
            *solids.translations(
                PELVIS_COORDINATES[:3], (solids.FORWARD, solids.UPWARD, solids.RIGHTWARD)
            ),
            *solids.rotations(PELVIS_COORDINATES[3:], mirrored=False),
        ],
    )
    names = list(PELVIS_COORDINATES)
    segments = {"pelvis": pelvis}
    for side in ("right", "left"):
        segments |= _add_leg(plant, instance, body, pelvis, side, intact=side == sound)
        names += leg_coordinates(side, side == sound)
    foot = _add_intact_foot(
        plant, instance, body, model.intact_foot, segments[f"shank_{sound}"], sound
    )
    segments[f"foot_{sound}"] = foot
    mirrored = subject.prosthetic_side == "left"
    socket = add_socket(
        plant,
        segments[f"shank_{subject.prosthetic_side}"].body_frame(),
        model.socket,
        residual_length=body.residual_length,
        pylon_length=body.pylon_length,
        mirrored=mirrored,
    )
    place = plant.AddFrame(
        FixedOffsetFrame("foot_place", socket.distal, body.placement.pose(mirrored=mirrored))
    )
    return PersonHandles(
        subject=subject,
        body=body,
        coordinate_names=tuple(names),
        pelvis=pelvis,
        segments=segments,
        intact_sites=_intact_sites(model.intact_foot, body, foot, sound),
        socket=socket,
        foot=add_foot(
            plant,
            place,
            model.foot,
            side=subject.prosthetic_side,
            contact=model.contact_law,
        ),
    )


def _add_leg(
    plant: MultibodyPlant,
    instance: ModelInstanceIndex,
    body: Body,
    pelvis: RigidBody,
    side: str,
    *,
    intact: bool,
) -> dict[str, RigidBody]:
    """Thigh and shank, by name."""
    mirrored = side == "left"
    thigh_size = body.thigh(intact=intact)
    thigh = plant.AddRigidBody(
        f"thigh_{side}", instance, solids.frustum(body.thigh_mass, *thigh_size)
    )
    shank = plant.AddRigidBody(
        f"shank_{side}",
        instance,
        solids.frustum(
            body.shank_mass if intact else body.residual_shank_mass, *body.shank(intact=intact)
        ),
    )
    names = leg_coordinates(side, intact)
    hip = np.array(
        [body.hip_forward, body.hip_lateral if mirrored else -body.hip_lateral, body.hip_up]
    )
    solids.add_chain(
        plant, instance, pelvis.body_frame(), hip, thigh, solids.rotations(names[:3], mirrored)
    )
    knee = np.array([0.0, 0.0, -thigh_size[-1]])
    solids.add_chain(
        plant,
        instance,
        thigh.body_frame(),
        knee,
        shank,
        solids.rotations(names[3:6], mirrored, solids.LEFTWARD),
    )
    return {f"thigh_{side}": thigh, f"shank_{side}": shank}


def _add_intact_foot(
    plant: MultibodyPlant,
    instance: ModelInstanceIndex,
    body: Body,
    parameters: IntactFootParameters,
    shank: RigidBody,
    side: str,
) -> RigidBody:
    ap, ml, long = np.square(np.array(body.table.foot_gyration) * body.foot_length)
    # The foot's long axis points forward: "longitudinal" is about x, the other two about y and z.
    moments = body.foot_mass * np.array([long, ml, ap])
    heel = -parameters.ankle_x_ratio * body.foot_length
    center = np.array(
        [heel + body.table.foot_center * body.foot_length, 0.0, -0.5 * body.ankle_height]
    )
    foot = plant.AddRigidBody(
        f"foot_{side}", instance, solids.from_central(body.foot_mass, center, moments)
    )
    solids.add_chain(
        plant,
        instance,
        shank.body_frame(),
        np.array([0.0, 0.0, -body.shank_length]),
        foot,
        solids.rotations(leg_coordinates(side, intact=True)[6:], side == "left"),
    )
    return foot


def _intact_sites(
    parameters: IntactFootParameters, body: Body, foot: RigidBody, side: str
) -> ContactSites:
    """Contact spheres of the intact foot: scaled with foot length, mirrored on the left."""
    scale = body.foot_length / parameters.reference_length_m
    mirror = -1.0 if side == "left" else 1.0
    points = [
        [
            scale * 1e-3 * x - parameters.ankle_x_ratio * body.foot_length,
            mirror * scale * 1e-3 * y,
            zone.radius_m + 1e-3 * rise - body.ankle_height,
        ]
        for zone in parameters.zones
        for x, y, rise in zip(zone.x_mm, zone.y_mm, zone.rise_mm, strict=True)
    ]
    return zone_sites(parameters.zones, [foot.index()] * len(points), np.array(points))


def add_socket(
    plant: MultibodyPlant,
    shank: Frame,
    parameters: SocketParameters,
    *,
    residual_length: float,
    pylon_length: float,
    mirrored: bool = False,
) -> SocketHandles:
    """Adds socket and pylon below `shank` (origin at the knee, z up along it), free to move in six
    directions.

    The bushing's origin is at the end of the residual shank, `residual_length` (m) below the knee;
    coordinates are displacements of the socket in the frame of the residual shank: forward, left,
    up (onto the limb), then flexion (toes up), adduction and internal rotation. On the left,
    `mirrored`, the axes of the last two change their sign.
    """
    instance = plant.AddModelInstance("socket")
    radius = SOCKET_RADIUS_M
    height = residual_length
    hanging = solids.frustum(parameters.socket_mass_kg, radius, 0.75 * radius, height)
    socket = plant.AddRigidBody(
        "socket_body", instance, hanging.Shift(np.array([0.0, 0.0, -height]))
    )
    pylon = plant.AddRigidBody(
        "pylon",
        instance,
        solids.frustum(
            parameters.pylon_mass_kg,
            parameters.pylon_radius_m,
            parameters.pylon_radius_m,
            pylon_length,
        ),
    )
    plant.AddJoint(
        WeldJoint("pylon_weld", socket.body_frame(), pylon.body_frame(), RigidTransform())
    )
    solids.add_chain(
        plant,
        instance,
        shank,
        np.array([0.0, 0.0, -residual_length]),
        socket,
        [
            *solids.translations(
                SOCKET_COORDINATES[:3], (solids.FORWARD, solids.LEFTWARD, solids.UPWARD)
            ),
            *solids.rotations(SOCKET_COORDINATES[3:], mirrored),
        ],
    )
    lower_end = RigidTransform(np.array([0.0, 0.0, -pylon_length]))
    distal = plant.AddFrame(
        FixedOffsetFrame("pylon_distal", pylon.body_frame(), lower_end, instance)
    )
    p = parameters
    return SocketHandles(
        parameters=p,
        socket=socket,
        pylon=pylon,
        distal=distal,
        coordinate_names=SOCKET_COORDINATES,
        axes=(p.tx, p.ty, p.tz, p.flexion, p.adduction, p.rotation),
    )
