"""The factors of the sensitivity study: what one does not know of a walk's model before a fit, and how far.

Each range is the uncertainty that one really has, not what a search may try. Shifts are added to the study's values
(the fitted contact, where there is one); ratios multiply them and are sampled in the logarithm. All are sampled evenly.
Errors of the pelvis's orientation are not among them: where markers on the thigh are tracked, the hip's angles take
them up, and the leg stays where it was.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.analysis.contact_fit.standard import REFERENCE_DEPTH_M
from vsf_drake.simulation.variables import Variable

CONTACT, FRICTION, GEOMETRY, KINEMATICS, BUSHING, KEEL = GROUPS = (
    "contact", "friction", "geometry", "kinematics", "bushing", "keel")
SHIFT, RATIO, EXPONENT = "shift", "ratio", "exponent"
"""How a factor changes its variables: adds to them, multiplies them, or adds to an exponent at the same force at
REFERENCE_DEPTH_M."""
FULCRUM_M = 5e-3
"""How far off the support may really be, either way."""
_ANGLE = "misplaced markers: the standard deviation of the embedded synthetic laboratory's constant errors"
_MARKERS = "errors between cameras, plates and markers, a choice"
_FOAM = "the bench knows the foam under one load point, no more"
_SOCKET = "measured sockets fix it within a factor of two"


@dataclass(frozen=True, kw_only=True)
class Factor:
    """One factor of the study.

    Attributes:
        name: for people. group: one of GROUPS.
        unit: of `low` and `high`: "mm", "deg", "×" (times the study's value) or "1".
        low, high: the range, about no change.
        why: where the range comes from.
        variables: of the walker, which it changes together. kind: how.
    """

    name: str
    group: str
    unit: str
    low: float
    high: float
    why: str
    variables: tuple[str, ...]
    kind: str = SHIFT

    def value(self, share: float, limits: tuple[float, float] = (-math.inf, math.inf)) -> float:
        """What is added or multiplied (SI) at a share from 0 to 1 of the range, or of its part within `limits`."""
        low, high = (min(max(bound * _SI[self.unit], limits[0]), limits[1]) for bound in (self.low, self.high))
        if self.kind == RATIO:
            return float(low * (high / low) ** share)
        return float(low + (high - low) * share)

    def row(self) -> dict[str, Any]:
        """The factor as a row of the table."""
        return {"name": self.name, "group": self.group, "unit": self.unit, "low": self.low, "high": self.high,
                "why": self.why, "variables": list(self.variables)}


_SI = {"mm": 1e-3, "deg": math.radians(1.0), "1": 1.0, "×": 1.0}


def sensitivity_factors(variables: Mapping[str, Variable], side: str) -> tuple[Factor, ...]:
    """The factors of a walker with these variables.

    Args:
        side: of the prosthesis, "right" or "left".
    """
    zones = [name.split(".")[1] for name in variables if name.startswith("contact.") and name.endswith(".stiffness")]
    leg = side[0]
    found = [_ratio(f"{_words(zone)} foam stiffness", CONTACT, 1.5, _FOAM, f"contact.{zone}.stiffness")
             for zone in zones]
    found += [
        Factor(name="foam exponent", group=CONTACT, unit="1", low=-0.2, high=0.2, kind=EXPONENT,
               variables=tuple(f"contact.{zone}.exponent" for zone in zones),
               why=f"foams differ; at the same force at {1e3 * REFERENCE_DEPTH_M:g} mm, so that no stiffness hides in "
                   "it; not below 1"),
        _ratio("foam damping", CONTACT, 2.0, "not measured on the bench, a choice",
               *(f"contact.{zone}.damping" for zone in zones)),
        _ratio("foam depth of full damping", CONTACT, 2.0, "a number of the law rather than of the foam, a choice",
               *(f"contact.{zone}.full_damping_depth" for zone in zones)),
        _ratio("static friction", FRICTION, 1.25, "0.4 to 0.6 about the paper's 0.5: floors and soles differ",
               "friction.mu_static"),
        _ratio("kinetic friction", FRICTION, 1.25, "0.24 to 0.38 about the paper's 0.3", "friction.mu_kinetic"),
        _ratio("friction threshold velocity", FRICTION, 2.0, "a number of the law rather than of the sole, a choice",
               "friction.threshold_velocity"),
        _shift("prosthesis height", GEOMETRY, "mm", 2.0, "length of limb, socket and pylon with a tape",
               "offset.height"),
        _shift("prosthesis fore-aft", GEOMETRY, "mm", 5.0, "where the foot is bolted on, by eye", "offset.fore_aft"),
        _shift("prosthesis alignment", GEOMETRY, "deg", 1.0, "a prosthetist's angle, by eye", "offset.alignment"),
        *(_shift(f"{_words(zone)} sole height", GEOMETRY, "mm", 1.0, "the sole is drawn flat; soles are round",
                 f"contact.{zone}.rise") for zone in zones),
        *(_shift(words, KINEMATICS, "deg", 1.2, _ANGLE, f"coordinate.{name}_{leg}") for words, name in _LEG),
        *(_shift(words, KINEMATICS, "mm", most, _MARKERS, f"coordinate.{name}") for words, name, most in _PELVIS),
        *(_ratio(f"{words} socket stiffness", BUSHING, 1.5, _SOCKET, f"socket.{axis}.stiffness")
          for axis, words in _SOCKET_AXES),
        _ratio("keel modulus", KEEL, 1.1, "data sheets of G10/FR4 differ by 20 %", "keel.flexural_modulus"),
        _ratio("fulcrum stiffness", KEEL, 1.5, "calibrated to two published end points", "fulcrum.stiffness"),
        _shift("fulcrum position", KEEL, "mm", 1e3 * FULCRUM_M, "the support has a width and its drive some play; "
               "inward only where it stands at an end of its reach", "fulcrum.shift")]
    return tuple(factor for factor in found if factor.variables and all(name in variables for name in factor.variables))


_LEG = (("hip flexion", "hip_flexion"), ("hip adduction", "hip_adduction"), ("hip rotation", "hip_rotation"),
        ("knee flexion", "knee_angle"), ("knee adduction", "knee_adduction"), ("knee rotation", "knee_rotation"))
_PELVIS = (
    ("pelvis height", "pelvis_ty", 1.0), ("pelvis fore-aft", "pelvis_tx", 2.0), ("pelvis sideways", "pelvis_tz", 2.0))
_SOCKET_AXES = (("tx", "fore-aft"), ("ty", "sideways"), ("tz", "axial"), ("flexion", "flexion"),
                ("adduction", "adduction"), ("rotation", "rotation"))


def values_at(
    factors: Sequence[Factor], shares: np.ndarray, variables: Mapping[str, Variable],
    limits: Mapping[str, tuple[float, float]] | None = None
) -> dict[str, float]:
    """Values of the walker's variables where the factors stand at these shares (k,) of their ranges, 0 to 1.

    Args:
        limits: lowest and highest shift (SI) by variable, where not all of a factor's range is possible.
    """
    values = {name: variables[name].default for factor in factors for name in factor.variables}
    for factor, share in zip(factors, shares, strict=True):
        change = factor.value(float(share), (limits or {}).get(factor.variables[0], (-math.inf, math.inf)))
        for name in factor.variables:
            if factor.kind == RATIO:
                values[name] *= change
            elif factor.kind == SHIFT:
                values[name] += change
            else:
                before, after = variables[name].default, max(variables[name].default + change, 1.0)
                stiffness = name.replace(".exponent", ".stiffness")
                values[name] = after
                values[stiffness] = values.get(stiffness, variables[stiffness].default) * REFERENCE_DEPTH_M ** (
                    before - after)
    return values


def _ratio(name: str, group: str, most: float, why: str, *variables: str) -> Factor:
    return Factor(name=name, group=group, unit="×", low=1.0 / most, high=most, why=why, variables=variables, kind=RATIO)


def _shift(name: str, group: str, unit: str, most: float, why: str, variable: str) -> Factor:
    return Factor(name=name, group=group, unit=unit, low=-most, high=most, why=why, variables=(variable,))


def _words(zone: str) -> str:
    return zone.replace("_", " ")
