"""The report's chapter on walking: a function of the saved section."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsf_drake.report.fit_figures import TrialSweep, fit_sweep_figure
from vsf_drake.report.page import Chapter
from vsf_drake.report.style import MEASURED, NEUTRAL, SIMULATED, Arrays, colour_of, drawing, label, say_synthetic

if TYPE_CHECKING:
    from vsf_drake.analysis.validation.walking_section import WalkingCondition, WalkingTable, WalkRow

_ACROSS = 3
"""Conditions side by side in a figure."""
_FORCES = ("vertical", "fore_aft", "medio_lateral", "resultant")
_PATHS = ("cop", "impulse", "free_moment")
_POINTWISE = "pointwise bootstrap"
"""The method of a section that was made without spm1d, as it is saved."""
_PERCENT = np.linspace(0.0, 100.0, 101)
_NAMES = {
    "resultant": ("resultant force", "BW", "resultant\nforce (BW)"),
    "vertical": ("vertical force", "BW", "vertical\nforce (BW)"),
    "fore_aft": ("fore-aft force (forward +)", "BW", "fore-aft\nforce (BW)"),
    "medio_lateral": ("medio-lateral force (left +)", "BW", "medio-lateral\nforce (BW)"),
    "impulse": ("impulse of the resultant", "BW s", "impulse of the\nresultant (BW s)"),
    "cop": ("centre of pressure, fore-aft", "FL", "centre of pressure,\nahead of the plate's\nrearmost (foot lengths)"),
    "free_moment": ("free moment (up +)", "N m", "free moment\n(N m)")}
"""Quantities by key: how a sentence calls them, their unit, and the label of their axis."""
_PAPER_IMPULSE_BWS = (0.01, 0.05)
"""The range of the paper's errors of the impulse."""
_LINES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (6, 1.5, 1, 1.5)), (0, (3, 1, 1, 1, 1, 1)))
_MOST_NAMED = 24
"""Walks that an axis has room to name."""


def walking_chapter(table: WalkingTable, arrays: Arrays) -> Chapter:
    """Table 3, Figures 5 to 7, null model, sweep, and where the curves differ."""
    rows, group = table.rows, _main_group(table)
    swept = [row.sweep for row in rows if row.sweep and row.sweep.right is not None]
    ends = [sweep for sweep in swept if sweep.at_end]
    limits = [(d.n, d.threshold) for d in table.differences if d.threshold is not None]
    figures = {"walking_errors": walk_errors_figure(table)}
    ensembles = []
    for name, quantities in (("walking_forces", _FORCES), ("walking_paths", _PATHS)):
        conditions = [i for i in range(len(table.conditions)) if any(_has_curves(arrays, i, q) for q in quantities)]
        for part in range(0, len(conditions), _ACROSS):
            own = conditions[part : part + _ACROSS]
            shown = [q for q in quantities if any(_has_curves(arrays, i, q) for i in own)]
            title = f"{name}_{part // _ACROSS + 1}" if len(conditions) > _ACROSS else name
            figures[title] = _ensemble_figure(table, arrays, shown, own)
            ensembles.append((title, list(_extremes(table, arrays, shown, own))))
    drawn = any(_has_curves(arrays, group, quantity) for quantity in _NAMES)
    if drawn:
        figures["walking_differences"] = _difference_figure(table, arrays)
    any_sweep = any(error is not None for row in rows if row.sweep for error in row.sweep.grf_rmse_bw)
    if any_sweep:
        figures["walking_sweep"] = fit_sweep_figure([
            TrialSweep(label=row.label, role=row.role, fulcrum_mm=row.fulcrum_mm, synthetic=table.synthetic,
                       sweep=row.sweep) for row in rows if row.sweep])
    facts = {
        "names": _NAMES, "pointwise": table.difference_method == _POINTWISE, "drawn_differences": drawn,
        "over_all": [d for d in table.differences if d.group == group], "ensembles": ensembles,
        "fewest_tested": min((n for n, _ in limits), default=None),
        "largest_threshold": max((threshold for _, threshold in limits), default=None),
        "times_s": [(name, float(np.mean(known))) for name, key in (
            ("heel strike", "heel_strike_error_s"), ("toe-off", "toe_off_error_s"), ("stance", "stance_error_s"))
            if (known := [value for row in rows if (value := getattr(row, key)) is not None])],
        "region_rows": [
            {"group": "all" if d.group == "all" else _heading(table.conditions[int(d.group)]), "n": d.n,
             "quantity": _NAMES[d.quantity][0], "unit": _NAMES[d.quantity][1], **vars(region),
             "p": None if (p := region.p) is None else "< 0.001" if p < 1e-3 else f"{p:.3f}"}
            for d in table.differences for region in d.regions],
        "any_sweep": any_sweep, "sweeps": len(swept), "sweeps_at_end": len(ends),
        "off_inside_mm": max((abs(sweep.off_mm) for sweep in swept
                              if not sweep.at_end and sweep.off_mm is not None), default=None),
        "sweeps_unknown": [row.label for row in rows if row.sweep and row.sweep.right is None]}
    return Chapter(name="walking", title="Walking", template="validation/walking.html.j2",
                   facts={**vars(table), **_walks(table), **facts, "exact": False}, figures=figures)


