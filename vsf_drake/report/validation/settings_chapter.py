"""The chapter "Can two settings be told apart?": a function of its saved section."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from vsf_drake.files import plain
from vsf_drake.report.page import Chapter
from vsf_drake.report.style import MARKERS, Arrays, colour_of, drawing, label

if TYPE_CHECKING:
    from vsf_drake.analysis.validation.settings_section import OutcomeRow, PairRow, SettingsTable

TITLE = "Can two settings be told apart?"
SHOWN = ("resultant_first_bw", "resultant_second_bw", "vertical_trough_bw", "propulsion_bw", "cop_mid_stance_fl",
         "energy_stored_j")
DESIGNS = {"same_recording": "same recording", "same_session": "two recordings, one session",
           "two_sessions": "two sessions"}
_SHADES = {"two_sessions": "0.93", "same_session": "0.84", "same_recording": "0.70"}
_FACES = {True: "0.25", False: "0.93", None: "white"}
"""Told apart, not, and not known."""


def settings_chapter(table: SettingsTable, arrays: Arrays) -> Chapter:
    """The answer, what the model predicts against what is detectable, and how that was found."""
    facts, figures = dict(vars(table)), {}
    if table.outcomes:
        facts |= _facts(table)
        figures = {"settings_effects": _effect_figure(table, arrays), "settings_pairs": _pairs_figure(table)}
    return Chapter(name="settings", title=TITLE, template="validation/settings.html.j2", facts=facts, figures=figures)


def _facts(table: SettingsTable) -> dict[str, Any]:
    """What the chapter's sentences need besides the table."""
    outcomes, places = table.outcomes, table.positions_mm
    curves = {(row.from_mm, row.to_mm): row for row in table.curves if row.rms_bw is not None}
    near = [row.rms_bw or 0.0 for (start, end), row in curves.items() if places.index(end) - places.index(start) == 1]
    known = any(_limited(row) for row in outcomes)
    changes = [(row, row.limits["sdd_same_recording" if _limited(row) else "noise_sdd_same_recording"])
               for row in outcomes if row.name in SHOWN]
    reached, apart = [], []
    for design, title in DESIGNS.items():
        travels = [(travel, row.title) for row in outcomes
                   if (travel := row.limits[f"{'smallest' if known else 'noise'}_travel_mm_{design}"]) is not None]
        reached += [(title, *min(travels), len(travels))] if travels else []
        verdicts = [told_apart(row, design) for row in table.pairs]
        apart.append((title, verdicts.count(True), len(verdicts) - verdicts.count(None)))
    titles = {row.name: f"{row.title} ({row.unit})" for row in outcomes}
    words = {True: "yes", False: "no", None: None}
    return {
        "outcomes": plain(outcomes),
        "ends": curves[max(curves, key=lambda ends: ends[1] - ends[0])] if curves else None,
        "neighbours_percent": [100.0 * x for x in near], "as_large_as_a_step": 0.08 <= max(near, default=0.0) <= 0.2,
        "walked_percent": [100.0 * apart_bw for apart_bw in table.as_walked_apart_bw],
        "changes": [(row, limit) for row, limit in sorted(changes, key=lambda item: SHOWN.index(item[0].name))
                    if row.effect_ends is not None and limit is not None],
        "reached": reached, "apart": apart, "poor_judge": poor_judge(table.pairs),
        "walked_rows": [{**vars(row), "title": titles[row.outcome], "told": words[row.told_apart],
                         "strides": words[row.beyond_strides]} for row in table.as_walked]}


def told_apart(row: PairRow, design: str) -> bool | None:
    """Whether the effect exceeds what is detectable; None where that is not known."""
    limit = row.limits[f"limit_{design}"]
    return None if row.effect is None or limit is None else abs(row.effect) > limit


def poor_judge(pairs: Sequence[PairRow]) -> PairRow | None:
    """Stored energy between the ends, if with the motion held it cannot tell them apart and is largest in between."""
    effects = [(row, row.effect) for row in pairs if row.outcome == "energy_stored_j" and row.effect is not None]
    if not effects:
        return None
    ends, effect = max(effects, key=lambda item: item[0].to_mm - item[0].from_mm)
    largest = max(abs(other) for _, other in effects)
    between = max(other for row, other in effects if row.from_mm == ends.from_mm) > max(0.0, effect)
    apart = abs(effect) > 0.5 * largest or told_apart(ends, "same_recording")
    return ends if between and not apart else None


def _limited(outcome: OutcomeRow) -> bool:
    """Whether the model's error in it is known: else limits are of noise alone."""
    return outcome.limits["sdd_same_recording"] is not None


