"""Points fixed to bodies, all at once: their kinematics, and their forces summed by body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

# (a_i b_j) flattened row by row, times this, is a × b: faster for small N than np.cross or components
_CROSS = np.zeros((9, 3))
_CROSS[[5, 6, 1], [0, 1, 2]] = 1.0
_CROSS[[7, 2, 3], [0, 1, 2]] = -1.0


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a × b of (N, 3) arrays, or of (3,) arrays."""
    return (a[..., :, None] * b[..., None, :]).reshape(*a.shape[:-1], 9) @ _CROSS


class Sites:
    """N sites S, the i-th fixed to body B = body_indices[i].

    Forces on the sites of one body are summed to one spatial force at the body's origin, which is statically the same
    and costs less to hand over.
    """

    def __init__(self, body_indices: Sequence[int]) -> None:
        bodies, self._row = np.unique([int(index) for index in body_indices], return_inverse=True)
        self._bodies = [int(body) for body in bodies]
        self._sum = (np.arange(len(bodies))[:, None] == self._row).astype(float)

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

    def spatial_forces(self, p_BoQ_W: np.ndarray, f_Q_W: np.ndarray) -> list[tuple[int, np.ndarray]]:
        """Each body with the (6,) moment and force at its origin of forces `f_Q_W` (N, 3) at the sites' points Q; (N,)
        stands for forces along +z_W."""
        if f_Q_W.ndim == 1:
            f_Q_W = f_Q_W[:, None] * np.array([0.0, 0.0, 1.0])
        F_Bo_W = self._sum @ np.concatenate((cross(p_BoQ_W, f_Q_W), f_Q_W), axis=1)
        return list(zip(self._bodies, F_Bo_W, strict=True))
