"""What the figures of a validation have in common; all are made of saved rows, whose positions are in mm."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.style import condition_colour, condition_label

Row = Mapping[str, Any]
Arrays = Mapping[str, np.ndarray]
FULCRUM = "fulcrum from the keel's posterior end (mm)"
DOTTED: dict[str, Any] = {"linestyle": (0, (1, 1.2)), "linewidth": 1.3}


def colour_of(fulcrum_mm: float | None) -> Any:
    """The colour of a position, or of the heel for None."""
    return condition_colour(None if fulcrum_mm is None else 1e-3 * fulcrum_mm)


def name_of(fulcrum_mm: float) -> str:
    """A position's name in legends."""
    return condition_label(1e-3 * fulcrum_mm)


def position(fulcrum_mm: float | None) -> str:
    """A position in a table and beside a curve."""
    return "heel" if fulcrum_mm is None else f"{fulcrum_mm:g} mm"


def value(row: Any, *keys: Any) -> Any:
    """A value of a nested row; None where any part is missing."""
    for key in keys:
        if not isinstance(row, Mapping) or row.get(key) is None:
            return None
        row = row[key]
    return row


def numbers(rows: Iterable[Row], *keys: str) -> list[float]:
    """The same over rows, NaN where it is missing: gaps in a figure."""
    return [float("nan") if (found := value(row, *keys)) is None else float(found) for row in rows]


def tag(axes: Axes, fulcrum_mm: float | None, at: tuple[float, float], **options: Any) -> None:
    """Names a position beside its curve."""
    axes.annotate(position(fulcrum_mm), at, fontsize=8, textcoords="offset points", color=colour_of(fulcrum_mm),
                  fontweight="bold", annotation_clip=False, **options)


def bars(axes: Axes, groups: Sequence[tuple[str, str, Any]], places: Sequence[str]) -> None:
    """Bars side by side at each place: a label, a grey and the heights of each group."""
    width = 0.8 / len(groups)
    for j, (text, grey, heights) in enumerate(groups):
        axes.bar(np.arange(len(places)) + (j - 0.5 * (len(groups) - 1)) * width, heights, width, color=grey,
                 edgecolor="0.1", linewidth=0.6, label=text)
    axes.set_xticks(np.arange(len(places)), places)


def say_synthetic(figure: Figure, table: Row, what: str) -> None:
    """That nobody recorded these walks, or trials."""
    if table["synthetic"]:
        figure.suptitle(f"SYNTHETIC {what}, not recorded", x=0.01, ha="left", fontsize=11)
