"""How a stiffness tuning with a given motion is to be done."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from vsf_drake.errors import InputError

COSTS = ("joint_load", "metabolic", "push_off", "tracking")
"""Costs that stand for themselves; "weighted" adds them up."""
WEIGHTED = "weighted"
DESIGN = ("heel_stiffness", "alignment", "keel_thickness")
"""What may be tuned beside the fulcrum: see `variables`."""
JOINTS = ("hip_flexion", "hip_adduction", "hip_rotation", "knee_angle", "knee_adduction", "knee_rotation")
CONFIRM = ("ipopt", "nlopt")


@dataclass(frozen=True, kw_only=True)
class TuningOptions:
    """Options of a stiffness tuning with the motion given. All numbers without a source are choices.

    Attributes:
        bounds_mm: least and largest fulcrum position from A; None for the carriage's reach.
        design: of DESIGN, tuned together with the fulcrum. design_bounds: (low, high) by name, in the unit of
            `variables.DesignVariable`; those that are not named have their own.
        weights: of COSTS in the weighted cost, each cost being divided by its size at the trials' own positions; their
            sum counts as 1.
        consistency_weight: what a change of the ground reaction force by `consistency_bw` adds to the cost, as a share
            of its size at the trials' own positions; `consistency_bw` is in body weights, root mean square over stance.
            Motion being given, a change of the force is one that nothing in the recording pays for. With 0.2 it makes
            up less than 5 % of the cost at the optima of the embedded trials, where the force has changed by less than
            5 % body weight; with 0.05, a force changed by 20 % would pay for push-off.
        socket_weight: of the socket's wrench against the joints' moments in the cost joint_load. The axial force bears
            the body and its square is about a hundred times those of the normalised moments: with 0.01 both count.
        joints: of JOINTS, whose moments are in joint_load and whose work is in metabolic.
        late_share: of stance, after which positive power counts as push-off.
        cutoff_hz: low-pass of all forces and moments, as for all forces that are compared here.
        margin_s: that is counted before and after stance, because a setting moves touch-down and toe-off.
        step_s: of the walks whose numbers are given. search_step_s: of those that look for a start.
        support_width_m: on either side of a keel joint, over which the support passes from one piece of the keel to the
            next, so that the cost has a derivative there too; 0 for none. Less where joints are nearer.
        sweep_mm: spacing of the sweep over the fulcrum.
        starts: most searches of the fulcrum alone. more_starts: random ones on top where a design is tuned.
        seed: of these and of `draws`.
        iterations, tolerance: of a search (major iterations, optimality).
        confirm: of CONFIRM, solvers that search again from where the best search began.
        draws: of the contact's parameters, by which the optimum's uncertainty is judged; 0 for none.
        same_load: whether the settings are compared under one load too (`same_load`).
        pareto: two of COSTS whose trade-off is told; () for none.
        workers: threads; None for one a core.

    Raises:
        InputError: an option is none of what it may be.
    """

    bounds_mm: tuple[float, float] | None = None
    design: tuple[str, ...] = ()
    design_bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    weights: Mapping[str, float] = field(
        default_factory=lambda: {"joint_load": 1.0, "metabolic": 1.0, "push_off": 1.0})
    consistency_weight: float = 0.2
    consistency_bw: float = 0.1
    socket_weight: float = 0.01
    joints: tuple[str, ...] = JOINTS[:4]
    late_share: float = 0.5
    cutoff_hz: float = 40.0
    margin_s: float = 0.05
    step_s: float = 1e-3
    search_step_s: float = 2e-3
    support_width_m: float = 4e-3
    sweep_mm: float = 1.0
    starts: int = 3
    more_starts: int = 3
    seed: int = 0
    iterations: int = 60
    tolerance: float = 1e-6
    confirm: tuple[str, ...] = CONFIRM
    draws: int = 6
    same_load: bool = True
    pareto: tuple[str, ...] = ("joint_load", "push_off")
    workers: int | None = None

    def __post_init__(self) -> None:
        _check_names("design", self.design, DESIGN)
        _check_names("joints", self.joints, JOINTS, some=True)
        _check_names("confirm", self.confirm, CONFIRM)
        _check_names("pareto", self.pareto, COSTS)
        if len(self.pareto) not in (0, 2):
            raise InputError(f"names {len(self.pareto)} costs", where="pareto", right="Give two costs, or none")
        if self.bounds_mm is not None:
            _check_pair("bounds_mm", self.bounds_mm)
        for name, pair in self.design_bounds.items():
            _check_names("design_bounds", (name,), DESIGN)
            _check_pair(f"design_bounds[{name!r}]", pair)
        self._check_weights()
        for name, low, high in (
                ("consistency_weight", 0.0, 100.0), ("consistency_bw", 1e-4, 1.0), ("socket_weight", 0.0, 100.0),
                ("late_share", 0.0, 0.95), ("cutoff_hz", 5.0, 200.0), ("margin_s", 0.0, 0.2), ("step_s", 1e-5, 0.01),
                ("search_step_s", 1e-5, 0.01), ("support_width_m", 0.0, 0.05), ("sweep_mm", 0.1, 20.0),
                ("tolerance", 1e-12, 1e-2)):
            value = getattr(self, name)
            if not _is_number(value) or not low <= value <= high:
                raise InputError(f"{value!r} is not usable", where=name,
                                 right=f"It must be a number from {low:g} to {high:g}")
        for name, least in (("starts", 1), ("more_starts", 0), ("seed", 0), ("iterations", 1), ("draws", 0)):
            _check_count(name, getattr(self, name), least)
        if not isinstance(self.same_load, bool):
            raise InputError(f"{self.same_load!r} is neither True nor False", where="same_load")
        if self.workers is not None:
            _check_count("workers", self.workers, 1)
        for name in ("step_s", "search_step_s"):
            if self.cutoff_hz >= 0.5 / getattr(self, name):
                raise InputError(f"{self.cutoff_hz:g} Hz cannot be told from steps of {1e3 * getattr(self, name):g} ms",
                                 where="cutoff_hz", right=f"It must be below {0.5 / getattr(self, name):g} Hz")

    def _check_weights(self) -> None:
        if not isinstance(self.weights, Mapping) or not self.weights:
            raise InputError("gives no weights", where="weights", right=f"Give a weight for some of {', '.join(COSTS)}")
        _check_names("weights", tuple(self.weights), COSTS)
        for name, value in self.weights.items():
            if not _is_number(value) or value < 0.0:
                raise InputError(f"{value!r} is no weight", where=f"weights[{name!r}]",
                                 right="It must be a number from 0 on")
        if not sum(self.weights.values()) > 0.0:
            raise InputError("are all zero", where="weights", right="One of them must be above 0")


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _check_names(where: str, names: Any, known: tuple[str, ...], *, some: bool = False) -> None:
    if isinstance(names, str) or not isinstance(names, tuple):
        raise InputError(f"is a {type(names).__name__}, no tuple of names", where=where)
    for name in names:
        if name not in known:
            raise InputError(f"{name!r} is none", where=where, right=f"There are: {', '.join(known)}")
    if len(set(names)) != len(names):
        raise InputError("names one twice", where=where)
    if some and not names:
        raise InputError("is empty", where=where, right=f"Give some of {', '.join(known)}")


def _check_pair(where: str, pair: Any) -> None:
    if not isinstance(pair, (tuple, list)) or len(pair) != 2 or not all(_is_number(value) for value in pair):
        raise InputError(f"{pair!r} is no pair of numbers", where=where, right="Give (low, high)")
    if not pair[0] < pair[1]:
        raise InputError(f"its lower bound {pair[0]:g} is not below its upper one {pair[1]:g}", where=where,
                         right="No setting meets both: give the lower one first")


def _check_count(name: str, value: Any, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise InputError(f"{value!r} is not usable", where=name, right=f"It must be a whole number from {least} on")
