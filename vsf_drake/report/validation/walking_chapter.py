"""The report's chapter on walking: a function of the saved section."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from vsf_drake.base.sentences import say
from vsf_drake.report.fit_figures import fit_sweep_figure
from vsf_drake.report.layer_curves import layers_figure
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
    say_synthetic,
)
from vsf_drake.report.validation.panels import mark, plate_name, section_chapter
from vsf_drake.walks.numbers import cells, spread

if TYPE_CHECKING:
    from vsf_drake.validation.walking_section import LayersTable, WalkingCondition, WalkingTable

_ACROSS = 3
"""Conditions side by side in a figure."""
_CURVES = (
    ("walking_forces", ("vertical", "fore_aft", "cop")),
    ("walking_others", ("resultant", "medio_lateral", "impulse", "free_moment")),
)
"""The figures of curves: the first is shown, the other folded."""
_PERCENT = np.linspace(0.0, 100.0, 101)
_NAMES = {
    "resultant": ("resultant force", "BW"),
    "vertical": ("vertical force", "BW"),
    "fore_aft": ("fore-aft force (forward +)", "BW"),
    "medio_lateral": ("medio-lateral force (left +)", "BW"),
    "impulse": ("impulse of the resultant", "BW s"),
    "cop": ("centre of pressure, fore-aft", "foot lengths"),
    "free_moment": ("free moment (up +)", "N m"),
}
"""Quantities by key: how a sentence calls them, and their unit."""
_MOST_NAMED = 24
"""Walks that an axis has room to name."""


def walking_chapter(table: WalkingTable, arrays: Arrays) -> Chapter:
    """Table 3, Figures 5 to 7, null model, sweep, and where the curves differ."""
    group = _main_group(table)
    figures = {"walking_errors": walk_errors_figure(table)}
    ensembles = []
    for name, quantities in _CURVES:
        conditions = [
            i
            for i in range(len(table.conditions))
            if any(_has_curves(arrays, i, q) for q in quantities)
        ]
        for part in range(0, len(conditions), _ACROSS):
            own = conditions[part : part + _ACROSS]
            shown = [q for q in quantities if any(_has_curves(arrays, i, q) for i in own)]
            title = f"{name}_{part // _ACROSS + 1}" if len(conditions) > _ACROSS else name
            figures[title] = _ensemble_figure(table, arrays, shown, own)
            ensembles.append((title, list(_extremes(table, arrays, shown, own))))
    if any(_has_curves(arrays, group, quantity) for quantity in _NAMES):
        figures["walking_differences"] = _difference_figure(table, arrays)
    sweeps = [
        (row.label, row.fulcrum_mm, row.sweep)
        for row in table.rows
        if row.sweep and row.fulcrum_mm is not None
    ]
    if any(np.isfinite(sweep.errors_bw).any() for _, _, sweep in sweeps):
        figures["walking_sweep"] = fit_sweep_figure(sweeps, synthetic=table.synthetic)
    return _chapter(
        table,
        figures,
        exact=False,
        ensembles=ensembles,
        over_all=[
            {**vars(d), "curve": _NAMES[d.quantity][0], "unit": _NAMES[d.quantity][1]}
            for d in table.differences
            if d.group == group and d.largest_difference is not None
        ],
    )


def exact_chapter(table: WalkingTable, arrays: Arrays) -> Chapter:
    """Table 3 and every walk whose motion and force belong together: what of an error is the
    model's own."""
    return _chapter(table, exact=True)


def layers_chapter(table: LayersTable, arrays: Arrays, *, exact: bool = False) -> Chapter:
    """Every walk in layers; `exact`: those without errors of measurement."""
    figures = {}
    if table.shown is not None and "plate" in arrays:
        figures["exact_layers_walk" if exact else "walking_layers_walk"] = layers_figure(
            arrays, table.shown, synthetic=table.synthetic
        )
    return section_chapter(
        "layers",
        table,
        figures,
        exact=exact,
        rows=[{**vars(row), **row.scores} for row in table.rows],
        interval="half_width" in arrays,
        not_held=f"{say('not_held')[0]}.",
        no_interval=f"{say('no_interval')[0]}.",
        null_bw=table.null_bw,
        by_phase=say("phases", phases=table.phases),
    )


