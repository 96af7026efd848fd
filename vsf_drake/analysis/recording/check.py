"""What a check of a recording says: a mark, a number, a sentence. And what an error may cost before it matters.

Every limit that can be is derived from one question: by which share of body weight does the predicted ground
reaction change? Sensitivities come from a prototype of this model on a recorded walk (resultant force, root mean
square over stance); they are good to a factor of two or so, which is enough to tell a millimetre from a centimetre.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

MARKS = ("good", "doubtful", "unusable")

GOOD_BW, DOUBTFUL_BW = 0.03, 0.10
"""Change of the force (body weights) up to which an error is good, and up to which doubtful. The smaller is what a
curve merely stretched from another trial misses (2-3 %), the larger twice the published error of the model (5 %)."""
FARTHEST_BW = 0.3
"""Cost up to which a sensitivity is quoted as a number (a choice): beyond it nothing is linear."""
HIP_BW_PER_DEG, KNEE_BW_PER_DEG, ALIGNMENT_BW_PER_DEG = 0.075, 0.04, 0.037
HEIGHT_BW_PER_MM, FORE_AFT_BW_PER_MM = 0.028, 0.03 / 5


@dataclass(frozen=True)
class Check:
    """One statement about a recording.

    Attributes:
        name: which check, in words.
        mark: "good", "doubtful" or "unusable".
        value: what was measured, in `unit`; None where it cannot be told.
        sentence: what was found and what it means for a simulation.
        side: "right" or "left" where it is about one foot or leg.
        stance: number of the stance of that foot, from 1.
    """

    name: str
    mark: str
    value: float | None
    unit: str
    sentence: str
    side: str | None = None
    stance: int | None = None

    def __post_init__(self) -> None:
        if self.mark not in MARKS:
            raise ValueError(f"{self.mark!r} is no mark")


def grade(value: float, good: float, doubtful: float) -> str:
    """The mark of an error of size |value| with these two limits; NaN is unusable."""
    size = abs(value)
    return MARKS[0] if size < good else MARKS[1] if size < doubtful else MARKS[2]


def worst(marks: Iterable[str]) -> str:
    """The worst of the marks; "good" for none."""
    return max(marks, key=MARKS.index, default=MARKS[0])


def cost(share_bw: float) -> str:
    """How an error's cost (body weights, from a linear sensitivity) is said: linear no further than a third."""
    return f"about {100 * share_bw:.0f} %" if share_bw < FARTHEST_BW else f"more than {100 * FARTHEST_BW:.0f} %"


def at_most(mark: str, limit: str) -> str:
    """`mark`, but no worse than `limit`."""
    return min(mark, limit, key=MARKS.index)
