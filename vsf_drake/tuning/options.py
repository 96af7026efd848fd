"""How a stiffness tuning with a given motion is to be done, what is tuned, and how that enters a
walk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vsf_drake.base.errors import require
from vsf_drake.base.schema import choice, quantity
from vsf_drake.model.model_file import check_movable
from vsf_drake.model.parameters import FootParameters
from vsf_drake.simulation.variables import Variable
from vsf_drake.tuning.common import DESIGN, JOINTS, GivenMotionOptions, chosen


@dataclass(frozen=True, kw_only=True)
class TuningOptions(GivenMotionOptions):
    """Options of a stiffness tuning with the motion given, beside those of `CommonOptions` and
    `GivenMotionOptions`.

    Attributes:
        consistency_weight: what a change of the ground reaction force by `consistency_bw` (body
            weights, root mean square over stance) adds to the cost, as a share of its size at the
            trials' own positions. Motion being given, nothing in the recording pays for such a
            change. With 0.2 it makes up less than 5 % of the cost at the optima of the embedded
            trials; with 0.05, a force changed by 20 % would pay for push-off.
        margin_s: that is counted before and after stance, because a setting moves touch-down and
            toe-off.
        support_width_m: on either side of a keel joint, over which the support passes from one
            piece of the keel to the next, so that the cost has a derivative there too; 0 for none.
            Less where joints are nearer.
    """

    design: tuple[str, ...] = choice((), options=DESIGN, source="choice")
    confirm: tuple[str, ...] = choice(
        ("ipopt", "nlopt"), options=("ipopt", "nlopt"), source="choice"
    )
    consistency_weight: float = chosen(0.2, "1", low=0.0, high=100.0)
    consistency_bw: float = chosen(0.1, "BW", low=1e-4, high=1.0)
    cutoff_hz: float = quantity(40.0, unit="Hz", low=5.0, high=200.0, source="McGeehan 2021")
    """of forces and moments"""
    margin_s: float = chosen(0.05, "s", low=0.0, high=0.2)
    step_s: float = chosen(1e-3, "s", low=1e-5, high=0.01)
    """of walks whose numbers are given"""
    search_step_s: float = chosen(2e-3, "s", low=1e-5, high=0.01)
    """that look for a start"""
    support_width_m: float = chosen(4e-3, "m", low=0.0, high=0.05)
    sweep_mm: float = chosen(1.0, "mm", low=0.1, high=20.0)  # spacing
    more_starts: int = chosen(3, "1", low=0)
    """random ones, on top where a design is tuned"""
    tolerance: float = chosen(1e-6, "1", low=1e-12, high=1e-2)
    """optimality of a search"""
    same_load: bool = True
    """whether settings are compared under one load too, see `sweep.same_load_outcomes`"""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.joints, "is empty", "joints", f"Give some of {', '.join(JOINTS)}")
        require(
            len(self.pareto) in (0, 2),
            f"names {len(self.pareto)} cost{'s' * (len(self.pareto) != 1)}",
            "pareto",
            "Give two costs, or none",
        )
        for step in (self.step_s, self.search_step_s):
            require(
                self.cutoff_hz < 0.5 / step,
                f"{self.cutoff_hz:g} Hz cannot be told from steps of {1e3 * step:g} ms",
                "cutoff_hz",
                f"It must be below {0.5 / step:g} Hz",
            )


MM = 1e-3
SHIFT = "fulcrum.shift"
ALIGNMENT = "offset.alignment"
MODULUS = "keel.flexural_modulus"
HEEL = "heel"


@dataclass(frozen=True)
class DesignVariable:
    """One number that is tuned, with its bounds."""

    name: str
    label: str
    unit: str
    low: float
    high: float
    default: float  # the device as it is; NaN for the fulcrum, where every trial has its own


def design_variables(
    options: TuningOptions, feet: list[FootParameters]
) -> tuple[DesignVariable, ...]:
    """The fulcrum, then the options' design, with bounds that every one of these feet can meet, or
    InputError."""
    for foot in feet:
        check_movable(foot, "There is nothing to tune on a passive foot")
    low = max(foot.fulcrum.rearmost_m for foot in feet) / MM
    high = min(foot.fulcrum.foremost_m for foot in feet) / MM
    require(low < high, "the carriages of these trials' feet have no range in common", "trials")
    bounds = options.bounds_mm or (low, high)
    require(
        low - 1e-6 <= bounds[0] and bounds[1] <= high + 1e-6,
        f"{bounds[0]:g} to {bounds[1]:g} mm is out of the carriage's reach",
        "bounds_mm",
        f"It must lie within {low:g} to {high:g} mm",
    )
    variables = [
        DesignVariable(
            "fulcrum", "fulcrum position", "mm", float(bounds[0]), float(bounds[1]), float("nan")
        )
    ]
    t = feet[0].keel.thickness_m / MM
    # label, unit, the device as it is, bounds unless others are asked for, the widest ones
    known = {
        "heel_stiffness": ("heel stiffness", "1", 1.0, 0.5, 2.0, 0.05, 20.0),
        "alignment": ("alignment, toe up +", "rad", 0.0, -0.07, 0.07, -0.26, 0.26),
        "keel_thickness": ("keel thickness", "mm", t, 0.8 * t, 1.25 * t, 0.3 * t, 3.0 * t),
    }
    for name in options.design:
        require(
            name != "heel_stiffness" or any(zone.name.startswith(HEEL) for zone in feet[0].zones),
            "the model has no contact zone whose name begins with 'heel'",
            "design",
        )
        label, unit, default, *own, least, most = known[name]
        low, high = options.design_bounds.get(name, own)
        require(
            least <= low and high <= most,
            f"{low:g} to {high:g} is out of range",
            f"design_bounds[{name!r}]",
            f"It must lie within {least:g} to {most:g} {unit}",
        )
        variables.append(DesignVariable(name, label, unit, float(low), float(high), default))
    return tuple(variables)


def device_values(
    name: str, x: float, variables: Mapping[str, Variable], base: Mapping[str, float]
) -> dict[str, tuple[float, float]]:
    """What one of DESIGN at x makes of the walk's variables, by their names: value, and derivative
    by x.

        heel_stiffness      factor on the contact stiffness of every zone whose name begins with
                            "heel"
        alignment           rad added to the trials' own, + toe up (`offset.alignment`)
        keel_thickness      factor; the flexural modulus is multiplied by its third power, as the
                            section's inertia would be. That the mass of the keel changes in
                            proportion is left out

    Values of `base` stand in place of the model's own numbers.
    """
    if name == "alignment":
        return {ALIGNMENT: (base.get(ALIGNMENT, 0.0) + x, 1.0)}
    power, changed = (
        (3, [MODULUS])
        if name == "keel_thickness"
        else (
            1,
            [
                other
                for other in variables
                if other.startswith(f"contact.{HEEL}") and other.endswith(".stiffness")
            ],
        )
    )
    own = {other: base.get(other, variables[other].default) for other in changed}
    return {
        other: (value * x**power, power * value * x ** (power - 1)) for other, value in own.items()
    }


def walk_setting(
    design: tuple[DesignVariable, ...],
    x: np.ndarray,
    variables: Mapping[str, Variable],
    foot: FootParameters,
    base: Mapping[str, float],
) -> tuple[dict[str, float], dict[str, np.ndarray]]:
    """What a walk takes at x (P,), the values of `design` in their units, the fulcrum first; `base`
    as above: values of the walk's variables, and by name the derivatives (P,) of these and of the
    fulcrum's shift by x."""
    values = dict(base)
    by = {SHIFT: np.zeros(len(design))}
    by[SHIFT][0] = MM
    for p, variable in enumerate(design[1:], start=1):
        unit = foot.keel.thickness_m / MM if variable.name == "keel_thickness" else 1.0
        for name, (value, slope) in device_values(
            variable.name, x[p] / unit, variables, base
        ).items():
            values[name] = value
            by.setdefault(name, np.zeros(len(design)))[p] = slope / unit
    return values, by
