"""What the paper's contact fit varies, in the paper's units, and how it draws scenarios.

    contact.ZONE.stiffness            k, N/mm^n      of each of the foot's zones
    contact.ZONE.exponent             n
    contact.ZONE.damping              b, N s/mm
    contact.ZONE.full_damping_depth   mm
    friction.*                        as in a walk (SI), only if asked for

A normal distribution is not the same in other units. In these, a sphere 1 mm deep carries k whatever n is, so that n
and k can be drawn independently of each other; in N/m^n they cannot.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import truncnorm

from vsf_drake.errors import InputError
from vsf_drake.simulation.variables import Variable, check_values

FRICTION = ("friction.mu_static", "friction.mu_kinetic", "friction.threshold_velocity")
FULL_DAMPING_MM = 1.0
"""Depth of full damping in the initial guess (McGeehan 2021)."""
DAMPING_OVER_STIFFNESS = 0.5
"""Of the initial guess, N s/mm over N/mm (McGeehan 2021)."""
_MM_PER_M = 1e3


@dataclass(frozen=True, kw_only=True, eq=False)
class PaperSpace:
    """The parameters of one fit.

    Attributes:
        names: (P) of variables of a walk.
        start, low, high: (P,) initial guess and bounds, in the units above.
    """

    names: tuple[str, ...]
    start: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def values(self, x: np.ndarray) -> dict[str, float]:
        """The values of a walk's variables (SI) at x (P,)."""
        own = dict(zip(self.names, map(float, x), strict=True))
        found = dict(own)
        for name, value in own.items():
            if name.endswith(".stiffness"):
                found[name] = value * _MM_PER_M ** own[name.removesuffix("stiffness") + "exponent"]
            elif name.endswith(".damping"):
                found[name] = value * _MM_PER_M
            elif name.endswith(".full_damping_depth"):
                found[name] = value / _MM_PER_M
        return found

    def change(self, x: np.ndarray, other: np.ndarray) -> float:
        """Largest difference of a parameter between two points, over the distance of its bounds."""
        return float(np.max(np.abs(other - x) / (self.high - self.low)))

    def sample(self, centre: np.ndarray, *, count: int, spread: float, random: np.random.Generator) -> np.ndarray:
        """(count, P) scenarios: a Latin hypercube of normal distributions round `centre`, cut off at the bounds.

        Each parameter's distribution is cut into `count` slices of equal probability and each slice is met once (McKay,
        Beckman & Conover 1979, doi 10.1080/00401706.1979.10489755).

        Args:
            spread: standard deviation over the value at the centre, before cutting off.
        """
        columns = []
        for value, low, high in zip(centre, self.low, self.high, strict=True):
            share = (random.permutation(count) + random.uniform(size=count)) / count
            scale = spread * value
            drawn = truncnorm.ppf(share, (low - value) / scale, (high - value) / scale, loc=value, scale=scale)
            columns.append(np.clip(drawn, low, high))
        return np.column_stack(columns)


def paper_space(
    variables: Mapping[str, Variable], stiffness: float, *, fold: float, exponents: tuple[float, float],
    full_damping_mm: tuple[float, float], friction: bool
) -> PaperSpace:
    """The paper's initial guess with one stiffness for all zones, and bounds about it.

    Args:
        variables: of the walker.
        stiffness: N/mm.
        fold: bounds of stiffness and damping are their initial guess divided and multiplied by this.
        exponents, full_damping_mm: bounds.
        friction: whether the coefficients are varied as well, within the variables' own bounds.

    Raises:
        InputError: the initial guess lies outside of bounds, or a bound is out of the model's range.
    """
    damping = DAMPING_OVER_STIFFNESS * stiffness
    law = {"stiffness": (stiffness, stiffness / fold, fold * stiffness), "exponent": (1.0, *exponents),
           "damping": (damping, damping / fold, fold * damping),
           "full_damping_depth": (FULL_DAMPING_MM, *full_damping_mm)}
    rows = {f"contact.{zone}.{name}": row for zone in zones(variables) for name, row in law.items()}
    if friction:
        rows |= {name: (variables[name].default, variables[name].low, variables[name].high) for name in FRICTION}
    for name, (start, low, high) in rows.items():
        if not low <= start <= high or not low < high:
            raise InputError(f"the initial guess {start:g} of {name} does not lie in its bounds {low:g} to {high:g}",
                             where="bounds")
    table = np.array([*rows.values()])
    space = PaperSpace(names=tuple(rows), start=table[:, 0], low=table[:, 1], high=table[:, 2])
    for corner in (space.low, space.high):
        check_values(space.values(corner), variables)
    return space


def zones(variables: Mapping[str, Variable]) -> tuple[str, ...]:
    """The zones of the foot's spheres."""
    return tuple(name.split(".")[1] for name in variables
                 if name.startswith("contact.") and name.endswith(".stiffness"))
