"""One member of a sweep, the task that a worker gets for it, and the key under which its walk is kept."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import operator
import platform
import reprlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.laws.compiled import sources_sha256
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.schema import to_plain
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import DEFAULT_STEP_S

if TYPE_CHECKING:
    from vsf_drake.motion.trial_record import Trial


ARRAYS = {f.name: f.metadata for f in dataclasses.fields(WalkResult) if "shape" in f.metadata}
"""Arrays of a `WalkResult` by name, each with its shape, unit and meaning."""
OFFSETS = tuple(f.name for f in dataclasses.fields(GeometricOffsets))
DEFAULT_KEEP = ("time_s", "grf_W", "cop_W")


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkCase:
    """One walk of a sweep.

    Attributes:
        trial: whose motion, person and devices; `dataclasses.replace(trial, start_s=..., end_s=...)` for a part of it.
        values: of the walker's variables, by name (see `vsf_drake.simulation.variables`). A copy is taken.
        fulcrum_m: from A (m), a number or a function of time (s, array to array), which is taken at the ends of the
            steps; None for where it stood in the trial.
        offsets: how the prosthesis sits; None for the trial's own.
        free: anatomical coordinates that are not prescribed.
        label: yours; it names the member in messages and does not enter its numbers.
    """

    trial: Trial
    values: Mapping[str, float] = field(default_factory=dict)
    fulcrum_m: float | Callable[[np.ndarray], np.ndarray] | None = None
    offsets: GeometricOffsets | None = None
    step_s: float = DEFAULT_STEP_S
    free: Sequence[str] = ()
    label: str = ""

    def __post_init__(self) -> None:
        if isinstance(self.values, Mapping):  # what is none is refused when it is walked, as one member of many
            object.__setattr__(self, "values", dict(self.values))

    def describe(self) -> str:
        """The member's label, trial and parameters in one line, also of what cannot be walked."""
        fulcrum, step = self.trial.fulcrum_m if self.fulcrum_m is None else self.fulcrum_m, self.step_s
        where = "moving" if callable(fulcrum) else _scaled(fulcrum, "mm")
        parts = [f"{self.label}: " * (self.label != "") + self.trial.name, f"fulcrum {where}",
                 f"step {_scaled(step, 'ms')}"]
        if isinstance(self.offsets, GeometricOffsets):
            parts += [f"{name} {shown(getattr(self.offsets, name))}" for name in OFFSETS]
        elif self.offsets is not None:
            parts.append(f"offsets {shown(self.offsets)}")
        if isinstance(self.values, Mapping):
            parts += [f"{name} {shown(value)}" for name, value in self.values.items()]
        else:
            parts.append(f"values {shown(self.values)}")
        return ", ".join(parts)


@dataclass(frozen=True, eq=False)
class Task:
    """What a worker needs for one walk. Person and motion go by their keys: it asks for those that it does not know.

    Attributes:
        key: of everything that the numbers depend on.
        person, motion: keys of (subject, model, free) and of the trajectory.
        options: of `Walker.walk`, picklable.
        software: what must run it.
        parts: by key, what the worker has asked for.
    """

    key: str
    person: str
    motion: str
    options: dict[str, Any]
    keep: tuple[str, ...]
    software: dict[str, str]
    parts: dict[str, Any] = field(default_factory=dict)


