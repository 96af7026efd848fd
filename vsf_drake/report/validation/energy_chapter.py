"""The report's chapter on energy storage and return: a function of the saved section."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from vsf_drake.files import plain
from vsf_drake.report.page import Chapter
from vsf_drake.report.style import (
    FULCRUM,
    MARKERS,
    NEUTRAL,
    SIMULATED,
    Arrays,
    colour_of,
    drawing,
    label,
    log_scale,
    name_of,
)

if TYPE_CHECKING:
    from vsf_drake.analysis.validation.energy_section import EnergyCondition, EnergyRow, EnergyTable, MovedRow

_WORDS = {
    "limb_work": "work of the limb through the socket", "kinetic": "kinetic", "gravity": "gravity",
    "bushing_strain": "bushing, strain", "keel_strain": "keel, strain", "foam_strain": "foam, strain",
    "fulcrum_strain": "fulcrum support, strain", "bushing_loss": "bushing, loss", "keel_loss": "keel, damping",
    "foam_loss": "foam, damping", "friction_loss": "friction", "fulcrum_loss": "fulcrum support, loss",
    "remainder": "remainder"}
"""Terms of the ledger in words, in the order in which they are shown."""
_KINDS = (("stored_j", "stored", True), ("returned_j", "returned", False))
"""Energies over the fulcrum's position: key, name, and whether its marks are full."""
_STORES = (("keel_strain", "keel", 0.85, ""), ("fulcrum_strain", "fulcrum support", 0.5, "////"),
           ("foam_strain", "foam", 0.2, ""))
_LOSSES = ("keel_loss", "foam_loss", "friction_loss", "fulcrum_loss")


def energy_chapter(table: EnergyTable, arrays: Arrays) -> Chapter:
    """What the foot stores and returns by fulcrum position, and how well the ledger of it closes."""
    trials, figures = table.trials, {}
    facts = {**vars(table), "trials": plain(trials), "conditions": plain(table.conditions)}
    if trials:
        facts |= {
            "firsts": [trials[i] for i in _first_of_each(table).values()],
            "stored_at_ends": [(name, *ends) for name, stored in (
                ("as recorded", [(c.fulcrum_mm, c.means["stored_j"] or 0.0) for c in table.conditions]),
                ("under the same load", [(row.fulcrum_mm, row.stored_j) for row in table.same_load]),
                ("with the same motion", [(row.fulcrum_mm, row.stored_j) for row in table.same_motion]))
                if (ends := _at_ends(stored))],
            "remainder_ratios": [row.coarse_remainder_max_j / row.remainder_max_j for row in trials
                                 if row.coarse_remainder_max_j is not None and row.remainder_max_j > 0.0],
            "lost_first_j": sum(trials[0].terms_j[f"{name}_j"] for name in table.terms if name.endswith("_loss")),
            "beam_ratios": [(row.keel_at_most_j + row.fulcrum_at_most_j) / row.beam_j for row in trials if row.beam_j]}
        figures = {"energy_stance": _stance_figure(table, arrays), "energy_ledger": _ledger_figure(table),
                   "energy_power": _power_figure(table, arrays)}
        if table.same_load or table.same_motion:
            figures["energy_position"] = _position_figure(table)
    return Chapter(name="energy", title="Energy storage and return", template="validation/energy.html.j2", facts=facts,
                   figures=figures)


def _at_ends(stored: Sequence[tuple[float, float]]) -> tuple[float, ...]:
    """Softest position (mm), mean energy stored there (J), and the same of the stiffest; nothing for one position."""
    places = sorted({at for at, _ in stored})
    return tuple(number for x in (places[0], places[-1]) for number in (
        x, float(np.mean([energy for at, energy in stored if at == x])))) if len(places) > 1 else ()


def _first_of_each(table: EnergyTable) -> dict[float, int]:
    """Row of `trials` of the first stance at each position (mm), softest first."""
    first: dict[float, int] = {}
    for i, row in enumerate(table.trials):
        first.setdefault(row.fulcrum_mm, i)
    return dict(sorted(first.items()))


def _ledger_figure(table: EnergyTable) -> Figure:
    """How the ledger closes: a waterfall at toe-off of the first stance at the softest position, and the remainder of
    all stances."""
    with drawing(10.5, 4.6) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
        row = table.trials[0]
        _waterfall(left, row)
        label(left, x="energy, touch-down to toe-off (J)", y="",
              title=f"Where the limb's work is at toe-off: {row.label}")
        _remainders(right, table)
    return figure


