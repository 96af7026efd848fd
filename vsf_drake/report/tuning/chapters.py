"""What a tuning and a schedule leave on disk, all of it or nothing, and the chapters of their pages.

Chapters are functions of saved records and arrays: numbers, decisions and figures for the templates `tuning/*.html.j2`,
where their tables stand too; words are in `tuning/words.txt.j2`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.analysis.metrics import UNFITTED
from vsf_drake.analysis.tuning.schedule import (
    DESCRIPTORS,
    LOOKUP,
    POLICY_FORMAT,
    Schedule,
    TaskSetting,
    schedule_of,
)
from vsf_drake.analysis.tuning.table import FORMAT, Provenance, TuningTable, tuning_of
from vsf_drake.files import plain
from vsf_drake.report.page import Chapter, listed, made_chapter, render, said, write_csv
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.tuning import figures, reading
from vsf_drake.report.tuning.reading import Arrays

Facts = dict[str, Any]
"""Of a chapter: figures by name under "figures", the rest as its template calls it; `t` is the record."""
_MATTERS = {True: "yes", False: "NO", None: None}


def words(part: str, **facts: Any) -> list[str]:
    """The paragraphs of a macro of `tuning/words.txt.j2`, as plain text."""
    text = render("tuning/told.txt.j2", part=part, facts=facts).unescape()
    return [" ".join(paragraph.split()) for paragraph in text.split("\n\n") if paragraph.strip()]


def tuning_page(
    saved: Mapping[str, Any], arrays: Arrays, *, lenient: bool, folder: Path | None = None
) -> Facts:
    """What `page.chapter_page` is to be given of tuning.json and tuning.npz: chapters that there is anything of."""
    made = (  # name, title, the part that it tells of ("" for none), what else it needs
        ("answer", "", _answer, "", ("sweep", "terms", "outcomes", "design")),
        ("outcomes", "What changes with the setting", _outcomes, "outcomes", ("sweep",)),
        ("motion", "Motion and forces", _motion, "", ("sweep",)),
        ("tasks", "One setting for each task, or one for all", _tasks, "tasks", ("sweep", "terms")),
        ("pareto", "Between two costs", _pareto, "pareto", ()),
        ("robustness", "How firm the setting is", _robustness, "robustness", ("sweep",)),
        ("range", "The whole range", _range, "sweep", ("terms", "outcomes")),
        ("checks", "Checks", _checks, "", ("checks", "solver", "confirmed_by", "starts")),
        ("made", "How this was made", _made, "", ("provenance",)),
    )

    def shown(
        name: str, title: str, make: Callable[[TuningTable, Arrays], Facts], parts: tuple[str, ...]
    ) -> Chapter:
        table = tuning_of(saved, parts)
        return _chapter(name, title, table, make(table, arrays))

    head = tuning_of(saved, ())
    return {
        "title": words("title", what="Stiffness tuned", t=head)[0],
        "first_line": " ".join(first_line(head)),
        "alarm": "" if head.optimal else words("alarm", t=head)[0],
        "synthetic": head.synthetic,
        "chapters": [
            made_chapter(name, title, partial(shown, name, title, make, (part, *parts)), lenient)
            for name, title, make, part, parts in made
            if not part or saved[part]
        ],
    }


def schedule_page(
    saved: Mapping[str, Any], arrays: Arrays, *, lenient: bool, folder: Path | None = None
) -> Facts:
    """The same of a schedule: the policy, what it buys, and how it was made."""
    schedule = schedule_of(saved)

    def shown(name: str, title: str, make: Callable[[Schedule], Facts]) -> Chapter:
        return _chapter(name, title, schedule, make(schedule))

    trials = ", ".join(trial for row in schedule.tasks for trial in row.trials)
    return {
        "title": words("title", what="Settings by task", t=schedule)[0],
        "first_line": " ".join(words("first_line", t=schedule, trials=trials)),
        "alarm": "" if schedule.optimal else words("schedule_alarm", t=schedule)[0],
        "synthetic": schedule.synthetic,
        "chapters": [
            made_chapter(name, title, partial(shown, name, title, make), lenient)
            for name, title, make in (("policy", "", _policy), ("made", "How this was made", _made))
        ],
    }


def _chapter(name: str, title: str, record: TuningTable | Schedule, facts: Facts) -> Chapter:
    return Chapter(
        name=name,
        title=title,
        template=f"tuning/{name}.html.j2",
        figures=facts.pop("figures", {}),
        facts={"t": record, "unfitted": UNFITTED, **facts},
    )


def first_line(table: TuningTable) -> list[str]:
    """Whose data these are, and what the model is."""
    return words("first_line", t=table, trials=listed(table.trials))


def answer(table: TuningTable) -> list[str]:
    """Which setting, how much better than others, and whether that is more than the uncertainty; in sentences."""
    if not table.optimal or table.cost is None:
        return words("answer", t=table)
    (x, costs), row, holding = table.swept(), table.cost_outcome, table.holding
    others = [other for other in table.outcomes if other is not row]
    more, no_more, open_ = (
        [other.label for other in others if other.matters is kind] for kind in (True, False, None)
    )
    matters = None if row is None else row.matters
    nothing = row is None and bool(others) and not more and not open_
    places = reading.compared(table, table.cost_at, table.cost)
    own, held, least = table.rest, table.held_from, None
    if held is not None and own is not None:
        ends = {x[0]: "the softest setting", x[-1]: "the stiffest"}
        least = {
            "mm": held[0],
            "end": ends.get(held[0], ""),
            "more": own - held[1],
            "percent": 100.0 * (own - held[1]) / held[1] if held[1] > 0.0 else None,
        }
    return words(
        "answer",
        t=table,
        span=(x[0], x[-1]) if len(x) else None,
        row=row,
        places=places,
        holding=holding,
        size=float(costs.max() - costs.min()) if len(costs) else None,
        hardly="outcomes" if nothing else "cost" if matters is False and len(costs) else "",
        rest=[]
        if own is None or not (places and holding)
        else reading.compared(table, table.rest_at, own),
        least_rest=least,
        all_more=len(more) > max(1, len(others) - 1),
        more=more,
        no_more=no_more,
        unknown=matters is None and not more and not no_more,
    )


def _answer(table: TuningTable, arrays: Arrays) -> Facts:
    x, y = table.swept()
    if len(x) < 2:
        return {"sentences": answer(table), "curve": None, "drawn": {}}
    low, high = int(np.argmin(y)), int(np.argmax(y))
    drawn = {"cost": figures.cost_curve_figure(table, arrays)}
    if len(table.terms) > 1:
        drawn["terms"] = figures.terms_figure(table)
    return {
        "sentences": answer(table),
        "figures": drawn,
        "drawn": list(drawn),
        "curve": {
            "span": (x[0], x[-1]),
            "least": y[low],
            "least_mm": x[low],
            "most": y[high],
            "most_mm": x[high],
        },
    }


FIRST = (
    "dorsiflexion",
    "ankle_moment",
    "knee_extension",
    "knee_flexor_moment",
    "push_off_power",
    "stored_energy",
    "returned_energy",
    "intact_first_peak",
    "socket_moment",
    "muscle_energy",
)
"""Outcomes of level 2 that a reader sees first: those that stiffness was seen to change in people, the load of the
residual limb, and energy."""


def _outcomes(table: TuningTable, arrays: Arrays) -> Facts:
    shown = []
    for row in reading.shown_outcomes(table):
        x, y = table.swept("outcomes", row.name)
        shown.append({"label": row.label, "unit": row.unit, "x": x[[0, -1]], "y": y[[0, -1]]})
    rows = [{**vars(row), "told": _MATTERS[row.matters]} for row in table.outcomes]
    return {
        "shown": shown,
        "figures": {"outcomes": figures.outcomes_figure(table)} if shown else {},
        "rows": rows,
        "first": [
            row for name in FIRST for row in rows if table.level == 2 and row["name"] == name
        ],
    }


def _motion(table: TuningTable, arrays: Arrays) -> Facts:
    """Forces, motion and torques, as far as they are there; a level 1 tuning has forces only."""
    facts: Facts = {"stance": {}, "stride": None, "figures": {}}
    trials = reading.drawn_trials(table, arrays)
    if trials:
        facts["figures"]["force"] = figures.stance_force_figure(table, arrays)
        facts["stance"] = {
            trial: {
                name: np.nanmax(np.asarray(arrays[prefix + name])[:, 2])
                for name in ("recorded", *reading.SHOWN)
                if prefix + name in arrays
            }
            for trial, prefix in trials.items()
        }
    if "phase" in arrays:
        facts["figures"] |= {
            "stride_force": figures.stride_force_figure(table, arrays),
            "motion": figures.stride_figure(table, arrays, "q"),
            "torque": figures.stride_figure(table, arrays, "torque"),
        }
        facts["stride"] = [
            (name, suffix, float(np.linalg.norm(off)))
            for foot, name in reading.FEET.items()
            for suffix in ("_recorded", "_resimulated_prescribed", "_resimulated_feedback")
            if (off := reading.root_mean_squares(arrays, f"grf_{foot}", suffix)) is not None
        ]
        names, torques = [str(name) for name in arrays["names"]], np.asarray(arrays["torque"]).T
        change = reading.root_mean_squares(arrays, "q")
        if change is None:
            raise ValueError("the recorded motion lacks, or is of other instants")
        facts["motion"] = [
            (
                name,
                f"{1e3 * away:.1f} mm" if name in reading.LENGTHS else f"{np.degrees(away):.1f}°",
            )
            for name, away in zip(names, change, strict=True)
        ]
        facts["torque"] = [
            (name, values.min(), values.max())
            for name, values in zip(names[-len(torques) :], torques, strict=True)
        ]
    return facts


def bought(table: TuningTable | Schedule) -> Facts:
    """What adaptability buys, in numbers."""
    lost = [value for row in table.tasks if (value := reading.excess(row)) is not None]
    settings = [row.fulcrum_mm for row in table.tasks if row.fulcrum_mm is not None]
    if not lost or not settings or table.common_fulcrum_mm is None:
        return {"known": False}
    # What of it is no gain of the person, because a term of the cost only holds to the recording.
    alone, rest = table.rest_common_mm if isinstance(table, Schedule) else None, None
    if alone is not None:
        pairs = [
            (row.rest or 0.0, row.rest_common or 0.0)
            for row in table.tasks
            if isinstance(row, TaskSetting)
        ]
        more = float(np.mean([common - own for own, common in pairs]))
        rest = {
            "mm": alone,
            "percent": 100.0 * more / (float(np.mean([abs(own) for own, _ in pairs])) or 1.0),
        }
    return {
        "known": True,
        "low": min(settings),
        "high": max(settings),
        "common": table.common_fulcrum_mm,
        "mean": float(np.mean(lost)),
        "most": max(lost),
        "unit": reading.excess_unit(table),
        "rest": rest,
        "held": bool(table.holding)
        if isinstance(table, TuningTable)
        else any(row.rest is not None for row in table.tasks),
    }


def _tasks(table: TuningTable, arrays: Arrays) -> Facts:
    return {
        "buys": words("tasks", **bought(table))[0],
        "intervals": False,
        "figures": {"tasks": figures.tasks_figure(table)},
        "rows": [{**vars(row), "excess": reading.excess(row)} for row in table.tasks],
        "done": [row for row in table.tasks if row.fulcrum_mm is not None],
        "unit": reading.excess_unit(table),
    }


def _pareto(table: TuningTable, arrays: Arrays) -> Facts:
    rows = [row for row in table.pareto if row.first is not None and row.second is not None]
    ends = (
        {
            key: (min(getattr(row, key) for row in rows), max(getattr(row, key) for row in rows))
            for key in ("fulcrum_mm", "first", "second")
        }
        if len(rows) > 1
        else None
    )
    return {
        "ends": ends,
        "front": words("pareto", t=table, ends=ends)[0],
        "figures": {"pareto": figures.pareto_figure(table)} if ends else {},
    }


def _robustness(table: TuningTable, arrays: Arrays) -> Facts:
    return {"figures": {"robustness": figures.robustness_figure(table)}}


def _checks(table: TuningTable, arrays: Arrays) -> Facts:
    return {"unmet": [row.label for row in table.checks if row.met is False]}


def _range(table: TuningTable, arrays: Arrays) -> Facts:
    headings = {"fulcrum_mm": "fulcrum (mm)", "cost": f"cost ({table.cost_unit})"}
    headings |= {f"term_{row.name}": row.label for row in table.terms}
    headings |= {f"outcome_{row.name}": f"{row.label} ({row.unit})" for row in table.outcomes}
    rows = [
        {
            "fulcrum_mm": point.fulcrum_mm,
            "cost": point.cost,
            **{f"term_{name}": value for name, value in point.terms.items()},
            **{f"outcome_{name}": value for name, value in point.outcomes.items()},
        }
        for point in table.sweep
    ]
    keys = sorted(
        dict.fromkeys(key for row in rows for key in row),
        key=lambda key: key.startswith("outcome_"),
    )
    return {
        "rows": rows,
        "columns": [
            (
                key,
                headings.get(key, key.partition("_")[2]),
                "{:.1f}" if key == "fulcrum_mm" else "{:.4g}",
            )
            for key in keys
        ],
    }


def _made(table: TuningTable | Schedule, arrays: Arrays | None = None) -> Facts:
    made = table.provenance or Provenance()
    return {
        "made": made,
        "files": [{"file": name, "sha256": digest} for name, digest in made.inputs_sha256.items()],
        "options": [
            {"option": name, "value": said(value, "none")} for name, value in made.options.items()
        ],
    }


def schedule_words(schedule: Schedule) -> list[str]:
    """What the device would store and what that buys, in sentences."""
    return words(
        "schedule",
        t=schedule,
        buys=words("tasks", **bought(schedule))[0] if schedule.optimal else "",
    )


def _policy(schedule: Schedule) -> Facts:
    known = [row for row in schedule.tasks if row.exact_mm is not None]
    over = reading.telling(schedule) if len(known) > 1 else None
    curves, done = (
        reading.curved(schedule),
        [row for row in schedule.tasks if row.fulcrum_mm is not None],
    )
    shown = {} if over is None else {"policy": figures.policy_figure(schedule, over)}
    if curves:
        shown["curves"] = figures.schedule_curves_figure(schedule)
    if done:
        shown["tasks"] = figures.tasks_figure(dataclasses.replace(schedule, tasks=tuple(done)))
    return {
        "sentences": schedule_words(schedule),
        "known": known,
        "over": over,
        "lookup": LOOKUP,
        "curves": curves,
        "done": done,
        "intervals": True,
        "buys": words("tasks", **bought(schedule))[0] if done else "",
        "unit": reading.excess_unit(schedule),
        "figures": shown,
        "rows": [
            {
                **row,
                "excess": reading.excess(task),
                "told": _MATTERS[task.matters],
                "of": ", ".join(task.trials),
            }
            for task, row in zip(
                schedule.tasks, _with_intervals(schedule, "low_mm", "high_mm"), strict=True
            )
        ],
    }


def _with_intervals(schedule: Schedule, *ends: str) -> Iterator[Facts]:
    """The tasks with the ends of their intervals under these names."""
    return (
        vars(row) | dict(zip(ends, row.interval_mm or (None, None), strict=True))
        for row in schedule.tasks
    )


TUNING = ResultsFolder(
    kind="tuning",
    command="tune",
    table="tuning.json",
    arrays="tuning.npz",
    show=tuning_page,
    known=lambda table: str(table.get("format")).startswith(FORMAT.rpartition(" ")[0]),
    valid=lambda table, path: tuning_of(table, ()),
)
"""The table is that of `TuningTable`. Arrays are any of `level1.tuning_arrays`, or of level 2: `phase` (n,) 0 to 1,
`names` (8,), `q`, `q_recorded` (n, 8) rad and m, `torque`, `torque_recorded` (n, 5) N m, `grf_prosthetic`,
`grf_intact` (n, 2) N (forward, up), and these two with `_recorded`, `_resimulated_prescribed`, `_resimulated_feedback`.
Others are kept, not shown."""


def write_tuning(out: str | Path, table: TuningTable, arrays: Mapping[str, np.ndarray]) -> None:
    """Writes a tuning; see `ResultsFolder.write`."""
    TUNING.write(out, plain(table), arrays)


POLICY_CSV = "policy.csv"
_COLUMNS = (
    "label",
    *DESCRIPTORS,
    "fulcrum_mm",
    "exact_mm",
    "interval_low_mm",
    "interval_high_mm",
    "cost",
    "cost_common",
    "matters",
    "optimal",
    "status",
)
SCHEDULE = ResultsFolder(
    kind="schedule",
    command="schedule",
    table="policy.json",
    names=(POLICY_CSV,),
    show=schedule_page,
    known=lambda table: str(table.get("format")).startswith(POLICY_FORMAT.rpartition(" ")[0]),
    valid=lambda table, path: schedule_of(table, file=path),
)
"""The table is that of `Schedule`, and how it is looked up in words."""


def write_schedule(out: str | Path, schedule: Schedule) -> None:
    """Writes a schedule with its policy.csv; see `ResultsFolder.write`."""

    def policy(folder: Path, saved: Facts) -> None:
        rows = _with_intervals(schedule, "interval_low_mm", "interval_high_mm")
        write_csv(folder / POLICY_CSV, _COLUMNS, ([row[name] for name in _COLUMNS] for row in rows))

    SCHEDULE.write(out, plain(schedule) | {"lookup": LOOKUP}, more=policy)
