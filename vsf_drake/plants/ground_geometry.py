"""The ground as Drake's collision geometry, for feet with Drake's own contact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.geometry import AddContactMaterial, AddRigidHydroelasticProperties, Box, ProximityProperties
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant

from vsf_drake.errors import InputError
from vsf_drake.ground import Ground, GroundPatch, check_ground
from vsf_drake.parameters import FootParameters, FrictionParameters
from vsf_drake.plants.contact_geometry import DRAKE_CONTACTS, check_scene_graph

RIGID_N_PER_M = 1e12
"""Point-contact stiffness of rigid ground; in series with a foam's it changes that by less than 1e-6."""
GROUND_THICKNESS_M = 1.0


def add_ground_geometry(
    plant: MultibodyPlant, ground: Ground | None = None, *, foot: FootParameters | None = None,
    contact: str = "drake_point"
) -> None:
    """Makes the patches of `ground` collision geometry of the world, for DRAKE_CONTACTS, before Finalize.

    Each patch is a rigid box of GROUND_THICKNESS_M below its plane, so Drake adds up the forces where a foot touches
    two of them: at a seam, and over a lower patch that a foot reaches through the upper one.

    Args:
        ground: by default the plane z = 0.
        foot: of the feet that will stand on it, by default the nominal one, for its friction. A patch with
            coefficients of its own gets what together with the foot's gives them, as Drake takes the harmonic mean.
        contact: of the feet. Say "hydroelastic" where one of them has it: pads do not feel a patch's stiffness, which
            is refused then.

    Raises:
        InputError: see `check_ground`; the contact is none of Drake's; the plant has no SceneGraph, or a ground
            already; two patches lie in one plane over one another; a patch has a stiffness of its own under
            "hydroelastic"; a patch's friction cannot be had.
    """
    ground, foot = check_ground(ground or Ground()), foot or FootParameters()
    if contact not in DRAKE_CONTACTS:
        raise InputError(f"{contact!r} takes no geometry", where="contact", right=f"One of {', '.join(DRAKE_CONTACTS)}")
    check_scene_graph(plant, contact)
    _check_apart(ground.patches)
    for i, patch in enumerate(ground.patches):
        if patch.stiffness_n_per_m is not None and contact == "hydroelastic":
            raise InputError("hydroelastic pads take the ground for rigid",
                             where=f"patches[{i}].stiffness_n_per_m",
                             right="Leave it out, or take contact drake_point")
        properties = ProximityProperties()
        AddRigidHydroelasticProperties(1.0, properties)
        AddContactMaterial(0.0, patch.stiffness_n_per_m or RIGID_N_PER_M, _ground_friction(patch, foot.friction, i),
                           properties)
        name = f"ground_{i}"  # whatever its patch is called, so that a second ground is told
        try:
            plant.RegisterCollisionGeometry(plant.world_body(), *box_under(patch, GROUND_THICKNESS_M), name, properties)
        except RuntimeError as error:
            raise InputError(f"the plant has a ground already, its geometry {name}", where=f"patches[{i}]",
                             right="Call add_ground_geometry once for all feet, with every patch") from error


def _ground_friction(patch: GroundPatch, foot: FrictionParameters, row: int) -> CoulombFriction:
    wanted = [foot.mu_static if patch.mu_static is None else patch.mu_static,
              foot.mu_kinetic if patch.mu_kinetic is None else patch.mu_kinetic]
    wanted[1] = min(wanted)
    made = []
    for name, mu, own in zip(("mu_static", "mu_kinetic"), wanted, (foot.mu_static, foot.mu_kinetic), strict=True):
        if mu > 0.0 and 2.0 * own <= mu:
            raise InputError(f"{mu:g} is twice the foot's {own:g} or more; Drake takes the harmonic mean",
                             where=f"patches[{row}].{name}", right="Raise the foot's own coefficient")
        made.append(mu * own / (2.0 * own - mu) if mu > 0.0 else 0.0)
    return CoulombFriction(max(made), made[1])


def box_under(patch: GroundPatch, thickness_m: float) -> tuple[RigidTransform, Box]:
    """Pose in W and shape of the box whose top is the patch; exact bounds where it slopes one way only."""
    slope, bank = np.tan(np.radians([patch.slope_deg, patch.bank_deg]))
    x, y = 0.5 * (patch.from_x_m + patch.to_x_m), 0.5 * (patch.from_y_m + patch.to_y_m)
    top = np.array([x, y, patch.height_m + slope * (x - patch.reference_x_m) + bank * y])
    along = np.array([1.0, 0.0, slope]) / np.hypot(1.0, slope)
    normal = np.array([-slope, -bank, 1.0]) / np.sqrt(1.0 + slope**2 + bank**2)
    R_WG = RotationMatrix(np.column_stack((along, np.cross(normal, along), normal)))
    length, width = patch.to_x_m - patch.from_x_m, patch.to_y_m - patch.from_y_m
    size = (length * np.hypot(1.0, slope), width * np.hypot(1.0, bank))
    return RigidTransform(R_WG, top - 0.5 * thickness_m * normal), Box(*size, thickness_m)


def _check_apart(patches: Sequence[GroundPatch]) -> None:
    planes = [(p.height_m, p.slope_deg, p.bank_deg, p.reference_x_m if p.slope_deg else 0.0) for p in patches]
    for i, a in enumerate(patches):
        for j, b in enumerate(patches[:i]):
            over = (min(a.to_x_m, b.to_x_m) > max(a.from_x_m, b.from_x_m)
                    and min(a.to_y_m, b.to_y_m) > max(a.from_y_m, b.from_y_m))
            if over and planes[i] == planes[j]:
                raise InputError(f"lies in the plane of patches[{j}] and over it, and Drake would add up both forces",
                                 where=f"patches[{i}]", right="Give them bounds that do not overlap")
