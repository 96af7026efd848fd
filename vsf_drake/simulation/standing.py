"""The person standing still: angles held at the anatomical neutral, the pelvis free in height."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import GRAVITY, ModelParameters, Subject
from vsf_drake.simulation.walk import DEFAULT_STEP_S, Walk, Walker


@dataclass(frozen=True)
class Standing:
    """What the ground carries after `time_s[-1]` s of standing.

    Attributes:
        time_s: (n,) s. vertical_n: (n,) N on both feet. weight_n: mass times 9.81 m/s^2.
        prosthetic_share: share of the load under the prosthetic foot at the end.
        drift_m: how far the pelvis moved in the last half of the time.
    """

    time_s: np.ndarray
    vertical_n: np.ndarray
    weight_n: float
    prosthetic_share: float
    drift_m: float
    walk: Walk


def simulate_standing(
    subject: Subject, model: ModelParameters, *, fulcrum_m: float = 0.108, duration_s: float = 2.0,
    step_s: float = DEFAULT_STEP_S
) -> Standing:
    """Lets the person settle on both feet.

    Raises:
        InputError, SimulationError: see `Walker`.
    """
    walker = Walker(subject, model, free=("pelvis_ty",))
    names = walker.gait.prescribed
    moments = np.linspace(0.0, duration_s, 8)
    still = CoordinateTrajectory(moments, np.zeros((len(moments), len(names))), names)
    body = walker.gait.person.body
    walk = walker.walk(still, fulcrum_m=fulcrum_m, start_s=0.0, end_s=duration_s, step_s=step_s,
                       initial={"pelvis_ty": body.leg_length - body.hip_up})
    vertical = walk.prosthetic.grf_W[:, 2] + walk.intact.grf_W[:, 2]
    height = walk.record.q[:, walk.mechanism.tree.index("pelvis_ty")]
    return Standing(
        time_s=walk.record.time_s, vertical_n=vertical, weight_n=subject.mass_kg * GRAVITY,
        prosthetic_share=float(walk.prosthetic.grf_W[-1, 2] / vertical[-1]),
        drift_m=float(np.ptp(height[len(height) // 2 :])), walk=walk)
