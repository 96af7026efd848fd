"""The bench chapter of the validation's report: the foot in the testing machine, experiment beside simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from vsf_drake.report.page import Chapter
from vsf_drake.report.style import (
    MARKERS,
    MEASURED,
    NEUTRAL,
    SHADE,
    SIMULATED,
    condition_colour,
    drawing,
    label,
    log_scale,
    new_figure,
    style,
)

_LINE_MARKERS = {"model": "o", "nominal": "s", "refined": "D", "calibrated": "^"}
_LINE_GREYS = {"measured": "0.55", "model": "0.1", "nominal": "0.78", "refined": "0.38", "calibrated": "0.95"}
_DOTTED: dict[str, Any] = {"linestyle": (0, (1, 1.2)), "linewidth": 1.3}
_NOMINAL: dict[str, Any] = {"linestyle": (0, (1, 2)), "linewidth": 1.2}
Row = Mapping[str, Any]


def bench_chapter(table: Row, arrays: Mapping[str, Any]) -> Chapter:
    """The chapter; `table` and `arrays` of the saved bench section."""
    lines, points, forefoot = table["lines"], table["load_points"], _forefoot(table)
    comparison = [{"of": line["name"] + (": the settings it did not see" if key == "held_out" else ""), **line[key]}
                  for line in lines for key in ("statistics", "held_out") if line.get(key)]
    names = {"measured": "measured"} | {line["key"]: line["name"] for line in lines}
    passes = sorted((row for row in table["rates"] if row["fulcrum_mm"] is not None),
                    key=lambda row: (row["fulcrum_mm"], row["speed_mm_per_min"]))
    slowest = {row["fulcrum_mm"]: row for row in reversed(passes)}
    softest, stiffest = (slowest[min(slowest)], slowest[max(slowest)]) if len(slowest) > 1 else (None, None)
    at = {(row["fulcrum_mm"], row["speed_mm_per_min"]): row for row in passes}
    low, high = min(table["rate_speeds_mm_per_min"]), max(table["rate_speeds_mm_per_min"])
    change = None
    if softest and all((softest["fulcrum_mm"], speed) in at for speed in (low, high)):
        change = (at[softest["fulcrum_mm"], high]["stiffness_n_per_mm"]
                  - at[softest["fulcrum_mm"], low]["stiffness_n_per_mm"])
    by_fulcrum = {x: [row for row in points if row["fulcrum_mm"] == x] for x in sorted(
        {row["fulcrum_mm"] for row in points})}
    facts = {
        "line_of": {line["key"]: line for line in lines},
        "pressed": [row for row in forefoot if row["model"]],
        "heel": next((row for row in table["settings"] if row["fulcrum_mm"] is None), None),
        "worst": max((row for row in forefoot if _value(row, "model", "mid_range_offset_mm") is not None),
                     key=lambda row: abs(row["model"]["mid_range_offset_mm"]), default=None),
        "comparison_rows": [*comparison, {"of": "paper, its model on its bench", "n": 5, **table["limits"]}],
        "setting_rows": _setting_rows(table), "setting_columns": _setting_columns(table),
        "shape_rows": [{"setting": _position(row["fulcrum_mm"]), "of": name, **row[key]["shape"]}
                       for row in table["settings"] for key, name in names.items() if _value(row, key, "shape")],
        "chord_shares": [(name, shares) for key, name in (
            ("measured", "measured here"), ("model", f"simulated ({lines[0]['name']})"))
            if (shares := [(row["fulcrum_mm"], share) for row in forefoot
                           if (share := _value(row, key, "shape", "curvature_share")) is not None])],
        "softest": softest, "stiffest": stiffest, "stiffening_n_per_mm": change,
        "returned": {(x, speed): _value(at, (x, speed), "return_ratio") for x in slowest for speed in (low, high)},
        "rate_rows": [row | {"setting": _position(row["fulcrum_mm"]), "lost_share": 1.0 - row["return_ratio"]}
                      for row in table["rates"]],
        "moved_ends": [(by_fulcrum[x][0], by_fulcrum[x][-1]) for x in (min(by_fulcrum), max(by_fulcrum))]
        if points else [],
        "beam_off": max((abs(row["closed_form_n_per_mm"] / row["stiffness_n_per_mm"] - 1.0) for row in points),
                        default=None)}
    figures = {"bench_curves": _curves_figure(table, arrays), "bench_agreement": bench_agreement_figure(table, arrays),
               "bench_shape": _shape_figure(table, arrays)}
    if table["rates"]:
        figures["bench_energy"] = _energy_figure(table, arrays)
    if points:
        figures["bench_load_point"] = _load_point_figure(table)
    return Chapter(name="bench", title="Bench", template="validation/bench.html.j2", facts={**table, **facts},
                   figures=figures)


def _setting_columns(table: Row) -> list[tuple[str, ...]]:
    columns: list[tuple[str, ...]] = [("setting", "fulcrum"), ("max_load_n", "up to (N)", "{:.0f}"),
                                      ("published_n_per_mm", "published stiffness (N/mm)", "{:.1f}")]
    if table["measured"]:
        columns += [("repeats", "passes", "{:.0f}"), ("measured_n_per_mm", "measured stiffness (N/mm)", "{:.2f}"),
                    ("measured_half_width_n_per_mm", "± 95 % (N/mm)", "{:.2f}"),
                    ("measured_mid_range_mm", "measured mid-range displacement (mm)", "{:.2f}"),
                    ("measured_mid_range_half_width_mm", "± 95 % (mm)", "{:.2f}")]
    for line in table["lines"]:
        key, name = line["key"], line["name"]
        columns.append((f"{key}_n_per_mm", f"{name}: stiffness (N/mm)", "{:.2f}"))
        columns += [(f"{key}_offset_mm", f"{name}: offset Δ_D (mm)", "{:+.2f}"),
                    (f"{key}_curve_rmse_mm", f"{name}: curve RMSE (mm)", "{:.2f}")] if table["measured"] else [
                        (f"{key}_mid_range_mm", f"{name}: mid-range displacement (mm)", "{:.2f}")]
    return columns


def _setting_rows(table: Row) -> list[dict[str, Any]]:
    return [{
        "setting": _position(row["fulcrum_mm"]), "max_load_n": row["max_load_n"],
        "published_n_per_mm": row["published_n_per_mm"], "repeats": row["repeats"] or None,
        "measured_half_width_n_per_mm": _value(row, "measured", "stiffness_n_per_mm_half_width"),
        "measured_mid_range_half_width_mm": _value(row, "measured", "mid_range_mm_half_width"),
        **{f"{key}_{name}": _value(row, key, of) for key in ("measured", *(line["key"] for line in table["lines"]))
           for name, of in (("n_per_mm", "stiffness_n_per_mm"), ("offset_mm", "mid_range_offset_mm"),
                            ("mid_range_mm", "mid_range_mm"), ("curve_rmse_mm", "curve_rmse_mm"))}}
        for row in table["settings"]]


def _metres(fulcrum_mm: float | None) -> float | None:
    """The position as the style's colours want it."""
    return None if fulcrum_mm is None else 1e-3 * fulcrum_mm


