"""The report's chapter on rolling over: walking, the ISO 22675 profile, and inclined loading."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from vsf_drake.report.page import Chapter
from vsf_drake.report.style import (
    MEASURED,
    NEUTRAL,
    PANEL,
    SIMULATED,
    Arrays,
    colour_of,
    drawing,
    entry,
    label,
    name_of,
    tag,
)
from vsf_drake.report.validation.panels import mark, plate_name, section_chapter
from vsf_drake.walks.numbers import by_fulcrum, cells, known, spread

if TYPE_CHECKING:
    from vsf_drake.device.inclined import InclinedRow
    from vsf_drake.device.roll_over import Iso, IsoRow
    from vsf_drake.validation.roll_over_section import RollOverTable

_PANELS = (
    ("radius_m", 1e3, "radius", "(mm)"),
    ("effective_foot_length_ratio", 1.0, "effective /\nfoot length", "(ratio)"),
    ("mean_moment_arm_m", 1e3, "mean\nmoment arm", "(mm)"),
)
_WITH_FRICTION = ("deflection_forefoot_mm", "radius_m", "dorsiflexing_moment_nm")
_ISO = (
    ("force_n", "(N)", "Force along the line"),
    ("deflection_mm", "(mm)", "Deflection"),
    ("moment_nm", "(N m)", "Moment, toe up +"),
    ("strain_j", "(J)", "Stored energy"),
)


def roll_over_chapter(table: RollOverTable, arrays: Arrays) -> Chapter:
    """The chapter of a saved section (`validation.roll_over_section`)."""
    iso = table.iso
    figures: dict[str, Figure] = {}
    if table.walks:
        figures |= {
            "roll_over_shapes": _shape_figure(table, arrays),
            "roll_over_measures": _measures_figure(table),
        }
    if iso.positions:
        figures["iso_22675_profile"] = _iso_figure(iso, arrays)
    if table.inclined:
        figures["inclined_loading"] = _inclined_figure(table.inclined, arrays)
    conditions = table.conditions
    at_one_position = by_fulcrum(table.walks).values()
    rough = [
        (row, other)
        for row in iso.positions
        for other in iso.with_friction
        if row.fulcrum_mm == other.fulcrum_mm
    ]
    return section_chapter(
        "roll_over",
        table,
        figures,
        off=_sizes(row.off("radius_m") for row in conditions),
        off_after_heel=_sizes(row.off("radius_after_heel_m") for row in conditions),
        after_heel=[row for row in conditions if row.off("radius_after_heel_m") is not None],
        heel_apart_mm=_means_mm([walk.heel_apart_m for walk in own] for own in at_one_position),
        later_apart_mm=_means_mm([walk.later_apart_m for walk in own] for own in at_one_position),
        condition_rows=[
            {
                "fulcrum_mm": row.fulcrum_mm,
                "source": words,
                "footfalls": means["radius_m"].n,
                **cells(means, "_mean"),
            }
            for row in table.conditions
            for means, words in ((row.measured, "plate"), (row.model, "model"))
        ],
        followed=[
            {**vars(row), "follows": "yes" if row.follows else "NO"} for row in iso.positions
        ],
        rough=rough,
        changes={name: _percents(rough, name) for name in _WITH_FRICTION},
        inclined_rows=[
            {**vars(row), "zones": ", ".join(row.zones_loaded).replace("_", " ")}
            for row in table.inclined
        ],
    )


def _sizes(values: Iterable[float | None]) -> np.ndarray:
    """Of those that are known."""
    return np.asarray(np.abs(known(values)))


def _means_mm(groups: Iterable[Iterable[float | None]]) -> np.ndarray:
    """Of the groups of which something is known."""
    return 1e3 * known(spread(group).mean for group in groups)


def _percents(pairs: Sequence[tuple[IsoRow, IsoRow]], name: str) -> np.ndarray:
    """By how many percent a number of the second is larger, where both are known."""
    numbers = np.array([[getattr(row, name) for row in pair] for pair in pairs], dtype=float)
    first, second = numbers.reshape(-1, 2).T
    return known(100.0 * (second / first - 1.0))


def _inclined_figure(rows: Sequence[InclinedRow], arrays: Arrays) -> Figure:
    """Load and displacement of the foot pressed at an angle."""
    with drawing(*PANEL) as figure:
        heel, forefoot = figure.subplots(1, 2, width_ratios=(1.0, 1.6), sharey=True)
        for i, row in enumerate(rows):
            sign = "plus" if row.angle_deg > 0.0 else "minus"
            name = f"inclined_{sign}{abs(row.angle_deg):.0f}_{row.fulcrum_mm:.0f}"
            load = arrays[f"{name}_load_n"]
            top = int(np.argmax(load))
            x = 1e3 * arrays[f"{name}_displacement_m"][: top + 1]
            colour = colour_of(row.fulcrum_mm)
            axes = forefoot if sign == "plus" else heel
            axes.plot(x, load[: top + 1], color=colour, **SIMULATED)
            if axes is forefoot:
                offset = (0, 4 + 9 * (i % 2))
                tag(
                    axes,
                    f"{row.fulcrum_mm:g}",
                    (x[-1], load[top]),
                    colour,
                    ha="center",
                    offset=offset,
                )
        for axes, y, title in ((heel, "load (N)", "Heel, -15°"), (forefoot, "", "Forefoot, +20°")):
            axes.set_xlim(left=0.0)
            axes.margins(y=0.15)
            axes.set_ylim(bottom=0.0)
            label(axes, x="displacement (mm)", y=y, title=title)
    return figure


def _iso_figure(iso: Iso, arrays: Arrays) -> Figure:
    """The foot under the ISO 22675 loading profile: the force, and how the foot answers at each
    position."""
    with drawing(PANEL[0], 1.5 * PANEL[1]) as figure:
        panels = figure.subplots(2, 2, sharex=True).ravel()
        time = 1e3 * arrays["iso_time_s"]
        panels[0].plot(time, arrays["iso_wanted_n"], color=NEUTRAL, **MEASURED)
        for axes, (what, unit, title) in zip(panels, _ISO, strict=True):
            for row in iso.positions:
                curve = arrays[f"iso_{row.fulcrum_mm:.0f}_{what}"]
                axes.plot(time, curve, color=colour_of(row.fulcrum_mm), **SIMULATED)
            label(axes, x="time (ms)" if axes in panels[2:] else "", y=unit, title=title)
        handles = [entry("profile", color=NEUTRAL, **MEASURED)]
        handles += [
            entry(name_of(row.fulcrum_mm), color=colour_of(row.fulcrum_mm), **SIMULATED)
            for row in iso.positions
        ]
        figure.legend(handles=handles, loc="lower center", ncols=2)
    return figure


def _shape_figure(table: RollOverTable, arrays: Arrays) -> Figure:
    """Roll-over shapes in walking, plate beside model: the mean over a condition's footfalls."""
    with drawing(PANEL[0], 0.8 * PANEL[1]) as figure:
        axes = figure.subplots()
        for condition in table.conditions:
            fulcrum = condition.fulcrum_mm
            ends = list[tuple[float, float]]()
            own = [f"walk_{i}" for i, row in enumerate(table.walks) if row.fulcrum_mm == fulcrum]
            for side, look in (("measured", MEASURED), ("model", SIMULATED)):
                # where all are known, else NaN
                forward, up = (
                    1e3 * np.mean([arrays[f"{name}_{side}_{axis}_m"] for name in own], axis=0)
                    for axis in ("forward", "up")
                )
                axes.plot(forward, up, color=colour_of(fulcrum), **look)
                ends += [(x, y) for x, y in zip(forward, up, strict=True) if np.isfinite(x)][-1:]
            if ends:
                tag(axes, f"{fulcrum:g}", max(ends), colour_of(fulcrum), offset=(4, 2))
        axes.plot([], [], color=NEUTRAL, label=plate_name(table.synthetic), **MEASURED)
        axes.plot([], [], color=NEUTRAL, label="model", **SIMULATED)
        axes.margins(x=0.1, y=0.5)
        axes.set_aspect("equal", adjustable="datalim")
        axes.legend(loc="upper left", ncols=2)
        label(axes, x="forward of the pylon's axis (mm)", y="above its end (mm)")
    return figure


def _measures_figure(table: RollOverTable) -> Figure:
    """What describes the shapes, by fulcrum position: every footfall."""
    with drawing(PANEL[0], 0.9 * PANEL[1]) as figure:
        panels = figure.subplots(1, len(_PANELS))
        for axes, (name, scale, title, unit) in zip(panels, _PANELS, strict=True):
            for side, marker, shift in (("measured", "o", 4.0), ("model", "D", -4.0)):
                for row in table.walks:
                    value = getattr(getattr(row, side), name)
                    look = mark(colour_of(row.fulcrum_mm), side == "measured", marker, markersize=6)
                    if value is not None:
                        axes.plot(row.fulcrum_mm + shift, scale * value, **look)
            axes.margins(x=0.2, y=0.15)
            label(axes, x="fulcrum (mm)", y=unit, title=title)
        handles = [
            entry(plate_name(table.synthetic), **mark(NEUTRAL, True)),
            entry("model", **mark(NEUTRAL, False, "D")),
        ]
        figure.legend(handles=handles, loc="lower center", ncols=2)
    return figure
