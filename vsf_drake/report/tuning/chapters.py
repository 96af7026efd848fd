"""The chapters of the pages of a tuning and of a schedule: functions of their saved tables and arrays.

Words stand in the templates `tuning/*.html.j2`, those that the screen shows too in `tuning/words.txt.j2`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vsf_drake.report.page import Chapter, Column, Grid, listed, made_chapter, render, said
from vsf_drake.report.tuning.figures import (
    FEET,
    SETTINGS,
    cost_curve_figure,
    course_figure,
    outcomes_figure,
    pareto_figure,
    policy_figure,
    robustness_figure,
    schedule_curves_figure,
    stance_force_figure,
    stride_force_figure,
    tasks_figure,
)
from vsf_drake.report.tuning.reading import (
    Table,
    compared,
    cost_at,
    cost_outcome,
    curved,
    drawn_trials,
    excess,
    excess_unit,
    holding_terms,
    rest_at,
    root_mean_squares,
    shown_outcomes,
    swept,
    telling,
)

Arrays = Mapping[str, np.ndarray]
_NUMBER = "{:.4g}"
_MATTERS = {True: "yes", False: "NO", None: None}


def told(part: str, **facts: Any) -> list[str]:
    """The paragraphs of a macro of `tuning/words.txt.j2`, as plain text."""
    text = render("tuning/told.txt.j2", part=part, facts=facts).unescape()
    return [" ".join(paragraph.split()) for paragraph in text.split("\n\n") if paragraph.strip()]


def tuning_page(table: Table, arrays: Arrays, *, lenient: bool) -> dict[str, Any]:
    """What `page.chapter_page` is to be given: the answer, cost, outcomes, motion, choices between settings, checks,
    and how it was made; what there is of it.

    Args:
        table, arrays: of tuning.json and tuning.npz. lenient: see `page.chapter_page`.
    """
    makers: tuple[tuple[str, str, Callable[[Table, Arrays], dict[str, Any]], bool], ...] = (
        ("answer", "Answer", _answer, True),
        ("outcomes", "What changes with the setting", _outcomes, bool(table["outcomes"])),
        ("motion", "Motion and forces", _motion, True),
        ("tasks", "One setting for each task, or one for all", _tasks, bool(table["tasks"])),
        ("pareto", "Between two costs", _pareto, bool(table["pareto"])),
        ("robustness", "How firm the setting is", _robustness, bool(table["robustness"])),
        ("range", "The whole range", _range, bool(table["sweep"])),
        ("checks", "Checks", _checks, True),
        ("made", "How this was made", _made, True))
    return {"chapters": [made_chapter(name, title, partial(_chapter, name, title, make, table, arrays), lenient)
                         for name, title, make, there in makers if there],
            "title": told("title", what="Stiffness tuned", t=table)[0], "first_line": first_line(table),
            "synthetic": bool(table["synthetic"]), "alarm": "" if table["optimal"] else told("alarm", t=table)[0]}


def schedule_page(table: Table, *, lenient: bool) -> dict[str, Any]:
    """The same of a schedule: the policy, what it buys, and how it was made."""
    makers: tuple[tuple[str, str, Callable[[Table, Arrays], dict[str, Any]]], ...] = (
        ("policy", "What the device would store", _policy), ("buys", "What adaptability buys", _buys),
        ("made", "How this was made", _made))
    return {"chapters": [made_chapter(name, title, partial(_chapter, name, title, make, table, {}), lenient)
                         for name, title, make in makers],
            "title": told("title", what="Settings by task", t=table)[0], "first_line": told(
                "first_line", t=table, trials=", ".join(trial for row in table["tasks"] for trial in row["trials"]))[0],
            "synthetic": bool(table["synthetic"]),
            "alarm": "" if table["optimal"] else told("schedule_alarm", t=table)[0]}


def _chapter(
    name: str, title: str, make: Callable[[Table, Arrays], dict[str, Any]], table: Table, arrays: Arrays
) -> Chapter:
    parts = make(table, arrays)
    return Chapter(name=name, title=title, template=f"tuning/{name}.html.j2", tables=parts.pop("tables", ()),
                   figures=parts.pop("figures", {}), facts={"t": table, **parts})


def _grid(name: str, rows: Any, *columns: tuple[Any, ...]) -> Grid:
    return Grid(name, [Column(*column) for column in columns], rows)


def first_line(table: Table) -> str:
    """Whose data these are, and what the model is."""
    return told("first_line", t=table, trials=listed(table["trials"]))[0]


def answer(table: Table) -> list[str]:
    """Which setting, how much better than others, and whether that is more than the uncertainty; in sentences."""
    if not table["optimal"]:
        return told("answer", t=table)
    (x, costs), row, holding = swept(table), cost_outcome(table), holding_terms(table)
    others = [other for other in table["outcomes"] if other is not row]
    more, no_more, open_ = ([other["label"] for other in others if other["matters"] is kind]
                            for kind in (True, False, None))
    matters = None if row is None else row["matters"]
    nothing = row is None and bool(others) and not more and not open_
    places = compared(table, partial(cost_at, table), table["cost"])
    own = table["cost"] - sum(term["value"] for term in holding)
    return told(
        "answer", t=table, span=(x[0], x[-1]) if len(x) else None, row=row, places=places, holding=holding,
        size=float(costs.max() - costs.min()) if len(costs) else None,
        hardly="outcomes" if nothing else "cost" if matters is False and len(costs) else "",
        rest=compared(table, partial(rest_at, table), own) if places and holding else [],
        all_more=len(more) > max(1, len(others) - 1), more=more, no_more=no_more,
        unknown=matters is None and not more and not no_more)


def _answer(table: Table, arrays: Arrays) -> dict[str, Any]:
    x, y = swept(table)
    curve = None
    if len(x) > 1:
        low, high = int(np.argmin(y)), int(np.argmax(y))
        curve = {"span": (x[0], x[-1]), "least": y[low], "least_mm": x[low], "most": y[high], "most_mm": x[high]}
    return {
        "sentences": answer(table), "curve": curve,
        "figures": {} if curve is None else {"cost": cost_curve_figure(table, arrays)},
        "tables": [
            _grid("design", table["design"], ("name", "variable"), ("value", "chosen", _NUMBER), ("unit", "unit"),
                  ("low", "lowest", _NUMBER), ("high", "highest", _NUMBER), ("default", "before", _NUMBER)),
            _grid("terms", table["terms"], ("label", "term"), ("value", f"value ({table['cost_unit']})", _NUMBER),
                  ("share", "share (%)", "{:.1f}", 100.0))]}


def _outcomes(table: Table, arrays: Arrays) -> dict[str, Any]:
    own, shown = cost_outcome(table), []
    for row in shown_outcomes(table):
        x, y = swept(table, "outcomes", row["name"])
        shown.append({**row, "x": x[[0, -1]], "y": y[[0, -1]]})
    here = "optimum" if table["optimal"] else "last iterate"
    rows = [{**row, "told": _MATTERS[row["matters"]]} for row in table["outcomes"]]
    return {
        "sentences": [row["sentence"] for row in table["outcomes"] if row["sentence"] and row is not own],
        "shown": shown, "figures": {"outcomes": outcomes_figure(table)} if shown else {},
        "tables": [_grid("outcomes", rows, ("label", "outcome"), ("unit", "unit"), ("softest", "softest", _NUMBER),
                         ("optimum", here, _NUMBER), ("stiffest", "stiffest", _NUMBER),
                         ("recorded", "recorded setting", _NUMBER), ("uncertainty", "uncertainty", _NUMBER),
                         ("told", "matters"))]}


def _motion(table: Table, arrays: Arrays) -> dict[str, Any]:
    """Forces, motion and torques, as far as they are there; a level 1 tuning has forces only."""
    figures: dict[str, Figure] = {}
    facts: dict[str, Any] = {"stance": {}, "stride": None, "motion": None, "torque": None}
    trials = drawn_trials(table, arrays)
    if trials:
        figures["force"] = stance_force_figure(table, arrays)
        facts["stance"] = {trial: {name: np.nanmax(np.asarray(arrays[prefix + name])[:, 2])
                                   for name in ("recorded", *SETTINGS) if prefix + name in arrays}
                           for trial, prefix in trials.items()}
    if "phase" in arrays and any(f"grf_{foot}" in arrays for foot in FEET):
        figures["stride_force"] = stride_force_figure(table, arrays)
        facts["stride"] = []
        for foot, name in FEET.items():
            own = np.asarray(arrays.get(f"grf_{foot}", np.nan))
            for suffix in ("_recorded", "_resimulated_prescribed", "_resimulated_feedback"):
                other = np.asarray(arrays.get(f"grf_{foot}{suffix}", np.nan))
                if own.ndim == other.ndim == 2 and own.shape == other.shape:
                    off = float(np.sqrt(np.mean(np.sum((own - other) ** 2, axis=1))))
                    facts["stride"].append((name, suffix, off))
    if {"phase", "q", "names"} <= set(arrays):
        figures["motion"] = course_figure(table, arrays, "q")
        away, columns = root_mean_squares(arrays, "q"), []
        for i, name in enumerate(map(str, arrays["names"])):
            scale, unit = (1e3, " mm") if name in ("pelvis_tx", "pelvis_ty") else (180.0 / np.pi, "°")
            values = scale * np.asarray(arrays["q"])[:, i]
            columns.append((name, f"{values.min():.0f} to {values.max():.0f}{unit}" if away is None else
                            f"{scale * away[i]:.1f}{unit}"))
        facts["motion"] = {"compared": away is not None, "columns": columns}
    if {"phase", "torque"} <= set(arrays):
        figures["torque"] = course_figure(table, arrays, "torque")
        torques = np.asarray(arrays["torque"]).T
        names = [str(name) for name in arrays.get("names", ())][-len(torques):] or ["torque"] * len(torques)
        facts["torque"] = [(name, values.min(), values.max()) for name, values in zip(names, torques, strict=True)]
    return {**facts, "figures": figures}


def tasks_words(table: Table) -> str:
    """What adaptability buys."""
    lost = [value for row in table["tasks"] if (value := excess(row)) is not None]
    settings = [row["fulcrum_mm"] for row in table["tasks"] if row["fulcrum_mm"] is not None]
    if not lost or not settings or table["common_fulcrum_mm"] is None:
        return told("tasks", known=False)[0]
    # What of it is no gain of the person, because a term of the cost only holds to the recording.
    pairs = [(row["rest"], row["rest_common"]) for row in table["tasks"]
             if row.get("rest") is not None and row.get("rest_common") is not None]
    rest = None
    if pairs:
        more = float(np.mean([common - own for own, common in pairs]))
        rest = (more, 100.0 * abs(more) / (float(np.mean([abs(own) for own, _ in pairs])) or 1.0))
    return told("tasks", known=True, low=min(settings), high=max(settings), common=table["common_fulcrum_mm"],
                mean=float(np.mean(lost)), most=max(lost), unit=excess_unit(table), rest=rest,
                held=bool(holding_terms({"terms": [], "sweep": [], **table})), cost_unit=table["cost_unit"])[0]


def _tasks(table: Table, arrays: Arrays) -> dict[str, Any]:
    unit = table["cost_unit"]
    rows = [{**row, "excess": excess(row)} for row in table["tasks"]]
    return {
        "buys": tasks_words(table), "intervals": False, "figures": {"tasks": tasks_figure(table)},
        "done": [row for row in rows if row["fulcrum_mm"] is not None],
        "tables": [_grid("tasks", rows, ("label", "task"), ("fulcrum_mm", "own setting (mm)", "{:.1f}"),
                         ("cost", f"cost there ({unit})", _NUMBER),
                         ("cost_common", f"with one for all ({unit})", _NUMBER),
                         ("excess", f"more ({excess_unit(table)})", "{:.2f}"))]}


def _pareto(table: Table, arrays: Arrays) -> dict[str, Any]:
    rows = [row for row in table["pareto"] if row["first"] is not None and row["second"] is not None]
    ends = {key: (min(row[key] for row in rows), max(row[key] for row in rows))
            for key in ("fulcrum_mm", "first", "second")} if len(rows) > 1 else None
    first, second = (name.replace("_", " ") for name in table["pareto_names"])
    return {"ends": ends, "front": told("pareto", t=table, ends=ends)[0],
            "figures": {"pareto": pareto_figure(table)} if ends else {},
            "tables": [_grid("pareto", table["pareto"], ("weight", f"weight of {second}", "{:g}"),
                             ("fulcrum_mm", "fulcrum (mm)", "{:.1f}"), ("first", first, _NUMBER),
                             ("second", second, _NUMBER))]}


def _robustness(table: Table, arrays: Arrays) -> dict[str, Any]:
    found = any(row["fulcrum_mm"] is not None for row in table["robustness"])
    return {"figures": {"robustness": robustness_figure(table)} if found else {},
            "tables": [_grid("robustness", table["robustness"], ("what", "changed"),
                             ("fulcrum_mm", "fulcrum (mm)", "{:.1f}"),
                             ("cost", f"cost ({table['cost_unit']})", _NUMBER))]}


def _range(table: Table, arrays: Arrays) -> dict[str, Any]:
    """The cost over the range, with its terms and the outcomes, a row a position."""
    labels = {("terms", row["name"]): row["label"] for row in table["terms"]}
    labels |= {("outcomes", row["name"]): f"{row['label']} ({row['unit']})" for row in table["outcomes"]}
    columns = [("fulcrum_mm", "fulcrum (mm)", "{:.1f}"), ("cost", f"cost ({table['cost_unit']})", _NUMBER)]
    rows = [{"fulcrum_mm": row["fulcrum_mm"], "cost": row["cost"]} for row in table["sweep"]]
    for part, prefix in (("terms", "term"), ("outcomes", "outcome")):
        for name in dict.fromkeys(name for row in table["sweep"] for name in row[part] or ()):
            columns.append((f"{prefix}_{name}", labels.get((part, name), name), _NUMBER))
        for row, all_of in zip(rows, table["sweep"], strict=True):
            row |= {f"{prefix}_{name}": value for name, value in (all_of[part] or {}).items()}
    return {"tables": [_grid("sweep", rows, *columns)]}


def _checks(table: Table, arrays: Arrays) -> dict[str, Any]:
    cost = ("cost", f"cost ({table['cost_unit']})", "{:.6g}")
    return {
        "unmet": [row["label"] for row in table["checks"] if row["met"] is False],
        "tables": [
            _grid("solver", [table["solver"] or {}], ("name", "solver"), ("iterations", "iterations", "{:g}"),
                  ("evaluations", "evaluations", "{:g}"), ("violation", "constraints violated by", "{:.1e}"),
                  ("optimality", "optimality", "{:.1e}"), ("message", "in its words")),
            _grid("checks", table["checks"], ("label", "check"), ("value", "found", _NUMBER), ("unit", "unit"),
                  ("target", "asked", "{:g}"), ("met", "met"), ("sentence", "meaning")),
            _grid("confirmed_by", table["confirmed_by"], ("solver", "solver"), ("start", "began from"),
                  ("fulcrum_mm", "fulcrum (mm)", "{:.1f}"), cost, ("success", "converged"),
                  ("message", "in its words")),
            _grid("starts", table["starts"], ("fulcrum_mm", "began at (mm)", "{:.1f}"),
                  ("end_mm", "ended at (mm)", "{:.1f}"), cost, ("success", "converged"))]}


def _made(table: Table, arrays: Arrays) -> dict[str, Any]:
    """Notes, time, software, options and files."""
    made = {"versions": None, "seed": None, "options": None, "inputs_sha256": None} | (table["provenance"] or {})
    options = [{"option": name, "value": said(value, "none")} for name, value in (made["options"] or {}).items()]
    files = [{"file": name, "sha256": digest} for name, digest in (made["inputs_sha256"] or {}).items()]
    return {"made": made, "tables": [_grid("options", options, ("option", "option"), ("value", "value")),
                                     _grid("files", files, ("file", "file"), ("sha256", "SHA-256"))]}


def schedule_words(table: Table) -> list[str]:
    """What the device would store and what that buys, in sentences."""
    return told("schedule", t=table, buys=tasks_words(table) if table["optimal"] else "")


def _policy(table: Table, arrays: Arrays) -> dict[str, Any]:
    unit, known, over = table["cost_unit"], [row for row in table["tasks"] if row["exact_mm"] is not None], None
    if len(known) > 1:
        over = telling(table)
    rows = []
    for row in table["tasks"]:
        low, high = row["interval_mm"] or (None, None)
        rows.append({**row, "excess": excess(row), "low_mm": low, "high_mm": high, "told": _MATTERS[row["matters"]],
                     "of": ", ".join(row["trials"])})
    return {
        "sentences": schedule_words(table), "known": known, "over": over,
        "figures": {} if over is None else {"policy": policy_figure(table, over)},
        "tables": [_grid(
            "policy", rows, ("label", "task"), ("speed_m_per_s", "speed (m/s)", "{:g}"),
            ("slope_deg", "slope (°)", "{:g}"), ("carried_kg", "carried (kg)", "{:g}"),
            ("fulcrum_mm", "fulcrum (mm)", "{:.1f}"), ("exact_mm", "before rounding (mm)", "{:.2f}"),
            ("low_mm", "interval from (mm)", "{:.0f}"), ("high_mm", "to (mm)", "{:.0f}"),
            ("cost", f"cost ({unit})", _NUMBER), ("cost_common", f"cost with one for all ({unit})", _NUMBER),
            ("excess", f"more ({excess_unit(table)})", "{:.2f}"),
            ("rest", f"cost that does not hold to the recording ({unit})", _NUMBER),
            ("rest_common", f"the same with one for all ({unit})", _NUMBER), ("told", "own setting matters"),
            ("of", "trials"), ("status", "how it ended"))]}


def _buys(table: Table, arrays: Arrays) -> dict[str, Any]:
    curves, done = curved(table), [row for row in table["tasks"] if row["fulcrum_mm"] is not None]
    figures = {"curves": schedule_curves_figure(table)} if curves else {}
    if done:
        figures["tasks"] = tasks_figure({**table, "tasks": done})
    return {"curves": curves, "done": done, "intervals": True, "figures": figures,
            "buys": tasks_words({**table, "tasks": done}) if done else ""}
