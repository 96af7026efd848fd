"""Where the model's feet and centre of mass are while its person follows a recording: kinematics, nothing simulated.

The prosthesis hangs under the residual shank as a rigid body: socket and keel undeformed. A real one bends under load,
so its toe and heel go "into" the floor here by as much as the device would give.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from vsf_drake.analysis.recording.foot import FootMotion
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.plants.contact_sites import ContactSites
from vsf_drake.plants.foot import set_mount, sole_height
from vsf_drake.plants.person import PersonHandles, add_person


@dataclass(frozen=True)
class _Points:
    """Points of one foot: bodies, places in them (k, 3), radii (k,); the first three are heel, toe and ankle."""

    bodies: list
    p_BP: np.ndarray
    radius: np.ndarray


@dataclass(frozen=True, eq=False)
class ModelMotion:
    """What the model's person does: both feet by side, and the body's centre of mass (x, y, z in W, m)."""

    feet: dict[str, FootMotion]
    centre_of_mass: CoordinateTrajectory


def model_motion(subject: Subject, model: ModelParameters, trajectory: CoordinateTrajectory, *,
                 offsets: GeometricOffsets | None = None) -> ModelMotion:
    """The feet and the centre of mass of the model's person at the trajectory's instants.

    `lowest_m` is that of the contact spheres. The heel and toe of the prosthesis are those of its flat sole below its
    rearmost and foremost sphere.

    Args:
        trajectory: the person's coordinates (rad, m), intact ankle included.
        offsets: of the prosthesis under the person.

    Raises:
        InputError: the segments do not fit (see `plants.anthropometry.scale_body`), or a coordinate is missing.
    """
    plant = MultibodyPlant(0.0)
    person = add_person(plant, subject, model)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    if offsets is not None:
        set_mount(context, person.foot, height=offsets.height_m, fore_aft=offsets.fore_aft_m,
                  alignment=offsets.alignment_rad)
    prosthetic = subject.prosthetic_side
    points = {prosthetic: _prosthetic(person),
              "left" if prosthetic == "right" else "right": _intact(person, model, prosthetic)}
    motion = trajectory.ordered(person.coordinate_names)
    columns = [plant.GetJointByName(name).position_start() for name in motion.names]
    q: np.ndarray = np.zeros(plant.num_positions())
    places = {side: np.empty((len(motion.time_s), len(item.bodies), 3)) for side, item in points.items()}
    centre = np.empty((len(motion.time_s), 3))
    for i, row in enumerate(motion.values):
        q[columns] = row
        plant.SetPositions(context, q)
        centre[i] = plant.CalcCenterOfMassPositionInWorld(context)
        for side, item in points.items():
            places[side][i] = _places(plant, context, item)
    lowest = {side: (places[side][:, 3:, 2] - item.radius[3:]).min(axis=1) for side, item in points.items()}
    feet = {side: FootMotion(side, motion.time_s, heel_W=place[:, 0], toe_W=place[:, 1], ankle_W=place[:, 2],
                             lowest_m=lowest[side], prosthetic=side == prosthetic, undeformed=side == prosthetic)
            for side, place in places.items()}
    return ModelMotion(feet, CoordinateTrajectory(motion.time_s, centre, ("x", "y", "z"), source=motion.source))


def _places(plant: MultibodyPlant, context: Context, item: _Points) -> np.ndarray:
    """(k, 3) the points in W; poses of bodies are asked for once each."""
    poses: dict[int, np.ndarray] = {}
    for body in item.bodies:
        if int(body) not in poses:
            poses[int(body)] = plant.EvalBodyPoseInWorld(context, plant.get_body(body)).GetAsMatrix34()
    X: np.ndarray = np.array([poses[int(body)] for body in item.bodies])
    return np.einsum("kij,kj->ki", X[:, :, :3], item.p_BP) + X[:, :, 3]


def _with_sites(own_bodies: list, own: np.ndarray, sites: ContactSites) -> _Points:
    return _Points([*own_bodies, *sites.body_indices], np.vstack([own, sites.p_BS]),
                   np.concatenate([np.zeros(len(own)), sites.radius]))


def _prosthetic(person: PersonHandles) -> _Points:
    parameters = person.foot.parameters
    x = [1e-3 * value for zone in parameters.zones for value in zone.x_mm]
    sole, frame = sole_height(parameters), person.foot.frame.index()
    own = np.array([[min(x), 0.0, sole], [max(x), 0.0, sole],
                    [parameters.pylon_x_m, 0.0, sole + parameters.build_height_m]])
    return _with_sites([frame] * 3, own, person.foot.sites)


def _intact(person: PersonHandles, model: ModelParameters, prosthetic: str) -> _Points:
    body, side = person.body, "left" if prosthetic == "right" else "right"
    rear = -model.intact_foot.ankle_x_ratio * body.foot_length
    own = np.array([[rear, 0.0, -body.ankle_height], [rear + body.foot_length, 0.0, -body.ankle_height], np.zeros(3)])
    return _with_sites([person.segments[f"foot_{side}"].index()] * 3, own, person.intact_sites)