def _position(fulcrum_mm: float | None) -> str:
    return "heel" if fulcrum_mm is None else f"{fulcrum_mm:g} mm"


def _value(row: Any, *keys: Any) -> Any:
    """A value of a nested row; None where any part is missing."""
    for key in keys:
        if not isinstance(row, Mapping) or row.get(key) is None:
            return None
        row = row[key]
    return row


def _numbers(rows: Sequence[Row], *keys: str) -> list[float]:
    """The same over rows, NaN where it is missing: gaps in a figure."""
    return [float("nan") if (found := _value(row, *keys)) is None else float(found) for row in rows]


def _forefoot(table: Row) -> list[Row]:
    return [row for row in table["settings"] if row["fulcrum_mm"] is not None]


def _source(table: Row) -> str:
    return "measured (SYNTHETIC)" if table["measured_synthetic"] else "measured"


# Stiffness by fulcrum position, and by what the simulation misses it and the mid-range displacement.


def bench_agreement_figure(table: Row, arrays: Mapping[str, Any]) -> Figure:
    """The figure: three panels with measured curves, the first alone without."""
    with style():
        if table["n"]:
            figure = new_figure(10.5, 4.3)
            first, second, third = figure.subplots(1, 3, width_ratios=(1.1, 1.0, 1.0))
            _errors(second, table, arrays)
            _offsets(third, table)
        else:
            figure = new_figure(6.4, 4.3)
            first = figure.subplots()
        _stiffness(first, table)
        figure.draw_without_rendering()
    return figure


