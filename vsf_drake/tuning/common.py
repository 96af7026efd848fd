"""What the tunings of both levels share: costs by name, checks and options."""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.schema import SEED, check, choice, option, quantity
from vsf_drake.base.sentences import say
from vsf_drake.collocation.methods import METHODS
from vsf_drake.tuning.quantities import FREE_CHECKS, GIVEN_CHECKS

if TYPE_CHECKING:
    from vsf_drake.motion.trial import Trial

# costs that stand for themselves; "weighted" adds them up
COSTS = ("joint_load", "metabolic", "push_off", "tracking")
FREE_COSTS = (*COSTS, "activation")  # where the motion adapts
WEIGHTED = "weighted"
DESIGN = ("heel_stiffness", "alignment", "keel_thickness")  # what may be tuned beside the fulcrum
JOINTS = (
    "hip_flexion",
    "hip_adduction",
    "hip_rotation",
    "knee_angle",
    "knee_adduction",
    "knee_rotation",
)
SETTINGS = SOFTEST, OPTIMUM, STIFFEST, RECORDED = "softest", "optimum", "stiffest", "recorded"
"""Settings of the fulcrum that a reader compares; the recorded one is each trial's own, the device
as it is."""
SEEN_SHARE = 0.01  # of an outcome, below which a change of it counts as none (a choice)
SEEN = {"BW": 0.01, "deg": 1.0}
"""The same by unit, where a laboratory at its best sees no less, however small the outcome: 1 % of
body weight of a plate's force, one degree of a joint angle by markers within a session (choices;
between sessions it is 2 to 5 degrees: McGinley 2009, doi:10.1016/j.gaitpost.2008.09.003)."""


def chosen(default: Any, unit: str, **told: Any) -> Any:
    """A number as of `quantity` whose default is a choice."""
    return quantity(default, unit=unit, source="choice", **told)


def check_name(name: str, known: Sequence[str], where: str) -> str:
    """Returns a name that is one of those known, or raises InputError with the one that is
    meant."""
    if name not in known:
        near = difflib.get_close_matches(str(name), known, n=1)
        raise InputError(
            f"there is no {name!r}",
            where=where,
            right=f"Did you mean {near[0]}?" if near else f"There are: {', '.join(known)}",
        )
    return name


def digests(labels: Sequence[str], trials: Sequence[Trial]) -> dict[str, str]:
    """SHA-256 by trial and file of what the trials were read from."""
    return {
        f"{label}: {file}": digest
        for label, trial in zip(labels, trials, strict=True)
        for file, digest in trial.inputs.items()
    }


def least_seen(values: Iterable[float], unit: str) -> float:
    """By how much an outcome that has these values must change to count, in its unit."""
    return max(SEEN_SHARE * max(map(abs, values)), SEEN.get(unit, 0.0))


def check_cost(cost: str, known: Sequence[str] = COSTS) -> str:
    """Returns the name of a cost, or raises InputError."""
    return check_name(cost, (*known, WEIGHTED), "cost")


@dataclass(frozen=True)
class TuningCheck:
    """What a solution was held against; `met` None where nothing is demanded or it could not be
    made."""

    name: str
    label: str
    value: float | None
    unit: str
    target: float | str | None
    met: bool | None
    sentence: str


class Checks(list[TuningCheck]):
    """What a solution of a level was held against, in the words of that level."""

    def __init__(self, level: int) -> None:
        super().__init__()
        self.labels = {1: GIVEN_CHECKS, 2: FREE_CHECKS}[level]
        self.wording, self.at_most = {1: ("level1", ""), 2: ("stride", "<= {:g}")}[level]

    def add(
        self,
        name: str,
        value: float | None,
        target: float | str | None,
        met: bool | None = None,
        *,
        row: str = "",
        part: str = "",
        unit: str | None = None,
        **numbers: Any,
    ) -> None:
        """One more, met where its value is no more than a number as a target, unless `met` says;
        its sentence knows value, target and `numbers`.

        `row` of the labels, the name unless given; `part` of the wording, the row unless given.
        """
        own = self.labels[row or name]
        limit = None if target is None or isinstance(target, str) else float(target)
        if met is None and value is not None and limit is not None:
            met = value <= limit
        self.append(
            TuningCheck(
                name,
                own.label.format(**numbers),
                None if value is None else float(value),
                own.unit if unit is None else unit,
                self.at_most.format(target) if self.at_most and limit is not None else target,
                None if met is None else bool(met),
                say(self.wording, part or row or name, value=value, target=target, **numbers)[0],
            )
        )


