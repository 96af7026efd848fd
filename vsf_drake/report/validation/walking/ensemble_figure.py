"""Curves over stance per condition, as in the paper's Figures 5 to 7: experiment solid, simulation dashed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsf_drake.report.style import MEASURED, NEUTRAL, SIMULATED, condition_colour, label, new_figure, style

PERCENT = np.linspace(0.0, 100.0, 101)
NAMES = {
    "resultant": ("resultant force", "resultant\nforce (BW)"), "vertical": ("vertical force", "vertical\nforce (BW)"),
    "fore_aft": ("fore-aft force (forward +)", "fore-aft\nforce (BW)"),
    "medio_lateral": ("medio-lateral force (left +)", "medio-lateral\nforce (BW)"),
    "impulse": ("impulse of the resultant", "impulse of the\nresultant (BW s)"),
    "cop": ("centre of pressure, fore-aft", "centre of pressure,\nahead of the plate's\nrearmost (foot lengths)"),
    "free_moment": ("free moment (up +)", "free moment\n(N m)")}
"""Quantities by key: how a sentence calls them, and the label of their axis."""


def ensemble_figure(
    table: Mapping[str, Any], arrays: Mapping[str, np.ndarray], quantities: Sequence[str], conditions: Sequence[int]
) -> Figure:
    """A row a quantity, a column a condition (indices in `table["conditions"]`); both must be among the arrays."""
    with style():
        figure = new_figure(10.5 if len(conditions) > 1 else 6.0, 0.7 + 2.1 * len(quantities))
        panels = figure.subplots(len(quantities), len(conditions), sharex=True, sharey="row", squeeze=False)
        bands = False
        for column, group in enumerate(conditions):
            condition = table["conditions"][group]
            for row, name in enumerate(quantities):
                axes = panels[row, column]
                bands |= _draw(axes, arrays, f"group_{group}_{name}", condition_colour(1e-3 * condition["fulcrum_mm"]))
                n = _count(table, group, name)
                head = f"{heading(condition)}, {n} walk{'s' * (n != 1)}" if row == 0 else ""
                label(axes, x="measured stance (%)" if row == len(quantities) - 1 else "",
                      y=NAMES[name][1] if column == 0 else "", title=head)
        panels[0, 0].set_xlim(0.0, 100.0)
        figure.legend(handles=_handles(table["synthetic"], bands), loc="outside lower center", ncols=4)
        figure.draw_without_rendering()
    return figure


def heading(condition: Mapping[str, Any]) -> str:
    """A condition's name in a title."""
    position = f"fulcrum {condition['fulcrum_mm']:g} mm"
    return f"{condition['name']}: {position}" if condition["name"] else position


def has_curves(arrays: Mapping[str, np.ndarray], group: int | str, quantity: str) -> bool:
    """Whether there is anything to draw of a quantity in a group."""
    curve = arrays.get(f"group_{group}_{quantity}_measured_mean")
    return curve is not None and bool(np.isfinite(np.asarray(curve, dtype=float)).any())


def _draw(axes: Axes, arrays: Mapping[str, np.ndarray], key: str, colour: Any) -> bool:
    """Whether there is a band."""
    axes.axhline(0.0, color="0.75", linewidth=0.7)
    if f"{key}_measured_mean" not in arrays:
        axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center", color="0.35")
        return False
    found = {name: np.asarray(arrays[f"{key}_{name}"], dtype=float)
             for name in ("measured_mean", "measured_sd", "model_mean", "model_sd")}
    band = bool(np.isfinite(found["measured_sd"]).any())
    if band:
        low, high = (found["measured_mean"] + sign * found["measured_sd"] for sign in (-1.0, 1.0))
        axes.fill_between(PERCENT, low, high, color=colour, alpha=0.22, linewidth=0.0)
        for sign in (-1.0, 1.0):
            axes.plot(PERCENT, found["model_mean"] + sign * found["model_sd"], color=colour, linewidth=0.8,
                      linestyle=":")
    axes.plot(PERCENT, found["measured_mean"], color=colour, **MEASURED)
    axes.plot(PERCENT, found["model_mean"], color=colour, **SIMULATED)
    return band


def _count(table: Mapping[str, Any], group: int, name: str) -> int:
    return next((len(d["labels"]) for d in table["differences"] if d["group"] == group and d["quantity"] == name), 0)


def _handles(synthetic: bool, bands: bool) -> list[Artist]:
    measured = "plate (SYNTHETIC)" if synthetic else "plate"
    found: list[Artist] = [Line2D([], [], color=NEUTRAL, label=f"{measured}, mean", **MEASURED),
                           Line2D([], [], color="0.2", label="simulated, mean", **SIMULATED)]
    if bands:
        found += [Patch(facecolor=NEUTRAL, alpha=0.3, linewidth=0.0, label=f"{measured}, ± SD"),
                  Line2D([], [], color="0.2", linewidth=0.8, linestyle=":", label="simulated, ± SD")]
    return found
