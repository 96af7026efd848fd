"""Level 2: the motion and the joint torques that go with the optimum, against the recorded ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vsf_drake.report.style import MEASURED, label, new_figure, style
from vsf_drake.report.tuning.cost_curve_figure import mark_origin

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
