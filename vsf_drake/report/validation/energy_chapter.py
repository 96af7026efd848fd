"""The report's chapter on energy storage and return: a function of the saved section."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from vsf_drake.base.files import plain
from vsf_drake.report.page import Chapter
from vsf_drake.report.style import (
    NEUTRAL,
    PANEL,
    SIMULATED,
    Arrays,
    colour_of,
    drawing,
    entry,
    label,
    legend_below,
    name_of,
    say_synthetic,
)
from vsf_drake.report.validation.panels import mark, section_chapter
from vsf_drake.walks.numbers import by_fulcrum, spread

if TYPE_CHECKING:
    from vsf_drake.validation.energy_section import (
        EnergyCondition,
        EnergyRow,
        EnergyTable,
        MovedRow,
    )

_WORDS = {
    "limb_work": "work of the limb",
    "kinetic": "kinetic",
    "gravity": "gravity",
    "bushing_strain": "socket, strain",
    "keel_strain": "keel, strain",
    "foam_strain": "foam, strain",
    "fulcrum_strain": "fulcrum, strain",
    "bushing_loss": "socket, damping",
    "keel_loss": "keel, damping",
    "foam_loss": "foam, damping",
    "friction_loss": "friction",
    "fulcrum_loss": "fulcrum, damping",
    "remainder": "remainder",
}
"""Terms of the energy balance in words, in the order in which they are shown."""
_KINDS = (("stored_j", "stored", True), ("returned_j", "returned", False))
"""Energies over the fulcrum's position: key, name, and whether its marks are full."""
_STORES = (
    ("keel_strain", "keel", 0.85, ""),
    ("fulcrum_strain", "fulcrum", 0.5, "////"),
    ("foam_strain", "foam", 0.2, ""),
)
_DOTTED: dict[str, Any] = {"linestyle": (0, (1, 1))}
_LOST = _DOTTED | {"linewidth": 1.4}
_LOSSES = ("keel_loss", "foam_loss", "friction_loss", "fulcrum_loss")


def energy_chapter(table: EnergyTable, arrays: Arrays) -> Chapter:
    """What the foot stores and returns by fulcrum position, and how well its balance closes."""
    figures = {}
    facts: dict[str, object] = {}
    if table.trials:
        stored: dict[str, list[tuple[float, float | None]]] = {
            "as recorded": [(row.fulcrum_mm, row.means["stored_j"]) for row in table.conditions],
            "under the same load": [(row.fulcrum_mm, row.stored_j) for row in table.same_load],
            "with the same motion": [(row.fulcrum_mm, row.stored_j) for row in table.same_motion],
        }
        first = table.trials[0].terms_j
        facts = {
            "stored_at_ends": [
                (name, *_ends(rows)) for name, rows in stored.items() if len(dict(rows)) > 1
            ],
            "lost_first_j": sum(
                first[f"{name}_j"] for name in table.terms if name.endswith("_loss")
            ),
        }
        figures = {
            "energy_stance": _stance_figure(table, arrays),
            "energy_position": _position_figure(table),
            "energy_balance": _balance_figure(table.trials[0]),
            "energy_power": _power_figure(table, arrays),
        }
    return section_chapter(
        "energy", table, figures, condition_rows=plain(table.conditions), **facts
    )


def _ends(rows: Sequence[tuple[float, float | None]]) -> list[tuple[float, float | None]]:
    """The softest and the stiffest position (mm), and the mean at each."""
    places = {place for place, _ in rows}
    return [
        (end, spread(value for place, value in rows if place == end).mean)
        for end in (min(places), max(places))
    ]


def _balance_figure(row: EnergyRow) -> Figure:
    """Where the limb's work is at toe-off of a stance, one term after the other taken off it."""
    with drawing(PANEL[0], 1.15 * PANEL[1]) as figure:
        axes = figure.subplots()
        left = row.terms_j["limb_work_j"]
        names = list(_WORDS)
        axes.barh(0, left, color=colour_of(row.fulcrum_mm))
        axes.text(left, 0, f" {left:.2f}", va="center")
        for i, name in enumerate(names[1:], start=1):
            size = row.terms_j[f"{name}_j"]
            axes.barh(i, -size, left=left, color="0.35" if name.endswith("_loss") else "0.75")
            text = f"{size:.4f}" if name == "remainder" else f"{size:.2f}"
            axes.text(max(left, left - size), i, f" {text}", va="center")
            left -= size
        axes.set_yticks(range(len(names)), list(_WORDS.values()))
        axes.invert_yaxis()
        axes.grid(False, axis="y")
        axes.set_xlim(right=1.15 * axes.get_xlim()[1])
        label(axes, x="energy, touch-down to toe-off (J)", y="")
    return figure


