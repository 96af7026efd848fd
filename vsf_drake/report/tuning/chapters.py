"""The chapters of a tuning's page: functions of its saved table and arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from vsf_drake.report.page import Bullets, Chapter, Column, Grid, Missing, Picture, Piece, Text, made_chapter
from vsf_drake.report.tuning.choices_figure import (
    cost_alt,
    excess,
    outcomes_alt,
    outcomes_figure,
    pareto_alt,
    pareto_figure,
    pareto_words,
    robustness_alt,
    robustness_figure,
    robustness_words,
    shown_outcomes,
    spans,
    tasks_alt,
    tasks_figure,
    tasks_words,
)
from vsf_drake.report.tuning.figures import (
    FEET,
    SETTINGS,
    cost_curve_figure,
    drawn_trials,
    motion_figure,
    root_mean_squares,
    stance_force_figure,
    stride_force_figure,
    torque_figure,
)
from vsf_drake.report.tuning.schedule_figure import curved, policy_figure, schedule_curves_figure, telling
from vsf_drake.report.tuning.words import HARDLY, MODELS, NOT_OPTIMAL, answer, cost_outcome, millimetres, swept

Arrays = Mapping[str, np.ndarray]


def tuning_chapters(table: Mapping[str, Any], arrays: Arrays, *, lenient: bool) -> list[Chapter]:
    """The answer, cost, outcomes, motion, choices between settings, checks, and how it was made; what there is of it.

    Args:
        table, arrays: of tuning.json and tuning.npz.
        lenient: see `page.chapter_page`.
    """
    makers: list[tuple[str, str, Callable[[], Chapter], bool]] = [
        ("answer", "Answer", lambda: _answer(table, arrays), True),
        ("outcomes", "What changes with the setting", lambda: _outcomes(table), bool(table["outcomes"])),
        ("motion", "Motion and forces", lambda: motion_chapter(table, arrays), True),
        ("tasks", "One setting for each task, or one for all", lambda: _tasks(table), bool(table["tasks"])),
        ("pareto", "Between two costs", lambda: _pareto(table), bool(table["pareto"])),
        ("robustness", "How firm the setting is", lambda: _robustness(table), bool(table["robustness"])),
        ("range", "The whole range", lambda: _range(table), bool(table["sweep"])),
        ("checks", "Checks", lambda: _checks(table), True),
        ("made", "How this was made", lambda: _made(table), True)]
    return [made_chapter(name, title, make, lenient) for name, title, make, there in makers if there]


def making_pieces(table: Mapping[str, Any]) -> tuple[Piece, ...]:
    """Notes, time, software, options and files of a tuning or a schedule."""
    made = table["provenance"] or {}
    lines = list(table["notes"])
    if table["wall_s"] is not None:
        lines.append(f"It took {table['wall_s']:.1f} s.")
    if made.get("versions"):
        versions = made["versions"].items()
        lines.append("Software: " + ", ".join(f"{name} {version}" for name, version in versions) + ".")
    if made.get("seed") is not None:
        lines.append(f"Seed {made['seed']}.")
    pieces: list[Piece] = [Bullets(lines)] if lines else [Missing("The results do not say how they were made.")]
    options = [{"option": name, "value": _said(value)} for name, value in (made.get("options") or {}).items()]
    if options:
        pieces.append(Grid(name="options", rows=options, caption="Options that were given.", columns=(
            Column(key="option", heading="option"), Column(key="value", heading="value"))))
    files = [{"file": name, "sha256": digest} for name, digest in (made.get("inputs_sha256") or {}).items()]
    if files:
        pieces.append(Grid(name="files", rows=files, caption="Files that were read.", columns=(
            Column(key="file", heading="file"), Column(key="sha256", heading="SHA-256"))))
    return tuple(pieces)


def _answer(table: Mapping[str, Any], arrays: Arrays) -> Chapter:
    pieces: list[Piece] = [Bullets(answer(table))]
    if len(swept(table)[0]) > 1:
        pieces.append(Picture(
            name="cost", figure=cost_curve_figure(table, arrays), alt=cost_alt(table),
            caption="Left: the cost over the fulcrum's whole range (black); in grey, where there are several trials, "
                    "each of them, moved up or down to meet the mean at the marked setting. The band is the "
                    "interval of the optimum; dotted lines are where the fulcrum was recorded. Right, where the cost "
                    "has several terms: the change of each from the marked setting."))
    else:
        pieces.append(Missing("The cost was not computed over the range of the fulcrum."))
    if table["design"]:
        pieces.append(design_grid(table))
    if table["terms"]:
        pieces.append(term_grid(table))
    return Chapter(name="answer", title="Answer", pieces=tuple(pieces))


def _outcomes(table: Mapping[str, Any]) -> Chapter:
    pieces: list[Piece] = []
    said = [row["sentence"] for row in table["outcomes"] if row["sentence"] and row is not cost_outcome(table)]
    if said:
        pieces.append(Bullets(said))
    if shown_outcomes(table):
        pieces.append(Picture(
            name="outcomes", figure=outcomes_figure(table), alt=outcomes_alt(table),
            caption="Outcomes over the range of the fulcrum, each in its unit. The grey band across is the uncertainty "
                    "of an outcome about its value at the optimum (star): inside of it settings are not told apart."))
    return Chapter(name="outcomes", title="What changes with the setting", pieces=(*pieces, outcome_grid(table)))


def _tasks(table: Mapping[str, Any]) -> Chapter:
    picture = Picture(
        name="tasks", figure=tasks_figure(table), alt=tasks_alt(table),
        caption="Left: the best setting of each task and the one that is best for all together (broken line). Right: "
                "what the one setting for all costs in each task, above the task's own.")
    return Chapter(name="tasks", title="One setting for each task, or one for all", pieces=(
        Text(tasks_words(table)), picture, task_grid(table)))


def _pareto(table: Mapping[str, Any]) -> Chapter:
    pieces: list[Piece] = [Text(pareto_words(table))]
    if sum(row["first"] is not None and row["second"] is not None for row in table["pareto"]) > 1:
        pieces.append(Picture(name="pareto", figure=pareto_figure(table), alt=pareto_alt(table),
                              caption="Each point is the best setting for one weight between the two costs; lower "
                                      "left is better. Colours are positions of the fulcrum."))
    return Chapter(name="pareto", title="Between two costs", pieces=(*pieces, pareto_grid(table)))


def _robustness(table: Mapping[str, Any]) -> Chapter:
    pieces: list[Piece] = [Text(robustness_words(table))]
    if any(row["fulcrum_mm"] is not None for row in table["robustness"]):
        pieces.append(Picture(name="robustness", figure=robustness_figure(table), alt=robustness_alt(table),
                              caption="Line: the optimum. Band: its interval."))
    return Chapter(name="robustness", title="How firm the setting is", pieces=(*pieces, robustness_grid(table)))


def _range(table: Mapping[str, Any]) -> Chapter:
    return Chapter(name="range", title="The whole range", pieces=(sweep_grid(table),))


def _checks(table: Mapping[str, Any]) -> Chapter:
    solver, unmet = table["solver"], [row["label"] for row in table["checks"] if row["met"] is False]
    pieces: list[Piece] = [Text(f"{'Optimal' if table['optimal'] else 'NOT OPTIMAL'}: {table['status']}")]
    if unmet:
        pieces.append(Missing(f"Not met: {', '.join(unmet)}."))
    if solver:
        pieces.append(Grid(name="solver", rows=[solver], columns=[
            Column(key="name", heading="solver"), Column(key="iterations", heading="iterations", form="{:g}"),
            Column(key="evaluations", heading="evaluations", form="{:g}"),
            Column(key="violation", heading="constraints violated by", form="{:.1e}"),
            Column(key="optimality", heading="optimality", form="{:.1e}"),
            Column(key="message", heading="in its words")], caption="How the solver ended."))
    grids = (("checks", check_grid), ("confirmed_by", confirmation_grid), ("starts", start_grid))
    pieces += [make(table) for key, make in grids if table[key]]
    return Chapter(name="checks", title="Checks", pieces=tuple(pieces))


def _made(table: Mapping[str, Any]) -> Chapter:
    return Chapter(name="made", title="How this was made", pieces=making_pieces(table))


def _said(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_said(item)}" for name, item in value.items()) or "none"
    if isinstance(value, (list, tuple)):
        return ", ".join(map(_said, value)) or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "none" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


# The chapter on motion and forces at the optimum; a level 1 tuning has forces only.


TITLE = "Motion and forces"
_AGAIN = {"_recorded": "the recorded ones", "_resimulated_prescribed": "those simulated again with the motion "
          "prescribed", "_resimulated_feedback": "those simulated again with torques and feedback"}


def motion_chapter(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Chapter:
    """What there is of it: forces, motion, torques."""
    pieces: list[Piece] = []
    if table["level"] == 1:
        pieces.append(Text("The motion is the recorded one at every setting, so that only forces are shown."))
    if drawn_trials(table, arrays):
        pieces.append(Picture(
            name="force", figure=stance_force_figure(table, arrays), alt=_stance_alt(table, arrays),
            caption="Ground reaction force of the prosthetic foot by setting, in three trials at most; in grey, as "
                    "recorded, at the setting of the recording (the plate's; the model's where there is no plate)."))
    if "phase" in arrays and any(f"grf_{foot}" in arrays for foot in FEET):
        pieces.append(Picture(
            name="stride_force", figure=stride_force_figure(table, arrays), alt=_stride_alt(arrays),
            caption="Ground reaction forces over the gait cycle: of the optimisation, of the plates (grey), and "
                    "simulated again by the stepper with the whole keel, once with the optimised motion prescribed "
                    "and once driven by the optimised torques with stabilising feedback."))
    if {"phase", "q", "names"} <= set(arrays):
        pieces.append(Picture(
            name="motion", figure=motion_figure(table, arrays), alt=_motion_alt(arrays),
            caption="Coordinates over the gait cycle, optimised and recorded. The pelvis's forward way is shown "
                    "without its steady progress."))
    if {"phase", "torque"} <= set(arrays):
        pieces.append(Picture(
            name="torque", figure=torque_figure(table, arrays), alt=_torque_alt(arrays),
            caption="Joint torques over the gait cycle; recorded are those of inverse dynamics of the recorded "
                    "motion with its plates."))
    if not any(isinstance(piece, Picture) for piece in pieces):
        pieces.append(Missing("These results hold no motion and no forces."))
    return Chapter(name="motion", title=TITLE, pieces=tuple(pieces))


def _stance_alt(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> str:
    said = []
    for trial, prefix in drawn_trials(table, arrays).items():
        peaks = [f"{name} {np.nanmax(np.asarray(arrays[prefix + name])[:, 2]):.0f} N"
                 for name in ("recorded", *SETTINGS) if prefix + name in arrays]
        said.append(f"{trial}: {', '.join(peaks)}" if trial else ", ".join(peaks))
    return f"Force of the prosthetic foot by setting. Largest vertical force, {'; '.join(said)}."


def _stride_alt(arrays: Mapping[str, np.ndarray]) -> str:
    said = []
    for foot, name in FEET.items():
        own = arrays.get(f"grf_{foot}")
        for suffix, other in _AGAIN.items():
            known = arrays.get(f"grf_{foot}{suffix}")
            if own is not None and known is not None and np.shape(own) == np.shape(known):
                off = float(np.sqrt(np.mean(np.sum((np.asarray(own) - np.asarray(known)) ** 2, axis=1))))
                said.append(f"{name}: {off:.0f} N from {other}")
    return "Ground reaction forces of both feet over the gait cycle; root mean square differences of the optimised " \
           f"ones. {'; '.join(said) or 'There is nothing to compare them with'}."


def _motion_alt(arrays: Mapping[str, np.ndarray]) -> str:
    off = root_mean_squares(arrays, "q")
    names = [str(name) for name in arrays["names"]]
    if off is None:
        return f"The optimised motion over the gait cycle: {spans(arrays['q'], names)}."
    parts = [f"{name.replace('_', ' ')} {1e3 * value:.1f} mm" if name in ("pelvis_tx", "pelvis_ty") else
             f"{name.replace('_', ' ')} {np.degrees(value):.1f}°" for name, value in zip(names, off, strict=True)]
    return f"Optimised against recorded motion; root mean square differences: {', '.join(parts)}."


def _torque_alt(arrays: Mapping[str, np.ndarray]) -> str:
    torque = np.asarray(arrays["torque"])
    names = [str(name) for name in arrays.get("names", ())][-torque.shape[1]:] or ["torque"] * torque.shape[1]
    parts = [f"{name.replace('_', ' ')} {values.min():.0f} to {values.max():.0f} N m"
             for name, values in zip(names, torque.T, strict=True)]
    return f"Joint torques over the gait cycle: {', '.join(parts)}."


# Tables of a tuning: each row of them is one of tuning.json, with nothing left out.


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


# The chapters of a schedule's page: functions of its saved table.


_SAID = {True: "yes", False: "NO", None: None}


def schedule_title(table: Mapping[str, Any]) -> str:
    """Of the page."""
    words = f"Settings by task: {table['cost_label']}"
    return words if table["optimal"] else f"{NOT_OPTIMAL}: {words[0].lower()}{words[1:]}"


def schedule_alarm(table: Mapping[str, Any]) -> str:
    """What stands in red above a schedule that may not be stored; nothing above one that may."""
    if table["optimal"]:
        return ""
    bad = "; ".join(f"{row['label']}: {row['status']}" for row in table["tasks"] if not row["optimal"])
    return f"{NOT_OPTIMAL}: {bad}. This table is not complete; do not store it in a device."


def schedule_first_line(table: Mapping[str, Any]) -> str:
    """Whose data these are, and what the model is."""
    trials = ", ".join(trial for row in table["tasks"] for trial in row["trials"])
    data = f"Data are SYNTHETIC, not recorded: {trials}." if table["synthetic"] else f"Recorded trials: {trials}."
    return f"{data} {MODELS[table['level']]}"


def schedule_words(table: Mapping[str, Any]) -> list[str]:
    """What the device would store and what that buys, in sentences."""
    if not table["optimal"]:
        return [f"{NOT_OPTIMAL}. Tasks with a result: " + (", ".join(
            row["label"] for row in table["tasks"] if row["optimal"]) or "none") + "."]
    stored = ", ".join(f"{millimetres(row['fulcrum_mm'])} for {row['label']}" for row in table["tasks"])
    told = [row["label"] for row in table["tasks"] if row["matters"]]
    same = [row["label"] for row in table["tasks"] if row["matters"] is False]
    said = [f"To store: {stored}.", tasks_words(table)]
    if same and not told and len(same) == len(table["tasks"]):
        said.insert(0, f"{HARDLY} from task to task: for none of them is the own setting known to be better than the "
                       "one for all.")
    elif told or same:
        said += [f"Known to need a setting of its own: {', '.join(told) or 'none'}."]
        said += [f"Not told from the one setting for all: {', '.join(same)}."] if same else []
    else:
        said.append("Whether any task needs a setting of its own is not known: its trials do not tell.")
    return said


def schedule_chapters(table: Mapping[str, Any], *, lenient: bool) -> list[Chapter]:
    """The policy, what it buys, and how it was made.

    Args:
        lenient: see `page.chapter_page`.
    """
    makers: tuple[tuple[str, str, Callable[[Mapping[str, Any]], Chapter]], ...] = (
        ("policy", "What the device would store", _policy),
        ("buys", "What adaptability buys", _buys),
        ("made", "How this was made", _made))
    return [made_chapter(name, title, partial(make, table), lenient) for name, title, make in makers]


def policy_grid(table: Mapping[str, Any]) -> Grid:
    """The policy table."""
    unit = table["cost_unit"]
    rows = [{**row, "excess": excess(row), "low_mm": (row["interval_mm"] or (None, None))[0],
             "high_mm": (row["interval_mm"] or (None, None))[1], "told": _SAID[row["matters"]],
             "of": ", ".join(row["trials"])} for row in table["tasks"]]
    relative = all(row["cost"] is not None and row["cost"] > 0.0 for row in rows)
    return Grid(name="policy", rows=rows, columns=[
        Column(key="label", heading="task"), Column(key="speed_m_per_s", heading="speed (m/s)", form="{:g}"),
        Column(key="slope_deg", heading="slope (°)", form="{:g}"),
        Column(key="carried_kg", heading="carried (kg)", form="{:g}"),
        Column(key="fulcrum_mm", heading="fulcrum (mm)", form="{:.1f}"),
        Column(key="exact_mm", heading="before rounding (mm)", form="{:.2f}"),
        Column(key="low_mm", heading="interval from (mm)", form="{:.0f}"),
        Column(key="high_mm", heading="to (mm)", form="{:.0f}"),
        Column(key="cost", heading=f"cost ({unit})", form="{:.4g}"),
        Column(key="cost_common", heading=f"cost with one for all ({unit})", form="{:.4g}"),
        Column(key="excess", heading=f"more ({'%' if relative else unit})", form="{:.2f}"),
        Column(key="rest", heading=f"cost that does not hold to the recording ({unit})", form="{:.4g}"),
        Column(key="rest_common", heading=f"the same with one for all ({unit})", form="{:.4g}"),
        Column(key="told", heading="own setting matters"), Column(key="of", heading="trials"),
        Column(key="status", heading="how it ended")],
        caption=f"The policy: {table['cost_label']}, a row a task. Own setting matters: whether the task's cost is "
                "known to depend on the setting, and the one for all lies outside of the task's interval.")


def _policy(table: Mapping[str, Any]) -> Chapter:
    pieces: list[Piece] = [Bullets(schedule_words(table)), policy_grid(table), Text(table["lookup"])]
    name = telling(table)
    known = [row for row in table["tasks"] if row["exact_mm"] is not None]
    if name is not None and len(known) > 1:
        pairs = ", ".join(f"{row[name]:g}: {row['fulcrum_mm']:.1f} mm" for row in known)
        pieces.append(Picture(
            name="policy", figure=policy_figure(table, name), alt=f"Setting over {name.replace('_', ' ')}: {pairs}.",
            caption="Points: what is stored. Line: the lookup before rounding, which is clamped outside of the tasks. "
                    "Grey bars: the interval of each."))
    step = table["resolution_mm"]
    low, high = table["reach_mm"]
    pieces.append(Text(f"The carriage reaches from {low:g} to {high:g} mm"
                       + ("; settings are not rounded." if step is None else f" in steps of {step:g} mm.")))
    return Chapter(name="policy", title="What the device would store", pieces=tuple(pieces))


def _buys(table: Mapping[str, Any]) -> Chapter:
    pieces: list[Piece] = []
    if curved(table):
        parts = [f"{row['label']} {row['fulcrum_mm']:.1f} mm" for row in curved(table) if row["fulcrum_mm"] is not None]
        pieces.append(Picture(
            name="curves", figure=schedule_curves_figure(table),
            alt=f"Cost of every task over the fulcrum, above its own least; least at: {', '.join(parts) or 'unknown'}.",
            caption="How much a task's cost rises when its setting is missed. Flat curves need none of their own."))
    done = {**table, "tasks": [row for row in table["tasks"] if row["fulcrum_mm"] is not None]}
    if done["tasks"]:
        pieces.append(Picture(
            name="tasks", figure=tasks_figure(done), alt=tasks_alt(done),
            caption="Left: the setting of each task, its interval in grey, and the one that is best for all together. "
                    "Right: what the one setting for all costs in each task, above the task's own."))
    if not pieces:
        pieces.append(Missing("No task has a result."))
    return Chapter(name="buys", title="What adaptability buys", pieces=tuple(pieces))
