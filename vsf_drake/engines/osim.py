"""The foot as a model of OpenSim, whose text is in `engines/templates`."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from vsf_drake.engines.written import written
from vsf_drake.laws.contact_laws import FITTED_LAW
from vsf_drake.model.parameters import GRAVITY, FootParameters
from vsf_drake.plants.contact_geometry import MATCHED_DEPTH_M, dissipation
from vsf_drake.plants.foot_visuals import LEAST_RADIUS_M
from vsf_drake.plants.foot_wiring import DEPTH_WIDTH_M, RATE_WIDTH_M_PER_S

FAR_M = 1e6
"""Depth of the point below the ground from which a sphere is pushed (m): x (m) travelled over the
ground leaves the sphere x^2 / (2 FAR_M) too high, 0.05 mm after 10 m."""
# U is OpenSim's axes (y up), K the keel frame's, in both x is forward
R_UK = RotationMatrix(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]))


def foot_osim(parameters: FootParameters, *, fulcrum_m: float, law: str = FITTED_LAW) -> str:
    """The rigid foot with the springs in its keel and its support at `fulcrum_m` (m from A) as the
    text of an OpenSim 4 model (.osim), named vsf, in OpenSim's axes: x forward, y up, z right.

    Bodies and hinges are named as by `add_foot`. The mount M stands on a planar joint over the
    ground, which is the plane y = 0. Each sphere's normal force is an expression; friction and a
    fulcrum that moves are not in the file.

    Args:
        law: of the spheres, one of CONTACT_LAWS; InputError for another.
    """
    return written(
        "foot.osim.j2",
        parameters,
        fulcrum_m,
        law=law,
        far_m=FAR_M,
        gravity=GRAVITY,
        angles=_angles,
        dissipation=dissipation,
        matched_depth=MATCHED_DEPTH_M,
        depth_width=DEPTH_WIDTH_M,
        rate_width=RATE_WIDTH_M_PER_S,
        least_radius=LEAST_RADIUS_M,
    )


def _angles(X_BG: RigidTransform) -> np.ndarray:
    """(3,) rad about OpenSim's axes x, y, z one after the other, each turned by those before."""
    R = R_UK @ X_BG.rotation() @ R_UK.inverse()
    return -RollPitchYaw(R.inverse()).vector()
