"""The chapters of a validation, made of its saved sections: in order, and with what is missing said."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from vsf_drake.files import record
from vsf_drake.report.page import Chapter, made_chapter
from vsf_drake.report.style import Arrays
from vsf_drake.report.validation.bench_chapter import bench_chapter, standing_chapter
from vsf_drake.report.validation.energy_chapter import energy_chapter
from vsf_drake.report.validation.roll_over_chapter import roll_over_chapter
from vsf_drake.report.validation.sensitivity_chapter import sensitivity_chapter
from vsf_drake.report.validation.settings_chapter import settings_chapter
from vsf_drake.report.validation.walking_chapter import exact_chapter, walking_chapter

Content = Mapping[str, Any]
"""What a `validation.json` holds, of any version, which a record of this version need not take."""


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
