"""Drake's own contact under the foot: spheres with point contact, or hydroelastic pads.

    drake_point    each contact sphere a collision sphere, as stiff as its zone
    hydroelastic   one compliant box under each piece of the foot that carries spheres

Both know linear stiffness only, and damping after Hunt and Crossley, f = k x (1 + d x'): what a zone's own law
becomes in them is matched at REFERENCE_LOAD_N and MATCHED_DEPTH_M. Friction is Coulomb's with the foot's two
coefficients; a plant with a time step takes the kinetic one alone. The ground: `ground_geometry`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    Box,
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import ContactModel, CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.errors import InputError
from vsf_drake.laws.hunt_crossley import matched_dissipation
from vsf_drake.model_file import secant_stiffness
from vsf_drake.parameters import FootParameters

if TYPE_CHECKING:
    from vsf_drake.plants.foot import ContactSites, FootHandles

DRAKE_CONTACTS = ("drake_point", "hydroelastic")
REFERENCE_LOAD_N = 50.0
"""Load on one sphere at which its stiffness is matched: 400 N, the middle of what the bench measures, on the eight
spheres of its patch (a choice)."""
MATCHED_DEPTH_M = 6e-3
"""Depth of the stroke in which damping after Hunt and Crossley loses what the paper's law loses; about that of the
nominal foot's spheres under body weight (a choice)."""
DEEPEST_SHARE = 0.25
"""Of a pad's least dimension, beyond which its modulus is not matched even if the load is less (a choice)."""


@dataclass(frozen=True)
class Pad:
    """One compliant box: carrying body, its centre there (m), size (m), modulus (Pa), dissipation (s/m).

    A compliant box has the pressure modulus · e / h, e the distance to its nearest face, h half its least dimension.
    Pressed by a plane to depth D <= h it bears modulus / h · (a b D - (a + b) D² + 4/3 D³), a and b its length and
    width: the edges, within D of a side, bear less. So it is softer at larger depth, and matched at one.
    """

    body: RigidBody
    centre: np.ndarray
    size: np.ndarray
    modulus: float
    dissipation: float

    def force(self, depth: float) -> float:
        """Load (N) of a rigid plane at `depth` (m, up to half the least dimension)."""
        return self.modulus * _pad_shape(self.size, depth)


def dissipation(sites: ContactSites) -> np.ndarray:
    """(N,) s/m of the Hunt-Crossley law that loses what the paper's law loses in a stroke to MATCHED_DEPTH_M."""
    rows = zip(sites.stiffness, sites.exponent, sites.damping, strict=True)
    return np.array([matched_dissipation(stiffness=k, exponent=n, damping=b, depth=MATCHED_DEPTH_M)
                     for k, n, b in rows])


def point_law(sites: ContactSites) -> tuple[np.ndarray, np.ndarray]:
    """What Drake's point contact, f = k x (1 + d x'), makes of N spheres' laws: k (N,) N/m and d (N,) s/m.

    k is the secant stiffness**(1/n) F**(1 - 1/n) under REFERENCE_LOAD_N, which is the zone's own for exponent 1; d
    loses in a half-sine stroke to MATCHED_DEPTH_M what the zone's damping loses (`laws.hunt_crossley`).
    """
    rows = zip(sites.stiffness, sites.exponent, strict=True)
    k = np.array([secant_stiffness(stiffness, exponent, REFERENCE_LOAD_N) for stiffness, exponent in rows])
    return k, dissipation(replace(sites, stiffness=k, exponent=np.ones_like(k)))


def hydroelastic_pads(foot: FootHandles, plant: MultibodyPlant) -> list[Pad]:
    """The pads under `foot`: as long as their keel piece, as wide as the keel, as thick as the foam, down to the sole.

    That of the heel block reaches from the end of the foot as far ahead of its spheres as behind them. A pad bears at
    its matched depth what its spheres bear there by their own laws; that depth is the mean one of its spheres under
    REFERENCE_LOAD_N each, or DEEPEST_SHARE of the pad's least dimension if that is less.
    """
    p, sites = foot.parameters, foot.sites
    ends = np.append(foot.keel_starts[1:], sum(p.keel.element_lengths_m)) - foot.keel_starts
    spans = {int(body.index()): (0.0, float(end)) for body, end in zip(foot.keel, ends, strict=True)}
    secant, _ = point_law(sites)
    pads: list[Pad] = []
    for index in sorted({int(body) for body in sites.body_indices}):
        rows = np.array([i for i, body in enumerate(sites.body_indices) if body == index])
        if not np.any(sites.stiffness[rows]):
            continue
        bottom = float(np.mean(sites.p_BS[rows, 2] - sites.radius[rows]))
        behind, ahead = spans.get(index) or _heel_span(p, float(np.mean(sites.p_BS[rows, 0])))
        if index == int(foot.keel[1].index()):
            behind = max(behind, p.fulcrum.rearmost_m - foot.keel_starts[1])
        size = np.array([ahead - behind, p.keel.width_m, p.foam_thickness_m])
        depth = min(REFERENCE_LOAD_N / float(np.mean(secant[rows])), DEEPEST_SHARE * float(size.min()))
        load = sites.stiffness[rows] * depth ** sites.exponent[rows]
        damping = float(np.sum(sites.damping[rows]))
        pads.append(Pad(
            body=plant.get_body(BodyIndex(index)), size=size, modulus=float(load.sum()) / _pad_shape(size, depth),
            centre=np.array([0.5 * (behind + ahead), 0.0, bottom + 0.5 * size[2]]),
            dissipation=matched_dissipation(
                stiffness=float(load.sum()) / depth, exponent=1.0, damping=damping, depth=MATCHED_DEPTH_M)))
    return pads


