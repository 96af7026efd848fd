"""The sensitivity chapter: what of the model's uncertainty matters for force, centre of pressure and keel energy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsf_drake.report.page import Chapter
from vsf_drake.report.style import Arrays, drawing, label, say_synthetic

if TYPE_CHECKING:
    from vsf_drake.analysis.validation.sensitivity_indices import Index
    from vsf_drake.analysis.validation.sensitivity_section import GroupedEffect, SensitivityTable


class Output(NamedTuple):
    """How an output of the study is shown: its name, unit, scale of the stored value, and number format."""

    name: str
    unit: str
    scale: float = 1.0
    form: str = "{:.2f}"


OUTPUTS = {
    "grf_rmse_bw": Output("resultant GRF error", "% BW", 100.0, "{:.1f}"),
    "cop_rmse_fl": Output("CoP error", "% foot length", 100.0, "{:.2f}"),
    "cop_shift_mm": Output("mean CoP shift", "mm", 1.0, "{:.1f}"),
    "peak_vertical_bw": Output("peak vertical force", "% BW", 100.0, "{:.1f}"),
    "spring_stored_j": Output("energy stored", "J"),
    "spring_returned_j": Output("energy returned", "J"),
    "spring_return_ratio": Output("return ratio", "%", 100.0, "{:.2f}"),
    "keel_stored_j": Output("energy stored in the keel alone", "J"),
}
MAIN = ("grf_rmse_bw", "cop_rmse_fl", "spring_returned_j")
"""What the chapter draws."""
GROUPS = {  # colours of Okabe and Ito, told apart with any colour vision, and a hatch each for grey print
    "kinematics": ("#D55E00", ""), "geometry": ("#E69F00", "///"), "bushing": ("#009E73", "..."),
    "contact": ("#0072B2", "\\\\\\"), "friction": ("#56B4E9", "ooo"), "keel": ("#CC79A7", "xxx")}
MOST = 12
"""Factors in a panel of the screening, and in the table by condition."""
_NAMED = 4
_HEIGHT = 0.38


def sensitivity_chapter(table: SensitivityTable, arrays: Arrays) -> Chapter:
    """Made of a `sensitivity_section` alone; `arrays` is empty."""
    screened = _shown(table.morris)
    by_kind = [(kind, rows, _shown(rows)) for kind, rows in _indices(table)]
    indices = [(OUTPUTS[name], rows[name] or ()) for _, rows, names in by_kind for name in names]
    stable = [(known, OUTPUTS[name].name) for name in screened if (known := table.stability[name]) is not None]
    facts = {**vars(table), "screened": bool(screened), "most": MOST,
             "label": table.conditions[table.indexed].label,  # of the trial of indices and percentiles
             "findings": [{
                 "output": OUTPUTS[name], "baseline": table.baseline[name].mean, "spread": table.spread[name],
                 "strongest": _strongest(table.morris[name] or (), _NAMED),
                 "groups": _largest(table.sobol[name] or (), 3)} for name in screened],
             "least_stable": min(stable, default=None),
             "indices": [(output, _largest(rows, 2)) for output, rows in indices],
             "interactions": [(OUTPUTS[name], table.interaction[name], table.interaction_conf[name])
                              for name in _shown(table.sobol) if table.interaction[name] is not None],
             "explained_by_few": [(OUTPUTS[name], table.explained[name]) for name in _shown(table.sobol_factors)
                                  if table.explained[name] is not None],
             "wide": [(row, output) for output, rows in indices for row in rows if row.st_wide],
             "first_order_wide": [row.s1_wide for _, rows in indices for row in rows],
             "index_tables": [_index_table(kind, rows, names) for kind, rows, names in by_kind if names],
             "output_rows": _output_rows(table),
             "drops": [(OUTPUTS[name], count) for name, of in table.failures.dropped.items()
                       if (count := sum(value or 0 for value in vars(of).values()))]}
    figures = {}
    if screened:
        facts |= _screening_tables(table, screened)
        figures["sensitivity_screening"] = screening_figure(table)
    if indices:
        figures["sensitivity_indices"] = indices_figure(table)
    return Chapter(name="sensitivity", title="Sensitivity", template="validation/sensitivity.html.j2", facts=facts,
                   figures=figures)


def _indices(table: SensitivityTable) -> list[tuple[str, Mapping[str, Sequence[Index] | None]]]:
    """What indices are of, and their rows by output."""
    return [("group", table.sobol), ("factor", table.sobol_factors)]


def _shown(rows_by_output: Mapping[str, Sequence[object] | None]) -> list[str]:
    """The MAIN outputs of which there are rows."""
    return [name for name in MAIN if rows_by_output.get(name)]


def _strongest(rows: Sequence[GroupedEffect], most: int) -> list[GroupedEffect]:
    return sorted(rows, key=lambda row: -row.mu_star)[:most]


def _largest(rows: Sequence[Index], most: int | None = None) -> list[Index]:
    return sorted(rows, key=lambda row: -row.st)[:most]


def _output_rows(table: SensitivityTable) -> list[dict[str, object]]:
    """Every output as it is, over the uncertainty, and by what it is moved most; values in the output's unit."""
    rows = []
    for name, output in OUTPUTS.items():
        spread, known = table.spread.get(name), table.baseline[name].by_condition[table.indexed]
        rows.append({
            "output": output.name, "unit": output.unit, "baseline": None if known is None else output.scale * known,
            **{p: None if spread is None else output.scale * getattr(spread, p) for p in ("p05", "p50", "p95")},
            "interaction": table.interaction.get(name), "interaction_conf": table.interaction_conf.get(name),
            "stability": table.stability.get(name), "strongest": ", ".join(table.ranking.get(name, ())[:3]) or None})
    return rows


