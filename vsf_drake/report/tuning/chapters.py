"""What a tuning leaves on disk, all of it or nothing, and the chapters of its page.

Chapters are functions of saved records and arrays: numbers, decisions and figures for the templates
`tuning/*.html.j2`, where their tables stand too; words are in `tuning/words.txt.j2`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.base.files import plain
from vsf_drake.report.page import Chapter, listed, made_chapter, render, said
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.tuning import figures, reading
from vsf_drake.report.tuning.reading import Arrays
from vsf_drake.tuning.common import SEEN
from vsf_drake.tuning.quantities import GIVEN_COSTS
from vsf_drake.tuning.table import FORMAT, Provenance, TuningTable, tuning_of
from vsf_drake.walks.metrics import UNFITTED

Facts = dict[str, Any]
"""Of a chapter: figures by name under "figures", the rest as its template calls it; `t` is the
record."""
Make = Callable[[TuningTable, Arrays], Facts]
FORM = "{:.4g}"
_SEEN = {True: "yes", False: "NO", None: None}


def words(part: str, **facts: Any) -> list[str]:
    """The paragraphs of a macro of `tuning/words.txt.j2`, as plain text."""
    text = render("tuning/told.txt.j2", part=part, facts=facts).unescape()
    return [" ".join(paragraph.split()) for paragraph in text.split("\n\n") if paragraph.strip()]


def tuning_page(
    saved: Mapping[str, Any], arrays: Arrays, *, lenient: bool, folder: Path | None = None
) -> Facts:
    """What `page.chapter_page` is to be given of tuning.json and tuning.npz: chapters that there is
    anything of."""
    # name, title, the part that it tells of ("" for none), what else it needs
    made: Sequence[tuple[str, str, Make, str, tuple[str, ...]]] = (
        ("answer", "", _answer, "", ("sweep", "terms", "outcomes", "design")),
        ("outcomes", "What changes with the setting", _outcomes, "outcomes", ("sweep",)),
        ("motion", "Motion and forces", _motion, "", ("sweep",)),
        ("along", "Along the person's own answer", _along, "along", ()),
        ("pareto", "Between two costs", _pareto, "pareto", ()),
        (
            "robustness",
            "How firm the setting is",
            lambda table, arrays: {"figures": {"robustness": figures.robustness_figure(table)}},
            "robustness",
            ("sweep",),
        ),
        ("range", "The whole range", _range, "sweep", ("terms", "outcomes")),
        (
            "checks",
            "Checks",
            lambda table, arrays: {},
            "",
            ("checks", "solver", "confirmed_by", "starts"),
        ),
        ("made", "How this was made", _made, "", ("provenance",)),
    )

    def shown(name: str, title: str, make: Make, parts: tuple[str, ...]) -> Chapter:
        table = tuning_of(saved, parts)
        facts = make(table, arrays)
        return Chapter(
            name=name,
            title=title,
            template=f"tuning/{name}.html.j2",
            figures=facts.pop("figures", {}),
            facts={"t": table, "unfitted": UNFITTED, **facts},
        )

    head = tuning_of(saved, ())
    return {
        "title": words("title", t=head)[0],
        "first_line": " ".join(first_line(head)),
        "alarm": "" if head.optimal else words("alarm", t=head)[0],
        "synthetic": head.synthetic,
        "chapters": [
            made_chapter(name, title, partial(shown, name, title, make, (part, *parts)), lenient)
            for name, title, make, part, parts in made
            if not part or saved.get(part)
        ],
    }


def first_line(table: TuningTable) -> list[str]:
    """Whose data these are, and what the model is."""
    return words("first_line", t=table, trials=listed(table.trials))


def answer(table: TuningTable) -> list[str]:
    """Which setting, how much better than others, and whether that is more than the uncertainty; in
    sentences."""
    places: list[reading.Compared] = []
    rest: list[reading.Compared] = []
    if table.optimal and table.cost is not None:
        places = reading.compared(table, table.cost_at, table.cost)
        if places and table.holding and table.rest is not None:
            rest = reading.compared(table, table.rest_at, table.rest)
    return words("answer", t=table, places=places, rest=rest)


def _answer(table: TuningTable, arrays: Arrays) -> Facts:
    drawn = {}
    if len(table.swept()[0]) > 1:
        drawn["cost"] = figures.cost_curve_figure(table, arrays)
        if len(table.terms) > 1:
            drawn["terms"] = figures.terms_figure(table)
    return {"sentences": answer(table), "figures": drawn, "drawn": list(drawn)}


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
"""Outcomes of level 2 that a reader sees first: those that stiffness was seen to change in people,
the load of the residual limb, and energy."""


def _outcomes(table: TuningTable, arrays: Arrays) -> Facts:
    shown = []
    for row in reading.shown_outcomes(table):
        x, y = table.swept("outcomes", row.name)
        shown.append({"label": row.label, "unit": row.unit, "x": x[[0, -1]], "y": y[[0, -1]]})
    rows = [{**vars(row), "told": _SEEN[row.matters]} for row in table.outcomes]
    null = [table.spring_alone[i].equal_load for i in (0, -1)] if table.spring_alone else []
    return {
        "null": [
            {**row, "spring_soft": null[0][row["name"]], "spring_stiff": null[1][row["name"]]}
            for row in rows
            if null and row["name"] != "cost" and null[0].get(row["name"]) is not None
        ],
        "shown": shown,
        "figures": {"outcomes": figures.outcomes_figure(table)} if shown else {},
        "rows": rows,
        "seen": ", ".join(f"{value:g} {unit}" for unit, value in SEEN.items()),
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
        names = [str(name) for name in arrays["names"]]
        torques = np.asarray(arrays["torque"]).T
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


def _along(table: TuningTable, arrays: Arrays) -> Facts:
    null = [point for point in table.along if point.equal_load is not None]
    return {
        "said": words("along", t=table, null=null)[0],
        "cost": GIVEN_COSTS[table.cost_name],
        "figures": {"along": figures.along_figure(table)},
    }


def _pareto(table: TuningTable, arrays: Arrays) -> Facts:
    known = [row for row in table.pareto if row.first is not None and row.second is not None]
    shown = known if len(known) > 1 else []
    costs = [GIVEN_COSTS[name].heading for name in table.pareto_names]
    return {
        "shown": shown,
        "front": words("pareto", rows=shown, costs=costs)[0],
        "costs": costs,
        "figures": {"pareto": figures.pareto_figure(table)} if shown else {},
    }


def _range(table: TuningTable, arrays: Arrays) -> Facts:
    named = {"fulcrum_mm": ("fulcrum (mm)", "{:.1f}"), "cost": (f"cost ({table.cost_unit})", FORM)}
    for term in table.terms:
        named[f"term_{term.name}"] = f"in the cost: {term.label}", FORM
    for row in table.outcomes:
        named[f"outcome_{row.name}"] = f"{row.label} ({row.unit})", FORM
    rows = [
        {
            "fulcrum_mm": point.fulcrum_mm,
            "cost": point.cost,
            **{f"term_{name}": value for name, value in point.terms.items()},
            **({} if point.walked is None else {"walked": point.walked}),
            **{f"null_{name}": value for name, value in point.equal_load.items()},
            **{f"outcome_{name}": value for name, value in point.outcomes.items()},
        }
        for point in table.sweep
    ]
    labels = {row.name: f"{row.label} ({row.unit})" for row in table.outcomes}
    named["walked"] = f"own stride, before it adapts ({table.cost_unit})", FORM
    named |= {f"null_{name}": (f"spring alone: {labels[name]}", FORM) for name in labels}
    named["null_cost"] = f"spring alone: cost without the hold ({table.cost_unit})", FORM
    keys = sorted(
        dict.fromkeys(key for row in rows for key in row),
        key=lambda key: key.startswith("outcome_"),
    )
    return {
        "rows": rows,
        "columns": [(key, *named.get(key, (key.partition("_")[2], FORM))) for key in keys],
    }


def _made(table: TuningTable, arrays: Arrays) -> Facts:
    made = table.provenance or Provenance()
    return {
        "made": made,
        "files": [{"file": name, "sha256": digest} for name, digest in made.inputs_sha256.items()],
        "options": [
            {"option": name, "value": said(value, "none")} for name, value in made.options.items()
        ],
    }


TUNING = ResultsFolder(
    layered=True,
    kind="tuning",
    command="tune",
    table="tuning.json",
    arrays="tuning.npz",
    show=tuning_page,
    known=lambda table: str(table.get("format")).startswith(FORMAT.rpartition(" ")[0]),
    valid=lambda table, path: tuning_of(table, ()),
)
"""The table is that of `TuningTable`. Arrays are any of `tuning.tuning_arrays`, or of level 2:
`phase` (n,) 0 to 1, `names` (8,), `q`, `q_recorded` (n, 8) rad and m, `torque`, `torque_recorded`
(n, 5) N m, `grf_prosthetic`, `grf_intact` (n, 2) N (forward, up), and these two with `_recorded`,
`_resimulated_prescribed`, `_resimulated_feedback`. Others are kept, not shown."""


def write_tuning(out: str | Path, table: TuningTable, arrays: Mapping[str, np.ndarray]) -> None:
    """Writes a tuning; see `ResultsFolder.write`."""
    TUNING.write(out, plain(table), arrays)
