"""The fitted foot in the testing machine beside the measurement."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure

from vsf_drake.report.fit_text import shown
from vsf_drake.report.style import HEEL_COLOUR, MARKERS, condition_colour, label, new_figure, style


def fit_bench_figure(table: Mapping[str, Any]) -> Figure:
    """Stiffness over the fulcrum's position; `table` is that of a judged fit with a bench."""
    bench = table["bench"]
    x, measured, model = bench["fulcrum_mm"], bench["measured_n_per_mm"], bench["model_n_per_mm"]
    with style():
        figure = new_figure(7.6, 4.0)
        left, right = figure.subplots(1, 2, width_ratios=(3.0, 1.0))
        left.plot(x, measured, color="0.6", linewidth=2.4, zorder=1)
        left.plot(x, model, color="0.2", linewidth=1.4, linestyle=(0, (4, 1.6)), zorder=2)
        for i, (position, k, fitted) in enumerate(zip(x, measured, model, strict=True)):
            colour = condition_colour(1e-3 * position)
            left.errorbar(position, k, yerr=2.0 * bench["uncertainty_n_per_mm"], color=colour, marker="_",
                          markersize=16, markeredgewidth=3.0, capsize=4, linewidth=1.4, zorder=3)
            left.plot(position, fitted, marker=MARKERS[i % len(MARKERS)], color=colour, markersize=7,
                      markerfacecolor="white", markeredgewidth=1.6, zorder=4)
            left.annotate(shown(fitted - k, "{:+.2f}"), (position, max(k, fitted)), xytext=(0, 9), ha="center",
                          fontsize=8, textcoords="offset points")
        left.plot([], [], color="0.6", linewidth=2.4, label="measured, ± 2 standard deviations")
        left.plot([], [], color="0.2", linewidth=1.4, linestyle=(0, (4, 1.6)), marker="o", markerfacecolor="white",
                  label="fitted model; number: its difference (N/mm)")
        left.set_ylim(0.0, 1.2 * max(*measured, *model))
        left.margins(x=0.1)
        left.legend(loc="upper left")
        synthetic = " (SYNTHETIC)" if bench["synthetic"] else ""
        label(left, x="fulcrum from the keel's posterior end (mm)", y="stiffness (N/mm)",
              title=f"Forefoot{synthetic}, RMS difference {bench['rmse_n_per_mm']:.2f} N/mm")
        _heel(right, bench)
        figure.draw_without_rendering()
    return figure


def _heel(axes: Any, bench: Mapping[str, Any]) -> None:
    measured, model = bench["heel_measured_n_per_mm"], bench["heel_model_n_per_mm"]
    axes.set_xticks([])
    if measured is None:
        axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center")
    else:
        axes.errorbar(-0.35, measured, yerr=2.0 * bench["uncertainty_n_per_mm"], color="0.6", marker="_", markersize=22,
                      markeredgewidth=3.0, capsize=4)
        axes.plot(0.35, model, marker="*", color=HEEL_COLOUR, markersize=11, markerfacecolor="white",
                  markeredgewidth=1.4)
        axes.annotate(shown(model - measured, "{:+.2f}"), (0.35, model), xytext=(0, 10), textcoords="offset points",
                      ha="center", fontsize=8)
        axes.set_xlim(-1.0, 1.0)
        axes.set_ylim(0.0, 1.25 * max(measured, model))
    label(axes, x="heel (one position)", y="stiffness (N/mm)", title="Heel")
