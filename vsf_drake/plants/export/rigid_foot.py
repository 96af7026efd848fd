"""The rigid parts, springs, drawings and contact spheres of the foot that `add_foot` builds, as numbers to be written.

All of it is read from a plant of that foot, so that an exported file says what the plant says. With all coordinates
zero every link's frame is parallel to the keel frame K, which is the frame of the first link.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import GeometryId, Role, SceneGraph, SceneGraphInspector, Shape
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody

from vsf_drake.parameters import FootParameters
from vsf_drake.plants.contact_geometry import add_contact_geometry
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_handles import ContactSites, FootHandles
from vsf_drake.plants.foot_visuals import add_foot_visuals
from vsf_drake.plants.inertia import RIGHTWARD

NAME = "vsf"
"""Of the exported model, and what the names of its frame, mount and carriage begin with."""


@dataclass(frozen=True)
class Drawing:
    """A shape to be seen: its pose in the link's frame, and red, green, blue, opacity."""

    name: str
    shape: Shape
    X_BG: RigidTransform
    colour: np.ndarray


@dataclass(frozen=True)
class Pad:
    """A contact sphere.

    Attributes:
        p_BS: (3,) m, its centre. radius: m.
        stiffness, dissipation, friction: N/m, s/m and coefficients for Drake's point contact, see `contact_geometry`.
        foam_stiffness, exponent, foam_damping: N/m^exponent, 1 and N s/m of the model's own law.
    """

    name: str
    p_BS: np.ndarray
    radius: float
    stiffness: float
    dissipation: float
    friction: CoulombFriction
    foam_stiffness: float
    exponent: float
    foam_damping: float


@dataclass(frozen=True)
class Link:
    """A rigid body: p_KB (3,) m its place with all coordinates zero, p_BBcm (3,) m its centre of mass, moments (3, 3)
    kg m^2 about that, in its own frame."""

    name: str
    mass: float
    p_BBcm: np.ndarray
    moments: np.ndarray
    p_KB: np.ndarray
    drawings: tuple[Drawing, ...]
    pads: tuple[Pad, ...]


@dataclass(frozen=True)
class Hinge:
    """A revolute joint of the keel at the child's origin: axis (3,), stiffness N m/rad, damping N m s/rad."""

    name: str
    parent: str
    child: str
    axis: np.ndarray
    stiffness: float
    damping: float


@dataclass(frozen=True)
class RigidFoot:
    """A foot to be written: frame, keel from A to the toe, carriage, hinges, and the mount M on the frame."""

    parameters: FootParameters
    frame: Link
    keel: tuple[Link, ...]
    carriage: Link
    hinges: tuple[Hinge, ...]
    carriage_joint: str
    mount: str
    X_KM: RigidTransform

    @property
    def links(self) -> tuple[Link, ...]:
        """All of them, parents before children."""
        return (self.frame, *self.keel, self.carriage)

    def over_fulcrum(self, fulcrum_m: float) -> tuple[Link, np.ndarray]:
        """The keel's link over the fulcrum at `fulcrum_m` (m from A), and its point there, (3,) m in its frame."""
        starts = [link.p_KB[0] for link in self.keel]
        link = self.keel[int(np.clip(np.searchsorted(starts, fulcrum_m, side="right") - 1, 0, len(starts) - 1))]
        return link, np.array([fulcrum_m, 0.0, 0.0]) - link.p_KB

    @property
    def fulcrum_damping(self) -> float:
        """Of the support (N s/m)."""
        return self.parameters.fulcrum.stiffness_n_per_m * self.parameters.fulcrum.damping_time_s


def rigid_foot(parameters: FootParameters) -> RigidFoot:
    """Reads the foot of `parameters` from a plant of its own.

    Raises:
        ValueError: see `add_foot`.
    """
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    foot = add_foot(plant, plant.world_frame(), parameters, name=NAME)
    add_foot_visuals(plant, foot)
    add_contact_geometry(plant, foot, "drake_point")
    plant.Finalize()
    inspector = scene_graph.model_inspector()
    carriage = plant.GetJointByName(foot.carriage_joint_name, foot.instance).child_body()
    places = [np.zeros(3), *([x, 0.0, 0.0] for x in foot.keel_starts), np.zeros(3)]
    links = [_link(plant, inspector, foot, body, np.array(place))
             for body, place in zip((foot.frame, *foot.keel, carriage), places, strict=True)]
    chain = [link.name for link in links[:-1]]
    hinges = tuple(
        Hinge(name, parent, child, RIGHTWARD, float(stiffness), float(damping))
        for name, parent, child, stiffness, damping in zip(
            foot.keel_joint_names, chain[:-1], chain[1:], foot.joint_stiffness, foot.joint_damping, strict=True))
    return RigidFoot(
        parameters=parameters, frame=links[0], keel=tuple(links[1:-1]), carriage=links[-1], hinges=hinges,
        carriage_joint=foot.carriage_joint_name, mount=foot.mount.name(), X_KM=foot.mount.GetFixedPoseInBodyFrame())


def _link(
    plant: MultibodyPlant, inspector: SceneGraphInspector, foot: FootHandles, body: RigidBody, p_KB: np.ndarray
) -> Link:
    inertia = body.default_spatial_inertia()
    centre = inertia.get_com()
    geometries = inspector.GetGeometries(plant.GetBodyFrameIdOrThrow(body.index()), Role.kIllustration)
    drawings = tuple(Drawing(
        name=inspector.GetName(i).split("::")[-1], shape=inspector.GetShape(i), X_BG=inspector.GetPoseInFrame(i),
        colour=inspector.GetIllustrationProperties(i).GetProperty("phong", "diffuse").rgba) for i in geometries)
    return Link(
        name=body.name(), mass=inertia.get_mass(), p_BBcm=centre,
        moments=inertia.Shift(centre).CalcRotationalInertia().CopyToFullMatrix3(), p_KB=p_KB, drawings=drawings,
        pads=tuple(_pad(inspector, i, foot.sites) for i in plant.GetCollisionGeometriesForBody(body)))


def _pad(inspector: SceneGraphInspector, shape: GeometryId, sites: ContactSites) -> Pad:
    """The sphere of a collision shape, whose name ends in the number of its site."""
    name, sphere = inspector.GetName(shape).split("::")[-1], inspector.GetShape(shape)
    i, properties = int(name.rsplit("_", 1)[-1]), inspector.GetProximityProperties(shape)
    return Pad(
        name=name, p_BS=inspector.GetPoseInFrame(shape).translation(), radius=sphere.radius(),
        stiffness=properties.GetProperty("material", "point_contact_stiffness"),
        dissipation=properties.GetProperty("material", "hunt_crossley_dissipation"),
        friction=properties.GetProperty("material", "coulomb_friction"),
        foam_stiffness=float(sites.stiffness[i]), exponent=float(sites.exponent[i]),
        foam_damping=float(sites.damping[i]))
