"""How the ledger closes: one stance as a waterfall, and what remains of every trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from vsf_drake.report.style import MARKERS, NEUTRAL, condition_colour, label, log_scale, new_figure, style

WORDS = {
    "limb_work": "work of the limb through the socket", "kinetic": "kinetic", "gravity": "gravity",
    "bushing_strain": "bushing, strain", "keel_strain": "keel, strain", "foam_strain": "foam, strain",
    "fulcrum_strain": "fulcrum support, strain", "bushing_loss": "bushing, loss", "keel_loss": "keel, damping",
    "foam_loss": "foam, damping", "friction_loss": "friction", "fulcrum_loss": "fulcrum support, loss",
    "remainder": "remainder"}
"""Terms of the ledger in words, in the order in which they are shown."""
_STORED, _LOST = "0.75", "0.35"


def energy_ledger_figure(table: Mapping[str, Any]) -> Figure:
    """The figure: waterfall at toe-off of the first stance at the softest position, and the remainder of all."""
    with style():
        figure = new_figure(10.5, 4.6)
        left, right = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
        row = table["trials"][0]
        _waterfall(left, row)
        label(left, x="energy, touch-down to toe-off (J)", y="",
              title=f"Where the limb's work is at toe-off: {row['label']}")
        _remainders(right, table)
        figure.draw_without_rendering()
    return figure


def _waterfall(axes: Axes, row: Mapping[str, Any]) -> None:
    left, names = row["limb_work_j"], list(WORDS)
    axes.barh(0, left, color=condition_colour(1e-3 * row["fulcrum_mm"]))
    axes.text(left, 0, f" {left:.2f}", va="center", fontsize=8)
    for i, name in enumerate(names[1:], start=1):
        size = row[f"{name}_j"]
        shade = "black" if name == "remainder" else _LOST if name.endswith("_loss") else _STORED
        axes.barh(i, -size, left=left, color=shade)
        axes.plot([left, left], [i - 1.4, i + 0.4], color=NEUTRAL, linewidth=0.6)
        text = f"{size:.4f}" if name == "remainder" else f"{size:.2f}"
        axes.text(max(left, left - size), i, f" {text}", va="center", fontsize=8)
        left -= size
    axes.set_yticks(range(len(names)), list(WORDS.values()))
    axes.invert_yaxis()
    axes.grid(False, axis="y")
    axes.set_xlim(right=1.12 * axes.get_xlim()[1])


def _remainders(axes: Axes, table: Mapping[str, Any]) -> None:
    rows: Sequence[Mapping[str, Any]] = table["trials"]
    coarse = {(row["label"], row["stance"]): row for row in table["convergence"]}
    homes = sorted({row["fulcrum_mm"] for row in rows})
    for i, row in enumerate(rows):
        colour = condition_colour(1e-3 * row["fulcrum_mm"])
        marker = MARKERS[homes.index(row["fulcrum_mm"]) % len(MARKERS)]
        if row["remainder_share"]:
            axes.plot(i, 100.0 * row["remainder_share"], marker=marker, color=colour, linestyle="")
        twin = coarse.get((row["label"], row["stance"]))
        if twin and row["stored_j"] > 0.0 and twin["coarse_remainder_max_j"] > 0.0:
            axes.plot(i, 100.0 * twin["coarse_remainder_max_j"] / row["stored_j"], marker=marker, color=colour,
                      markerfacecolor="white", linestyle="")
    axes.axhline(100.0 * table["asked_share"], color="0.1", linewidth=1.2)
    axes.text(0.02, 100.0 * table["asked_share"] * 1.06, f"asked: at most {100.0 * table['asked_share']:g} %",
              va="bottom", fontsize=8, transform=axes.get_yaxis_transform())
    axes.plot([], [], marker="o", color=NEUTRAL, linestyle="", label=f"steps of {1e3 * table['step_s']:g} ms")
    axes.plot([], [], marker="o", color=NEUTRAL, markerfacecolor="white", linestyle="",
              label=f"steps of {1e3 * table['coarse_step_s']:g} ms")
    log_scale(axes.yaxis)
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(top=max(axes.get_ylim()[1], 200.0 * table["asked_share"]))
    axes.set_xticks(range(len(rows)), [row["label"] for row in rows], rotation=45, ha="right")
    axes.legend(loc="upper right")
    label(axes, x="trial", y="largest remainder over stored energy (%)", title="How well the ledger closes")
