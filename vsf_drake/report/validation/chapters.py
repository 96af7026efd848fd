"""The story and the chapters of a validation, made of its saved sections, with what is missing
said."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from vsf_drake.base.files import record
from vsf_drake.base.sentences import say
from vsf_drake.model.setting import AtSetting, setting_column
from vsf_drake.report.page import Chapter, made_chapter
from vsf_drake.report.style import Arrays
from vsf_drake.report.validation.bench_chapter import bench_chapter, standing_chapter
from vsf_drake.report.validation.energy_chapter import energy_chapter
from vsf_drake.report.validation.roll_over_chapter import roll_over_chapter
from vsf_drake.report.validation.sensitivity_chapter import sensitivity_chapter
from vsf_drake.report.validation.settings_chapter import settings_chapter
from vsf_drake.report.validation.story import story_chapter
from vsf_drake.report.validation.walking_chapter import (
    exact_chapter,
    layers_chapter,
    walking_chapter,
)

Content = Mapping[str, Any]
"""What a `validation.json` holds, of any version, which a record of this version need not take."""


_MAKERS: dict[str, tuple[str, Callable[..., Chapter]]] = {
    "bench": ("Bench", bench_chapter),
    "standing": ("Standing", standing_chapter),
    "walking": ("Walking", walking_chapter),
    "layers": ("Prediction in layers", layers_chapter),
    "walking_exact": ("Walking without errors of measurement", exact_chapter),
    "layers_exact": (
        "Prediction in layers without errors of measurement",
        partial(layers_chapter, exact=True),
    ),
    "energy": ("Energy storage and return", energy_chapter),
    "roll_over": ("Roll-over and inclined loading", roll_over_chapter),
    "settings": ("Can two settings be distinguished?", settings_chapter),
    "sensitivity": ("Sensitivity", sensitivity_chapter),
}
"""By section: what its chapter is called, and what makes it."""
_OF_STUDIES = ("settings", "sensitivity")  # computed by studies/ship_validation.py
_made: dict[str, tuple[object, Arrays, Chapter]] = {}
"""The chapter of each section that was made last, and of what: a page that grows shows it again."""


def make_chapters(
    content: Content, arrays: Arrays, tables: Mapping[str, type], *, lenient: bool
) -> list[Chapter]:
    """The story; then of its appendix the main numbers, one chapter a section, and how it was made.
    `arrays` by "section/name", `tables` the records of the sections.

    If `lenient`, a section that this version cannot show is named as missing instead of raising, as
    for results that another version wrote or somebody edited.
    """
    moved = _within(arrays, "moved/")
    chapters = [
        made_chapter("story", "", partial(story_chapter, content, moved), lenient),
        made_chapter("summary", "Main numbers", partial(_summary, content), lenient),
    ]
    for name, (title, _) in _MAKERS.items():
        section, chapter = content["sections"].get(name), Chapter(name=name, title=title)
        if not isinstance(section, Mapping):
            some = ("layers", "walking_exact", "layers_exact")  # only of some studies
            if name in some or _passive(content):
                continue
            why = say(
                "validation",
                "absent",
                to_come=name.replace("_", " ") in (content.get("to_come") or ()),
                by="studies/ship_validation.py" if name in _OF_STUDIES else "vsf-drake validate",
            )
        elif section.get("failure") or section.get("table") is None:
            why = say("validation", "not_computed", why=section.get("failure") or "unknown")
        else:
            make = partial(_chapter_of, name, tables[name], section["table"])
            own = _within(arrays, f"{name}/")
            chapter = made_chapter(name, title, partial(make, own), lenient)
            why = [*map(str, section.get("missing") or ()), *chapter.missing]
        chapters.append(replace(chapter, name=name, title=title, missing=why))
    return [
        *chapters,
        made_chapter("made", "How this was made", partial(_making, content), lenient),
    ]


def _passive(content: Content) -> bool:
    """Whether a foot of it is passive: chapters of settings are then none of it."""
    return any(trial.get("fulcrum_mm", 0.0) is None for trial in content.get("trials") or ())


def _chapter_of(name: str, kind: type, saved: object, arrays: Arrays) -> Chapter:
    table, own, chapter = _made.get(name, (None, {}, Chapter(name="", title="")))
    if saved != table or own.keys() != arrays.keys() or any(own[k] is not arrays[k] for k in own):
        chapter = _MAKERS[name][1](record(kind, saved), arrays)
        _made[name] = (saved, arrays, chapter)
    return chapter


def _within(arrays: Arrays, begin: str) -> Arrays:
    """Those whose names begin so, by the rest of their names."""
    return {
        key.removeprefix(begin): array for key, array in arrays.items() if key.startswith(begin)
    }


def _summary(content: Content) -> Chapter:
    bench = (content["sections"].get("bench") or {}).get("table") or {}
    settings = [record(AtSetting, trial) for trial in content.get("trials") or ()]
    return Chapter(
        name="summary",
        title="Main numbers",
        template="validation/summary.html.j2",
        facts={
            "verdict": (),
            **content,
            "bench": bench,
            "place": setting_column(settings),
        },
    )


def _making(content: Content) -> Chapter:
    return Chapter(
        name="made",
        title="How this was made",
        template="validation/made.html.j2",
        facts={
            **content,
            "times": [
                {"section": name.replace("_", " "), "wall_s": section["wall_s"]}
                for name, section in content["sections"].items()
            ],
        },
    )
