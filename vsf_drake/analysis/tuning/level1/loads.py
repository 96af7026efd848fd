"""Forces and moments of one walk, low-passed, with their derivatives by what is tuned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.motion.filters import low_pass
from vsf_drake.plants.person import PELVIS_COORDINATES
from vsf_drake.simulation.reactions import sum_sites
from vsf_drake.simulation.walk import Walker
from vsf_drake.simulation.walk_run import Walk


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
