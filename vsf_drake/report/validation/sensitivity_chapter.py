"""The sensitivity chapter: what of the model's uncertainty matters for force, centre of pressure
and keel energy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vsf_drake.report.page import Chapter
from vsf_drake.report.style import PANEL, Arrays, drawing, label, say_synthetic
from vsf_drake.walks.quantities import JUDGED

if TYPE_CHECKING:
    from vsf_drake.validation.sensitivity_section import (
        Effect,
        Index,
        OutputRow,
        SensitivityTable,
    )


class Output(NamedTuple):
    """How an output of the study is shown: its name, one over a panel, unit, scale of the stored
    value, format."""

    name: str
    short: str
    unit: str
    scale: float = 1.0
    form: str = "{:.2f}"


OUTPUTS = {
    JUDGED: Output("resultant GRF error", "GRF error", "% BW", 100.0, "{:.1f}"),
    "cop_rmse_fl": Output("CoP error", "CoP error", "% foot length", 100.0, "{:.2f}"),
    "cop_shift_mm": Output("mean CoP shift", "CoP shift", "mm", 1.0, "{:.1f}"),
    "peak_vertical_bw": Output("peak vertical force", "peak force", "% BW", 100.0, "{:.1f}"),
    "spring_stored_j": Output("energy stored", "stored", "J"),
    "spring_returned_j": Output("energy returned", "energy returned", "J"),
}
MAIN = (JUDGED, "cop_rmse_fl", "spring_returned_j")
"""What the chapter draws."""
MOST = 6
"""Factors in a panel of the screening."""
_NAMED = 3
_BAR = "0.75"
_MARK: dict[str, Any] = {
    "color": "0.1",
    "marker": "D",
    "linestyle": "",
    "markersize": 4.5,
    "markerfacecolor": "white",
}


def sensitivity_chapter(table: SensitivityTable, arrays: Arrays) -> Chapter:
    """Made of its section alone; `arrays` is empty."""
    rows = table.outputs
    screened = [name for name in MAIN if rows[name].morris]
    by_output = _indices(table)
    indices = [(OUTPUTS[name], own) for name, own in by_output.items()]
    stable = [
        (known, OUTPUTS[name].name)
        for name in screened
        if (known := rows[name].stability) is not None
    ]
    facts = {
        **vars(table),
        "screened": bool(screened),
        # of the trial of indices and percentiles
        "label": table.conditions[table.indexed].label,
        "findings": [
            (
                OUTPUTS[name],
                rows[name],
                _strongest(rows[name].morris or ())[:_NAMED],
                _largest(rows[name].sobol or ())[:3],
            )
            for name in screened
        ],
        "least_stable": min(stable, default=None),
        "indices": [(output, _largest(own)[:2]) for output, own in indices],
        "interactions": [
            (OUTPUTS[name], row.interaction, row.interaction_conf)
            for name in MAIN
            if (row := rows[name]).interaction is not None
        ],
        "wide": [
            (row, output) for output, own in indices for row in own if 2.0 * row.st_conf > row.st
        ],
        "first_order_wide": [2.0 * row.s1_conf > row.s1 for _, own in indices for row in own],
        "output_rows": [_output_row(name, row) for name, row in rows.items()],
        "drops": [(OUTPUTS[name], row.dropped) for name, row in rows.items() if row.dropped],
    }
    figures = {}
    if screened:
        facts |= _screening_table(table, screened)
        figures["sensitivity_screening"] = screening_figure(table)
    if indices:
        facts |= _index_table(by_output)
        figures["sensitivity_indices"] = indices_figure(table)
    return Chapter(
        name="sensitivity",
        title="Sensitivity",
        template="validation/sensitivity.html.j2",
        facts=facts,
        figures=figures,
    )


def _indices(table: SensitivityTable) -> dict[str, Sequence[Index]]:
    """Rows of the groups by those of the MAIN outputs that have any."""
    return {name: rows for name in MAIN if (rows := table.outputs[name].sobol)}


def _strongest(rows: Sequence[Effect]) -> list[Effect]:
    return sorted(rows, key=lambda row: -row.mu_star)


def _largest(rows: Sequence[Index]) -> list[Index]:
    return sorted(rows, key=lambda row: -row.st)


def _output_row(name: str, row: OutputRow) -> dict[str, object]:
    """An output as it is, over the uncertainty, and by what it is moved most; values in the
    output's unit."""
    output = OUTPUTS[name]
    values = {"baseline": row.baseline_indexed, "p05": row.p05, "p50": row.p50, "p95": row.p95}
    return {
        "output": output.name,
        "unit": output.unit,
        "interaction": row.interaction,
        "interaction_conf": row.interaction_conf,
        "stability": row.stability,
        "strongest": ", ".join(one.name for one in _strongest(row.morris or ())[:3]) or None,
        **{key: None if value is None else output.scale * value for key, value in values.items()},
    }


