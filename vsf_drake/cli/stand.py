"""`vsf-drake stand`: a person standing still on both feet."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from vsf_drake.cli.app import Contact, Model, Out, app, console, file_of, model_of, progress
from vsf_drake.files import user_path


@app.command()
def stand(
    subject: Annotated[Path, typer.Argument(help="subject.yaml, or a trial manifest, whose subject stands.")],
    out: Out,
    model: Model = None,
    contact: Contact = None,
    fulcrum_mm: Annotated[float, typer.Option(help="Fulcrum position from the keel's posterior end.")] = 108.0,
    duration_s: Annotated[float, typer.Option(help="How long to stand.")] = 10.0,
    upright: Annotated[bool, typer.Option(
        "--upright", help="Hold the pelvis's angles in any case; without it they are as free as stays up.")] = False,
) -> None:
    """Stands the person at anatomically neutral angles: does the ground carry the weight, and which foot how much?"""
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.contact_file import load_contact
    from vsf_drake.files import sha256
    from vsf_drake.motion.fitted_trial import check_person
    from vsf_drake.motion.trial_record import load_subject
    from vsf_drake.report.outputs import STANDING, write_standing
    from vsf_drake.simulation.standing import simulate_standing

    contact = file_of(contact)
    out = STANDING.check(user_path(out))
    person = load_subject(user_path(subject))
    if contact:
        check_person(person, load_contact(contact), file=contact)
    stood_on = model_of(file_of(model), contact)
    with progress() as show:
        standing = simulate_standing(
            person, stood_on, fulcrum_m=1e-3 * fulcrum_mm, duration_s=duration_s, upright=upright,
            progress=lambda f: show("standing", f))
    if contact:
        note = (f"The model has the fitted contact of {contact.name} (SHA-256 {sha256(contact)}); what the fit adds to "
                "offsets and joint angles belongs to its recordings and is left out.")
        standing = dataclasses.replace(standing, notes=(note, *standing.notes))
    print_standing(write_standing(standing, out))
    console.print(f"written to {out}", highlight=False)


def print_standing(table: dict[str, Any]) -> None:
    """The table of forces and drift, the verdict and what it took."""
    grid = Table("", "value", title=Text(f"{table['subject']}, standing {table['duration_s']:g} s"), show_header=False)
    angles, legs = table["pelvis_deg"], table["leg_length_mm"]
    rows = (
        ("weight (N)", f"{table['weight_n']:.2f}"),
        ("mean vertical force (N)", f"{table['mean_vertical_n']:.2f} ({table['weight_error']:+.3%})"),
        ("under the prosthetic foot", f"{table['prosthetic_share']:.1%}"),
        ("under the intact foot", f"{table['intact_share']:.1%}"),
        ("drift of the pelvis (mm)", f"{table['drift_mm']:.3f}"),
        ("turn of the pelvis (degrees)", f"{table['turn_deg']:.3f}"),
        ("pelvis tilt, list (degrees)", f"{angles['tilt']:.2f}, {angles['list']:.2f}"),
        ("leg, prosthetic and intact (mm)", f"{legs['prosthetic']:.1f}, {legs['intact']:.1f}"),
        ("free", ", ".join(table["free"])),
        ("held with (N m)", ", ".join(f"{key} {value:.1f}" for key, value in table["held_nm"].items()) or "nothing"),
        ("unconverged steps", str(table["unconverged_steps"])),
        *([("steps cut into smaller ones", str(table["refined_steps"]))] if table["refined_steps"] else []),
    )
    for label, value in rows:
        grid.add_row(label, value)
    console.print(grid)
    if not table["stands"]:
        console.print("! This person does not stand still on the model: see drift, force and notes.",
                      style="bold yellow", highlight=False)
    for note in table["notes"]:
        console.print(f"- {note}", highlight=False, markup=False)