def _screening_tables(table: SensitivityTable, screened: Sequence[str]) -> dict[str, Any]:
    """All factors by all outputs (mu* with its interval, and sigma), and mu* of the first main output by condition."""
    effects = {name: {row.name: row for row in rows} for name in OUTPUTS if (rows := table.morris.get(name))}
    factors, order = {row.name: row for row in table.factors}, table.ranking[screened[0]]
    columns: list[tuple[Any, ...]] = [
        ("factor", "factor"), ("group", "group"),
        ("local_grf_bw", "resultant, derivative (% BW)", "{:.2f}", 100.0)]
    for name in effects:
        output = OUTPUTS[name]
        parts = {"mu_star": f"{output.name} mu* ({output.unit})"}
        parts |= {"mu_star_conf": "±", "mu": "mu", "sigma": "sigma"} if name in screened else {}
        columns += [(f"{name}_{key}", heading, "{:.2f}", output.scale) for key, heading in parts.items()]
    by_condition, first = table.morris_by_condition[screened[0]], OUTPUTS[screened[0]]
    return {
        "screening_columns": columns,
        "screening_rows": [
            {"factor": factor, "group": factors[factor].group, "local_grf_bw": factors[factor].local_grf_bw,
             **{f"{name}_{key}": getattr(rows[factor], key) for name, rows in effects.items()
                for key in ("mu", "mu_star", "mu_star_conf", "sigma")}} for factor in order],
        "condition_columns": [("factor", "factor"), *(
            (f"condition_{n}", f"{one.fulcrum_mm:g} mm ({one.label})", "{:.2f}", first.scale)
            for n, one in enumerate(table.conditions))],
        "condition_rows": [
            {"factor": factor, **{f"condition_{n}": None if one is None else one[list(factors).index(factor)]
                                  for n, one in enumerate(by_condition)}} for factor in order[:MOST]]}


def _index_table(kind: str, by_output: Mapping[str, Sequence[Index] | None], names: Sequence[str]) -> tuple[Any, ...]:
    """Name, kind, rows and columns of the indices of groups or of factors for the main outputs."""
    indices = {name: {row.name: row for row in by_output[name] or ()} for name in names}
    rows = [{"name": one.name, **{f"{name}_{part}": getattr(indices[name][one.name], part) for name in names
                                  for part in ("s1", "s1_conf", "st", "st_conf")}}
            for one in _largest(by_output[names[0]] or ())]
    columns = [("name", kind), *((f"{name}_{part}", heading, "{:.2f}") for name in names for part, heading in (
        ("s1", f"{OUTPUTS[name].name}: first order"), ("s1_conf", "±"), ("st", "total"), ("st_conf", "±")))]
    return f"sensitivity_{kind}_indices", kind, rows, columns


