"""Load over displacement at every setting, experiment beside simulation, after Figure 4 of McGeehan 2021."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.style import MEASURED, NEUTRAL, SIMULATED, condition_colour, label, new_figure, style
from vsf_drake.report.validation.bench.words import metres, position, source

_SLOPE_ABOVE_N = 200.0
_DOTTED: dict[str, Any] = {"linestyle": (0, (1, 2)), "linewidth": 1.2}


def bench_curves_figure(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Figure:
    """The figure: forefoot on the left, heel on the right; `table` and `arrays` of the bench section."""
    with style():
        figure = new_figure(10.5, 5.0)
        left, right = figure.subplots(1, 2, width_ratios=(2.4, 1.0), sharey=True)
        for i, row in enumerate(table["settings"]):
            _setting(left if row["fulcrum_mm"] is not None else right, i, row, table, arrays)
        if table["measured"]:
            left.plot([], [], color=NEUTRAL, label=source(table), **MEASURED)
        else:
            left.plot([], [], color=NEUTRAL, label="published slope, laid through the simulation at 200 N", **MEASURED)
        left.plot([], [], color=NEUTRAL, label=f"simulated: {table['lines'][0]['name']}", **SIMULATED)
        if any(line["key"] == "nominal" for line in table["lines"]):
            left.plot([], [], color=NEUTRAL, label="simulated: nominal", **_DOTTED)
        left.legend(loc="lower right", frameon=True, facecolor="white", edgecolor="none", framealpha=1.0)
        for axes in (left, right):
            axes.axhline(_SLOPE_ABOVE_N, color=NEUTRAL, linewidth=0.8, linestyle=":")
            axes.set_xlim(left=0.0)
            axes.margins(y=0.1)
            axes.set_ylim(bottom=0.0)
        label(left, x="displacement since touch-down (mm)", y="load (N)", title="Forefoot, by position of the fulcrum")
        label(right, x="displacement since touch-down (mm)", y="load (N)", title="Heel")
        figure.draw_without_rendering()
    return figure


def _setting(
    axes: Axes, i: int, row: Mapping[str, Any], table: Mapping[str, Any], arrays: Mapping[str, Any]
) -> None:
    colour = condition_colour(metres(row["fulcrum_mm"]))
    load = np.asarray(arrays["load_n"], dtype=float)[i]
    curves = {key: np.asarray(arrays[f"{key}_mm"], dtype=float)[i] for key in ("measured", "model", "nominal")
              if f"{key}_mm" in arrays}
    half = np.asarray(arrays["measured_half_width_mm"], dtype=float)[i]
    if np.isfinite(half).any():
        axes.fill_betweenx(load, curves["measured"] - half, curves["measured"] + half, color=colour, alpha=0.2,
                           linewidth=0)
    axes.plot(curves["measured"], load, color=colour, **MEASURED)
    axes.plot(curves["model"], load, color=colour, **SIMULATED)
    if "nominal" in curves:
        axes.plot(curves["nominal"], load, color=colour, **_DOTTED)
    if not table["measured"] and row["published_n_per_mm"] is not None and np.isfinite(curves["model"]).all():
        above = load >= _SLOPE_ABOVE_N
        start = float(np.interp(_SLOPE_ABOVE_N, load, curves["model"]))
        axes.plot(start + (load[above] - _SLOPE_ABOVE_N) / row["published_n_per_mm"], load[above], color=colour,
                  **MEASURED)
    shown = next((curve for curve in (curves["model"], curves["measured"]) if np.isfinite(curve[-1])), None)
    if shown is not None:
        axes.annotate(position(row["fulcrum_mm"]), (shown[-1], load[-1]), xytext=(0, 5), ha="center", fontsize=8,
                      textcoords="offset points", color=colour, fontweight="bold", annotation_clip=False)
