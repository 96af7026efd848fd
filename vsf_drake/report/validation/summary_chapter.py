"""The first and the last chapter of the validation's report: what it comes to, and how it was made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vsf_drake.report.pieces import Bullets, Chapter, Column, Grid, Heading, Missing, Piece, Text

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
