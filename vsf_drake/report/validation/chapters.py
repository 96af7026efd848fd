"""The chapters of a validation, made of its saved sections: in order, and with what is missing said."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from vsf_drake.report.chapter_files import absent_chapter, made_chapter
from vsf_drake.report.pieces import Chapter, Missing, Piece
from vsf_drake.report.validation.bench.chapter import bench_chapter
from vsf_drake.report.validation.energy.chapter import energy_chapter
from vsf_drake.report.validation.roll_over.chapter import roll_over_chapter
from vsf_drake.report.validation.sensitivity.chapter import sensitivity_chapter
from vsf_drake.report.validation.settings.chapter import settings_chapter
from vsf_drake.report.validation.standing_chapter import standing_chapter
from vsf_drake.report.validation.summary_chapter import making_chapter, summary_chapter
from vsf_drake.report.validation.walking.chapter import walking_chapter
from vsf_drake.report.validation.walking.exact_chapter import exact_chapter

Maker = Callable[[Mapping[str, Any], Mapping[str, np.ndarray]], Chapter]
_MAKERS: dict[str, tuple[str, Maker]] = {
    "bench": ("Bench", bench_chapter), "standing": ("Standing", standing_chapter),
    "walking": ("Walking", walking_chapter), "walking_exact": ("Without errors of measurement", exact_chapter),
    "energy": ("Energy storage and return", energy_chapter), "roll_over": ("Roll-over", roll_over_chapter),
    "settings": ("Can two settings be told apart?", settings_chapter),
    "sensitivity": ("Sensitivity", sensitivity_chapter)}
"""By section: what its chapter is called if it cannot be made, and what makes it."""
_OPTIONAL = ("walking_exact",)


def make_chapters(content: Mapping[str, Any], arrays: Mapping[str, np.ndarray], *, lenient: bool) -> list[Chapter]:
    """Summary, one chapter a section, and how it was made.

    Args:
        content: of validation.json. arrays: of validation.npz, by "section/name".
        lenient: whether a section that this version cannot show is named as missing instead of raising, as for results
            that another version wrote or somebody edited.
    """
    chapters = [made_chapter("summary", "Summary", lambda: summary_chapter(content), lenient)]
    for name, (title, maker) in _MAKERS.items():
        section = content["sections"].get(name)
        if not isinstance(section, Mapping):
            if name not in _OPTIONAL:
                chapters.append(absent_chapter(name, title, "These results have no such section."))
        elif section.get("failure") or section.get("table") is None:
            chapters.append(absent_chapter(
                name, title, f"This could not be computed: {section.get('failure') or 'unknown'}"))
        else:
            own = {key.partition("/")[2]: array for key, array in arrays.items() if key.partition("/")[0] == name}
            made = made_chapter(
                name, title, lambda maker=maker, table=section["table"], own=own: maker(table, own), lenient)
            missing: list[Piece] = [Missing(str(sentence)) for sentence in section.get("missing") or ()]
            chapters.append(Chapter(name=name, title=made.title, pieces=(*missing, *made.pieces)))
    return [*chapters, made_chapter("made", "How this was made", lambda: making_chapter(content), lenient)]