def _effect_figure(table: SettingsTable, arrays: Arrays) -> Figure:
    """Six outcomes over the fulcrum's position, each as a difference from the middle position."""
    positions = np.array(table.positions_mm, dtype=float)
    middle = int(np.argmin(np.abs(positions - 0.5 * (positions[0] + positions[-1]))))
    outcomes, recorded = {row.name: row for row in table.outcomes}, table.trials_mm
    with drawing(10.6, 6.4) as figure:
        for axes, name in zip(figure.subplots(2, 3, sharex=True).ravel(), SHOWN, strict=True):
            row, effects = outcomes[name], arrays["effects"][:, :, list(outcomes).index(name)]
            _bands(axes, [pair for pair in table.pairs if pair.outcome == name], positions[middle])
            change = effects - effects[:, middle:middle + 1]
            for values, at in zip(change, recorded, strict=True):
                axes.plot(positions, values, color=colour_of(at), linewidth=1.0)
            axes.plot(positions, np.nanmean(change, axis=0), color="black", linewidth=2.2, marker="o", markersize=4.5)
            axes.axhline(0.0, color="0.4", linewidth=0.8)
            axes.set_xticks(positions)
            label(axes, x="fulcrum from the keel's end (mm)",
                  y=f"difference from {positions[middle]:g} mm ({row.unit})",
                  title=row.title + ("" if _limited(row) else ": noise alone"))
        handles: list[Any] = [Patch(facecolor=_SHADES[d], edgecolor="0.6", label=f"not detectable: {DESIGNS[d]}")
                              for d in reversed(_SHADES)]
        handles += [Line2D([], [], color="black", linewidth=2.2, marker=MARKERS[0], markersize=4.5,
                           label="mean of the trials"),
                    *(Line2D([], [], color=colour_of(x), label=f"trials recorded at {x:g} mm")
                      for x in sorted(set(recorded)))]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
        figure.suptitle(("SYNTHETIC trials. " if table.synthetic else "")
                        + "The same motion walked at every position of the fulcrum", x=0.01, ha="left", fontsize=10.5)
    return figure


def _bands(axes: Axes, pairs: Sequence[PairRow], here: float) -> None:
    """What is not detectable from the position `here`, to both sides; next to it as at its neighbour."""
    for design, shade in _SHADES.items():
        limits = {row.to_mm if row.from_mm == here else row.from_mm: row.limits[f"limit_{design}"]
                  for row in pairs if here in (row.from_mm, row.to_mm)}
        if None in limits.values():
            continue
        low, high = (sorted(x for x in limits if (x > here) == ahead) for ahead in (False, True))
        for x, near in ((low, low[-1:]), (high, high[:1])):
            at = np.array(sorted([*x, here]))
            wide = np.array([limits[near[0] if place == here else place] for place in at])
            axes.fill_between(at, -wide, wide, color=shade, linewidth=0.0, zorder=0)


def _name_outcomes(axes: Axes, rows: Sequence[OutcomeRow]) -> None:
    axes.set_yticks(range(len(rows)), [row.title + ("" if _limited(row) else " (noise alone)") for row in rows])


def _pairs_figure(table: SettingsTable) -> Figure:
    """One panel a design; dark cells are told apart, with the effect over the limit in each."""
    rows, rank = table.outcomes, table.positions_mm.index
    pairs = sorted({(row.from_mm, row.to_mm) for row in table.pairs},
                   key=lambda pair: (rank(pair[1]) - rank(pair[0]), pair))  # near ones first
    by_pair = {(row.outcome, row.from_mm, row.to_mm): row for row in table.pairs}
    with drawing(11.0, 1.7 + 0.27 * len(rows)) as figure:
        for axes, (design, title) in zip(figure.subplots(1, 3, sharey=True), DESIGNS.items(), strict=True):
            for i, outcome in enumerate(rows):
                for j, pair in enumerate(pairs):
                    row = by_pair[(outcome.name, *pair)]
                    effect, limit, apart = row.effect, row.limits[f"limit_{design}"], told_apart(row, design)
                    axes.add_patch(Rectangle((j - 0.47, i - 0.45), 0.94, 0.9, facecolor=_FACES[apart], edgecolor="0.7",
                                             linewidth=0.5))
                    over = abs(effect) / limit if effect is not None and limit else 0.0
                    text = "–" if apart is None else f"{over:.{1 if over < 9.95 else 0}f}"
                    axes.text(j, i, text, ha="center", va="center", fontsize=6.5, color="white" if apart else "black")
            axes.set_xlim(-0.6, len(pairs) - 0.4)
            axes.set_ylim(len(rows) - 0.4, -0.6)
            axes.set_xticks(range(len(pairs)), [f"{a:g}–{b:g}" for a, b in pairs], rotation=90, fontsize=7.5)
            _name_outcomes(axes, rows)
            axes.grid(False)
            axes.tick_params(length=0)
            label(axes, x="pair of positions (mm)", y="", title=title[0].upper() + title[1:])
        figure.axes[0].set_ylabel("outcome; in the cells: effect over limit (1)")
        handles = [Patch(facecolor=_FACES[apart], edgecolor="0.7", label=text)
                   for apart, text in ((True, "told apart"), (False, "not told apart"))]
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure
