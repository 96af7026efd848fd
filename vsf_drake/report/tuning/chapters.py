"""The chapters of a tuning's page: functions of its saved table and arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from vsf_drake.report.chapter_files import made_chapter
from vsf_drake.report.pieces import Bullets, Chapter, Column, Grid, Missing, Picture, Piece, Text
from vsf_drake.report.tuning.choices_figure import pareto_figure, robustness_figure, tasks_figure
from vsf_drake.report.tuning.cost_curve_figure import cost_curve_figure
from vsf_drake.report.tuning.grids import (
    check_grid,
    confirmation_grid,
    design_grid,
    outcome_grid,
    pareto_grid,
    robustness_grid,
    start_grid,
    sweep_grid,
    task_grid,
    term_grid,
)
from vsf_drake.report.tuning.motion_chapter import motion_chapter
from vsf_drake.report.tuning.outcomes_figure import outcomes_figure, shown_outcomes
from vsf_drake.report.tuning.table import cost_outcome, swept
from vsf_drake.report.tuning.words import answer
from vsf_drake.report.tuning.words_of_figures import (
    cost_alt,
    outcomes_alt,
    pareto_alt,
    pareto_words,
    robustness_alt,
    robustness_words,
    tasks_alt,
    tasks_words,
)

Arrays = Mapping[str, np.ndarray]


def tuning_chapters(table: Mapping[str, Any], arrays: Arrays, *, lenient: bool) -> list[Chapter]:
    """The answer, cost, outcomes, motion, choices between settings, checks, and how it was made; what there is of it.

    Args:
        table, arrays: of tuning.json and tuning.npz.
        lenient: see `chapter_files.write_chapters`.
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
