"""One member of a sweep, the task that a worker gets for it, and the key under which its walk is
kept; samples."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import json
import platform
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.base.schema import to_plain
from vsf_drake.laws.compiled import sources_sha256
from vsf_drake.laws.lanes import WIDTH
from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.results import ARRAYS
from vsf_drake.simulation.variables import (
    Variable,
    check_names,
    check_number,
    check_whole,
    is_number,
    shown,
)
from vsf_drake.simulation.walk import (
    DEFAULT_STEP_S,
    Walk,
    fulcrum_on_grid,
    walk_grid,
)

if TYPE_CHECKING:
    from vsf_drake.motion.trial import Trial


OFFSETS = tuple(f.name for f in dataclasses.fields(GeometricOffsets))
DEFAULT_KEEP = ("time_s", "grf_W", "cop_W")
Person = tuple[Subject, ModelParameters, tuple[str, ...]]  # with the free coordinates


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkCase:
    """One walk of a sweep."""

    trial: Trial
    """Whose motion, person and devices; `dataclasses.replace(trial, start_s=..., end_s=...)` for a
    part of it."""
    values: Mapping[str, float] = field(default_factory=dict)
    """Of the walker's variables, by name (see `vsf_drake.simulation.variables`). A copy is
    taken."""
    fulcrum_m: float | Callable[[np.ndarray], np.ndarray] | None = None
    """From A (m), a number or a function of time (s, array to array), which is taken at the ends of
    the steps; None for where it stood in the trial."""
    offsets: GeometricOffsets | None = None
    """How the prosthesis sits; None for the trial's own."""
    step_s: float = DEFAULT_STEP_S
    free: Sequence[str] = ()
    """Anatomical coordinates that are not prescribed."""
    label: str = ""
    """Yours; it names the member in messages and does not enter its numbers."""

    def __post_init__(self) -> None:
        # what is none is refused when it is walked, as one member of many
        if isinstance(self.values, Mapping):
            object.__setattr__(self, "values", dict(self.values))

    def describe(self) -> str:
        """The member's label, trial and parameters in one line, also of what cannot be walked."""
        fulcrum = self.trial.fulcrum_m if self.fulcrum_m is None else self.fulcrum_m
        where = "moving" if callable(fulcrum) else _scaled(fulcrum, "mm")
        offsets = {} if self.offsets is None else {"offsets": self.offsets}
        if isinstance(self.offsets, GeometricOffsets):
            offsets = vars(self.offsets)
        numbers = {
            **offsets,
            **(self.values if isinstance(self.values, Mapping) else {"values": self.values}),
        }
        return ", ".join(
            [
                f"{self.label}: " * (self.label != "") + self.trial.name,
                f"fulcrum {where}",
                f"step {_scaled(self.step_s, 'ms')}",
                *(f"{k} {shown(v)}" for k, v in numbers.items()),
            ]
        )


class WalkScorer(Protocol):
    """What says numbers of the walks of one trial, where they are made; picklable."""

    @property
    def key(self) -> str:
        """SHA-256 of everything that its numbers depend on beside the walk."""

    def __call__(self, walks: Sequence[Walk], /) -> Sequence[Mapping[str, float | None]]:
        """The numbers of each of the walks, which share their instants; InputError if none of them
        can have any."""


@dataclass(frozen=True, eq=False)
class WorkerTask:
    """What a worker needs for one walk."""

    key: str  # of everything that the numbers depend on
    made_by: str  # of software and of what is kept, the same for all tasks of a batch
    person_key: str  # of `person`
    person: Person
    motion_key: str  # of the trajectory `motion`
    motion: Any
    steps: int
    options: dict[str, Any]  # of `Walker.walk`, picklable
    keep: tuple[str, ...]
    scorer: WalkScorer | None
    software: dict[str, str]  # what must run it


