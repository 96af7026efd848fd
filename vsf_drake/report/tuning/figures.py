"""What tuning found along the fulcrum, the forces and the motion at its optimum, as figures."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping
from functools import cache, wraps
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.textpath import TextPath

from vsf_drake.report.style import (
    MARKERS,
    MEASURED,
    NEUTRAL,
    PANEL,
    SHADE,
    colour_of,
    drawing,
    label,
    legend_below,
)
from vsf_drake.report.tuning import reading
from vsf_drake.report.tuning.reading import Arrays
from vsf_drake.tuning.quantities import GIVEN_COSTS
from vsf_drake.tuning.table import TuningTable

FULCRUM = "fulcrum from the keel's end (mm)"
_FAILED = "#b3261e"
_LETTERS = 23  # of a title in a line, at most
_TITLE_PT = 9.5  # its letters
_TITLE_WIDE_PT = 105.0  # one of two panels
_DASHES = ("-", "--", "-.", ":", (0, (6, 1.5, 1, 1.5)), (0, (1, 1)))


def _drawn(draw: Callable[..., None]) -> Callable[..., Figure]:
    """`draw`, which fills a figure of a table, as a function that returns it, marked where there is
    no optimum, or none to be believed, or data are synthetic."""

    @wraps(draw)
    def drawn(table: TuningTable, *others: Any) -> Figure:
        with drawing(PANEL[0], 1.0) as figure:
            draw(figure, table, *others)
            said = (
                table.doubt,
                "SYNTHETIC trials, not recorded" * bool(table.synthetic),
            )
            if any(said):
                figure.suptitle(
                    "; ".join(filter(None, said)),
                    x=0.01,
                    ha="left",
                    fontsize=10.5,
                    color=_FAILED if table.doubt else "black",
                )
        return figure

    return drawn


def _panels(figure: Figure, count: int, across: int, x_label: str) -> list[Axes]:
    panels = figure.subplots(-(-count // across), across, sharex=True, squeeze=False).ravel()
    for axes in panels[count:]:
        axes.set_axis_off()
    for axes in panels[max(count - across, 0) : count]:
        axes.tick_params(labelbottom=True)
        axes.set_xlabel(textwrap.fill(x_label, 20))
    return list(panels[:count])


def _wrapped(title: str) -> str:
    """A title in lines that are no wider than one of two panels, whatever its letters are."""
    lines = [title]
    for count in range(_LETTERS, 0, -1):
        lines = textwrap.wrap(title, count, break_on_hyphens=False)
        if max(map(_width_pt, lines)) <= _TITLE_WIDE_PT:
            break
    return "\n".join(lines)


@cache
def _width_pt(line: str) -> float:
    return float(TextPath((0.0, 0.0), line, size=_TITLE_PT).get_extents().width)


def _colour(fulcrum_mm: float | None) -> Any:
    return NEUTRAL if fulcrum_mm is None else colour_of(fulcrum_mm)


def _mark(
    axes: Axes, fulcrum_mm: float, y: float, marker: str, size: float, edge: float, **look: Any
) -> None:
    """What stands out of a curve over the fulcrum: white, with an edge in the position's colour."""
    axes.plot(
        fulcrum_mm,
        y,
        marker,
        markersize=size,
        color="white",
        markeredgecolor=_colour(fulcrum_mm),
        markeredgewidth=edge,
        zorder=5,
        **look,
    )


def _curve(axes: Axes, x: np.ndarray, y: np.ndarray, **look: Any) -> None:
    axes.plot(
        x,
        y,
        **{
            "color": "black",
            "marker": "o",
            "markersize": 3.5,
            "markevery": max(1, round(len(x) / 20)),
            **look,
        },
    )


def _mark_positions(axes: Axes, table: TuningTable, *, named: bool = True) -> None:
    """The interval of the optimum as a band, and lines where the fulcrum was recorded and where it
    ended."""
    interval = table.fulcrum_interval_mm
    if interval is not None and not table.doubt:
        axes.axvspan(*interval, color=SHADE, zorder=0, label="its interval" if named else None)
    for i, mm in enumerate(reading.recorded_positions(table)):
        axes.axvline(
            mm,
            color=NEUTRAL,
            linestyle=":",
            linewidth=1.2,
            zorder=1,
            label="recorded" if named and not i else None,
        )
    if table.fulcrum_mm is not None:
        axes.axvline(
            table.fulcrum_mm,
            color=_FAILED if table.doubt else _colour(table.fulcrum_mm),
            linewidth=1.0,
            zorder=1,
        )