def _position_figure(table: EnergyTable) -> Figure:
    """Stored and returned energy over the fulcrum's position: as recorded, under the same load,
    with the same motion.
    """
    ways = {"as recorded": (), "same load": table.same_load, "same motion": table.same_motion}
    titles = [title for title, rows in ways.items() if rows or title == "as recorded"]
    with drawing(PANEL[0], 1.05 * PANEL[1]) as figure:
        panels = figure.subplots(1, len(titles), sharey=True, squeeze=False)[0]
        for axes, title in zip(panels, titles, strict=True):
            if axes is panels[0]:
                _recorded(axes, table.trials, table.conditions)
            else:
                _moved(axes, ways[title], table.trials)
            y = "energy of a stance (J)" if axes is panels[0] else ""
            label(axes, x="fulcrum (mm)", y=y, title=title)
            axes.margins(x=0.12)
        panels[0].set_ylim(bottom=0.0)
        handles = [entry(name, **mark(NEUTRAL, full) | SIMULATED) for _, name, full in _KINDS]
        handles += [
            entry(f"recorded at {x:g} mm", color=colour_of(x), linewidth=2.0)
            for x in by_fulcrum(table.trials)
        ]
        figure.legend(handles=handles, loc="lower center", ncols=2)
        say_synthetic(figure, table.synthetic, "walks")
    return figure


def _recorded(
    axes: Axes, trials: Sequence[EnergyRow], conditions: Sequence[EnergyCondition]
) -> None:
    places = [c.fulcrum_mm for c in conditions]
    for key, _, full in _KINDS:
        means = np.array([c.means[key] for c in conditions], dtype=float)
        axes.plot(places, means, color=NEUTRAL, zorder=1, **SIMULATED)
        for row in trials:
            look = mark(colour_of(row.fulcrum_mm), full, markersize=5)
            axes.plot(row.fulcrum_mm, getattr(row, key), **look)


def _moved(axes: Axes, rows: Sequence[MovedRow], trials: Sequence[EnergyRow]) -> None:
    """Means over the trials of each condition, where all of them could be walked."""
    own = {row.label: row.fulcrum_mm for row in trials}
    for home in sorted(set(own.values())):
        at = by_fulcrum(row for row in rows if own.get(row.label) == home)
        walks = len({row.label for here in at.values() for row in here})
        places = [x for x, here in at.items() if len(here) == walks]
        for key, _, full in _KINDS:
            axes.plot(
                places,
                [float(np.mean([getattr(row, key) for row in at[x]])) for x in places],
                **mark(colour_of(home), full, markersize=5) | SIMULATED,
            )


def _power_figure(table: EnergyTable, arrays: Arrays) -> Figure:
    """Distal segment power over stance, mean of the stances at each position, of pylon and residual
    shank."""
    middle = 0.5 * (arrays["percent"][1:] + arrays["percent"][:-1])
    homes = np.array([row.fulcrum_mm for row in table.trials])
    with drawing(PANEL[0], 1.15 * PANEL[1]) as figure:
        axes = figure.subplots()
        for home in sorted(set(homes)):
            for body, look in (
                ("pylon", {"linewidth": 1.8, "label": name_of(home)}),
                ("shank", _DOTTED | {"linewidth": 1.2}),
            ):
                power = arrays[f"{body}_power_w"][homes == home].mean(axis=0)
                axes.plot(middle, power, color=colour_of(home), **look)
        axes.plot([], [], color=NEUTRAL, label="foot and socket together", **_DOTTED)
        axes.axhline(0.0, color="0.3", linewidth=0.8)
        axes.set_xlim(0.0, 100.0)
        label(axes, x="stance (%)", y="distal segment power (W)")
        legend_below(figure, axes.get_legend_handles_labels()[0])
    return figure


def _stance_figure(table: EnergyTable, arrays: Arrays) -> Figure:
    """Where the energy of the foot is over a stance: strain of keel, support and foam stacked, and
    losses so far; one trial a fulcrum position."""
    shown = by_fulcrum(table.trials)
    percent = arrays["percent"]
    with drawing(PANEL[0], 1.05 * PANEL[1]) as figure:
        panels = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
        for axes, (fulcrum, rows) in zip(panels, shown.items(), strict=True):
            curves = arrays["terms_j"][table.trials.index(rows[0])]
            terms = dict(zip(table.terms, curves, strict=True))
            colour = colour_of(fulcrum)
            base = np.zeros(len(percent))
            for name, _, alpha, hatch in _STORES:
                top = base + terms[name]
                axes.fill_between(
                    percent,
                    base,
                    top,
                    facecolor=(*colour[:3], alpha),
                    edgecolor="white",
                    hatch=hatch,
                    linewidth=0.0,
                )
                base = top
            axes.plot(percent, base, color=colour, **SIMULATED)
            lost = np.sum([terms[name] for name in _LOSSES], axis=0)
            axes.plot(percent, lost, color="0.1", **_LOST)
            axes.set_xlim(0.0, 100.0)
            axes.set_ylim(bottom=0.0)
            y = "energy (J)" if axes is panels[0] else ""
            label(axes, x="stance (%)", y=y, title=f"{fulcrum:g} mm")
        handles: list[Artist] = [
            Patch(facecolor=("0.3", alpha), edgecolor="white", hatch=hatch, label=text)
            for _, text, alpha, hatch in _STORES
        ]
        handles.append(entry("lost so far", color="0.1", **_LOST))
        figure.legend(handles=handles, loc="lower center", ncols=4)
        say_synthetic(figure, table.synthetic, "walks")
    return figure
