"""Persons whose answer to the setting is stated: what of their own motion gives way at
another setting of the foot.

A person has a motion of their own, that at the middle setting. At another one they go on carrying
what they carried there, and each function of the motion gives way by its `ease` times what it may
be off in any walk (`placing.STANDARD`). A motion that did not give way at all would be no walk: the
force would change by two thirds of body weight from the softest to the stiffest setting, and the
trunk would have to move by two decimetres.

    none    the prosthetic leg's angles hold as well as they can; the body rises and sinks on the
            foot, and the intact leg follows the body
    people  the vertical force of the middle setting holds to 1 % of body weight from the softest to
            the stiffest setting; for that the prosthetic knee gives way by 4 degrees, other joints
            by 1 to 2, as was seen on the one person with a variable foot who was recorded
    strong  everything gives way as in data/sessions, and the centre of pressure passes later along
            a softer foot

What `none` and `strong` are to carry is the force that the draw wishes, to some newtons: under a
quick push-off no walk has it, each setting misses it its own way, and their vertical force changes
by a tenth of body weight. `people` are to carry what their walk at the middle setting did carry, to
HELD_N: an inverse problem of its own for each setting, in which the angles that hold least and the
pelvis's path pay for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from virtual_laboratory.balance import PLATE
from virtual_laboratory.motion import COORDINATES, TRUNK, Person, base_motion
from virtual_laboratory.people import TruePerson
from virtual_laboratory.placing import RATE_HZ, Attempt, place, rise_of_legs, set_stage, start
from virtual_laboratory.polish import FORCE_HZ, polish
from virtual_laboratory.prosthesis import Prosthesis
from virtual_laboratory.recording import Recorded, record
from virtual_laboratory.targets import YIELDING, Draw, lifted

NONE, PEOPLE, STRONG = ANSWERS = ("none", "people", "strong")
MIDDLE = "medium"
PATH = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
EASE = {
    NONE: {**dict.fromkeys(PATH, 1.5), "pelvis_": 0.3, "hip_": 0.05, "knee_": 0.05},
    PEOPLE: {
        **dict.fromkeys(PATH, 1.0),
        "pelvis_": 0.4,
        "knee_angle_r": 0.5,
        "hip_": 0.4,
        "knee_": 0.4,
    },
    STRONG: {},
}
"""By answer, of coordinates by how their names begin, of the first that fits; of others 1. Of
`none` the intact leg has INTACT_EASE."""
INTACT_EASE = 0.6
HELD_N = 1.0
"""To which `people` keep the vertical force of the middle setting, in the fit's tolerance."""


def walks(
    person: Person, true: TruePerson, draw: Draw, steps: int
) -> Iterator[tuple[str, Recorded, Recorded, Prosthesis]]:
    """The draw's trial by each answer, the same draw's at the middle setting, and the foot that the
    first was walked with. At the middle setting there is one trial for all answers."""
    own = replace(
        draw,
        condition=MIDDLE,
        roll_over=draw.roll_over - YIELDING[draw.condition] + YIELDING[MIDDLE],
    )
    middle = true.prosthesis(own.fulcrum_m)
    attempt = start(own, base_motion)
    rise = rise_of_legs(person, attempt, set_stage(person, own, middle, attempt.time_s))
    own = lifted(own, rise)
    attempt = start(own, base_motion)
    stage = set_stage(person, own, middle, attempt.time_s)
    place(person, attempt, stage)
    polish(person, attempt, middle, stage, steps)
    unchanged = record(person, middle, attempt, stage)
    if draw.condition == MIDDLE:
        for answer in ANSWERS:
            yield answer, unchanged, unchanged, middle
        return
    set_otherwise = true.prosthesis(draw.fulcrum_m)
    for answer in ANSWERS:
        aimed = replace(
            own,
            condition=draw.condition,
            roll_over=draw.roll_over if answer == STRONG else own.roll_over,
        )
        changed = Attempt(
            aimed,
            attempt.time_s,
            attempt.u,
            attempt.splines,
            np.zeros_like(attempt.c),
            ease(answer),
        )
        stage = set_stage(person, aimed, set_otherwise, changed.time_s)
        if answer == PEOPLE:
            carried = unchanged.right.force[:: FORCE_HZ // RATE_HZ]
            polish(person, changed, set_otherwise, stage, steps, carried, HELD_N)
        else:
            polish(person, changed, set_otherwise, stage, steps)
        yield (
            answer,
            record(person, set_otherwise, changed, stage),
            unchanged,
            set_otherwise,
        )


def ease(answer: str) -> np.ndarray:
    """(33,) of every function of the motion."""
    table = EASE[answer]
    found = [
        next((table[begin] for begin in table if name.startswith(begin)), 1.0)
        for name in COORDINATES
    ]
    if answer == NONE:
        found = [
            INTACT_EASE if name.endswith("_l") else own
            for name, own in zip(COORDINATES, found, strict=True)
        ]
    return np.array([*found, *np.ones(len(TRUNK) + len(PLATE))])
