"""The person's joints without mass: what markers are fitted to. Both legs end in a foot with an ankle of its own.

Joints, their order, axes and places are those of `person.add_person`, made by the same functions. Only the prosthetic
side differs below the knee: there the model has socket, pylon and foot, whose bending no marker set resolves, and the
skeleton has a shank of the measured length with an ankle, so that a foot that deforms need not turn its shank.
"""

from __future__ import annotations

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia

from vsf_drake.plants.anthropometry import Body
from vsf_drake.plants.joints import FORWARD, LEFTWARD, RIGHTWARD, UPWARD, add_chain, rotations, translations
from vsf_drake.plants.person import PELVIS_COORDINATES, leg_coordinates

SIDES = ("right", "left")


def add_skeleton(plant: MultibodyPlant, body: Body, *, prosthetic_side: str,
                 p_ShankAnkle: np.ndarray) -> dict[str, RigidBody]:
    """Adds the seven segments and their 24 coordinates; returns the bodies by the names of `markers.schema.SEGMENTS`.

    Args:
        plant: not yet finalized.
        body: the scaled person.
        prosthetic_side: "right" or "left".
        p_ShankAnkle: (3,) m, where the prosthetic side has its ankle in the shank's frame.
    """
    instance = plant.AddModelInstance("skeleton")

    def segment(name: str) -> RigidBody:
        return plant.AddRigidBody(name, instance, SpatialInertia.Zero())

    bodies = {"pelvis": segment("pelvis")}
    steps = translations(PELVIS_COORDINATES[:3], (FORWARD, UPWARD, RIGHTWARD))
    steps += rotations(PELVIS_COORDINATES[3:], mirrored=False)
    add_chain(plant, instance, plant.world_frame(), np.zeros(3), bodies["pelvis"], steps)
    for side in SIDES:
        intact, mirrored = side != prosthetic_side, side == "left"
        names = leg_coordinates(side, intact=True)
        thigh, shank, foot = (segment(f"{kind}_{side}") for kind in ("thigh", "shank", "foot"))
        hip = np.array([body.hip_forward, body.hip_lateral if mirrored else -body.hip_lateral, body.hip_up])
        knee = np.array([0.0, 0.0, -body.thigh_length_of(intact=intact)])
        ankle = np.array([0.0, 0.0, -body.shank_length]) if intact else np.asarray(p_ShankAnkle, dtype=float)
        add_chain(plant, instance, bodies["pelvis"].body_frame(), hip, thigh, rotations(names[:3], mirrored))
        add_chain(plant, instance, thigh.body_frame(), knee, shank, rotations(names[3:6], mirrored, LEFTWARD))
        add_chain(plant, instance, shank.body_frame(), ankle, foot, rotations(names[6:], mirrored))
        bodies |= {f"thigh_{side}": thigh, f"shank_{side}": shank, f"foot_{side}": foot}
    return bodies
