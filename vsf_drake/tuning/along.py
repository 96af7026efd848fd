"""The cost over the setting along the person's own answer, beside the quasi-static null: the spring
alone, under an equal load.

Along the answer every recorded walk is moved to the setting, motion, times and plate
(`walks.answer`). In the null nothing of the motion answers but the pelvis's height, which keeps the
vertical force of the recording (`walks.energy_ledger`); what the model misses of the plate at the
recorded setting is added, so that there both are the recorded walks. The hold to the recording,
which tuning with a given motion needs, is in neither.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.base.sentences import say
from vsf_drake.tuning.answered import carried, carrying, plate_wrench
from vsf_drake.tuning.costs import CONSISTENCY, TRACKING, Terms, value_of
from vsf_drake.tuning.problem import SettingOutcome, StiffnessTuning, TrialTuning
from vsf_drake.tuning.table import AlongPoint
from vsf_drake.walks.answer import Answer, answer_of
from vsf_drake.walks.between_settings import settings_of
from vsf_drake.walks.energy_ledger import walk_with_same_load

BETWEEN = 2  # positions between two recorded settings (a choice)


@dataclass(frozen=True)
class _Cost:
    """The tuned cost without its hold to the recording."""

    factors: Mapping[str, float]

    def of(self, terms: Mapping[str, Terms]) -> float:
        return sum(factor * value_of(terms[name]) for name, factor in self.factors.items())


def along_answer(tuning: StiffnessTuning) -> tuple[AlongPoint, ...]:
    """From the softest to the stiffest recorded setting; empty where one setting was recorded, or
    the cost is the deviation from the recorded force.

    InputError: what `answer_of` refuses. SimulationError: a moved walk fails.
    """
    positions = np.array([trial.fulcrum_m for trial in tuning.trials])
    if len(settings_of(positions)) < 2 or TRACKING in tuning.combination.factors:
        return ()
    answer = answer_of(tuning.trials)
    cost = _Cost({k: v for k, v in tuning.combination.factors.items() if k != CONSISTENCY})
    places = np.unique(
        np.concatenate(
            [
                np.linspace(low, high, BETWEEN + 2)
                for low, high in zip(answer.settings_m, answer.settings_m[1:], strict=False)
            ]
        )
    )
    own = np.array([_moved(tuning, answer, i, at, cost) for i, at in enumerate(answer.fulcrum_m)])
    return tuple(
        AlongPoint(
            fulcrum_mm=1e3 * float(at),
            recorded=bool(np.abs(answer.settings_m - at).min() < 1e-9),
            cost=float(
                np.mean([_moved(tuning, answer, i, at, cost) for i in range(len(answer.walks))])
            ),
            half_width=answer.half_width(own, at),
            equal_load=_equal_load(tuning, float(at), cost),
        )
        for at in places
    )


def told_along(
    make: Callable[[], StiffnessTuning],
) -> tuple[tuple[AlongPoint, ...], list[str]]:
    """`along_answer` of a tuning that is made here, and in words why there is none."""
    try:
        return along_answer(make()), []
    except (InputError, SimulationError) as error:
        return (), say("level1", "no_along", error=error)


def _moved(tuning: StiffnessTuning, answer: Answer, i: int, at_m: float, cost: _Cost) -> float:
    walker = tuning.parts[i].walker
    _, found = carried(walker, answer.moved(i, at_m), tuning.options)
    return cost.of(found.terms)


def _equal_load(tuning: StiffnessTuning, at_m: float, cost: _Cost) -> float | None:
    """Mean over the trials that keep their load; None where none does."""
    found = [_same_load(part, at_m, cost) for part in tuning.parts]
    kept = [value for value in found if value is not None]
    return float(np.mean(kept)) if kept else None


def _same_load(part: TrialTuning, at_m: float, cost: _Cost) -> float | None:
    options = part.options
    try:
        same = walk_with_same_load(
            part.walker,
            part.trial,
            fulcrum_m=at_m,
            step_s=options.step_s,
            search_step_s=options.search_step_s,
        )
    except SimulationError:
        return None
    if not same.kept:
        return None
    frame = part.frame(options.step_s)
    loads = part.loads(same.walk)
    plate = plate_wrench(part.trial.prosthetic_plate, frame.time_s)
    missed = plate - frame.own.ground[..., 0]  # by the model at the recorded setting
    found = SettingOutcome({}, same.walk, loads, frame)
    return cost.of(carrying(part, found, loads.ground[..., 0] + missed).terms)
