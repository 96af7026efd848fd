"""The bench in one figure: load against displacement at every setting, and stiffness against fulcrum position.

After Figure 4 of McGeehan 2021 (doi 10.1115/1.4050456), with the published end points beside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.analysis.bench_metrics import (
    STIFFNESS_ABOVE_N,
    closed_form_stiffness,
    displacement,
    published_stiffness,
)
from vsf_drake.report.style import (
    HEEL_COLOUR,
    MARKERS,
    MEASURED,
    NEUTRAL,
    SIMULATED,
    condition_colour,
    condition_label,
    drawing,
    label,
)
from vsf_drake.simulation.results import BenchResult


def bench_figure(bench: BenchResult, table: Mapping[str, Any]) -> Figure:
    """The figure of a finished bench; `table` is `bench_table(bench)`."""
    with drawing(10.0, 4.6) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(1.35, 1.0))
        _curves(left, bench)
        _stiffness(right, bench, table)
        state = "" if bench.converged else f", {table['unconverged_steps']} STEPS NOT CONVERGED"
        title = f"Testing machine, {table['speed_mm_per_min']:g} mm/min, up to {bench.max_load_n:g} N{state}"
        figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def _curves(axes: Axes, bench: BenchResult) -> None:
    settings = [*bench.forefoot, *([bench.heel] if bench.heel else [])]
    for i, setting in enumerate(settings):
        x, colour = 1e3 * displacement(setting), condition_colour(setting.fulcrum_m)
        marker = "*" if setting.fulcrum_m is None else MARKERS[i % len(MARKERS)]
        axes.plot(x, setting.load_n, color=colour, label=condition_label(setting.fulcrum_m), marker=marker,
                  markevery=(0.06 + 0.02 * i, 0.17), markersize=4.5, **SIMULATED)
        published = published_stiffness(setting.fulcrum_m)
        if published is not None:  # a line of that slope through the simulated curve at 200 N
            x0 = float(np.interp(STIFFNESS_ABOVE_N, setting.load_n, displacement(setting)))
            loads = np.array([STIFFNESS_ABOVE_N, float(np.max(setting.load_n))])
            axes.plot(1e3 * (x0 + (loads - STIFFNESS_ABOVE_N) / published), loads, color=colour, **MEASURED)
    axes.axhline(STIFFNESS_ABOVE_N, color=NEUTRAL, linewidth=0.8, linestyle=":")
    axes.plot([], [], color=NEUTRAL, label="published slope (offset not published)", **MEASURED)
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="lower right", title="dashed: simulated", title_fontsize=8.0, alignment="left", frameon=True,
                facecolor="white", edgecolor="none", framealpha=1.0)
    label(axes, x="displacement of the platen (mm)", y="load (N)",
          title=f"Load and displacement (dotted: {STIFFNESS_ABOVE_N:g} N, above which stiffness is the mean slope)")


def _stiffness(axes: Axes, bench: BenchResult, table: Mapping[str, Any]) -> None:
    rows = table["settings"]
    if rows:
        span = np.linspace(rows[0]["fulcrum_mm"], rows[-1]["fulcrum_mm"], 100)
        beam = closed_form_stiffness(bench.parameters, 1e-3 * span)
        if beam is not None:
            axes.plot(span, 1e-3 * beam, color=NEUTRAL, linewidth=1.2, linestyle=":",
                      label="overhung beam, small deflection")
    for i, row in enumerate(rows):
        colour = condition_colour(1e-3 * row["fulcrum_mm"])
        if row["published_n_per_mm"] is not None:
            axes.plot(row["fulcrum_mm"], row["published_n_per_mm"], marker="_", markersize=22, markeredgewidth=3.5,
                      color=colour, alpha=MEASURED["alpha"], linestyle="")
        axes.plot(row["fulcrum_mm"], row["stiffness_n_per_mm"], marker=MARKERS[i % len(MARKERS)], color=colour,
                  markersize=7, linestyle="", markerfacecolor="none" if row["prediction"] else colour)
        axes.annotate(f"{row['stiffness_n_per_mm']:.1f}", (row["fulcrum_mm"], row["stiffness_n_per_mm"]),
                      xytext=(0, 8), textcoords="offset points", ha="center", fontsize=8)
    axes.plot([], [], linestyle="", marker="o", color=NEUTRAL, label="simulated, calibrated end point")
    axes.plot([], [], linestyle="", marker="o", markerfacecolor="none", color=NEUTRAL, label="simulated, prediction")
    axes.plot([], [], linestyle="", marker="_", markersize=14, markeredgewidth=3.5, color=NEUTRAL,
              alpha=MEASURED["alpha"], label="published")
    heel = table["heel_stiffness_n_per_mm"]
    if heel is not None:
        text = f"heel: {heel:.1f} N/mm (published {table['heel_published_n_per_mm']:g})"
        axes.text(0.98, 0.03, text, color=HEEL_COLOUR, transform=axes.transAxes, ha="right", fontsize=8)
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.1, y=0.15)
    axes.legend(loc="upper left")
    label(axes, x="fulcrum from the keel's posterior end (mm)", y="stiffness (N/mm)", title="Stiffness above 200 N")
