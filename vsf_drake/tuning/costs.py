"""A cost as a sum of the costs of one walk, each with a factor that is fixed before the search.

What a setting changes has a last axis of 1 + P: the value, then its derivatives by the P design
variables; P = 0 without derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import Span, Stance, find_stances, within
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.reactions import PROSTHETIC, follow
from vsf_drake.simulation.walk import Walk, Walker
from vsf_drake.tuning.common import COSTS, WEIGHTED
from vsf_drake.tuning.options import TuningOptions
from vsf_drake.tuning.quantities import GIVEN_COSTS
from vsf_drake.walks.comparison import resample

CONSISTENCY = "consistency"
TRACKING = "tracking"
POSITIVE_EFFICIENCY = 0.25
NEGATIVE_EFFICIENCY = 1.2
LEAST_TRACKING = 0.01**2
"""BW²: a recorded force is not known better than 1 % of body weight, so that tracking is not
divided by less."""
SMOOTH_W_PER_KG = 0.01
"""Nearer to zero than this powers are part positive and part negative, so that work has a
derivative (a choice)."""


@dataclass(frozen=True, eq=False)
class WalkLoads:
    """What a walk loads the prosthetic side with, at the n ends of its steps, low-passed."""

    ground: np.ndarray
    """(n, 6, 1 + P) of the ground on the prosthetic foot: moment (N m) about W's origin, force
    (N)"""
    joints: np.ndarray
    """(n, J, 1 + P) N m, moments of the driver at the joints asked for, in the coordinates'
    signs"""
    socket: np.ndarray
    """(n, 6, 1 + P) N, N m of the bushing: tx, ty, tz, flexion, adduction, rotation"""

    @property
    def grf(self) -> np.ndarray:
        return self.ground[:, 3:]


def walk_loads(
    walker: Walker, walk: Walk, by: np.ndarray | None, joints: Sequence[str], cutoff_hz: float
) -> WalkLoads:
    """Reads a `walk` that `walker` made, through a zero-phase low-pass; `by` has the derivatives
    (Q, P) of the walk's `with_respect_to`, made `with_loads`, by the design variables, if any."""
    record = walk.record
    tree = walk.mechanism.tree
    columns = [tree.index(name) for name in joints]
    wrench = record.wrench[:, PROSTHETIC].copy()
    parts = [value[:, :, None] for value in (wrench, record.load[:, columns], walk.socket_wrench)]
    if by is not None:
        loads = walk.load_sensitivity
        assert loads is not None
        slopes = (record.wrench_by, loads.load[:, columns], loads.socket)
        parts = [
            np.concatenate([part, slope @ by], axis=2)
            for part, slope in zip(parts, slopes, strict=True)
        ]

    # From moments about the ground's height h to ones about W's origin: M_O = M_h + (0, 0, h) x F.
    parts[0][:, 0] -= walk.mechanism.ground_height * parts[0][:, 4]
    parts[0][:, 1] += walk.mechanism.ground_height * parts[0][:, 3]

    rate_hz = 1.0 / walk.step_s
    return WalkLoads(*(low_pass(part, rate_hz=rate_hz, cutoff_hz=cutoff_hz) for part in parts))


@dataclass(frozen=True, eq=False)
class StanceFrame:
    """What of a trial no setting changes, on the n instants of its walks."""

    time_s: np.ndarray  # (n,)
    step_s: float
    stances: tuple[Stance, ...]
    """of the model's prosthetic foot at the trial's own setting, whole ones"""
    inside: np.ndarray
    """(n,) s, weight of each instant in an integral over stance, its margins included; 0 outside"""
    late: np.ndarray  # (n,) s, the same for push-off
    rates: np.ndarray  # (n, J) rad/s of the joints
    twist: np.ndarray  # (n, 6) of the residual shank about W's origin
    weight_n: float
    mass_kg: float
    leg_m: float  # from hip centre to sole, of the intact leg
    own: WalkLoads  # at the trial's own setting
    plate_W: np.ndarray | None
    """(n, 3) N, recorded, low-passed likewise; None without, or if it saw no load"""
    unknown_s: tuple[Span, ...] = ()
    """in which the foot's force is unknown, whatever `plate_W` says"""

    @property
    def duration_s(self) -> float:
        return float(sum(stance.duration_s for stance in self.stances))


