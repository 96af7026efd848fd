"""Between two costs, between one setting and several, and how firm the setting is when the contact is not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.style import NEUTRAL, SHADE, condition_colour, label, new_figure, style
from vsf_drake.report.tuning.cost_curve_figure import FULCRUM, mark_origin


def pareto_figure(table: Mapping[str, Any]) -> Figure:
    """The front of two costs: each point is the best that one weight gives."""
    rows = [row for row in table["pareto"] if row["first"] is not None and row["second"] is not None]
    first, second = table["pareto_names"]
    with style():
        figure = new_figure(7.4, 4.4)
        axes = figure.subplots()
        axes.plot([row["first"] for row in rows], [row["second"] for row in rows], color=NEUTRAL, linewidth=1.0)
        for row in rows:
            axes.plot(row["first"], row["second"], marker="o", markersize=7, linestyle="",
                      color=condition_colour(1e-3 * row["fulcrum_mm"]))
        for row in _apart(rows):
            axes.annotate(f"{row['fulcrum_mm']:.0f} mm", (row["first"], row["second"]), xytext=(7, 5),
                          textcoords="offset points", fontsize=8)
        axes.margins(x=0.12, y=0.1)
        label(axes, x=f"{_name(first)} (in its unit)", y=f"{_name(second)} (in its unit)",
              title="Less of one costs more of the other")
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure


def tasks_figure(table: Mapping[str, Any]) -> Figure:
    """Each task's own setting, and by how much one setting for all is worse."""
    rows, common = table["tasks"], table["common_fulcrum_mm"]
    places = np.arange(len(rows))
    with style():
        figure = new_figure(10.6, 1.5 + 0.38 * len(rows))
        left, right = figure.subplots(1, 2, sharey=True)
        if common is not None:
            left.axvline(common, color=NEUTRAL, linestyle="--", linewidth=1.3, label=f"one for all, {common:.1f} mm")
        for place, row in zip(places, rows, strict=True):
            if row.get("interval_mm") is not None:
                left.plot(row["interval_mm"], [place, place], color="0.75", linewidth=5.0, solid_capstyle="butt",
                          zorder=1)
            left.plot(row["fulcrum_mm"], place, marker="o", markersize=8, linestyle="", zorder=2,
                      color=condition_colour(1e-3 * row["fulcrum_mm"]))
            lost = excess(row)
            if lost is not None:
                right.barh(place, lost, height=0.55, color="0.55")
                right.annotate(f" {lost:.2f}", (max(lost, 0.0), place), va="center", fontsize=8)
        left.set_yticks(places, [row["label"] for row in rows])
        left.set_ylim(len(rows) - 0.4, -0.6)
        right.margins(x=0.15)
        right.set_xlim(left=0.0)
        if common is not None:
            left.legend(loc="best", frameon=True, facecolor="white", edgecolor="none")
        unit = "%" if all(_relative(row) for row in rows) else table["cost_unit"]
        label(left, x=FULCRUM, y="", title="Setting of each task")
        label(right, x=f"more {table['cost_label']} with one setting for all ({unit})", y="",
              title="What adaptability buys")
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure


def robustness_figure(table: Mapping[str, Any]) -> Figure:
    """Where the optimum goes when something that is not known exactly is changed."""
    rows = [row for row in table["robustness"] if row["fulcrum_mm"] is not None]
    with style():
        figure = new_figure(8.6, 1.4 + 0.3 * len(rows))
        axes = figure.subplots()
        _spread(axes, table, rows)
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure


def excess(row: Mapping[str, Any]) -> float | None:
    """What a task's cost is worse by with one setting for all: in percent where costs are positive, else as it is."""
    if row["cost"] is None or row["cost_common"] is None:
        return None
    lost = float(row["cost_common"] - row["cost"])
    return 100.0 * lost / row["cost"] if _relative(row) else lost


def _relative(row: Mapping[str, Any]) -> bool:
    return row["cost"] is not None and row["cost"] > 0.0


def _spread(axes: Axes, table: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> None:
    places = range(len(rows))
    if table["fulcrum_interval_mm"] is not None:
        axes.axvspan(*table["fulcrum_interval_mm"], color=SHADE, zorder=0)
    if table["fulcrum_mm"] is not None:
        axes.axvline(table["fulcrum_mm"], color="black", linewidth=1.0, zorder=1)
    for place, row in zip(places, rows, strict=True):
        axes.plot(row["fulcrum_mm"], place, marker="o", markersize=7, linestyle="", zorder=2,
                  color=condition_colour(1e-3 * row["fulcrum_mm"]))
    axes.set_yticks(places, [row["what"] for row in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)
    ends = [row["fulcrum_mm"] for row in table["sweep"]]
    if ends:
        axes.set_xlim(min(ends) - 2.0, max(ends) + 2.0)
    label(axes, x=FULCRUM, y="", title="The optimum when something is changed")


def _apart(rows: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Points that are far enough from the last named one to have a name of their own."""
    if not rows:
        return []
    xs, ys = ([row[key] for row in rows] for key in ("first", "second"))
    wide, tall = (max(max(values) - min(values), 1e-300) for values in (xs, ys))
    named: list[Mapping[str, Any]] = []
    for row in rows:
        if all(np.hypot((row["first"] - other["first"]) / wide, (row["second"] - other["second"]) / tall) > 0.08
               for other in named):
            named.append(row)
    return named


def _name(cost: str) -> str:
    return cost.replace("_", " ")
