"""Drake's own contact under the foot: spheres with point contact, or pads with hydroelastic
contact.

    drake_point    each contact sphere a collision sphere, as stiff as its zone
    hydroelastic   each contact sphere a compliant square pad, its sole at the sphere's bottom, on
                   rigid ground

Both know linear stiffness only, and damping after Hunt and Crossley, f = k x (1 + d x'): what a
zone's own law becomes in them is matched at REFERENCE_LOAD_N and MATCHED_DEPTH_M. Friction is
Coulomb's with the foot's two coefficients; a plant with a time step takes the kinetic one alone.

Why a pad is a mesh and not a Box: the pressure in a compliant box is E e / h, e the distance to the
nearest face and h half the least dimension; boxes of the length of a keel piece lose half of their
load at the depth to which 600 N press the foam. In a mesh the pressure is linear between the
vertices, 0 at the surface and E deepest within. Here four vertices are within, RIM_M below the top
and inside the sides, so that the pressure grows with the distance from the sole alone: p' A D, but
for the rim.

Drake 1.51 gives no gradients through contact with materials of their own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake import geometry
from pydrake.common import MemoryFile
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import ContactModel, CoulombFriction, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.base.errors import InputError, require
from vsf_drake.laws.hunt_crossley import matched_dissipation
from vsf_drake.model.ground import Ground, GroundPatch, check_ground, ground_arrays
from vsf_drake.model.model_file import secant_stiffness
from vsf_drake.model.parameters import FootParameters, FrictionParameters
from vsf_drake.plants.foot_handles import ContactSites, FootHandles

DRAKE_CONTACTS = ("drake_point", "hydroelastic")
REFERENCE_LOAD_N = 50.0
"""Load on one sphere at which its stiffness is matched: 400 N, the middle of what the bench
measures, on the eight spheres of its patch (a choice)."""
MATCHED_DEPTH_M = 6e-3
"""Depth of the stroke in which damping after Hunt and Crossley loses what the paper's law loses;
about that of the nominal foot's spheres under body weight (a choice)."""
PRESSURE_PER_DEPTH = 8e7
"""Pa/m in every pad: those of the nominal foot, 10 mm and 16 mm wide, do not overlap then (a
choice)."""
PAD_THICKNESS_M, RIM_M = 0.03, 2e-5
"""Of a pad, upwards: more than foam is pressed in; how far its inner vertices are from its surface
(choices)."""
RIGID_N_PER_M = 1e12
"""Point-contact stiffness of rigid ground; in series with a foam's it changes that by less than
1e-6."""
GROUND_THICKNESS_M = 1.0


def dissipation(
    stiffness: np.ndarray, exponent: np.ndarray, damping: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(N,) s/m of the Hunt-Crossley law that loses what the paper's law loses in a stroke to
    MATCHED_DEPTH_M, and its derivatives by the three constants of that."""
    return matched_dissipation(
        stiffness=stiffness, exponent=exponent, damping=damping, depth=MATCHED_DEPTH_M
    )


def point_law(sites: ContactSites) -> tuple[np.ndarray, np.ndarray]:
    """What Drake's point contact, f = k x (1 + d x'), makes of N spheres' laws: k (N,) N/m, the
    secant stiffness under REFERENCE_LOAD_N, and d (N,) s/m, by `dissipation`."""
    rows = zip(sites.stiffness, sites.exponent, strict=True)
    k = np.array(
        [secant_stiffness(stiffness, exponent, REFERENCE_LOAD_N) for stiffness, exponent in rows]
    )
    return k, dissipation(k, np.ones_like(k), sites.damping)[0]


def pad_widths(sites: ContactSites) -> np.ndarray:
    """(N,) m, side of the square pad that with PRESSURE_PER_DEPTH is as stiff as its sphere."""
    return np.sqrt(point_law(sites)[0] / PRESSURE_PER_DEPTH)


def add_contact_geometry(plant: MultibodyPlant, foot: FootHandles, contact: str) -> None:
    """Gives the foot its collision geometry for one of DRAKE_CONTACTS, before Finalize; see
    `check_scene_graph`."""
    sites = foot.sites
    friction = foot.parameters.friction
    mu = CoulombFriction(friction.mu_static, min(friction.mu_kinetic, friction.mu_static))
    stiffness, rate = point_law(sites)
    for i in np.flatnonzero(stiffness):
        properties = geometry.ProximityProperties()
        body = plant.get_body(sites.body_indices[i])
        shape: geometry.Shape
        if contact == "drake_point":
            geometry.AddContactMaterial(rate[i], stiffness[i], mu, properties)
            name = f"foam_{i}"
            shape = geometry.Sphere(sites.radius[i])
            place = sites.p_BS[i]
        else:
            geometry.AddCompliantHydroelasticProperties(
                PAD_THICKNESS_M, PRESSURE_PER_DEPTH * (PAD_THICKNESS_M - RIM_M), properties
            )
            geometry.AddContactMaterial(rate[i], None, mu, properties)
            name = f"pad_{i}"
            shape = _pad(pad_widths(sites)[i])
            place = sites.p_BS[i] - [0.0, 0.0, sites.radius[i]]
        plant.RegisterCollisionGeometry(body, RigidTransform(place), shape, name, properties)


def own_geometry(plant: MultibodyPlant, foot: FootHandles) -> list[geometry.GeometryId]:
    """The collision geometries on the foot's frame and keel."""
    return [
        geometry
        for body in (foot.frame, *foot.keel)
        for geometry in plant.GetCollisionGeometriesForBody(body)
    ]