def _waterfall(axes: Axes, row: EnergyRow) -> None:
    left, names = row.terms_j["limb_work_j"], list(_WORDS)
    axes.barh(0, left, color=colour_of(row.fulcrum_mm))
    axes.text(left, 0, f" {left:.2f}", va="center", fontsize=8)
    for i, name in enumerate(names[1:], start=1):
        size = row.terms_j[f"{name}_j"]
        axes.barh(i, -size, left=left,
                  color="black" if name == "remainder" else "0.35" if name.endswith("_loss") else "0.75")
        axes.plot([left, left], [i - 1.4, i + 0.4], color=NEUTRAL, linewidth=0.6)
        text = f"{size:.4f}" if name == "remainder" else f"{size:.2f}"
        axes.text(max(left, left - size), i, f" {text}", va="center", fontsize=8)
        left -= size
    axes.set_yticks(range(len(names)), list(_WORDS.values()))
    axes.invert_yaxis()
    axes.grid(False, axis="y")
    axes.set_xlim(right=1.12 * axes.get_xlim()[1])


def _remainders(axes: Axes, table: EnergyTable) -> None:
    rows, asked = table.trials, 100.0 * table.asked_share
    homes = sorted({row.fulcrum_mm for row in rows})
    for i, row in enumerate(rows):
        look: dict[str, Any] = {"marker": MARKERS[homes.index(row.fulcrum_mm) % len(MARKERS)],
                                "color": colour_of(row.fulcrum_mm)}
        if row.remainder_share:
            axes.plot(i, 100.0 * row.remainder_share, **look, linestyle="")
        if row.coarse_remainder_max_j and row.stored_j > 0.0:
            axes.plot(i, 100.0 * row.coarse_remainder_max_j / row.stored_j, **look, markerfacecolor="white",
                      linestyle="")
    axes.axhline(asked, color="0.1", linewidth=1.2)
    axes.text(0.02, asked * 1.06, f"asked: at most {asked:g} %", va="bottom", fontsize=8,
              transform=axes.get_yaxis_transform())
    for key, face in (("step_s", NEUTRAL), ("coarse_step_s", "white")):
        axes.plot([], [], marker="o", color=NEUTRAL, markerfacecolor=face, linestyle="",
                  label=f"steps of {1e3 * getattr(table, key):g} ms")
    log_scale(axes.yaxis)
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(top=max(axes.get_ylim()[1], 2.0 * asked))
    axes.set_xticks(range(len(rows)), [row.label for row in rows], rotation=45, ha="right")
    axes.legend(loc="upper right")
    label(axes, x="trial", y="largest remainder over stored energy (%)", title="How well the ledger closes")


def _position_figure(table: EnergyTable) -> Figure:
    """Stored and returned energy over the fulcrum's position: as recorded, under the same load, with the same motion.
    """
    trials = table.trials
    places = sorted({row.fulcrum_mm for row in trials} | {row.fulcrum_mm for row in table.same_load})
    with drawing(10.5, 4.1) as figure:
        panels = first, second, third = figure.subplots(1, 3)
        _recorded(first, trials, table.conditions)
        _moved(second, table.same_load, trials)
        _moved(third, table.same_motion, trials)
        for axes, title in zip(panels, ("Trials as recorded, each at its own position",
                                        "Each trial's load, fulcrum moved", "Each trial's motion, fulcrum moved"),
                               strict=True):
            label(axes, x=FULCRUM, y="energy of a stance (J)" if axes is first else "", title=title)
            axes.set_ylim(bottom=0.0)
            axes.set_xticks(places, [f"{x:g}" for x in places])
        for _, name, full in _KINDS:
            first.plot([], [], color=NEUTRAL, marker="o", markerfacecolor=NEUTRAL if full else "white",
                       label=f"{name}, mean of trials", **SIMULATED)
        first.plot([], [], color=NEUTRAL, marker="x", linestyle="", label="lost in the foot, mean of trials")
        first.legend(loc="upper right")
        second.legend(loc="upper right", title="means of the trials at")
        second.set_ylim(top=second.get_ylim()[1] * 1.25)
        first.set_ylim(top=first.get_ylim()[1] * 1.35)
    return figure


