"""The rows of the certificate: what is compared, how, and what difference may be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.base.files import table_of

AGREES, DIFFERS, REPORTED, NOT_RUN, FAILED = "agrees", "differs", "reported", "not run", "failed"


@dataclass(frozen=True, kw_only=True)
class Row:
    """One comparison of one engine with this package."""

    row: str  # the same for all engines that are asked the same
    question: str
    engine: str
    answer: str  # array of the engine
    against: str  # array of this package; "" where the measure takes none
    measure: str  # a key of MEASURES
    asked: float | None  # largest difference with which they agree; None: it is reported only


@dataclass(frozen=True, kw_only=True)
class Judged(Row):
    """A row and what came of it."""

    difference: float | None  # as the measure has it; None where there is none
    verdict: str

    @property
    def met(self) -> bool:
        """Whether nothing speaks against it."""
        return self.verdict not in (DIFFERS, FAILED)


def relative(answer: np.ndarray, against: np.ndarray) -> float:
    """The largest difference, each over its own value."""
    return float(np.abs(answer / against - 1.0).max())


def of_largest(answer: np.ndarray, against: np.ndarray) -> float:
    """The largest difference over the largest value."""
    return float(np.abs(answer - against).max() / np.abs(against).max())


def of_largest_to_1_ms(answer: np.ndarray, against: np.ndarray) -> float:
    """The same at the file's own step and at 1 ms, as `steadiness` has its arrays."""
    return of_largest(answer[:2], against[:2])


def rms_of_largest(answer: np.ndarray, against: np.ndarray) -> float:
    """The root mean square of the differences over the largest value."""
    return float(np.sqrt(np.mean((answer - against) ** 2)) / np.abs(against).max())


def false_to_1_ms(answer: np.ndarray, against: np.ndarray) -> float:
    """How many are not so at the file's own step and at 1 ms, as `steadiness` has its arrays."""
    return float(np.sum(~answer[:2]))


def false_to_2_ms(answer: np.ndarray, against: np.ndarray) -> float:
    """How many are not so at the file's own step, 1 ms and 2 ms."""
    return float(np.sum(~answer))


MEASURES = {
    measure.__name__: measure
    for measure in (
        relative,
        of_largest,
        of_largest_to_1_ms,
        rms_of_largest,
        false_to_1_ms,
        false_to_2_ms,
    )
}

ROWS = tuple(
    Row(**row, asked=float(asked) if asked else None)
    for row in table_of("engines/certificate/rows.csv")
    for asked in [row.pop("asked")]
)


def judged(
    row: Row, status: str, answers: Mapping[str, np.ndarray], own: Mapping[str, np.ndarray]
) -> Judged:
    """The row for an engine that has `answers`, or whose `status` is NOT_RUN or FAILED; `own` are
    this package's."""

    def end(verdict: str, difference: float | None = None) -> Judged:
        return Judged(**vars(row), difference=difference, verdict=verdict)

    if status:
        return end(status)
    answer = answers.get(row.answer)
    against = own.get(row.against) if row.against else answer
    if answer is None or against is None or answer.shape != against.shape:
        return end(FAILED)
    difference = MEASURES[row.measure](answer, against)
    if row.asked is None:
        return end(REPORTED, difference)
    # what is not a number differs
    return end(AGREES if difference <= row.asked else DIFFERS, difference)


def agree(rows: Sequence[Judged]) -> bool:
    """Whether something was compared, and no row differs or failed."""
    return all(row.met for row in rows) and any(row.verdict == AGREES for row in rows)
