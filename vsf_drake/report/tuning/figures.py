"""What tuning found along the fulcrum, and the forces and the motion at its optimum, as figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsf_drake.report.style import MARKERS, MEASURED, NEUTRAL, SHADE, condition_colour, label, new_figure, style
from vsf_drake.report.tuning.words import NOT_OPTIMAL, recorded_positions, swept, swept_part

# The cost over the whole range of the fulcrum, where it is least, and what it is made of.


FULCRUM = "fulcrum from the keel's end (mm)"
_FAILED = "#b3261e"
_DASHES = ("-", "--", "-.", ":", (0, (6, 1.5, 1, 1.5)), (0, (1, 1)))


def cost_curve_figure(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Figure:
    """Left, the cost with its optimum; right, what each of its terms adds as the fulcrum leaves the optimum."""
    terms = [row for row in table["terms"] if len(swept_part(table, "terms", row["name"])[0])]
    with style():
        figure = new_figure(10.6 if len(terms) > 1 else 7.4, 4.3)
        panels = figure.subplots(1, 2 if len(terms) > 1 else 1, squeeze=False)[0]
        _cost(panels[0], table, arrays)
        if len(terms) > 1:
            _terms(panels[1], table, terms)
        for axes in panels:
            mark_positions(axes, table)
            axes.legend(loc="best", frameon=True, facecolor="white", edgecolor="none", framealpha=0.8)
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure


def mark_positions(axes: Axes, table: Mapping[str, Any], *, named: bool = True) -> None:
    """The interval of the optimum as a band, and lines where the fulcrum was recorded and where it ended."""
    interval = table["fulcrum_interval_mm"]
    if interval is not None and table["optimal"]:
        axes.axvspan(*interval, color=SHADE, zorder=0, label="its interval" if named else None)
    for i, mm in enumerate(recorded_positions(table)):
        axes.axvline(mm, color=NEUTRAL, linestyle=":", linewidth=1.2, zorder=1,
                     label="recorded" if named and not i else None)
    if table["fulcrum_mm"] is not None:
        colour = condition_colour(1e-3 * table["fulcrum_mm"]) if table["optimal"] else _FAILED
        axes.axvline(table["fulcrum_mm"], color=colour, linewidth=1.0, zorder=1)


def mark_origin(figure: Figure, table: Mapping[str, Any]) -> None:
    """Above a figure: that there is no optimum, that data are synthetic."""
    said = [*([NOT_OPTIMAL] if not table["optimal"] else []),
            *(["SYNTHETIC trials, not recorded"] if table["synthetic"] else [])]
    if said:
        figure.suptitle("; ".join(said), x=0.01, ha="left", fontsize=10.5,
                        color=_FAILED if not table["optimal"] else "black")


def every(x: np.ndarray) -> int:
    """How many points of a curve share a marker, so that there are about twenty."""
    return max(1, round(len(x) / 20))


def _cost(axes: Axes, table: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    x, y = swept(table)
    x_of, trials = arrays.get("sweep_mm"), arrays.get("sweep_cost_trials")
    if x_of is not None and trials is not None and np.shape(trials)[1] > 1:
        own = np.asarray(trials, dtype=float).T
        at = int(np.argmin(np.abs(np.asarray(x_of) - (table["fulcrum_mm"] or np.median(x_of)))))
        mean = own.mean(axis=0)
        for i, values in enumerate(own):
            axes.plot(x_of, values - values[at] + mean[at], color="0.75", linewidth=0.9, zorder=1,
                      label="one trial, shifted" if i == 0 else None)
    axes.plot(x, y, color="black", linewidth=1.8, marker="o", markersize=3.5, markevery=every(x), label="cost")
    if table["fulcrum_mm"] is not None and table["cost"] is not None:
        if table["optimal"]:
            axes.plot(table["fulcrum_mm"], table["cost"], marker="*", markersize=15, color="white", linestyle="",
                      markeredgecolor=condition_colour(1e-3 * table["fulcrum_mm"]), markeredgewidth=1.6, zorder=5,
                      label=f"optimum, {table['fulcrum_mm']:.1f} mm")
        else:
            axes.plot(table["fulcrum_mm"], table["cost"], marker="x", markersize=11, color=_FAILED, linestyle="",
                      markeredgewidth=2.4, zorder=5, label=f"last iterate, {NOT_OPTIMAL}")
    label(axes, x=FULCRUM, y=f"{table['cost_label']} ({table['cost_unit']})", title="Cost over the whole range")


def _terms(axes: Axes, table: Mapping[str, Any], terms: list[Mapping[str, Any]]) -> None:
    axes.axhline(0.0, color="0.4", linewidth=0.8)
    for i, row in enumerate(terms):
        x, y = swept_part(table, "terms", row["name"])
        here = row["value"] if row["value"] is not None else float(y.min())
        axes.plot(x, y - here, color=f"{0.08 + 0.5 * i / len(terms):.2f}", linewidth=1.6, linestyle=_DASHES[i % 6],
                  marker=MARKERS[i % len(MARKERS)], markersize=3.5, markevery=every(x), label=row["label"])
    label(axes, x=FULCRUM, y=f"change from the optimum ({table['cost_unit']})", title="What each term adds")


# Ground reaction forces at the optimum: against the recorded ones, and simulated again with the full keel.


FEET = {"prosthetic": "prosthetic foot", "intact": "intact foot"}
_LINES: dict[str, tuple[str, dict[str, Any]]] = {
    "_recorded": ("recorded", {"color": "0.45", **MEASURED}),
    "": ("optimised", {"color": "black", "linewidth": 1.5}),
    "_resimulated_prescribed": ("simulated again, motion prescribed",
                                {"color": "#1f6f8b", "linewidth": 1.4, "linestyle": (0, (4, 1.6))}),
    "_resimulated_feedback": ("simulated again, torques and feedback",
                              {"color": "#b35900", "linewidth": 1.4, "linestyle": (0, (1, 1))})}
_DIRECTIONS = ("fore-aft", "vertical")
SETTINGS = ("softest", "optimum", "stiffest")
_FORCE_DASHES = {"softest": (0, (1, 1)), "optimum": "-", "stiffest": (0, (5, 2))}


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
    """Level 1: the prosthetic foot's force in up to three trials, at three settings and as recorded."""
    shown = drawn_trials(table, arrays)
    at = dict(zip(SETTINGS, (_end(table, min), table["fulcrum_mm"], _end(table, max)), strict=True))
    with style():
        figure = new_figure(10.6, 0.9 + 2.7 * len(shown))
        panels = figure.subplots(len(shown), 2, squeeze=False)
        for row, (trial, prefix) in zip(panels, shown.items(), strict=True):
            for axes, column, direction in zip(row, (0, 2), _DIRECTIONS, strict=True):
                for name in ("recorded", *SETTINGS):
                    if f"{prefix}{name}" in arrays:
                        axes.plot(arrays[f"{prefix}time"], np.asarray(arrays[f"{prefix}{name}"])[:, column],
                                  **_look(name, at.get(name), optimal=table["optimal"]))
                label(axes, x="time (s)", y="force (N)", title=f"{trial + ': ' if trial else ''}{direction}")
        figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure


