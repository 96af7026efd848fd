"""The cost over the whole range of the fulcrum, where it is least, and what it is made of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.style import MARKERS, NEUTRAL, SHADE, condition_colour, label, new_figure, style
from vsf_drake.report.tuning.table import recorded_positions, swept, swept_part
from vsf_drake.report.tuning.words import NOT_OPTIMAL

FULCRUM = "fulcrum from the keel's end (mm)"
_FAILED = "#b3261e"
_DASHES = ("-", "--", "-.", ":", (0, (6, 1.5, 1, 1.5)), (0, (1, 1)))


def cost_curve_figure(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Figure:
    """Left, the cost with its optimum; right, what each of its terms adds as the fulcrum leaves the optimum."""
    terms = [row for row in table["terms"] if len(swept_part(table, "terms", row["name"])[0])]
    with style():
        figure = new_figure(10.6 if len(terms) > 1 else 7.4, 4.3)
        panels = figure.subplots(1, 2 if len(terms) > 1 else 1, squeeze=False)[0]
        _cost(panels[0], table, arrays)
        if len(terms) > 1:
            _terms(panels[1], table, terms)
        for axes in panels:
            mark_positions(axes, table)
            axes.legend(loc="best", frameon=True, facecolor="white", edgecolor="none", framealpha=0.8)
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure


def mark_positions(axes: Axes, table: Mapping[str, Any], *, named: bool = True) -> None:
    """The interval of the optimum as a band, and lines where the fulcrum was recorded and where it ended."""
    interval = table["fulcrum_interval_mm"]
    if interval is not None and table["optimal"]:
        axes.axvspan(*interval, color=SHADE, zorder=0, label="its interval" if named else None)
    for i, mm in enumerate(recorded_positions(table)):
        axes.axvline(mm, color=NEUTRAL, linestyle=":", linewidth=1.2, zorder=1,
                     label="recorded" if named and not i else None)
    if table["fulcrum_mm"] is not None:
        colour = condition_colour(1e-3 * table["fulcrum_mm"]) if table["optimal"] else _FAILED
        axes.axvline(table["fulcrum_mm"], color=colour, linewidth=1.0, zorder=1)


def mark_origin(figure: Figure, table: Mapping[str, Any]) -> None:
    """Above a figure: that there is no optimum, that data are synthetic."""
    said = [*([NOT_OPTIMAL] if not table["optimal"] else []),
            *(["SYNTHETIC trials, not recorded"] if table["synthetic"] else [])]
    if said:
        figure.suptitle("; ".join(said), x=0.01, ha="left", fontsize=10.5,
                        color=_FAILED if not table["optimal"] else "black")


def every(x: np.ndarray) -> int:
    """How many points of a curve share a marker, so that there are about twenty."""
    return max(1, round(len(x) / 20))


def _cost(axes: Axes, table: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    x, y = swept(table)
    x_of, trials = arrays.get("sweep_mm"), arrays.get("sweep_cost_trials")
    if x_of is not None and trials is not None and np.shape(trials)[1] > 1:
        own = np.asarray(trials, dtype=float).T
        at = int(np.argmin(np.abs(np.asarray(x_of) - (table["fulcrum_mm"] or np.median(x_of)))))
        mean = own.mean(axis=0)
        for i, values in enumerate(own):
            axes.plot(x_of, values - values[at] + mean[at], color="0.75", linewidth=0.9, zorder=1,
                      label="one trial, shifted" if i == 0 else None)
    axes.plot(x, y, color="black", linewidth=1.8, marker="o", markersize=3.5, markevery=every(x), label="cost")
    if table["fulcrum_mm"] is not None and table["cost"] is not None:
        if table["optimal"]:
            axes.plot(table["fulcrum_mm"], table["cost"], marker="*", markersize=15, color="white", linestyle="",
                      markeredgecolor=condition_colour(1e-3 * table["fulcrum_mm"]), markeredgewidth=1.6, zorder=5,
                      label=f"optimum, {table['fulcrum_mm']:.1f} mm")
        else:
            axes.plot(table["fulcrum_mm"], table["cost"], marker="x", markersize=11, color=_FAILED, linestyle="",
                      markeredgewidth=2.4, zorder=5, label=f"last iterate, {NOT_OPTIMAL}")
    label(axes, x=FULCRUM, y=f"{table['cost_label']} ({table['cost_unit']})", title="Cost over the whole range")


def _terms(axes: Axes, table: Mapping[str, Any], terms: list[Mapping[str, Any]]) -> None:
    axes.axhline(0.0, color="0.4", linewidth=0.8)
    for i, row in enumerate(terms):
        x, y = swept_part(table, "terms", row["name"])
        here = row["value"] if row["value"] is not None else float(y.min())
        axes.plot(x, y - here, color=f"{0.08 + 0.5 * i / len(terms):.2f}", linewidth=1.6, linestyle=_DASHES[i % 6],
                  marker=MARKERS[i % len(MARKERS)], markersize=3.5, markevery=every(x), label=row["label"])
    label(axes, x=FULCRUM, y=f"change from the optimum ({table['cost_unit']})", title="What each term adds")