def _chapter(
    table: WalkingTable, figures: Mapping[str, Figure] | None = None, **facts: Any
) -> Chapter:
    """With the rows of the tables that both chapters have."""
    off_s = {
        words: spread(row.scores[f"{key}_error_s"] for row in table.rows).mean
        for words, key in (
            ("heel strike", "heel_strike"),
            ("toe-off", "toe_off"),
            ("stance", "stance"),
        )
    }
    return section_chapter(
        "walking",
        table,
        figures,
        condition_rows=list(_condition_rows(table)),
        passive=any(row.fulcrum_mm is None for row in table.rows),
        times_s={words: value for words, value in off_s.items() if value is not None},
        **facts,
    )


def _condition_rows(table: WalkingTable) -> Iterable[dict[str, Any]]:
    """Up to four rows a condition, the last the paper's: a person's walks, beside those of a person
    alone."""
    for condition in table.conditions:
        name = _heading(condition)
        for source, own in condition.scores.items():
            yield {"setting": name, "source": source, "n": own.n, **cells(own.spreads)}
        if condition.paper and not table.synthetic:
            yield {"setting": name, "source": "paper", "n": None, **condition.paper}


def _extremes(
    table: WalkingTable, arrays: Arrays, quantities: Sequence[str], groups: Sequence[int]
) -> Iterable[dict[str, Any]]:
    """The extreme of each measured curve, and where plate and model are furthest apart."""
    for group, quantity in (
        (g, q) for g in groups for q in quantities if _has_curves(arrays, g, q)
    ):
        measured, model = (
            arrays[f"group_{group}_{quantity}_{side}_mean"] for side in ("measured", "model")
        )
        known = np.flatnonzero(np.isfinite(measured) & np.isfinite(model))
        if known.size:
            at = int(known[np.argmax(np.abs(model - measured)[known])])
            yield {
                "heading": _heading(table.conditions[group]),
                "name": _NAMES[quantity][0],
                "unit": _NAMES[quantity][1],
                "percent": at,
                "difference": model[at] - measured[at],
                "peak": measured[known][np.argmax(np.abs(measured[known]))],
            }


def _main_group(table: WalkingTable) -> int | str:
    """The group of all walks; the only condition where there is one only."""
    return "all" if any(d.group == "all" for d in table.differences) else 0


def _heading(condition: WalkingCondition) -> str:
    """A condition's name in a title."""
    words = condition.setting_words
    return f"{condition.name}: {words}" if condition.name else words


def _has_curves(arrays: Arrays, group: int | str, quantity: str) -> bool:
    """Whether there is anything to draw of a quantity in a group."""
    curve = arrays.get(f"group_{group}_{quantity}_measured_mean")
    return curve is not None and bool(np.isfinite(curve).any())


