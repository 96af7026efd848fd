"""The foot at rest in the validation's report: in the testing machine, experiment beside
simulation, and stood upon."""

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
    PANEL,
    SHADE,
    SIMULATED,
    Arrays,
    colour_of,
    drawing,
    label,
    legend_below,
    tag,
)
from vsf_drake.report.validation.panels import section_chapter

if TYPE_CHECKING:
    from vsf_drake.device.bench_lines import SettingRow
    from vsf_drake.validation.bench_section import BenchSectionTable, StoodTable

_MARKERS = {"model": "o", "nominal": "s", "soft_support": "v", "refined": "D", "calibrated": "^"}
_MISSED = (
    ("stiffness_n_per_mm", "stiffness_rmse_n_per_mm", "N/mm", "Stiffness", ""),
    ("mid_range_mm", "mid_range_rmse_mm", "mm", "Mid-range displacement", FULCRUM),
)
_PUBLISHED: dict[str, Any] = {"marker": "_", "markeredgewidth": 3.0}
_SLOPE_ABOVE_N = 200.0


def bench_chapter(table: BenchSectionTable, arrays: Arrays) -> Chapter:
    """The chapter; `table` and `arrays` of the saved bench section."""
    figures = {
        "bench_curves": _curves_figure(table, arrays),
        "bench_stiffness": _stiffness_figure(table),
    }
    if table.lines[0].statistics is not None:
        figures["bench_errors"] = _errors_figure(table)
    forefoot = sorted(
        (row for row in table.rates if row.fulcrum_mm is not None),
        key=lambda row: row.fulcrum_mm or 0.0,
    )
    at_speed = {
        speed: [row for row in forefoot if row.speed_mm_per_min == speed]
        for speed in sorted({row.speed_mm_per_min for row in forefoot}, reverse=True)
    }
    return section_chapter(
        "bench",
        table,
        figures,
        loops=[(speed, own[0], own[-1]) for speed, own in at_speed.items() if len(own) > 1],
        comparison_rows=[
            {"of": line.name + more, **vars(own)}
            for line in table.lines
            for more, own in (
                ("", line.statistics),
                (": settings not calibrated to", line.held_out),
            )
            if own
        ],
        setting_rows=[
            {
                **vars(row),
                "setting": _setting_name(row.fulcrum_mm),
                "repeats": row.repeats or None,
                **{
                    f"{key}_{name}": value
                    for key, curve in row.lines.items()
                    if curve
                    for name, value in vars(curve).items()
                },
            }
            for row in table.settings
        ],
        rate_rows=[
            {
                **vars(row),
                "setting": _setting_name(row.fulcrum_mm),
                "lost_share": 1.0 - row.return_ratio,
            }
            for row in table.rates
        ],
    )


def standing_chapter(table: StoodTable, arrays: Arrays) -> Chapter:
    """What the ground carries of a standing person, and how the feet share it, per fulcrum
    position."""
    return section_chapter("standing", table)


def _setting_name(fulcrum_mm: float | None) -> str:
    """A setting in a table."""
    return "heel" if fulcrum_mm is None else f"{fulcrum_mm:g} mm"


def _forefoot(table: BenchSectionTable) -> list[SettingRow]:
    return [row for row in table.settings if row.fulcrum_mm is not None]


def _source(table: BenchSectionTable) -> str:
    return "SYNTHETIC bench" if table.measured_synthetic else "measured"


def _stiffness_figure(table: BenchSectionTable) -> Figure:
    """Stiffness by fulcrum position: published, measured, simulated."""
    rows = _forefoot(table)
    x = [row.fulcrum_mm or 0.0 for row in rows]
    model = _of_line(rows, "model", "stiffness_n_per_mm")
    measured, half = (
        _of_line(rows, "measured", f"stiffness_n_per_mm{more}") for more in ("", "_half_width")
    )
    with drawing(PANEL[0], 1.25 * PANEL[1]) as figure:
        axes = figure.subplots()
        if np.isfinite(measured).any():
            axes.plot(x, measured, color=NEUTRAL, label=_source(table), **MEASURED)
        axes.plot(x, model, color=NEUTRAL, label=table.lines[0].name, **SIMULATED)
        for i, row in enumerate(rows):
            marker = MARKERS[i % len(MARKERS)]
            look: dict[str, Any] = {"color": colour_of(x[i]), "linestyle": "", "marker": marker}
            if row.published_n_per_mm is not None:
                axes.plot(x[i], row.published_n_per_mm, **look | _PUBLISHED, markersize=20)
            axes.errorbar(x[i], measured[i], yerr=half[i], capsize=4, **look)
            axes.plot(
                x[i], model[i], markersize=10, markerfacecolor="none", markeredgewidth=1.4, **look
            )
        axes.plot(
            x,
            [row.tuned_joints_n_per_mm or np.nan for row in rows],
            marker="x",
            color=NEUTRAL,
            linestyle="",
            label="tuned joints of the authors' model, small loads",
        )
        axes.plot(
            [],
            [],
            color=NEUTRAL,
            linestyle="",
            markersize=14,
            label="published end points",
            **_PUBLISHED,
        )
        axes.margins(x=0.1, y=0.12)
        axes.set_ylim(bottom=0.0)
        label(axes, x=FULCRUM, y="stiffness above 200 N (N/mm)")
        legend_below(figure, axes.get_legend_handles_labels()[0])
    return figure