def _screening_table(table: SensitivityTable, screened: Sequence[str]) -> dict[str, Any]:
    """All factors by all outputs: mu*, and of the main ones its interval, mu and sigma."""
    columns: list[tuple[Any, ...]] = [("factor", "factor"), ("group", "group")]
    rows: dict[str, dict[str, object]] = {
        row.name: {"factor": row.name, "group": row.group} for row in table.factors
    }
    for name, output in OUTPUTS.items():
        effects = table.outputs[name].morris
        if effects:
            parts = {"mu_star": f"{output.name} mu* ({output.unit})"}
            parts |= {"mu_star_conf": "±", "mu": "mu", "sigma": "sigma"} if name in screened else {}
            columns += [
                (f"{name}_{key}", heading, "{:.2f}", output.scale) for key, heading in parts.items()
            ]
            for one in effects:
                rows[one.name] |= {f"{name}_{key}": getattr(one, key) for key in parts}
    return {
        "screening_columns": columns,
        "screening_rows": [
            rows[one.name] for one in _strongest(table.outputs[screened[0]].morris or ())
        ],
    }


def _index_table(by_output: Mapping[str, Sequence[Index]]) -> dict[str, Any]:
    """The indices of groups for the main outputs."""
    indices = {name: {row.name: row for row in own} for name, own in by_output.items()}
    rows = [
        {
            "name": one.name,
            **{
                f"{name}_{part}": getattr(own[one.name], part)
                for name, own in indices.items()
                for part in ("s1", "s1_conf", "st", "st_conf")
            },
        }
        for one in _largest(next(iter(by_output.values())))
    ]
    columns = [
        ("name", "group"),
        *(
            (f"{name}_{part}", heading, "{:.2f}")
            for name in indices
            for part, heading in (
                ("s1", f"{OUTPUTS[name].name}: first order"),
                ("s1_conf", "±"),
                ("st", "total"),
                ("st_conf", "±"),
            )
        ),
    ]
    return {"index_rows": rows, "index_columns": columns}


def indices_figure(table: SensitivityTable) -> Figure:
    """First-order and total indices of groups, outputs side by side; at least one main output must
    have rows."""
    by_output = _indices(table)
    names = [row.name for row in _largest(next(iter(by_output.values())))]
    with drawing(PANEL[0], 1.2 + 0.24 * len(names)) as figure:
        panels = figure.subplots(1, len(by_output), squeeze=False, sharex=True, sharey=True)[0]
        for axes, (name, own) in zip(panels, by_output.items(), strict=True):
            for row in own:
                _bar(axes, names.index(row.name), row.st, row.st_conf, max(row.s1, 0.0))
            _name_bars(axes, names)
            label(axes, x="share (1)", y="", title=OUTPUTS[name].short)
        panels[0].set_xlim(left=0.0)
        _explain(figure, table, bar="total", mark="first order")
    return figure


def screening_figure(table: SensitivityTable) -> Figure:
    """mu* of the MOST strongest factors, one panel an output; at least one main output must have
    rows."""
    shown = {
        name: _strongest(effects)[:MOST] for name in MAIN if (effects := table.outputs[name].morris)
    }
    with drawing(PANEL[0], 0.8 + 1.75 * len(shown)) as figure:
        for axes, (name, rows) in zip(
            figure.subplots(len(shown), squeeze=False)[:, 0], shown.items(), strict=True
        ):
            output = OUTPUTS[name]
            for place, row in enumerate(rows):
                sizes = (row.mu_star, row.mu_star_conf, abs(row.mu))
                _bar(axes, place, *(output.scale * size for size in sizes))
            _name_bars(axes, [row.name for row in rows])
            axes.set_xlim(left=0.0)
            label(axes, x=f"effect ({output.unit})", y="", title=output.name)
        _explain(figure, table, bar="mean size", mark="mean, signs kept")
    return figure


def _bar(axes: Axes, place: int, size: float, half: float, mark: float) -> None:
    """A horizontal bar with the interval of its end, and a mark."""
    axes.barh(place, size, height=0.7, color=_BAR)
    axes.plot([max(size - half, 0.0), size + half], [place, place], color="0.1")
    axes.plot(mark, place, clip_on=False, **_MARK)


def _name_bars(axes: Axes, names: Sequence[str]) -> None:
    """The names of horizontal bars, the first on top."""
    axes.set_yticks(np.arange(len(names)), names)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.grid(False, axis="y")


def _explain(figure: Figure, table: SensitivityTable, *, bar: str, mark: str) -> None:
    handles = [
        Patch(facecolor=_BAR, label=bar),
        Line2D([], [], label=mark, **_MARK),
        Line2D([], [], color="0.1", label="95 % interval"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=3)
    say_synthetic(figure, table.synthetic, "trials")
