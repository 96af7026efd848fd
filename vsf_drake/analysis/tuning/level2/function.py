"""What a stride is solved with: options, the recording that it is compared with, its outputs at an instant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.analysis.tuning.common import CommonOptions
from vsf_drake.analysis.tuning.recorded_stride import RecordedStride
from vsf_drake.collocation.problem import METHODS, Layout
from vsf_drake.errors import InputError
from vsf_drake.schema import choice, quantity
from vsf_drake.simulation.sagittal.linearise import linearise
from vsf_drake.simulation.sagittal.model import DESIGN, SagittalModel, Smoothing

STAGES = (
    Smoothing(depth_m=2e-3, rate_m_per_s=0.02, friction_velocity_m_per_s=0.1, damping=1.0),
    Smoothing(depth_m=1e-3, rate_m_per_s=0.02, friction_velocity_m_per_s=0.1, damping=1.0))
"""Down to the fitted contact, but for its last millimetre; the optimum counts only at the end of them. From a recorded
stride no softer ones are needed (a choice)."""


@dataclass(frozen=True, kw_only=True)
class StrideOptions(CommonOptions):
    """Options of a stiffness tuning by trajectory optimisation, beside those of `CommonOptions`.

    Attributes:
        method, intervals: of the collocation. Trapezoidal takes twice as many for the same accuracy.
        deviation_weight: how much of its own size a cost may lose for a deviation of one, a root mean square of
            `angle_deg` and `place_m` from the recorded motion and of `force_bw` and `cop_m` from the recorded force.
            A cost without it exploits what the model does not know: balance, comfort, the contact's law.
        acceleration_weight: of deviations from the recorded accelerations by `acceleration_rad_per_s2` and
            `acceleration_m_per_s2` in the deviation.
        torque_weight: of the squared joint moments in the tracking cost, to make the solution unique.
        smooth_power_w: power below which positive and negative work are rounded.
        torque_nm_per_kg: largest joint moment. angle_margin_deg: how far an angle may leave the range of its recording.
        clearance_m: least height of a foot over the ground in the middle of its swing.
        stages: of smoothing, the last of which counts.
        positions: how many fixed positions the sweep takes. time_limit_s: of one solve.
    """

    design: tuple[str, ...] = choice((), options=DESIGN[1:], source="choice")
    iterations: int = quantity(200, unit="1", low=1, high=10000, source="choice")
    confirm: tuple[str, ...] = choice(("snopt", "ipopt"), options=("snopt", "ipopt"), source="choice")
    draws: int = quantity(3, unit="1", low=0, high=1000, source="choice")
    method: str = choice("hermite_simpson", options=METHODS, source="choice")
    intervals: int = quantity(40, unit="1", low=10, high=400, source="choice")
    deviation_weight: float = quantity(0.5, unit="1", low=1e-4, high=1e3, source="choice")
    angle_deg: float = quantity(2.0, unit="deg", low=0.1, high=30.0, source="choice")
    place_m: float = quantity(0.01, unit="m", low=1e-4, high=0.2, source="choice")
    force_bw: float = quantity(0.05, unit="BW", low=1e-3, high=1.0, source="choice")
    cop_m: float = quantity(0.05, unit="m", low=1e-3, high=0.2, source="choice")
    acceleration_rad_per_s2: float = quantity(20.0, unit="rad/s^2", low=0.1, high=1e4, source="choice")
    acceleration_m_per_s2: float = quantity(2.0, unit="m/s^2", low=0.01, high=1e3, source="choice")
    acceleration_weight: float = quantity(0.005, unit="1", low=0.0, high=10.0, source="choice")
    torque_weight: float = quantity(0.1, unit="1", low=0.0, high=10.0, source="choice")
    smooth_power_w: float = quantity(5.0, unit="W", low=0.1, high=100.0, source="choice")
    torque_nm_per_kg: float = quantity(4.0, unit="N m/kg", low=0.5, high=20.0, source="choice")
    angle_margin_deg: float = quantity(15.0, unit="deg", low=1.0, high=90.0, source="choice")
    clearance_m: float = quantity(0.01, unit="m", low=-0.05, high=0.05, source="choice")
    stages: tuple[Smoothing, ...] = STAGES
    positions: int = quantity(9, unit="1", low=2, high=100, source="choice")
    time_limit_s: float = quantity(120.0, unit="s", low=1.0, high=1e5, source="choice")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.stages:
            raise InputError("there are none", where="stages", right="Give at least one")


# The recorded stride on the instants of a grid: what a solution is compared with.


SWING_MIDDLE = (0.3, 0.7)  # share of a swing in which the foot must clear the ground
FEET = ("prosthetic", "intact")


@dataclass(frozen=True, eq=False)
class StrideReference:
    """N instants of a recorded stride, sagittal; SI."""

    q: np.ndarray  # (N, 8), and its derivatives
    v: np.ndarray
    a: np.ndarray
    force: dict[str, np.ndarray]  # by foot (N, 2) fx, fz in N, 0 where not known
    cop_x: dict[str, np.ndarray]  # by foot (N,) m, 0 where there is no load
    known: dict[str, np.ndarray]  # by foot (N,) whether the force was measured
    stance: dict[str, np.ndarray]  # by foot (N,)
    clear: dict[str, np.ndarray]  # by foot (N,) middle of swing
    late: np.ndarray  # (N,) late prosthetic stance


def stride_reference(recorded: RecordedStride, times: np.ndarray, late_share: float) -> StrideReference:
    """The recorded stride at instants (N,) s."""
    period, never = recorded.period_s, np.zeros(len(times), dtype=bool)
    found: dict[str, dict[str, np.ndarray]] = {name: {} for name in ("force", "cop_x", "known", "stance", "clear")}
    for foot, span in zip(FEET, (recorded.prosthetic_stance, recorded.intact_stance), strict=True):
        force, cop = recorded.measured(foot, times)
        found["force"][foot], found["cop_x"][foot] = np.nan_to_num(force[:, :2]), np.nan_to_num(cop)
        found["known"][foot] = np.isfinite(force[:, :2]).all(axis=1)
        found["stance"][foot] = found["clear"][foot] = never
        if span is not None:
            found["stance"][foot] = ~np.isnan(_share(times, *span, period))
            swing = _share(times, span[1], span[0] + period, period)
            found["clear"][foot] = (swing >= SWING_MIDDLE[0]) & (swing <= SWING_MIDDLE[1])
    q, v, a = recorded.sample(times)
    return StrideReference(q=q, v=v, a=a, **found,
                           late=_share(times, *recorded.prosthetic_stance, period) >= late_share)


def _share(times_s: np.ndarray, start: float, end: float, period_s: float) -> np.ndarray:
    """(N,) share of the way from start to end at times that count modulo the period, NaN outside of it."""
    share = np.mod(times_s - start, period_s) / (end - start)
    return np.where(share <= 1.0, share, np.nan)


class StrideFunction:
    """The sagittal person as a function of one instant: y (N, m) of z (N, Z), p (4,), an `InstantFunction`.

    Outputs are those of `SagittalModel.evaluate`; FOOT_cop_moment, the ground's moment (N m) about +y at the recorded
    centre of pressure; q_* and a_*, the coordinates and their accelerations themselves, for what compares with a
    recording. cop_x: by foot (N,) m, where the recorded centre of pressure is. names: (m,) of the outputs.
    """

    def __init__(self, model: SagittalModel, smoothing: Smoothing, cop_x: Mapping[str, np.ndarray]) -> None:
        self.model, self.smoothing = model, smoothing
        self.layout = Layout(coordinates=model.coordinates, quasi_static=model.quasi_static)
        self.names = (*model.outputs, *(f"{foot}_cop_moment" for foot in cop_x),
                      *(f"{kind}_{name}" for kind in "qa" for name in model.coordinates))
        self._feet = [(model.outputs.index(f"{foot}_my"), model.outputs.index(f"{foot}_fz"), x)
                      for foot, x in cop_x.items()]

    def index(self, *names: str) -> list[int]:
        """Places of outputs."""
        return [self.names.index(name) for name in names]

    def starting_with(self, start: str) -> list[int]:
        """Places of all outputs whose name begins so."""
        return [i for i, name in enumerate(self.names) if name.startswith(start)]

    def evaluate(self, z: np.ndarray, p: np.ndarray) -> np.ndarray:
        """(N, m)."""
        return self._whole(self.model.evaluate(*self._parts(z, p)).T, z)

    def linearise(self, z: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(N, m), (N, m, Z), (N, m, P)."""
        y, by = linearise(self.model, *self._parts(z, p))
        by = by.transpose(2, 0, 1)
        size, n = self.layout.size, self.layout.n
        moments_by = [(by[:, my] + x[:, None] * by[:, fz])[:, None] for my, fz, x in self._feet]
        by = np.concatenate([by, *moments_by], axis=1)
        by_z = np.concatenate([by[:, :, :size], np.zeros((len(z), 2 * n, size))], axis=1)
        by_z[:, -2 * n:-n, self.layout.q] = by_z[:, -n:, self.layout.a] = np.eye(n)
        by_p = np.concatenate([by[:, :, size:], np.zeros((len(z), 2 * n, len(p)))], axis=1)
        return self._whole(y.T, z), by_z, by_p

    def _whole(self, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        moments = [(y[:, my] + x * y[:, fz])[:, None] for my, fz, x in self._feet]
        return np.concatenate([y, *moments, z[:, self.layout.q], z[:, self.layout.a]], axis=1)

    def _parts(self, z: np.ndarray, p: np.ndarray) -> tuple[Any, ...]:
        layout = self.layout
        return (*(np.ascontiguousarray(z[:, part].T) for part in (layout.q, layout.v, layout.a, layout.w, layout.u)),
                np.repeat(p[:, None], len(z), 1), self.smoothing)