def part_own_geometry(builder: DiagramBuilder, plant: MultibodyPlant, foot: FootHandles) -> None:
    """Keeps parts of the foot from colliding with each other, in the SceneGraph that `plant`
    asks."""
    query = plant.get_geometry_query_input_port().get_index()
    asked = [
        source
        for (system, index), (source, _) in builder.connection_map().items()
        if system is plant and index == query
    ]
    require(
        asked,
        "its geometry query is not connected",
        "plant",
        "Make plant and SceneGraph with AddMultibodyPlantSceneGraph(builder, time_step)",
    )
    asked[0].collision_filter_manager().Apply(
        geometry.CollisionFilterDeclaration().ExcludeWithin(
            geometry.GeometrySet(own_geometry(plant, foot))
        )
    )


def check_scene_graph(plant: MultibodyPlant, contact: str) -> None:
    """Raises InputError unless `contact` is one of Drake's that `plant` can still be given geometry
    for."""
    require(
        contact in DRAKE_CONTACTS,
        f"{contact!r} takes no geometry",
        "contact",
        f"One of {', '.join(DRAKE_CONTACTS)}",
    )
    require(
        plant.geometry_source_is_registered(),
        f"contact {contact} needs geometry, and the plant has no SceneGraph",
        "plant",
        "Make both with AddMultibodyPlantSceneGraph(builder, time_step)",
    )
    require(
        not plant.is_finalized(),
        "the plant is finalized and takes no more geometry",
        "plant",
        "Call this before plant.Finalize()",
    )
    require(
        contact != "hydroelastic" or plant.get_contact_model() != ContactModel.kPoint,
        "the plant's contact model is kPoint, which knows no pads",
        "plant",
        "Leave it at kHydroelasticWithFallback, or take contact drake_point",
    )


def _pad(width: float) -> geometry.Mesh:
    """Square prism of tetrahedra over z = 0: four corners below, four within, four above."""
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    layers = (
        (0.5 * width, 0.0),
        (0.5 * width - RIM_M, PAD_THICKNESS_M - RIM_M),
        (0.5 * width, PAD_THICKNESS_M),
    )
    vertices = np.array([[*(half * corner), z] for half, z in layers for corner in corners])
    below, within, above = (range(4 * i, 4 * i + 4) for i in range(3))
    prisms = [
        ([low[i] for i in triangle], [high[i] for i in triangle])
        for low, high in ((below, within), (within, above))
        for triangle in ((0, 1, 2), (0, 2, 3))
    ]
    prisms += [
        ([below[i], within[i], above[i]], [below[j], within[j], above[j]])
        for i, j in ((0, 1), (1, 2), (2, 3), (0, 3))
    ]
    # A face's diagonal runs from the earlier column's lower vertex to the later one's upper, seen
    # from either side.
    cells = [
        cell
        for (a, b, c), (d, e, f) in prisms
        for cell in ((a, b, c, f), (a, b, e, f), (a, d, e, f))
    ]
    cells = [
        cell
        if np.linalg.det(vertices[list(cell[1:])] - vertices[cell[0]]) > 0.0
        else (*cell[:2], *cell[:1:-1])
        for cell in cells
    ]
    text = "\n".join(
        (
            "# vtk DataFile Version 3.0",
            "pad",
            "ASCII",
            "DATASET UNSTRUCTURED_GRID",
            f"POINTS {len(vertices)} double",
            *(" ".join(f"{value:.17g}" for value in vertex) for vertex in vertices),
            f"CELLS {len(cells)} {5 * len(cells)}",
            *(" ".join(map(str, (4, *cell))) for cell in cells),
            f"CELL_TYPES {len(cells)}",
            *(["10"] * len(cells)),
            "",
        )
    )
    file = MemoryFile(contents=text, extension=".vtk", filename_hint="pad.vtk")
    return geometry.Mesh(geometry.InMemoryMesh(mesh_file=file))