def add_contact_geometry(plant: MultibodyPlant, foot: FootHandles, contact: str) -> None:
    """Gives the foot its collision geometry for one of DRAKE_CONTACTS, before Finalize.

    Raises:
        InputError: there is no such contact, the plant has no SceneGraph, or it is told to treat hydroelastic
            bodies as points.
    """
    if contact not in DRAKE_CONTACTS:
        raise InputError(f"{contact!r} is not a contact of Drake's", where="contact",
                         right=f"Known are {', '.join(DRAKE_CONTACTS)}")
    check_scene_graph(plant, contact)
    friction = foot.parameters.friction
    mu = CoulombFriction(friction.mu_static, min(friction.mu_kinetic, friction.mu_static))
    if contact == "drake_point":
        sites = foot.sites
        stiffness, rate = point_law(sites)
        for i in np.flatnonzero(stiffness):
            properties = ProximityProperties()
            AddContactMaterial(rate[i], stiffness[i], mu, properties)
            plant.RegisterCollisionGeometry(plant.get_body(sites.body_indices[i]), RigidTransform(sites.p_BS[i]),
                                            Sphere(sites.radius[i]), f"foam_{i}", properties)
    else:
        for pad in hydroelastic_pads(foot, plant):
            properties = ProximityProperties()
            AddCompliantHydroelasticProperties(float(pad.size.min()), pad.modulus, properties)
            AddContactMaterial(pad.dissipation, None, mu, properties)
            plant.RegisterCollisionGeometry(pad.body, RigidTransform(pad.centre), Box(*pad.size), "pad", properties)


def own_geometry(plant: MultibodyPlant, foot: FootHandles) -> list[GeometryId]:
    """The collision geometries on the foot's frame and keel."""
    return [geometry for body in (foot.frame, *foot.keel) for geometry in plant.GetCollisionGeometriesForBody(body)]


def part_own_geometry(builder: DiagramBuilder, plant: MultibodyPlant, foot: FootHandles) -> None:
    """Keeps parts of the foot from colliding with each other, in the SceneGraph that `plant` asks.

    Raises:
        InputError: the plant's geometry query is not connected.
    """
    port = plant.get_geometry_query_input_port()
    for (system, index), (source, _) in builder.connection_map().items():
        if system is plant and index == port.get_index():
            source.collision_filter_manager().Apply(
                CollisionFilterDeclaration().ExcludeWithin(GeometrySet(own_geometry(plant, foot))))
            return
    raise InputError("its geometry query is not connected", where="plant",
                     right="Make plant and SceneGraph with AddMultibodyPlantSceneGraph(builder, time_step)")


def check_scene_graph(plant: MultibodyPlant, contact: str) -> None:
    """Raises InputError unless `plant` can still be given geometry for `contact`."""
    if not plant.geometry_source_is_registered():
        raise InputError(f"contact {contact} needs geometry, and the plant has no SceneGraph", where="plant",
                         right="Make both with AddMultibodyPlantSceneGraph(builder, time_step)")
    if plant.is_finalized():
        raise InputError("the plant is finalized and takes no more geometry", where="plant",
                         right="Call this before plant.Finalize()")
    if contact == "hydroelastic" and plant.get_contact_model() == ContactModel.kPoint:
        raise InputError("the plant's contact model is kPoint, which knows no pads", where="plant",
                         right="Leave it at kHydroelasticWithFallback, or take contact drake_point")


def _pad_shape(size: np.ndarray, depth: float) -> float:
    """Load over modulus (m²) of a box of `size` pressed by a plane to `depth`."""
    a, b, half = size[0], size[1], 0.5 * size.min()
    return float((a * b * depth - (a + b) * depth**2 + 4.0 / 3.0 * depth**3) / half)


def _heel_span(p: FootParameters, mean_x: float) -> tuple[float, float]:
    behind = sum(p.keel.element_lengths_m) - p.length_m
    return behind, max(2.0 * mean_x - behind, behind + 1e-3)
