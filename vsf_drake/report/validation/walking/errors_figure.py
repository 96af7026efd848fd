"""Errors of every walk beside the null model and the paper's errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsf_drake.report.style import NEUTRAL, condition_colour, label, new_figure, style

MOST_NAMED = 24
"""Walks that the axis has room to name."""


def walk_errors_figure(table: Mapping[str, Any]) -> Figure:
    """Resultant, centre of pressure, impulse and times; a place on the axis a walk, by fulcrum position."""
    rows: Sequence[Mapping[str, Any]] = table["rows"]
    paper = table["paper"]
    with style():
        figure = new_figure(10.5, 6.6)
        panels = figure.subplots(2, 2, sharex=True)
        _errors(panels[0, 0], rows, "grf_rmse_bw", 100.0)
        _errors(panels[0, 1], rows, "cop_rmse_fl", 100.0)
        _errors(panels[1, 0], rows, "impulse_rmse_bws", 1.0)
        for place, row in enumerate(rows):
            if row["null_model_grf_rmse_bw"] is not None:
                panels[0, 0].plot(place, 100.0 * row["null_model_grf_rmse_bw"], marker="x", color="0.1", markersize=6)
        for axes, key in ((panels[0, 0], "grf_rmse_bw"), (panels[0, 1], "cop_rmse_fl")):
            for condition in table["conditions"]:
                own = [i for i, row in enumerate(rows) if row["fulcrum_mm"] == condition["fulcrum_mm"]]
                if condition["paper"]:
                    level = 100.0 * condition["paper"][key]
                    axes.plot([own[0] - 0.4, own[-1] + 0.4], [level, level], color=NEUTRAL, linewidth=2.2, alpha=0.7)
        panels[1, 0].axhspan(*paper["impulse_rmse_bws"], color=NEUTRAL, alpha=0.2, linewidth=0.0)
        _times(panels[1, 1], rows)
        label(panels[0, 0], x="", y="RMS error (% BW)", title="Resultant force")
        label(panels[0, 1], x="", y="RMS error (% foot length)", title="Centre of pressure, fore-aft")
        label(panels[1, 0], x="walk", y="RMS error (BW s)", title="Impulse of the resultant")
        label(panels[1, 1], x="walk", y="model less plate (ms)", title="Times (late +)")
        named = len(rows) <= MOST_NAMED
        for axes in panels.ravel():
            axes.set_xlim(-0.6, len(rows) - 0.4)
        for axes in panels[1]:
            axes.set_xticks(range(len(rows)), [row["label"] if named else "" for row in rows],
                            rotation=35 if len(rows) > 3 else 0, ha="right" if len(rows) > 3 else "center")
        for axes in panels.ravel()[:3]:
            axes.set_ylim(bottom=-0.03 * axes.get_ylim()[1])
        figure.legend(handles=_handles(table), loc="outside lower center", ncols=4)
        if table["synthetic"]:
            figure.suptitle("SYNTHETIC walks, not recorded", x=0.01, ha="left", fontsize=11)
        figure.draw_without_rendering()
    return figure


def _errors(axes: Axes, rows: Sequence[Mapping[str, Any]], key: str, scale: float) -> None:
    for place, row in enumerate(rows):
        if row[key] is not None:
            colour = condition_colour(1e-3 * row["fulcrum_mm"])
            axes.plot(place, scale * row[key], marker="o", markersize=7, color=colour, markeredgewidth=1.5,
                      markerfacecolor=_fill(row, colour))
    if all(row[key] is None for row in rows):
        axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center", color="0.35")


def _times(axes: Axes, rows: Sequence[Mapping[str, Any]]) -> None:
    axes.axhline(0.0, color="0.75", linewidth=0.7)
    for place, row in enumerate(rows):
        colour = condition_colour(1e-3 * row["fulcrum_mm"])
        for key, marker, shift in (("heel_strike_error_s", "v", -0.18), ("toe_off_error_s", "^", 0.0),
                                   ("stance_error_s", "s", 0.18)):
            if row[key] is not None:
                axes.plot(place + shift, 1e3 * row[key], marker=marker, markersize=6, color=colour,
                          markerfacecolor=_fill(row, colour))


def _fill(row: Mapping[str, Any], colour: Any) -> Any:
    """Open for what the fit has not seen."""
    return "white" if row["role"] == "held out" else colour


def _handles(table: Mapping[str, Any]) -> list[Artist]:
    rows = table["rows"]
    found: list[Artist] = [
        Line2D([], [], color="0.2", marker="o", linestyle="", markersize=7, label=f"{role} walk",
               markerfacecolor="white" if role == "held out" else "0.2") for role in
        dict.fromkeys(row["role"] for row in rows)]
    if any(row["null_model_grf_rmse_bw"] is not None for row in rows):
        found.append(Line2D([], [], color="0.1", marker="x", linestyle="", label="null model"))
    if any(condition["paper"] for condition in table["conditions"]):
        found.append(Line2D([], [], color=NEUTRAL, linewidth=2.2, alpha=0.7, label="paper, per setting"))
    found.append(Patch(facecolor=NEUTRAL, alpha=0.3, label="paper, range of all"))
    return found + [Line2D([], [], color="0.2", marker=marker, linestyle="", markersize=6, label=name)
                    for marker, name in (("v", "heel strike"), ("^", "toe-off"), ("s", "stance time"))]
