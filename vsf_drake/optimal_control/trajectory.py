"""A sagittal solution as it is handed over to be re-simulated, and the motion between its
instants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import BPoly, CubicSpline

from vsf_drake.collocation.solution import TrajectorySolution
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.optimal_control.stride import FREE, OWN
from vsf_drake.simulation.walk import Walker
from vsf_drake.tuning.options import device_values

PELVIS = ("pelvis_tilt", "pelvis_tx", "pelvis_ty")
FEET = ("prosthetic", "intact")
COORDINATES = 8
SAMPLE_S, BEYOND_S = 1e-3, 0.01
"""Between the samples of the motion that a walk is given, the walk's usual step; and by how much
they reach over the ends of a walk: a spline's ends are less exact."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SagittalTrajectory:
    """Motion, torques and ground reaction of a sagittal stride at n instants; SI, radians, signs of
    the plant.

    It repeats: q(t + period_s) = q(t) + advance.
    """

    time_s: np.ndarray  # (n,), n >= 3, increasing, from the start of the period to its end
    names: tuple[str, ...]  # of the coordinates (`simulation.sagittal.model.sagittal_coordinates`)
    q: np.ndarray  # (n, 8) coordinates; below their first and second derivatives
    v: np.ndarray
    a: np.ndarray
    torque: np.ndarray
    """(n, 5) on the last five, as loads of a driver: positive increases the coordinate"""
    grf: Mapping[str, np.ndarray]
    """by "prosthetic" and "intact" (n, 2), fx forward and fz up, of the ground, in W"""
    advance: np.ndarray  # (8,)
    fulcrum_m: float  # from the keel's posterior end
    values: Mapping[str, float] = field(default_factory=dict)
    """of the walk's variables, see `design_values`"""
    # frozen: one default can serve all
    offsets: GeometricOffsets = GeometricOffsets()  # noqa: RUF009
    pelvis_load: np.ndarray | None = None
    """(n, 3) on the first three: a recording's residual, an aid; None in walking"""

    @property
    def start_s(self) -> float:
        return float(self.time_s[0])

    @property
    def end_s(self) -> float:
        return float(self.time_s[-1])

    @property
    def period_s(self) -> float:
        return self.end_s - self.start_s

    @property
    def alternation(self) -> float:
        """How much the torques go up and down from one instant to the next: root mean square of
        (-1, 2, -1)/4 over three instants, which is the whole of what alternates and little of what
        is smooth, over that of torques."""
        torque = np.asarray(self.torque, dtype=float)
        change = 0.25 * (2.0 * torque[1:-1] - torque[:-2] - torque[2:])
        size = float(np.sqrt(np.mean(torque**2)))
        return float(np.sqrt(np.mean(change**2))) / size if size else 0.0


class SolutionMotion:
    """q, v, a at any time of a `SagittalTrajectory`: the quintic through position, velocity and
    acceleration of both ends of each interval (Hermite), period after period."""

    def __init__(self, trajectory: SagittalTrajectory) -> None:
        self.trajectory = t = trajectory
        spline = BPoly.from_derivatives(t.time_s, np.stack([t.q, t.v, t.a], axis=1))
        self._splines = (spline, spline.derivative(1), spline.derivative(2))
        pelvis = (
            np.zeros((len(t.time_s), 3)) if t.pelvis_load is None else np.asarray(t.pelvis_load)
        )
        loads = np.column_stack([pelvis, t.torque])
        # The end of a period is the start of the next one: their mean stands for both.
        loads[0] = loads[-1] = 0.5 * (loads[0] + loads[-1])
        self._loads = CubicSpline(t.time_s, loads, bc_type="periodic")

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(m, 8) positions, velocities and accelerations at m times."""
        t = self.trajectory
        times = np.asarray(times, dtype=float)
        turns = np.floor((times - t.start_s) / t.period_s)
        q, v, a = (
            spline(np.clip(times - turns * t.period_s, t.start_s, t.end_s))
            for spline in self._splines
        )
        return q + turns[:, None] * t.advance, v, a

    def loads(self, times: np.ndarray) -> np.ndarray:
        """(m, 8) N, N m: what acts on the coordinates, by cubic splines through the instants: on
        the pelvis the known load (nothing without), on the others the torques."""
        return np.asarray(self._loads(times))


def whole_motion(
    motion: SolutionMotion, names: Sequence[str], start_s: float, end_s: float
) -> CoordinateTrajectory:
    """The person's coordinates `names`: those out of the sagittal plane are zero."""
    count = max(8, int(np.ceil((end_s - start_s + 2 * BEYOND_S) / SAMPLE_S)) + 1)
    times = np.linspace(start_s - BEYOND_S, end_s + BEYOND_S, count)
    values = np.zeros((len(times), len(names)))
    values[:, [list(names).index(name) for name in motion.trajectory.names]] = motion.sample(times)[
        0
    ]
    return CoordinateTrajectory(times, values, names)


def design_values(walker: Walker, **design: float) -> dict[str, float]:
    """Values for `Walker.walk` with which the full model has the device of
    `simulation.sagittal.model.DESIGN`: heel and keel over the walker's (see
    `tuning.options.device_values`), the foot's turn, toes up, beyond the offsets."""
    values: dict[str, float] = {}
    for name, x in design.items():
        if x != OWN[FREE.index(name)]:
            changed = device_values(name.removesuffix("_rad"), x, walker.variables, {})
            values |= {variable: value for variable, (value, _) in changed.items()}
    return values


def solved_trajectory(
    solution: TrajectorySolution,
    walker: Walker,
    *,
    outputs: Sequence[str],
    offsets: GeometricOffsets | None = None,
) -> SagittalTrajectory:
    """Motion, torques and ground reaction of a solution, with its fulcrum and its device; FitError
    where it is none. `outputs` names its function's outputs; the walker's device is what the design
    multiplies."""
    problem = solution.problem
    y = solution.y()
    layout = problem.layout
    grid = problem.grid
    names = list(outputs)

    def closed(rows: np.ndarray, further: np.ndarray | float = 0.0) -> np.ndarray:
        """With the end of the period, which is no instant of its own."""
        return np.concatenate([rows, rows[:1] + further])

    def columns(*wanted: str) -> np.ndarray:
        return closed(y[:, [names.index(name) for name in wanted]])

    coordinates = tuple(layout.coordinates)
    q, v, a = (solution.z[:, getattr(layout, part)] for part in ("q", "v", "a"))
    design = dict(zip(problem.design.names, (float(x) for x in solution.p), strict=True))

    # A stride that takes `pace` times as long as the unknowns' and goes as far at their speed
    # (`stride`).
    pace = design.pop("stride_time", 1.0)
    T = grid.duration_s
    more = (pace - 1.0) * problem.advance
    q = q + np.outer(grid.times_s / T, more)
    v = (v + more / T) / pace
    a = a / pace**2
    advance = pace * problem.advance
    return SagittalTrajectory(
        time_s=pace * closed(grid.times_s, T),
        names=coordinates,
        q=closed(q, advance),
        v=closed(v),
        a=closed(a),
        torque=columns(*(f"torque_{name}" for name in coordinates[len(PELVIS) :])),
        advance=advance,
        fulcrum_m=design.pop("fulcrum_m"),
        grf={foot: columns(f"{foot}_fx", f"{foot}_fz") for foot in FEET},
        values=design_values(walker, **design),
        offsets=offsets or GeometricOffsets(),
    )
