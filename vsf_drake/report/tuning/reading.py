"""What a page reads off the record of a tuning, and its arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from vsf_drake.tuning.common import SETTINGS
from vsf_drake.tuning.table import Outcome, TuningTable

Arrays = Mapping[str, np.ndarray]
SHOWN = SETTINGS[:3]  # settings of a tuning beside the recorded one
FEET = {"prosthetic": "prosthetic foot", "intact": "intact foot"}
LENGTHS = ("pelvis_tx", "pelvis_ty", "pelvis_tz")  # coordinates in metres, not radians
_NEAR_MM = 0.05  # positions that are nearer than this are one


def recorded_positions(table: TuningTable) -> list[float]:
    """Where the fulcrum stood in the trials (mm), each position once, rising; empty if the table
    does not say."""
    return sorted(set(table.recorded_mm))


def shown_outcomes(table: TuningTable) -> list[Outcome]:
    """Outcomes that were followed over the range."""
    return [row for row in table.outcomes if len(table.swept("outcomes", row.name)[0]) > 1]


@dataclass(frozen=True)
class Compared:
    """A setting beside the optimum."""

    name: str  # in words
    mm: float
    recorded: bool  # whether an end of the range was recorded too
    saved: float | None  # by the optimum, in the cost's unit; None at the optimum itself
    percent: float | None = None  # the same; None for costs that are not positive


def compared(
    table: TuningTable, cost: Callable[[float], float | None], own: float
) -> list[Compared]:
    """`own`, a cost at the optimum, against that at the ends and at recorded settings."""
    x, _ = table.swept()
    if not len(x):
        return []
    recorded = recorded_positions(table)
    inside = [mm for mm in recorded if x[0] < mm < x[-1]]
    names = [
        "the softest setting",
        "the stiffest",
        *["the recorded setting" if len(recorded) == 1 else "another recorded one"] * len(inside),
    ]
    places: list[Compared] = []
    for i, (name, mm) in enumerate(zip(names, [float(x[0]), float(x[-1]), *inside], strict=True)):
        there = cost(mm)
        also = i < 2 and mm in recorded
        if table.fulcrum_mm is not None and abs(mm - table.fulcrum_mm) < _NEAR_MM:
            places.append(Compared(name, mm, also, None))
        elif there is not None:
            percent = 100.0 * (there - own) / there if there > 0.0 and own > 0.0 else None
            places.append(Compared(name, mm, also, there - own, percent))
    return places


def drawn_trials(table: TuningTable, arrays: Arrays) -> dict[str, str]:
    """Up to three trials of a level 1 tuning whose forces there are: what their arrays begin with,
    by label."""
    prefixes = {
        name: f"trial_{i}_"
        for i, name in enumerate(table.trials)
        if any(f"trial_{i}_{setting}" in arrays for setting in SHOWN)
    }
    names = list(prefixes)
    return (
        {name: prefixes[name] for name in (names[0], names[len(names) // 2], names[-1])}
        if names
        else {}
    )


def root_mean_squares(arrays: Arrays, key: str, other: str = "_recorded") -> np.ndarray | None:
    """Of the differences of `key` and its recorded (or `other`) counterpart, column by column; None
    without one."""
    own = arrays.get(key)
    against = arrays.get(f"{key}{other}")
    if own is None or against is None or np.shape(own) != np.shape(against):
        return None
    return np.asarray(np.sqrt(np.mean((np.asarray(own) - np.asarray(against)) ** 2, axis=0)))
