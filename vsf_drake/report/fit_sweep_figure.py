"""The fulcrum sweep of a contact fit: the error of every trial over the fulcrum's position."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from vsf_drake.report.style import MARKERS, NEUTRAL, condition_colour, label, log_scale, new_figure, style

_ACROSS = 3


def fit_sweep_figure(table: Mapping[str, Any]) -> Figure:
    """One panel a true position of the fulcrum; `table` is that of a fit with sweeps."""
    swept = [trial for trial in table["trials"] if trial["sweep"] is not None]
    settings = sorted({trial["fulcrum_mm"] for trial in swept})
    across = min(_ACROSS, len(settings))
    down = -(-len(settings) // across)
    with style():
        figure = new_figure(11.0 if across > 1 else 6.5, 0.5 + 3.3 * down)
        panels = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False).ravel()
        for axes, setting in zip(panels, settings, strict=False):
            colour = condition_colour(1e-3 * setting)
            axes.axvline(setting, color=NEUTRAL, linewidth=6.0, alpha=0.35, zorder=0)
            own = [trial for trial in swept if trial["fulcrum_mm"] == setting]
            for i, trial in enumerate(own):
                _curve(axes, trial, colour, MARKERS[i % len(MARKERS)])
            axes.legend(loc="best", frameon=True, facecolor="white", edgecolor="none", framealpha=0.8)
            label(axes, x="fulcrum from the keel's end (mm)", y="resultant, RMS error (% BW)",
                  title=f"Trials at {setting:g} mm")
        log_scale(panels[0].yaxis)
        panels[0].yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        panels[0].yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
        panels[0].yaxis.set_minor_formatter(NullFormatter())
        for axes in panels[len(settings):]:
            axes.set_axis_off()
        handles = [Line2D([], [], color=NEUTRAL, linewidth=6.0, alpha=0.35, label="where it stood"),
                   Line2D([], [], color="white", marker="*", markersize=12, linestyle="", markeredgecolor="black",
                          markeredgewidth=1.3, label="least error"),
                   *(Line2D([], [], color="black", marker="o", markersize=4.5, label=f"{role} trial",
                            markerfacecolor="black" if role == "fitted" else "white")
                     for role in dict.fromkeys(trial["role"] for trial in swept))]
        if any(None in trial["sweep"]["grf_rmse_bw"] for trial in swept):
            handles.append(Line2D([], [], color="black", marker="x", linestyle="", label="the walk failed"))
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
        if any(trial["synthetic"] for trial in swept):
            figure.suptitle("SYNTHETIC trials, not recorded", x=0.01, ha="left", fontsize=11)
        figure.draw_without_rendering()
    return figure


def _curve(axes: Any, trial: Mapping[str, Any], colour: Any, marker: str) -> None:
    sweep = trial["sweep"]
    positions = np.array(sweep["fulcrum_mm"])
    errors = 100.0 * np.array([np.nan if e is None else e for e in sweep["grf_rmse_bw"]])
    verdict = "not known" if sweep["right"] is None else "right" if sweep["right"] else "WRONG"
    name = f"{trial['label']}: {verdict}"
    axes.plot(positions, errors, color=colour, linewidth=1.2, marker=marker, markersize=4.5, markevery=2,
              markerfacecolor=colour if trial["role"] == "fitted" else "white", label=f" {name}")
    known = np.isfinite(errors)
    if sweep["best_mm"] is not None and known.any():
        axes.plot(sweep["best_mm"], errors[known].min(), marker="*", markersize=12, color="white",
                  markeredgecolor=colour, markeredgewidth=1.3, zorder=5)
    for position in positions[~known]:
        axes.plot(position, 0.02, marker="x", color=colour, transform=axes.get_xaxis_transform(), clip_on=False)
