"""Points fixed to bodies, all at once: their kinematics, and their forces packed for a MultibodyPlant."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform_
from pydrake.multibody.math import SpatialForce_, SpatialVelocity_
from pydrake.multibody.plant import ExternallyAppliedSpatialForce_
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import InputPort


def declare_body_poses(system: Any, T: type) -> InputPort:
    """Declares the input port that takes MultibodyPlant's `body_poses`."""
    return system.DeclareAbstractInputPort("body_poses", AbstractValue.Make([RigidTransform_[T]()]))


def declare_kinematics(system: Any, T: type) -> tuple[InputPort, InputPort]:
    """Declares the input ports that take MultibodyPlant's `body_poses` and `body_spatial_velocities`."""
    velocities = AbstractValue.Make([SpatialVelocity_[T]()])
    return declare_body_poses(system, T), system.DeclareAbstractInputPort("body_spatial_velocities", velocities)


# (a_i b_j) flattened row by row, times this, is a × b: faster for small N than np.cross or components
_CROSS = np.zeros((9, 3))
_CROSS[[5, 6, 1], [0, 1, 2]] = 1.0
_CROSS[[7, 2, 3], [0, 1, 2]] = -1.0


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a × b of (N, 3) arrays, or of (3,) arrays."""
    return (a[..., :, None] * b[..., None, :]).reshape(*a.shape[:-1], 9) @ _CROSS


def level_reaction(F: np.ndarray, M: np.ndarray, height: Any) -> dict[str, np.ndarray]:
    """Force, centre of pressure (m) in the plane z = height, and free moment (1,), of F (N) and M (N m about Wo) in W.

    Without load both are zero: there is no centre of pressure.
    """
    if not F[2] > 0:
        return {"grf": F, "cop": 0.0 * F, "free_moment": 0.0 * F[2:]}
    cop_x, cop_y = (height * F[0] - M[1]) / F[2], (height * F[1] + M[0]) / F[2]
    return {"grf": F, "cop": np.array([cop_x, cop_y, height]),
            "free_moment": np.array([M[2] - (cop_x * F[1] - cop_y * F[0])])}


def scattered(values: np.ndarray, at: np.ndarray, count: int) -> np.ndarray:
    """(count,) generalized forces: `values` at the indices `at`, zero elsewhere."""
    force = np.zeros(count, dtype=values.dtype)
    force[at] = values
    return force


class ForcePacker:
    """Makes ExternallyAppliedSpatialForce objects at the origins of given bodies, for one scalar type T."""

    def __init__(self, bodies: Sequence[int], T: type) -> None:
        self._spatial_force, self._blanks = SpatialForce_[T], {}
        for body in bodies:
            blank = ExternallyAppliedSpatialForce_[T]()
            blank.body_index = BodyIndex(body)
            blank.p_BoBq_B = np.zeros(3)
            self._blanks[body] = blank

    def pack(self, body: int, F_Bo_W: np.ndarray) -> Any:
        """Spatial force F_Bo_W (6,), moment then force, at the origin of `body`."""
        applied = copy(self._blanks[body])
        applied.F_Bq_W = self._spatial_force(F_Bo_W)
        return applied


class Sites:
    """N sites S, the i-th fixed to body B = body_indices[i].

    Forces on the sites of one body are summed to one spatial force at the body's origin, which is
    statically the same and costs less to hand over.

    Args:
        body_indices: N body indices.
        T: float or AutoDiffXd.
    """

    def __init__(self, body_indices: Sequence[int], T: type) -> None:
        indices = np.array([int(index) for index in body_indices])
        bodies, self._row = np.unique(indices, return_inverse=True)
        self._bodies = [int(body) for body in bodies]
        self._sum = (np.arange(len(bodies))[:, None] == self._row).astype(float)
        self._packer = ForcePacker(self._bodies, T)

    def __len__(self) -> int:
        return len(self._row)

    def positions(self, poses: list, p_BS: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """p_WS and p_BoS_W, each (N, 3), from all `poses` of the plant and the sites' p_BS (N, 3)."""
        X_WB = np.array([poses[body].GetAsMatrix34() for body in self._bodies]).take(self._row, axis=0)
        p_BoS_W = (X_WB[:, :, :3] @ p_BS[:, :, None])[:, :, 0]
        return X_WB[:, :, 3] + p_BoS_W, p_BoS_W

    def velocities(self, spatial_velocities: list, p_BoS_W: np.ndarray) -> np.ndarray:
        """v_WS (N, 3) from all `spatial_velocities` of the plant."""
        V_WB = np.array([spatial_velocities[body].get_coeffs() for body in self._bodies]).take(self._row, axis=0)
        return V_WB[:, 3:] + cross(V_WB[:, :3], p_BoS_W)

    def spatial_forces(self, p_BoQ_W: np.ndarray, f_Q_W: np.ndarray) -> list:
        """One ExternallyAppliedSpatialForce per body from forces `f_Q_W` (N, 3) at the sites' points Q."""
        F_Bo_W = self._sum @ np.concatenate((cross(p_BoQ_W, f_Q_W), f_Q_W), axis=1)
        return [self._packer.pack(body, F) for body, F in zip(self._bodies, F_Bo_W, strict=True)]

    def upward_forces(self, p_BoQ_W: np.ndarray, size: np.ndarray) -> list:
        """`spatial_forces` of forces along +z_W of `size` (N,)."""
        return self.spatial_forces(p_BoQ_W, size[:, None] * np.array([0.0, 0.0, 1.0]))
