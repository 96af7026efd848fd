"""A sagittal solution as it is handed over to be re-simulated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.manifest import GeometricOffsets

PELVIS = ("pelvis_tilt", "pelvis_tx", "pelvis_ty")
FEET = ("prosthetic", "intact")
COORDINATES, TORQUES = 8, 5
_ROWS = ("q", "v", "a", "torque", "pelvis_load")
PERIODIC_WITHIN = 1e-4
"""rad, m, rad/s, m/s: what a periodic trajectory may miss its own start by after one period."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SagittalTrajectory:
    """Motion, torques and ground reaction of a sagittal solution at n instants; SI, radians, signs of the plant.

    Attributes:
        time_s: (n,) s, increasing, n >= 3; of a periodic one from the start of the period to its end, both included.
        names: of the coordinates, see `simulation.sagittal.model.sagittal_coordinates`; the last five have a torque.
        q, v, a: (n, 8) coordinates, their first and second derivatives.
        torque: (n, 5) N m on the last five coordinates, as loads of a driver: positive increases the coordinate.
        grf: by "prosthetic" and "intact" (n, 2) N, fx forward and fz up, of the ground on the foot, in W.
        period_s, advance: of a periodic trajectory q(t + period_s) = q(t) + advance (8,); None for a single stance.
        fulcrum_m: from the keel's posterior end.
        values: variables of the walk (`Walker.walk(values=...)`) that the solution was made with; see `result`
            for those of an optimised device.
        offsets: of the prosthesis, as for `Walker.walk`.
        pelvis_load: (n, 3) N m, N, N, a force on the first three coordinates that is known to act (a recording's
            residual, an external aid); None for none, as in walking.

    Raises:
        InputError: an array has another shape or a number that is not finite; time does not increase; a periodic
            trajectory does not close.
    """

    time_s: np.ndarray
    names: tuple[str, ...]
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    torque: np.ndarray
    grf: Mapping[str, np.ndarray]
    fulcrum_m: float
    period_s: float | None = None
    advance: np.ndarray | None = None
    values: Mapping[str, float] = field(default_factory=dict)
    offsets: GeometricOffsets = GeometricOffsets()  # noqa: RUF009 (frozen: one default can serve all)
    pelvis_load: np.ndarray | None = None

    def __post_init__(self) -> None:
        n = len(self.time_s)
        wanted = {"time_s": (n,), "q": (n, COORDINATES), "v": (n, COORDINATES), "a": (n, COORDINATES),
                  "torque": (n, TORQUES)}
        if self.pelvis_load is not None:
            wanted["pelvis_load"] = (n, len(PELVIS))
        for name, shape in wanted.items():
            _check_array(getattr(self, name), shape, name)
        if n < 3 or not (np.diff(self.time_s) > 0.0).all():
            raise InputError("must hold three or more increasing instants", where="time_s")
        if len(set(self.names)) != COORDINATES or tuple(self.names[:3]) != PELVIS:
            raise InputError(f"are {', '.join(self.names)}", where="names",
                             right=f"Give eight different coordinates, first {', '.join(PELVIS)}")
        if set(self.grf) != set(FEET):
            raise InputError(f"is of {', '.join(self.grf)}", where="grf", right=f"It must be of {' and '.join(FEET)}")
        for foot in FEET:
            _check_array(self.grf[foot], (n, 2), f"grf[{foot!r}]")
        if (self.period_s is None) != (self.advance is None):
            raise InputError("only one of them is given", where="period_s, advance",
                             right="Give both for a periodic trajectory, none for another")
        if self.periodic:
            self._check_period()

    @classmethod
    def of_period(
        cls, time_s: np.ndarray, *, period_s: float, advance: np.ndarray, grf: Mapping[str, np.ndarray], **rows: Any
    ) -> SagittalTrajectory:
        """A periodic one from n instants of one period without its end, which is added here; arguments as above."""
        closed = {name: np.concatenate([value, value[:1]]) if name in _ROWS and value is not None else value
                  for name, value in rows.items()}
        if np.shape(advance) == np.shape(rows["q"])[1:]:
            closed["q"][-1] += advance
        return cls(time_s=np.append(time_s, time_s[0] + period_s), period_s=period_s, advance=advance,
                   grf={foot: np.concatenate([force, force[:1]]) for foot, force in grf.items()}, **closed)

    @property
    def periodic(self) -> bool:
        return self.period_s is not None

    @property
    def alternation(self) -> float:
        """How much the torques go up and down from one instant to the next: root mean square of (-1, 2, -1)/4 over
        three instants, which is the whole of what alternates and little of what is smooth, over that of the torques."""
        torque = np.asarray(self.torque, dtype=float)
        change = 0.25 * (2.0 * torque[1:-1] - torque[:-2] - torque[2:])
        size = float(np.sqrt(np.mean(torque**2)))
        return float(np.sqrt(np.mean(change**2))) / size if size else 0.0

    @property
    def start_s(self) -> float:
        return float(self.time_s[0])

    @property
    def end_s(self) -> float:
        return float(self.time_s[-1])

    def _check_period(self) -> None:
        _check_array(self.advance, (COORDINATES,), "advance")
        if abs(self.end_s - self.start_s - self.period_s) > 1e-6:
            raise InputError(f"the instants span {self.end_s - self.start_s:g} s, the period is {self.period_s:g} s",
                             where="time_s", right="Give the period's start and its end")
        for name, gap in (("q", self.q[-1] - self.q[0] - self.advance), ("v", self.v[-1] - self.v[0])):
            worst = int(np.argmax(np.abs(gap)))
            if abs(gap[worst]) > PERIODIC_WITHIN:
                raise InputError(f"{self.names[worst]} misses its start by {gap[worst]:.2g} after a period",
                                 where=name, right="Give a trajectory that closes, or none as periodic")


def _check_array(values: np.ndarray | None, shape: tuple[int, ...], where: str) -> None:
    if np.shape(values) != shape:
        raise InputError(f"has the shape {np.shape(values)}", where=where, right=f"It must be {shape}")
    if not np.isfinite(np.asarray(values, dtype=float)).all():
        raise InputError("has a number that is not finite", where=where)