def _stiffness(axes: Axes, table: Row) -> None:
    rows = _forefoot(table)
    x, measured, model = _numbers(rows, "fulcrum_mm"), *(
        _numbers(rows, key, "stiffness_n_per_mm") for key in ("measured", "model"))
    if np.isfinite(measured).any():
        axes.plot(x, measured, color=NEUTRAL, label=_source(table), **MEASURED)
    axes.plot(x, model, color=NEUTRAL, label=f"simulated: {table['lines'][0]['name']}", **SIMULATED)
    for i, row in enumerate(rows):
        colour = condition_colour(1e-3 * x[i])
        if row["published_n_per_mm"] is not None:
            axes.plot(x[i], row["published_n_per_mm"], marker="_", markersize=20, markeredgewidth=3.0, color=colour,
                      alpha=0.6, linestyle="")
        half = _numbers([row], "measured", "stiffness_n_per_mm_half_width")[0]
        axes.errorbar(x[i], measured[i], yerr=half if np.isfinite(half) else None, color=colour, linestyle="",
                      capsize=4, marker=MARKERS[i % len(MARKERS)], markersize=6)
        axes.plot(x[i], model[i], marker=MARKERS[i % len(MARKERS)], color=colour, markersize=10, linestyle="",
                  markerfacecolor="none", markeredgewidth=1.4)
    axes.plot([], [], marker="_", markersize=14, markeredgewidth=3.0, color=NEUTRAL, alpha=0.6, linestyle="",
              label="published end points")
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.1, y=0.12)
    axes.legend(loc="upper left")
    label(axes, x="fulcrum from the keel's posterior end (mm)", y="stiffness above 200 N (N/mm)", title="Stiffness")


def _errors(axes: Axes, table: Row, arrays: Mapping[str, Any]) -> None:
    rows, limit = _forefoot(table), table["limits"]["stiffness_rmse_n_per_mm"]
    measured = _numbers(rows, "measured", "stiffness_n_per_mm")
    axes.axhspan(-limit, limit, color=SHADE, zorder=0, label=f"paper's RMSE, ± {limit:g} N/mm")
    axes.axhline(0.0, color=NEUTRAL, linewidth=0.8)
    if table["regression"] is not None:
        at, line, low, high = (np.asarray(arrays[f"regression_{key}"], dtype=float)
                               for key in ("measured_n_per_mm", "line", "low", "high"))
        axes.fill_between(at, low - at, high - at, color="0.5", alpha=0.35, linewidth=0,
                          label=f"regression, 95 % band (n = {table['regression']['n']})")
        axes.plot(at, line - at, color="0.1", **SIMULATED)
    for line in table["lines"]:
        axes.plot(measured, _numbers(rows, line["key"], "stiffness_error_n_per_mm"), linestyle="", color="0.1",
                  marker=_LINE_MARKERS[line["key"]], markerfacecolor="0.1" if line["key"] == "model" else "none",
                  markersize=5 if line["key"] == "model" else 8, label=line["name"])
    axes.set_ylim(-1.9 * limit, 2.6 * limit)
    axes.margins(x=0.08)
    axes.legend(loc="upper left", fontsize=7.5)
    label(axes, x="measured stiffness (N/mm)", y="simulated less measured (N/mm)", title="Error of stiffness")


def _offsets(axes: Axes, table: Row) -> None:
    rows, limit = _forefoot(table), table["limits"]["mid_range_rmse_mm"]
    places, lines = np.arange(len(rows)), table["lines"]
    axes.axhspan(-limit, limit, color=SHADE, zorder=0, label=f"paper's RMSE, ± {limit:g} mm")
    axes.axhline(0.0, color=NEUTRAL, linewidth=0.8)
    width = 0.8 / len(lines)
    for j, line in enumerate(lines):
        offset = _numbers(rows, line["key"], "mid_range_offset_mm")
        axes.bar(places + (j - 0.5 * (len(lines) - 1)) * width, offset, width, color=_LINE_GREYS[line["key"]],
                 edgecolor="0.1", linewidth=0.6, label=line["name"])
    axes.set_xticks(places, [f"{row['fulcrum_mm']:g}" for row in rows])
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.45 * (high - low))
    axes.legend(loc="upper left", fontsize=7.5)
    label(axes, x="fulcrum from the keel's posterior end (mm)", y="simulated less measured (mm)",
          title="Offset Δ_D of the mid-range displacement")


