"""Ground reaction forces at the optimum: against the recorded ones, and simulated again with the full keel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vsf_drake.report.style import MEASURED, condition_colour, label, new_figure, style
from vsf_drake.report.tuning.cost_curve_figure import mark_origin

FEET = {"prosthetic": "prosthetic foot", "intact": "intact foot"}
_LINES: dict[str, tuple[str, dict[str, Any]]] = {
    "_recorded": ("recorded", {"color": "0.45", **MEASURED}),
    "": ("optimised", {"color": "black", "linewidth": 1.5}),
    "_resimulated_prescribed": ("simulated again, motion prescribed",
                                {"color": "#1f6f8b", "linewidth": 1.4, "linestyle": (0, (4, 1.6))}),
    "_resimulated_feedback": ("simulated again, torques and feedback",
                              {"color": "#b35900", "linewidth": 1.4, "linestyle": (0, (1, 1))})}
_DIRECTIONS = ("fore-aft", "vertical")
SETTINGS = ("softest", "optimum", "stiffest")
_DASHES = {"softest": (0, (1, 1)), "optimum": "-", "stiffest": (0, (5, 2))}
_ROWS = 3
"""Most trials that are drawn."""


def stride_force_figure(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Figure:
    """Level 2: forces of both feet over the gait cycle, as far as `arrays` has them."""
    feet = [foot for foot in FEET if f"grf_{foot}" in arrays]
    phase = 100.0 * np.asarray(arrays["phase"])
    with style():
        figure = new_figure(10.6, 0.7 + 2.6 * len(feet))
        panels = figure.subplots(len(feet), 2, sharex=True, squeeze=False)
        for row, foot in zip(panels, feet, strict=True):
            for axes, column, direction in zip(row, range(2), _DIRECTIONS, strict=True):
                for suffix, (name, look) in _LINES.items():
                    known = arrays.get(f"grf_{foot}{suffix}")
                    if known is not None:
                        axes.plot(phase, np.asarray(known)[:, column], label=name, **look)
                label(axes, x="gait cycle (%)", y="force (N)", title=f"{FEET[foot]}, {direction}")
        figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure


def stance_force_figure(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Figure:
    """Level 1: the prosthetic foot's force in up to three trials, at three settings and on the plate."""
    shown = drawn_trials(arrays)[:_ROWS]
    at = dict(zip(SETTINGS, (_end(table, min), table["fulcrum_mm"], _end(table, max)), strict=True))
    with style():
        figure = new_figure(10.6, 0.9 + 2.7 * len(shown))
        for row, i in zip(figure.subplots(len(shown), 2, squeeze=False), shown, strict=True):
            trial = table["trials"][i] if i < len(table["trials"]) else f"trial {i + 1}"
            for axes, column, direction in zip(row, (0, 2), _DIRECTIONS, strict=True):
                measured = plate_of(arrays, i)
                if measured is not None:
                    axes.plot(measured[0], measured[1][:, column], color="0.45", label="plate", **MEASURED)
                for name in SETTINGS:
                    if f"{i}_{name}_grf_W" not in arrays:
                        continue
                    where = "" if at[name] is None else f", {at[name]:.0f} mm"
                    called = name if table["optimal"] or name != "optimum" else "last iterate"
                    axes.plot(arrays[f"{i}_{name}_time_s"], np.asarray(arrays[f"{i}_{name}_grf_W"])[:, column],
                              linewidth=1.4, linestyle=_DASHES[name], label=f"{called}{where}",
                              color=condition_colour(None if at[name] is None else 1e-3 * at[name]))
                label(axes, x="time (s)", y="force (N)", title=f"{trial}: prosthetic foot, {direction}")
                axes.title.set_parse_math(False)
        figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure


def drawn_trials(arrays: Mapping[str, Any]) -> list[int]:
    """Numbers of the trials of a level 1 tuning whose forces there are."""
    numbers = {int(name.partition("_")[0]) for name in arrays if name.endswith("_grf_W") and name[0].isdigit()}
    return sorted(i for i in numbers if any(f"{i}_{name}_grf_W" in arrays for name in SETTINGS))


def plate_of(arrays: Mapping[str, Any], i: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Time (n,) and force (n, 3) of the plate of trial i, where there is one on the time of a walk."""
    force = arrays.get(f"{i}_plate_grf_W")
    for name in ("recorded", *SETTINGS):
        time = arrays.get(f"{i}_{name}_time_s")
        if force is not None and time is not None and len(time) == len(force):
            return np.asarray(time), np.asarray(force)
    return None


def _end(table: Mapping[str, Any], which: Any) -> float | None:
    return which((row["fulcrum_mm"] for row in table["sweep"]), default=None)