class Planner:
    """Turns cases into tasks; hashes each person and each recording once, however many cases share it.

    Attributes:
        parts: (subject, model, free) and trajectories by key.
    """

    def __init__(self, keep: tuple[str, ...]) -> None:
        self.keep = keep
        self.parts: dict[str, Any] = {}
        self._keys: dict[tuple, tuple[str, Any]] = {}

    def task(self, case: WalkCase) -> Task:
        """The task of `case`.

        Raises:
            InputError: it holds what cannot be a number, a name or a time.
        """
        trial, free = case.trial, names(case.free)
        values, window = numbers(case.values), {
            "start_s": number(trial.start_s, "start_s"), "end_s": number(trial.end_s, "end_s"),
            "step_s": number(case.step_s, "step_s")}
        check_steps(**window)
        offsets = trial.offsets if case.offsets is None else case.offsets
        if not isinstance(offsets, GeometricOffsets):
            raise InputError(f"{shown(offsets)} is not usable", where="offsets", right="Give GeometricOffsets, or None")
        for name in OFFSETS:
            number(getattr(offsets, name), f"offsets.{name}")
        options: dict[str, Any] = {**window, "values": values}
        plain, arrays = dict(options), {}
        fulcrum = trial.fulcrum_m if case.fulcrum_m is None else case.fulcrum_m
        if callable(fulcrum):
            options["fulcrum_m"] = moving = sampled(fulcrum, **window)
            arrays = {"time_s": moving.time_s, "position_m": moving.position_m}
        else:
            options["fulcrum_m"] = plain["fulcrum_m"] = number(fulcrum, "fulcrum_m")
        person = self._key((id(trial.subject), id(trial.model), free), (trial.subject, trial.model, free), _person_key)
        motion = self._key((id(trial.trajectory),), trial.trajectory, _motion_key)
        options["offsets"] = offsets
        made_by = software()
        try:
            key = digest({"person": person, "motion": motion, **plain, "offsets": to_plain(offsets),
                          "keep": sorted(self.keep), "software": made_by}, arrays)
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(f"holds what is not a finite number ({error})", where="offsets") from None
        return Task(key=key, person=person, motion=motion, options=options, keep=self.keep, software=made_by)

    def _key(self, identity: tuple, part: Any, key_of: Callable[[Any], str]) -> str:
        if identity not in self._keys:
            key = key_of(part)
            self._keys[identity] = key, part  # holding the part keeps its identity from being used again
            self.parts.setdefault(key, part)
        return self._keys[identity][0]


def check_keep(keep: Iterable[str]) -> tuple[str, ...]:
    """`keep` as names of arrays, each once.

    Raises:
        InputError: a name is none of `ARRAYS`, or there is none at all.
    """
    kept = (keep,) if isinstance(keep, str) else tuple(dict.fromkeys(keep))
    unknown = [name for name in kept if name not in ARRAYS]
    if unknown or not kept:
        raise InputError(f"{unknown[0]!r} is no array of a walk" if unknown else "names no array", where="keep",
                         right=f"There are: {', '.join(ARRAYS)}")
    return kept


def _person_key(part: tuple) -> str:
    subject, model, free = part
    try:
        return digest({"subject": to_plain(subject), "model": to_plain(model), "free": list(free)})
    except (TypeError, ValueError) as error:
        raise InputError(f"holds what is not a finite number ({error})", where="subject or model") from None


def _motion_key(trajectory: Any) -> str:
    return digest(list(trajectory.names), {"time_s": trajectory.time_s, "values": trajectory.values})


def _scaled(value: Any, unit: str) -> str:
    """A length (m) or time (s) in thousandths, which `unit` names; whatever else it is as it is."""
    try:
        return f"{1e3 * value:g} {unit}" if is_number(value) else shown(value)
    except OverflowError:
        return shown(value)


# SHA-256 of what numbers depend on: of values, of arrays, and of the software that makes them.
#
# A key is the same on any day, in any process and whatever the order of a mapping, and differs as soon as one bit of
# one number does.


PACKAGE = Path(__file__).resolve().parents[2]
SOURCES = ("laws", "systems", "plants", "simulation", "motion/trajectory.py", "motion/events.py",
           "ground.py", "model_file.py", "parameters.py", "schema.py", "subject.py")
"""Parts of the package that the numbers of a walk come from, once its recording is read."""


def digest(plain: Any, arrays: Mapping[str, np.ndarray] | None = None) -> str:
    """64 hexadecimal digits for plain values (as `schema.to_plain` gives them) and named arrays.

    Raises:
        ValueError: a number in `plain` is not finite.
        TypeError: something in `plain` is not a plain value.
    """
    found = hashlib.sha256(json.dumps(plain, sort_keys=True, allow_nan=False).encode())
    for name, array in sorted((arrays or {}).items()):
        found.update(f"\0{name} {array.dtype.str} {array.shape}\0".encode())
        found.update(np.ascontiguousarray(array).data)
    return found.hexdigest()


@cache
def software() -> dict[str, str]:
    """Versions of what computes a walk, kind of processor, and the digest of this package's own sources.

    A version number alone would let a changed law in a checkout return old numbers. Read when the package is
    imported, so that it describes the code that runs.
    """
    return {**provenance()["versions"], "machine": platform.machine(),
            "sources_sha256": sources_sha256(PACKAGE, SOURCES)}


software()


# What the fields of a case and the counts of a sweep may hold, each refused by its name.


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
