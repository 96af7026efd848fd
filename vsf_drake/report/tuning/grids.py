"""Tables of a tuning: each row of them is one of tuning.json, with nothing left out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vsf_drake.report.pieces import Column, Grid
from vsf_drake.report.tuning.choices_figure import excess

_FULCRUM = Column(key="fulcrum_mm", heading="fulcrum (mm)", form="{:.1f}")
_NUMBER = "{:.4g}"


def sweep_grid(table: Mapping[str, Any]) -> Grid:
    """The cost over the range, with its terms and the outcomes, a row a position."""
    unit, labels = table["cost_unit"], {row["name"]: row["label"] for row in table["terms"]}
    titles = {row["name"]: f"{row['label']} ({row['unit']})" for row in table["outcomes"]}
    names = {part: list(dict.fromkeys(name for row in table["sweep"] for name in row[part] or ()))
             for part in ("terms", "outcomes")}
    columns = [_FULCRUM, Column(key="cost", heading=f"cost ({unit})", form=_NUMBER)]
    columns += [Column(key=f"term_{name}", heading=labels.get(name, name), form=_NUMBER) for name in names["terms"]]
    columns += [Column(key=f"outcome_{name}", heading=titles.get(name, name), form=_NUMBER)
                for name in names["outcomes"]]
    rows = [{"fulcrum_mm": row["fulcrum_mm"], "cost": row["cost"],
             **{f"term_{name}": value for name, value in (row["terms"] or {}).items()},
             **{f"outcome_{name}": value for name, value in (row["outcomes"] or {}).items()}}
            for row in table["sweep"]]
    return Grid(name="sweep", columns=columns, rows=rows, caption=(
        f"The whole range, a row a position of the fulcrum. Terms are parts of the cost, in {unit}."))


def outcome_grid(table: Mapping[str, Any]) -> Grid:
    """What changes with the setting, and whether by more than its uncertainty."""
    here = "optimum" if table["optimal"] else "last iterate"
    said = {True: "yes", False: "NO", None: None}
    return Grid(name="outcomes", rows=[{**row, "told": said[row["matters"]]} for row in table["outcomes"]], columns=[
        Column(key="label", heading="outcome"), Column(key="unit", heading="unit"),
        Column(key="softest", heading="softest", form=_NUMBER), Column(key="optimum", heading=here, form=_NUMBER),
        Column(key="stiffest", heading="stiffest", form=_NUMBER),
        Column(key="recorded", heading="recorded setting", form=_NUMBER),
        Column(key="uncertainty", heading="uncertainty", form=_NUMBER), Column(key="told", heading="matters")],
        caption="Outcomes by setting. Matters: whether the outcome changes over the range by more than its "
                "uncertainty.")


def design_grid(table: Mapping[str, Any]) -> Grid:
    """What was chosen besides the fulcrum."""
    return Grid(name="design", rows=table["design"], columns=[
        Column(key="name", heading="variable"), Column(key="value", heading="chosen", form=_NUMBER),
        Column(key="unit", heading="unit"), Column(key="low", heading="lowest", form=_NUMBER),
        Column(key="high", heading="highest", form=_NUMBER), Column(key="default", heading="before", form=_NUMBER)],
        caption="What the optimisation could choose, within these bounds.")


def term_grid(table: Mapping[str, Any]) -> Grid:
    """What the cost is made of."""
    here = "optimum" if table["optimal"] else "last iterate"
    return Grid(name="terms", rows=table["terms"], columns=[
        Column(key="label", heading="term"), Column(key="value", heading=f"value ({table['cost_unit']})", form=_NUMBER),
        Column(key="share", heading="share (%)", form="{:.1f}", scale=100.0)],
        caption=f"What the cost is made of at the {here}.")


def check_grid(table: Mapping[str, Any]) -> Grid:
    """What was tried to show the result wrong."""
    return Grid(name="checks", rows=table["checks"], columns=[
        Column(key="label", heading="check"), Column(key="value", heading="found", form=_NUMBER),
        Column(key="unit", heading="unit"), Column(key="target", heading="asked", form="{:g}"),
        Column(key="met", heading="met"), Column(key="sentence", heading="meaning")],
        caption="Checks of this very result; one that is not met is marked.")


def confirmation_grid(table: Mapping[str, Any]) -> Grid:
    """Other solvers on the same problem."""
    return Grid(name="confirmed_by", rows=table["confirmed_by"], columns=[
        Column(key="solver", heading="solver"), Column(key="start", heading="began from"), _FULCRUM,
        Column(key="cost", heading=f"cost ({table['cost_unit']})", form="{:.6g}"),
        Column(key="success", heading="converged"), Column(key="message", heading="in its words")],
        caption="The same problem by other solvers.")


def start_grid(table: Mapping[str, Any]) -> Grid:
    """Where searches began and ended."""
    return Grid(name="starts", rows=table["starts"], columns=[
        Column(key="fulcrum_mm", heading="began at (mm)", form="{:.1f}"),
        Column(key="end_mm", heading="ended at (mm)", form="{:.1f}"),
        Column(key="cost", heading=f"cost ({table['cost_unit']})", form="{:.6g}"),
        Column(key="success", heading="converged")],
        caption="Searches from different settings: where they end together, there is one optimum.")


def task_grid(table: Mapping[str, Any]) -> Grid:
    """One setting each against one for all."""
    rows = [{**row, "excess": excess(row)} for row in table["tasks"]]
    relative = all(row["cost"] is not None and row["cost"] > 0.0 for row in rows)
    unit = table["cost_unit"]
    return Grid(name="tasks", rows=rows, columns=[
        Column(key="label", heading="task"), Column(key="fulcrum_mm", heading="own setting (mm)", form="{:.1f}"),
        Column(key="cost", heading=f"cost there ({unit})", form=_NUMBER),
        Column(key="cost_common", heading=f"with one for all ({unit})", form=_NUMBER),
        Column(key="excess", heading=f"more ({'%' if relative else unit})", form="{:.2f}")],
        caption="Each task with a setting of its own, and with one setting for all.")


def pareto_grid(table: Mapping[str, Any]) -> Grid:
    """Points of the front."""
    first, second = (name.replace("_", " ") for name in table["pareto_names"])
    return Grid(name="pareto", rows=table["pareto"], columns=[
        Column(key="weight", heading=f"weight of {second}", form="{:g}"), _FULCRUM,
        Column(key="first", heading=first, form=_NUMBER), Column(key="second", heading=second, form=_NUMBER)],
        caption="The front of two costs, a row a weight between them.")


def robustness_grid(table: Mapping[str, Any]) -> Grid:
    """The optimum when something is changed."""
    return Grid(name="robustness", rows=table["robustness"], columns=[
        Column(key="what", heading="changed"), _FULCRUM,
        Column(key="cost", heading=f"cost ({table['cost_unit']})", form=_NUMBER)],
        caption="The optimum found again with something changed that is not known exactly.")