@_drawn
def cost_curve_figure(figure: Figure, table: TuningTable, arrays: Arrays) -> None:
    """The cost over the whole range with its optimum; where terms of it only hold to the recording
    or to able-bodied walking, also without these, with that least."""
    figure.set_size_inches(PANEL[0], 3.9)
    axes = figure.subplots()
    best = table.fulcrum_mm
    x_of = arrays.get("sweep_mm")
    trials = arrays.get("sweep_cost_trials")
    if x_of is not None and trials is not None and np.shape(trials)[1] > 1:
        own = np.asarray(trials, dtype=float).T
        at = int(np.argmin(np.abs(np.asarray(x_of) - (best or np.median(x_of)))))
        for i, values in enumerate(own):
            axes.plot(
                x_of,
                values - values[at] + own[:, at].mean(),
                color="0.75",
                linewidth=0.9,
                zorder=1,
                label="one trial, shifted" if i == 0 else None,
            )
    least = table.least_rest()
    x = table.swept()[0]
    held = f"cost, held to {table.held_to}"
    _curve(axes, *table.swept(), linewidth=1.8, label="cost" if least is None else held)
    if least is not None:
        _curve(
            axes,
            x,
            np.array([table.rest_at(mm) for mm in x], dtype=float),
            linewidth=1.6,
            linestyle="--",
            marker="",
            label="cost by itself",
        )
        _mark(axes, *least, "D", 8, 1.6, label=f"its least, {least[0]:.1f} mm")
    if table.walked:
        _curve(
            axes,
            np.array([point.fulcrum_mm for point in table.walked]),
            np.array([point.walked for point in table.walked], dtype=float),
            linestyle="-.",
            label="own strides, before they adapt",
        )
    if table.spring_alone:
        _curve(
            axes,
            np.array([point.fulcrum_mm for point in table.spring_alone]),
            np.array([point.equal_load["cost"] for point in table.spring_alone], dtype=float),
            linestyle=":",
            marker="",
            color=NEUTRAL,
            linewidth=1.8,
            label="spring alone, equal load",
        )
    if best is not None and table.cost is not None:
        if not table.doubt:
            _mark(axes, best, table.cost, "*", 15, 1.6, label=f"optimum, {best:.1f} mm")
        else:
            axes.plot(
                best,
                table.cost,
                "x",
                markersize=11,
                color=_FAILED,
                markeredgewidth=2.4,
                zorder=5,
                label=f"{'least cost' if table.optimal else 'last iterate'}, {table.doubt}",
            )
    label(
        axes,
        x=FULCRUM,
        y="\n".join(textwrap.wrap(f"{table.cost_says} ({table.cost_unit})", 34)),
        title="By itself the cost is least elsewhere"
        if table.held_from
        else "Cost over the whole range",
    )
    _mark_positions(axes, table)
    legend_below(figure, axes.get_legend_handles_labels()[0])


@_drawn
def terms_figure(figure: Figure, table: TuningTable) -> None:
    """What each term of the cost adds as the fulcrum leaves the optimum."""
    figure.set_size_inches(PANEL[0], 3.9)
    axes = figure.subplots()
    terms = [row for row in table.terms if len(table.swept("terms", row.name)[0])]
    axes.axhline(0.0, color="0.4", linewidth=0.8)
    for i, row in enumerate(terms):
        x, y = table.swept("terms", row.name)
        _curve(
            axes,
            x,
            y - (row.value if row.value is not None else float(y.min())),
            color=f"{0.08 + 0.5 * i / len(terms):.2f}",
            linewidth=1.6,
            linestyle=_DASHES[i % 6],
            marker=MARKERS[i % len(MARKERS)],
            label=row.label,
        )
    label(
        axes,
        x=FULCRUM,
        y=f"change from the optimum ({table.cost_unit})",
        title="What each term adds",
    )
    _mark_positions(axes, table)
    legend_below(figure, axes.get_legend_handles_labels()[0])


