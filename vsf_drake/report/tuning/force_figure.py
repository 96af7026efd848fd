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
_SETTINGS = {"grf_softest": "softest", "grf_optimum": "optimum", "grf_stiffest": "stiffest"}
_DASHES = {"grf_softest": (0, (1, 1)), "grf_optimum": "-", "grf_stiffest": (0, (5, 2))}


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
    """Level 1: the prosthetic foot's force in one trial at the softest, best and stiffest setting, and as recorded."""
    time = np.asarray(arrays["grf_time"])
    at = {"grf_softest": 66.0, "grf_stiffest": 151.0, "grf_optimum": table["fulcrum_mm"]}
    if table["sweep"]:
        ends = sorted(row["fulcrum_mm"] for row in table["sweep"])
        at |= {"grf_softest": ends[0], "grf_stiffest": ends[-1]}
    with style():
        figure = new_figure(10.6, 3.9)
        panels = figure.subplots(1, 2)
        for axes, column, direction in zip(panels, (0, 2), _DIRECTIONS, strict=True):
            if "grf_recorded" in arrays:
                axes.plot(time, np.asarray(arrays["grf_recorded"])[:, column], color="0.45", label="recorded",
                          **MEASURED)
            for key, name in _SETTINGS.items():
                if key in arrays:
                    where = "" if at[key] is None else f", {at[key]:.0f} mm"
                    called = name if table["optimal"] or key != "grf_optimum" else "last iterate"
                    axes.plot(time, np.asarray(arrays[key])[:, column], linewidth=1.5, linestyle=_DASHES[key],
                              color=condition_colour(None if at[key] is None else 1e-3 * at[key]),
                              label=f"{called}{where}")
            label(axes, x="time (s)", y="force (N)", title=f"prosthetic foot, {direction}")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure
