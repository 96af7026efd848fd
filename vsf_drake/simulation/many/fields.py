"""What the fields of a case and the counts of a sweep may hold, each refused by its name."""

from __future__ import annotations

import math
import operator
import reprlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from vsf_drake.errors import InputError

MOST_STEPS = 10_000_000
"""Of one walk; their histories would take some 10 GB."""


class SampledFulcrum:
    """A moving fulcrum as numbers: linear between the instants at which it was taken, exact on them."""

    def __init__(self, time_s: np.ndarray, position_m: np.ndarray) -> None:
        self.time_s, self.position_m = time_s, position_m

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        return np.interp(time_s, self.time_s, self.position_m)


def shown(value: Any) -> str:
    """`value` in a few words, whatever it is: a number in six digits, else its shortened repr."""
    try:
        return f"{value:g}" if is_number(value) else reprlib.repr(value)
    except Exception:  # an integer beyond any float, an object whose repr fails
        return f"a {type(value).__name__} that cannot be shown"


def is_number(value: Any) -> bool:
    """Whether it is one real number, finite or not."""
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def number(value: Any, where: str) -> float:
    """`value` as a float.

    Raises:
        InputError: it is no finite real number.
    """
    try:
        found = float(value) if is_number(value) else math.nan
    except OverflowError:
        found = math.inf
    if not math.isfinite(found):
        raise InputError(f"{shown(value)} is not usable", where=where, right="It must be a finite number")
    return found


def whole(value: Any, where: str, least: int) -> int:
    """`value` as an int.

    Raises:
        InputError: it is no whole number, or less than `least`.
    """
    try:
        found = least - 1 if isinstance(value, bool) else operator.index(value)
    except TypeError:
        found = least - 1
    if found < least:
        raise InputError(f"{shown(value)} is not usable", where=where,
                         right=f"It must be a whole number, {least} or more")
    return found


def numbers(values: Any) -> dict[str, float]:
    """`WalkCase.values` as floats by name.

    Raises:
        InputError: it is no mapping, or one of them is no finite number.
    """
    if not isinstance(values, Mapping):
        raise InputError(f"{shown(values)} is no mapping", where="values",
                         right="Give numbers by the names of variables, or {} for none")
    return {str(name): number(value, f"values[{name!r}]") for name, value in values.items()}


def names(free: Any) -> tuple[str, ...]:
    """`WalkCase.free` as a tuple.

    Raises:
        InputError: it is not a sequence of names.
    """
    if isinstance(free, str):
        raise InputError(f"{shown(free)} is one name, not a sequence of names", where="free", right=f"Give ({free!r},)")
    if not isinstance(free, (Sequence, set, frozenset, np.ndarray)) or not all(isinstance(name, str) for name in free):
        raise InputError(f"{shown(free)} is no sequence of names", where="free",
                         right="Give names of coordinates, or () for none")
    return tuple(str(name) for name in free)


def check_steps(start_s: float, end_s: float, step_s: float) -> None:
    """Refuses what no memory could hold; other faults of the window are the walker's to name.

    Raises:
        InputError: there are more than MOST_STEPS.
    """
    if step_s > 0.0 and (end_s - start_s) / step_s > MOST_STEPS:
        raise InputError(f"{start_s:g} to {end_s:g} s in steps of {step_s:g} s are more than {MOST_STEPS:,} steps",
                         where="step_s", right="Give a longer step")


def sampled(fulcrum: Callable[[np.ndarray], Any], start_s: float, end_s: float, step_s: float) -> SampledFulcrum:
    """`fulcrum` on the grid of `Walker.walk`.

    Raises:
        InputError: there is no such grid, or it does not give one finite real number for each time.
    """
    if step_s <= 0.0 or end_s <= start_s:
        raise InputError(f"{start_s:g} to {end_s:g} s in steps of {step_s:g} s is no time to walk", where="step_s")
    moments = np.minimum(start_s + step_s * np.arange(max(1, round((end_s - start_s) / step_s)) + 1), end_s)
    right = "It must return one finite number (m) for each time, or one for all"
    try:
        given = np.asarray(fulcrum(moments.copy()))
    except Exception as error:  # the caller's function can raise anything
        raise InputError(f"the function raises {type(error).__name__}: {error}", where="fulcrum_m",
                         right=right) from None
    if given.dtype.kind not in "fiu":
        raise InputError(f"the function returns {shown(given)}, no real numbers", where="fulcrum_m", right=right)
    try:
        position = np.array(np.broadcast_to(given, moments.shape), dtype=float)
    except ValueError:
        raise InputError(f"the function returns the shape {given.shape} for {moments.size} times", where="fulcrum_m",
                         right=right) from None
    if not np.isfinite(position).all():
        raise InputError(f"is not a finite number at {moments[~np.isfinite(position)][0]:g} s", where="fulcrum_m")
    return SampledFulcrum(moments, position)
