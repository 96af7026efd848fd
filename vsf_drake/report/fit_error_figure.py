"""Errors of a contact fit by trial, beside the null model, the floor and what the paper was left with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from vsf_drake.report.style import NEUTRAL, condition_colour, label, new_figure, style

_PANELS = (("grf_rmse_bw", "RMS error (% body weight)", "Resultant force"),
           ("fore_aft_rmse_bw", "RMS error (% body weight)", "Fore-aft force"),
           ("cop_rmse_fl", "RMS error (% foot length)", "Centre of pressure, fore-aft"))
_BAND = "0.9"


def fit_error_figure(table: Mapping[str, Any]) -> Figure:
    """One panel an error, one row a trial; `table` is that of a fit that was judged."""
    trials = [trial for trial in table["trials"] if trial["metrics"] is not None]
    with style():
        figure = new_figure(11.0, max(2.6, 1.7 + 0.27 * len(trials)))
        panels = figure.subplots(1, 3, sharey=True, width_ratios=(1.5, 1.0, 1.0))
        for axes, (key, x, title) in zip(panels, _PANELS, strict=True):
            _published(axes, table["published"], key)
            for row, trial in enumerate(trials):
                _trial(axes, row, trial, key)
            axes.set_xlim(left=0.0)
            axes.margins(x=0.08)
            axes.xaxis.set_major_locator(MaxNLocator(5))
            label(axes, x=x, y="", title=title)
        panels[0].set_yticks(range(len(trials)), [
            f"{t['label']}, {t['role']}, {t['fulcrum_mm']:g} mm" for t in trials])
        panels[0].set_ylim(len(trials) - 0.4, -0.6)
        panels[0].set_ylabel("trial (one row each)")
        figure.legend(handles=_handles(trials), loc="outside lower center", ncols=3)
        if any(trial["synthetic"] for trial in trials):
            figure.suptitle("SYNTHETIC trials, not recorded", x=0.01, ha="left", fontsize=11)
        figure.draw_without_rendering()
    return figure


def _trial(axes: Axes, row: int, trial: Mapping[str, Any], key: str) -> None:
    value, colour = trial["metrics"][key], condition_colour(1e-3 * trial["fulcrum_mm"])
    if key == "grf_rmse_bw":
        null, floor = trial["null_model_grf_rmse_bw"], trial["floor_grf_rmse_bw"]
        if null is not None:
            axes.plot(100.0 * null, row, marker="D", color=NEUTRAL, markersize=5.5, markerfacecolor="white")
        if floor is not None:
            axes.plot(100.0 * floor, row, marker="|", color="black", markersize=12, markeredgewidth=1.8)
    if value is not None:
        axes.plot([0.0, 100.0 * value], [row, row], color=colour, linewidth=1.2, alpha=0.6)
        axes.plot(100.0 * value, row, marker="o", color=colour, markersize=7,
                  markerfacecolor=colour if trial["role"] == "fitted" else "white", markeredgewidth=1.8)


def _published(axes: Axes, published: Mapping[str, Any], key: str) -> None:
    """Draws what the paper was left with; of the fore-aft force it says nothing."""
    if key == "grf_rmse_bw":
        axes.axvline(100.0 * published["fitted_grf_rmse_bw"], color=NEUTRAL, linewidth=1.0, linestyle=":", zorder=0)
        low, high = published["other_grf_rmse_bw"]
    elif key == "cop_rmse_fl":
        low, high = published["cop_rmse_fl"]
    else:
        return
    axes.axvspan(100.0 * low, 100.0 * high, color=_BAND, linewidth=0.0, zorder=0)


def _handles(trials: Sequence[Mapping[str, Any]]) -> list[Artist]:
    def dot(name: str, **look: Any) -> Line2D:
        return Line2D([], [], linestyle="", label=name, **look)

    handles: list[Artist] = [dot("fitted trial", marker="o", color=NEUTRAL, markersize=7)]
    if any(trial["role"] != "fitted" for trial in trials):
        handles.append(dot("held-out trial", marker="o", color=NEUTRAL, markersize=7, markerfacecolor="white",
                           markeredgewidth=1.8))
    if any(trial["null_model_grf_rmse_bw"] is not None for trial in trials):
        handles.append(dot("null model: another trial's curve", marker="D", color=NEUTRAL, markerfacecolor="white",
                           markersize=5.5))
    if any(trial["floor_grf_rmse_bw"] is not None for trial in trials):
        handles.append(dot("floor: the true foot on this motion", marker="|", color="black", markersize=12,
                           markeredgewidth=1.8))
    return [*handles, Line2D([], [], color=NEUTRAL, linestyle=":", linewidth=1.0, label="paper, fitted trial"),
            Patch(facecolor=_BAND, label="paper, force: other trials; centre of pressure: all")]