def _difference_figure(table: WalkingTable, arrays: Arrays) -> Figure:
    """Model less plate over stance: a panel a quantity, conditions in colour, all walks black with
    their band, below it where they differ."""
    group = _main_group(table)
    shown = [name for name in _NAMES if _has_curves(arrays, group, name)]
    down = -(-len(shown) // 2)
    with drawing(PANEL[0], 0.8 + 1.5 * down) as figure:
        panels = figure.subplots(down, 2, sharex=True, squeeze=False).ravel()
        for axes, name in zip(panels, shown, strict=False):
            _panel(axes, table, arrays, name, group)
        for axes in panels[len(shown) :]:
            axes.set_axis_off()
        for axes in panels[max(0, len(shown) - 2) : len(shown)]:
            axes.set_xlabel("stance (%)")
            axes.tick_params(labelbottom=True)
        panels[0].set_xlim(0.0, 100.0)
        handles: list[Artist] = [entry("mean of all walks", color="black", linewidth=2.0)]
        if any(d.method for d in table.differences if d.group == group):
            handles += [
                Patch(facecolor=NEUTRAL, alpha=0.4, label="its 95 % band"),
                entry("different from zero", color="0.1", linewidth=4.0),
            ]
        handles += [
            entry(name_of(c), color=colour_of(c, table.conditions), linewidth=1.3)
            for c in (table.conditions if group == "all" else ())
        ]
        figure.legend(handles=handles, loc="lower center", ncols=2)
        say_synthetic(figure, table.synthetic, "walks")
    return figure


def _panel(axes: Axes, table: WalkingTable, arrays: Arrays, name: str, group: int | str) -> None:
    own = next(d for d in table.differences if d.group == group and d.quantity == name)
    mean, low, high = (
        arrays[f"group_{group}_{name}_difference_{key}"] for key in ("mean", "low", "high")
    )
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    for region in own.regions:
        axes.plot(
            (region.start_percent, region.end_percent),
            [0.02, 0.02],
            color="0.1",
            linewidth=4.0,
            solid_capstyle="butt",
            transform=axes.get_xaxis_transform(),
        )
    axes.fill_between(_PERCENT, low, high, color=NEUTRAL, alpha=0.35, linewidth=0.0)
    for i, condition in enumerate(table.conditions if group == "all" else ()):
        if _has_curves(arrays, i, name):
            axes.plot(
                _PERCENT,
                arrays[f"group_{i}_{name}_difference_mean"],
                linewidth=1.3,
                color=colour_of(condition, table.conditions),
            )
    axes.plot(_PERCENT, mean, color="black", linewidth=2.0)
    title, unit = _NAMES[name]
    label(axes, x="", y=f"({unit})", title=_short(title))


def _short(title: str) -> str:
    """A quantity over a narrow panel."""
    return (title[0].upper() + title[1:]).partition(" (")[0].replace("Centre of pressure", "CoP")


def _ensemble_figure(
    table: WalkingTable, arrays: Arrays, quantities: Sequence[str], conditions: Sequence[int]
) -> Figure:
    """Curves over stance, experiment solid and simulation dashed, as in the paper's Figures 5 to 7:
    a row a quantity, a column a condition (indices in `table.conditions`); both must be among the
    arrays."""
    with drawing(PANEL[0], 0.8 + 1.35 * len(quantities)) as figure:
        panels = figure.subplots(
            len(quantities), len(conditions), sharex=True, sharey="row", squeeze=False
        )
        for column, group in enumerate(conditions):
            setting = table.conditions[group]
            colour = colour_of(setting, table.conditions)
            for row, name in enumerate(quantities):
                _draw(panels[row, column], arrays, f"group_{group}_{name}", colour)
                title, unit = _NAMES[name]
                label(
                    panels[row, column],
                    x="stance (%)" if row == len(quantities) - 1 else "",
                    y=f"{_short(title).replace(' ', chr(10), 1)}\n({unit})" if column == 0 else "",
                    title=setting.setting_short if row == 0 else "",
                )
        panels[0, 0].set_xlim(0.0, 100.0)
        handles = [
            entry(plate_name(table.synthetic), color=NEUTRAL, **MEASURED),
            entry("simulated", color="0.2", **SIMULATED),
        ]
        figure.legend(handles=handles, loc="lower center", ncols=2)
    return figure


def _draw(axes: Axes, arrays: Arrays, key: str, colour: Any) -> None:
    axes.axhline(0.0, color="0.75", linewidth=0.7)
    if f"{key}_measured_mean" not in arrays:
        axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center", color="0.35")
        return
    measured, spread, model = (
        arrays[f"{key}_{name}"] for name in ("measured_mean", "measured_sd", "model_mean")
    )
    if np.isfinite(spread).any():
        axes.fill_between(
            _PERCENT, measured - spread, measured + spread, color=colour, alpha=0.22, linewidth=0.0
        )
    axes.plot(_PERCENT, measured, color=colour, **MEASURED)
    axes.plot(_PERCENT, model, color=colour, **SIMULATED)


def walk_errors_figure(table: WalkingTable) -> Figure:
    """The resultant's error of every walk beside its null model's, softest setting on top."""
    rows = table.rows
    with drawing(PANEL[0], 1.2 + 0.24 * max(min(len(rows), _MOST_NAMED), 6)) as figure:
        axes = figure.subplots()
        for place, row in enumerate(rows):
            colour = colour_of(row, rows)
            error, null = 100.0 * np.array([row.error_bw, row.null_bw], dtype=float)
            axes.plot([error, null], [place, place], color=colour, linewidth=1.0)
            axes.plot(null, place, marker="x", color="0.1", markersize=6, zorder=4)
            axes.plot(error, place, **mark(colour, row.role != "held out", markersize=7))
        axes.set_ylim(len(rows) - 0.4, -0.6)
        axes.set_yticks(
            range(len(rows)),
            [
                f"{row.label}, {row.setting_short}" if len(rows) <= _MOST_NAMED else ""
                for row in rows
            ],
        )
        axes.set_xlim(left=0.0)
        axes.grid(False, axis="y")
        handles = [
            entry(role, **mark("0.2", role != "held out", markersize=7))
            for role in dict.fromkeys(row.role for row in rows)
        ]
        handles.append(entry("null model", color="0.1", marker="x", linestyle=""))
        figure.legend(handles=handles, loc="lower center", ncols=len(handles))
        label(axes, x="resultant force, RMS error (% BW)", y="")
        say_synthetic(figure, table.synthetic, "walks")
    return figure
