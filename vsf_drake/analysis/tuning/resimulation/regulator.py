"""Linear-quadratic regulators of steps that change with time (Bryson & Ho 1975, Applied Optimal Control, ch. 2 and 5).

    x' = A_k x + B_k u,        minimise sum x^T Q x + u^T R u,        u = -K_k x

by the Riccati recursion backward over the steps; a period is gone over until the gains repeat.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.resimulation.trajectory import FEET
from vsf_drake.errors import FitError, InputError
from vsf_drake.motion.events import THRESHOLD_N

MOST_PERIODS = 50
REPEATS_WITHIN = 1e-6
"""Relative change of the cost-to-go from one period to the next at which the gains count as periodic."""


@dataclass(frozen=True, kw_only=True)
class RegulatorWeights:
    """Deviations and torques that weigh alike (Bryson's rule: each is divided by its largest acceptable value).

    They are choices. With a torque of 20 N m a stride of the embedded subject recovers from a push of 0.2 m/s; with
    40 N m it follows a tracked stride more closely (1.9 against 2.9 % of body weight), but does not recover from 0.1.

    Attributes:
        tilt_deg, forward_m, up_m: of the pelvis. joint_deg: of the five joints. tilt_deg_per_s, pelvis_m_per_s,
            joint_deg_per_s: of their rates. torque_nm: of the feedback in each joint.
        hand_n, hand_nm: of the force and the moment of a hand at the pelvis, where one is allowed.
    """

    tilt_deg: float = 5.0
    forward_m: float = 0.1
    up_m: float = 0.05
    joint_deg: float = 10.0
    tilt_deg_per_s: float = 60.0
    pelvis_m_per_s: float = 0.3
    joint_deg_per_s: float = 200.0
    torque_nm: float = 20.0
    hand_n: float = 20.0
    hand_nm: float = 10.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < math.inf:
                raise InputError(f"{value!r} is not usable", where=name, right="It must be a number above 0")

    @property
    def state(self) -> np.ndarray:
        """(16,) acceptable deviations of positions, then velocities, in the order of the sagittal coordinates."""
        q = [math.radians(self.tilt_deg), self.forward_m, self.up_m, *[math.radians(self.joint_deg)] * 5]
        v = [math.radians(self.tilt_deg_per_s), *[self.pelvis_m_per_s] * 2, *[math.radians(self.joint_deg_per_s)] * 5]
        return np.array([*q, *v])

    @property
    def force(self) -> np.ndarray:
        """(8,) of what acts on the coordinates, a hand's first."""
        return np.array([self.hand_nm, self.hand_n, self.hand_n, *[self.torque_nm] * 5])


def regulator(
    A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, *, periodic: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Gains K (N, m, n) and the cost-to-go (n, n) at the first step.

    Args:
        A: (N, n, n). B: (N, n, m). Q: (n, n), R: (m, m), the same at every step.
        periodic: whether the last step is followed by the first; else by nothing, at a cost of Q.

    Raises:
        FitError: no feedback keeps the cost of a periodic system finite, or it does not settle.
    """
    P = Q.copy()
    for _ in range(MOST_PERIODS if periodic else 1):
        before = P
        K, P = _sweep(A, B, Q, R, P)
        if not np.isfinite(P).all():
            raise FitError("no feedback stabilises the linearised stride: its cost grows without bound")
        if periodic and np.abs(P - before).max() <= REPEATS_WITHIN * np.abs(P).max():
            return K, P
    if periodic:
        raise FitError(f"the feedback's gains still change after {MOST_PERIODS} periods: the stride is hardly "
                       "controllable")
    return K, P


def _sweep(
    A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, P: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    K = np.zeros((len(A), B.shape[2], A.shape[1]))
    for k in range(len(A) - 1, -1, -1):
        PA, PB = P @ A[k], P @ B[k]
        K[k] = np.linalg.solve(R + B[k].T @ PB, B[k].T @ PA)
        P = Q + A[k].T @ (PA - PB @ K[k])
        P = 0.5 * (P + P.T)
    return K, P


def multiplier(A: np.ndarray) -> float:
    """Largest magnitude among the eigenvalues of the product of the steps A (N, n, n), the first one acting first."""
    product = np.eye(A.shape[1])
    for step in A:
        product = step @ product
    return float(np.abs(np.linalg.eigvals(product)).max())


# How far the ground reaction of a re-simulation is from that of the solution, at the solution's instants.


STRIDE, STANCE = "stride", "stance"


@dataclass(frozen=True)
class ForceDifference:
    """Root mean square difference over time, in percent of body weight.

    Attributes:
        foot: "prosthetic" or "intact".
        over: "stride", all instants that count, or "stance", those of them where either carries the foot (20 N).
        filtered: whether the re-simulation was low-passed at 40 Hz before; the solution is never filtered, because its
            instants are too far apart for that.
        fore_aft, vertical: of the components. resultant: of the length of the force. NaN without an instant.
    """

    foot: str
    over: str
    filtered: bool
    fore_aft: float
    vertical: float
    resultant: float


def force_differences(
    time_s: np.ndarray, solution: Mapping[str, np.ndarray], resimulated: Mapping[str, np.ndarray],
    counted: np.ndarray, *, filtered: bool, body_weight_n: float
) -> tuple[ForceDifference, ...]:
    """Both feet, over the stride and over stance.

    Args:
        time_s: (n,) s. solution, resimulated: by foot, (n, 2) N. counted: (n,) bool, the instants that count.
    """
    weights = np.gradient(time_s)
    weights[[0, -1]] *= 0.5
    found = []
    for foot in FEET:
        ours, theirs = (np.asarray(force, dtype=float)[counted] / body_weight_n for force in
                        (resimulated[foot], solution[foot]))
        series = [ours[:, 0] - theirs[:, 0], ours[:, 1] - theirs[:, 1],
                  np.linalg.norm(ours, axis=1) - np.linalg.norm(theirs, axis=1)]
        loaded = np.maximum(ours[:, 1], theirs[:, 1]) > THRESHOLD_N / body_weight_n
        for over, rows in ((STRIDE, np.ones(len(ours), dtype=bool)), (STANCE, loaded)):
            w = weights[counted][rows]
            fore_aft, vertical, resultant = (100.0 * weighted_rms(values[rows], w) for values in series)
            found.append(ForceDifference(foot, over, filtered, fore_aft, vertical, resultant))
    return tuple(found)


def weighted_rms(values: np.ndarray, weights: np.ndarray) -> float:
    """Root of the weighted mean of squares; NaN without a value."""
    return float(np.sqrt(np.sum(weights * values**2) / np.sum(weights))) if len(values) else float("nan")
