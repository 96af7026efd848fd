"""Morris' screening: the strongest factors of each output."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsf_drake.report.style import label, new_figure, style
from vsf_drake.report.validation.sensitivity.words import GROUPS, OUTPUTS, look, shown_outputs, top

MOST = 12


def screening_figure(table: Mapping[str, Any]) -> Figure:
    """mu* of the MOST strongest factors, one panel an output; at least one main output must have rows."""
    names = shown_outputs(table["morris"])
    with style():
        figure = new_figure(11.0 if len(names) > 1 else 6.5, 4.8)
        panels = figure.subplots(1, len(names), squeeze=False)[0]
        for axes, name in zip(panels, names, strict=True):
            _panel(axes, table, name)
        present = {row["group"] for name in names for row in top(table["morris"][name], "mu_star", MOST)}
        handles: list[Any] = [Patch(label=group, **look(group)) for group in GROUPS if group in present]
        handles += [Line2D([], [], color="black", marker="D", linestyle="", markersize=4.5, markerfacecolor="white",
                           label="size of the mean effect, signs kept"),
                    Line2D([], [], color="black", linewidth=1.0, label="95 % bootstrap interval")]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
        if table["synthetic"]:
            figure.suptitle("SYNTHETIC trials, not recorded", x=0.01, ha="left", fontsize=11)
        figure.draw_without_rendering()
    return figure


def _panel(axes: Axes, table: Mapping[str, Any], name: str) -> None:
    output, rows = OUTPUTS[name], top(table["morris"][name], "mu_star", MOST)
    places = np.arange(len(rows))
    for place, row in zip(places, rows, strict=True):
        size = output.scale * row["mu_star"]
        axes.barh(place, size, height=0.72, **look(row["group"]))
        spread = output.scale * row["mu_star_conf"]
        axes.plot([max(size - spread, 0.0), size + spread], [place, place], color="black", linewidth=1.0)
        axes.plot(output.scale * abs(row["mu"]), place, marker="D", markersize=4.0, color="black",
                  markerfacecolor="white", linestyle="")
    axes.set_yticks(places, [row["name"] for row in rows], fontsize=8.0)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(left=0.0)
    axes.grid(False, axis="y")
    label(axes, x=f"effect mu* ({output.unit})", y="factor",
          title=f"{output.name}: {output.shown(table['baseline'][name]['mean'])}")
