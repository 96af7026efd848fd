"""The way to a contact fit: the cost of each search, or the paper's error over its iterations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from vsf_drake.report.style import NEUTRAL, label, log_scale, new_figure, style

_END, _FAILED = "#1f6f8b", "#b3261e"


def fit_search_figure(table: Mapping[str, Any]) -> Figure:
    """The figure of a fit's table, one that failed too; either `searches` or `history` is not empty."""
    with style():
        figure = new_figure(7.6, 3.4)
        axes = figure.subplots()
        if table["searches"]:
            _searches(axes, table)
        else:
            _history(axes, table)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        figure.draw_without_rendering()
    return figure


def _searches(axes: Any, table: Mapping[str, Any]) -> None:
    searches = table["searches"]
    for i, s in enumerate(searches, start=1):
        if s["cost"] is None:
            axes.plot(i, 0.04, marker="x", color=_FAILED, markersize=9, markeredgewidth=2.2,
                      transform=axes.get_xaxis_transform())
            continue
        axes.plot([i, i], [s["start_cost"], s["cost"]], color=NEUTRAL, linewidth=1.0, zorder=1)
        axes.plot(i, s["start_cost"], marker="o", color=NEUTRAL, markerfacecolor="white", markersize=7)
        best = i - 1 == table["best_search"]
        axes.plot(i, s["cost"], marker=("*" if best else "o") if s["success"] else "x",
                  color=_END if s["success"] else _FAILED, markersize=13 if best else 8, markeredgewidth=1.8)
        axes.annotate(f"{s['cost']:.1f}", (i, s["cost"]), xytext=(9, 0), textcoords="offset points", va="center",
                      fontsize=8)
    if any(s["cost"] is not None for s in searches):
        log_scale(axes.yaxis)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(0.5, len(searches) + 0.7)
    axes.margins(y=0.15)
    handles = [
        Line2D([], [], marker="o", color=NEUTRAL, markerfacecolor="white", linestyle="", label="start"),
        Line2D([], [], marker="o", color=_END, linestyle="", label="end"),
        Line2D([], [], marker="*", color=_END, linestyle="", markersize=12, label="end, taken"),
        *([] if all(s["success"] for s in searches) else [Line2D(
            [], [], marker="x", color=_FAILED, linestyle="", markeredgewidth=1.8, label="end, not converged")])]
    axes.figure.legend(handles=handles, loc="outside lower center", ncols=4)
    label(axes, x="search (number)", y="cost (half the sum of squares, 1)", title="Searches from different starts")


def _history(axes: Any, table: Mapping[str, Any]) -> None:
    rows = [{"iteration": 0, "rms_n": table["initial_rms_n"]}, *table["history"]]
    axes.plot([row["iteration"] for row in rows], [row["rms_n"] for row in rows], color=_END, marker="o",
              markersize=4.0, linewidth=1.4)
    axes.set_ylim(bottom=0.0)
    label(axes, x="iteration (0: initial guess)", y="best RMS difference\nof the resultant (N)",
          title="The paper's search")
