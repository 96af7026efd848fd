"""One person's stride as a trajectory problem, for any smoothing, grid, cost and range of the
fulcrum. Its costs:

    joint_load   1/T int sum_j (tau_j / (m g L))^2
                 + w_s [ (F_x^2 + F_z^2) / (m g)^2 + M^2 / (m g L)^2 ] dt, five sagittal joints, F
                   and M of the socket on the residual limb; without unit
    metabolic    1/m int sum_j P_j+ / 0.25 + P_j- / 1.2 dt, J/kg: the efficiencies of positive and
                 negative muscle work (Margaria's), applied to joints
    activation   1/T int sum_j a_j^2 dt of the joints that muscles move (`laws.joint_strength`);
                 without unit
    push_off     -1/m int P+ dt over late prosthetic stance, J/kg: P is the power of the ground's
                 wrench at the motion of the residual shank
    deviation    1/T int mean of the squares of (q - q_ref) / scale and (F - F_ref) / scale, centre
                 of pressure included, and a little of that of the accelerations, which else
                 alternate from instant to instant; from the recording, or from the consistent
                 stride that stands for it (`reference`)
    tracking     the deviation, and a little joint_load
    normal       1/T int of half the mean of the squares of angles and half of that of both feet's
                 forces, each less that of able-bodied walking at this speed, over its standard
                 deviation between persons (`normal`)
    own          1/T int of a third each of the mean of the squares of angles, of forces, and of the
                 square of the stride's time, each less that of the person's own stride at this
                 position of the fulcrum, over its standard deviation between walks (`own`); in
                 place of normal where walks at two settings or more were recorded

A cost counts as its size over that in the tracked stride (activation: over a typical size, for any
person), plus `normal_weight` times normal or `own_weight` times own, and a little of the squared
accelerations (push_off alone: ten times as much of the hold); with metabolic and push_off comes
half as much of joint_load.
Tracking counts as it is, and alone. P+ is (P + sqrt(P^2 + e^2) - e) / 2, P- likewise.

The speed is given, as recorded or another; the stride's time T may differ by a factor r from T_0,
that of the recorded stride or, at another speed, of the one made from it (`Stride.at_speed`), its
length with it. The unknowns are curves over T_0, for which the collocation stays linear; what moves
is

    q + (r - 1) speed t e_x,    v = (q' + (r - 1) speed e_x) / r,    a = q'' / r^2,    u = w' / r

with e_x the pelvis's way forward, which the level ground does not feel. T in the costs above is
then T_0, so that metabolic and push_off are of the distance speed T_0.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from vsf_drake.base.errors import require
from vsf_drake.base.schema import choice
from vsf_drake.collocation import problem as collocation
from vsf_drake.collocation.problem import Convex, Curve, Grid, Layout, Residuals
from vsf_drake.collocation.solution import Start, TrajectorySolution
from vsf_drake.laws.joint_strength import GRAVITY_OF_SOURCE, Muscles
from vsf_drake.optimal_control.balance import quasi_static_motion
from vsf_drake.optimal_control.normal import FORCES, NormalGait, normal_gait
from vsf_drake.optimal_control.own import Hold, OwnStrides
from vsf_drake.optimal_control.recorded_projection import TX
from vsf_drake.optimal_control.recorded_stride import RecordedStride
from vsf_drake.optimal_control.reference import (
    FEET,
    StrideReference,
    consistent_reference,
    normal_reference,
    stride_reference,
)
from vsf_drake.simulation.sagittal.linearise import linearise
from vsf_drake.simulation.sagittal.model import (
    DESIGN,
    IMAGINARY_STEP,
    SOCKET,
    SagittalModel,
    Smoothing,
)
from vsf_drake.tuning.common import FREE_COSTS, WEIGHTED, FreeMotionOptions, chosen
from vsf_drake.tuning.costs import NEGATIVE_EFFICIENCY, POSITIVE_EFFICIENCY

MM = 1e-3
SAME_SPEED = 0.005  # m/s, half of the last digit in which a speed is given (a choice)
Term = Residuals | Convex
PACE = "stride_time"  # over the recorded one
FREE = (*DESIGN, PACE)  # what all instants share
OWN = np.array([np.nan, 1.0, 0.0, 1.0, 1.0])  # the device as it is, by FREE
RANGE = {
    "heel_stiffness": (0.5, 2.0),
    "alignment_rad": (-0.07, 0.07),
    "keel_thickness": (0.8, 1.25),
    PACE: (0.8, 1.25),
}
"""Bounds of the design variables unless given."""
STAGES = (
    Smoothing(depth_m=2e-3, rate_m_per_s=0.02, friction_velocity_m_per_s=0.1, damping=1.0),
    Smoothing(depth_m=1e-3, rate_m_per_s=0.02, friction_velocity_m_per_s=0.1, damping=1.0),
)
"""Down to the fitted contact, but for its last millimetre; the optimum counts only at the end of
them. From a recorded stride no softer ones are needed (a choice)."""


@dataclass(frozen=True, kw_only=True)
class StrideOptions(FreeMotionOptions):
    """Options of a stiffness tuning by trajectory optimisation, beside those of
    `CommonOptions` and `FreeMotionOptions`.

    Attributes:
        normal_weight: how much of its own size a cost may lose for a deviation from able-bodied
            walking of one standard deviation between persons. A cost without it exploits what the
            model does not know: balance, comfort, the contact's law. Chosen on a model of an
            able-bodied person (studies/adaptive_stride.py).
        own_weight: the same for a deviation from the person's own stride of one standard deviation
            between walks, where walks at two settings or more were recorded. The least power of two
            with which strides at recorded settings differ by no more than that from the person's
            own, root mean square (activation; embedded subject and person A, SYNTHETIC).
        hold_factors: of normal_weight, with which the optimum and the signs of stiffness are asked
            again; own_factors: of own_weight.
        angle_deg, place_m, force_bw, cop_m: what counts as one in the deviation from a recorded
            stride.
        acceleration_weight: of deviations from the recorded accelerations by
            `acceleration_rad_per_s2` and `acceleration_m_per_s2` in that deviation; smooth_weight:
            of accelerations of that size beside a cost.
        torque_weight: of the squared joint moments in the tracking cost, to make the solution
            unique.
        smooth_power_w: power below which positive and negative work are rounded.
        torque_nm_per_kg: largest joint moment. angle_margin_deg: how far an angle may leave the
            range of its recording and of able-bodied walking.
        clearance_m: least height of a foot over the ground in the middle of its swing.
        stages: of smoothing, the last of which counts.
        positions: how many fixed positions the sweep takes.
    """

    costs: ClassVar[tuple[str, ...]] = FREE_COSTS

    design: tuple[str, ...] = choice((), options=DESIGN[1:], source="choice")
    iterations: int = chosen(200, "1", low=1, high=10000)
    confirm: tuple[str, ...] = choice(
        ("snopt", "ipopt"), options=("snopt", "ipopt"), source="choice"
    )
    draws: int = chosen(3, "1", low=0, high=1000)
    normal_weight: float = chosen(2.0, "1", low=1e-4, high=1e3)
    own_weight: float = chosen(0.125, "1", low=1e-4, high=1e3)
    angle_deg: float = chosen(2.0, "deg", low=0.1, high=30.0)
    place_m: float = chosen(0.01, "m", low=1e-4, high=0.2)
    force_bw: float = chosen(0.05, "BW", low=1e-3, high=1.0)
    cop_m: float = chosen(0.05, "m", low=1e-3, high=0.2)
    acceleration_rad_per_s2: float = chosen(20.0, "rad/s^2", low=0.1, high=1e4)
    acceleration_m_per_s2: float = chosen(2.0, "m/s^2", low=0.01, high=1e3)
    acceleration_weight: float = chosen(0.005, "1", low=0.0, high=10.0)
    smooth_weight: float = chosen(0.0005, "1", low=0.0, high=10.0)
    torque_weight: float = chosen(0.1, "1", low=0.0, high=10.0)
    smooth_power_w: float = chosen(5.0, "W", low=0.1, high=100.0)
    torque_nm_per_kg: float = chosen(4.0, "N m/kg", low=0.5, high=20.0)
    angle_margin_deg: float = chosen(15.0, "deg", low=1.0, high=90.0)
    clearance_m: float = chosen(0.01, "m", low=-0.05, high=0.05)
    stages: tuple[Smoothing, ...] = STAGES
    hold_factors: tuple[float, ...] = (0.25, 4.0)  # a choice
    own_factors: tuple[float, ...] = (0.5, 2.0)  # a choice
    positions: int = chosen(9, "1", low=2, high=100)

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.stages, "there are none", "stages", "Give at least one")
        for name, factors in (
            ("normal_weight", "hold_factors"),
            ("own_weight", "own_factors"),
        ):
            weight = getattr(self, name)
            every = getattr(self, factors)
            require(all(factor > 0.0 for factor in every), f"{every} are not all above 0", factors)
            for factor in every:
                require(
                    1e-4 <= factor * weight <= 1e3,
                    f"{weight:g} times {factor:g} of {factors} is out of range",
                    name,
                    "The product must be from 0.0001 to 1000",
                )


class StrideFunction:
    """The sagittal person as a function of one instant: y (N, m) of z (N, Z), p (5,) of FREE, an
    `InstantFunction`.

    Outputs are those of `SagittalModel.evaluate`; FOOT_cop_moment, the ground's moment (N m) about
    +y at the reference's centre of pressure; activation_* of the joints; q_* and a_*, the
    coordinates and their accelerations themselves, for what compares with a reference; with a hold
    also PACE, and off_*, its outputs less its targets at p's fulcrum. cop_x: by foot (N,) m, where
    that moment counts. speed: m/s. names: (m,) of the outputs. muscles: of the joints, in the order
    of the coordinates.
    """

    def __init__(
        self,
        model: SagittalModel,
        smoothing: Smoothing,
        cop_x: Mapping[str, np.ndarray],
        speed: float,
        hold: Hold | None = None,
    ) -> None:
        self.model = model
        self.hold = hold
        self.smoothing = smoothing
        self.speed = speed
        self.layout = Layout(coordinates=model.coordinates, quasi_static=model.quasi_static)
        joints = [
            name.removeprefix("torque_") for name in model.outputs if name.startswith("torque_")
        ]
        self.names = (
            *model.outputs,
            *(f"{foot}_cop_moment" for foot in cop_x),
            *(f"activation_{joint}" for joint in joints),
            *(f"{kind}_{name}" for kind in "qa" for name in model.coordinates),
        )
        if hold is not None:
            self.names += (PACE,)
            self._held = self.index(*hold.names)
            self.names += tuple(f"off_{name}" for name in hold.names)
        self._feet = [
            (model.outputs.index(f"{foot}_my"), model.outputs.index(f"{foot}_fz"), x)
            for foot, x in cop_x.items()
        ]
        subject = model.subject
        self.muscles = Muscles(
            [joint.split("_")[0] for joint in joints],
            subject.sex,
            subject.mass_kg * GRAVITY_OF_SOURCE * subject.stature_m,
        )
        self._torques = [model.outputs.index(f"torque_{joint}") for joint in joints]
        self._moved = [model.coordinates.index(joint) for joint in joints]

    def index(self, *names: str) -> list[int]:
        return [self.names.index(name) for name in names]

    def starting_with(self, start: str) -> list[int]:
        return [i for i, name in enumerate(self.names) if name.startswith(start)]

    def evaluate(self, z: np.ndarray, p: np.ndarray) -> np.ndarray:
        q, v, *_ = parts = self.parts(z, p)
        whole = self._whole(self.model.evaluate(*parts), q, v, z, p[-1])
        if self.hold is None:
            return whole
        target, _ = self.hold.at(p[0], len(z))
        return self._with_off(whole, p[-1], target)

    def linearise(self, z: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(N, m), (N, m, Z), (N, m, P)."""
        q, v, a, _, u, *_ = parts = self.parts(z, p)
        y, by = linearise(self.model, *parts)
        layout = self.layout
        pace = p[-1]
        size = layout.size
        n = layout.n
        whole = self._whole(y, q, v, z, pace)
        moments_by = [by[my] + np.resize(x, len(z)) * by[fz] for my, fz, x in self._feet]
        by = np.concatenate([by, np.stack(moments_by), self._activation_by(y, by, q, v)]).transpose(
            2, 0, 1
        )
        by_z = np.concatenate([by[:, :, :size], np.zeros((len(z), 2 * n, size))], axis=1)
        by_z[:, -2 * n : -n, layout.q] = by_z[:, -n:, layout.a] = np.eye(n)

        # r dv/dr = speed e_x - v, r da/dr = -2 a, r du/dr = -u, at given unknowns.
        v[TX] -= self.speed
        by_pace = -sum(
            gain * np.einsum("nmi,in->nm", by_z[:, :, part], moved) / pace
            for gain, part, moved in ((1.0, layout.v, v), (2.0, layout.a, a), (1.0, layout.u, u))
        )
        for power, part in ((1, layout.v), (2, layout.a), (1, layout.u)):
            by_z[:, :, part] /= pace**power
        by_device = np.concatenate(
            [by[:, :, size:], np.zeros((len(z), 2 * n, len(DESIGN)))], axis=1
        )
        by_p = np.concatenate([by_device, by_pace[:, :, None]], axis=2)
        if self.hold is None:
            return whole, by_z, by_p
        target, by_fulcrum = self.hold.at(p[0], len(z))
        by_z = np.concatenate([by_z, np.zeros((len(z), 1, by_z.shape[2]))], axis=1)
        by_p = np.concatenate([by_p, np.zeros((len(z), 1, len(p)))], axis=1)
        by_p[:, -1, -1] = 1.0
        off = by_p[:, self._held]
        off[:, :, 0] -= by_fulcrum
        return (
            self._with_off(whole, pace, target),
            np.concatenate([by_z, by_z[:, self._held]], axis=1),
            np.concatenate([by_p, off], axis=1),
        )

    def _with_off(self, whole: np.ndarray, pace: float, target: np.ndarray) -> np.ndarray:
        whole = np.column_stack([whole, np.full(len(whole), pace)])
        return np.concatenate([whole, whole[:, self._held] - target], axis=1)

    def _whole(
        self, y: np.ndarray, q: np.ndarray, v: np.ndarray, z: np.ndarray, pace: float
    ) -> np.ndarray:
        moments = [y[my] + np.resize(x, len(z)) * y[fz] for my, fz, x in self._feet]
        active = self.muscles.activation(y[self._torques], q[self._moved], v[self._moved])
        return np.concatenate(
            [
                np.concatenate([y, np.stack(moments), active]).T,
                z[:, self.layout.q],
                z[:, self.layout.a] / pace**2,
            ],
            axis=1,
        )

    def _activation_by(
        self, y: np.ndarray, by: np.ndarray, q: np.ndarray, v: np.ndarray
    ) -> np.ndarray:
        """(joints, 52, N) by what `SagittalModel.evaluate` is given; of the law by complex
        steps."""
        of = np.stack([y[self._torques], q[self._moved], v[self._moved]])
        steps = of[:, None] + 1j * IMAGINARY_STEP * np.eye(3)[:, :, None, None]
        by_torque, by_angle, by_rate = self.muscles.activation(*steps).imag / IMAGINARY_STEP
        rows = by_torque[:, None] * by[self._torques]
        each = np.arange(len(self._moved))
        moved = np.array(self._moved)
        rows[each, moved] += by_angle
        rows[each, len(q) + moved] += by_rate
        return np.asarray(rows)

    def parts(self, z: np.ndarray, p: np.ndarray) -> tuple[Any, ...]:
        """What `SagittalModel.evaluate` is to be given, but for the shift along the ground."""
        layout, (*device, pace) = self.layout, p
        q, v, a, w, u = (
            np.ascontiguousarray(z[:, part].T)
            for part in (layout.q, layout.v, layout.a, layout.w, layout.u)
        )
        v[TX] += (pace - 1.0) * self.speed
        return (
            q,
            v / pace,
            a / pace**2,
            w,
            u / pace,
            np.repeat(np.array(device)[:, None], len(z), 1),
            self.smoothing,
        )


