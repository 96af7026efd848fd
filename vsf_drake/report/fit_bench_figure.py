"""The fitted foot in the testing machine beside the measurement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from vsf_drake.report.fit_text import shown
from vsf_drake.report.style import HEEL_COLOUR, MARKERS, condition_colour, label, new_figure, style


@dataclass(frozen=True, kw_only=True)
class _Compared:
    """One quantity, measured and fitted, forefoot (n,) and heel (None where it was not measured), in its unit."""

    name: str
    unit: str
    measured: list[float]
    model: list[float]
    heel_measured: float | None
    heel_model: float | None
    uncertainty: float
    rmse: float


def fit_bench_figure(table: Mapping[str, Any]) -> Figure:
    """Stiffness, and mid-range displacement where it was measured, over the fulcrum's position; `table` is that of a
    judged fit with a bench."""
    bench, found = table["bench"], table["bench"].get("mid_range")
    rows = [_Compared(name="stiffness", unit="N/mm", measured=bench["measured_n_per_mm"], model=bench["model_n_per_mm"],
                      heel_measured=bench["heel_measured_n_per_mm"], heel_model=bench["heel_model_n_per_mm"],
                      uncertainty=bench["uncertainty_n_per_mm"], rmse=bench["rmse_n_per_mm"])]
    if found is not None:
        rows.append(_Compared(
            name="mid-range displacement", unit="mm", measured=found["measured_mm"], model=found["model_mm"],
            heel_measured=found["heel_measured_mm"], heel_model=found["heel_model_mm"],
            uncertainty=found["uncertainty_mm"], rmse=found["rmse_mm"]))
    with style():
        figure = new_figure(7.6, 4.0 * len(rows))
        pairs = figure.subplots(len(rows), 2, width_ratios=(3.0, 1.0), squeeze=False)
        for (left, right), row in zip(pairs, rows, strict=True):
            _forefoot(left, bench, row)
            _heel(right, row)
        figure.draw_without_rendering()
    return figure


def _forefoot(axes: Any, bench: Mapping[str, Any], row: _Compared) -> None:
    x, measured, model = bench["fulcrum_mm"], row.measured, row.model
    falls = measured[-1] < measured[0]
    axes.plot(x, measured, color="0.6", linewidth=2.4, zorder=1)
    axes.plot(x, model, color="0.2", linewidth=1.4, linestyle=(0, (4, 1.6)), zorder=2)
    for i, (position, k, fitted) in enumerate(zip(x, measured, model, strict=True)):
        colour = condition_colour(1e-3 * position)
        axes.errorbar(position, k, yerr=2.0 * row.uncertainty, color=colour, marker="_",
                      markersize=16, markeredgewidth=3.0, capsize=4, linewidth=1.4, zorder=3)
        axes.plot(position, fitted, marker=MARKERS[i % len(MARKERS)], color=colour, markersize=7,
                  markerfacecolor="white", markeredgewidth=1.6, zorder=4)
        axes.annotate(shown(fitted - k, "{:+.2f}"), (position, max(k, fitted)), xytext=(0, 9), ha="center",
                      fontsize=8, textcoords="offset points")
    axes.plot([], [], color="0.6", linewidth=2.4, label="measured, ± 2 standard deviations")
    axes.plot([], [], color="0.2", linewidth=1.4, linestyle=(0, (4, 1.6)), marker="o", markerfacecolor="white",
              label=f"fitted model; number: its difference ({row.unit})")
    axes.set_ylim(0.0, 1.2 * max(*measured, *model))
    axes.margins(x=0.1)
    axes.legend(loc="upper right" if falls else "upper left")
    synthetic = " (SYNTHETIC)" if bench["synthetic"] else ""
    label(axes, x="fulcrum from the keel's posterior end (mm)", y=f"{row.name} ({row.unit})",
          title=f"Forefoot{synthetic}, RMS difference {row.rmse:.2f} {row.unit}")


def _heel(axes: Any, row: _Compared) -> None:
    measured, model = row.heel_measured, row.heel_model
    axes.set_xticks([])
    if measured is None or model is None:
        axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center")
    else:
        axes.errorbar(-0.35, measured, yerr=2.0 * row.uncertainty, color="0.6", marker="_", markersize=22,
                      markeredgewidth=3.0, capsize=4)
        axes.plot(0.35, model, marker="*", color=HEEL_COLOUR, markersize=11, markerfacecolor="white",
                  markeredgewidth=1.4)
        axes.annotate(shown(model - measured, "{:+.2f}"), (0.35, model), xytext=(0, 10), textcoords="offset points",
                      ha="center", fontsize=8)
        axes.set_xlim(-1.0, 1.0)
        axes.set_ylim(0.0, 1.25 * max(measured, model))
    label(axes, x="heel (one position)", y=f"{row.name} ({row.unit})", title="Heel")