@dataclass(frozen=True, kw_only=True)
class CommonOptions:
    """Options that tunings of both levels have; InputError where one is none of what it may be. All
    are choices.

    Attributes:
        bounds_mm: least and largest fulcrum position from A; None for the carriage's reach.
        design: what is tuned together with the fulcrum; `design_bounds`: (low, high) by name, in
            its unit.
        weights: of `costs` in the weighted cost, each divided by its size in what was recorded;
            their sum counts as 1.
        socket_weight: of the socket's wrench against the joints' moments in the cost joint_load.
            The axial force bears the body and its square is about a hundred times those of the
            normalised moments: with 0.01 both count.
        late_share: of prosthetic stance, after which positive power counts as push-off.
        starts: most searches. iterations: of one. confirm: solvers that search again.
        draws: of the contact's parameters, by which the optimum's uncertainty is judged; 0 for
            none.
    """

    costs: ClassVar[tuple[str, ...]] = COSTS

    bounds_mm: tuple[float, float] | None = option(
        None,
        "Range of fulcrum positions (mm) to choose from. Default: the carriage's reach.",
        flag="--fulcrum-range",
        metavar="LOW HIGH",
    )
    design: tuple[str, ...] = choice(
        (),
        options=(),
        source="choice",
        metavar="NAME,...",
        help=f"Variables that are chosen besides the fulcrum: {', '.join(DESIGN)}.",
    )
    design_bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    weights: Mapping[str, float] = field(
        default_factory=lambda: {"joint_load": 1.0, "metabolic": 1.0, "push_off": 1.0},
        metadata={
            "unit": "1",
            "low": 0.0,
            "high": math.inf,
            "source": "choice",
            "metavar": "COST=NUMBER,...",
            "help": f"Weights of the costs in --cost {WEIGHTED}, each divided by its value at the "
            "recorded setting.",
        },
    )
    socket_weight: float = chosen(0.01, "1", low=0.0, high=100.0)
    late_share: float = chosen(0.5, "1", low=0.0, high=0.95)
    starts: int = chosen(3, "1", low=1)
    iterations: int = chosen(60, "1", low=1)
    confirm: tuple[str, ...] = choice((), options=("snopt", "ipopt", "nlopt"), source="choice")
    draws: int = chosen(6, "1", low=0)
    seed: int = chosen(0, "1", low=0, help=SEED)

    def __post_init__(self) -> None:
        for item in dataclasses.fields(self):
            names = getattr(self, item.name)
            if str(item.type) == "tuple[str, ...]":
                require(
                    isinstance(names, tuple),
                    f"is a {type(names).__name__}, no tuple of names",
                    item.name,
                )
                for name in names:
                    require(names.count(name) <= 1, f"names {name} twice", item.name)
        check(self)
        known = type(self).__dataclass_fields__["design"].metadata["options"]
        for name, pair in self.design_bounds.items():
            _check_pair(f"design_bounds[{check_name(name, known, 'design_bounds')!r}]", pair)
        if self.bounds_mm is not None:
            _check_pair("bounds_mm", self.bounds_mm)
        for name, weight in self.weights.items():
            check_name(name, self.costs, "weights")
            require(
                _is_number(weight),
                f"{weight!r} is no weight",
                f"weights[{name!r}]",
                "It must be a number from 0 on",
            )
        require(
            sum(self.weights.values()) > 0.0,
            "are all zero",
            "weights",
            "One of them must be above 0",
        )

    @property
    def weighed(self) -> tuple[str, ...]:
        """Costs with a weight above zero."""
        return tuple(name for name, weight in self.weights.items() if weight > 0.0)


@dataclass(frozen=True, kw_only=True)
class GivenMotionOptions(CommonOptions):
    """Options of level 1 alone that the command line has.

    Attributes:
        joints: of joint_load and of metabolic.
        pareto: two costs whose trade-off is told; () for none.
        workers: threads; None for one a core.
    """

    joints: tuple[str, ...] = choice(
        JOINTS[:4],
        options=JOINTS,
        source="choice",
        metavar="JOINT,...",
        help=f"Level 1: joints whose moments count, of {', '.join(JOINTS)}.",
    )
    pareto: tuple[str, ...] = choice(
        ("joint_load", "push_off"),
        options=COSTS,
        source="choice",
        metavar="A,B",
        help="Two costs whose trade-off is reported.",
    )
    workers: int | None = chosen(
        None, "1", low=1, help="Threads for the walks. Default: one per core."
    )


@dataclass(frozen=True, kw_only=True)
class FreeMotionOptions(CommonOptions):
    """Options of level 2 alone that the command line has.

    Attributes:
        method, intervals: of the collocation. Trapezoidal takes twice as many for the same
            accuracy.
        speed_m_per_s: None for the recorded one, from which it must differ by more than
            `stride.SAME_SPEED` to count.
    """

    intervals: int = chosen(40, "1", low=10, high=400, help="Level 2: intervals of the stride.")
    method: str = choice(
        METHODS[0],
        options=METHODS,
        source="choice",
        metavar="|".join(METHODS),
        help="Level 2: method of collocation.",
    )
    speed_m_per_s: float | None = chosen(
        None,
        "m/s",
        flag="--speed",
        metavar="M/S",
        shown="the recorded one",
        help="Level 2: the speed to walk at.",
    )


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _check_pair(where: str, pair: Any) -> None:
    require(
        isinstance(pair, (tuple, list)) and len(pair) == 2 and all(map(_is_number, pair)),
        f"{pair!r} is no pair of numbers",
        where,
        "Give (low, high)",
    )
    require(
        pair[0] < pair[1],
        f"its lower bound {pair[0]:g} is not below its upper one {pair[1]:g}",
        where,
        "No setting meets both: give the lower one first",
    )
