"""`vsf-drake import` and `check`: a laboratory's files to trials that drive the model, and how good they are."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsf_drake.cli import app as cli
from vsf_drake.cli.app import Contact, OptionalOut, Out, Trials, app, path, progress, read_trials
from vsf_drake.errors import InputError, require

if TYPE_CHECKING:  # it imports Drake
    from vsf_drake.analysis.recording.examine import Examined


@app.command("import")
def import_trials(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            parser=path,
            metavar="STATIC WALK...",
            help="Standing trial, then walks (.c3d, or .trc with forces). Without a "
            "standing trial name the walk twice.",
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
    prosthetic_side: Annotated[str | None, typer.Option(help="right or left.")] = None,
    sex: Annotated[str | None, typer.Option(help="male or female.")] = None,
    mass_kg: Annotated[
        float | None, typer.Option(help="Body mass, prosthesis included. Default: from the forces.")
    ] = None,
    stature_m: Annotated[
        float | None, typer.Option(help="Stature. Default: from the leg's length.")
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the person in reports.")] = None,
    subject: Annotated[
        Path | None,
        typer.Option(parser=path, help="YAML file of the person, instead of the options above."),
    ] = None,
    fulcrum_mm: Annotated[
        list[float] | None,
        typer.Option(
            help="Fulcrum position from the keel's posterior end; once, or once per walk in their order. Default: "
            "108, mid-range."
        ),
    ] = None,
    marker_map: Annotated[
        str | None,
        typer.Option(
            "--map",
            "--marker-map",
            help="Marker map: plug_in_gait, rajagopal, ior or a file. Default: the best fit.",
        ),
    ] = None,
    forces: Annotated[
        list[Path] | None,
        typer.Option(
            parser=path,
            help=(
                "Force file of each walk, in their order. Default: the file of the same name beside a .trc."
            ),
        ),
    ] = None,
    right_plate: Annotated[
        str | None,
        typer.Option(help="Plate under the right foot, if it is not detected correctly."),
    ] = None,
    left_plate: Annotated[
        str | None, typer.Option(help="Plate under the left foot, if it is not detected correctly.")
    ] = None,
    up: Annotated[
        str | None, typer.Option(help="Laboratory axis that points up: x, y, z, -x, ...")
    ] = None,
    forward: Annotated[str | None, typer.Option(help="Laboratory axis of walking.")] = None,
    length_unit: Annotated[
        str | None, typer.Option(help="mm, cm or m, where the file does not say.")
    ] = None,
    hip: Annotated[
        str, typer.Option(help="Hip centre: harrington, bell, hara or davis.")
    ] = "harrington",
    cutoff_hz: Annotated[
        float, typer.Option(help="Cut-off of the zero-phase low-pass of the markers.")
    ] = 6.0,
    already_filtered: Annotated[
        bool, typer.Option("--already-filtered", help="Do not filter them again.")
    ] = False,
    longest_gap_s: Annotated[float, typer.Option(help="Longest gap of a marker to fill.")] = 0.1,
    window: Annotated[
        tuple[float, float] | None,
        typer.Option(
            metavar="START END",
            help="Part of the walks to use, in s. Default: the prosthetic foot's stances on "
            "plates and 0.3 s around them.",
        ),
    ] = None,
    belt_speed_m_per_s: Annotated[
        float, typer.Option(help="Belt speed of a treadmill; + when the belt runs backward.")
    ] = 0.0,
    scale_prosthesis: Annotated[
        bool,
        typer.Option(
            "--scale-prosthesis",
            help="Make the model's prosthetic foot as long as the recorded one.",
        ),
    ] = False,
    ik: Annotated[
        bool, typer.Option("--ik", help="Refine the angles by a global inverse kinematics.")
    ] = False,
    synthetic: Annotated[
        bool,
        typer.Option("--synthetic", help="Nobody was recorded: all results then say SYNTHETIC."),
    ] = False,
) -> None:
    """Turns recordings of a person with markers over force plates into trials that drive the model."""
    if list_markers is not None:
        _list_markers(list_markers)
        return
    from vsf_drake.analysis.import_walks import ImportOptions, gather, import_walks
    from vsf_drake.motion.manifest import Window, load_stated_subject
    from vsf_drake.motion.markers.person_facts import PersonFacts
    from vsf_drake.report.import_outputs import IMPORT, write_import

    if not files or len(files) < 2:
        raise InputError(
            "a standing trial and at least one walk are needed",
            where="STATIC WALK...",
            right="Without a standing trial name the walk twice",
        )
    if out is None:
        raise InputError("is missing", where="--out", right="Name the folder for the results")
    options_given = [
        option
        for option, value in (
            ("--prosthetic-side", prosthetic_side),
            ("--sex", sex),
            ("--mass-kg", mass_kg),
            ("--stature-m", stature_m),
            ("--name", name),
        )
        if value is not None
    ]
    if subject is not None and options_given:
        raise InputError(
            "is given beside a file that says it",
            where=options_given[0],
            right="Write it into the --subject file",
        )
    require(
        abs(belt_speed_m_per_s) <= 5.0,
        f"{belt_speed_m_per_s:g} m/s is no speed of a belt",
        "--belt-speed-m-per-s",
        "It must be between -5 and 5 m/s",
    )
    person, stated = (
        load_stated_subject(subject)
        if subject is not None
        else (
            PersonFacts(
                prosthetic_side=prosthetic_side,
                sex=sex,
                mass_kg=mass_kg,
                stature_m=stature_m,
                name=PersonFacts.name if name is None else name,
            ),
            {},
        )
    )
    IMPORT.check(out)
    options = ImportOptions(
        person=person,
        stated=stated,
        marker_map=marker_map,
        fulcrum_mm=tuple(fulcrum_mm or ()),
        laboratory={"up": up, "forward": forward, "length_unit": length_unit},
        hip=hip,
        cutoff_hz=None if already_filtered else cutoff_hz,
        longest_gap_s=longest_gap_s,
        plate_sides={"right": right_plate, "left": left_plate}
        if right_plate or left_plate
        else None,
        window=None if window is None else Window(start_s=window[0], end_s=window[1]),
        belt_speed_m_per_s=belt_speed_m_per_s,
        scale_prosthesis=scale_prosthesis,
        inverse_kinematics=ik,
        synthetic=synthetic,
    )
    with progress() as show:
        imported = import_walks(gather(files[0], files[1:], forces or ()), options, progress=show)
        show("writing the report", 0.95)
        write_import(imported, out)
    _finish(IMPORT.kind, imported.items, imported.failures, out, more=imported.scaling)


@app.command()
def check(trials: Trials, out: Out, contact: Contact = None) -> None:
    """Judges the quality of recorded trials without simulating: a mark, a number and a sentence for every check."""
    from vsf_drake.analysis.recording.examine import examine
    from vsf_drake.motion.manifest import load_manifest
    from vsf_drake.report.import_outputs import CHECK, write_check

    CHECK.check(out)
    read_trials([], contact)
    items, failures = [], {}
    with progress() as show:
        for number, file in enumerate(trials):
            show(f"checking {file.name}", number / len(trials))
            try:
                [trial], manifest = read_trials([file], contact), load_manifest(file)
                items.append(
                    examine(
                        trial,
                        cutoff_hz=None if manifest.already_filtered else manifest.marker_cutoff_hz,
                        belt_speed_m_per_s=manifest.belt_speed_m_per_s,
                    )
                )
            except InputError as error:
                if len(trials) == 1:
                    raise
                failures[str(file)] = str(error)
        if not items:
            raise InputError(
                "none of the trials can be read:\n"
                + "\n".join(f"- {why}" for why in failures.values())
            )
        write_check(items, failures, out)
    _finish(CHECK.kind, items, failures, out)


def _finish(
    kind: str,
    items: Sequence[Examined],
    failures: Mapping[str, str],
    out: Path,
    more: Sequence[str] = (),
) -> None:
    """Says how good each trial is and which files could not be used; exit code 2 if there are any of these."""
    from vsf_drake.analysis.recording import (
        motion_checks,
    )  # which imports what Drake would look through

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
    if not labels:
        raise InputError("has no markers", file=file)
    typer.echo(f"# {' '.join(file.name.split())}\n{suggest_map(labels)}", nl=False)