# Load over displacement at every setting, experiment beside simulation, after Figure 4 of McGeehan 2021.


_SLOPE_ABOVE_N = 200.0


def _curves_figure(table: Row, arrays: Mapping[str, Any]) -> Figure:
    """The figure: forefoot on the left, heel on the right; `table` and `arrays` of the bench section."""
    with drawing(10.5, 5.0) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(2.4, 1.0), sharey=True)
        for i, row in enumerate(table["settings"]):
            _setting(left if row["fulcrum_mm"] is not None else right, i, row, table, arrays)
        if table["measured"]:
            left.plot([], [], color=NEUTRAL, label=_source(table), **MEASURED)
        else:
            left.plot([], [], color=NEUTRAL, label="published slope, laid through the simulation at 200 N", **MEASURED)
        left.plot([], [], color=NEUTRAL, label=f"simulated: {table['lines'][0]['name']}", **SIMULATED)
        if any(line["key"] == "nominal" for line in table["lines"]):
            left.plot([], [], color=NEUTRAL, label="simulated: nominal", **_NOMINAL)
        left.legend(loc="lower right", frameon=True, facecolor="white", edgecolor="none", framealpha=1.0)
        for axes in (left, right):
            axes.axhline(_SLOPE_ABOVE_N, color=NEUTRAL, linewidth=0.8, linestyle=":")
            axes.set_xlim(left=0.0)
            axes.margins(y=0.1)
            axes.set_ylim(bottom=0.0)
        label(left, x="displacement since touch-down (mm)", y="load (N)", title="Forefoot, by position of the fulcrum")
        label(right, x="displacement since touch-down (mm)", y="load (N)", title="Heel")
    return figure


def _setting(
    axes: Axes, i: int, row: Row, table: Row, arrays: Mapping[str, Any]
) -> None:
    colour = condition_colour(_metres(row["fulcrum_mm"]))
    load = np.asarray(arrays["load_n"], dtype=float)[i]
    curves = {key: np.asarray(arrays[f"{key}_mm"], dtype=float)[i] for key in ("measured", "model", "nominal")
              if f"{key}_mm" in arrays}
    half = np.asarray(arrays["measured_half_width_mm"], dtype=float)[i]
    if np.isfinite(half).any():
        axes.fill_betweenx(load, curves["measured"] - half, curves["measured"] + half, color=colour, alpha=0.2,
                           linewidth=0)
    axes.plot(curves["measured"], load, color=colour, **MEASURED)
    axes.plot(curves["model"], load, color=colour, **SIMULATED)
    if "nominal" in curves:
        axes.plot(curves["nominal"], load, color=colour, **_NOMINAL)
    if not table["measured"] and row["published_n_per_mm"] is not None and np.isfinite(curves["model"]).all():
        above = load >= _SLOPE_ABOVE_N
        start = float(np.interp(_SLOPE_ABOVE_N, load, curves["model"]))
        axes.plot(start + (load[above] - _SLOPE_ABOVE_N) / row["published_n_per_mm"], load[above], color=colour,
                  **MEASURED)
    shown = next((curve for curve in (curves["model"], curves["measured"]) if np.isfinite(curve[-1])), None)
    if shown is not None:
        axes.annotate(_position(row["fulcrum_mm"]), (shown[-1], load[-1]), xytext=(0, 5), ha="center", fontsize=8,
                      textcoords="offset points", color=colour, fontweight="bold", annotation_clip=False)


# Loading and unloading: the loop at the highest speed, what is lost by speed, and what is stored by position.


