"""Stiffness by fulcrum position, and by what the simulation misses it and the mid-range displacement."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.style import (
    MARKERS,
    MEASURED,
    NEUTRAL,
    SHADE,
    SIMULATED,
    condition_colour,
    label,
    new_figure,
    style,
)
from vsf_drake.report.validation.bench.words import LINE_GREYS, LINE_MARKERS, forefoot, numbers, source


def bench_agreement_figure(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Figure:
    """The figure: three panels with measured curves, the first alone without."""
    with style():
        if table["n"]:
            figure = new_figure(10.5, 4.3)
            first, second, third = figure.subplots(1, 3, width_ratios=(1.1, 1.0, 1.0))
            _errors(second, table, arrays)
            _offsets(third, table)
        else:
            figure = new_figure(6.4, 4.3)
            first = figure.subplots()
        _stiffness(first, table)
        figure.draw_without_rendering()
    return figure


def _stiffness(axes: Axes, table: Mapping[str, Any]) -> None:
    rows = forefoot(table)
    x, measured, model = numbers(rows, "fulcrum_mm"), *(
        numbers(rows, key, "stiffness_n_per_mm") for key in ("measured", "model"))
    if np.isfinite(measured).any():
        axes.plot(x, measured, color=NEUTRAL, label=source(table), **MEASURED)
    axes.plot(x, model, color=NEUTRAL, label=f"simulated: {table['lines'][0]['name']}", **SIMULATED)
    for i, row in enumerate(rows):
        colour = condition_colour(1e-3 * x[i])
        if row["published_n_per_mm"] is not None:
            axes.plot(x[i], row["published_n_per_mm"], marker="_", markersize=20, markeredgewidth=3.0, color=colour,
                      alpha=0.6, linestyle="")
        half = numbers([row], "measured", "stiffness_n_per_mm_half_width")[0]
        axes.errorbar(x[i], measured[i], yerr=half if np.isfinite(half) else None, color=colour, linestyle="",
                      capsize=4, marker=MARKERS[i % len(MARKERS)], markersize=6)
        axes.plot(x[i], model[i], marker=MARKERS[i % len(MARKERS)], color=colour, markersize=10, linestyle="",
                  markerfacecolor="none", markeredgewidth=1.4)
    axes.plot([], [], marker="_", markersize=14, markeredgewidth=3.0, color=NEUTRAL, alpha=0.6, linestyle="",
              label="published end points")
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.1, y=0.12)
    axes.legend(loc="upper left")
    label(axes, x="fulcrum from the keel's posterior end (mm)", y="stiffness above 200 N (N/mm)", title="Stiffness")


def _errors(axes: Axes, table: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    rows, limit = forefoot(table), table["limits"]["stiffness_rmse_n_per_mm"]
    measured = numbers(rows, "measured", "stiffness_n_per_mm")
    axes.axhspan(-limit, limit, color=SHADE, zorder=0, label=f"paper's RMSE, ± {limit:g} N/mm")
    axes.axhline(0.0, color=NEUTRAL, linewidth=0.8)
    if table["regression"] is not None:
        at, line, low, high = (np.asarray(arrays[f"regression_{key}"], dtype=float)
                               for key in ("measured_n_per_mm", "line", "low", "high"))
        axes.fill_between(at, low - at, high - at, color="0.5", alpha=0.35, linewidth=0,
                          label=f"regression, 95 % band (n = {table['regression']['n']})")
        axes.plot(at, line - at, color="0.1", **SIMULATED)
    for line in table["lines"]:
        axes.plot(measured, numbers(rows, line["key"], "stiffness_error_n_per_mm"), linestyle="", color="0.1",
                  marker=LINE_MARKERS[line["key"]], markerfacecolor="0.1" if line["key"] == "model" else "none",
                  markersize=5 if line["key"] == "model" else 8, label=line["name"])
    axes.set_ylim(-1.9 * limit, 2.6 * limit)
    axes.margins(x=0.08)
    axes.legend(loc="upper left", fontsize=7.5)
    label(axes, x="measured stiffness (N/mm)", y="simulated less measured (N/mm)", title="Error of stiffness")


def _offsets(axes: Axes, table: Mapping[str, Any]) -> None:
    rows, limit = forefoot(table), table["limits"]["mid_range_rmse_mm"]
    places, lines = np.arange(len(rows)), table["lines"]
    axes.axhspan(-limit, limit, color=SHADE, zorder=0, label=f"paper's RMSE, ± {limit:g} mm")
    axes.axhline(0.0, color=NEUTRAL, linewidth=0.8)
    width = 0.8 / len(lines)
    for j, line in enumerate(lines):
        offset = numbers(rows, line["key"], "mid_range_offset_mm")
        axes.bar(places + (j - 0.5 * (len(lines) - 1)) * width, offset, width, color=LINE_GREYS[line["key"]],
                 edgecolor="0.1", linewidth=0.6, label=line["name"])
    axes.set_xticks(places, [f"{row['fulcrum_mm']:g}" for row in rows])
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.45 * (high - low))
    axes.legend(loc="upper left", fontsize=7.5)
    label(axes, x="fulcrum from the keel's posterior end (mm)", y="simulated less measured (mm)",
          title="Offset Δ_D of the mid-range displacement")
