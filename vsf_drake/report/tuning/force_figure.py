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
    """Level 1: the prosthetic foot's force in up to three trials, at three settings and as recorded."""
    shown = drawn_trials(table, arrays)
    at = dict(zip(SETTINGS, (_end(table, min), table["fulcrum_mm"], _end(table, max)), strict=True))
    with style():
        figure = new_figure(10.6, 0.9 + 2.7 * len(shown))
        panels = figure.subplots(len(shown), 2, squeeze=False)
        for row, (trial, prefix) in zip(panels, shown.items(), strict=True):
            for axes, column, direction in zip(row, (0, 2), _DIRECTIONS, strict=True):
                for name in ("recorded", *SETTINGS):
                    if f"{prefix}{name}" in arrays:
                        axes.plot(arrays[f"{prefix}time"], np.asarray(arrays[f"{prefix}{name}"])[:, column],
                                  **_look(name, at.get(name), optimal=table["optimal"]))
                label(axes, x="time (s)", y="force (N)", title=f"{trial + ': ' if trial else ''}{direction}")
        figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure


def drawn_trials(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> dict[str, str]:
    """Up to three trials of a level 1 tuning whose forces there are: what their arrays begin with, by label.

    One without a label where the arrays do not tell trials apart.
    """
    found = {str(name): f"trial_{i}_" for i, name in enumerate(table["trials"])}
    found = {name: prefix for name, prefix in found.items() if _known(arrays, prefix)}
    if not found:
        return {"": "grf_"} if _known(arrays, "grf_") else {}
    names = list(found)
    return {name: found[name] for name in dict.fromkeys((names[0], names[len(names) // 2], names[-1]))}


def _known(arrays: Mapping[str, Any], prefix: str) -> bool:
    return f"{prefix}time" in arrays and any(f"{prefix}{name}" in arrays for name in SETTINGS)


def _look(name: str, mm: float | None, *, optimal: bool) -> dict[str, Any]:
    if name == "recorded":
        return {"color": "0.45", "label": "recorded", **MEASURED}
    called = name if optimal or name != "optimum" else "last iterate"
    return {"color": condition_colour(None if mm is None else 1e-3 * mm), "linestyle": _DASHES[name], "linewidth": 1.4,
            "label": called if mm is None else f"{called}, {mm:.0f} mm"}


def _end(table: Mapping[str, Any], which: Any) -> float | None:
    return which((row["fulcrum_mm"] for row in table["sweep"]), default=None)
