"""One trial of a contact fit: force and centre of pressure, measured and of the fitted model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from vsf_drake.report.style import MEASURED, NEUTRAL, SIMULATED, condition_colour, label, new_figure, style


def fit_trial_figure(trial: Mapping[str, Any], curves: Mapping[str, np.ndarray]) -> Figure:
    """Resultant and fore-aft force over time, and the centre of pressure over the first stance.

    Args:
        trial: a row of the fit's table, with its metrics.
        curves: time_s (n,), measured_bw and model_bw (n, 3), cop_measured_fl and cop_model_fl (101,).
    """
    metrics, colour = trial["metrics"], condition_colour(1e-3 * trial["fulcrum_mm"])
    measured, model = curves["measured_bw"], curves["model_bw"]
    forces = (
        ("Resultant", *(np.linalg.norm(force, axis=1) for force in (measured, model)), metrics["grf_rmse_bw"]),
        ("Fore-aft", measured[:, 0], model[:, 0], metrics["fore_aft_rmse_bw"]))
    with style():
        figure = new_figure(11.0, 3.1)
        panels = figure.subplots(1, 3)
        for axes, (name, recorded, simulated, error) in zip(panels, forces, strict=False):
            axes.axhline(0.0, color="0.7", linewidth=0.8)
            axes.plot(curves["time_s"], recorded, color=colour, **MEASURED)
            axes.plot(curves["time_s"], simulated, color=colour, **SIMULATED)
            axes.set_xlim(_scored(metrics, curves["time_s"]))
            label(axes, x="time (s)", y=f"{'forward ' if name == 'Fore-aft' else ''}force (body weights)",
                  title=f"{name}{_error(error, 'BW')}")
        _centre_of_pressure(panels[-1], curves, metrics, colour)
        plate = "reference (synthetic)" if trial["synthetic"] else "force plate"
        name = "fitted model (off: root mean square; FL: foot length)"
        figure.legend(handles=[Line2D([], [], color=colour, label=plate, **MEASURED),
                               Line2D([], [], color=colour, label=name, **SIMULATED)],
                      loc="outside lower center", ncols=2)
        kind = ", SYNTHETIC" if trial["synthetic"] else ""
        figure.suptitle(f"{trial['label']}: {trial['role']}, fulcrum {trial['fulcrum_mm']:g} mm{kind}", x=0.01,
                        ha="left", fontsize=11)
        figure.set_layout_engine("constrained", w_pad=0.08)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # there are many of these, and to lay them out takes as long as to draw them
    return figure


def _centre_of_pressure(
    axes: Axes, curves: Mapping[str, np.ndarray], metrics: Mapping[str, Any], colour: Any
) -> None:
    measured, model = curves["cop_measured_fl"], curves["cop_model_fl"]
    percent = np.linspace(0.0, 100.0, len(measured))
    both = np.isfinite(measured) & np.isfinite(model)
    if both.any():
        origin = np.nanmin(measured)
        axes.plot(percent, 100.0 * (measured - origin), color=colour, **MEASURED)
        axes.plot(percent, 100.0 * (model - origin), color=colour, **SIMULATED)
    else:
        axes.text(0.5, 0.5, "no centre of pressure\nin common", transform=axes.transAxes, ha="center", va="center",
                  color=NEUTRAL)
    axes.set_xlim(0.0, 100.0)
    label(axes, x="stance (%)", y="ahead of its rearmost (% FL)",
          title="Centre of pressure" + _error(metrics["cop_rmse_fl"], "FL"))


def _scored(metrics: Mapping[str, Any], time_s: np.ndarray) -> tuple[float, float]:
    windows = metrics["scored_window_s"]
    return (windows[0][0], windows[-1][1]) if windows else (float(time_s[0]), float(time_s[-1]))


def _error(value: float | None, unit: str) -> str:
    return "" if value is None else f": {100.0 * value:.1f} % {unit} off"
