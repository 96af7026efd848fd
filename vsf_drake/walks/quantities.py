"""The numbers of a compared walk: unit, scale, format, label and meaning of each, told here alone.

A number is kept in SI units, in body weights or in foot lengths, under the name that it has in
`WalkMetrics`, JSON and CSV; tables, sentences, figures and screens look up here how it is shown.
BW is the subject's mass times 9.81 m/s², FL the length of the model's prosthetic foot.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.base.files import table_of

JUDGED = "grf_rmse_bw"
"""The error that a walk is judged by: the one of a sweep, of a null model, of a layer."""
NULL = f"null_model_{JUDGED}"
STRETCHED = f"stretched_null_{JUDGED}"
IN_LATE_STANCE = f"null_model_predicted_times_{JUDGED}"
FLOOR = f"floor_{JUDGED}"


@dataclass(frozen=True)
class Quantity:
    """What a number of a compared walk is; one without `form` is no number."""

    label: str
    unit: str  # in which it is kept, in words
    scale: float  # from that one to the one in which it is shown
    shown: str  # unit
    form: str  # of the number in that unit
    meaning: str

    @property
    def heading(self) -> str:
        """Of a column: the label with the unit."""
        return f"{self.label} ({self.shown})" if self.shown else self.label

    def changed(self, value: float) -> str:
        """A difference of such numbers in a sentence: "+4.3 mm"."""
        return f"{self.form.replace('{:', '{:+').format(self.scale * value)} {self.shown}"

    def told(self, value: float | None) -> str:
        """The number in a sentence, which says itself of what it is a share: "4.3 %"."""
        if value is None:
            return "unknown"
        return f"{self.form.format(self.scale * value)} {self.shown.partition(' ')[0]}"


def quantities_of(table: str) -> dict[str, Quantity]:
    """By name, those that a CSV file of the package tells."""
    return {
        row.pop("name"): Quantity(**row | {"scale": float(row["scale"])})  # type: ignore[arg-type]
        for row in table_of(table)
    }


QUANTITIES = quantities_of("walks/quantities.csv")


def quantity(name: str) -> Quantity:
    """What NAME is, also that of `NAME_worst` and `LAYER_NAME`; KeyError for anything else."""
    own = name.removesuffix("_worst")
    return QUANTITIES[own if own in QUANTITIES else own.partition("_")[2]]


def known(numbers: Iterable[float | None]) -> list[float]:
    """Those that are."""
    return [number for number in numbers if number is not None]


def mean(numbers: Iterable[float | None]) -> float | None:
    """Of what is known; None where nothing is."""
    own = known(numbers)
    return float(np.mean(own)) if own else None


class Judged:
    """A record of a compared walk, whose numbers stand under their names."""

    def number(self, name: str) -> Any:
        """What it holds under this name; None for what it does not know."""
        return getattr(self, name, None)

    @property
    def error_bw(self) -> float | None:
        """The error that the walk is judged by."""
        error: float | None = self.number(JUDGED)
        return error

    @property
    def null_bw(self) -> float | None:
        """That of the null model."""
        error: float | None = self.number(NULL)
        return error

    @property
    def nearest_bw(self) -> float | None:
        """That of the nearest single curve."""
        error: float | None = self.number(STRETCHED)
        return error

    def __str__(self) -> str:
        """A line for each number that is known: label, unit, number."""
        return "\n".join(
            f"{own.heading:30}{own.form.format(own.scale * self.number(name)):>8}"
            for name, own in QUANTITIES.items()
            if own.form and self.number(name) is not None
        )


class Scored(Judged):
    """One with numbers in a mapping, by name."""

    scores: Mapping[str, Any]

    def number(self, name: str) -> Any:
        """What its `scores` or it itself holds under this name; None for what neither knows."""
        return self.scores.get(name, super().number(name))
