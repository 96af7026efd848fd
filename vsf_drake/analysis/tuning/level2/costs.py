"""Costs of a stride as terms of a trajectory problem, and the options of all that is done with it.

    joint_load   1/T int sum_j (tau_j / (m g L))^2 + w_s [ (F_x^2 + F_z^2) / (m g)^2 + M^2 / (m g L)^2 ] dt, five
                 sagittal joints, F and M of the socket on the residual limb; without unit
    metabolic    1/m int sum_j P_j+ / 0.25 + P_j- / 1.2 dt, J/kg a stride: the efficiencies of positive and negative
                 muscle work (Margaria's), applied to joints
    push_off     -1/m int P+ dt over late prosthetic stance, J/kg: P is the power of the ground's wrench at the motion
                 of the residual shank
    deviation    1/T int mean of the squares of (q - q_rec) / scale and (F - F_rec) / scale, centre of pressure
                 included, and a little of that of the accelerations, which else alternate from instant to instant
    tracking     the deviation, and a little joint_load

A cost counts as its size over that in the tracked stride, plus `deviation_weight` times the deviation (push_off alone:
ten times that). P+ = (P + sqrt(P^2 + e^2) - e) / 2, P- likewise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.common import WEIGHTED, CommonOptions
from vsf_drake.analysis.tuning.recorded_stride import RecordedStride
from vsf_drake.collocation.problem import METHODS, Convex, Curve, Grid, Layout, Residuals
from vsf_drake.errors import InputError
from vsf_drake.schema import choice, quantity
from vsf_drake.simulation.sagittal.contact_spheres import Smoothing
from vsf_drake.simulation.sagittal.linearise import linearise
from vsf_drake.simulation.sagittal.model import DESIGN, SOCKET, SagittalModel

POSITIVE, NEGATIVE = 0.25, 1.2
"""Efficiencies of positive and negative muscle work (Margaria's), here of joints."""
LABELS = {"joint_load": "joint and socket load", "metabolic": "metabolic estimate",
          "push_off": "push-off work, negative", "tracking": "deviation from the recording",
          "deviation": "deviation from the recording"}
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


@dataclass(frozen=True, eq=False)
class Terms:
    """Parts of a cost, ready for a problem."""

    residuals: tuple[Residuals, ...] = ()
    convex: tuple[Convex, ...] = ()

    def __add__(self, other: Terms) -> Terms:
        return Terms(self.residuals + other.residuals, self.convex + other.convex)

    def value(self, y: np.ndarray, weights_s: np.ndarray) -> float:
        """The cost of the outputs y (N, m) with the quadrature `weights_s` (N,)."""
        total = 0.0
        for part in self.residuals:
            left = y[:, list(part.outputs)] - part.target
            total += 0.5 * float(weights_s @ np.sum(part.weight * left * left, axis=1))
        for part in self.convex:
            total += float(weights_s @ (part.weight * part.function(y[:, part.output])[0]))
        return total


@dataclass(frozen=True, eq=False)
class StrideCosts:
    """Costs of one person's stride.

    Attributes:
        mass_kg, weight_n, leg_m: by which costs are normalised. duration_s: of the stride.
    """

    function: StrideFunction
    reference: StrideReference
    options: StrideOptions
    mass_kg: float
    weight_n: float
    leg_m: float
    duration_s: float

    def of(self, name: str, factor: float = 1.0) -> Terms:
        """Terms of a cost by its name, times `factor`."""
        return getattr(self, f"_{name}")(factor)

    def whole(self, cost: str, sizes: Mapping[str, float]) -> dict[str, Terms]:
        """The terms that are minimised for `cost`, by name.

        Args:
            sizes: of the costs in the tracked stride.
        """
        if cost == "tracking":
            return {"tracking": self.of("tracking")}
        weights = self.options.weights if cost == WEIGHTED else {cost: 1.0}
        every = sum(weights.values())
        parts = {name: self.of(name, weight / every / abs(sizes[name])) for name, weight in weights.items() if weight}
        hold = self.options.deviation_weight * (UNBOUNDED if cost == "push_off" else 1.0)
        return parts | {"deviation": self.of("deviation", hold)}

    def _joint_load(self, factor: float) -> Terms:
        moment = self.weight_n * self.leg_m
        torques = self.function.starting_with("torque_")
        socket = self.function.index(*(f"force_{axis}" for axis in SOCKET))
        scale = np.array([self.weight_n, self.weight_n, moment])
        each = 2.0 * factor / self.duration_s
        return Terms((Residuals(outputs=torques, weight=each / moment**2),
                      Residuals(outputs=socket, weight=each * self.options.socket_weight / scale**2)))

    def _metabolic(self, factor: float) -> Terms:
        curve = _work(self.options.smooth_power_w)
        return Terms(convex=tuple(Convex(output=i, function=curve, weight=factor / self.mass_kg)
                                  for i in self.function.starting_with("power_")))

    def _push_off(self, factor: float) -> Terms:
        (power,) = self.function.index("prosthesis_power")
        return Terms(convex=(Convex(output=power, function=_gained(self.options.smooth_power_w),
                                    weight=factor / self.mass_kg * self.reference.late),))

    def _deviation(self, factor: float) -> Terms:
        options, reference = self.options, self.reference
        n = self.function.layout.n
        scale = np.full(n, np.radians(options.angle_deg))
        scale[1:3] = options.place_m
        each = 2.0 * factor / self.duration_s
        found = [Residuals(outputs=self.function.starting_with("q_"), target=reference.q,
                           weight=0.5 * each / n / scale**2)]
        fast = np.full(n, options.acceleration_rad_per_s2)
        fast[1:3] = options.acceleration_m_per_s2
        found.append(Residuals(outputs=self.function.starting_with("a_"), target=reference.a,
                               weight=each * options.acceleration_weight / n / fast**2))
        for foot, force in reference.force.items():
            outputs = self.function.index(f"{foot}_fx", f"{foot}_fz", f"{foot}_cop_moment")
            scales = self.weight_n * np.array([options.force_bw, options.force_bw, options.cop_m])
            found.append(Residuals(outputs=outputs, target=np.column_stack([force, np.zeros(len(force))]),
                                   weight=0.5 * each / (3 * len(reference.force)) * reference.known[foot][:, None]
                                   / scales**2))
        return Terms(tuple(found))

    def _tracking(self, factor: float) -> Terms:
        return self._deviation(factor) + self._joint_load(factor * self.options.torque_weight / TYPICAL_LOAD)


UNBOUNDED = 10.0
"""How much more the cost push_off alone is held to the recording: work has no end that it could come near."""
TYPICAL_LOAD = 0.05
"""Size of joint_load in walking, to which `torque_weight` refers."""


def _work(smooth_w: float) -> Curve:
    """P+ / POSITIVE + P- / NEGATIVE and its derivatives by the power."""
    mean, difference = 0.5 * (1.0 / POSITIVE + 1.0 / NEGATIVE), 0.5 * (1.0 / POSITIVE - 1.0 / NEGATIVE)

    def curve(power: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        root = np.sqrt(power**2 + smooth_w**2)
        return (mean * (root - smooth_w) + difference * power, mean * power / root + difference,
                mean * smooth_w**2 / root**3)

    return curve


def _gained(smooth_w: float) -> Curve:
    """-P+ and its slope; that it is concave is left out of the curvature."""

    def curve(power: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        root = np.sqrt(power**2 + smooth_w**2)
        return -0.5 * (power + root - smooth_w), -0.5 * (1.0 + power / root), np.zeros_like(power)

    return curve


# The sagittal person as a function of one instant, in the form that collocation takes.
#
# Outputs are those of `SagittalModel.evaluate`; FOOT_cop_moment, the ground's moment (N m) about +y at the recorded
# centre of pressure; q_* and a_*, the coordinates and their accelerations themselves. The latter are for terms that
# compare with a recording.


class StrideFunction:
    """Outputs y (N, m) of z (N, Z), p (4,), see `collocation.problem.InstantFunction`.

    Attributes:
        layout: q, v, a; w, u. names: (m,) of the outputs.
    """

    def __init__(self, model: SagittalModel, smoothing: Smoothing, cop_x: Mapping[str, np.ndarray]) -> None:
        """`cop_x`: by foot (N,) m, where the recorded centre of pressure is at every instant."""
        self.model, self.smoothing, self.cop_x = model, smoothing, dict(cop_x)
        self.layout = Layout(coordinates=model.coordinates, quasi_static=model.quasi_static)
        self.names = (*model.outputs, *(f"{foot}_cop_moment" for foot in self.cop_x),
                      *(f"{kind}_{name}" for kind in "qa" for name in model.coordinates))

    def index(self, *names: str) -> list[int]:
        """Places of outputs."""
        return [self.names.index(name) for name in names]

    def starting_with(self, start: str) -> list[int]:
        """Places of all outputs whose name begins so."""
        return [i for i, name in enumerate(self.names) if name.startswith(start)]

    def evaluate(self, z: np.ndarray, p: np.ndarray) -> np.ndarray:
        """(N, m)."""
        y = self.model.evaluate(*self._parts(z), np.repeat(p[:, None], len(z), 1), self.smoothing).T
        return np.concatenate([y, *self._cop_moments(y), z[:, self.layout.q], z[:, self.layout.a]], axis=1)

    def linearise(self, z: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(N, m), (N, m, Z), (N, m, P)."""
        y, by = linearise(self.model, *self._parts(z), np.repeat(p[:, None], len(z), 1), self.smoothing)
        y, by = y.T, by.transpose(2, 0, 1)
        size, n = self.layout.size, self.layout.n
        moments_by = [by[:, my] + x[:, None] * by[:, fz] for my, fz, x in self._feet()]
        by = np.concatenate([by, *(part[:, None] for part in moments_by)], axis=1)
        by_z = np.concatenate([by[:, :, :size], np.zeros((len(z), 2 * n, size))], axis=1)
        by_z[:, -2 * n:-n, self.layout.q] = by_z[:, -n:, self.layout.a] = np.eye(n)
        by_p = np.concatenate([by[:, :, size:], np.zeros((len(z), 2 * n, len(p)))], axis=1)
        return np.concatenate([y, *self._cop_moments(y), z[:, self.layout.q], z[:, self.layout.a]], axis=1), by_z, by_p

    def _feet(self) -> list[tuple[int, int, np.ndarray]]:
        outputs = self.model.outputs
        return [(outputs.index(f"{foot}_my"), outputs.index(f"{foot}_fz"), x) for foot, x in self.cop_x.items()]

    def _cop_moments(self, y: np.ndarray) -> list[np.ndarray]:
        return [(y[:, my] + x * y[:, fz])[:, None] for my, fz, x in self._feet()]

    def _parts(self, z: np.ndarray) -> list[np.ndarray]:
        layout = self.layout
        return [np.ascontiguousarray(z[:, part].T) for part in (layout.q, layout.v, layout.a, layout.w, layout.u)]


# The recorded stride on the instants of a grid: what a solution is compared with.


SWING_MIDDLE = (0.3, 0.7)
"""Share of a swing in which the foot must clear the ground."""
FEET = ("prosthetic", "intact")


@dataclass(frozen=True, eq=False)
class StrideReference:
    """N instants of a recorded stride, sagittal; SI.

    Attributes:
        q, v, a: (N, 8). force: by foot (N, 2) fx, fz in N. cop_x: by foot (N,) m, 0 where there is no load.
        known: by foot (N,) bool, whether the force was measured.
        stance: by foot (N,) bool. late: (N,) bool, late prosthetic stance. clear: by foot (N,) bool, middle of swing.
    """

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    force: dict[str, np.ndarray]
    cop_x: dict[str, np.ndarray]
    known: dict[str, np.ndarray]
    stance: dict[str, np.ndarray]
    late: np.ndarray
    clear: dict[str, np.ndarray]


def stride_reference(recorded: RecordedStride, grid: Grid, options: StrideOptions) -> StrideReference:
    """The recorded stride at the grid's instants."""
    times, period = grid.times_s, recorded.period_s
    q, v, a = recorded.sample(times)
    grf, cop, known = recorded.grf(times), recorded.cop(times), recorded.known(times)
    spans = {"prosthetic": recorded.prosthetic_stance, "intact": recorded.intact_stance}
    stance, clear = {}, {}
    for foot, span in spans.items():
        if span is None:
            stance[foot] = clear[foot] = np.zeros(len(times), dtype=bool)
            continue
        stance[foot] = ~np.isnan(_share(times, *span, period))
        swing = _share(times, span[1], span[0] + period, period)
        clear[foot] = (swing >= SWING_MIDDLE[0]) & (swing <= SWING_MIDDLE[1])
    late = _share(times, *recorded.prosthetic_stance, period) >= options.late_share
    return StrideReference(
        q=q, v=v, a=a, known=known, stance=stance, late=late, clear=clear,
        force={foot: np.nan_to_num(grf[foot][:, :2]) if foot in grf else np.zeros((len(times), 2)) for foot in FEET},
        cop_x={foot: np.nan_to_num(cop[foot]) if foot in cop else np.zeros(len(times)) for foot in FEET})


def _share(times_s: np.ndarray, start: float, end: float, period_s: float) -> np.ndarray:
    """(N,) share of the way from start to end at times that count modulo the period, NaN outside of it."""
    share = np.mod(times_s - start, period_s) / (end - start)
    return np.where(share <= 1.0, share, np.nan)