def add_ground_geometry(
    plant: MultibodyPlant,
    ground: Ground | None = None,
    *,
    foot: FootParameters | None = None,
    contact: str = "drake_point",
) -> None:
    """Makes the patches of `ground` collision geometry of the world, for DRAKE_CONTACTS, before
    Finalize: each a rigid box of GROUND_THICKNESS_M below its plane, so Drake adds up the forces
    where a foot touches two of them.

    Args:
        ground: by default the plane z = 0.
        foot: of the feet that will stand on it, by default the nominal one, for its friction. A
            patch with coefficients of its own gets what together with the foot's gives them, as
            Drake takes the harmonic mean.
        contact: of the feet; "hydroelastic" where one of them has it: pads feel no patch's
            stiffness, which is refused. A belt's velocity is refused for both.
    """
    ground = check_ground(ground or Ground())
    foot = foot or FootParameters()
    check_scene_graph(plant, contact)
    _check_apart(ground.patches)
    arrays = ground_arrays(
        ground, mu_static=foot.friction.mu_static, mu_kinetic=foot.friction.mu_kinetic
    )
    for i, patch in enumerate(ground.patches):
        require(
            patch.stiffness_n_per_m is None or contact != "hydroelastic",
            "hydroelastic pads take the ground for rigid",
            f"patches[{i}].stiffness_n_per_m",
            "Leave it out, or take contact drake_point",
        )
        require(
            patch.belt_m_per_s == 0.0,
            f"a belt, here of {patch.belt_m_per_s:g} m/s, is for our own contact laws",
            f"patches[{i}].belt_m_per_s",
            "Take another contact, or let the foot meet a body that moves, by wire_foot(..., "
            "own_ground=True)",
        )
        properties = geometry.ProximityProperties()
        geometry.AddRigidHydroelasticProperties(1.0, properties)
        friction = _ground_friction(
            arrays["mu_static"][i], arrays["mu_kinetic"][i], foot.friction, i
        )
        geometry.AddContactMaterial(
            0.0, patch.stiffness_n_per_m or RIGID_N_PER_M, friction, properties
        )
        name = f"ground_{i}"  # whatever its patch is called, so that a second ground is told
        try:
            plant.RegisterCollisionGeometry(
                plant.world_body(), *box_under(patch, GROUND_THICKNESS_M), name, properties
            )
        except RuntimeError as error:
            raise InputError(
                f"the plant has a ground already, its geometry {name}",
                where=f"patches[{i}]",
                right="Call add_ground_geometry once for all feet, with every patch",
            ) from error


def _ground_friction(
    static: float, kinetic: float, foot: FrictionParameters, row: int
) -> CoulombFriction:
    """What together with the foot's makes a patch's coefficients: Drake takes the harmonic mean."""
    ground = []
    for name, mu, sole in (
        ("mu_static", static, foot.mu_static),
        ("mu_kinetic", min(kinetic, static), foot.mu_kinetic),
    ):
        require(
            mu == 0.0 or mu < 2.0 * sole,
            f"{mu:g} is twice the foot's {sole:g} or more; Drake takes the harmonic mean",
            f"patches[{row}].{name}",
            "Raise the foot's own coefficient",
        )
        # of mu = 2 sole ground / (sole + ground)
        ground.append(mu * sole / (2.0 * sole - mu) if mu > 0.0 else 0.0)
    return CoulombFriction(max(ground), ground[1])


def box_under(patch: GroundPatch, thickness_m: float) -> tuple[RigidTransform, geometry.Box]:
    """Pose in W and shape of the box whose top is the patch; exact bounds where it slopes one way
    only."""
    slope, bank = np.tan(np.radians([patch.slope_deg, patch.bank_deg]))
    x = 0.5 * (patch.from_x_m + patch.to_x_m)
    y = 0.5 * (patch.from_y_m + patch.to_y_m)
    top = np.array([x, y, patch.height_m + slope * (x - patch.reference_x_m) + bank * y])
    along = np.array([1.0, 0.0, slope]) / np.hypot(1.0, slope)
    normal = np.array([-slope, -bank, 1.0]) / np.sqrt(1.0 + slope**2 + bank**2)
    R_WG = RotationMatrix(np.column_stack((along, np.cross(normal, along), normal)))
    length = patch.to_x_m - patch.from_x_m
    width = patch.to_y_m - patch.from_y_m
    size = (length * np.hypot(1.0, slope), width * np.hypot(1.0, bank))
    return RigidTransform(R_WG, top - 0.5 * thickness_m * normal), geometry.Box(*size, thickness_m)


def _check_apart(patches: Sequence[GroundPatch]) -> None:
    planes = [
        (p.height_m, p.slope_deg, p.bank_deg, p.reference_x_m if p.slope_deg else 0.0)
        for p in patches
    ]
    for i, a in enumerate(patches):
        for j, b in enumerate(patches[:i]):
            over = min(a.to_x_m, b.to_x_m) > max(a.from_x_m, b.from_x_m) and min(
                a.to_y_m, b.to_y_m
            ) > max(a.from_y_m, b.from_y_m)
            require(
                not over or planes[i] != planes[j],
                f"lies in the plane of patches[{j}] and over it, and Drake "
                "would add up both forces",
                f"patches[{i}]",
                "Give them bounds that do not overlap",
            )
