"""The linear and the curvilinear part of the bench's curves: slope over load, and how much the foam's toe takes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vsf_drake.report.style import MEASURED, NEUTRAL, SIMULATED, condition_colour, label, new_figure, style
from vsf_drake.report.validation.bench.words import LINE_GREYS, forefoot, metres, numbers, position, source


def bench_shape_figure(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Figure:
    """The figure: slope dF/dx over load on the left, curvature by position on the right."""
    with style():
        figure = new_figure(10.5, 4.4)
        left, right = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
        load = np.asarray(arrays["load_n"], dtype=float)
        for i, row in enumerate(table["settings"]):
            if row["fulcrum_mm"] is None:
                continue
            colour, last = condition_colour(metres(row["fulcrum_mm"])), float("nan")
            for key, look in (("measured", MEASURED), ("model", SIMULATED)):
                slope = np.asarray(arrays[f"{key}_tangent_n_per_mm"], dtype=float)[i]
                left.plot(load[i], slope, color=colour, **look)
                known = np.flatnonzero(np.isfinite(slope))
                last = slope[known[-1]] if known.size else last
            if np.isfinite(last):
                left.annotate(position(row["fulcrum_mm"]), (load[i, -1], last), xytext=(3, 0), va="center", fontsize=8,
                              textcoords="offset points", color=colour, fontweight="bold", annotation_clip=False)
        left.axvline(200.0, color=NEUTRAL, linewidth=0.8, linestyle=":")
        if table["measured"]:
            left.plot([], [], color=NEUTRAL, label=source(table), **MEASURED)
        left.plot([], [], color=NEUTRAL, label=f"simulated: {table['lines'][0]['name']}", **SIMULATED)
        left.set_ylim(0.0, 1.2 * left.get_ylim()[1])
        left.legend(loc="upper left")
        label(left, x="load (N)", y="slope dF/dx (N/mm)", title="Slope over load (dotted: 200 N)")
        rows = forefoot(table)
        keys = (["measured"] if table["measured"] else []) + [line["key"] for line in table["lines"]]
        names = {line["key"]: line["name"] for line in table["lines"]} | {"measured": source(table)}
        places, width = np.arange(len(rows)), 0.8 / len(keys)
        for j, key in enumerate(keys):
            share = 100.0 * np.array(numbers(rows, key, "shape", "curvature_share"))
            right.bar(places + (j - 0.5 * (len(keys) - 1)) * width, share, width, color=LINE_GREYS[key],
                      edgecolor="0.1", linewidth=0.6, label=names[key])
        right.set_xticks(places, [f"{row['fulcrum_mm']:g}" for row in rows])
        right.set_ylim(0.0, 1.5 * right.get_ylim()[1])
        right.legend(loc="upper left", ncols=2)
        label(right, x="fulcrum from the keel's posterior end (mm)", y="largest distance from the chord (% of travel)",
              title="How far the curve is from straight")
        figure.draw_without_rendering()
    return figure
