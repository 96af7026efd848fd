"""The report's chapter on rolling over: walking, the ISO 22675 profile, and inclined loading."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from vsf_drake.report.page import Chapter
from vsf_drake.report.style import (
    MARKERS,
    MEASURED,
    NEUTRAL,
    SIMULATED,
    Arrays,
    colour_of,
    drawing,
    label,
    name_of,
)

if TYPE_CHECKING:
    from vsf_drake.analysis.validation.roll_over_section import InclinedRow, Iso, RollOverTable

_SECOND_PEAK_MS = 447.5
_PANELS = (("radius_m", 1e3, "arc radius (mm)"), ("effective_foot_length_ratio", 1.0, "effective / foot length (1)"),
           ("mean_moment_arm_m", 1e3, "mean moment arm (mm)"))


def roll_over_chapter(table: RollOverTable, arrays: Arrays) -> Chapter:
    """The chapter of a saved section (`analysis.validation.roll_over_section`)."""
    iso, inclined = table.iso, table.inclined
    pairs = [(row, other) for row in iso.positions for other in iso.with_friction if row.fulcrum_mm == other.fulcrum_mm]
    facts = {
        "condition_rows": [
            {"fulcrum_mm": row.fulcrum_mm, "source": words, "footfalls": means["radius_m"].n,
             **{f"{name}_{what}": getattr(own, what) for what in ("mean", "sd") for name, own in means.items()}}
            for row in table.conditions for means, words in ((row.measured, "plate"), (row.model, "model"))],
        "iso_ends": [*iso.positions[:1], *iso.positions[1:][-1:]],
        "followed": [{**vars(row), "follows": "yes" if row.follows else "NO"} for row in iso.positions],
        "changes": {name: [100.0 * (getattr(other, name) / getattr(row, name) - 1.0) for row, other in pairs
                           if getattr(row, name) is not None and getattr(other, name) is not None]
                    for name in ("deflection_forefoot_mm", "radius_m", "dorsiflexing_moment_nm")},
        "sliding_j": [other.lost_by_sliding_j for _, other in pairs],
        "inclined_ends": [(words, own[0], own[-1]) for angle, words in ((-15.0, "heel"), (20.0, "forefoot"))
                          if (own := [row for row in inclined if row.angle_deg == angle])],
        "inclined_rows": [{**vars(row), "zones": ", ".join(row.zones_loaded).replace("_", " ")} for row in inclined]}
    figures = {}
    if table.walks:
        figures["roll_over_shapes"] = _shape_figure(table, arrays)
    if iso.positions:
        figures["iso_22675_profile"] = _iso_figure(iso, arrays)
    if inclined:
        figures["inclined_loading"] = _inclined_figure(inclined, arrays)
    return Chapter(name="roll-over", title="Roll-over and inclined loading", template="validation/roll_over.html.j2",
                   facts={**vars(table), **facts}, figures=figures)


def _inclined_figure(rows: Sequence[InclinedRow], arrays: Arrays) -> Figure:
    """Load and displacement of the foot pressed at an angle."""
    with drawing(10.5, 3.9) as figure:
        for axes, sign, title, place in zip(figure.subplots(1, 2, width_ratios=(1.0, 1.3)), ("minus", "plus"), (
                "Heel, -15°", "Forefoot, +20°"), ("upper left", "lower right"), strict=True):
            own = [row for row in rows if (row.angle_deg > 0.0) == (sign == "plus")]
            for i, row in enumerate(own):
                name = f"inclined_{sign}{abs(row.angle_deg):.0f}_{row.fulcrum_mm:.0f}"
                load = arrays[f"{name}_load_n"]
                loading = slice(0, int(np.argmax(load)) + 1)
                axes.plot(1e3 * arrays[f"{name}_displacement_m"][loading], load[loading],
                          color=colour_of(row.fulcrum_mm), label=name_of(row.fulcrum_mm), markersize=4,
                          marker=MARKERS[i % len(MARKERS)], markevery=(8 + 4 * i, 22), **SIMULATED)
            axes.set_xlim(left=0.0)
            axes.set_ylim(bottom=0.0)
            label(axes, x="displacement (mm)", y="load (N)", title=title)
            if own:
                axes.legend(loc=place)
    return figure


def _iso_figure(iso: Iso, arrays: Arrays) -> Figure:
    """The foot under the ISO 22675 loading profile: what is prescribed, and how the foot answers at each position."""
    with drawing(10.5, 6.4) as figure:
        (force, tilt, deflection), (shape, moment, strain) = figure.subplots(2, 3)
        time = 1e3 * arrays["iso_time_s"]
        rolled = time <= _SECOND_PEAK_MS
        force.plot(time, arrays["iso_wanted_n"], color=NEUTRAL, label="profile", **MEASURED)
        tilt.plot(time, arrays["iso_tilt_deg"], color=NEUTRAL, linewidth=1.8)
        tilt.axhline(0.0, color=NEUTRAL, linewidth=0.6)
        for i, row in enumerate(iso.positions):
            name = f"iso_{row.fulcrum_mm:.0f}"
            look: dict[str, Any] = {
                **SIMULATED, "color": colour_of(row.fulcrum_mm), "label": name_of(row.fulcrum_mm),
                "marker": MARKERS[i % len(MARKERS)], "markersize": 4, "markevery": (12 * (i + 1), 60)}
            force.plot(time, arrays[f"{name}_force_n"], **(look | {"label": "foot" if i == 0 else None}))
            for axes, what in ((deflection, "deflection_mm"), (moment, "moment_nm"), (strain, "strain_j")):
                axes.plot(time, arrays[f"{name}_{what}"], **look)
            forward, up = (1e3 * arrays[f"{name}_cop_{axis}_m"] for axis in ("forward", "up"))
            shape.plot(forward[rolled], up[rolled], **look)
            shape.plot(forward[~rolled], up[~rolled], color=look["color"], linewidth=0.7, linestyle=":")
        shape.plot(0.0, 0.0, "+", color=NEUTRAL, markersize=9)
        shape.set_aspect("equal", adjustable="datalim")
        for axes, y, title in (
                (force, "force along the fixed line (N)", "Force: profile, and what the foot bears"),
                (tilt, "tilt of the platform (deg)", "Tilt (below zero: heel)"),
                (deflection, "deflection (mm)", "Deflection along the line of force"),
                (moment, "moment at the pylon's end (N m)", "Moment (positive: toe up)"),
                (strain, "stored energy (J)", "Energy stored in keel and foam")):
            label(axes, x="time (ms)", y=y, title=title)
        label(shape, x="forward of the pylon's axis (mm)", y="above the pylon's end (mm)",
              title="Centre of pressure seen from the pylon")
        force.legend(loc="lower center")
        deflection.legend(loc="upper left")
    return figure


def _shape_figure(table: RollOverTable, arrays: Arrays) -> Figure:
    """Roll-over shapes in walking, plate beside model, and what describes them by fulcrum position."""
    with drawing(10.5, 6.6) as figure:
        grid = figure.add_gridspec(2, 3, height_ratios=(1.25, 1.0))
        shapes = figure.add_subplot(grid[0, :])
        for i, condition in enumerate(table.conditions):
            fulcrum = condition.fulcrum_mm
            own = [f"walk_{i}" for i, row in enumerate(table.walks) if row.fulcrum_mm == fulcrum]
            for side, look, words in (("measured", MEASURED, "plate"), ("model", SIMULATED, "model")):
                # where all are known, else NaN
                forward, up = (1e3 * np.mean([arrays[f"{name}_{side}_{axis}_m"] for name in own], axis=0)
                               for axis in ("forward", "up"))
                if np.isfinite(forward).any():
                    shapes.plot(forward, up, color=colour_of(fulcrum), marker=MARKERS[i % len(MARKERS)],
                                markersize=4.5, markevery=(3 + 2 * i, 9), **look, label=f"{name_of(fulcrum)}, {words}")
        shapes.plot(0.0, 0.0, "+", color=NEUTRAL, markersize=10, label="end of the pylon")
        shapes.set_aspect("equal", adjustable="datalim")
        shapes.legend(loc="upper right", ncols=2)
        label(shapes, x="forward of the pylon's axis (mm)", y="above the pylon's end (mm)",
              title="Centre of pressure seen from the shank, mean of the footfalls, "
                    "heel strike to the end of the shape")
        for i, (name, scale, words) in enumerate(_PANELS):
            axes = figure.add_subplot(grid[1, i])
            for side, marker, said, shift in (("measured", "o", "plate", 2.0), ("model", "D", "model", -2.0)):
                for row in table.walks:
                    value = getattr(row.measured if side == "measured" else row.model, name)
                    colour = colour_of(row.fulcrum_mm)
                    if value is not None:
                        axes.plot(row.fulcrum_mm + shift, scale * value, marker, markersize=6, color=colour,
                                  markerfacecolor=colour if side == "measured" else "white")
                axes.plot([], [], marker, color=NEUTRAL, markerfacecolor=NEUTRAL if side == "measured" else "white",
                          label=said)
            axes.margins(x=0.12, y=0.15)
            if i == 0:
                axes.legend(loc="best")
            label(axes, x="fulcrum position (mm)", y=words)
    return figure