def stance_frame(
    walker: Walker,
    trial: Trial,
    walk: Walk,
    own: WalkLoads,
    joints: Sequence[str],
    options: TuningOptions,
) -> StanceFrame:
    """Prepares `trial` from its `walk` at its own setting; InputError if the prosthetic foot has no
    whole stance."""
    record = walk.record
    tree = walk.mechanism.tree
    subject = trial.subject
    time = record.time_s
    step = walk.step_s
    margin = options.margin_s
    seen = find_stances(time, walk.prosthetic.grf_W[:, 2])
    stances = tuple(stance for stance in seen if stance.complete)
    if not stances:
        cut = " (one is cut by the window)" if seen else ""
        raise InputError(
            f"the prosthetic foot has no whole stance between {trial.start_s:g} and "
            f"{trial.end_s:g} s{cut}",
            file=trial.path,
            where="window",
            right=(
                "Tuning needs the foot on the ground from touch-down to toe-off: choose another "
                "window or motion, or fit the contact if the foot misses the ground"
            ),
        )

    # Weights of the instants in integrals over stance and over push-off.
    inside = np.zeros(len(time))
    late = np.zeros(len(time))
    for stance in stances:
        start = stance.start_s + options.late_share * stance.duration_s
        inside[(time >= stance.start_s - margin) & (time <= stance.end_s + margin)] = step
        late[(time >= start) & (time <= stance.end_s + margin)] = step

    # The mean of the rates at both ends of a step: with it a load's work is the change of kinetic
    # energy.
    rates = 0.5 * (record.v + np.vstack([record.v0, record.v[:-1]]))
    person = walker.gait.person
    shank = int(person.segments[f"shank_{subject.prosthetic_side}"].index())
    socket = tree.index(person.socket.coordinate_names[-1])
    motion = follow(
        tree,
        record.q,
        rates,
        bodies=[shank],
        coordinates=[socket],
        inside=tree.ancestors[:, socket],
    )

    # The plate's force, if that covers the walk and saw a load.
    body = person.body
    plate = trial.plates.get(subject.prosthetic_side)
    force = None
    if (
        plate is not None
        and plate.time_s[0] <= time[0] + 1e-9 + step
        and plate.time_s[-1] >= time[-1] - 1e-9 - step
    ):
        force = low_pass(
            resample(time, plate.time_s, plate.force_W),
            rate_hz=1.0 / step,
            cutoff_hz=options.cutoff_hz,
        )
    unknown = trial.unmeasured.get(subject.prosthetic_side, ())
    if force is not None and not (
        find_stances(time, force[:, 2]) and inside[~within(time, unknown)].any()
    ):
        force = None
    return StanceFrame(
        time_s=time,
        step_s=step,
        stances=stances,
        inside=inside,
        late=late,
        rates=rates[:, [tree.index(name) for name in joints]],
        twist=motion.twist[:, 0],
        weight_n=subject.mass_kg * GRAVITY,
        mass_kg=subject.mass_kg,
        leg_m=body.thigh_length + body.shank_length + body.ankle_height,
        own=own,
        plate_W=force,
        unknown_s=unknown,
    )


Terms = dict[str, np.ndarray]  # (1 + P,) by name of a term of a cost, in the cost's unit


def value_of(terms: Terms) -> float:
    """Their sum, without derivatives."""
    return float(sum(term[0] for term in terms.values()))


