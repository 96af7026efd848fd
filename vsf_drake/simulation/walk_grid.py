"""The instants of a walk's steps, and what a caller gives on them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.simulation.variables import check_number

MAX_STEP_S = 0.01
MOST_STEPS = 10_000_000
"""Longer walks are mistakes in a unit."""


def walk_grid(start_s: float, end_s: float, step_s: float) -> tuple[np.ndarray, float]:
    """The n + 1 instants (s) from `start_s` to `end_s`, and the step (s) as a float.

    Raises:
        InputError: a number is not finite or makes no sense.
    """
    start_s, end_s, step_s = (check_number(value, where) for value, where in
                              ((start_s, "start_s"), (end_s, "end_s"), (step_s, "step_s")))
    if not 0.0 < step_s <= MAX_STEP_S:
        raise InputError(f"{step_s:g} s is not a usable step", where="step_s",
                         right=f"It must be above 0 and at most {MAX_STEP_S:g} s")
    if not 0.0 < end_s - start_s <= MOST_STEPS * step_s:
        raise InputError(f"{start_s:g} to {end_s:g} s is no time to walk", where="start_s, end_s")
    steps = max(1, round((end_s - start_s) / step_s))
    moments = start_s + step_s * np.arange(steps + 1)
    moments[-1] = min(moments[-1], end_s)
    return moments, step_s


def fulcrum_on_grid(fulcrum_m: float | Callable[[np.ndarray], np.ndarray], moments: np.ndarray) -> np.ndarray:
    """Positions (n,) at the moments (n,)."""
    given = np.asarray(fulcrum_m(moments) if callable(fulcrum_m) else fulcrum_m)
    if given.dtype.kind not in "iuf" or given.shape not in ((), moments.shape) or not np.isfinite(given).all():
        raise InputError(f"gives {given.dtype} numbers of shape {given.shape} for {len(moments)} times",
                         where="fulcrum_m", right="Give a finite number (m), or a function with one for each time")
    return np.broadcast_to(given.astype(float), moments.shape)
