"""Options of `vsf-drake tune` and `schedule`: their words read and checked before anything else is done."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vsf_drake.errors import InputError

SINGLE = ("joint_load", "metabolic", "push_off", "tracking")
WEIGHTED = "weighted"
DESIGN = ("heel_stiffness", "alignment", "keel_thickness")
METHODS = ("hermite_simpson", "trapezoidal")
MOTION_GIVEN, MOTION_FREE = 1, 2
OPTION_OF = {"cost": "--cost", "weights": "--weights", "design": "--design", "bounds_mm": "--fulcrum-range",
             "pareto": "--pareto", "intervals": "--intervals", "method": "--method", "joints": "--joints",
             "warm_start": "--warm-start", "seed": "--seed", "trials": "TRIAL.yaml"}
"""By what the analysis calls it."""


@dataclass(frozen=True, kw_only=True)
class TuneOptions:
    """What was asked for; None where the analysis decides."""

    cost: str
    weights: dict[str, float] | None = None
    level: int = MOTION_GIVEN
    design: tuple[str, ...] = ()
    fulcrum_range_mm: tuple[float, float] | None = None
    intervals: int | None = None
    method: str | None = None
    pareto: tuple[str, ...] | None = None
    joints: tuple[str, ...] | None = None
    seed: int = 0
    workers: int | None = None
    quick: bool = False

    def __post_init__(self) -> None:
        """Raises InputError for what is not there, or cannot go together."""
        if self.cost not in (*SINGLE, WEIGHTED):
            raise _unknown("--cost", self.cost, (*SINGLE, WEIGHTED))
        if self.level not in (MOTION_GIVEN, MOTION_FREE):
            raise InputError(f"{self.level} is no level", where="--level",
                             right="1: the motion is given. 2: the motion adapts")
        if self.weights is not None and self.cost != WEIGHTED:
            raise InputError(f"cannot go with --cost {self.cost}", where="--weights",
                             right=f"Give --cost {WEIGHTED}, or leave it out")
        for option, given in (("--intervals", self.intervals), ("--method", self.method)):
            if given is not None and self.level == MOTION_GIVEN:
                raise InputError("is an option of level 2, where the motion is free", where=option,
                                 right="Leave it out, or give --level 2")
        if self.joints is not None and self.level == MOTION_FREE:
            raise InputError("is an option of level 1; level 2 has all joints of the sagittal plane", where="--joints",
                             right="Leave it out, or give --level 1")
        if self.intervals is not None and self.intervals < 1:
            raise InputError(f"{self.intervals} intervals are none", where="--intervals")
        if self.method is not None and self.method not in METHODS:
            raise _unknown("--method", self.method, METHODS)
        if self.fulcrum_range_mm is not None:
            _check_range(*self.fulcrum_range_mm)

    def told(self) -> dict[str, object]:
        """For the results."""
        return {name: value for name, value in vars(self).items() if value is not None}


def read_weights(text: str | None) -> dict[str, float] | None:
    """`joint_load=1,push_off=0.5` as numbers by cost.

    Raises:
        InputError: a cost is unknown or named twice, a weight is no number from 0 on, or all are zero.
    """
    if text is None:
        return None
    found: dict[str, float] = {}
    for part in text.split(","):
        name, equals, number = (piece.strip() for piece in part.partition("="))
        if not equals:
            raise InputError(f"{part.strip()!r} is no weight", where="--weights",
                             right="Write COST=NUMBER, separated by commas: joint_load=1,push_off=0.5")
        if name not in SINGLE:
            raise _unknown("--weights", name, SINGLE)
        if name in found:
            raise InputError(f"{name} has two weights", where="--weights", right="Give every cost one")
        try:
            found[name] = float(number)
        except ValueError:
            raise InputError(f"{number!r} is no number", where=f"--weights {name}") from None
        if not math.isfinite(found[name]) or found[name] < 0.0:
            raise InputError(f"{number} is no weight", where=f"--weights {name}", right="Give a number from 0 on")
    if not any(found.values()):
        raise InputError("are all zero", where="--weights", right="Give one above 0")
    return found


def read_names(text: str | None, option: str, known: Sequence[str] | None = None) -> tuple[str, ...] | None:
    """Names separated by commas; of `known`, if given.

    Raises:
        InputError: one is unknown or named twice.
    """
    if text is None:
        return None
    names = tuple(part.strip() for part in text.split(",") if part.strip())
    if not names:
        raise InputError("names nothing", where=option)
    for name in names:
        if known is not None and name not in known:
            raise _unknown(option, name, known)
        if names.count(name) > 1:
            raise InputError(f"names {name} twice", where=option)
    return names


def read_pareto(text: str | None) -> tuple[str, ...] | None:
    """Two costs, `A,B`."""
    names = read_names(text, "--pareto", SINGLE)
    if names is not None and len(names) != 2:
        raise InputError(f"names {len(names)} cost{'s' * (len(names) != 1)}", where="--pareto",
                         right="Give two, separated by a comma")
    return names


def as_option(error: InputError, warm_start: Path | None = None) -> InputError:
    """The same mistake, named as the command line names it."""
    where = str(error.where or "").partition("[")[0]
    if error.file is not None or where not in OPTION_OF:
        return error
    file = warm_start if where == "warm_start" else None
    return InputError(error.what, file=file, where=OPTION_OF[where], right=error.right)


def _check_range(low: float, high: float) -> None:
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"{low:g} to {high:g} mm is no range", where="--fulcrum-range",
                         right="Give the lower end first: 66 151")


def _unknown(option: str, name: str, known: Sequence[str]) -> InputError:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    right = f"Did you mean {near[0]}?" if near else f"There are: {', '.join(known)}"
    return InputError(f"there is no {name!r}", where=option, right=right)