def walk_terms(frame: StanceFrame, loads: WalkLoads, options: TuningOptions) -> dict[str, Terms]:
    """The terms of all costs of one walk, those of CONSISTENCY too; of TRACKING only where the
    trial has a plate."""
    terms = {
        "joint_load": joint_load(frame, loads, socket_weight=options.socket_weight),
        "metabolic": metabolic(frame, loads),
        "push_off": push_off(frame, loads),
    }
    if frame.plate_W is not None:
        terms[TRACKING] = deviation(frame, loads, frame.plate_W, unknown_s=frame.unknown_s)
    change = deviation(frame, loads, frame.own.grf[..., 0])
    return terms | {CONSISTENCY: {CONSISTENCY: np.sum([*change.values()], axis=0)}}


def _total(weight: np.ndarray, series: np.ndarray) -> np.ndarray:
    """(1 + P,) sum of weight times series (..., 1 + P), each by itself: the value is the same
    without derivatives."""
    return np.array([np.sum(weight * series[..., p]) for p in range(series.shape[-1])])


def mean_square(series: np.ndarray, weight_s: np.ndarray, duration_s: float) -> np.ndarray:
    """(1 + P,) sum over n and k of weight_s (n,) series (n, k, 1 + P)^2 / duration_s."""
    mean = _total(series[..., 0] * weight_s[:, None] / duration_s, series)
    mean[1:] *= 2.0
    return mean


def positive_part(power: np.ndarray, smooth_w: float) -> np.ndarray:
    """A max(power, 0) of (..., 1 + P) with a continuous derivative.

    p+ = (p + e)^2 / 4 e        where |p| < e, exact elsewhere; e / 4 too much at 0
    """
    inside = np.clip(power[..., 0] + smooth_w, 0.0, 2.0 * smooth_w)
    positive = power * (inside / (2.0 * smooth_w))[..., None]
    positive[..., 0] = inside**2 / (4.0 * smooth_w) + np.maximum(power[..., 0] - smooth_w, 0.0)
    return positive


# How far the ground reaction force is from another, over stance: the cost `tracking`, and what
# keeps other costs sane.
#
#     T = 1/T int |F - F_0|^2 / (m g)^2 dt            body weights squared
#
# With the recorded force as F_0 it is the tracking cost. With that of the model at the trial's own
# setting it measures how much a setting makes of the force that nothing in the given motion pays
# for: the pelvis is carried along by what records the motion, and would be carried by it just as
# well with no foot at all.


def deviation(
    frame: StanceFrame, loads: WalkLoads, from_W: np.ndarray, *, unknown_s: Sequence[Span] = ()
) -> Terms:
    """By component of the force in W, from another (n, 3) N, over the part of stance in which that
    is not unknown."""
    weight_s = np.where(within(frame.time_s, unknown_s), 0.0, frame.inside)
    duration_s = frame.duration_s * float(weight_s.sum() / frame.inside.sum())
    away = loads.grf / frame.weight_n
    away[..., 0] -= from_W / frame.weight_n
    return {
        name: mean_square(away[:, [i]], weight_s, duration_s)
        for i, name in enumerate(("fore_aft", "lateral", "vertical"))
    }


# Load on the prosthetic leg: moments at hip and knee, and what the socket passes to the residual
# limb.
#
#     J = 1/T int  sum_j (tau_j / (m g L))^2  +  w [ |F|^2 / (m g)^2 + |M|^2 / (m g L)^2 ]  dt
#
# over prosthetic stance of duration T, with leg length L, the moments tau_j of the prosthetic
# joints and the bushing's force F and moment M; without unit. The squared moment is the usual
# measure where no muscle is modelled. The intact leg is left out because it cannot change: with the
# motion given, its forces are those of the recording at every setting.


def joint_load(frame: StanceFrame, loads: WalkLoads, *, socket_weight: float) -> Terms:
    """Squared moments of the joints, and the weighted squared load of the socket."""
    force = frame.weight_n
    moment = frame.weight_n * frame.leg_m
    socket = loads.socket / np.repeat([force, moment], 3)[:, None]
    return {
        "joint_moments": mean_square(loads.joints / moment, frame.inside, frame.duration_s),
        "socket": socket_weight * mean_square(socket, frame.inside, frame.duration_s),
    }


