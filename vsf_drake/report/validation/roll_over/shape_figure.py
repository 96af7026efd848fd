"""Roll-over shapes in walking, plate beside model, and what describes them by fulcrum position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.style import (
    MARKERS,
    MEASURED,
    NEUTRAL,
    SIMULATED,
    condition_colour,
    condition_label,
    label,
    new_figure,
    style,
)

PANELS = (("radius_m", 1e3, "arc radius (mm)"), ("effective_foot_length_ratio", 1.0, "effective / foot length (1)"),
          ("mean_moment_arm_m", 1e3, "mean moment arm (mm)"))


def roll_over_shape_figure(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Figure:
    """The figure of a roll-over section's walks (`analysis.validation.roll_over.section`)."""
    with style():
        figure = new_figure(10.5, 6.6)
        grid = figure.add_gridspec(2, 3, height_ratios=(1.25, 1.0))
        _shapes(figure.add_subplot(grid[0, :]), table, arrays)
        for i, (name, scale, words) in enumerate(PANELS):
            _numbers(figure.add_subplot(grid[1, i]), table, name, scale, words, legend=i == 0)
        figure.draw_without_rendering()
    return figure


def mean_curve(curves: Sequence[np.ndarray]) -> np.ndarray:
    """(n,) mean of the curves (n,) where all are known, else NaN."""
    return np.asarray(np.mean(np.array(curves, dtype=float), axis=0))


def _shapes(axes: Axes, table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> None:
    for i, condition in enumerate(table["conditions"]):
        fulcrum = condition["fulcrum_mm"]
        own = [row["curves"] for row in table["walks"] if row["fulcrum_mm"] == fulcrum]
        for side, look in (("measured", MEASURED), ("model", SIMULATED)):
            forward, up = (1e3 * mean_curve([arrays[f"{name}_{side}_{axis}_m"] for name in own])
                           for axis in ("forward", "up"))
            if np.isfinite(forward).any():
                axes.plot(forward, up, color=condition_colour(1e-3 * fulcrum), marker=MARKERS[i % len(MARKERS)],
                          markersize=4.5, markevery=(3 + 2 * i, 9), **look,
                          label=f"{condition_label(1e-3 * fulcrum)}, {'plate' if side == 'measured' else 'model'}")
    axes.plot(0.0, 0.0, "+", color=NEUTRAL, markersize=10, label="end of the pylon")
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(loc="upper right", ncols=2)
    label(axes, x="forward of the pylon's axis (mm)", y="above the pylon's end (mm)",
          title="Centre of pressure seen from the shank, mean of the footfalls, heel strike to the end of the shape")


def _numbers(axes: Axes, table: Mapping[str, Any], name: str, scale: float, words: str, *, legend: bool) -> None:
    looks = {"measured": ("o", True, "plate"), "model": ("D", False, "model")}
    for side, (marker, filled, said) in looks.items():
        shift = 2.0 if filled else -2.0
        known = [(row["fulcrum_mm"], scale * row[side][name]) for row in table["walks"] if row[side][name] is not None]
        for fulcrum, value in known:
            colour = condition_colour(1e-3 * fulcrum)
            axes.plot(fulcrum + shift, value, marker, markersize=6, color=colour,
                      markerfacecolor=colour if filled else "white")
        axes.plot([], [], marker, color=NEUTRAL, markerfacecolor=NEUTRAL if filled else "white", label=said)
    axes.margins(x=0.12, y=0.15)
    if legend:
        axes.legend(loc="best")
    label(axes, x="fulcrum position (mm)", y=words)
