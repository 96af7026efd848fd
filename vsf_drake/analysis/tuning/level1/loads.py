"""Forces and moments of one walk, low-passed, with their derivatives by what is tuned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.comparison import resample
from vsf_drake.analysis.validation.energy_same_load import follow
from vsf_drake.errors import InputError
from vsf_drake.motion.events import Stance, find_stances
from vsf_drake.motion.filters import low_pass
from vsf_drake.motion.trial_record import Trial
from vsf_drake.parameters import GRAVITY
from vsf_drake.plants.person import PELVIS_COORDINATES
from vsf_drake.simulation.reactions import sum_sites
from vsf_drake.simulation.walk import Walk, Walker


@dataclass(frozen=True, eq=False)
class Signal:
    """A series of n instants and k columns.

    Attributes:
        value: (n, k). by: (n, k, P) derivatives by the P design variables; P = 0 without.
    """

    value: np.ndarray
    by: np.ndarray


@dataclass(frozen=True, eq=False)
class WalkLoads:
    """What a walk loads the prosthetic side with, at the n ends of its steps.

    Attributes:
        ground: (n, 6) of the ground on the prosthetic foot: moment (N m) about W's origin, force (N), in W.
        joints: (n, J) N m, moments of the driver at the joints asked for, in the coordinates' signs.
        socket: (n, 6) N and N m of the bushing on the socket: tx, ty, tz, flexion, adduction, rotation.
        pelvis: (n, 3) N at the pelvis' translations (OpenSim's axes), without derivatives: what no muscle makes.
    """

    ground: Signal
    joints: Signal
    socket: Signal
    pelvis: np.ndarray

    @property
    def grf(self) -> Signal:
        """(n, 3) N, the force of the ground in W."""
        return Signal(self.ground.value[:, 3:], self.ground.by[:, 3:])


def walk_loads(
    walker: Walker, walk: Walk, by: np.ndarray | None, *, joints: Sequence[str], cutoff_hz: float
) -> WalkLoads:
    """Reads a `walk` that `walker` made.

    Args:
        by: (Q, P) derivatives of the walk's `with_respect_to`, made `with_loads`, by the design variables; None without
            derivatives.
        joints: coordinates of the prosthetic leg, with the side.
        cutoff_hz: of the zero-phase low-pass, which is linear: derivatives go through the same one.
    """
    record, tree = walk.record, walk.mechanism.tree
    columns = [tree.index(name) for name in joints]
    pelvis = [tree.index(name) for name in PELVIS_COORDINATES[:3]]
    wrench = np.zeros((len(record.q), 6))
    sum_sites(record.sites, 0, len(walker.gait.person.foot.sites.radius), wrench)
    raw = [_about_origin(wrench, walk.mechanism.ground_height), record.load[:, columns], walk.socket_wrench,
           record.load[:, pelvis]]
    values = _filtered(raw, walk.step_s, cutoff_hz)
    slopes = [np.zeros((*value.shape, 0)) for value in values[:3]]
    if by is not None:
        loads = walk.load_sensitivity
        assert loads is not None
        ground_by = _about_origin(record.wrench_by, walk.mechanism.ground_height)
        parts = [series @ by for series in (ground_by, loads.load[:, columns], loads.socket)]
        flat = _filtered([part.reshape(len(part), -1) for part in parts], walk.step_s, cutoff_hz)
        slopes = [item.reshape(part.shape) for item, part in zip(flat, parts, strict=True)]
    ground, moments, bushing = (Signal(value, slope) for value, slope in zip(values[:3], slopes, strict=True))
    return WalkLoads(ground=ground, joints=moments, socket=bushing, pelvis=values[3])


def _about_origin(wrench: np.ndarray, z: float) -> np.ndarray:
    """(n, 6, ...) with moments about W's origin from one with moments about the ground's height z."""
    moved = wrench.copy()
    moved[:, 0] -= z * wrench[:, 4]
    moved[:, 1] += z * wrench[:, 3]
    return moved


def _filtered(parts: list[np.ndarray], step_s: float, cutoff_hz: float) -> list[np.ndarray]:
    smooth = low_pass(np.column_stack(parts), rate_hz=1.0 / step_s, cutoff_hz=cutoff_hz)
    ends = np.cumsum([part.shape[1] for part in parts])
    return np.split(smooth, ends[:-1], axis=1)


# One trial prepared for tuning: its stance, the motion that is given, and the forces that were recorded.


@dataclass(frozen=True, eq=False)
class StanceFrame:
    """What of a trial no setting changes, on the n instants of its walks.

    Attributes:
        time_s: (n,). step_s: between them.
        stances: of the model's prosthetic foot at the trial's own setting, whole ones.
        duration_s: theirs, summed; count: how many.
        inside: (n,) s, weight of each instant in an integral over stance, its margins included; 0 outside.
        late: (n,) s, the same for push-off.
        rates: (n, J) rad/s of the joints. twist: (n, 6) of the residual shank about W's origin.
        weight_n: body weight. mass_kg: of the body. leg_m: from hip centre to sole, of the intact leg.
        own: loads at the trial's own setting. plate_W: (n, 3) N, recorded, low-passed likewise; None without.
    """

    time_s: np.ndarray
    step_s: float
    stances: tuple[Stance, ...]
    inside: np.ndarray
    late: np.ndarray
    rates: np.ndarray
    twist: np.ndarray
    weight_n: float
    mass_kg: float
    leg_m: float
    own: WalkLoads
    plate_W: np.ndarray | None

    @property
    def duration_s(self) -> float:
        """Of all stances together."""
        return float(sum(stance.duration_s for stance in self.stances))

    @property
    def count(self) -> int:
        """Of stances."""
        return len(self.stances)


def stance_frame(
    walker: Walker, trial: Trial, walk: Walk, own: WalkLoads, *, joints: Sequence[str], late_share: float,
    margin_s: float, cutoff_hz: float
) -> StanceFrame:
    """Prepares `trial` from its `walk` at its own setting.

    Raises:
        InputError: the prosthetic foot has no whole stance in the walk.
    """
    record, tree = walk.record, walk.mechanism.tree
    time, step = record.time_s, walk.step_s
    found = find_stances(time, walk.prosthetic.grf_W[:, 2])
    stances = tuple(stance for stance in found if stance.complete)
    if not stances:
        cut = " (one is cut by the window)" if found else ""
        raise InputError(f"the prosthetic foot has no whole stance between {trial.start_s:g} and {trial.end_s:g} s"
                         f"{cut}", file=trial.path, where="window",
                         right="Tuning needs the foot on the ground from touch-down to toe-off: choose another window "
                               "or motion, or fit the contact if the foot misses the ground")
    inside, late = np.zeros(len(time)), np.zeros(len(time))
    for stance in stances:
        start = stance.start_s + late_share * stance.duration_s
        inside[(time >= stance.start_s - margin_s) & (time <= stance.end_s + margin_s)] = step
        late[(time >= start) & (time <= stance.end_s + margin_s)] = step
    rates = 0.5 * (record.v + np.vstack([record.v0, record.v[:-1]]))
    person = walker.gait.person
    shank = int(person.segments[f"shank_{trial.subject.prosthetic_side}"].index())
    socket = tree.index(person.socket.coordinate_names[-1])
    motion = follow(tree, record.q, rates, bodies=[shank], coordinates=[socket], inside=tree.ancestors[:, socket])
    body = person.body
    return StanceFrame(
        time_s=time, step_s=step, stances=stances, inside=inside, late=late,
        rates=rates[:, [tree.index(name) for name in joints]], twist=motion.twist[:, 0],
        weight_n=trial.subject.mass_kg * GRAVITY, mass_kg=trial.subject.mass_kg,
        leg_m=body.thigh_length + body.shank_length + body.ankle_height, own=own,
        plate_W=_plate(trial, time, step, cutoff_hz))


def _plate(trial: Trial, time: np.ndarray, step: float, cutoff_hz: float) -> np.ndarray | None:
    """The prosthetic foot's plate at the walk's instants; None if there is none, or it saw no load there."""
    plate = trial.plates.get(trial.subject.prosthetic_side)
    if plate is None or not (plate.time_s[0] <= time[0] + 1e-9 + step and plate.time_s[-1] >= time[-1] - 1e-9 - step):
        return None
    force = low_pass(resample(time, plate.time_s, plate.force_W), rate_hz=1.0 / step, cutoff_hz=cutoff_hz)
    return force if find_stances(time, force[:, 2]) else None