@_drawn
def outcomes_figure(figure: Figure, table: TuningTable) -> None:
    """One panel an outcome; the grey band is its uncertainty about the value at the optimum."""
    rows = reading.shown_outcomes(table)
    best = table.fulcrum_mm
    across = min(2, len(rows))
    figure.set_size_inches(PANEL[0], 0.5 + 2.3 * -(-len(rows) // across))
    for axes, row in zip(_panels(figure, len(rows), across, FULCRUM), rows, strict=True):
        x, y = table.swept("outcomes", row.name)
        _mark_positions(axes, table, named=False)
        here = row.optimum
        error = row.uncertainty
        if here is not None and error is not None:
            axes.axhspan(here - error, here + error, color="0.8", alpha=0.5, zorder=0)
        _curve(axes, x, y, linewidth=1.5, markersize=3.0)
        if here is not None and best is not None and not table.doubt:
            _mark(axes, best, here, "*", 12, 1.4)
        if np.ptp(y) == 0.0:
            axes.margins(y=0.5)
        axes.set_ylabel(row.unit if row.unit not in ("", "1") else "no unit")
        hardly = ": hardly changes" if row.matters is False else ""
        axes.set_title(_wrapped(f"{row.label}{hardly}"), loc="left")


_RECORDED: dict[str, Any] = {"label": "recorded", "color": "0.45", **MEASURED}
_LINES: dict[str, dict[str, Any]] = {
    "_recorded": _RECORDED,
    "": {"label": "optimised", "color": "black", "linewidth": 1.5},
    "_resimulated_prescribed": {
        "label": "simulated again, motion prescribed",
        "color": "#1f6f8b",
        "linewidth": 1.4,
        "linestyle": (0, (4, 1.6)),
    },
    "_resimulated_feedback": {
        "label": "simulated again, torques and feedback",
        "color": "#b35900",
        "linewidth": 1.4,
        "linestyle": (0, (1, 1)),
    },
}


def _forces(
    figure: Figure,
    arrays: Arrays,
    rows: Mapping[str, str],
    time: Callable[[str], Any],
    looks: Mapping[str, Mapping[str, Any]],
    *,
    x_label: str,
    sharex: bool = False,
) -> None:
    """A row for each of `rows` (what its arrays begin with, by title), fore-aft (the first
    column of arrays) and vertical (the last)."""
    panels = figure.subplots(len(rows), 2, sharex=sharex, squeeze=False)
    for row, (title, prefix) in zip(panels, rows.items(), strict=True):
        for axes, column, direction in zip(row, (0, -1), ("fore-aft", "vertical"), strict=True):
            for name, look in looks.items():
                if f"{prefix}{name}" in arrays:
                    axes.plot(
                        time(prefix), np.asarray(arrays[f"{prefix}{name}"])[:, column], **look
                    )
            label(axes, x=x_label, y="force (N)", title=_wrapped(f"{title}{direction}"))
    legend_below(figure, panels[0, 0].get_legend_handles_labels()[0])


@_drawn
def stride_force_figure(figure: Figure, table: TuningTable, arrays: Arrays) -> None:
    """Level 2: forces of both feet over the gait cycle, as far as `arrays` has them."""
    rows = {
        f"{name}, ": f"grf_{foot}" for foot, name in reading.FEET.items() if f"grf_{foot}" in arrays
    }
    figure.set_size_inches(PANEL[0], 0.9 + 2.2 * len(rows))
    _forces(
        figure,
        arrays,
        rows,
        lambda prefix: 100.0 * np.asarray(arrays["phase"]),
        _LINES,
        x_label="gait cycle (%)",
        sharex=True,
    )


@_drawn
def stance_force_figure(figure: Figure, table: TuningTable, arrays: Arrays) -> None:
    """Level 1: the prosthetic foot's force in up to three trials."""
    shown = reading.drawn_trials(table, arrays)
    swept_mm = [row.fulcrum_mm for row in table.sweep]
    looks = {"recorded": _RECORDED}
    ends = (min(swept_mm, default=None), table.fulcrum_mm, max(swept_mm, default=None))
    for name, mm, dashes in zip(reading.SHOWN, ends, ((0, (1, 1)), "-", (0, (5, 2))), strict=True):
        called = name if table.optimal or name != "optimum" else "last iterate"
        looks[name] = {
            "color": colour_of(mm),
            "linestyle": dashes,
            "linewidth": 1.4,
            "label": called if mm is None else f"{called}, {mm:.0f} mm",
        }
    figure.set_size_inches(PANEL[0], 0.9 + 2.1 * len(shown))
    _forces(
        figure,
        arrays,
        {f"{trial}: ": prefix for trial, prefix in shown.items()},
        lambda prefix: arrays[f"{prefix}time"],
        looks,
        x_label="time (s)",
    )


@_drawn
def stride_figure(figure: Figure, table: TuningTable, arrays: Arrays, key: str) -> None:
    """Level 2: coordinates ("q") or joint "torque" over the gait cycle, and the recorded ones."""
    count = np.shape(arrays[key])[1]
    names = map(str, arrays["names"][-count:])
    figure.set_size_inches(PANEL[0], 0.6 + 1.8 * -(-count // 2))
    panels = _panels(figure, count, 2, "gait cycle (%)")
    for i, (axes, name) in enumerate(zip(panels, names, strict=True)):
        for suffix in ("_recorded", ""):
            if f"{key}{suffix}" in arrays:
                values = np.asarray(arrays[f"{key}{suffix}"])[:, i]
                axes.plot(
                    100.0 * np.asarray(arrays["phase"]),
                    values if key == "torque" else _line(name, values),
                    **_LINES[suffix],
                )
        axes.set_ylabel(
            "torque (N m)"
            if key == "torque"
            else "from its mean (mm)"
            if name in reading.LENGTHS
            else "angle (°)"
        )
        axes.set_title(name.replace("_", " "), loc="left")
    legend_below(figure, panels[0].get_legend_handles_labels()[0])


def _line(name: str, values: np.ndarray) -> np.ndarray:
    """In the unit that is shown: degrees; or mm about a straight line, which for the pelvis's way
    is its progress."""
    if name not in reading.LENGTHS:
        return np.asarray(np.degrees(values))
    i = np.arange(len(values))
    return np.asarray(
        1e3 * (values - np.polyval(np.polyfit(i, values, 1 if name == "pelvis_tx" else 0), i))
    )


@_drawn
def pareto_figure(figure: Figure, table: TuningTable) -> None:
    """The front of two costs."""
    points = [
        (row.fulcrum_mm, (row.first, row.second))
        for row in table.pareto
        if row.fulcrum_mm is not None and row.first is not None and row.second is not None
    ]
    first, second = (GIVEN_COSTS[name].heading for name in table.pareto_names)
    figure.set_size_inches(PANEL[0], 3.7)
    axes = figure.subplots()
    x, y = ([at[k] for _, at in points] for k in (0, 1))
    axes.plot(x, y, color=NEUTRAL, linewidth=1.0)
    wide, tall = (max(float(np.ptp(values or [0.0])), 1e-300) for values in (x, y))
    named: list[tuple[float, float]] = []
    for mm, (at_x, at_y) in points:
        axes.plot(at_x, at_y, "o", color=_colour(mm), markersize=7)
        # Points that are far enough from all named ones have a name of their own.
        if all(
            np.hypot((at_x - other_x) / wide, (at_y - other_y) / tall) > 0.08
            for other_x, other_y in named
        ):
            named.append((at_x, at_y))
            axes.annotate(
                f"{mm:.0f} mm", (at_x, at_y), xytext=(7, 5), textcoords="offset points", fontsize=8
            )
    axes.margins(x=0.17, y=0.1)
    axes.locator_params(axis="x", nbins=5)
    label(axes, x=first, y=second, title="Less of one costs more of the other")


@_drawn
def along_figure(figure: Figure, table: TuningTable) -> None:
    """The cost along the person's own answer, and under an equal load."""
    figure.set_size_inches(*PANEL)
    axes = figure.subplots()
    mm = [point.fulcrum_mm for point in table.along]
    cost = np.array([point.cost for point in table.along])
    wide = np.array([point.half_width or 0.0 for point in table.along])
    axes.fill_between(mm, cost - wide, cost + wide, color=SHADE, zorder=0)
    axes.plot(mm, cost, "o-", color="black", label="along the person's own answer")
    null = [
        (point.fulcrum_mm, point.equal_load)
        for point in table.along
        if point.equal_load is not None
    ]
    axes.plot(*np.array(null).reshape(-1, 2).T, "s:", color=NEUTRAL, label="under an equal load")
    axes.legend()
    label(axes, x=FULCRUM, y=f"cost ({GIVEN_COSTS[table.cost_name].unit})")


@_drawn
def robustness_figure(figure: Figure, table: TuningTable) -> None:
    """Where the optimum goes when something that is not known exactly is changed."""
    rows = [(row.what, row.fulcrum_mm) for row in table.robustness if row.fulcrum_mm is not None]
    ends = [row.fulcrum_mm for row in table.sweep]
    figure.set_size_inches(PANEL[0], 1.4 + 0.4 * len(rows))
    axes = figure.subplots()
    if table.fulcrum_interval_mm is not None:
        axes.axvspan(*table.fulcrum_interval_mm, color=SHADE, zorder=0)
    if table.fulcrum_mm is not None:
        axes.axvline(table.fulcrum_mm, color="black", linewidth=1.0, zorder=1)
    for place, (_, mm) in enumerate(rows):
        axes.plot(mm, place, "o", color=_colour(mm), markersize=7, zorder=2)
    axes.set_yticks(range(len(rows)), [textwrap.fill(what, 24) for what, _ in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)
    if ends:
        axes.set_xlim(min(ends) - 2.0, max(ends) + 2.0)
    label(axes, x=FULCRUM, y="", title="The optimum with one thing changed")
