"""A schedule drawn: the cost of every task over the range, and the setting over what tells the tasks apart."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vsf_drake.report.style import NEUTRAL, condition_colour, label, new_figure, style
from vsf_drake.report.tuning.figures import FULCRUM, mark_origin

_DASHES = ("-", "--", "-.", ":", (0, (6, 1.5, 1, 1.5)), (0, (1, 1)))
_TITLES = {"speed_m_per_s": "speed (m/s)", "slope_deg": "slope (°, uphill +)", "carried_kg": "carried load (kg)"}


def telling(table: Mapping[str, Any]) -> str | None:
    """The one descriptor in which the tasks differ; None if there is none, or several."""
    found = [name for name in _TITLES if len({row[name] for row in table["tasks"]}) > 1]
    known = all(row[name] is not None for name in found for row in table["tasks"])
    return found[0] if len(found) == 1 and known else None


def schedule_curves_figure(table: Mapping[str, Any]) -> Figure:
    """By how much each task's cost exceeds its own least, over the fulcrum; the one setting for all as a line."""
    with style():
        figure = new_figure(8.6, 4.2)
        axes = figure.subplots()
        for i, row in enumerate(curved(table)):
            x, y = (np.array(row["sweep"][key], dtype=float) for key in ("fulcrum_mm", "cost"))
            least = row["cost_exact"] if row["cost_exact"] is not None else y.min()
            colour = NEUTRAL if row["fulcrum_mm"] is None else condition_colour(1e-3 * row["fulcrum_mm"])
            axes.plot(x, y - least, color=colour, linestyle=_DASHES[i % len(_DASHES)], linewidth=1.6,
                      label=row["label"])
            if row["fulcrum_mm"] is not None and row["cost"] is not None:
                axes.plot(row["fulcrum_mm"], row["cost"] - least, marker="o" if row["optimal"] else "x", color=colour,
                          markersize=7, linestyle="")
        if table["common_fulcrum_mm"] is not None:
            axes.axvline(table["common_fulcrum_mm"], color=NEUTRAL, linestyle="--", linewidth=1.3,
                         label=f"one for all, {table['common_fulcrum_mm']:.1f} mm")
        axes.legend(loc="best", frameon=True, facecolor="white", edgecolor="none", framealpha=0.8)
        label(axes, x=FULCRUM, y=f"cost above the task's least ({table['cost_unit']})",
              title=f"Each task over the whole range: {table['cost_label']}")
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure


def curved(table: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Tasks whose cost is known over the range."""
    return [row for row in table["tasks"] if len(row["sweep"]["fulcrum_mm"]) > 1]


def policy_figure(table: Mapping[str, Any], name: str) -> Figure:
    """The setting over one descriptor, `name`, with its lookup between and outside of the tasks."""
    rows = sorted((row for row in table["tasks"] if row["exact_mm"] is not None), key=lambda row: row[name])
    x, y = ([row[key] for row in rows] for key in (name, "exact_mm"))
    beyond = 0.15 * (max(x) - min(x) or 1.0)
    with style():
        figure = new_figure(7.4, 3.8)
        axes = figure.subplots()
        axes.plot([x[0] - beyond, *x, x[-1] + beyond], [y[0], *y, y[-1]], color="black", linewidth=1.2,
                  label="lookup, before rounding")
        for i, row in enumerate(rows):
            if row["interval_mm"] is not None:
                axes.plot([row[name]] * 2, row["interval_mm"], color="0.8", linewidth=6.0, solid_capstyle="butt",
                          zorder=0, label="interval" if i == 0 else None)
            axes.plot(row[name], row["fulcrum_mm"], marker="o", markersize=8, linestyle="",
                      color=condition_colour(1e-3 * row["fulcrum_mm"]), label="stored" if i == 0 else None)
            axes.annotate(row["label"], (row[name], row["fulcrum_mm"]), xytext=(8, 6), textcoords="offset points",
                          fontsize=8)
        if table["common_fulcrum_mm"] is not None:
            axes.axhline(table["common_fulcrum_mm"], color=NEUTRAL, linestyle="--", linewidth=1.2, label="one for all")
        low, high = table["reach_mm"]
        axes.set_ylim(low - 2.0, high + 2.0)
        axes.legend(loc="best", frameon=True, facecolor="white", edgecolor="none", framealpha=0.8)
        label(axes, x=_TITLES[name], y=FULCRUM, title="What the controller would set")
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure
