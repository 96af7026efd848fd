"""What else changes with the setting: one small panel an outcome, over the whole range of the fulcrum."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.style import condition_colour, label, new_figure, style
from vsf_drake.report.tuning.cost_curve_figure import FULCRUM, every, mark_origin, mark_positions
from vsf_drake.report.tuning.table import swept_part

_ACROSS, _WIDE = 3, 38
"""Panels side by side; letters of a title's line."""


def shown_outcomes(table: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Outcomes that were followed over the range."""
    return [row for row in table["outcomes"] if len(swept_part(table, "outcomes", row["name"])[0]) > 1]


def outcomes_figure(table: Mapping[str, Any]) -> Figure:
    """One panel an outcome; the grey band is its uncertainty about the value at the optimum."""
    rows = shown_outcomes(table)
    across = min(_ACROSS, len(rows))
    down = -(-len(rows) // across)
    with style():
        figure = new_figure(10.6 if across > 1 else 6.0, 0.5 + 2.5 * down)
        panels = figure.subplots(down, across, sharex=True, squeeze=False).ravel()
        for axes, row in zip(panels, rows, strict=False):
            _panel(axes, table, row)
        for axes in panels[len(rows):]:
            axes.set_axis_off()
        for axes in panels[max(len(rows) - across, 0):len(rows)]:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel(FULCRUM)
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure


def _panel(axes: Axes, table: Mapping[str, Any], row: Mapping[str, Any]) -> None:
    x, y = swept_part(table, "outcomes", row["name"])
    mark_positions(axes, table, named=False)
    here = row["optimum"]
    if here is not None and row["uncertainty"] is not None:
        axes.axhspan(here - row["uncertainty"], here + row["uncertainty"], color="0.8", alpha=0.5, zorder=0)
    axes.plot(x, y, color="black", linewidth=1.5, marker="o", markersize=3.0, markevery=every(x))
    if here is not None and table["fulcrum_mm"] is not None and table["optimal"]:
        axes.plot(table["fulcrum_mm"], here, marker="*", markersize=12, color="white", zorder=5,
                  markeredgecolor=condition_colour(1e-3 * table["fulcrum_mm"]), markeredgewidth=1.4)
    if np.ptp(y) == 0.0:
        axes.margins(y=0.5)
    hardly = ": hardly changes" if row["matters"] is False else ""
    label(axes, x="", y=row["unit"] if row["unit"] not in ("", "1") else "no unit",
          title=textwrap.fill(f"{row['label']}{hardly}", _WIDE))