class Planner:
    """Turns cases into tasks; hashes each person and each recording once, however many cases share
    it."""

    def __init__(
        self, keep: tuple[str, ...], score: Callable[[Trial], WalkScorer] | None = None
    ) -> None:
        self.keep = keep
        self._score = score
        self._scorers: dict[int, tuple[WalkScorer, Trial]] = {}
        self._software = software()
        self._made_by = digest({"keep": sorted(keep), "software": self._software})
        self._keys: dict[tuple[object, ...], tuple[str, Any]] = {}

    def task(self, case: WalkCase) -> WorkerTask:
        """The task of `case`; InputError if it holds what cannot be a number, a name or a time."""
        trial = case.trial
        free = _names(case.free)
        if not isinstance(case.values, Mapping):
            raise InputError(
                f"{shown(case.values)} is no mapping",
                where="values",
                right="Give numbers by the names of variables, or {} for none",
            )
        values = {
            str(name): check_number(value, f"values[{name!r}]")
            for name, value in case.values.items()
        }
        moments, step_s = walk_grid(trial.start_s, trial.end_s, case.step_s)
        offsets = trial.offsets if case.offsets is None else case.offsets
        if not isinstance(offsets, GeometricOffsets):
            raise InputError(
                f"{shown(offsets)} is not usable",
                where="offsets",
                right="Give GeometricOffsets, or None",
            )
        for name in OFFSETS:
            check_number(getattr(offsets, name), f"offsets.{name}")
        plain: dict[str, Any] = {
            "start_s": float(trial.start_s),
            "end_s": float(trial.end_s),
            "step_s": step_s,
            "values": values,
        }
        fulcrum: Any = trial.fulcrum_m if case.fulcrum_m is None else case.fulcrum_m
        position = fulcrum_on_grid(fulcrum, moments)
        arrays = {}
        if callable(fulcrum):
            # linear between the instants at which it was taken, exact on them
            options = plain | {"fulcrum_m": partial(np.interp, xp=moments, fp=position)}
            arrays = {"time_s": moments, "position_m": position}
        else:
            options = plain = plain | {"fulcrum_m": float(position[0])}
        person = (trial.subject, trial.model, free)
        person_key = self._key((id(trial.subject), id(trial.model), free), person, _person_key)
        motion_key = self._key((id(trial.trajectory),), trial.trajectory, _motion_key)
        scorer = None if self._score is None else self._scorer(trial, self._score)
        key = _finite_digest(
            "offsets",
            {
                "person": person_key,
                "motion": motion_key,
                **plain,
                "offsets": to_plain(offsets),
                "made_by": self._made_by,
                "score": "" if scorer is None else scorer.key,
            },
            arrays,
        )
        return WorkerTask(
            key=key,
            made_by=self._made_by,
            person_key=person_key,
            person=person,
            motion_key=motion_key,
            motion=trial.trajectory,
            steps=len(moments) - 1,
            options=options | {"offsets": offsets},
            keep=self.keep,
            scorer=scorer,
            software=self._software,
        )

    def _scorer(self, trial: Trial, score: Callable[[Trial], WalkScorer]) -> WalkScorer:
        if id(trial) not in self._scorers:
            # likewise
            self._scorers[id(trial)] = score(trial), trial
        return self._scorers[id(trial)][0]

    def _key(self, identity: tuple[object, ...], part: Any, key_of: Callable[[Any], str]) -> str:
        if identity not in self._keys:
            # holding the part keeps its identity from being used again
            self._keys[identity] = key_of(part), part
        return self._keys[identity][0]


BLOCK = 32
"""Most walks that a worker is given at a time: what an interruption costs, at most, and what one
file of the cache holds."""
BLOCK_STEPS = 100_000  # above which a block is of WIDTH walks only: some seconds of work


