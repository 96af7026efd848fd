"""The chapters of a schedule's page: functions of its saved table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from vsf_drake.report.chapter_files import made_chapter
from vsf_drake.report.pieces import Bullets, Chapter, Column, Grid, Missing, Picture, Piece, Text
from vsf_drake.report.tuning.chapters import making_pieces
from vsf_drake.report.tuning.choices_figure import excess, tasks_figure
from vsf_drake.report.tuning.schedule_figure import curved, policy_figure, schedule_curves_figure, telling
from vsf_drake.report.tuning.words import HARDLY, MODELS, NOT_OPTIMAL, millimetres
from vsf_drake.report.tuning.words_of_figures import tasks_alt, tasks_words

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
        lenient: see `chapter_files.write_chapters`.
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


def _made(table: Mapping[str, Any]) -> Chapter:
    return Chapter(name="made", title="How this was made", pieces=making_pieces(table))