def _energy_figure(table: Row, arrays: Mapping[str, Any]) -> Figure:
    """The figure: loops, loss over speed, stored energy by setting; `table` and `arrays` of the bench section."""
    with drawing(10.5, 4.2) as figure:
        first, second, third = figure.subplots(1, 3, width_ratios=(1.15, 1.0, 1.0))
        _loops(first, table, arrays)
        _losses(second, table)
        _stored(third, table)
    return figure


def _loops(axes: Axes, table: Row, arrays: Mapping[str, Any]) -> None:
    x, load = (np.asarray(arrays[key], dtype=float) for key in ("loop_mm", "loop_n"))
    for i, fulcrum in enumerate(table["rate_settings_mm"]):
        colour = condition_colour(_metres(fulcrum))
        axes.fill(np.concatenate(x[i]), np.concatenate(load[i]), color=colour, alpha=0.18, linewidth=0)
        axes.plot(x[i, 0], load[i, 0], color=colour, **SIMULATED)
        axes.plot(x[i, 1], load[i, 1], color=colour, **_DOTTED)
    axes.plot([], [], color=NEUTRAL, label="loading", **SIMULATED)
    axes.plot([], [], color=NEUTRAL, label="unloading (area between: lost)", **_DOTTED)
    axes.set_xlim(left=0.0)
    axes.margins(y=0.12)
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="lower right", frameon=True, facecolor="white", edgecolor="none", framealpha=1.0)
    label(axes, x="displacement of the platen (mm)", y="load (N)",
          title=f"There and back at {max(table['rate_speeds_mm_per_min']):g} mm/min")


def _losses(axes: Axes, table: Row) -> None:
    for i, fulcrum in enumerate(table["rate_settings_mm"]):
        rows = [row for row in table["rates"] if row["fulcrum_mm"] == fulcrum and row["lost_j"] > 0.0]
        axes.plot(_numbers(rows, "speed_mm_per_min"), [100.0 * (1.0 - row["return_ratio"]) for row in rows],
                  color=condition_colour(_metres(fulcrum)), markersize=5, label=_position(fulcrum),
                  marker="*" if fulcrum is None else MARKERS[i % len(MARKERS)], **SIMULATED)
    log_scale(axes.xaxis)
    log_scale(axes.yaxis)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda number, _: f"{number:g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.legend(loc="upper left")
    label(axes, x="speed of the platen (mm/min)", y="lost of what was stored (%)", title="Loss by speed")


def _stored(axes: Axes, table: Row) -> None:
    slowest = min(table["rate_speeds_mm_per_min"], key=lambda speed: abs(speed - table["speed_mm_per_min"]))
    rows = [row for row in table["rates"] if row["speed_mm_per_min"] == slowest]
    places = np.arange(len(rows))
    axes.bar(places, _numbers(rows, "stored_j"), 0.62, edgecolor="0.1", linewidth=0.6,
             color=[condition_colour(_metres(row["fulcrum_mm"])) for row in rows], alpha=0.75, label="simulated")
    axes.plot(places, _numbers(rows, "linear_spring_j"), linestyle="", marker="_", markersize=22, markeredgewidth=2.2,
              color="0.05", label="linear spring, F²/2k")
    measured = {row["fulcrum_mm"]: row for row in table["settings"]
                if row["measured"] and abs(row["max_load_n"] - 600.0) < 1.0}
    stored = _numbers([measured.get(row["fulcrum_mm"], {}) for row in rows], "measured", "stored_j")
    if np.isfinite(stored).any():
        axes.plot(places, stored, linestyle="", marker="D", markersize=6, color="white", markeredgecolor="0.05",
                  markeredgewidth=1.2, label=_source(table))
    axes.set_xticks(places, [_position(row["fulcrum_mm"]).removesuffix(" mm") for row in rows])
    axes.set_ylim(0.0, 1.35 * axes.get_ylim()[1])
    axes.legend(loc="upper right")
    label(axes, x="fulcrum (mm), heel", y="energy stored at 600 N (J)", title=f"Stored at {slowest:g} mm/min")


# Stiffness with the load elsewhere on the keel, beside the closed form of the overhung beam.


