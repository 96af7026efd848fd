"""The motion between the instants of a solution, and the whole person's motion that a walk follows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import BPoly, CubicSpline

from vsf_drake.analysis.tuning.resimulation.trajectory import SagittalTrajectory
from vsf_drake.motion.trajectory import CoordinateTrajectory

SAMPLE_S = 1e-3
"""Between the samples of the motion that a walk is given, the walk's usual step."""
BEYOND_S = 0.01
"""By how much those samples reach over the ends of a walk: a spline's ends are less exact."""


class SolutionMotion:
    """q, v, a at any time of a `SagittalTrajectory`: the quintic through position, velocity and acceleration of both
    ends of each interval (Hermite), of which a periodic trajectory is made of without end.

    Beyond the ends of one that is not periodic the acceleration stays what it was there.
    """

    def __init__(self, trajectory: SagittalTrajectory) -> None:
        self.trajectory = trajectory
        values = np.stack([trajectory.q, trajectory.v, trajectory.a], axis=1)
        spline = BPoly.from_derivatives(trajectory.time_s, values)
        self._splines = (spline, spline.derivative(1), spline.derivative(2))

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(m, 8) positions, velocities and accelerations at m times."""
        t = self.trajectory
        times = np.asarray(times, dtype=float)
        if t.periodic:
            turns = np.floor((times - t.start_s) / t.period_s)
            inside = np.clip(times - turns * t.period_s, t.start_s, t.end_s)
            q, v, a = (spline(inside) for spline in self._splines)
            return q + turns[:, None] * t.advance, v, a
        inside = np.clip(times, t.start_s, t.end_s)
        q, v, a = (spline(inside) for spline in self._splines)
        out = (times - inside)[:, None]
        return q + out * v + 0.5 * out**2 * a, v + out * a, a

    def loads(self, times: np.ndarray) -> np.ndarray:
        """(m, 8) N, N m: what acts on the coordinates, by cubic splines through the instants: on the pelvis the known
        load (nothing without), on the others the torques. Constant beyond the ends of what is not periodic."""
        t = self.trajectory
        pelvis = np.zeros((len(t.time_s), 3)) if t.pelvis_load is None else np.asarray(t.pelvis_load)
        given = np.column_stack([pelvis, t.torque])
        times = np.asarray(times, dtype=float)
        if t.periodic:
            # The end of a period is the start of the next one: their mean stands for both.
            given[0] = given[-1] = 0.5 * (given[0] + given[-1])
            spline = CubicSpline(t.time_s, given, bc_type="periodic")
            return spline(t.start_s + np.mod(times - t.start_s, t.period_s))
        return CubicSpline(t.time_s, given)(np.clip(times, t.start_s, t.end_s))


def whole_motion(motion: SolutionMotion, names: Sequence[str], start_s: float, end_s: float) -> CoordinateTrajectory:
    """The coordinates `names` of the person from `start_s` to `end_s`: those out of the sagittal plane are zero."""
    count = max(8, int(np.ceil((end_s - start_s + 2 * BEYOND_S) / SAMPLE_S)) + 1)
    times = np.linspace(start_s - BEYOND_S, end_s + BEYOND_S, count)
    values = np.zeros((len(times), len(names)))
    q = motion.sample(times)[0]
    for column, name in enumerate(motion.trajectory.names):
        values[:, list(names).index(name)] = q[:, column]
    return CoordinateTrajectory(times, values, names)
