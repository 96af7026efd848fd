"""Whether a recording can drive the model: checks with a mark, a number and a sentence, and what an
error may cost.

Limits are derived, where they can be, from the share of body weight by which the predicted ground
reaction changes. Sensitivities come from a prototype on a recorded walk (resultant force, RMS over
stance), good to a factor of two.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from vsf_drake.base.sentences import say

MARKS = ("good", "doubtful", "unusable")
GOOD_BW, DOUBTFUL_BW = 0.03, 0.10
"""Change of the force (body weights) up to which an error is good, and up to which doubtful. The
smaller is what a curve merely stretched from another trial misses (2-3 %), the larger twice the
published error of the model (5 %)."""
LEVEL_BW = 0.005
"""Cost (body weights) below which an error is told with the others of its size only (a choice: a
sixth of what is still good; 36 of them together are doubtful)."""
TOLD = 3  # largest costs that a verdict names
FITTED_HIP_BW_PER_DEG = 0.02
"""What is left of a constant error of hip flexion once the offsets are fitted. Measured, as the
other FITTED ones, on three walks of the exact reference subject, spoiled in one thing at a time;
they agree to a factor of two."""
EXPECTED = (
    "The mark is that of the expected error: by so much, root mean square over stance, what the "
    "checks can see would change the predicted force once the offsets are fitted "
    f"(--fit-offsets). Good is below {100 * GOOD_BW:.0f} % of body weight, doubtful below "
    f"{100 * DOUBTFUL_BW:.0f} %; a check that is unusable makes the trial unusable, and a mass "
    "that cannot be told or a force beside its foot makes it doubtful. The verdict names the "
    f"{TOLD} largest errors of at least {100 * LEVEL_BW:g} %, and the sum of the others."
)
"""What the mark of a trial means, for reports."""


@dataclass(frozen=True)
class Check:
    """One statement about a recording."""

    name: str
    mark: str  # one of MARKS
    value: float | None  # what was measured, in `unit`; None where it cannot be told
    unit: str
    sentence: str  # what was found and what it means for a simulation
    side: str | None = None  # "right" or "left" where it is about one foot or leg
    stance: int | None = None  # number of the stance of that foot, from 1
    cost_bw: float | None = None
    """error of the force (root mean square over stance) left after a fit of the offsets"""
    needed: bool = False
    """a doubt here alone makes the recording doubtful: a good one cannot do without it"""


def checked(
    part: str,
    name: str,
    mark: str,
    value: float | None,
    unit: str,
    *,
    side: str | None = None,
    stance: int | None = None,
    cost_bw: float | None = None,
    needed: bool = False,
    **numbers: Any,
) -> Check:
    """A check whose sentence the macro `part` of `wording/recording.txt.j2` makes of mark, value
    and `numbers`."""
    [sentence] = say(
        "recording",
        part,
        c={"mark": mark, "value": value, "side": side, "stance": stance, **numbers},
    )
    return Check(name, mark, value, unit, sentence, side, stance, cost_bw, needed)


def grade(value: float, good: float, doubtful: float) -> str:
    """The mark of an error of size |value| with these two limits; NaN is unusable."""
    size = abs(value)
    return MARKS[0] if size < good else MARKS[1] if size < doubtful else MARKS[2]


def worst(marks: Iterable[str]) -> str:
    """The worst of the marks; "good" for none."""
    return max(marks, key=MARKS.index, default=MARKS[0])


def at_most(mark: str, limit: str) -> str:
    """`mark`, but no worse than `limit`."""
    return min(mark, limit, key=MARKS.index)


def costs(checks: Iterable[Check]) -> dict[str, float]:
    """The largest cost (body weights) under each name, of one error seen on several feet and
    stances; largest first."""
    largest: dict[str, float] = {}
    for check in checks:
        if check.cost_bw is not None:
            largest[check.name] = max(check.cost_bw, largest.get(check.name, 0.0))
    return dict(sorted(largest.items(), key=lambda item: -item[1]))


def leading(checks: Iterable[Check]) -> tuple[dict[str, float], int, float]:
    """Of `costs` the largest, at most TOLD and each at least LEVEL_BW; how many others there are,
    and their sum as `expected_error` makes it (body weights)."""
    every = costs(checks)
    told = {name: cost for name, cost in [*every.items()][:TOLD] if cost >= LEVEL_BW}
    rest = [cost for name, cost in every.items() if name not in told and cost > 0.0]
    return told, len(rest), math.hypot(*rest)


def expected_error(checks: Iterable[Check]) -> float:
    """Expected error (body weights) of the force predicted from a recording, for what the checks
    can see of it.

    Root mean square over stance, after a fit of the offsets, without the model's own error. Errors
    under different names are taken to be independent: their costs add as squares.
    """
    return math.hypot(*costs(checks).values())


def overall(checks: Iterable[Check]) -> str:
    """The mark of a recording: that of its expected error, but no better than an unusable or a
    needed check."""
    checks = list(checks)
    return worst(
        [
            grade(expected_error(checks), GOOD_BW, DOUBTFUL_BW),
            *(check.mark for check in checks if check.needed or check.mark == "unusable"),
        ]
    )