@dataclass(frozen=True, eq=False)
class Stride:
    """A stride at one speed, on a grid of instants and under one smoothing of the contact."""

    model: SagittalModel  # of the person
    recorded: RecordedStride | OwnStrides | None  # None where nothing was recorded at this speed
    advance_m: float  # length of the stride in the grid's time
    tilt_rad: float  # mean tilt of the pelvis
    own_m: float  # the fulcrum's position in the recording, or where own strides are told
    leg_m: float  # hip to ankle, intact side
    hip_height_m: float  # hip centre to sole of that leg, straight
    options: StrideOptions
    grid: Grid
    smoothing: Smoothing
    consistent: TrajectorySolution | None = None
    """the tracked stride, which stands for the recording from then on"""
    bend_rad: float = 0.0
    """by which the prosthetic knee is to be more bent than able-bodied, for a start"""
    own: tuple[TrajectorySolution, ...] = ()
    """the tracked own strides at two positions or more, rising, which it is held to if there are
    any"""

    @cached_property
    def reference(self) -> StrideReference:
        late = self.options.late_share
        if self.recorded is None:
            recorded = self.able_bodied
        elif isinstance(self.recorded, OwnStrides):
            recorded = self.recorded.reference(self.own_m, self.grid, self.advance_m, late)
        else:
            recorded = stride_reference(self.recorded, self.grid.times_s, late)
        if self.consistent is None:
            return recorded
        return consistent_reference(recorded, self.consistent, self.grid, self.model.outputs)

    @property
    def pace(self) -> float:
        """Time of the recorded stride over the grid's: other than 1 of own strides alone."""
        if isinstance(self.recorded, OwnStrides):
            return self.recorded.period_s(self.own_m) / self.grid.duration_s
        return 1.0

    @cached_property
    def hold(self) -> Hold | None:
        """What it is held to in place of able-bodied walking."""
        if not self.own:
            return None
        references = [
            consistent_reference(self.reference, one, self.grid, self.model.outputs)
            for one in self.own
        ]
        return Hold(
            np.array([one.last.p[0] for one in self.own]),
            (
                *(f"q_{name}" for name in self.model.coordinates),
                *(f"{foot}_{part}" for foot in FEET for part in ("fx", "fz")),
                PACE,
            ),
            np.array(
                [
                    np.column_stack(
                        [
                            reference.q,
                            *(reference.force[foot] for foot in FEET),
                            np.full(self.grid.instants, one.last.p[-1]),
                        ]
                    )
                    for one, reference in zip(self.own, references, strict=True)
                ]
            ),
        )

    @cached_property
    def gait(self) -> NormalGait:
        return normal_gait(self.speed, self.hip_height_m)

    @cached_property
    def able_bodied(self) -> StrideReference:
        """Able-bodied walking at this speed."""
        return normal_reference(
            self.gait, self.model, self.grid, self.advance_m, self.tilt_rad, self.options.late_share
        )

    @cached_property
    def function(self) -> StrideFunction:
        return StrideFunction(
            self.model, self.smoothing, self.reference.cop_x, self.speed, self.hold
        )

    @property
    def speed(self) -> float:
        """m/s."""
        return self.advance_m / self.grid.duration_s

    @property
    def reach_mm(self) -> tuple[float, float]:
        fulcrum = self.model.foot.fulcrum
        low, high = fulcrum.rearmost_m, fulcrum.foremost_m
        if isinstance(self.recorded, OwnStrides):
            low, *_, high = self.recorded.answer.settings_m.tolist()
        return self.options.bounds_mm or (low / MM, high / MM)

    @property
    def positions_mm(self) -> list[float]:
        """Where the sweep solves for a stride."""
        count = self.options.positions
        if isinstance(self.recorded, OwnStrides):
            return self.recorded.positions_mm(self.reach_mm, count)
        return list(np.linspace(*self.reach_mm, count).tolist())

    def at_speed(self, speed_m_per_s: float, before: Start) -> tuple[Stride, Start]:
        """The stride at another speed, of which nothing was recorded, and a start there from one at
        this speed; its time and length change alike."""
        longer = float(np.sqrt(speed_m_per_s / self.speed))
        duration = self.grid.duration_s / longer
        layout = self.function.layout
        z = before.z.copy()
        z[:, TX] = longer * (z[:, TX] - z[0, TX])
        for rank, part in enumerate((layout.v, layout.a), 1):
            z[:, part] *= longer**rank
        z[:, layout.v.start + TX] *= longer
        z[:, layout.a.start + TX] *= longer
        z[:, layout.u] *= longer
        return dataclasses.replace(
            self,
            recorded=None,
            consistent=None,
            advance_m=longer * self.advance_m,
            grid=dataclasses.replace(self.grid, duration_s=duration),
        ), Start(z=z, p=before.p)

    def value(self, cost: str, y: np.ndarray) -> float:
        """A cost of the module's text by its name, of outputs y (N, m)."""
        return sum(float(self.grid.weights @ part.values(y)) for part in self.terms(cost))

    def terms(self, cost: str, factor: float = 1.0) -> list[Term]:
        kinds = {
            "joint_load": self._joint_load,
            "metabolic": self._metabolic,
            "activation": self._activation,
            "push_off": self._push_off,
            "deviation": self._deviation,
            "tracking": self._tracking,
            "normal": self._normal,
            "own": self._own,
            "smooth": self._smooth,
        }
        return kinds[cost](factor)

    def minimised(self, cost: str, sizes: Mapping[str, float]) -> list[Term]:
        """The terms that are minimised for `cost`, named; sizes: of the costs in the tracked
        stride."""
        if cost == "tracking":
            parts = {"tracking": self.terms("tracking")}
        else:
            weights = self.options.weights if cost == WEIGHTED else {cost: 1.0}
            every = sum(weights.values())
            sizes = {**sizes, "activation": TYPICAL_ACTIVATION}
            parts = {
                name: self.terms(name, weight / every / abs(sizes[name]))
                for name, weight in weights.items()
                if weight
            }
            hold = "own" if self.own else "normal"
            weight = self.hold_weight * (UNBOUNDED if cost == "push_off" else 1.0)
            parts |= {
                hold: self.terms(hold, weight),
                "smooth": self.terms("smooth", self.options.smooth_weight),
            }
            work = sum(weights.get(name, 0.0) for name in WORK)
            if work:
                parts["steady"] = self.terms(
                    "joint_load", STEADY * work / every / sizes["joint_load"]
                )
        return [
            dataclasses.replace(part, name=name) for name, terms in parts.items() for part in terms
        ]

    @property
    def hold_weight(self) -> float:
        return self.options.own_weight if self.own else self.options.normal_weight

    def _mean_square(
        self,
        outputs: list[int],
        weight: np.ndarray | float,
        target: np.ndarray | float = 0.0,
    ) -> Residuals:
        """The mean over the stride of what outputs are off a target, squared, weighted, summed."""
        return Residuals(outputs=outputs, target=target, weight=2.0 * weight / self.grid.duration_s)

    def _joint_load(self, factor: float) -> list[Term]:
        weight = self.model.weight
        moment = self.model.weight * self.leg_m
        socket = self.function.starting_with("force_")
        scale = np.array([weight, weight, moment])[: len(socket)]
        return [
            self._mean_square(self.function.starting_with("torque_"), factor / moment**2),
            self._mean_square(socket, factor * self.options.socket_weight / scale**2),
        ]

    def _metabolic(self, factor: float) -> list[Term]:
        curve = _work(self.options.smooth_power_w)
        weight = factor / self.model.subject.mass_kg
        return [
            Convex(output=i, function=curve, weight=weight)
            for i in self.function.starting_with("power_")
        ]

    def _activation(self, factor: float) -> list[Term]:
        return [self._mean_square(self.function.starting_with("activation_"), factor)]

    def _push_off(self, factor: float) -> list[Term]:
        (power,) = self.function.index("prosthesis_power")
        return [
            Convex(
                output=power,
                function=_gained(self.options.smooth_power_w),
                weight=factor / self.model.subject.mass_kg * self.reference.late,
            )
        ]

    def _normal(self, factor: float) -> list[Term]:
        target = self.able_bodied
        angle_sd = self.gait.angle_sd(self.model.coordinates)
        force_sd = self.model.weight * np.array([self.gait.sd[name] for name in FORCES])
        knee = [
            name.startswith("knee") and name.endswith(self.model.subject.prosthetic_side[0])
            for name in self.model.coordinates
        ]
        # half of the mean over angles, and half of that over forces
        return [
            self._mean_square(
                self.function.starting_with("q_"),
                0.5 * factor / np.isfinite(angle_sd).sum() / angle_sd**2,
                target.q + np.where(knee, self.bend_rad, 0.0),
            ),
            *(
                self._mean_square(
                    self.function.index(f"{foot}_fx", f"{foot}_fz"),
                    0.5 * factor / (2 * len(target.force)) / force_sd**2,
                    force,
                )
                for foot, force in target.force.items()
            ),
        ]

    def _own(self, factor: float) -> list[Term]:
        assert isinstance(self.recorded, OwnStrides)
        sd = self.recorded.sd
        time = sd.time * self.pace
        count = np.isfinite(sd.angles_rad).sum()
        each = [
            1.0 / count / sd.angles_rad**2,
            *(0.5 / len(FEET) / sd.forces_n[foot] ** 2 for foot in FEET),
            [1.0 / time**2],
        ]
        return [
            self._mean_square(
                self.function.starting_with("off_"), factor / 3.0 * np.concatenate(each)
            )
        ]

    def _smooth(self, factor: float) -> list[Term]:
        each = factor / len(self._fast) / self._fast**2
        return [self._mean_square(self.function.starting_with("a_"), each)]

    @property
    def _fast(self) -> np.ndarray:
        """(n,) accelerations that count as one."""
        fast = np.full(self.function.layout.n, self.options.acceleration_rad_per_s2)
        fast[1:3] = self.options.acceleration_m_per_s2
        return fast

    def _deviation(self, factor: float) -> list[Term]:
        options = self.options
        reference = self.reference
        n = self.function.layout.n
        scale = np.full(n, np.radians(options.angle_deg))
        scale[1:3] = options.place_m
        forces = self.model.weight * np.array([options.force_bw, options.force_bw, options.cop_m])
        count = 3 * len(reference.force)
        return [
            self._mean_square(
                self.function.starting_with("q_"), 0.5 * factor / n / scale**2, reference.q
            ),
            self._mean_square(
                self.function.starting_with("a_"),
                factor * options.acceleration_weight / n / self._fast**2,
                reference.a,
            ),
            *(
                self._mean_square(
                    self.function.index(f"{foot}_fx", f"{foot}_fz", f"{foot}_cop_moment"),
                    0.5 * factor / count * reference.known[foot][:, None] / forces**2,
                    np.column_stack([force, reference.moment[foot]]),
                )
                for foot, force in reference.force.items()
            ),
        ]

    def _tracking(self, factor: float) -> list[Term]:
        return self._deviation(factor) + self._joint_load(
            factor * self.options.torque_weight / TYPICAL_LOAD
        )

    def problem(
        self, terms: Sequence[Term], fulcrum_mm: tuple[float, float], design: tuple[str, ...] = ()
    ) -> collocation.TrajectoryProblem:
        """The problem with the fulcrum within a range; equal ends fix it. design: of FREE, what
        else is free. Where the terms hold it to able-bodied walking, angles have the range of that
        beside their recorded one."""
        function = self.function
        reference = self.reference
        options = self.options
        layout = function.layout
        low = OWN.copy()
        high = OWN.copy()
        low[0], high[0] = fulcrum_mm[0] * MM, fulcrum_mm[1] * MM
        low[-1] = high[-1] = self.pace
        for name in design:
            low[FREE.index(name)], high[FREE.index(name)] = options.design_bounds.get(
                name, RANGE[name]
            )
        margin = np.radians(options.angle_margin_deg)
        z_low, z_high = (
            np.full((self.grid.instants, layout.size), end) for end in (-np.inf, np.inf)
        )
        held = [self.able_bodied.q] if any(part.name == "normal" for part in terms) else []
        if self.hold is not None:
            held = list(self.hold.targets[:, :, : layout.n])
        angles = np.concatenate([reference.q, *held])[:, 3:]
        z_low[:, 3 : layout.n], z_high[:, 3 : layout.n] = (
            angles.min(0) - margin,
            angles.max(0) + margin,
        )
        # where on level ground a stride begins nothing tells
        z_low[0, TX] = z_high[0, TX] = reference.q[0, TX]
        torque = options.torque_nm_per_kg * self.model.subject.mass_kg
        limits = [
            collocation.Limits(outputs=function.starting_with("torque_"), low=-torque, high=torque)
        ]
        for foot, swing in reference.clear.items():
            limits.append(
                collocation.Limits(
                    outputs=function.index(f"{foot}_sole"),
                    low=np.where(swing, options.clearance_m, -np.inf)[:, None],
                )
            )
        advance = np.zeros(layout.n)
        advance[TX] = self.advance_m
        return collocation.TrajectoryProblem(
            function,
            layout,
            self.grid,
            outputs=len(function.names),
            equations=function.starting_with("balance_"),
            limits=limits,
            residuals=[part for part in terms if isinstance(part, Residuals)],
            convex=[part for part in terms if isinstance(part, Convex)],
            design=collocation.Design(
                names=FREE, low=low, high=high, scale=np.array([0.02, 0.2, 0.02, 0.1, 0.1])
            ),
            advance=advance,
            low=z_low,
            high=z_high,
            z_scale=_variable_scales(layout),
            y_scale=_output_scales(
                function.names, self.model.weight, self.model.weight * self.leg_m
            ),
        )

    def start(self, fulcrum_mm: float) -> Start:
        """The recorded motion with keel and socket in balance: not yet a possible motion, but for
        them."""
        reference = self.reference
        layout = self.function.layout
        pace = self.pace
        p = np.array([fulcrum_mm * MM, *OWN[1:-1], pace])
        z = np.zeros((self.grid.instants, layout.size))
        z[:, layout.q], z[:, layout.v] = reference.q, pace * reference.v
        z[:, layout.v.start + TX] -= (pace - 1.0) * self.speed
        z[:, layout.a] = pace**2 * reference.a
        if layout.k:
            w, u = quasi_static_motion(
                self.model,
                reference.q.T,
                reference.v.T,
                reference.a.T,
                p[:-1],
                self.grid.rates(),
                self.smoothing,
            )
            z[:, layout.w], z[:, layout.u] = w.T, u.T
        return Start(z=z, p=p)


