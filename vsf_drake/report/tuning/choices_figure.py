"""Between two costs, between one setting and several, and how firm the setting is when the contact is not."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.style import NEUTRAL, SHADE, condition_colour, label, new_figure, style
from vsf_drake.report.tuning.figures import FULCRUM, every, mark_origin, mark_positions
from vsf_drake.report.tuning.words import NOT_OPTIMAL, holding_terms, quantity, swept, swept_part


def pareto_figure(table: Mapping[str, Any]) -> Figure:
    """The front of two costs: each point is the best that one weight gives."""
    rows = [row for row in table["pareto"] if row["first"] is not None and row["second"] is not None]
    first, second = table["pareto_names"]
    with style():
        figure = new_figure(7.4, 4.4)
        axes = figure.subplots()
        axes.plot([row["first"] for row in rows], [row["second"] for row in rows], color=NEUTRAL, linewidth=1.0)
        for row in rows:
            axes.plot(row["first"], row["second"], marker="o", markersize=7, linestyle="",
                      color=condition_colour(1e-3 * row["fulcrum_mm"]))
        for row in _apart(rows):
            axes.annotate(f"{row['fulcrum_mm']:.0f} mm", (row["first"], row["second"]), xytext=(7, 5),
                          textcoords="offset points", fontsize=8)
        axes.margins(x=0.12, y=0.1)
        label(axes, x=f"{_name(first)} (in its unit)", y=f"{_name(second)} (in its unit)",
              title="Less of one costs more of the other")
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure


def tasks_figure(table: Mapping[str, Any]) -> Figure:
    """Each task's own setting, and by how much one setting for all is worse."""
    rows, common = table["tasks"], table["common_fulcrum_mm"]
    places = np.arange(len(rows))
    with style():
        figure = new_figure(10.6, 1.5 + 0.38 * len(rows))
        left, right = figure.subplots(1, 2, sharey=True)
        if common is not None:
            left.axvline(common, color=NEUTRAL, linestyle="--", linewidth=1.3, label=f"one for all, {common:.1f} mm")
        for place, row in zip(places, rows, strict=True):
            if row.get("interval_mm") is not None:
                left.plot(row["interval_mm"], [place, place], color="0.75", linewidth=5.0, solid_capstyle="butt",
                          zorder=1)
            left.plot(row["fulcrum_mm"], place, marker="o", markersize=8, linestyle="", zorder=2,
                      color=condition_colour(1e-3 * row["fulcrum_mm"]))
            lost = excess(row)
            if lost is not None:
                right.barh(place, lost, height=0.55, color="0.55")
                right.annotate(f" {lost:.2f}", (max(lost, 0.0), place), va="center", fontsize=8)
        left.set_yticks(places, [row["label"] for row in rows])
        left.set_ylim(len(rows) - 0.4, -0.6)
        right.margins(x=0.15)
        right.set_xlim(left=0.0)
        if common is not None:
            left.legend(loc="best", frameon=True, facecolor="white", edgecolor="none")
        unit = "%" if all(_relative(row) for row in rows) else table["cost_unit"]
        label(left, x=FULCRUM, y="", title="Setting of each task")
        label(right, x=f"more {table['cost_label']} with one setting for all ({unit})", y="",
              title="What adaptability buys")
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure


def robustness_figure(table: Mapping[str, Any]) -> Figure:
    """Where the optimum goes when something that is not known exactly is changed."""
    rows = [row for row in table["robustness"] if row["fulcrum_mm"] is not None]
    with style():
        figure = new_figure(8.6, 1.4 + 0.3 * len(rows))
        axes = figure.subplots()
        _spread(axes, table, rows)
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure


def excess(row: Mapping[str, Any]) -> float | None:
    """What a task's cost is worse by with one setting for all: in percent where costs are positive, else as it is."""
    if row["cost"] is None or row["cost_common"] is None:
        return None
    lost = float(row["cost_common"] - row["cost"])
    return 100.0 * lost / row["cost"] if _relative(row) else lost


def _relative(row: Mapping[str, Any]) -> bool:
    return row["cost"] is not None and row["cost"] > 0.0


