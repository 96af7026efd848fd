"""The chapters of a validation, made of its saved sections: in order, and with what is missing said."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from vsf_drake.report.page import (
    Bullets,
    Chapter,
    Column,
    Grid,
    Heading,
    Missing,
    Piece,
    Text,
    absent_chapter,
    made_chapter,
)
from vsf_drake.report.validation.bench_chapter import bench_chapter
from vsf_drake.report.validation.energy_chapter import energy_chapter
from vsf_drake.report.validation.roll_over_chapter import roll_over_chapter
from vsf_drake.report.validation.sensitivity_chapter import sensitivity_chapter
from vsf_drake.report.validation.settings_chapter import settings_chapter
from vsf_drake.report.validation.standing_chapter import standing_chapter
from vsf_drake.report.validation.walking_chapter import exact_chapter, walking_chapter

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
            missing = [str(sentence) for sentence in section.get("missing") or ()]
            chapters.append(replace(made, name=name, missing=[*missing, *made.missing]))
    return [*chapters, made_chapter("made", "How this was made", lambda: making_chapter(content), lenient)]


# The first and the last chapter of the validation's report: what it comes to, and how it was made.


_WHAT = (
    "The figures of this table are in the chapters below, with what they rest on. Paper: McGeehan, Adamczyk, "
    "Nichols and Hahn 2021 (doi 10.1115/1.4050456), on a person and a device; where the data here are synthetic, the "
    "two columns are of different things and are shown beside each other for their size only.")


def summary_chapter(content: Mapping[str, Any]) -> Chapter:
    """The summary of a validation: `content` of validation.json."""
    pieces: list[Piece] = [Missing(note) for note in content.get("notes", ())]
    pieces += [Missing(f"{label} is not among the results: {why}") for label, why in content.get("failed", ())]
    pieces += [
        Text(_WHAT),
        Grid(name="summary", caption="What the model is asked, what it shows, and what the paper reports.", columns=(
            Column(key="what", heading="what"), Column(key="shown", heading="here", form="{}"),
            Column(key="unit", heading="unit"), Column(key="paper", heading="paper", form="{}"),
            Column(key="asked", heading="asked"), Column(key="met", heading="met")), rows=content["summary"])]
    bench = content["sections"].get("bench", {}).get("table") or {}
    if bench.get("contact_on_bench"):
        pieces.append(Text("The foot of these figures was fitted to a bench too, as its contact file says; on that "
                           "bench stiffness, and what else was fitted there, is no prediction."))
    answer = (content["sections"].get("settings", {}).get("table") or {}).get("answer")
    if answer:
        pieces += [Heading("Can two settings be told apart?"), Text(answer)]
    columns = (Column(key="label", heading="trial"), Column(key="fulcrum_mm", heading="fulcrum (mm)", form="{:g}"),
               Column(key="role", heading="role"), Column(key="height_mm", heading="height (mm)", form="{:+z.1f}"),
               Column(key="fore_aft_mm", heading="fore-aft (mm)", form="{:+z.1f}"),
               Column(key="alignment_deg", heading="alignment (°)", form="{:+z.1f}"),
               Column(key="synthetic", heading="synthetic"),
               Column(key="doubts", heading="doubts"))
    return Chapter(name="summary", title="Summary", pieces=(*pieces, Grid(
        name="trials", columns=columns, rows=content["trials"],
        caption="The trials. Fitted: the contact was fitted to it. Held out: the fit has not seen it. Offsets fitted: "
                "where the prosthesis sits was fitted to this trial's plate; agreement is then no prediction. "
                "Height (+ shorter), fore-aft (+ forward), alignment (+ toe up): how it sits under its pylon.")))


def making_chapter(content: Mapping[str, Any]) -> Chapter:
    """Options, versions, files and times of a validation."""
    options, made = content["options"], content["provenance"]
    sections = [{"section": name.replace("_", " "), "wall_s": section["wall_s"]}
                for name, section in content["sections"].items()]
    files = [{"file": name, "sha256": digest} for name, digest in made["inputs_sha256"].items()]
    return Chapter(name="made", title="How this was made", pieces=(
        Bullets([f"{'Short form (--quick)' if options['quick'] else 'Full form'}, seed {options['seed']}, steps of "
                 f"{1e3 * options['step_s']:g} ms.",
                 "Software: " + ", ".join(f"{name} {version}" for name, version in made["versions"].items()) + ".",
                 f"Contact: {content['contact']}."]),
        Grid(name="times", caption="Time that each section took (s); of one kept from an interrupted run, then.",
             rows=sections, columns=(
                 Column(key="section", heading="section"), Column(key="wall_s", heading="time (s)", form="{:.1f}"))),
        Grid(name="files", caption="Files that were read.", rows=files, columns=(
            Column(key="file", heading="file"), Column(key="sha256", heading="SHA-256")))))