def drawn_trials(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> dict[str, str]:
    """Up to three trials of a level 1 tuning whose forces there are: what their arrays begin with, by label.

    One without a label where the arrays do not tell trials apart.
    """
    found = {str(name): f"trial_{i}_" for i, name in enumerate(table["trials"])}
    found = {name: prefix for name, prefix in found.items() if _known(arrays, prefix)}
    if not found:
        return {"": "grf_"} if _known(arrays, "grf_") else {}
    names = list(found)
    return {name: found[name] for name in dict.fromkeys((names[0], names[len(names) // 2], names[-1]))}


def _known(arrays: Mapping[str, Any], prefix: str) -> bool:
    return f"{prefix}time" in arrays and any(f"{prefix}{name}" in arrays for name in SETTINGS)


def _look(name: str, mm: float | None, *, optimal: bool) -> dict[str, Any]:
    if name == "recorded":
        return {"color": "0.45", "label": "recorded", **MEASURED}
    called = name if optimal or name != "optimum" else "last iterate"
    return {"color": condition_colour(None if mm is None else 1e-3 * mm), "linestyle": _FORCE_DASHES[name],
            "linewidth": 1.4,
            "label": called if mm is None else f"{called}, {mm:.0f} mm"}


def _end(table: Mapping[str, Any], which: Any) -> float | None:
    return which((row["fulcrum_mm"] for row in table["sweep"]), default=None)


# Level 2: the motion and the joint torques that go with the optimum, against the recorded ones.


_OWN: dict[str, Any] = {"color": "black", "linewidth": 1.5}
_RECORDED: dict[str, Any] = {"color": "0.45", **MEASURED}
_LENGTHS = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
TORQUES = 5
"""Coordinates with a torque: the last ones."""


def motion_figure(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Figure:
    """Coordinates over the gait cycle; `arrays` has `phase`, `q`, `names`, and perhaps `q_recorded`."""
    names = [str(name) for name in arrays["names"]]
    series = [_course(name, np.asarray(arrays[key])[:, i]) for key in ("q", "q_recorded") if key in arrays
              for i, name in enumerate(names)]
    count = len(names)
    titles = [name.replace("_", " ") for name in names]
    units = ["from its mean (mm)" if name in _LENGTHS else "angle (°)" for name in names]
    return _small(table, arrays["phase"], series[:count], series[count:], titles, units)


def torque_figure(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Figure:
    """Joint torques over the gait cycle; `arrays` has `phase`, `torque` and perhaps `torque_recorded`."""
    own = [np.asarray(column) for column in np.asarray(arrays["torque"]).T]
    known = arrays.get("torque_recorded")
    recorded = [] if known is None else [np.asarray(column) for column in np.asarray(known).T]
    names = [str(name) for name in arrays.get("names", ())][-len(own):] or [f"torque {i + 1}" for i in range(len(own))]
    return _small(table, arrays["phase"], own, recorded, [name.replace("_", " ") for name in names],
                  ["torque (N m)"] * len(own))


def root_mean_squares(arrays: Mapping[str, Any], key: str) -> np.ndarray | None:
    """Of the differences of `key` and its recorded counterpart, column by column; None where one is missing."""
    own, recorded = arrays.get(key), arrays.get(f"{key}_recorded")
    if own is None or recorded is None or np.shape(own) != np.shape(recorded):
        return None
    found: np.ndarray = np.sqrt(np.mean((np.asarray(own) - np.asarray(recorded)) ** 2, axis=0))
    return found


def _course(name: str, values: np.ndarray) -> np.ndarray:
    """In the unit that is shown: degrees; or mm about a straight line, which for the pelvis's way is its progress."""
    if name not in _LENGTHS:
        return np.degrees(values)
    line = np.polyval(np.polyfit(np.arange(len(values)), values, 1 if name == "pelvis_tx" else 0),
                      np.arange(len(values)))
    found: np.ndarray = 1e3 * (values - line)
    return found


def _small(
    table: Mapping[str, Any], phase: np.ndarray, own: Sequence[np.ndarray], recorded: Sequence[np.ndarray],
    titles: Sequence[str], units: Sequence[str]
) -> Figure:
    across = 4 if len(own) > 6 else 3
    down = -(-len(own) // across)
    with style():
        figure = new_figure(10.6, 0.6 + 2.3 * down)
        panels = figure.subplots(down, across, sharex=True, squeeze=False).ravel()
        for i, (axes, values) in enumerate(zip(panels, own, strict=False)):
            if recorded:
                axes.plot(100.0 * np.asarray(phase), recorded[i], label="recorded", **_RECORDED)
            axes.plot(100.0 * np.asarray(phase), values, label="optimised", **_OWN)
            label(axes, x="", y=units[i], title=titles[i])
        for axes in panels[len(own):]:
            axes.set_axis_off()
        for axes in panels[max(len(own) - across, 0):len(own)]:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel("gait cycle (%)")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
        mark_origin(figure, table)
        figure.draw_without_rendering()
    return figure
