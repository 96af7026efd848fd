"""One member of a sweep, and the task that a worker gets for it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.schema import to_plain
from vsf_drake.simulation.many.keys import digest, software
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import DEFAULT_STEP_S

if TYPE_CHECKING:  # reading trials takes a third of a second to import, which workers do not need
    from vsf_drake.motion.trial_record import Trial

ARRAYS = {f.name: f.metadata for f in dataclasses.fields(WalkResult) if "shape" in f.metadata}
"""Arrays of a `WalkResult` by name, each with its shape, unit and meaning."""
DEFAULT_KEEP = ("time_s", "grf_W", "cop_W")


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkCase:
    """One walk of a sweep.

    Attributes:
        trial: whose motion, person and devices; `dataclasses.replace(trial, start_s=..., end_s=...)` for a part of it.
        values: of the walker's variables, by name (see `vsf_drake.simulation.variables`).
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

    def describe(self) -> str:
        """The member's label, trial and parameters in one line."""
        fulcrum = self.trial.fulcrum_m if self.fulcrum_m is None else self.fulcrum_m
        where = "moving" if callable(fulcrum) else f"{1e3 * fulcrum:g} mm" if _is_number(fulcrum) else repr(fulcrum)
        step = f"{1e3 * self.step_s:g} ms" if _is_number(self.step_s) else repr(self.step_s)
        parts = [f"{self.label}: " * bool(self.label) + self.trial.name, f"fulcrum {where}", f"step {step}"]
        if self.offsets is not None:
            parts.append(", ".join(f"{name} {value:g}" for name, value in to_plain(self.offsets).items()))
        parts += [f"{name} {value:g}" if _is_number(value) else f"{name} {value!r}"
                  for name, value in dict(self.values).items()]
        return ", ".join(parts)


class SampledFulcrum:
    """A moving fulcrum as numbers: linear between the instants at which it was taken, exact on them."""

    def __init__(self, time_s: np.ndarray, position_m: np.ndarray) -> None:
        self.time_s, self.position_m = time_s, position_m

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        return np.interp(time_s, self.time_s, self.position_m)


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
        trial, free = case.trial, tuple(case.free)
        person = self._key((id(trial.subject), id(trial.model), free), (trial.subject, trial.model, free), _person_key)
        motion = self._key((id(trial.trajectory),), trial.trajectory, _motion_key)
        offsets = trial.offsets if case.offsets is None else case.offsets
        values = {str(name): _number(value, f"values[{name!r}]") for name, value in dict(case.values).items()}
        options: dict[str, Any] = {
            "start_s": _number(trial.start_s, "start_s"), "end_s": _number(trial.end_s, "end_s"),
            "step_s": _number(case.step_s, "step_s"), "values": values}
        numbers, arrays = dict(options), {}
        fulcrum = trial.fulcrum_m if case.fulcrum_m is None else case.fulcrum_m
        if callable(fulcrum):
            sampled = _sampled(fulcrum, options)
            arrays = {"time_s": sampled.time_s, "position_m": sampled.position_m}
            options["fulcrum_m"] = sampled
        else:
            options["fulcrum_m"] = numbers["fulcrum_m"] = _number(fulcrum, "fulcrum_m")
        options["offsets"] = offsets
        made_by = software()
        try:
            key = digest({"person": person, "motion": motion, **numbers, "offsets": to_plain(offsets),
                          "keep": sorted(self.keep), "software": made_by}, arrays)
        except (TypeError, ValueError) as error:
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
    names = (keep,) if isinstance(keep, str) else tuple(dict.fromkeys(keep))
    unknown = [name for name in names if name not in ARRAYS]
    if unknown or not names:
        raise InputError(f"{unknown[0]!r} is no array of a walk" if unknown else "names no array", where="keep",
                         right=f"There are: {', '.join(ARRAYS)}")
    return names


def _person_key(part: tuple) -> str:
    subject, model, free = part
    try:
        return digest({"subject": to_plain(subject), "model": to_plain(model), "free": list(free)})
    except (TypeError, ValueError) as error:
        raise InputError(f"holds what is not a finite number ({error})", where="subject or model") from None


def _motion_key(trajectory: Any) -> str:
    return digest(list(trajectory.names), {"time_s": trajectory.time_s, "values": trajectory.values})


def _sampled(fulcrum: Callable[[np.ndarray], np.ndarray], options: Mapping[str, float]) -> SampledFulcrum:
    """`fulcrum` on the grid of `Walker.walk`."""
    start, end, step = (options[name] for name in ("start_s", "end_s", "step_s"))
    if step <= 0.0 or end <= start:
        raise InputError(f"{start:g} to {end:g} s in steps of {step:g} s is no time to walk", where="step_s")
    moments = np.minimum(start + step * np.arange(max(1, round((end - start) / step)) + 1), end)
    position = np.array(np.broadcast_to(fulcrum(moments), moments.shape), dtype=float)
    if not np.isfinite(position).all():
        raise InputError(f"is not a finite number at {moments[~np.isfinite(position)][0]:g} s", where="fulcrum_m")
    return SampledFulcrum(moments, position)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float, np.number)) and not isinstance(value, bool)


def _number(value: Any, where: str) -> float:
    if not _is_number(value) or not math.isfinite(value):
        raise InputError(f"{value!r} is not usable", where=where, right="It must be a finite number")
    return float(value)