def _errors_figure(table: BenchSectionTable) -> Figure:
    """By what each model misses the measured stiffness and mid-range displacement, by fulcrum
    position."""
    rows = _forefoot(table)
    x = [row.fulcrum_mm for row in rows]
    with drawing(PANEL[0], 1.6 * PANEL[1]) as figure:
        for axes, (key, rmse, unit, title, x_label) in zip(
            figure.subplots(2, sharex=True), _MISSED, strict=True
        ):
            if not table.measured_synthetic:
                limit = table.limits[rmse]
                axes.axhspan(-limit, limit, color=SHADE, zorder=0, label="paper's RMSE")
            axes.axhline(0.0, color=NEUTRAL, linewidth=0.8)
            for line in table.lines:
                own = line.key == "model"
                axes.plot(
                    x,
                    _of_line(rows, line.key, key) - _of_line(rows, "measured", key),
                    color="0.1",
                    marker=_MARKERS[line.key],
                    markerfacecolor="0.1" if own else "white",
                    label=line.name,
                    linewidth=0.8,
                    linestyle="-" if own else ":",
                )
            label(axes, x=x_label, y=f"less {_source(table)} ({unit})", title=title)
        figure.legend(*axes.get_legend_handles_labels(), loc="lower center", ncols=2)
    return figure


def _curves_figure(table: BenchSectionTable, arrays: Arrays) -> Figure:
    """Load over displacement at every setting, experiment beside simulation, after Figure 4 of
    McGeehan 2021."""
    with drawing(*PANEL) as figure:
        axes = figure.subplots()
        for i, row in enumerate(table.settings):
            _setting(axes, i, row, table, arrays)
        axes.plot(
            [],
            [],
            color=NEUTRAL,
            label=_source(table) if table.measured_name else "published slope",
            **MEASURED,
        )
        axes.plot([], [], color=NEUTRAL, label=table.lines[0].name, **SIMULATED)
        axes.legend(loc="lower right", title="numbers: fulcrum (mm)", alignment="left")
        axes.set_xlim(left=0.0)
        axes.margins(y=0.1)
        axes.set_ylim(bottom=0.0)
        label(axes, x="displacement since touch-down (mm)", y="load (N)")
    return figure


def _setting(axes: Axes, i: int, row: SettingRow, table: BenchSectionTable, arrays: Arrays) -> None:
    colour = colour_of(row.fulcrum_mm)
    load = arrays["load_n"][i]
    half = arrays["measured_half_width_mm"][i]
    measured = arrays["measured_mm"][i]
    model = arrays["model_mm"][i]
    axes.fill_betweenx(load, measured - half, measured + half, color=colour, alpha=0.2, linewidth=0)
    axes.plot(measured, load, color=colour, **MEASURED)
    axes.plot(model, load, color=colour, **SIMULATED)
    if (
        table.measured_name is None
        and row.published_n_per_mm is not None
        and np.isfinite(model).all()
    ):
        above = load[load >= _SLOPE_ABOVE_N]
        start = float(np.interp(_SLOPE_ABOVE_N, load, model))
        axes.plot(
            start + (above - _SLOPE_ABOVE_N) / row.published_n_per_mm,
            above,
            color=colour,
            **MEASURED,
        )
    ends = [curve[-1] for curve in (model, measured) if np.isfinite(curve[-1])]
    if ends:
        name = "heel" if row.fulcrum_mm is None else f"{row.fulcrum_mm:g}"
        tag(axes, name, (ends[0], load[-1]), colour, offset=(0, 5), ha="center")


def _of_line(rows: Iterable[SettingRow], line: str, key: str) -> np.ndarray:
    """A value of the measured curves, or of a model, by setting; NaN where it is missing: gaps in a
    figure."""
    return np.array([getattr(row.lines.get(line), key, None) for row in rows], dtype=float)