def exact_chapter(table: WalkingTable, arrays: Arrays) -> Chapter:
    """Table 3 and every walk whose motion and force belong together: what of an error is the model's own."""
    return Chapter(name="walking_exact", title="Walking without errors of measurement",
                   template="validation/walking.html.j2", facts={**vars(table), **_walks(table), "exact": True})


def _walks(table: WalkingTable) -> dict[str, Any]:
    """Rows of the tables that both chapters have."""
    return {
        "condition_rows": list(_condition_rows(table)),
        "walk_rows": [{**vars(row), "sweep_best_mm": row.sweep and row.sweep.best_mm,
                       "sweep_right": row.sweep and row.sweep.right} for row in table.rows],
        "with_spread": lambda columns: tuple(one for own in columns for one in (
            own, (f"{own[0]}_sd", "SD", own[2].replace("+", ""), *own[3:])))}


def _condition_rows(table: WalkingTable) -> Iterable[dict[str, Any]]:
    """Up to four rows a condition, the last the paper's."""
    for condition in table.conditions:
        name = _heading(condition)
        for source, own in condition.scores.items():
            row: dict[str, Any] = {"setting": name, "source": source, "n": own.n}
            for key, spread in own.spreads.items():
                row |= {key: spread.mean, f"{key}_sd": spread.sd}
            yield row
        if condition.paper:
            yield {"setting": name, "source": "paper", "n": None, **vars(condition.paper)}


def _extremes(
    table: WalkingTable, arrays: Arrays, quantities: Sequence[str], groups: Sequence[int]
) -> Iterable[dict[str, Any]]:
    """The extreme of each measured curve, and where plate and model are furthest apart."""
    for group, quantity in ((g, q) for g in groups for q in quantities if _has_curves(arrays, g, q)):
        measured, model = (arrays[f"group_{group}_{quantity}_{side}_mean"] for side in ("measured", "model"))
        known = np.flatnonzero(np.isfinite(measured) & np.isfinite(model))
        if known.size:
            at = int(known[np.argmax(np.abs(model - measured)[known])])
            yield {"heading": _heading(table.conditions[group]), "name": _NAMES[quantity][0],
                   "unit": _NAMES[quantity][1], "percent": at, "difference": model[at] - measured[at],
                   "peak": measured[known][np.argmax(np.abs(measured[known]))]}


def _main_group(table: WalkingTable) -> int | str:
    """The group of all walks; the only condition where there is one only."""
    return "all" if any(d.group == "all" for d in table.differences) else 0


def _heading(condition: WalkingCondition) -> str:
    """A condition's name in a title."""
    position = f"fulcrum {condition.fulcrum_mm:g} mm"
    return f"{condition.name}: {position}" if condition.name else position


def _has_curves(arrays: Arrays, group: int | str, quantity: str) -> bool:
    """Whether there is anything to draw of a quantity in a group."""
    curve = arrays.get(f"group_{group}_{quantity}_measured_mean")
    return curve is not None and bool(np.isfinite(curve).any())


