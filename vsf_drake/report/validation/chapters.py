"""The chapters of a validation, made of its saved sections: in order, and with what is missing said."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from vsf_drake.files import record
from vsf_drake.report.page import Chapter, made_chapter
from vsf_drake.report.style import MEASURED, NEUTRAL, Arrays, colour_of, drawing, label, name_of
from vsf_drake.report.validation.bench_chapter import bench_chapter
from vsf_drake.report.validation.energy_chapter import energy_chapter
from vsf_drake.report.validation.roll_over_chapter import roll_over_chapter
from vsf_drake.report.validation.sensitivity_chapter import sensitivity_chapter
from vsf_drake.report.validation.settings_chapter import settings_chapter
from vsf_drake.report.validation.walking_chapter import exact_chapter, walking_chapter

if TYPE_CHECKING:
    from vsf_drake.analysis.validation.bench_section import StoodRow, StoodTable

Content = Mapping[str, Any]
"""What a `validation.json` holds, of any version, which a record of this version need not take."""
_LEAST_TOLD = 1e-4
"""Share of the mass below which an error has no number in a sentence."""


def standing_chapter(table: StoodTable, arrays: Arrays) -> Chapter:
    """Mass predicted against mass known, per fulcrum position."""
    stood = [(i, row) for i, row in enumerate(table.rows) if row.failure is None]
    facts = {"shown": [{**vars(row), "paper_mass_error": table.paper_mass_error,
                        "held": _held(row.held_nm) if row.failure is None else None} for row in table.rows],
             "stood": [row for _, row in stood], "tellable": abs(table.worst_mass_error or 0.0) >= _LEAST_TOLD,
             "notes": [f"Fulcrum at {row.fulcrum_mm:g} mm: {note}" for _, row in stood for note in row.notes]}
    return Chapter(name="standing", title="Standing", template="validation/standing.html.j2",
                   facts={**vars(table), **facts},
                   figures={"standing": _standing_figure(stood, table.duration_s, arrays)} if stood else {})


def _held(held_nm: Mapping[str, float]) -> str:
    return ", ".join(f"{name.removeprefix('pelvis_')} {value:+.1f} N m" for name, value in held_nm.items()) or "nothing"


_SETTLED_S = 1.0
"""What is drawn of the force: later there is nothing to see."""


def _standing_figure(rows: Sequence[tuple[int, StoodRow]], duration_s: float, arrays: Arrays) -> Figure:
    """Left, the force on both feet against the weight until it has settled; right, the mean force on each foot."""
    with drawing(10.5, 3.9) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(1.4, 1.0))
        weight = rows[0][1].weight_n
        left.axhline(weight, color=NEUTRAL, label=f"weight, {weight:.1f} N", **MEASURED)
        for k, (i, row) in enumerate(rows):
            time, *feet = (arrays[f"standing_{i}_{name}"] for name in ("time_s", "prosthetic_n", "intact_n"))
            left.plot(time, sum(feet), color=colour_of(row.fulcrum_mm), linewidth=1.4,
                      linestyle=("--", "-.", (0, (1, 1)), (0, (6, 1.5, 1, 1.5)))[k % 4],
                      label=f"{name_of(row.fulcrum_mm)}, mean {row.mean_vertical_n:.1f} N")
        left.set_xlim(0.0, min(duration_s, _SETTLED_S))
        left.legend(loc="upper right")
        label(left, x="time (s)", y="vertical force on both feet (N)", title="Let go off rest: the start")
        places = np.arange(len(rows))
        prosthetic = np.array([row.prosthetic_share * row.mean_vertical_n for _, row in rows])
        intact = np.array([row.mean_vertical_n for _, row in rows]) - prosthetic
        for bottom, height, shade, hatch, name in ((0.0 * places, prosthetic, "0.35", "", "prosthetic foot"),
                                                   (prosthetic, intact, "0.85", "///", "intact foot")):
            right.bar(places, height, bottom=bottom, color=shade, edgecolor="0.2", hatch=hatch, width=0.6, label=name)
        for place, (_, row) in zip(places, rows, strict=True):
            right.text(place, 0.5 * prosthetic[place], f"{row.prosthetic_share:.0%}", color="white",
                       ha="center", va="center")
        right.axhline(weight, color=NEUTRAL, **MEASURED)
        right.set_xticks(places, [f"{row.fulcrum_mm:g}" for _, row in rows])
        right.set_ylim(0.0, 1.3 * weight)
        right.legend(loc="upper center", ncols=2)
        label(right, x="fulcrum from the keel's end (mm)", y="mean vertical force (N)", title="How the feet share it")
    return figure


_MAKERS: dict[str, tuple[str, Callable[..., Chapter]]] = {
    "bench": ("Bench", bench_chapter), "standing": ("Standing", standing_chapter),
    "walking": ("Walking", walking_chapter), "walking_exact": ("Without errors of measurement", exact_chapter),
    "energy": ("Energy storage and return", energy_chapter), "roll_over": ("Roll-over", roll_over_chapter),
    "settings": ("Can two settings be told apart?", settings_chapter),
    "sensitivity": ("Sensitivity", sensitivity_chapter)}
"""By section: what its chapter is called if it cannot be made, and what makes it."""


def make_chapters(
    content: Content, arrays: Arrays, tables: Mapping[str, type], *, lenient: bool
) -> list[Chapter]:
    """Summary, one chapter a section, and how it was made; `arrays` by "section/name", `tables` the sections' records.

    If `lenient`, a section that this version cannot show is named as missing instead of raising, as for results that
    another version wrote or somebody edited.
    """
    chapters = [made_chapter("summary", "Summary", partial(_summary, content), lenient)]
    for name, (title, maker) in _MAKERS.items():
        section, chapter = content["sections"].get(name), Chapter(name=name, title=title)
        if not isinstance(section, Mapping):
            if name == "walking_exact":  # only of the embedded trials
                continue
            why = ["These results have no such section."]
        elif section.get("failure") or section.get("table") is None:
            why = [f"This could not be computed: {section.get('failure') or 'unknown'}"]
        else:
            own = {key.removeprefix(f"{name}/"): array for key, array in arrays.items() if key.startswith(f"{name}/")}

            def make(name: str = name, maker: Callable[..., Chapter] = maker, saved: object = section["table"],
                     own: Arrays = own) -> Chapter:
                return maker(record(tables[name], saved), own)

            chapter = made_chapter(name, title, make, lenient)
            why = [*map(str, section.get("missing") or ()), *chapter.missing]
        chapters.append(replace(chapter, name=name, missing=why))
    return [*chapters, made_chapter("made", "How this was made", partial(_making, content), lenient)]


def _summary(content: Content) -> Chapter:
    tables = {name: (content["sections"].get(name) or {}).get("table") or {} for name in ("bench", "settings")}
    return Chapter(
        name="summary", title="Summary", template="validation/summary.html.j2", missing=content.get("notes", ()),
        facts={**content, "summary": [row for row in content["summary"] if row.get("value") is not None],
               "failed": content.get("failed", ()), "on_bench": tables["bench"].get("contact_on_bench"),
               "answer": tables["settings"].get("answer")})


def _making(content: Content) -> Chapter:
    return Chapter(name="made", title="How this was made", template="validation/made.html.j2", facts={
        **content, "times": [{"section": name.replace("_", " "), "wall_s": section["wall_s"]}
                             for name, section in content["sections"].items()],
        "files": [{"file": name, "sha256": digest} for name, digest in content["provenance"]["inputs_sha256"].items()]})
