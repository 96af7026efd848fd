"""One member of a sweep, and the task that a worker gets for it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.schema import to_plain
from vsf_drake.simulation.many.fields import check_steps, is_number, names, number, numbers, sampled, shown
from vsf_drake.simulation.many.keys import digest, software
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import DEFAULT_STEP_S

if TYPE_CHECKING:  # reading trials takes a third of a second to import, which workers do not need
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
