"""What is tuned, and how it enters a walk.

    fulcrum             mm from A
    heel_stiffness      factor on the contact stiffness of every zone whose name begins with "heel"
    alignment           rad added to the trials' own, + toe up (`offset.alignment`)
    keel_thickness      mm; the flexural modulus is multiplied by (t / t0)^3, as the section's inertia would be. That
                        the mass of the keel changes in proportion is left out
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.level1.options import TuningOptions
from vsf_drake.errors import InputError
from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.variables import Variable

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
