"""The rigid foot read link by link, as files for other programs take it."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.geometry import GeometryId, Mesh, Role, SceneGraph, Sphere
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from vsf_drake.base.errors import InputError
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants.contact_geometry import add_contact_geometry
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_handles import FootHandles

NAME = "vsf"
"""Of the exported model, and what the names of its frame, mount and carriage begin with."""

# All of it is read from a plant of the foot that `add_foot` builds, so that an exported file says
# what the plant says. With all coordinates zero every link's frame is parallel to the keel frame K,
# which is the frame of the first link.


def rigid_foot(parameters: FootParameters) -> tuple[FootHandles, list[dict[str, Any]]]:
    """The foot of `parameters` in a plant of its own, and its links as the templates take them:
    frame, keel from A to the toe, carriage."""
    plant = MultibodyPlant(0.0)
    scene_graph = SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    foot = add_foot(plant, plant.world_frame(), parameters, name=NAME)
    add_contact_geometry(plant, foot, "drake_point")
    plant.Finalize()
    inspector = scene_graph.model_inspector()
    carriage = foot.carriage_joint(plant).child_body()
    bodies = (foot.frame, *foot.keel, carriage)
    starts = (0.0, *foot.keel_starts, 0.0)
    return foot, [
        _link(plant, inspector, body, start) for body, start in zip(bodies, starts, strict=True)
    ]


def _link(plant: MultibodyPlant, inspector: Any, body: RigidBody, start: float) -> dict[str, Any]:
    inertia = body.default_spatial_inertia()
    centre = inertia.get_com()
    drawings = [
        {
            "name": inspector.GetName(i).split("::")[-1],
            "shape": inspector.GetShape(i),
            "X_BG": inspector.GetPoseInFrame(i),
            "colour": inspector.GetIllustrationProperties(i).GetProperty("phong", "diffuse").rgba,
        }
        for i in inspector.GetGeometries(
            plant.GetBodyFrameIdOrThrow(body.index()), Role.kIllustration
        )
        # the sole would be a file of its own
        if not isinstance(inspector.GetShape(i), Mesh)
    ]
    return {
        "name": body.name(),
        "mass": inertia.get_mass(),
        "p_BBcm": centre,
        "p_KB": np.array([start, 0.0, 0.0]),
        "moments": inertia.Shift(centre).CalcRotationalInertia().CopyToFullMatrix3(),
        "drawings": drawings,
        "pads": dict(
            pad_of(inspector, shape) for shape in plant.GetCollisionGeometriesForBody(body)
        ),
    }


def pad_of(inspector: Any, shape: GeometryId) -> tuple[str, dict[str, float]]:
    """Name of a collision sphere, and its place in its body's frame, size and point contact."""
    properties = inspector.GetProximityProperties(shape)
    sphere = inspector.GetShape(shape)
    if not isinstance(sphere, Sphere):
        raise InputError(
            f"is a {type(sphere).__name__}, but must be a sphere",
            where=inspector.GetName(shape),
            right="Export the foot again",
        )
    x, y, z = inspector.GetPoseInFrame(shape).translation()
    friction = properties.GetProperty("material", "coulomb_friction")
    return inspector.GetName(shape).split("::")[-1], {
        "x (m)": x,
        "y (m)": y,
        "z (m)": z,
        "radius (m)": sphere.radius(),
        "stiffness (N/m)": properties.GetProperty("material", "point_contact_stiffness"),
        "dissipation (s/m)": properties.GetProperty("material", "hunt_crossley_dissipation"),
        "static friction": friction.static_friction(),
        "kinetic friction": friction.dynamic_friction(),
    }
