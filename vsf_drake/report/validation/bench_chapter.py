"""The bench chapter of the validation's report: the foot in the testing machine, experiment beside simulation."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.page import Chapter
from vsf_drake.report.style import (
    FULCRUM,
    MARKERS,
    MEASURED,
    NEUTRAL,
    SHADE,
    SIMULATED,
    Arrays,
    colour_of,
    drawing,
    label,
)

if TYPE_CHECKING:
    from vsf_drake.analysis.validation.bench_lines import SettingRow
    from vsf_drake.analysis.validation.bench_section import BenchSectionTable

_MARKERS = {"model": "o", "nominal": "s", "soft_support": "v", "refined": "D", "calibrated": "^"}
_NOMINAL: dict[str, Any] = {"linestyle": (0, (1, 2)), "linewidth": 1.2}
_SLOPE_ABOVE_N = 200.0


def bench_chapter(table: BenchSectionTable, arrays: Arrays) -> Chapter:
    """The chapter; `table` and `arrays` of the saved bench section."""
    points, forefoot = table.load_points, _forefoot(table)
    rates = sorted((row for row in table.rates if row.fulcrum_mm is not None), key=lambda row: row.fulcrum_mm or 0.0)
    speeds = {row.speed_mm_per_min for row in rates}
    ends = {speed: [row for row in rates if row.speed_mm_per_min == speed] for speed in sorted(speeds, reverse=True)}
    offsets = np.abs(_of_line(forefoot, "model", "mid_range_offset_mm"))
    facts = {
        "line_of": {line.key: line for line in table.lines},
        "pressed": [row for row in forefoot if row.lines["model"]],
        "heel": next((row for row in table.settings if row.fulcrum_mm is None), None),
        "worst": forefoot[int(np.nanargmax(offsets))] if np.isfinite(offsets).any() else None,
        "comparison_rows": [*({"of": line.name + more, **vars(own)} for line in table.lines for more, own in (
            ("", line.statistics), (": the settings it did not see", line.held_out)) if own),
            {"of": "paper, its model on its bench", "n": 5, **table.limits}],
        "setting_rows": [{
            **vars(row), "setting": _position(row.fulcrum_mm), "repeats": row.repeats or None,
            **{f"{key}_{name}": value for key, curve in row.lines.items() if curve
               for name, value in vars(curve).items()}} for row in table.settings],
        "chord_shares": [(words, shares) for key, words in (
            ("measured", "measured here"), ("model", f"simulated ({table.lines[0].name})"))
            if (shares := [(row.fulcrum_mm, curve.curvature_share) for row in forefoot if (curve := row.lines[key])])],
        "loops": [(speed, own[0], own[-1]) for speed, own in ends.items() if len(own) > 1],
        "rate_rows": [{**vars(row), "setting": _position(row.fulcrum_mm), "lost_share": 1.0 - row.return_ratio}
                      for row in table.rates],
        "moved_ends": [(own[0], own[-1]) for x in _ends(row.fulcrum_mm for row in points)
                       if (own := [row for row in points if row.fulcrum_mm == x])],
        "beam_off": max((abs(row.closed_form_n_per_mm / row.stiffness_n_per_mm - 1.0) for row in points),
                        default=None)}
    figures = {"bench_curves": _curves_figure(table, arrays), "bench_agreement": bench_agreement_figure(table, arrays)}
    return Chapter(name="bench", title="Bench", template="validation/bench.html.j2", facts={**vars(table), **facts},
                   figures=figures)


def _forefoot(table: BenchSectionTable) -> list[SettingRow]:
    return [row for row in table.settings if row.fulcrum_mm is not None]


def _ends(positions: Iterable[float]) -> list[float]:
    """The least and the largest of them."""
    ordered = sorted(positions)
    return [*ordered[:1], *ordered[-1:]]


def _source(table: BenchSectionTable) -> str:
    return "measured (SYNTHETIC)" if table.measured_synthetic else "measured"


def _simulated(table: BenchSectionTable) -> str:
    return f"simulated: {table.lines[0].name}"


def bench_agreement_figure(table: BenchSectionTable, arrays: Arrays) -> Figure:
    """Stiffness by fulcrum position; with measured curves also by what the simulation misses it and the mid-range
    displacement."""
    judged = table.lines[0].statistics is not None
    with drawing(10.5 if judged else 6.4, 4.3) as figure:
        first, *others = figure.subplots(1, 3, width_ratios=(1.1, 1.0, 1.0)) if judged else [figure.subplots()]
        if judged:
            _errors(others[0], table, "stiffness_n_per_mm", ("stiffness", "N/mm"), "Error of stiffness")
            _errors(others[1], table, "mid_range_mm", ("mid-range displacement", "mm"),
                    "Offset Δ_D of the mid-range displacement")
            if "regression_line" in arrays:
                at, line, low, high = (arrays[f"regression_{key}"] for key in (
                    "measured_n_per_mm", "line", "low", "high"))
                others[0].fill_between(at, low - at, high - at, color="0.5", alpha=0.35, linewidth=0,
                                       label="regression, 95 % band")
                others[0].plot(at, line - at, color="0.1", **SIMULATED)
            for axes in others:
                axes.legend(loc="upper left", fontsize=7.5)
        _stiffness(first, table)
    return figure


def _stiffness(axes: Axes, table: BenchSectionTable) -> None:
    rows = _forefoot(table)
    x, model = [row.fulcrum_mm or 0.0 for row in rows], _of_line(rows, "model", "stiffness_n_per_mm")
    measured, half = (_of_line(rows, "measured", f"stiffness_n_per_mm{more}") for more in ("", "_half_width"))
    if np.isfinite(measured).any():
        axes.plot(x, measured, color=NEUTRAL, label=_source(table), **MEASURED)
    axes.plot(x, model, color=NEUTRAL, label=_simulated(table), **SIMULATED)
    for i, row in enumerate(rows):
        colour, marker = colour_of(x[i]), MARKERS[i % len(MARKERS)]
        if row.published_n_per_mm is not None:
            axes.plot(x[i], row.published_n_per_mm, marker="_", markersize=20, markeredgewidth=3.0, color=colour,
                      alpha=0.6, linestyle="")
        axes.errorbar(x[i], measured[i], yerr=half[i] if np.isfinite(half[i]) else None, color=colour, linestyle="",
                      capsize=4, marker=marker, markersize=6)
        axes.plot(x[i], model[i], marker=marker, color=colour, markersize=10, linestyle="", markerfacecolor="none",
                  markeredgewidth=1.4)
    axes.plot([], [], marker="_", markersize=14, markeredgewidth=3.0, color=NEUTRAL, alpha=0.6, linestyle="",
              label="published end points")
    axes.plot(x, [row.tuned_joints_n_per_mm or np.nan for row in rows], marker="x", color=NEUTRAL, linestyle="",
              label="tuned joints of the authors' model")
    axes.plot(x, _of_line(rows, "soft_support", "stiffness_n_per_mm"), marker="v", markersize=5, color=NEUTRAL,
              linestyle="", markerfacecolor="none", label="laminate on a soft support")
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.1, y=0.12)
    axes.legend(loc="upper left")
    label(axes, x=FULCRUM, y="stiffness above 200 N (N/mm)", title="Stiffness")


def _errors(axes: Axes, table: BenchSectionTable, key: str, quantity: tuple[str, str], title: str) -> None:
    """By what each model misses the measurement, over the measured value; `quantity` in words and its unit."""
    rows, (name, unit) = _forefoot(table), quantity
    limit = table.limits["stiffness_rmse_n_per_mm" if unit == "N/mm" else "mid_range_rmse_mm"]
    axes.axhspan(-limit, limit, color=SHADE, zorder=0, label=f"paper's RMSE, ± {limit:g} {unit}")
    axes.axhline(0.0, color=NEUTRAL, linewidth=0.8)
    measured = _of_line(rows, "measured", key)
    for line in table.lines:
        own = line.key == "model"
        axes.plot(measured, _of_line(rows, line.key, key) - measured, linestyle="", color="0.1",
                  marker=_MARKERS[line.key], markerfacecolor="0.1" if own else "none", markersize=5 if own else 8,
                  label=line.name)
    axes.margins(x=0.08, y=0.4)
    label(axes, x=f"measured {name} ({unit})", y=f"simulated less measured ({unit})", title=title)


def _curves_figure(table: BenchSectionTable, arrays: Arrays) -> Figure:
    """Load over displacement at every setting, experiment beside simulation, after Figure 4 of McGeehan 2021."""
    with drawing(10.5, 5.0) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(2.4, 1.0), sharey=True)
        for i, row in enumerate(table.settings):
            _setting(left if row.fulcrum_mm is not None else right, i, row, table, arrays)
        left.plot([], [], color=NEUTRAL, label=_source(table) if table.measured_name else
                  "published slope, laid through the simulation at 200 N", **MEASURED)
        left.plot([], [], color=NEUTRAL, label=_simulated(table), **SIMULATED)
        if any(line.key == "nominal" for line in table.lines):
            left.plot([], [], color=NEUTRAL, label="simulated: nominal", **_NOMINAL)
        left.legend(loc="lower right", frameon=True, facecolor="white", edgecolor="none", framealpha=1.0)
        for axes, title in ((left, "Forefoot, by position of the fulcrum"), (right, "Heel")):
            axes.axhline(_SLOPE_ABOVE_N, color=NEUTRAL, linewidth=0.8, linestyle=":")
            axes.set_xlim(left=0.0)
            axes.margins(y=0.1)
            axes.set_ylim(bottom=0.0)
            label(axes, x="displacement since touch-down (mm)", y="load (N)", title=title)
    return figure


def _setting(axes: Axes, i: int, row: SettingRow, table: BenchSectionTable, arrays: Arrays) -> None:
    colour, load, half = colour_of(row.fulcrum_mm), arrays["load_n"][i], arrays["measured_half_width_mm"][i]
    measured, model = arrays["measured_mm"][i], arrays["model_mm"][i]
    if np.isfinite(half).any():
        axes.fill_betweenx(load, measured - half, measured + half, color=colour, alpha=0.2, linewidth=0)
    axes.plot(measured, load, color=colour, **MEASURED)
    axes.plot(model, load, color=colour, **SIMULATED)
    if "nominal_mm" in arrays:
        axes.plot(arrays["nominal_mm"][i], load, color=colour, **_NOMINAL)
    if table.measured_name is None and row.published_n_per_mm is not None and np.isfinite(model).all():
        above = load[load >= _SLOPE_ABOVE_N]
        start = float(np.interp(_SLOPE_ABOVE_N, load, model))
        axes.plot(start + (above - _SLOPE_ABOVE_N) / row.published_n_per_mm, above, color=colour, **MEASURED)
    ends = [curve[-1] for curve in (model, measured) if np.isfinite(curve[-1])]
    if ends:
        _tag(axes, row.fulcrum_mm, (ends[0], load[-1]), xytext=(0, 5), ha="center")


def _position(fulcrum_mm: float | None) -> str:
    """A position in a table and beside a curve."""
    return "heel" if fulcrum_mm is None else f"{fulcrum_mm:g} mm"


def _of_line(rows: Iterable[SettingRow], line: str, key: str) -> np.ndarray:
    """A value of the measured curves, or of a model, by setting; NaN where it is missing: gaps in a figure."""
    return np.array([getattr(row.lines.get(line), key, None) for row in rows], dtype=float)


def _tag(axes: Axes, fulcrum_mm: float | None, at: tuple[float, float], **options: Any) -> None:
    """Names a position beside its curve."""
    axes.annotate(_position(fulcrum_mm), at, fontsize=8, textcoords="offset points", color=colour_of(fulcrum_mm),
                  fontweight="bold", annotation_clip=False, **options)
