"""A sweep over one quantity in one figure: errors against the plate and the peak force, one line a trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from vsf_drake.report.style import MARKERS, NEUTRAL, condition_colour, label, log_scale, new_figure, style

_PANELS = (("grf_rmse_bw", 100.0, "RMS error (% body weight)", "Resultant force"),
           ("cop_rmse_fl", 100.0, "RMS error (% foot length)", "Centre of pressure, fore-aft"),
           ("peak_vertical_bw", 1.0, "vertical force (body weights)", "Peak of the model"))
_WIDE = 20.0
"""Ratio of largest to smallest value above which the axis is logarithmic."""


def sweep_figure(rows: Sequence[Mapping[str, Any]], table: Mapping[str, Any], variables: Mapping[str, Any]) -> Figure:
    """The figure of `rows` (of sweep.csv) and `table` (of sweep.json); just one quantity is varied in them."""
    [name] = table["varied"]
    unit = table["columns"][name]["unit"]
    axis = "fulcrum from the keel's posterior end (mm)" if name == "fulcrum_mm" else f"{name} ({unit})"
    with style():
        figure = new_figure(9.6, 4.0 + 0.16 * len(table["trials"]))
        for axes, (key, factor, y, title) in zip(figure.subplots(1, 3), _PANELS, strict=True):
            lines = []
            for number, trial in enumerate(table["trials"]):
                own = [row for row in rows if row["trial"] == trial["name"]]
                lines.append(_line(axes, own, name, key, factor, trial, number))
            _own_values(axes, name, table, variables)
            values = [row[name] for row in rows]
            if min(values) > 0.0 and max(values) / min(values) > _WIDE:
                log_scale(axes.xaxis)
            label(axes, x="", y=y, title=title)
        figure.axes[1].set_xlabel(axis)
        figure.legend(lines, [_shown(trial["name"]) for trial in table["trials"]], loc="outside lower left")
        synthetic = " (SYNTHETIC)" if any(trial["synthetic"] for trial in table["trials"]) else ""
        failed = f", {table['failed']} FAILED" if table["failed"] else ""
        figure.suptitle(f"{table['walks']} walks{synthetic}{failed}; shaded: the trial's own value; dotted: measured "
                        "peak", x=0.01, ha="left", fontsize=10)
        figure.draw_without_rendering()
    return figure


def _line(axes: Axes, rows: Sequence[Mapping[str, Any]], name: str, key: str, factor: float,
          trial: Mapping[str, Any], number: int) -> Line2D:
    colour = condition_colour(1e-3 * trial["fulcrum_mm"])
    known = sorted((row[name], factor * row[key]) for row in rows if row[key] is not None)
    [line] = axes.plot([x for x, _ in known], [y for _, y in known], marker=MARKERS[number % len(MARKERS)],
                       markersize=4, linewidth=1.4, color=colour)
    for row in rows:
        if row["failure"]:
            axes.plot(row[name], 0.02, marker="x", color=colour, transform=axes.get_xaxis_transform(), clip_on=False)
    if key == "peak_vertical_bw" and trial["measured_peak_vertical_bw"] is not None:
        axes.axhline(trial["measured_peak_vertical_bw"], color=colour, linestyle=":", linewidth=1.2)
    return line


def _shown(name: str) -> str:
    """`name` as legends take it: they leave out what begins with an underscore."""
    return f" {name}" if name.startswith("_") else name


def _own_values(axes: Axes, name: str, table: Mapping[str, Any], variables: Mapping[str, Any]) -> None:
    own = {trial["fulcrum_mm"] for trial in table["trials"]} if name == "fulcrum_mm" else {variables[name].default}
    for value in own:
        axes.axvline(value, color=NEUTRAL, linewidth=5.0, alpha=0.35, zorder=0)