WORK = ("metabolic", "push_off")
STEADY = 0.5
"""How much a joint load as large as the tracked stride's adds to one of WORK as large (a choice).
Work alone does not mind torques that jump from instant to instant where a joint hardly turns, and
these do not carry the full model: with 0, 0.1, 0.3, 0.5 it was 6.9, 5.6, 3.0, 2.0 % of body weight
off (metabolic, `medium_1` of the exact tier, 40 intervals, held to its recording)."""
UNBOUNDED = 10.0
"""How much more the cost push_off alone is held to able-bodied walking: work has no end that it
could come near."""
TYPICAL_LOAD = 0.05  # size of joint_load in walking, to which `torque_weight` refers
# size of activation in walking, one for all persons: `normal_weight` is against it
TYPICAL_ACTIVATION = 0.5


def _work(smooth_w: float) -> Curve:
    """P+ and P- over their efficiencies."""
    mean = 0.5 * (1.0 / POSITIVE_EFFICIENCY + 1.0 / NEGATIVE_EFFICIENCY)
    difference = mean - 1.0 / NEGATIVE_EFFICIENCY

    def curve(power: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        root = np.sqrt(power**2 + smooth_w**2)
        return (
            mean * (root - smooth_w) + difference * power,
            mean * power / root + difference,
            mean * smooth_w**2 / root**3,
        )

    return curve


def _gained(smooth_w: float) -> Curve:
    """-P+ and its slope; that it is concave is left out of the curvature."""

    def curve(power: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        root = np.sqrt(power**2 + smooth_w**2)
        return -0.5 * (power + root - smooth_w), -0.5 * (1.0 + power / root), np.zeros_like(power)

    return curve


BALANCE_OF_BODY = ("balance_pelvis_tilt", "balance_pelvis_tx", "balance_pelvis_ty")


def _output_scales(names: tuple[str, ...], weight_n: float, moment_nm: float) -> np.ndarray:
    scale = np.ones(len(names))
    for i, name in enumerate(names):
        kind = name.split("_")[0]
        turning = not any(part in name for part in ("_tx", "_ty", "_tz", "_fx", "_fz"))
        scale[i] = {
            "power": weight_n,
            "stored": weight_n,
            "prosthesis": weight_n,
            "q": 0.1,
            "a": 20.0,
            "stride": 0.1,
        }.get(kind, moment_nm if turning else weight_n)
        if kind == "balance" and name not in BALANCE_OF_BODY and turning:
            scale[i] = 0.1 * moment_nm
        if name.endswith("_sole"):
            scale[i] = 0.01
    return scale


def _variable_scales(layout: Layout) -> np.ndarray:
    scale = np.ones(layout.size)
    for kind, angle, length in (("q", 0.1, 0.05), ("v", 1.0, 0.5), ("a", 20.0, 10.0)):
        part = getattr(layout, kind)
        scale[part] = angle
        scale[part][1:3] = length
    socket = np.array([5e-3, 5e-3, 0.05])
    w = np.append(socket, np.full(max(layout.k - len(SOCKET), 0), 0.02))[: layout.k]
    scale[layout.w], scale[layout.u] = w, 10.0 * w
    return scale