def _recorded(axes: Axes, trials: Sequence[EnergyRow], conditions: Sequence[EnergyCondition]) -> None:
    places = [c.fulcrum_mm for c in conditions]
    for key, _, full in _KINDS:
        means = np.array([c.means[key] for c in conditions], dtype=float)
        axes.plot(places, means, color=NEUTRAL, zorder=1, **SIMULATED)
        for row in trials:
            colour = colour_of(row.fulcrum_mm)
            axes.plot(row.fulcrum_mm, getattr(row, key), marker="o", linestyle="", markersize=5, color=colour,
                      markerfacecolor=colour if full else "white")
    lost = np.array([c.means["lost_j"] for c in conditions], dtype=float)
    axes.plot(places, lost, marker="x", linestyle="", color=NEUTRAL)


def _moved(axes: Axes, rows: Sequence[MovedRow], trials: Sequence[EnergyRow]) -> None:
    """Means over the trials of each condition, where all of them could be walked."""
    own = {row.label: row.fulcrum_mm for row in trials}
    for number, home in enumerate(sorted(set(own.values()))):
        mine = [row for row in rows if own.get(row.label) == home]
        at = {x: [row for row in mine if row.fulcrum_mm == x] for x in sorted({row.fulcrum_mm for row in mine})}
        places = [x for x, of in at.items() if len(of) == len({row.label for row in mine})]
        colour = colour_of(home)
        for key, _, full in _KINDS:
            axes.plot(places, [float(np.mean([getattr(row, key) for row in at[x]])) for x in places], color=colour,
                      marker=MARKERS[number % len(MARKERS)], markersize=5, markerfacecolor=colour if full else "white",
                      label=name_of(home) if full else None, **SIMULATED)


def _power_figure(table: EnergyTable, arrays: Arrays) -> Figure:
    """Distal segment power over stance, of the pylon and of the residual shank: one line a stance."""
    middle = 0.5 * (arrays["percent"][1:] + arrays["percent"][:-1])
    with drawing(10.5, 3.9) as figure:
        panels = figure.subplots(1, 2, sharey=True)
        for axes, name, title in zip(panels, ("pylon_power_w", "shank_power_w"), (
                "Seen from the pylon: the foot alone", "Seen from the residual shank: foot and socket"), strict=True):
            seen = set()
            for row, power in zip(table.trials, arrays[name], strict=True):
                home = row.fulcrum_mm
                axes.plot(middle, power, color=colour_of(home), label=None if home in seen else name_of(home),
                          **SIMULATED)
                seen.add(home)
            axes.axhline(0.0, color="0.3", linewidth=0.8)
            axes.set_xlim(0.0, 100.0)
            label(axes, x="stance (%)", y="distal segment power (W)" if axes is panels[0] else "", title=title)
        panels[0].legend(loc="upper left")
        for height, side, text in ((0.97, "top", "given back"), (0.03, "bottom", "taken up")):
            panels[0].text(0.99, height, text, transform=panels[0].transAxes, ha="right", va=side, fontsize=8)
    return figure


def _stance_figure(table: EnergyTable, arrays: Arrays) -> Figure:
    """Where the energy of the foot is over a stance: strain of keel, support and foam stacked, and losses so far; one
    trial a fulcrum position."""
    shown, percent = _first_of_each(table).items(), arrays["percent"]
    with drawing(10.5, 3.9) as figure:
        panels = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
        for axes, (fulcrum, i) in zip(panels, shown, strict=True):
            terms = dict(zip(table.terms, arrays["terms_j"][i], strict=True))
            colour, base = colour_of(fulcrum), np.zeros(len(percent))
            for name, text, alpha, hatch in _STORES:
                top = base + terms[name]
                axes.fill_between(percent, base, top, facecolor=(*colour[:3], alpha), edgecolor="white", hatch=hatch,
                                  linewidth=0.0, label=text)
                base = top
            axes.plot(percent, base, color=colour, **SIMULATED)
            axes.plot(percent, np.sum([terms[name] for name in _LOSSES], axis=0), color="0.1", linestyle=(0, (1, 1)),
                      linewidth=1.4, label="lost in the foot so far")
            axes.set_xlim(0.0, 100.0)
            axes.set_ylim(bottom=0.0)
            label(axes, x="stance (%)", y="energy (J)" if axes is panels[0] else "",
                  title=f"{name_of(fulcrum)}: {table.trials[i].label}")
        panels[0].legend(loc="upper left")
    return figure
