"""Loading and unloading: the loop at the highest speed, what is lost by speed, and what is stored by position."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from vsf_drake.report.style import MARKERS, NEUTRAL, SIMULATED, condition_colour, label, log_scale, new_figure, style
from vsf_drake.report.validation.bench.words import metres, numbers, position, source

_BACK: dict[str, Any] = {"linestyle": (0, (1, 1.2)), "linewidth": 1.3}


def bench_energy_figure(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Figure:
    """The figure: loops, loss over speed, stored energy by setting; `table` and `arrays` of the bench section."""
    with style():
        figure = new_figure(10.5, 4.2)
        first, second, third = figure.subplots(1, 3, width_ratios=(1.15, 1.0, 1.0))
        _loops(first, table, arrays)
        _losses(second, table)
        _stored(third, table)
        figure.draw_without_rendering()
    return figure


def _loops(axes: Axes, table: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    x, load = (np.asarray(arrays[key], dtype=float) for key in ("loop_mm", "loop_n"))
    for i, fulcrum in enumerate(table["rate_settings_mm"]):
        colour = condition_colour(metres(fulcrum))
        axes.fill(np.concatenate(x[i]), np.concatenate(load[i]), color=colour, alpha=0.18, linewidth=0)
        axes.plot(x[i, 0], load[i, 0], color=colour, **SIMULATED)
        axes.plot(x[i, 1], load[i, 1], color=colour, **_BACK)
    axes.plot([], [], color=NEUTRAL, label="loading", **SIMULATED)
    axes.plot([], [], color=NEUTRAL, label="unloading (area between: lost)", **_BACK)
    axes.set_xlim(left=0.0)
    axes.margins(y=0.12)
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="lower right", frameon=True, facecolor="white", edgecolor="none", framealpha=1.0)
    label(axes, x="displacement of the platen (mm)", y="load (N)",
          title=f"There and back at {max(table['rate_speeds_mm_per_min']):g} mm/min")


def _losses(axes: Axes, table: Mapping[str, Any]) -> None:
    for i, fulcrum in enumerate(table["rate_settings_mm"]):
        rows = [row for row in table["rates"] if row["fulcrum_mm"] == fulcrum and row["lost_j"] > 0.0]
        axes.plot(numbers(rows, "speed_mm_per_min"), [100.0 * (1.0 - row["return_ratio"]) for row in rows],
                  color=condition_colour(metres(fulcrum)), marker="*" if fulcrum is None else MARKERS[i % len(MARKERS)],
                  markersize=5, label=position(fulcrum), **SIMULATED)
    log_scale(axes.xaxis)
    log_scale(axes.yaxis)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda number, _: f"{number:g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.legend(loc="upper left")
    label(axes, x="speed of the platen (mm/min)", y="lost of what was stored (%)", title="Loss by speed")


def _stored(axes: Axes, table: Mapping[str, Any]) -> None:
    slowest = min(table["rate_speeds_mm_per_min"], key=lambda speed: abs(speed - table["speed_mm_per_min"]))
    rows = [row for row in table["rates"] if row["speed_mm_per_min"] == slowest]
    places = np.arange(len(rows))
    axes.bar(places, numbers(rows, "stored_j"), 0.62, edgecolor="0.1", linewidth=0.6,
             color=[condition_colour(metres(row["fulcrum_mm"])) for row in rows], alpha=0.75, label="simulated")
    axes.plot(places, numbers(rows, "linear_spring_j"), linestyle="", marker="_", markersize=22, markeredgewidth=2.2,
              color="0.05", label="linear spring, F²/2k")
    measured = {row["fulcrum_mm"]: row for row in table["settings"]
                if row["measured"] and abs(row["max_load_n"] - 600.0) < 1.0}
    stored = numbers([measured.get(row["fulcrum_mm"], {}) for row in rows], "measured", "stored_j")
    if np.isfinite(stored).any():
        axes.plot(places, stored, linestyle="", marker="D", markersize=6, color="white", markeredgecolor="0.05",
                  markeredgewidth=1.2, label=source(table))
    axes.set_xticks(places, [position(row["fulcrum_mm"]).removesuffix(" mm") for row in rows])
    axes.set_ylim(0.0, 1.35 * axes.get_ylim()[1])
    axes.legend(loc="upper right")
    label(axes, x="fulcrum (mm), heel", y="energy stored at 600 N (J)", title=f"Stored at {slowest:g} mm/min")


