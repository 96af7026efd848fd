"""Sobol indices: whose share of an output's variance is whose, by group and by factor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from vsf_drake.report.style import label, new_figure, style
from vsf_drake.report.validation.sensitivity.words import GROUPS, OUTPUTS, look, shown_outputs

_HEIGHT = 0.38


def indices_figure(table: Mapping[str, Any]) -> Figure:
    """First-order and total indices: a row of panels for groups, one for single factors; outputs side by side.

    Of groups or of factors at least one main output must have rows.
    """
    blocks = [(kind, shown_outputs(table[key])) for kind, key in (("group", "sobol"), ("factor", "sobol_factors"))]
    blocks = [(kind, names) for kind, names in blocks if names]
    across = max(len(names) for _, names in blocks)
    with style():
        figure = new_figure(11.0 if across > 1 else 6.5, 0.9 + 3.1 * len(blocks))
        panels = figure.subplots(len(blocks), across, squeeze=False)
        for line, (kind, names) in zip(panels, blocks, strict=True):
            for axes, name in zip(line, names, strict=False):
                _panel(axes, table, kind, name)
            for axes in line[len(names):]:
                axes.set_axis_off()
        handles = [Patch(facecolor="0.6", edgecolor="black", linewidth=0.5, label="first order: alone (coloured)"),
                   Patch(facecolor="white", edgecolor="black", linewidth=0.9, label="total: with all interactions"),
                   *(Patch(label=group, **look(group)) for group in GROUPS)]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
        if table["synthetic"]:
            figure.suptitle("SYNTHETIC trials, not recorded", x=0.01, ha="left", fontsize=11)
        figure.draw_without_rendering()
    return figure


def _panel(axes: Axes, table: Mapping[str, Any], kind: str, name: str) -> None:
    groups = {row["name"]: row["group"] for row in table["factors"]}
    rows = sorted(table["sobol" if kind == "group" else "sobol_factors"][name], key=lambda row: -row["st"])
    places = np.arange(len(rows))
    for place, row in zip(places, rows, strict=True):
        group = row["name"] if kind == "group" else groups[row["name"]]
        axes.barh(place - _HEIGHT / 2, max(row["s1"], 0.0), height=_HEIGHT, **look(group))
        axes.barh(place + _HEIGHT / 2, row["st"], height=_HEIGHT, facecolor="white", edgecolor="black", linewidth=0.9)
        for key, at in (("s1", place - _HEIGHT / 2), ("st", place + _HEIGHT / 2)):
            axes.plot(_interval(row, key), [at, at], color="black", linewidth=1.0, clip_on=False)
    axes.set_yticks(places, [row["name"] for row in rows], fontsize=8.0)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(left=0.0)
    axes.grid(False, axis="y")
    label(axes, x="share of the variance (1)", y=kind, title=OUTPUTS[name].name)


def _interval(row: Mapping[str, Any], key: str) -> Sequence[float]:
    return [max(row[key] - row[f"{key}_conf"], 0.0), max(row[key] + row[f"{key}_conf"], 0.0)]
