"""What the figures and tables of the bench chapter share: names of positions and lines, values out of the table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

LINE_MARKERS = {"model": "o", "nominal": "s", "refined": "D", "calibrated": "^"}
LINE_GREYS = {"measured": "0.55", "model": "0.1", "nominal": "0.78", "refined": "0.38", "calibrated": "0.95"}


def metres(fulcrum_mm: float | None) -> float | None:
    """The position as the style's colours want it."""
    return None if fulcrum_mm is None else 1e-3 * fulcrum_mm


def position(fulcrum_mm: float | None) -> str:
    """"66 mm", or "heel"."""
    return "heel" if fulcrum_mm is None else f"{fulcrum_mm:g} mm"


def value(row: Mapping[str, Any], *keys: str) -> Any:
    """A value of a nested row; None where any part is missing."""
    found: Any = row
    for key in keys:
        if not isinstance(found, Mapping) or found.get(key) is None:
            return None
        found = found[key]
    return found


def numbers(rows: Sequence[Mapping[str, Any]], *keys: str) -> list[float]:
    """The same over rows, NaN where it is missing: gaps in a figure."""
    return [float("nan") if (found := value(row, *keys)) is None else float(found) for row in rows]


def forefoot(table: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The settings with a fulcrum position."""
    return [row for row in table["settings"] if row["fulcrum_mm"] is not None]


def source(table: Mapping[str, Any]) -> str:
    """What "measured" is in legends."""
    return "measured (SYNTHETIC)" if table["measured_synthetic"] else "measured"
