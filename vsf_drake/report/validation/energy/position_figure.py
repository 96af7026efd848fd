"""Stored and returned energy over the fulcrum's position: as recorded, under the same load, with the same motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.style import (
    MARKERS,
    NEUTRAL,
    SIMULATED,
    condition_colour,
    condition_label,
    label,
    new_figure,
    style,
)

_X = "fulcrum from the keel's posterior end (mm)"
_KINDS = (("stored_j", "stored", True), ("returned_j", "returned", False))


def energy_position_figure(table: Mapping[str, Any]) -> Figure:
    """The figure: three panels, each over the fulcrum's position."""
    with style():
        figure = new_figure(10.5, 4.1)
        first, second, third = figure.subplots(1, 3)
        _recorded(first, table["trials"], table["conditions"])
        _moved(second, table["same_load"], table["trials"])
        _moved(third, table["same_motion"], table["trials"])
        label(first, x=_X, y="energy of a stance (J)", title="Trials as recorded, each at its own position")
        label(second, x=_X, y="", title="Each trial's load, fulcrum moved")
        label(third, x=_X, y="", title="Each trial's motion, fulcrum moved")
        for axes in (first, second, third):
            axes.set_ylim(bottom=0.0)
            places = sorted({row["fulcrum_mm"] for key in ("trials", "same_load") for row in table[key]})
            axes.set_xticks(places, [f"{x:g}" for x in places])
        if table["trials"]:
            for _, name, filled in _KINDS:
                first.plot([], [], color=NEUTRAL, marker="o", markerfacecolor=NEUTRAL if filled else "white",
                           label=f"{name}, mean of trials", **SIMULATED)
            first.plot([], [], color=NEUTRAL, marker="x", linestyle="", label="lost in the foot, mean of trials")
            first.legend(loc="upper right")
            second.legend(loc="upper right", title="means of the trials at")
        second.set_ylim(top=second.get_ylim()[1] * 1.25)
        first.set_ylim(top=first.get_ylim()[1] * 1.35)
        figure.draw_without_rendering()
    return figure


def _recorded(axes: Axes, trials: Sequence[Mapping[str, Any]], conditions: Sequence[Mapping[str, Any]]) -> None:
    for key, _, filled in _KINDS:
        axes.plot([c["fulcrum_mm"] for c in conditions], [c[key] for c in conditions], color=NEUTRAL, zorder=1,
                  **SIMULATED)
        for row in trials:
            colour = condition_colour(1e-3 * row["fulcrum_mm"])
            axes.plot(row["fulcrum_mm"], row[key], marker="o", linestyle="", markersize=5, color=colour,
                      markerfacecolor=colour if filled else "white")
    axes.plot([c["fulcrum_mm"] for c in conditions], [c["lost_j"] for c in conditions], marker="x", linestyle="",
              color=NEUTRAL)


def _moved(axes: Axes, rows: Sequence[Mapping[str, Any]], trials: Sequence[Mapping[str, Any]]) -> None:
    """Means over the trials of each condition, where all of them could be walked."""
    own = {row["label"]: row["fulcrum_mm"] for row in trials}
    for number, home in enumerate(sorted(set(own.values()))):
        mine = [row for row in rows if own.get(row["label"]) == home]
        count = len({row["label"] for row in mine})
        places = [x for x in sorted({row["fulcrum_mm"] for row in mine})
                  if sum(row["fulcrum_mm"] == x for row in mine) == count]
        colour = condition_colour(1e-3 * home)
        for key, _, filled in _KINDS:
            means = [float(np.mean([row[key] for row in mine if row["fulcrum_mm"] == x])) for x in places]
            axes.plot(places, means, color=colour, marker=MARKERS[number % len(MARKERS)], markersize=5,
                      markerfacecolor=colour if filled else "white",
                      label=condition_label(1e-3 * home) if filled else None, **SIMULATED)
