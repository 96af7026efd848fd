"""Which pairs of positions are told apart, outcome by outcome; and the smallest travel that is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from vsf_drake.report.style import MARKERS, NEUTRAL, label, new_figure, style
from vsf_drake.report.validation.settings.effect_figure import DESIGNS

_TOLD, _LESS, _UNKNOWN = "0.25", "0.93", "white"
_DARK = ("black", "0.35", "0.6")


def pairs_of(table: Mapping[str, Any]) -> list[tuple[float, float]]:
    """Pairs of positions, near ones first."""
    found = dict.fromkeys((row["from_mm"], row["to_mm"]) for row in table["pairs"])
    rank = {x: i for i, x in enumerate(table["positions_mm"])}
    return sorted(found, key=lambda pair: (rank[pair[1]] - rank[pair[0]], pair))


def settings_pairs_figure(table: Mapping[str, Any]) -> Figure:
    """One panel a design; dark cells are told apart, with the effect over the limit in each."""
    pairs, rows = pairs_of(table), table["outcomes"]
    found = {(row["outcome"], row["from_mm"], row["to_mm"]): row for row in table["pairs"]}
    with style():
        figure = new_figure(11.0, 1.7 + 0.27 * len(rows))
        for axes, (design, title) in zip(figure.subplots(1, 3, sharey=True), DESIGNS.items(), strict=True):
            for i, outcome in enumerate(rows):
                prefix = "" if outcome["sdd_same_recording"] is not None else "noise_"
                for j, pair in enumerate(pairs):
                    row = found[(outcome["name"], *pair)]
                    apart, limit = row[f"{prefix}told_apart_{design}"], row[f"{prefix}sdd_{design}"]
                    face = _UNKNOWN if apart is None else _TOLD if apart else _LESS
                    axes.add_patch(Rectangle((j - 0.47, i - 0.45), 0.94, 0.9, facecolor=face, edgecolor="0.7",
                                             linewidth=0.5))
                    text = "–" if apart is None else _ratio(abs(row["effect"]) / limit)
                    axes.text(j, i, text, ha="center", va="center", fontsize=6.5, color="white" if apart else "black")
            axes.set_xlim(-0.6, len(pairs) - 0.4)
            axes.set_ylim(len(rows) - 0.4, -0.6)
            axes.set_xticks(range(len(pairs)), [f"{a:g}–{b:g}" for a, b in pairs], rotation=90, fontsize=7.5)
            axes.set_yticks(range(len(rows)), [
                row["title"] + ("" if row["sdd_same_recording"] is not None else " (noise alone)") for row in rows])
            axes.grid(False)
            axes.tick_params(length=0)
            label(axes, x="pair of positions (mm)", y="", title=title[0].upper() + title[1:])
        figure.axes[0].set_ylabel("outcome; in the cells: effect over limit (1)")
        handles = [Patch(facecolor=_TOLD, edgecolor="0.7", label="told apart"),
                   Patch(facecolor=_LESS, edgecolor="0.7", label="not told apart")]
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        figure.draw_without_rendering()
    return figure


def settings_travel_figure(table: Mapping[str, Any]) -> Figure:
    """The smallest detectable travel of the fulcrum by outcome and design."""
    rows, reach = table["outcomes"], table["positions_mm"][-1] - table["positions_mm"][0]
    known = any(row["sdd_same_recording"] is not None for row in rows)
    designs = {d: title for d, title in DESIGNS.items() if known or d != "same_recording"}
    beyond = 1.08 * reach
    with style():
        figure = new_figure(9.6, 1.5 + 0.27 * len(rows))
        axes = figure.subplots()
        axes.axvspan(reach, 1.16 * reach, color="0.93", zorder=0)
        handles = []
        for design, title in designs.items():
            k = list(DESIGNS).index(design)
            style_of: dict[str, Any] = {"marker": MARKERS[k], "color": _DARK[k], "linestyle": "", "markersize": 6.5}
            for i, row in enumerate(rows):
                limited = row["sdd_same_recording"] is not None
                if not limited and design == "same_recording":
                    continue
                travel = row[f"{'smallest' if limited else 'noise'}_travel_mm_{design}"]
                axes.plot(beyond if travel is None else travel, i + 0.22 * (k - 1), clip_on=False,
                          markerfacecolor=_DARK[k] if travel is not None else "white", **style_of)
            handles.append(Line2D([], [], label=title, **style_of))
        handles.append(Line2D([], [], color=NEUTRAL, markerfacecolor="white", marker="o", linestyle="",
                              label="more than the range"))
        axes.set_yticks(range(len(rows)), [
            row["title"] + ("" if row["sdd_same_recording"] is not None else " (noise alone)") for row in rows])
        axes.set_ylim(len(rows) - 0.5, -0.5)
        axes.set_xlim(0.0, 1.16 * reach)
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
        label(axes, x="smallest detectable travel of the fulcrum, around the middle of its range (mm)", y="")
        figure.draw_without_rendering()
    return figure


def _ratio(value: float) -> str:
    return f"{value:.1f}" if value < 9.95 else f"{value:.0f}"