def _difference_figure(table: WalkingTable, arrays: Arrays) -> Figure:
    """Where on the curve model and plate differ: a panel a quantity, conditions in colour, all walks black with their
    band, and below the regions that the test found."""
    group = _main_group(table)
    shown = [name for name in _NAMES if _has_curves(arrays, group, name)]
    down = -(-len(shown) // 2)
    with drawing(10.5, 0.9 + 2.1 * down) as figure:
        panels = figure.subplots(down, 2, sharex=True, squeeze=False).ravel()
        for axes, name in zip(panels, shown, strict=False):
            _panel(axes, table, arrays, name, group)
        for axes in panels[len(shown):]:
            axes.set_axis_off()
        for axes in panels[max(0, len(shown) - 2):len(shown)]:
            axes.set_xlabel("measured stance (%)")
            axes.tick_params(labelbottom=True)
        panels[0].set_xlim(0.0, 100.0)
        if len(shown) % 2:
            panels[len(shown)].legend(handles=_handles(table, group), loc="center")
        else:
            figure.legend(handles=_handles(table, group), loc="outside lower center", ncols=3)
        say_synthetic(figure, table.synthetic, "walks")
    return figure


def _panel(axes: Axes, table: WalkingTable, arrays: Arrays, name: str, group: int | str) -> None:
    own = next(d for d in table.differences if d.group == group and d.quantity == name)
    mean, low, high = (arrays[f"group_{group}_{name}_difference_{key}"] for key in ("mean", "low", "high"))
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    for region in own.regions:
        ends = region.start_percent, region.end_percent
        axes.axvspan(*ends, color="0.88", linewidth=0.0, zorder=0)
        axes.plot(ends, [0.02, 0.02], color="0.1", linewidth=4.0, solid_capstyle="butt",
                  transform=axes.get_xaxis_transform())
    axes.fill_between(_PERCENT, low, high, color=NEUTRAL, alpha=0.35, linewidth=0.0)
    for i, condition in enumerate(table.conditions if group == "all" else ()):
        if _has_curves(arrays, i, name):
            axes.plot(_PERCENT, arrays[f"group_{i}_{name}_difference_mean"], linewidth=1.3,
                      color=colour_of(condition.fulcrum_mm), linestyle=_LINES[i % len(_LINES)])
    axes.plot(_PERCENT, mean, color="black", linewidth=2.0)
    title, unit, _ = _NAMES[name]
    label(axes, x="", y=f"model less plate ({unit})", title=title[0].upper() + title[1:])


def _handles(table: WalkingTable, group: int | str) -> list[Artist]:
    own = [d for d in table.differences if d.group == group]
    count = max((d.n for d in own), default=0)
    handles: list[Artist] = [Line2D([], [], color="black", linewidth=2.0,
                                    label=f"mean of {count} walk{'s' * (count != 1)}")]
    if any(d.method for d in own):
        handles.append(Patch(facecolor=NEUTRAL, alpha=0.4, label="its pointwise 95 % bootstrap band"))
        handles.append(Line2D([], [], color="0.1", linewidth=4.0, label="they differ (α = 0.05)"))
    return handles + [Line2D([], [], color=colour_of(c.fulcrum_mm), linestyle=_LINES[i % len(_LINES)],
                           linewidth=1.3, label=f"fulcrum {c.fulcrum_mm:g} mm")
                    for i, c in enumerate(table.conditions if group == "all" else ())]


def _ensemble_figure(
    table: WalkingTable, arrays: Arrays, quantities: Sequence[str], conditions: Sequence[int]
) -> Figure:
    """Curves over stance, experiment solid and simulation dashed, as in the paper's Figures 5 to 7: a row a quantity, a
    column a condition (indices in `table.conditions`); both must be among the arrays."""
    with drawing(10.5 if len(conditions) > 1 else 6.0, 0.7 + 2.1 * len(quantities)) as figure:
        panels = figure.subplots(len(quantities), len(conditions), sharex=True, sharey="row", squeeze=False)
        bands = False
        for column, group in enumerate(conditions):
            condition = table.conditions[group]
            for row, name in enumerate(quantities):
                bands |= _draw(panels[row, column], arrays, f"group_{group}_{name}", colour_of(condition.fulcrum_mm))
                n = next((d.n for d in table.differences if d.group == group and d.quantity == name), 0)
                label(panels[row, column], x="measured stance (%)" if row == len(quantities) - 1 else "",
                      y=_NAMES[name][2] if column == 0 else "",
                      title=f"{_heading(condition)}, {n} walk{'s' * (n != 1)}" if row == 0 else "")
        panels[0, 0].set_xlim(0.0, 100.0)
        plate = "plate (SYNTHETIC)" if table.synthetic else "plate"
        handles: list[Artist] = [Line2D([], [], color=NEUTRAL, label=f"{plate}, mean", **MEASURED),
                                 Line2D([], [], color="0.2", label="simulated, mean", **SIMULATED)]
        if bands:
            handles += [Patch(facecolor=NEUTRAL, alpha=0.3, linewidth=0.0, label=f"{plate}, ± SD"),
                        Line2D([], [], color="0.2", linewidth=0.8, linestyle=":", label="simulated, ± SD")]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def _draw(axes: Axes, arrays: Arrays, key: str, colour: Any) -> bool:
    """Whether there is a band."""
    axes.axhline(0.0, color="0.75", linewidth=0.7)
    if f"{key}_measured_mean" not in arrays:
        axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center", color="0.35")
        return False
    measured, measured_sd, model, model_sd = (arrays[f"{key}_{name}"] for name in (
        "measured_mean", "measured_sd", "model_mean", "model_sd"))
    band = bool(np.isfinite(measured_sd).any())
    if band:
        axes.fill_between(_PERCENT, measured - measured_sd, measured + measured_sd, color=colour, alpha=0.22,
                          linewidth=0.0)
        for sign in (-1.0, 1.0):
            axes.plot(_PERCENT, model + sign * model_sd, color=colour, linewidth=0.8, linestyle=":")
    axes.plot(_PERCENT, measured, color=colour, **MEASURED)
    axes.plot(_PERCENT, model, color=colour, **SIMULATED)
    return band


def walk_errors_figure(table: WalkingTable) -> Figure:
    """Errors of every walk beside the null model and the paper's: resultant, centre of pressure, impulse and times; a
    place on the axis a walk, by fulcrum position."""
    rows = table.rows
    with drawing(10.5, 6.6) as figure:
        panels = figure.subplots(2, 2, sharex=True)
        for axes, key, scale in ((panels[0, 0], "grf_rmse_bw", 100.0), (panels[0, 1], "cop_rmse_fl", 100.0),
                                 (panels[1, 0], "impulse_rmse_bws", 1.0)):
            _marks(axes, rows, key, scale, marker="o", markersize=7, markeredgewidth=1.5)
            if all(getattr(row, key) is None for row in rows):
                axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center", color="0.35")
        _marks(panels[0, 1], rows, "cop_ml_rmse_fl", 100.0, shift=0.2, marker="D", markersize=4)
        for place, row in enumerate(rows):
            if row.null_model_grf_rmse_bw is not None:
                panels[0, 0].plot(place, 100.0 * row.null_model_grf_rmse_bw, marker="x", color="0.1", markersize=6)
        for axes, key in ((panels[0, 0], "grf_rmse_bw"), (panels[0, 1], "cop_rmse_fl")):
            for condition in table.conditions:
                own = [i for i, row in enumerate(rows) if row.fulcrum_mm == condition.fulcrum_mm]
                if condition.paper:
                    level = 100.0 * getattr(condition.paper, key)
                    axes.plot([own[0] - 0.4, own[-1] + 0.4], [level, level], color=NEUTRAL, linewidth=2.2, alpha=0.7)
        panels[1, 0].axhspan(*_PAPER_IMPULSE_BWS, color=NEUTRAL, alpha=0.2, linewidth=0.0)
        panels[1, 1].axhline(0.0, color="0.75", linewidth=0.7)
        for key, marker, shift in (("heel_strike_error_s", "v", -0.18), ("toe_off_error_s", "^", 0.0),
                                   ("stance_error_s", "s", 0.18)):
            _marks(panels[1, 1], rows, key, 1e3, shift=shift, marker=marker, markersize=6)
        label(panels[0, 0], x="", y="RMS error (% BW)", title="Resultant force")
        label(panels[0, 1], x="", y="RMS error (% foot length)", title="Centre of pressure (small: lateral)")
        label(panels[1, 0], x="walk", y="RMS error (BW s)", title="Impulse of the resultant")
        label(panels[1, 1], x="walk", y="model less plate (ms)", title="Times (late +)")
        for axes in panels.ravel():
            axes.set_xlim(-0.6, len(rows) - 0.4)
        for axes in panels[1]:
            axes.set_xticks(range(len(rows)), [row.label if len(rows) <= _MOST_NAMED else "" for row in rows],
                            rotation=35 if len(rows) > 3 else 0, ha="right" if len(rows) > 3 else "center")
        for axes in panels.ravel()[:3]:
            axes.set_ylim(bottom=-0.03 * axes.get_ylim()[1])
        figure.legend(handles=_error_handles(table), loc="outside lower center", ncols=4)
        say_synthetic(figure, table.synthetic, "walks")
    return figure


def _marks(axes: Axes, rows: Sequence[WalkRow], key: str, scale: float, *, shift: float = 0.0, **look: Any) -> None:
    """A mark a walk, open for what the fit has not seen."""
    for place, row in enumerate(rows):
        value = getattr(row, key)
        if value is not None:
            colour = colour_of(row.fulcrum_mm)
            axes.plot(place + shift, scale * value, color=colour,
                      markerfacecolor="white" if row.role == "held out" else colour, **look)


def _error_handles(table: WalkingTable) -> list[Artist]:
    rows = table.rows
    handles: list[Artist] = [
        Line2D([], [], color="0.2", marker="o", linestyle="", markersize=7, label=f"{role} walk",
               markerfacecolor="white" if role == "held out" else "0.2") for role in
        dict.fromkeys(row.role for row in rows)]
    if any(row.null_model_grf_rmse_bw is not None for row in rows):
        handles.append(Line2D([], [], color="0.1", marker="x", linestyle="", label="null model"))
    if any(condition.paper for condition in table.conditions):
        handles.append(Line2D([], [], color=NEUTRAL, linewidth=2.2, alpha=0.7, label="paper, per setting"))
    handles.append(Patch(facecolor=NEUTRAL, alpha=0.3, label="paper, range of all"))
    return handles + [Line2D([], [], color="0.2", marker=marker, linestyle="", markersize=6, label=name)
                    for marker, name in (("v", "heel strike"), ("^", "toe-off"), ("s", "stance time"))]