def blocks(tasks: Sequence[WorkerTask], workers: int) -> Iterator[tuple[WorkerTask, ...]]:
    """The tasks in blocks of one person, of like length side by side; smaller towards the end, so
    that so many workers end together."""
    people: dict[str, list[WorkerTask]] = {}
    for task in tasks:
        people.setdefault(task.person_key, []).append(task)
    left = len(tasks)
    for own in people.values():
        own.sort(key=lambda task: task.steps)
        at = 0
        while at < len(own):
            each = -(-left // workers)
            share = each if workers == 1 else max(-(-each // 2), min(each, WIDTH))
            size = min(share, BLOCK, max(WIDTH, BLOCK_STEPS // own[at].steps))
            if size > WIDTH:
                size -= size % WIDTH
            block = tuple(own[at : at + size])
            yield block
            at += len(block)
            left -= len(block)


def check_keep(keep: Iterable[str], *, scored: bool) -> tuple[str, ...]:
    """`keep` as names of arrays, each once; InputError if one is none of `ARRAYS`, or there is none
    and nothing is `scored` either."""
    names = (keep,) if isinstance(keep, str) else tuple(dict.fromkeys(keep))
    unknown = [name for name in names if name not in ARRAYS]
    if unknown or not (names or scored):
        raise InputError(
            f"{unknown[0]!r} is no array of a walk" if unknown else "names no array",
            where="keep",
            right=f"There are: {', '.join(ARRAYS)}",
        )
    return names


def _person_key(part: Person) -> str:
    return _finite_digest(
        "subject or model", dict(zip(("subject", "model", "free"), to_plain(part), strict=True))
    )


def _motion_key(trajectory: Any) -> str:
    return digest(
        list(trajectory.names), {"time_s": trajectory.time_s, "values": trajectory.values}
    )


def _finite_digest(where: str, plain: Any, arrays: Mapping[str, np.ndarray] | None = None) -> str:
    try:
        return digest(plain, arrays)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"holds what is not a finite number ({error})", where=where) from None


def _scaled(value: Any, unit: str) -> str:
    """A length (m) or time (s) in thousandths, which `unit` names; whatever else it is as it is."""
    try:
        return f"{1e3 * value:g} {unit}" if is_number(value) else shown(value)
    except OverflowError:
        return shown(value)


# SHA-256 of what numbers depend on: of values, of arrays, and of the software that makes them.
#
# A key is the same on any day, in any process and whatever the order of a mapping, and differs as
# soon as one bit of one number does.


PACKAGE = Path(__file__).resolve().parents[2]
SOURCES = (
    "laws",
    "systems",
    "plants",
    "simulation",
    "motion/trajectory.py",
    "motion/events.py",
    "model/ground.py",
    "model/model_file.py",
    "model/parameters.py",
    "base/schema.py",
    "base/sentences.py",
)
"""Parts of the package that the numbers and notes of a walk come from, once its recording is
read."""


def digest(plain: Any, arrays: Mapping[str, np.ndarray] | None = None) -> str:
    """64 hexadecimal digits for plain values (as `schema.to_plain` gives them) and named arrays;
    ValueError for what is not finite, TypeError for what is not plain."""
    sha256 = hashlib.sha256(json.dumps(plain, sort_keys=True, allow_nan=False).encode())
    for name, array in sorted((arrays or {}).items()):
        sha256.update(f"\0{name} {array.dtype.str} {array.shape}\0".encode())
        sha256.update(np.ascontiguousarray(array).data)
    return sha256.hexdigest()


@cache
def software() -> dict[str, str]:
    """Versions of what computes a walk, kind of processor, and the digest of this package's own
    sources.

    A version number alone would let a changed law in a checkout return old numbers. Read when the
    package is imported, so that it describes the code that runs.
    """
    return {
        **provenance()["versions"],
        "machine": platform.machine(),
        "sources_sha256": sources_sha256(PACKAGE, SOURCES),
    }


software()


def _names(free: Any) -> tuple[str, ...]:
    """`WalkCase.free` as a tuple."""
    if isinstance(free, str):
        raise InputError(
            f"{shown(free)} is one name, not a sequence of names",
            where="free",
            right=f"Give ({free!r},)",
        )
    if not isinstance(free, (Sequence, set, frozenset, np.ndarray)) or not all(
        isinstance(name, str) for name in free
    ):
        raise InputError(
            f"{shown(free)} is no sequence of names",
            where="free",
            right="Give names of coordinates, or () for none",
        )
    return tuple(str(name) for name in free)


# Values for the members of a sweep: every combination on a grid, or a random sample that fills the
# bounds evenly.


def grid_values(axes: Mapping[str, Sequence[float]]) -> list[dict[str, float]]:
    """Every combination of the values in `axes` (by variable), the last one running fastest."""
    return [
        dict(zip(axes, map(float, row), strict=True)) for row in itertools.product(*axes.values())
    ]


def sample_values(
    variables: Mapping[str, Variable], names: Sequence[str], count: int, seed: int
) -> list[dict[str, float]]:
    """A Latin hypercube over the bounds of `names` (McKay, Beckman & Conover 1979, doi
    10.1080/00401706.1979.10489755).

    The range of each variable is cut into `count` equal slices and each slice is met once. Where
    the lower bound is above zero the logarithm is cut, because such bounds are ratios.

    Gives `count` sets of values, the same ones for the same seed; `variables` are a walker's.
    """
    names = check_names(
        list(names) if isinstance(names, np.ndarray) else names, variables, where="names"
    )
    count = check_whole(count, "count", 0)
    seed = check_whole(seed, "seed", 0)
    if count < 1 or not names:
        raise InputError(f"{count} sets of {len(names)} values are none", where="count, names")
    random = np.random.default_rng(seed)
    columns = []
    for name in names:
        share = (random.permutation(count) + random.uniform(size=count)) / count
        low = variables[name].low
        high = variables[name].high
        columns.append(low * (high / low) ** share if low > 0.0 else low + (high - low) * share)
    return [dict(zip(names, map(float, row), strict=True)) for row in zip(*columns, strict=True)]