# Push-off: the work that the prosthesis does on the residual shank in late stance, as a cost with a
# minus.
#
#     J = -1/m int max(F . V, 0) dt           J/kg and stance
#
# over the later part of stance, with the ground's wrench F on the foot and the spatial velocity V
# of the residual shank, both about one point. It is the power of the unified deformable segment
# (Takahashi 2012; see `walks.energy_ledger`): what passes from all that is distal of
# the shank into it, if that had no mass. The shank's motion is given, so that only the force
# changes with a setting.


def push_off(frame: StanceFrame, loads: WalkLoads) -> Terms:
    """The work, negative."""
    power = np.sum(frame.twist[:, :, None] * loads.ground, axis=1)
    scale = -frame.late / (frame.mass_kg * len(frame.stances))
    return {"push_off_work": _total(scale, positive_part(power, SMOOTH_W_PER_KG * frame.mass_kg))}


# Joint work of the prosthetic leg as an estimate of metabolic energy.
#
#     E = (W+ / 0.25 + W- / 1.2) / m          J/kg and stance
#
# with the positive and negative work of each prosthetic joint over stance, W- counted positive. The
# efficiencies are Margaria's for muscle; applied to joints they leave out co-contraction, tendons
# and muscles over two joints, so that differences between settings mean more than the number. Only
# the prosthetic leg changes while the motion is given.


def metabolic(frame: StanceFrame, loads: WalkLoads) -> Terms:
    """Positive and negative work, over their efficiencies."""
    power = loads.joints * frame.rates[:, :, None]
    scale = frame.inside[:, None] / (frame.mass_kg * len(frame.stances))
    return {
        name: _total(
            scale / efficiency, positive_part(sign * power, SMOOTH_W_PER_KG * frame.mass_kg)
        )
        for name, sign, efficiency in (
            ("positive_work", 1.0, POSITIVE_EFFICIENCY),
            ("negative_work", -1.0, NEGATIVE_EFFICIENCY),
        )
    }


@dataclass(frozen=True)
class Combination:
    """J = sum over costs of factor times cost."""

    name: str
    label: str
    unit: str
    factors: Mapping[str, float]  # by cost, CONSISTENCY among them
    size: float  # of J without the consistency at the trials' own settings, positive

    def terms(self, walk: Mapping[str, Terms]) -> Terms:
        """What it is the sum of, for one walk: parts of a single cost, or the costs of a weighted
        one."""
        terms: Terms = {}
        for cost, factor in self.factors.items():
            whole = self.name == WEIGHTED and cost != CONSISTENCY
            parts = {cost: np.sum([*walk[cost].values()], axis=0)} if whole else walk[cost]
            terms |= {name: factor * term for name, term in parts.items()}
        return terms


def sizes(own: Sequence[Mapping[str, Terms]]) -> dict[str, float]:
    """Size of each cost that every trial has: its mean over the trials' own settings, without
    sign."""
    return {
        name: max(
            abs(float(np.mean([value_of(terms[name]) for terms in own]))),
            LEAST_TRACKING if name == TRACKING else 1e-12,
        )
        for name in COSTS
        if all(name in terms for terms in own)
    }


def combine(name: str, size: Mapping[str, float], options: TuningOptions) -> Combination:
    """The cost `name` of COSTS, or the weighted one. A change of force of `consistency_bw` counts
    `consistency_weight` of the cost's size; tracking has no such part."""
    share = options.consistency_weight / options.consistency_bw**2
    if name == WEIGHTED:
        whole = sum(options.weights.values())
        factors = {cost: options.weights[cost] / whole / size[cost] for cost in options.weighed}
        return Combination(name, *GIVEN_COSTS[name], factors | {CONSISTENCY: share}, 1.0)
    holding = {} if name == TRACKING else {CONSISTENCY: share * size[name]}
    return Combination(name, *GIVEN_COSTS[name], {name: 1.0} | holding, size[name])