def indices_figure(table: SensitivityTable) -> Figure:
    """First-order and total indices: a row of panels for groups, one for single factors; outputs side by side.

    Of groups or of factors at least one main output must have rows.
    """
    blocks = [(kind, rows, names) for kind, rows in _indices(table) if (names := _shown(rows))]
    across = max(len(names) for _, _, names in blocks)
    of = {row.name: row.group for row in table.factors}
    with drawing(11.0 if across > 1 else 6.5, 0.9 + 3.1 * len(blocks)) as figure:
        panels = figure.subplots(len(blocks), across, squeeze=False)
        for line, (kind, by_output, names) in zip(panels, blocks, strict=True):
            for axes, name in zip(line, names, strict=False):
                rows = _largest(by_output[name] or ())
                for place, row in enumerate(rows):
                    first, total = place - _HEIGHT / 2, place + _HEIGHT / 2
                    look = _look(of[row.name] if kind == "factor" else row.name)
                    axes.barh(first, max(row.s1, 0.0), height=_HEIGHT, **look)
                    axes.barh(total, row.st, height=_HEIGHT, facecolor="white", edgecolor="black", linewidth=0.9)
                    for index, half, at in ((row.s1, row.s1_conf, first), (row.st, row.st_conf, total)):
                        ends = [max(index + sign * half, 0.0) for sign in (-1.0, 1.0)]
                        axes.plot(ends, [at, at], color="black", linewidth=1.0, clip_on=False)
                _name_bars(axes, rows)
                label(axes, x="share of the variance (1)", y=kind, title=OUTPUTS[name].name)
            for axes in line[len(names):]:
                axes.set_axis_off()
        handles = [Patch(facecolor="0.6", edgecolor="black", linewidth=0.5, label="first order: alone (coloured)"),
                   Patch(facecolor="white", edgecolor="black", linewidth=0.9, label="total: with all interactions"),
                   *(Patch(label=group, **_look(group)) for group in GROUPS)]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
        say_synthetic(figure, table.synthetic, "trials")
    return figure


def _name_bars(axes: Axes, rows: Sequence[Index | GroupedEffect]) -> None:
    """The names of horizontal bars, the first on top."""
    axes.set_yticks(np.arange(len(rows)), [row.name for row in rows], fontsize=8.0)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(left=0.0)
    axes.grid(False, axis="y")


def _look(group: str) -> dict[str, Any]:
    """Colour and hatch of a group's bars."""
    colour, hatch = GROUPS.get(group, ("0.5", ""))
    return {"facecolor": colour, "hatch": hatch, "edgecolor": "black", "linewidth": 0.5}


def screening_figure(table: SensitivityTable) -> Figure:
    """mu* of the MOST strongest factors, one panel an output; at least one main output must have rows."""
    shown = {name: _strongest(table.morris[name] or (), MOST) for name in _shown(table.morris)}
    with drawing(11.0 if len(shown) > 1 else 6.5, 4.8) as figure:
        for axes, (name, rows) in zip(figure.subplots(1, len(shown), squeeze=False)[0], shown.items(), strict=True):
            output, known = OUTPUTS[name], table.baseline[name].mean
            for place, row in enumerate(rows):
                size, half = output.scale * row.mu_star, output.scale * row.mu_star_conf
                axes.barh(place, size, height=0.72, **_look(row.group))
                axes.plot([max(size - half, 0.0), size + half], [place, place], color="black", linewidth=1.0)
                axes.plot(output.scale * abs(row.mu), place, marker="D", markersize=4.0, color="black",
                          markerfacecolor="white", linestyle="")
            _name_bars(axes, rows)
            baseline = "–" if known is None else f"{output.form.format(output.scale * known)} {output.unit}"
            label(axes, x=f"effect mu* ({output.unit})", y="factor", title=f"{output.name}: {baseline}")
        present = {row.group for rows in shown.values() for row in rows}
        handles: list[Any] = [Patch(label=group, **_look(group)) for group in GROUPS if group in present]
        handles += [Line2D([], [], color="black", marker="D", linestyle="", markersize=4.5, markerfacecolor="white",
                           label="size of the mean effect, signs kept"),
                    Line2D([], [], color="black", linewidth=1.0, label="95 % bootstrap interval")]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
        say_synthetic(figure, table.synthetic, "trials")
    return figure
