"""How a stiffness tuning with a given motion is to be done."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.variables import Variable

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
            `DesignVariable`; those that are not named have their own.
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
        same_load: whether the settings are compared under one load too (`sweep`).
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


# What is tuned, and how it enters a walk.
#
# fulcrum             mm from A
# heel_stiffness      factor on the contact stiffness of every zone whose name begins with "heel"
# alignment           rad added to the trials' own, + toe up (`offset.alignment`)
# keel_thickness      mm; the flexural modulus is multiplied by (t / t0)^3, as the section's inertia would be. That
#                     the mass of the keel changes in proportion is left out


FULCRUM = "fulcrum"
SHIFT, ALIGNMENT, MODULUS = "fulcrum.shift", "offset.alignment", "keel.flexural_modulus"
HEEL = "heel"
MM = 1e-3


@dataclass(frozen=True)
class DesignVariable:
    """One number that is tuned.

    Attributes:
        low, high: bounds. default: the device as it is; NaN for the fulcrum, where every trial has its own.
    """

    name: str
    label: str
    unit: str
    low: float
    high: float
    default: float


@dataclass(frozen=True)
class WalkSetting:
    """What one walk takes at a point of the search.

    Attributes:
        fulcrum_m: from A. values: of the walk's variables.
        names: the Q variables to differentiate by. by: (Q, P) derivatives of these by the P design variables.
    """

    fulcrum_m: float
    values: dict[str, float]
    names: tuple[str, ...]
    by: np.ndarray


def design_variables(options: TuningOptions, feet: list[FootParameters]) -> tuple[DesignVariable, ...]:
    """The fulcrum, then the options' design, with bounds that every one of these feet can meet.

    Raises:
        InputError: a bound is out of the carriage's reach or leaves the model's range; there is no heel zone.
    """
    low = max(foot.fulcrum.rearmost_m for foot in feet) / MM
    high = min(foot.fulcrum.foremost_m for foot in feet) / MM
    if not low < high:
        raise InputError("the carriages of these trials' feet have no range in common", where="trials")
    bounds = options.bounds_mm or (low, high)
    if bounds[0] < low - 1e-6 or bounds[1] > high + 1e-6:
        raise InputError(f"{bounds[0]:g} to {bounds[1]:g} mm is out of the carriage's reach", where="bounds_mm",
                         right=f"It must lie within {low:g} to {high:g} mm")
    found = [DesignVariable(FULCRUM, "fulcrum position", "mm", float(bounds[0]), float(bounds[1]), float("nan"))]
    thickness = feet[0].keel.thickness_m / MM
    known = {
        "heel_stiffness": DesignVariable("heel_stiffness", "heel stiffness", "1", 0.5, 2.0, 1.0),
        "alignment": DesignVariable("alignment", "alignment, toe up +", "rad", -0.07, 0.07, 0.0),
        "keel_thickness": DesignVariable("keel_thickness", "keel thickness", "mm", 0.8 * thickness, 1.25 * thickness,
                                         thickness)}
    limits = {"heel_stiffness": (0.05, 20.0), "alignment": (-0.26, 0.26), "keel_thickness": (0.3 * thickness,
                                                                                             3.0 * thickness)}
    for name in options.design:
        if name == "heel_stiffness" and not any(zone.name.startswith(HEEL) for zone in feet[0].zones):
            raise InputError("the model has no contact zone whose name begins with 'heel'", where="design")
        variable = known[name]
        own = options.design_bounds.get(name, (variable.low, variable.high))
        least, most = limits[name]
        if own[0] < least or own[1] > most:
            raise InputError(f"{own[0]:g} to {own[1]:g} is out of range", where=f"design_bounds[{name!r}]",
                             right=f"It must lie within {least:g} to {most:g} {variable.unit}")
        found.append(DesignVariable(name, variable.label, variable.unit, float(own[0]), float(own[1]),
                                    variable.default))
    return tuple(found)


def walk_setting(
    design: tuple[DesignVariable, ...], x: np.ndarray, variables: Mapping[str, Variable], foot: FootParameters,
    base: Mapping[str, float] | None = None
) -> WalkSetting:
    """What a walk with `variables` takes at x (P,), the values of `design` in their units.

    Args:
        base: of the walk's variables, in place of the model's own numbers.
    """
    values = dict(base or {})
    columns: dict[str, np.ndarray] = {SHIFT: np.zeros(len(design))}
    fulcrum_m = x[0] * MM
    columns[SHIFT][0] = MM
    for p, variable in enumerate(design):
        if variable.name == "heel_stiffness":
            for name in variables:
                if name.startswith(f"contact.{HEEL}") and name.endswith(".stiffness"):
                    own = values.get(name, variables[name].default)
                    values[name] = own * x[p]
                    columns.setdefault(name, np.zeros(len(design)))[p] = own
        elif variable.name == "alignment":
            values[ALIGNMENT] = values.get(ALIGNMENT, 0.0) + x[p]
            columns.setdefault(ALIGNMENT, np.zeros(len(design)))[p] = 1.0
        elif variable.name == "keel_thickness":
            own, thickness = values.get(MODULUS, variables[MODULUS].default), foot.keel.thickness_m / MM
            values[MODULUS] = own * (x[p] / thickness) ** 3
            columns.setdefault(MODULUS, np.zeros(len(design)))[p] = 3.0 * own * x[p] ** 2 / thickness**3
    return WalkSetting(fulcrum_m=fulcrum_m, values=values, names=tuple(columns), by=np.array([*columns.values()]))
