"""What a tuning and a schedule leave on disk, all of it or nothing, and the chapters of their pages.

Chapters are functions of saved tables and arrays: numbers, decisions and figures for the templates `tuning/*.html.j2`,
where their tables stand too; words that the screen shows as well are in `tuning/words.txt.j2`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.analysis.tuning.common import FORMAT, check_tuning_table
from vsf_drake.analysis.tuning.schedule import DESCRIPTORS, POLICY_FORMAT, schedule_of
from vsf_drake.report.page import Chapter, listed, made_chapter, render, said, write_csv
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.tuning import figures, reading
from vsf_drake.report.tuning.reading import Arrays, Table

Facts = dict[str, Any]
"""Of a chapter: figures by name under "figures", the rest as its template calls it; `t` is the table."""
_MATTERS = {True: "yes", False: "NO", None: None}


def told(part: str, **facts: Any) -> list[str]:
    """The paragraphs of a macro of `tuning/words.txt.j2`, as plain text."""
    text = render("tuning/told.txt.j2", part=part, facts=facts).unescape()
    return [" ".join(paragraph.split()) for paragraph in text.split("\n\n") if paragraph.strip()]


def tuning_page(table: Table, arrays: Arrays, *, lenient: bool, folder: Path | None = None) -> Facts:
    """What `page.chapter_page` is to be given of tuning.json and tuning.npz: chapters that there is anything of."""
    makers = {
        "answer": ("Answer", _answer), "outcomes": ("What changes with the setting", _outcomes),
        "motion": ("Motion and forces", _motion), "tasks": ("One setting for each task, or one for all", _tasks),
        "pareto": ("Between two costs", _pareto), "robustness": ("How firm the setting is", _robustness),
        "range": ("The whole range", _range), "checks": ("Checks", _checks),
        "made": ("How this was made", _made)}
    needed = {"range": "sweep"} | {name: name for name in ("outcomes", "tasks", "pareto", "robustness")}
    return _page(table, arrays, {name: made for name, made in makers.items()
                                 if name not in needed or table[needed[name]]}, lenient) | {
        "title": told("title", what="Stiffness tuned", t=table)[0], "first_line": first_line(table),
        "alarm": "" if table["optimal"] else told("alarm", t=table)[0]}


def schedule_page(table: Table, arrays: Arrays, *, lenient: bool, folder: Path | None = None) -> Facts:
    """The same of a schedule: the policy, what it buys, and how it was made."""
    makers = {"policy": ("What the device would store", _policy), "buys": ("What adaptability buys", _buys),
              "made": ("How this was made", _made)}
    trials = ", ".join(trial for row in table["tasks"] for trial in row["trials"])
    return _page(table, arrays, makers, lenient) | {
        "title": told("title", what="Settings by task", t=table)[0],
        "first_line": told("first_line", t=table, trials=trials)[0],
        "alarm": "" if table["optimal"] else told("schedule_alarm", t=table)[0]}


def _page(
    table: Table, arrays: Arrays, makers: Mapping[str, tuple[str, Callable[[Table, Arrays], Facts]]], lenient: bool
) -> Facts:
    def chapter(name: str, title: str, make: Callable[[Table, Arrays], Facts]) -> Chapter:
        facts = {"t": table, "figures": {}} | make(table, arrays)
        return Chapter(name=name, title=title, template=f"tuning/{name}.html.j2", figures=facts.pop("figures"),
                       facts=facts)

    return {"synthetic": bool(table["synthetic"]), "chapters": [
        made_chapter(name, title, partial(chapter, name, title, make), lenient)
        for name, (title, make) in makers.items()]}


def first_line(table: Table) -> str:
    """Whose data these are, and what the model is."""
    return told("first_line", t=table, trials=listed(table["trials"]))[0]


def answer(table: Table) -> list[str]:
    """Which setting, how much better than others, and whether that is more than the uncertainty; in sentences."""
    if not table["optimal"]:
        return told("answer", t=table)
    (x, costs), row, holding = reading.swept(table), reading.cost_outcome(table), reading.holding_terms(table)
    others = [other for other in table["outcomes"] if other is not row]
    more, no_more, open_ = ([other["label"] for other in others if other["matters"] is kind]
                            for kind in (True, False, None))
    matters = None if row is None else row["matters"]
    nothing = row is None and bool(others) and not more and not open_
    places = reading.compared(table, partial(reading.cost_at, table), table["cost"])
    own = table["cost"] - sum(term["value"] for term in holding)
    return told(
        "answer", t=table, span=(x[0], x[-1]) if len(x) else None, row=row, places=places, holding=holding,
        size=float(costs.max() - costs.min()) if len(costs) else None,
        hardly="outcomes" if nothing else "cost" if matters is False and len(costs) else "",
        rest=reading.compared(table, partial(reading.rest_at, table), own) if places and holding else [],
        all_more=len(more) > max(1, len(others) - 1), more=more, no_more=no_more,
        unknown=matters is None and not more and not no_more)


def _answer(table: Table, arrays: Arrays) -> Facts:
    x, y = reading.swept(table)
    if len(x) < 2:
        return {"sentences": answer(table), "curve": None}
    low, high = int(np.argmin(y)), int(np.argmax(y))
    return {"sentences": answer(table), "figures": {"cost": figures.cost_curve_figure(table, arrays)},
            "curve": {"span": (x[0], x[-1]), "least": y[low], "least_mm": x[low], "most": y[high], "most_mm": x[high]}}


def _outcomes(table: Table, arrays: Arrays) -> Facts:
    own, shown = reading.cost_outcome(table), []
    for row in reading.shown_outcomes(table):
        x, y = reading.swept(table, "outcomes", row["name"])
        shown.append({**row, "x": x[[0, -1]], "y": y[[0, -1]]})
    return {"sentences": [row["sentence"] for row in table["outcomes"] if row["sentence"] and row is not own],
            "shown": shown, "figures": {"outcomes": figures.outcomes_figure(table)} if shown else {},
            "rows": [{**row, "told": _MATTERS[row["matters"]]} for row in table["outcomes"]]}


def _motion(table: Table, arrays: Arrays) -> Facts:
    """Forces, motion and torques, as far as they are there; a level 1 tuning has forces only."""
    found: Facts = {"stance": {}, "stride": None, "figures": {}}
    trials = reading.drawn_trials(table, arrays)
    if trials:
        found["figures"]["force"] = figures.stance_force_figure(table, arrays)
        found["stance"] = {trial: {name: np.nanmax(np.asarray(arrays[prefix + name])[:, 2])
                                   for name in ("recorded", *reading.SHOWN) if prefix + name in arrays}
                           for trial, prefix in trials.items()}
    if "phase" in arrays:
        found["figures"] |= {"stride_force": figures.stride_force_figure(table, arrays),
                             "motion": figures.course_figure(table, arrays, "q"),
                             "torque": figures.course_figure(table, arrays, "torque")}
        found["stride"] = [
            (name, suffix, float(np.linalg.norm(off))) for foot, name in reading.FEET.items()
            for suffix in ("_recorded", "_resimulated_prescribed", "_resimulated_feedback")
            if (off := reading.root_mean_squares(arrays, f"grf_{foot}", suffix)) is not None]
        names, torques = [str(name) for name in arrays["names"]], np.asarray(arrays["torque"]).T
        found["motion"] = [
            (name, f"{1e3 * away:.1f} mm" if name in reading.LENGTHS else f"{np.degrees(away):.1f}°")
            for name, away in zip(names, reading.root_mean_squares(arrays, "q"), strict=True)]
        found["torque"] = [(name, values.min(), values.max())
                           for name, values in zip(names[-len(torques):], torques, strict=True)]
    return found


def tasks_words(table: Table) -> str:
    """What adaptability buys."""
    lost = [value for row in table["tasks"] if (value := reading.excess(row)) is not None]
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
                mean=float(np.mean(lost)), most=max(lost), unit=reading.excess_unit(table), rest=rest,
                held=bool(reading.holding_terms({"terms": [], "sweep": [], **table})), cost_unit=table["cost_unit"])[0]


def _tasks(table: Table, arrays: Arrays) -> Facts:
    rows = [{**row, "excess": reading.excess(row)} for row in table["tasks"]]
    return {"buys": tasks_words(table), "intervals": False, "figures": {"tasks": figures.tasks_figure(table)},
            "rows": rows, "done": [row for row in rows if row["fulcrum_mm"] is not None],
            "unit": reading.excess_unit(table)}


def _pareto(table: Table, arrays: Arrays) -> Facts:
    rows = [row for row in table["pareto"] if row["first"] is not None and row["second"] is not None]
    ends = {key: (min(row[key] for row in rows), max(row[key] for row in rows))
            for key in ("fulcrum_mm", "first", "second")} if len(rows) > 1 else None
    return {"ends": ends, "front": told("pareto", t=table, ends=ends)[0],
            "figures": {"pareto": figures.pareto_figure(table)} if ends else {}}


def _robustness(table: Table, arrays: Arrays) -> Facts:
    return {"figures": {"robustness": figures.robustness_figure(table)}}


def _checks(table: Table, arrays: Arrays) -> Facts:
    return {"unmet": [row["label"] for row in table["checks"] if row["met"] is False]}


def _range(table: Table, arrays: Arrays) -> Facts:
    """The cost over the range, with its terms and the outcomes, a row a position."""
    headings = {"fulcrum_mm": "fulcrum (mm)", "cost": f"cost ({table['cost_unit']})"}
    headings |= {f"term_{row['name']}": row["label"] for row in table["terms"]}
    headings |= {f"outcome_{row['name']}": f"{row['label']} ({row['unit']})" for row in table["outcomes"]}
    rows = [{"fulcrum_mm": row["fulcrum_mm"], "cost": row["cost"], **{
        f"{kind[:-1]}_{name}": value for kind in ("terms", "outcomes") for name, value in (row[kind] or {}).items()}}
        for row in table["sweep"]]
    keys = sorted(dict.fromkeys(key for row in rows for key in row), key=lambda key: key.startswith("outcome_"))
    return {"rows": rows, "columns": [(key, headings.get(key, key.partition("_")[2]),
                                       "{:.1f}" if key == "fulcrum_mm" else "{:.4g}") for key in keys]}


def _made(table: Table, arrays: Arrays) -> Facts:
    """Notes, time, software, options and files."""
    made = {"versions": None, "seed": None, "options": None, "inputs_sha256": None} | (table["provenance"] or {})
    options = [{"option": name, "value": said(value, "none")} for name, value in (made["options"] or {}).items()]
    files = [{"file": name, "sha256": digest} for name, digest in (made["inputs_sha256"] or {}).items()]
    return {"made": made, "options": options, "files": files}


def schedule_words(table: Table) -> list[str]:
    """What the device would store and what that buys, in sentences."""
    return told("schedule", t=table, buys=tasks_words(table) if table["optimal"] else "")


def _policy(table: Table, arrays: Arrays) -> Facts:
    known = [row for row in table["tasks"] if row["exact_mm"] is not None]
    over = reading.telling(table) if len(known) > 1 else None
    return {"sentences": schedule_words(table), "known": known, "over": over, "unit": reading.excess_unit(table),
            "figures": {} if over is None else {"policy": figures.policy_figure(table, over)},
            "rows": [{**row, "excess": reading.excess(row), "told": _MATTERS[row["matters"]],
                      "of": ", ".join(row["trials"])} for row in _with_intervals(table, "low_mm", "high_mm")]}


def _with_intervals(table: Table, *ends: str) -> Iterable[Facts]:
    """The tasks with the ends of their intervals under these names."""
    return (row | dict(zip(ends, row["interval_mm"] or (None, None), strict=True)) for row in table["tasks"])


def _buys(table: Table, arrays: Arrays) -> Facts:
    curves, done = reading.curved(table), [row for row in table["tasks"] if row["fulcrum_mm"] is not None]
    shown = {"curves": figures.schedule_curves_figure(table)} if curves else {}
    if done:
        shown["tasks"] = figures.tasks_figure({**table, "tasks": done})
    return {"curves": curves, "done": done, "intervals": True, "figures": shown,
            "buys": tasks_words({**table, "tasks": done}) if done else ""}


# The folders.


TUNING = ResultsFolder(
    kind="tuning", command="tune", table="tuning.json", arrays="tuning.npz", show=tuning_page,
    known=lambda table: str(table.get("format")).startswith(FORMAT.rpartition(" ")[0]),
    valid=lambda table, path: check_tuning_table(table))
"""The table is that of `analysis.tuning.common.KEYS`; besides, where known, `recorded_mm`, where the fulcrum stood in
each trial. Arrays are any of `level1.tuning_arrays`, or of level 2: `phase` (n,) 0 to 1, `names` (8,), `q`,
`q_recorded` (n, 8) rad and m, `torque`, `torque_recorded` (n, 5) N m, `grf_prosthetic`, `grf_intact` (n, 2) N (forward,
up), and these two with `_recorded`, `_resimulated_prescribed`, `_resimulated_feedback`. Others are kept, not shown."""

SCHEDULE_KEYS = ("cost_name", "cost_label", "cost_unit", "level", "synthetic", "notes", "wall_s", "provenance")
"""What the table has besides the policy itself (`analysis.tuning.schedule.policy_table`)."""
POLICY_CSV = "policy.csv"
_COLUMNS = ("label", *DESCRIPTORS, "fulcrum_mm", "exact_mm", "interval_low_mm", "interval_high_mm", "cost",
            "cost_common", "matters", "optimal", "status")


def _check_schedule(table: Table, path: Path) -> None:
    missing = [key for key in SCHEDULE_KEYS if key not in table]
    if missing:
        raise ValueError(f"the table of a schedule lacks {', '.join(missing)}")
    schedule_of(table, file=path)


SCHEDULE = ResultsFolder(
    kind="schedule", command="schedule", table="policy.json", names=(POLICY_CSV,), show=schedule_page,
    known=lambda table: str(table.get("format")).startswith(POLICY_FORMAT.rpartition(" ")[0]), valid=_check_schedule)
"""The table is that of `policy_table`, with SCHEDULE_KEYS, and for every task `trials` (labels), `sweep` (lists of
`fulcrum_mm` and `cost`), and if known `rest`, `rest_common`: its cost at its own setting and at the one for all,
without terms that only hold to the recording."""


def write_schedule(out: str | Path, table: Table) -> Facts:
    """Writes a schedule with its policy.csv; see `ResultsFolder.write`."""
    def policy(folder: Path, table: Table) -> None:
        rows = _with_intervals(table, "interval_low_mm", "interval_high_mm")
        write_csv(folder / POLICY_CSV, _COLUMNS, ([row[name] for name in _COLUMNS] for row in rows))

    return SCHEDULE.write(out, table, more=policy)
