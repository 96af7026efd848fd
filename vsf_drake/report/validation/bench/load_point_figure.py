"""Stiffness with the load elsewhere on the keel, beside the closed form of the overhung beam."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure

from vsf_drake.report.style import MARKERS, NEUTRAL, SIMULATED, condition_colour, label, new_figure, style
from vsf_drake.report.validation.bench.words import metres, numbers, position

_DOTTED: dict[str, Any] = {"linestyle": (0, (1, 1.2)), "linewidth": 1.3}


def bench_load_point_figure(table: Mapping[str, Any]) -> Figure:
    """The figure: one line a fulcrum position; `table` of the bench section, which has load points."""
    points = table["load_points"]
    with style():
        figure = new_figure(7.2, 4.2)
        axes = figure.subplots()
        for i, fulcrum in enumerate(sorted({row["fulcrum_mm"] for row in points})):
            rows = [row for row in points if row["fulcrum_mm"] == fulcrum]
            colour, x = condition_colour(metres(fulcrum)), numbers(rows, "load_point_mm")
            axes.plot(x, numbers(rows, "stiffness_n_per_mm"), color=colour, marker=MARKERS[i % len(MARKERS)],
                      markersize=5, **SIMULATED)
            axes.plot(x, numbers(rows, "closed_form_n_per_mm"), color=colour, **_DOTTED)
            axes.annotate(position(fulcrum), (x[-1], rows[-1]["stiffness_n_per_mm"]), xytext=(7, 0), va="center",
                          fontsize=8, textcoords="offset points", color=colour, fontweight="bold",
                          annotation_clip=False)
        axes.plot([], [], color=NEUTRAL, marker="o", markersize=5, label="simulated", **SIMULATED)
        axes.plot([], [], color=NEUTRAL, **_DOTTED, label="overhung beam, small deflections")
        axes.set_xticks(sorted({row["load_point_mm"] for row in points}))
        axes.set_ylim(bottom=0.0)
        axes.margins(x=0.1)
        axes.legend(loc="upper right")
        label(axes, x="load from the keel's posterior end (mm)", y="stiffness above 200 N (N/mm)",
              title="Stiffness by where the foot is loaded, and by position of the fulcrum")
        figure.draw_without_rendering()
    return figure
