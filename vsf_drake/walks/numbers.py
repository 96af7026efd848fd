"""Numbers of which some may be unknown: None in records, NaN in arrays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Protocol, TypeVar

import numpy as np

from vsf_drake.model.setting import AtSetting


class _AtFulcrum(Protocol):
    @property
    def fulcrum_mm(self) -> float: ...


class _AtSetting(Protocol):
    @property
    def setting(self) -> AtSetting: ...


T = TypeVar("T", bound=_AtFulcrum)
S = TypeVar("S", bound=_AtSetting)


def by_fulcrum(rows: Iterable[T]) -> dict[float, list[T]]:
    """Rows by their `fulcrum_mm`, softest first."""
    groups: dict[float, list[T]] = {}
    for row in sorted(rows, key=attrgetter("fulcrum_mm")):
        groups.setdefault(row.fulcrum_mm, []).append(row)
    return groups


def by_setting(rows: Iterable[S]) -> dict[AtSetting, list[S]]:
    """Rows by their `setting`, softest first, those of passive feet by their names."""
    groups: dict[AtSetting, list[S]] = {}
    for row in sorted(rows, key=lambda row: row.setting.setting_order):
        groups.setdefault(row.setting, []).append(row)
    return groups


def known(values: Iterable[float | None]) -> np.ndarray:
    """Those of the numbers that are neither None nor NaN."""
    numbers = np.array([*values], dtype=float).ravel()
    return np.asarray(numbers[np.isfinite(numbers)])


def finite(value: float | np.floating[Any]) -> float | None:
    """The number, as records have it: None if it is not known."""
    return float(value) if np.isfinite(value) else None


def rms(values: Iterable[float | None]) -> float:
    """Root mean square of what is known; NaN if nothing is."""
    numbers = known(values)
    return float(np.sqrt(np.mean(numbers**2))) if numbers.size else float("nan")


@dataclass(frozen=True)
class Spread:
    """Mean and sample standard deviation of what is known, None where that is too little, and how
    much it is."""

    mean: float | None
    sd: float | None
    n: int


def cells(spreads: Mapping[str, Spread], mean: str = "") -> dict[str, float | None]:
    """In one row: means under their names and the ending `mean`, deviations under `NAME_sd`."""
    return {
        name + end: value
        for name, own in spreads.items()
        for end, value in ((mean, own.mean), ("_sd", own.sd))
    }


def spread(values: Iterable[float | None]) -> Spread:
    """Over what is known of the numbers."""
    numbers = known(values)
    return Spread(
        float(numbers.mean()) if numbers.size else None,
        float(numbers.std(ddof=1)) if numbers.size > 1 else None,
        numbers.size,
    )
