"""Contact of a foot that Drake's Parser has read: one of our laws, or its collision spheres, and not both."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import GeometryId, Role, SceneGraph
from pydrake.multibody.plant import MultibodyPlant

from vsf_drake.errors import InputError
from vsf_drake.plants.contact_geometry import own_geometry
from vsf_drake.plants.export.rigid_foot import rigid_foot
from vsf_drake.plants.foot import CONTACTS
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.systems.foot_forces import CONTACT_LAWS


def parsed_contact(
    plant: MultibodyPlant, foot: FootHandles, contact: str, scene_graph: SceneGraph | None, *, agreement: float
) -> str:
    """The contact of `foot`, after a check that it goes with the collision spheres that the plant has of it.

    For a law of `FootForces` they are taken out of `scene_graph`: they lose their proximity role.

    Args:
        scene_graph: where the spheres are; given, those of "drake_point" are also held against the parameters.
        agreement: of their numbers, relative.

    Raises:
        InputError: there is no such contact, or it does not go with the spheres.
    """
    where = f"{foot.name}: contact"
    if contact not in CONTACTS:
        raise InputError(f"{contact!r} is not known", where="contact", right=f"Known are {', '.join(CONTACTS)}")
    spheres = own_geometry(plant, foot)
    if scene_graph is not None:
        inspector = scene_graph.model_inspector()
        spheres = [i for i in spheres if inspector.GetProximityProperties(i) is not None]
    if contact in CONTACT_LAWS:
        if spheres and scene_graph is None:
            raise InputError(f"the plant has {len(spheres)} collision spheres of the foot, which {contact!r} would act "
                             "beside", where=where, right="Give scene_graph, from which they are then taken out, or "
                             "contact=\"drake_point\", or export the foot with --no-collision")
        for sphere in spheres:
            scene_graph.RemoveRole(plant.get_source_id(), sphere, Role.kProximity)
        return contact
    if contact != "drake_point":
        raise InputError(f"{contact!r} is not what the file's collision spheres are made for", where=where,
                         right="Use add_foot for it, or \"drake_point\"")
    pads = {pad.name: pad for link in rigid_foot(foot.parameters).links for pad in link.pads}
    if len(spheres) != len(pads):
        raise InputError(f"the plant has {len(spheres)} collision spheres of the foot, the parameters {len(pads)}",
                         where=where, right="Register the plant with a SceneGraph before parsing "
                         "(AddMultibodyPlantSceneGraph), and export the foot with collision spheres")
    if scene_graph is not None:
        _check_spheres(scene_graph, spheres, pads, agreement, where)
    return contact


def _check_spheres(
    scene_graph: SceneGraph, spheres: list[GeometryId], pads: dict, agreement: float, where: str
) -> None:
    inspector = scene_graph.model_inspector()
    for sphere in spheres:
        name, properties = inspector.GetName(sphere).split("::")[-1], inspector.GetProximityProperties(sphere)
        pad = pads.get(name)
        if pad is None:
            raise InputError(f"the parameters have no sphere {name}", where=where,
                             right="Export the file again from these parameters")
        friction = properties.GetProperty("material", "coulomb_friction")
        wanted = {"x (m)": pad.p_BS[0], "y (m)": pad.p_BS[1], "z (m)": pad.p_BS[2], "radius (m)": pad.radius,
                  "stiffness (N/m)": pad.stiffness, "dissipation (s/m)": pad.dissipation,
                  "static friction": pad.friction.static_friction(),
                  "kinetic friction": pad.friction.dynamic_friction()}
        found = (*inspector.GetPoseInFrame(sphere).translation(), inspector.GetShape(sphere).radius(),
                 properties.GetProperty("material", "point_contact_stiffness"),
                 properties.GetProperty("material", "hunt_crossley_dissipation"),
                 friction.static_friction(), friction.dynamic_friction())
        for (what, want), have in zip(wanted.items(), found, strict=True):
            if not np.isclose(have, want, rtol=agreement, atol=agreement):
                raise InputError(f"{name} has {what} {have:.6g}, by the parameters {want:.6g}", where=where,
                                 right="Export the file again from these parameters")
