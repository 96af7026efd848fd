"""Load and displacement of the foot pressed at an angle, and stiffness and energy by fulcrum position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.style import (
    HEEL_COLOUR,
    MARKERS,
    SIMULATED,
    condition_colour,
    condition_label,
    label,
    new_figure,
    style,
)


def inclined_loading_figure(rows: Sequence[Mapping[str, Any]], arrays: Mapping[str, np.ndarray]) -> Figure:
    """The figure of a roll-over section's rows `inclined` (`analysis.validation.roll_over.section`)."""
    with style():
        figure = new_figure(10.5, 3.9)
        panels = figure.subplots(1, 3, width_ratios=(1.0, 1.3, 1.0))
        for axes, sign, title in ((panels[0], -1.0, "Heel, -15°"), (panels[1], 1.0, "Forefoot, +20°")):
            _curves(axes, [row for row in rows if sign * row["angle_deg"] > 0.0], arrays)
            label(axes, x="displacement (mm)", y="load (N)", title=title)
        _energy(panels[2], rows)
        figure.draw_without_rendering()
    return figure


def curve_name(row: Mapping[str, Any]) -> str:
    """Start of the names of the arrays that hold a row's curves."""
    angle = row["angle_deg"]
    return f"inclined_{'minus' if angle < 0 else 'plus'}{abs(angle):.0f}_{row['fulcrum_mm']:.0f}"


def _curves(axes: Axes, rows: Sequence[Mapping[str, Any]], arrays: Mapping[str, np.ndarray]) -> None:
    for i, row in enumerate(rows):
        name, fulcrum = curve_name(row), 1e-3 * row["fulcrum_mm"]
        load = np.asarray(arrays[f"{name}_load_n"])
        loading = slice(0, int(np.argmax(load)) + 1)
        axes.plot(1e3 * np.asarray(arrays[f"{name}_displacement_m"])[loading], load[loading],
                  color=condition_colour(fulcrum), label=condition_label(fulcrum), marker=MARKERS[i % len(MARKERS)],
                  markersize=4, markevery=(8 + 4 * i, 22), **SIMULATED)
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    if rows:
        axes.legend(loc="lower right" if rows[0]["angle_deg"] > 0.0 else "upper left")


def _energy(axes: Axes, rows: Sequence[Mapping[str, Any]]) -> None:
    for sign, marker, words in ((-1.0, "s", "heel, -15°"), (1.0, "o", "forefoot, +20°")):
        own = [row for row in rows if sign * row["angle_deg"] > 0.0]
        if not own:
            continue
        axes.plot([row["fulcrum_mm"] for row in own], [row["energy_stored_j"] for row in own], color=HEEL_COLOUR,
                  linewidth=0.8, linestyle=":")
        for row in own:
            axes.plot(row["fulcrum_mm"], row["energy_stored_j"], marker, markersize=6,
                      color=condition_colour(1e-3 * row["fulcrum_mm"]))
        axes.plot([], [], marker, color=HEEL_COLOUR, label=words)
    if rows:
        axes.legend(loc="best")
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.12)
    label(axes, x="fulcrum position (mm)", y="energy stored at 600 N (J)", title="Energy stored")
