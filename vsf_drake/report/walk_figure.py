"""A simulated walk beside its force plate in six panels; a function of saved results."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsf_drake.analysis.comparison import PERCENT, Comparison, Plate, compare
from vsf_drake.report.style import (
    MARKERS,
    MEASURED,
    NEUTRAL,
    SHADE,
    SIMULATED,
    condition_colour,
    condition_label,
    drawing,
    label,
)
from vsf_drake.simulation.results import WalkResult

_ZONE_LINES = ("-", (0, (4, 1.6)), (0, (1, 1)), (0, (6, 1.5, 1, 1.5)), (0, (2, 2)))
TITLE_WIDTH = 110
"""Letters on a line of the title: what the figure is wide enough for."""
MOST_LABELLED = 4
"""Stances that the legend tells apart; a longer recording shows its footprints without one."""


def walk_figure(result: WalkResult, plate: Plate, metrics: Mapping[str, Any]) -> Figure:
    """The figure of a finished walk: forces, centre of pressure and the load of each zone.

    Forces are those that the metrics score (40 Hz, time-locked). Stances that the simulated time
    cuts are shaded. A synthetic trial is called so in the title.

    Args:
        plate: the plate under the prosthetic foot.
        metrics: `walk_metrics(result, plate)`.
    """
    comparison = compare(result, plate)
    model, measured = (force / metrics["body_weight_n"] for force in (comparison.model, comparison.measured))
    fulcrum = float(np.median(result.fulcrum_m))
    colour = condition_colour(fulcrum)
    kind = "synthetic walk, not recorded" if result.synthetic else "recorded walk"
    state = "" if result.converged else f", {result.unconverged_steps} STEPS NOT CONVERGED"
    with drawing(11.0, 8.2) as figure:
        panels = figure.subplots(3, 2)
        for axes, name, column, error in (
                (panels[0, 0], "Resultant", None, metrics["grf_rmse_bw"]),
                (panels[0, 1], "Vertical", 2, metrics["vertical_rmse_bw"]),
                (panels[1, 0], "Fore-aft (forward +)", 0, metrics["fore_aft_rmse_bw"]),
                (panels[1, 1], "Medio-lateral (left +)", 1, metrics["medio_lateral_rmse_bw"])):
            _shade(axes, comparison)
            for force, look in ((measured, MEASURED), (model, SIMULATED)):
                shown = np.linalg.norm(force, axis=1) if column is None else force[:, column]
                axes.plot(comparison.time_s, shown, color=colour, **look)
            label(axes, x="time (s)", y="force (BW)", title=name + _error(error, "BW"))
            axes.set_xlim(comparison.time_s[0], comparison.time_s[-1])
        _centre_of_pressure(panels[2, 0], result, comparison, metrics, colour)
        _zones(panels[2, 1], result, comparison)
        handles: list[Artist] = [
            Line2D([], [], color=colour, label="reference (synthetic)" if result.synthetic else "force plate",
                   **MEASURED),
            Line2D([], [], color=colour, label="simulated", **SIMULATED),
            Line2D([], [], color=NEUTRAL, linewidth=0.7, linestyle=":", label="scored: stance ± 0.25 s")]
        if not all(item.inside for item in comparison.stances):
            handles.append(Patch(facecolor=SHADE, edgecolor=NEUTRAL, linewidth=0.6,
                                 label="stance cut by the simulated time"))
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
        title = f"{result.trial_name}: {kind}, {result.side} prosthesis, {condition_label(fulcrum)}{state}"
        figure.suptitle(textwrap.fill(title, TITLE_WIDTH), x=0.01, ha="left", fontsize=11)
    return figure


def zone_loads(result: WalkResult) -> dict[str, np.ndarray]:
    """Zone -> (n,) normal force (N) summed over its spheres; one entry `all spheres` where zones are unknown."""
    names = np.array(result.sphere_zones)
    if len(names) != result.sphere_normal_n.shape[1]:
        return {"all spheres": result.sphere_normal_n.sum(axis=1)}
    return {zone: result.sphere_normal_n[:, names == zone].sum(axis=1) for zone in dict.fromkeys(result.sphere_zones)}


def _error(value: float | None, unit: str) -> str:
    return "" if value is None else f", RMSE {value:.3f} {unit}"


def _shade(axes: Axes, comparison: Comparison) -> None:
    """Shades the stances that the simulated time cuts and marks the ends of what is scored."""
    axes.axhline(0.0, color="0.7", linewidth=0.8)
    for item in comparison.stances:
        if not item.inside:
            start, end = (np.clip(t, *comparison.time_s[[0, -1]]) for t in (item.measured.start_s, item.measured.end_s))
            axes.axvspan(start, end, color=SHADE, linewidth=0.0, zorder=0)
        for instant in item.span:
            axes.axvline(instant, color=NEUTRAL, linewidth=0.7, linestyle=":")


def _centre_of_pressure(axes: Axes, result: WalkResult, comparison: Comparison, metrics: Mapping[str, Any],
                        colour: Any) -> None:
    """Fore-aft centre of pressure in foot lengths ahead of the plate's rearmost one in each footprint."""
    several = len(comparison.stances) > 1
    for number, item in enumerate(comparison.stances, start=1):
        known = np.isfinite(item.measured_cop[:, 0])
        if not known.any():
            continue
        origin = item.measured_cop[known, 0].min()
        measured = (item.measured_cop[:, 0] - origin) / result.foot_length_m
        model = (item.model_cop[:, 0] - origin) / result.foot_length_m
        axes.plot(PERCENT, measured, color=colour, **MEASURED)
        axes.plot(PERCENT, model, color=colour, marker=MARKERS[number % len(MARKERS)] if several else "",
                  markevery=(5 * number, 12), markersize=4.5, label=f"stance {number}, simulated", **SIMULATED)
    if not metrics["cop_points"]:
        axes.text(0.5, 0.5, "no centre of pressure in common", transform=axes.transAxes, ha="center", color="0.35")
    if 1 < len(axes.get_legend_handles_labels()[0]) <= MOST_LABELLED:
        axes.legend(loc="upper left")
    axes.set_xlim(0.0, 100.0)
    label(axes, x="measured stance (%)", y="ahead of the plate's\nrearmost point (foot lengths)",
          title="Centre of pressure along the foot" + _error(metrics["cop_rmse_fl"], "FL"))


def _zones(axes: Axes, result: WalkResult, comparison: Comparison) -> None:
    _shade(axes, comparison)
    loads = zone_loads(result)
    for i, (zone, load) in enumerate(loads.items()):
        shade = str(0.05 + 0.5 * i / max(1, len(loads) - 1))
        axes.plot(result.time_s, load, color=shade, linewidth=1.3, linestyle=_ZONE_LINES[i % len(_ZONE_LINES)],
                  label=zone.replace("_", " "))
    axes.set_xlim(comparison.time_s[0], comparison.time_s[-1])
    axes.legend(loc="best", ncols=2)
    label(axes, x="time (s)", y="normal force (N)", title="Simulated load of the zones of the sole, unfiltered")