def _load_point_figure(table: Row) -> Figure:
    """The figure: one line a fulcrum position; `table` of the bench section, which has load points."""
    points = table["load_points"]
    with drawing(7.2, 4.2) as figure:
        axes = figure.subplots()
        for i, fulcrum in enumerate(sorted({row["fulcrum_mm"] for row in points})):
            rows = [row for row in points if row["fulcrum_mm"] == fulcrum]
            colour, x = condition_colour(_metres(fulcrum)), _numbers(rows, "load_point_mm")
            axes.plot(x, _numbers(rows, "stiffness_n_per_mm"), color=colour, marker=MARKERS[i % len(MARKERS)],
                      markersize=5, **SIMULATED)
            axes.plot(x, _numbers(rows, "closed_form_n_per_mm"), color=colour, **_DOTTED)
            axes.annotate(_position(fulcrum), (x[-1], rows[-1]["stiffness_n_per_mm"]), xytext=(7, 0), va="center",
                          fontsize=8, textcoords="offset points", color=colour, fontweight="bold",
                          annotation_clip=False)
        axes.plot([], [], color=NEUTRAL, marker="o", markersize=5, label="simulated", **SIMULATED)
        axes.plot([], [], color=NEUTRAL, **_DOTTED, label="overhung beam, small deflections")
        axes.set_xticks(sorted({row["load_point_mm"] for row in points}))
        axes.set_ylim(bottom=0.0)
        axes.margins(x=0.1)
        axes.legend(loc="upper right")
        label(axes, x="load from the keel's posterior end (mm)", y="stiffness above 200 N (N/mm)",
              title="Stiffness by where the foot is loaded, and by position of the fulcrum")
    return figure


# The linear and the curvilinear part of the bench's curves: slope over load, and how much the foam's toe takes.


def _shape_figure(table: Row, arrays: Mapping[str, Any]) -> Figure:
    """The figure: slope dF/dx over load on the left, curvature by position on the right."""
    with drawing(10.5, 4.4) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
        load = np.asarray(arrays["load_n"], dtype=float)
        for i, row in enumerate(table["settings"]):
            if row["fulcrum_mm"] is None:
                continue
            colour, last = condition_colour(_metres(row["fulcrum_mm"])), float("nan")
            for key, look in (("measured", MEASURED), ("model", SIMULATED)):
                slope = np.asarray(arrays[f"{key}_tangent_n_per_mm"], dtype=float)[i]
                left.plot(load[i], slope, color=colour, **look)
                known = np.flatnonzero(np.isfinite(slope))
                last = slope[known[-1]] if known.size else last
            if np.isfinite(last):
                left.annotate(_position(row["fulcrum_mm"]), (load[i, -1], last), xytext=(3, 0), va="center", fontsize=8,
                              textcoords="offset points", color=colour, fontweight="bold", annotation_clip=False)
        left.axvline(200.0, color=NEUTRAL, linewidth=0.8, linestyle=":")
        if table["measured"]:
            left.plot([], [], color=NEUTRAL, label=_source(table), **MEASURED)
        left.plot([], [], color=NEUTRAL, label=f"simulated: {table['lines'][0]['name']}", **SIMULATED)
        left.set_ylim(0.0, 1.2 * left.get_ylim()[1])
        left.legend(loc="upper left")
        label(left, x="load (N)", y="slope dF/dx (N/mm)", title="Slope over load (dotted: 200 N)")
        rows = _forefoot(table)
        keys = (["measured"] if table["measured"] else []) + [line["key"] for line in table["lines"]]
        names = {line["key"]: line["name"] for line in table["lines"]} | {"measured": _source(table)}
        places, width = np.arange(len(rows)), 0.8 / len(keys)
        for j, key in enumerate(keys):
            share = 100.0 * np.array(_numbers(rows, key, "shape", "curvature_share"))
            right.bar(places + (j - 0.5 * (len(keys) - 1)) * width, share, width, color=_LINE_GREYS[key],
                      edgecolor="0.1", linewidth=0.6, label=names[key])
        right.set_xticks(places, [f"{row['fulcrum_mm']:g}" for row in rows])
        right.set_ylim(0.0, 1.5 * right.get_ylim()[1])
        right.legend(loc="upper left", ncols=2)
        label(right, x="fulcrum from the keel's posterior end (mm)", y="largest distance from the chord (% of travel)",
              title="How far the curve is from straight")
    return figure
