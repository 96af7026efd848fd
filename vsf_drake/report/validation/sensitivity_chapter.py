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
    from vsf_drake.analysis.validation.sensitivity_indices import Effect, Index
    from vsf_drake.analysis.validation.sensitivity_section import OutputRow, SensitivityTable


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
}
MAIN = ("grf_rmse_bw", "cop_rmse_fl", "spring_returned_j")
"""What the chapter draws."""
GROUPS = {  # colours of Okabe and Ito, told apart with any colour vision, and a hatch each for grey print
    "kinematics": ("#D55E00", ""), "geometry": ("#E69F00", "///"), "bushing": ("#009E73", "..."),
    "contact": ("#0072B2", "\\\\\\"), "friction": ("#56B4E9", "ooo"), "keel": ("#CC79A7", "xxx")}
MOST = 12
"""Factors in a panel of the screening."""
_NAMED = 4
_HEIGHT = 0.38


def sensitivity_chapter(table: SensitivityTable, arrays: Arrays) -> Chapter:
    """Made of a `sensitivity_section` alone; `arrays` is empty."""
    rows = table.outputs
    screened = [name for name in MAIN if rows[name].morris]
    by_output = _indices(table)
    indices = [(OUTPUTS[name], own) for name, own in by_output.items()]
    stable = [(known, OUTPUTS[name].name) for name in screened if (known := rows[name].stability) is not None]
    facts = {**vars(table), "screened": bool(screened), "most": MOST,
             "label": table.conditions[table.indexed].label,  # of the trial of indices and percentiles
             "findings": [(OUTPUTS[name], rows[name], _strongest(rows[name].morris or ())[:_NAMED],
                           _largest(rows[name].sobol or ())[:3]) for name in screened],
             "least_stable": min(stable, default=None),
             "indices": [(output, _largest(own)[:2]) for output, own in indices],
             "interactions": [(OUTPUTS[name], row.interaction, row.interaction_conf) for name in MAIN
                              if (row := rows[name]).interaction is not None],
             "wide": [(row, output) for output, own in indices for row in own if 2.0 * row.st_conf > row.st],
             "first_order_wide": [2.0 * row.s1_conf > row.s1 for _, own in indices for row in own],
             "output_rows": [_output_row(name, row) for name, row in rows.items()],
             "drops": [(OUTPUTS[name], row.dropped) for name, row in rows.items() if row.dropped]}
    figures = {}
    if screened:
        facts |= _screening_table(table, screened)
        figures["sensitivity_screening"] = screening_figure(table)
    if indices:
        facts |= _index_table(by_output)
        figures["sensitivity_indices"] = indices_figure(table)
    return Chapter(name="sensitivity", title="Sensitivity", template="validation/sensitivity.html.j2", facts=facts,
                   figures=figures)


def _indices(table: SensitivityTable) -> dict[str, Sequence[Index]]:
    """Rows of the groups by those of the MAIN outputs that have any."""
    return {name: rows for name in MAIN if (rows := table.outputs[name].sobol)}


def _strongest(rows: Sequence[Effect]) -> list[Effect]:
    return sorted(rows, key=lambda row: -row.mu_star)


def _largest(rows: Sequence[Index]) -> list[Index]:
    return sorted(rows, key=lambda row: -row.st)


def _output_row(name: str, row: OutputRow) -> dict[str, object]:
    """An output as it is, over the uncertainty, and by what it is moved most; values in the output's unit."""
    output = OUTPUTS[name]
    values = {"baseline": row.baseline_indexed, "p05": row.p05, "p50": row.p50, "p95": row.p95}
    return {"output": output.name, "unit": output.unit, "interaction": row.interaction,
            "interaction_conf": row.interaction_conf, "stability": row.stability,
            "strongest": ", ".join(one.name for one in _strongest(row.morris or ())[:3]) or None,
            **{key: None if value is None else output.scale * value for key, value in values.items()}}


def _screening_table(table: SensitivityTable, screened: Sequence[str]) -> dict[str, Any]:
    """All factors by all outputs: mu*, and of the main ones its interval, mu and sigma."""
    columns: list[tuple[Any, ...]] = [("factor", "factor"), ("group", "group")]
    rows: dict[str, dict[str, object]] = {row.name: {"factor": row.name, "group": row.group} for row in table.factors}
    for name, output in OUTPUTS.items():
        effects = table.outputs[name].morris
        if effects:
            parts = {"mu_star": f"{output.name} mu* ({output.unit})"}
            parts |= {"mu_star_conf": "±", "mu": "mu", "sigma": "sigma"} if name in screened else {}
            columns += [(f"{name}_{key}", heading, "{:.2f}", output.scale) for key, heading in parts.items()]
            for one in effects:
                rows[one.name] |= {f"{name}_{key}": getattr(one, key) for key in parts}
    return {"screening_columns": columns,
            "screening_rows": [rows[one.name] for one in _strongest(table.outputs[screened[0]].morris or ())]}