def _spread(axes: Axes, table: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> None:
    places = range(len(rows))
    if table["fulcrum_interval_mm"] is not None:
        axes.axvspan(*table["fulcrum_interval_mm"], color=SHADE, zorder=0)
    if table["fulcrum_mm"] is not None:
        axes.axvline(table["fulcrum_mm"], color="black", linewidth=1.0, zorder=1)
    for place, row in zip(places, rows, strict=True):
        axes.plot(row["fulcrum_mm"], place, marker="o", markersize=7, linestyle="", zorder=2,
                  color=condition_colour(1e-3 * row["fulcrum_mm"]))
    axes.set_yticks(places, [row["what"] for row in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)
    ends = [row["fulcrum_mm"] for row in table["sweep"]]
    if ends:
        axes.set_xlim(min(ends) - 2.0, max(ends) + 2.0)
    label(axes, x=FULCRUM, y="", title="The optimum when something is changed")


def _apart(rows: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Points that are far enough from the last named one to have a name of their own."""
    if not rows:
        return []
    xs, ys = ([row[key] for row in rows] for key in ("first", "second"))
    wide, tall = (max(max(values) - min(values), 1e-300) for values in (xs, ys))
    named: list[Mapping[str, Any]] = []
    for row in rows:
        if all(np.hypot((row["first"] - other["first"]) / wide, (row["second"] - other["second"]) / tall) > 0.08
               for other in named):
            named.append(row)
    return named


def _name(cost: str) -> str:
    return cost.replace("_", " ")


# What else changes with the setting: one small panel an outcome, over the whole range of the fulcrum.


_ACROSS, _WIDE = 3, 38
"""Panels side by side; letters of a title's line."""


def shown_outcomes(table: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Outcomes that were followed over the range."""
    return [row for row in table["outcomes"] if len(swept_part(table, "outcomes", row["name"])[0]) > 1]


def outcomes_figure(table: Mapping[str, Any]) -> Figure:
    """One panel an outcome; the grey band is its uncertainty about the value at the optimum."""
    rows = shown_outcomes(table)
    across = min(_ACROSS, len(rows))
    down = -(-len(rows) // across)
    with style():
        figure = new_figure(10.6 if across > 1 else 6.0, 0.5 + 2.5 * down)
        panels = figure.subplots(down, across, sharex=True, squeeze=False).ravel()
        for axes, row in zip(panels, rows, strict=False):
            _panel(axes, table, row)
        for axes in panels[len(rows):]:
            axes.set_axis_off()
        for axes in panels[max(len(rows) - across, 0):len(rows)]:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel(FULCRUM)
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure


def _panel(axes: Axes, table: Mapping[str, Any], row: Mapping[str, Any]) -> None:
    x, y = swept_part(table, "outcomes", row["name"])
    mark_positions(axes, table, named=False)
    here = row["optimum"]
    if here is not None and row["uncertainty"] is not None:
        axes.axhspan(here - row["uncertainty"], here + row["uncertainty"], color="0.8", alpha=0.5, zorder=0)
    axes.plot(x, y, color="black", linewidth=1.5, marker="o", markersize=3.0, markevery=every(x))
    if here is not None and table["fulcrum_mm"] is not None and table["optimal"]:
        axes.plot(table["fulcrum_mm"], here, marker="*", markersize=12, color="white", zorder=5,
                  markeredgecolor=condition_colour(1e-3 * table["fulcrum_mm"]), markeredgewidth=1.4)
    if np.ptp(y) == 0.0:
        axes.margins(y=0.5)
    hardly = ": hardly changes" if row["matters"] is False else ""
    label(axes, x="", y=row["unit"] if row["unit"] not in ("", "1") else "no unit",
          title=textwrap.fill(f"{row['label']}{hardly}", _WIDE))


# What the figures of a tuning show, in words and numbers: for who cannot see them, and above them.


def cost_alt(table: Mapping[str, Any]) -> str:
    """Of the cost's curve."""
    x, y = swept(table)
    low, high = int(np.argmin(y)), int(np.argmax(y))
    end = "" if table["fulcrum_mm"] is None else (
        f" The optimum is at {table['fulcrum_mm']:.1f} mm." if table["optimal"] else
        f" {NOT_OPTIMAL}: the last iterate is at {table['fulcrum_mm']:.1f} mm.")
    return (f"Cost, {table['cost_label']}, over the fulcrum from {x[0]:g} to {x[-1]:g} mm: least "
            f"{quantity(y[low], table['cost_unit'])} near {x[low]:g} mm, most {quantity(y[high], table['cost_unit'])} "
            f"at {x[high]:g} mm.{end}")


def outcomes_alt(table: Mapping[str, Any]) -> str:
    """Of the small panels."""
    parts = []
    for row in shown_outcomes(table):
        x, y = swept_part(table, "outcomes", row["name"])
        parts.append(f"{row['label']} from {quantity(y[0], row['unit'])} at {x[0]:g} mm to "
                     f"{quantity(y[-1], row['unit'])} at {x[-1]:g} mm")
    return f"Outcomes over the range of the fulcrum: {'; '.join(parts)}."


def tasks_words(table: Mapping[str, Any]) -> str:
    """What adaptability buys."""
    lost = [value for row in table["tasks"] if (value := excess(row)) is not None]
    settings = [row["fulcrum_mm"] for row in table["tasks"] if row["fulcrum_mm"] is not None]
    if not lost or not settings or table["common_fulcrum_mm"] is None:
        return "What one setting for all would cost is not known."
    relative = all(row["cost"] is not None and row["cost"] > 0.0 for row in table["tasks"])
    unit = "%" if relative else table["cost_unit"]
    return (f"The tasks' own settings lie between {min(settings):.1f} and {max(settings):.1f} mm. One setting for all "
            f"({table['common_fulcrum_mm']:.1f} mm) costs {quantity(float(np.mean(lost)), unit)} more on average and "
            f"{quantity(max(lost), unit)} at most: this is all that changing the setting from task to task can buy "
            f"here.{_rest_words(table)}")


def _rest_words(table: Mapping[str, Any]) -> str:
    """What of it is no gain of the person, because a term of the cost only holds to the recording."""
    pairs = [(row["rest"], row["rest_common"]) for row in table["tasks"]
             if row.get("rest") is not None and row.get("rest_common") is not None]
    if pairs:
        more = float(np.mean([common - own for own, common in pairs]))
        size = float(np.mean([abs(own) for own, _ in pairs])) or 1.0
        return (f" Without the part of the cost that only holds to the recording, one setting for all costs "
                f"{quantity(abs(more), table['cost_unit'])} {'more' if more >= 0.0 else 'LESS'} on average "
                f"({100.0 * abs(more) / size:.2g} %).")
    if holding_terms({"terms": [], "sweep": [], **table}):
        return " That counts the part of the cost that only holds to the recording, which is no gain of the person."
    return ""


def tasks_alt(table: Mapping[str, Any]) -> str:
    """Of the tasks' figure."""
    parts = [f"{row['label']} {row['fulcrum_mm']:.1f} mm" for row in table["tasks"] if row["fulcrum_mm"] is not None]
    return f"Own settings of the tasks: {', '.join(parts) or 'none is known'}. {tasks_words(table)}"


def pareto_words(table: Mapping[str, Any]) -> str:
    """How far the setting moves along the front, and what is gained and lost."""
    rows = [row for row in table["pareto"] if row["first"] is not None and row["second"] is not None]
    if len(rows) < 2:
        return "The front has fewer than two points."
    first, second = (name.replace("_", " ") for name in table["pareto_names"])
    settings = [row["fulcrum_mm"] for row in rows]
    return (f"From one end of the front to the other the fulcrum moves between {min(settings):.1f} and "
            f"{max(settings):.1f} mm; {first} lies between {_span(rows, 'first')} and {second} between "
            f"{_span(rows, 'second')}.")


def pareto_alt(table: Mapping[str, Any]) -> str:
    """Of the front."""
    return f"Pareto front of {' and '.join(name.replace('_', ' ') for name in table['pareto_names'])}. " \
        + pareto_words(table)


def robustness_words(table: Mapping[str, Any]) -> str:
    """How far the optimum moves."""
    found = [row["fulcrum_mm"] for row in table["robustness"] if row["fulcrum_mm"] is not None]
    if not found:
        return "No changed problem could be solved."
    return (f"With each of {len(found)} changes the optimum lies between {min(found):.1f} and {max(found):.1f} mm.")


def robustness_alt(table: Mapping[str, Any]) -> str:
    """Of its figure."""
    parts = [f"{row['what']} {row['fulcrum_mm']:.1f} mm" for row in table["robustness"]
             if row["fulcrum_mm"] is not None]
    return f"Where the optimum lies when something is changed: {', '.join(parts)}."


def spans(values: Any, names: Sequence[str]) -> str:
    """Ranges of the coordinates, in degrees and mm."""
    parts = []
    for name, column in zip(names, np.asarray(values).T, strict=True):
        scale, unit = (1e3, " mm") if name in ("pelvis_tx", "pelvis_ty") else (180.0 / np.pi, "°")
        parts.append(f"{name.replace('_', ' ')} {scale * column.min():.0f} to {scale * column.max():.0f}{unit}")
    return ", ".join(parts)


def _span(rows: Sequence[Mapping[str, Any]], key: str) -> str:
    values = [row[key] for row in rows]
    return f"{min(values):.4g} and {max(values):.4g}"
