"""`vsf-drake import` and `check`: a laboratory's files to trials that drive the model, and how good
they are."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.schema import SELDOM, option
from vsf_drake.cli import app as cli
from vsf_drake.cli.app import (
    Contact,
    FolderOrTrials,
    OptionalOut,
    Out,
    app,
    path,
    progress,
    read_trials,
    say,
    warn,
)
from vsf_drake.cli.options import Asked, fields_of, flags, from_fields, made
from vsf_drake.motion.import_options import AROUND_STANCES_S, ImportOptions
from vsf_drake.motion.manifest import Laboratory, Window, load_stated_subject
from vsf_drake.motion.markers.person_facts import PersonFacts

if TYPE_CHECKING:  # it imports Drake
    from vsf_drake.motion.trial import Trial
    from vsf_drake.recording.examine import Examined

AcceptUnusable = Annotated[
    bool,
    typer.Option(
        "--accept-unusable",
        help="Go on with recordings that `check` calls unusable; the results say so.",
    ),
]


def judged(trials: Sequence[Trial], *, accept: bool = True) -> list[Trial]:
    """The trials with what `check` says of each, among their notes too; prints the worst, with its
    largest cause, unless all are good.

    Every command that reads trials sends them through here, once. InputError for an unusable one
    unless `accept`."""
    from vsf_drake.recording import MARKS
    from vsf_drake.recording.examine import examine, settings_compared

    marks = [item.judged for item in settings_compared([examine(trial) for trial in trials])]
    worst, of = max(
        zip(marks, trials, strict=True),
        key=lambda pair: (MARKS.index(pair[0].mark), pair[0].expected_error_bw),
    )
    require(
        accept or worst.mark != "unusable",
        f"the recording is {worst.verdict}",
        right="`check` says more: correct it, leave it out, or give --accept-unusable",
        file=of.path,
    )
    several = f" (worst of {len(trials)})" if len(trials) > 1 else ""
    if worst.mark != MARKS[0]:
        (warn if worst.mark == "unusable" else say)(
            f"Recording {of.path.stem}{several}: {worst.verdict}"
        )
    return [
        dataclasses.replace(
            trial,
            judged=mark,
            notes=trial.notes if mark.mark == MARKS[0] else (mark.note, *trial.notes),
        )
        for trial, mark in zip(trials, marks, strict=True)
    ]


@dataclass(frozen=True, kw_only=True)
class ImportRequest:
    """Which files are read, and what they do not say of themselves."""

    subject: Path | None = option(None, "YAML file of the person, instead of the options above.")
    no_standing: bool = option(
        False, "There is no standing trial: a walk calibrates, which is doubtful.", panel=SELDOM
    )
    forces: tuple[Path, ...] = option(
        (),
        "Force file of each walk, in their order. Default: the file of the same name beside a "
        ".trc.",
        metavar="FILE",
        panel=SELDOM,
    )
    right_plate: str | None = option(
        None, "Plate under the right foot, if it is not detected correctly.", panel=SELDOM
    )
    left_plate: str | None = option(
        None, "Plate under the left foot, if it is not detected correctly.", panel=SELDOM
    )
    already_filtered: bool = option(False, "Do not filter the markers again.", panel=SELDOM)
    window: tuple[float, float] | None = option(
        None,
        "Part of the walks to use, in s. Default: the prosthetic foot's stances on plates and "
        f"{AROUND_STANCES_S:g} s around them.",
        metavar="START END",
        panel=SELDOM,
    )


@app.command("import")
@from_fields
def import_trials(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            parser=path,
            metavar="STATIC WALK...",
            help="Standing trial, then walks (.c3d, or .trc with forces); with "
            "--no-standing walks only.",
        ),
    ] = None,
    out: OptionalOut = None,
    list_markers: Annotated[
        Path | None,
        typer.Option(
            parser=path,
            help="Only print this file's labels and the beginning of a marker map made from them.",
        ),
    ] = None,
    *,
    person: Annotated[Asked, PersonFacts],
    request: ImportRequest,
    laboratory: Laboratory,
    reading: Annotated[Asked, ImportOptions],
) -> None:
    """Turns recordings of a person with markers over force plates into trials that drive the
    model."""
    if list_markers is not None:
        _list_markers(list_markers)
        return
    from vsf_drake.recording.import_walks import gather, import_walks
    from vsf_drake.report.import_outputs import IMPORT, write_import

    if not files or (len(files) < 2 and not request.no_standing):
        raise InputError(
            "a standing trial and at least one walk are needed",
            where="STATIC WALK...",
            right="Without a standing trial name walks only and give --no-standing",
        )
    out = cli.needed(out)
    for name in person:
        require(
            request.subject is None,
            "is given beside a file that says it",
            flags(fields_of(PersonFacts)[name])[0],
            "Write it into the --subject file",
        )
    facts, stated = (
        load_stated_subject(request.subject) if request.subject else (made(PersonFacts, person), {})
    )
    IMPORT.check(out)
    plates = {"right": request.right_plate, "left": request.left_plate}
    given: Asked = {
        "person": facts,
        "stated": stated,
        "laboratory": vars(laboratory),
        "plate_sides": plates if any(plates.values()) else None,
    }
    if request.window is not None:
        given["window"] = Window(start_s=request.window[0], end_s=request.window[1])
    if request.already_filtered:
        given["cutoff_hz"] = None
    options = made(ImportOptions, reading | given)
    standing = None if request.no_standing else files[0]
    with progress() as show:
        gathered = gather(standing, files[0 if standing is None else 1 :], request.forces)
        imported = import_walks(gathered, options, progress=show)
        show("writing the report", 0.95)
        write_import(imported, out)
    _finish(IMPORT.kind, imported.items, imported.failures, out, more=imported.told)


@app.command()
def check(trials: FolderOrTrials, out: Out, contact: Contact = None) -> None:
    """Judges the quality of recorded trials without simulating: a mark, a number and a sentence for
    every check."""
    from vsf_drake.recording.examine import examine, settings_compared
    from vsf_drake.report.import_outputs import CHECK, write_check

    CHECK.check(out)
    trials = cli.manifests_of(trials)
    read_trials([], contact)
    items = []
    failures = {}
    with progress() as show:
        for number, file in enumerate(trials):
            show(f"checking {file.name}", number / len(trials))
            try:
                [trial] = read_trials([file], contact)
                items.append(examine(trial))
            except InputError as error:
                if len(trials) == 1:
                    raise
                failures[str(file)] = str(error)
        if not items:
            raise InputError(
                "none of the trials can be read:\n"
                + "\n".join(f"- {why}" for why in failures.values())
            )
        items = settings_compared(items)
        write_check(items, failures, out)
    _finish(CHECK.kind, items, failures, out)


def _finish(
    kind: str,
    items: Sequence[Examined],
    failures: Mapping[str, str],
    out: Path,
    more: Sequence[str] = (),
) -> None:
    """Says how good each trial is and which files could not be used; exit code 2 if there are any
    of these."""
    # which imports what Drake would look through
    from vsf_drake.recording import motion_checks

    cli.print_text("recordings", items=items, to_do=motion_checks.TO_DO, more=more)
    cli.say(f"written to {out / kind}.html")
    for file, why in failures.items():
        cli.fail(why if file in why else f"{file}: {why}")
    if failures:
        sys.exit(InputError.exit_code)


def _list_markers(file: Path) -> None:
    """Labels and a started marker map, as YAML whose comments list the labels."""
    from vsf_drake.motion.formats.read import list_labels
    from vsf_drake.motion.markers.maps import suggest_map

    labels = list_labels(file)
    require(labels, "has no markers", file=file)
    typer.echo(f"# {' '.join(file.name.split())}\n{suggest_map(labels)}", nl=False)