def _index_table(by_output: Mapping[str, Sequence[Index]]) -> dict[str, Any]:
    """The indices of groups for the main outputs."""
    indices = {name: {row.name: row for row in own} for name, own in by_output.items()}
    rows = [{"name": one.name, **{f"{name}_{part}": getattr(own[one.name], part) for name, own in indices.items()
                                  for part in ("s1", "s1_conf", "st", "st_conf")}}
            for one in _largest(next(iter(by_output.values())))]
    columns = [("name", "group"), *((f"{name}_{part}", heading, "{:.2f}") for name in indices for part, heading in (
        ("s1", f"{OUTPUTS[name].name}: first order"), ("s1_conf", "±"), ("st", "total"), ("st_conf", "±")))]
    return {"index_rows": rows, "index_columns": columns}


def indices_figure(table: SensitivityTable) -> Figure:
    """First-order and total indices of groups, outputs side by side; at least one main output must have rows."""
    by_output = _indices(table)
    with drawing(11.0 if len(by_output) > 1 else 6.5, 4.0) as figure:
        for axes, (name, own) in zip(figure.subplots(1, len(by_output), squeeze=False)[0], by_output.items(),
                                     strict=True):
            rows = _largest(own)
            for place, row in enumerate(rows):
                first, total = place - _HEIGHT / 2, place + _HEIGHT / 2
                axes.barh(first, max(row.s1, 0.0), height=_HEIGHT, **_look(row.name))
                axes.barh(total, row.st, height=_HEIGHT, facecolor="white", edgecolor="black", linewidth=0.9)
                for index, half, at in ((row.s1, row.s1_conf, first), (row.st, row.st_conf, total)):
                    ends = [max(index + sign * half, 0.0) for sign in (-1.0, 1.0)]
                    axes.plot(ends, [at, at], color="black", linewidth=1.0, clip_on=False)
            _name_bars(axes, rows)
            label(axes, x="share of the variance (1)", y="group", title=OUTPUTS[name].name)
        handles = [Patch(facecolor="0.6", edgecolor="black", linewidth=0.5, label="first order: alone (coloured)"),
                   Patch(facecolor="white", edgecolor="black", linewidth=0.9, label="total: with all interactions"),
                   *(Patch(label=group, **_look(group)) for group in GROUPS)]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
        say_synthetic(figure, table.synthetic, "trials")
    return figure


def _name_bars(axes: Axes, rows: Sequence[Index | Effect]) -> None:
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
    shown = {name: _strongest(effects)[:MOST] for name in MAIN if (effects := table.outputs[name].morris)}
    group = {row.name: row.group for row in table.factors}
    with drawing(11.0 if len(shown) > 1 else 6.5, 4.8) as figure:
        for axes, (name, rows) in zip(figure.subplots(1, len(shown), squeeze=False)[0], shown.items(), strict=True):
            output, known = OUTPUTS[name], table.outputs[name].baseline
            for place, row in enumerate(rows):
                size, half = output.scale * row.mu_star, output.scale * row.mu_star_conf
                axes.barh(place, size, height=0.72, **_look(group[row.name]))
                axes.plot([max(size - half, 0.0), size + half], [place, place], color="black", linewidth=1.0)
                axes.plot(output.scale * abs(row.mu), place, marker="D", markersize=4.0, color="black",
                          markerfacecolor="white", linestyle="")
            _name_bars(axes, rows)
            baseline = "–" if known is None else f"{output.form.format(output.scale * known)} {output.unit}"
            label(axes, x=f"effect mu* ({output.unit})", y="factor", title=f"{output.name}: {baseline}")
        present = {group[row.name] for rows in shown.values() for row in rows}
        handles: list[Any] = [Patch(label=group, **_look(group)) for group in GROUPS if group in present]
        handles += [Line2D([], [], color="black", marker="D", linestyle="", markersize=4.5, markerfacecolor="white",
                           label="size of the mean effect, signs kept"),
                    Line2D([], [], color="black", linewidth=1.0, label="95 % bootstrap interval")]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
        say_synthetic(figure, table.synthetic, "trials")
    return figure
