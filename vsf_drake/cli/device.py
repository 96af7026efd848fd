"""`vsf-drake bench`, `export`, `show` and `stand`: the foot, or a person on it, without a recording."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from vsf_drake.cli.app import Contact, Model, Out, app, console, contact_hash, model_of, path, progress, say, warn
from vsf_drake.errors import InputError


@app.command()
def bench(
    out: Out,
    model: Model = None,
    contact: Contact = None,
    fulcrum_mm: Annotated[list[float] | None, typer.Option(
        help="Fulcrum position from the keel's posterior end; repeat for several. Default: the paper's five.")] = None,
    max_load_n: Annotated[float, typer.Option(help="Load at which a pass ends.")] = 600.0,
    speed_mm_per_min: Annotated[float, typer.Option(help="Speed of the platen.")] = 50.0,
    heel: Annotated[bool, typer.Option(help="Test the heel too.")] = True,
) -> None:
    """Presses the foot in the testing machine: stiffness at each fulcrum position and at the heel."""
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.report.outputs import BENCH, write_bench
    from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, run_bench

    BENCH.check(out)
    pressed = model_of(model, contact)
    positions = [1e-3 * position for position in fulcrum_mm] if fulcrum_mm else PUBLISHED_FULCRUMS_M
    with progress() as show:
        result = run_bench(pressed, fulcrums_m=positions, heel=heel, max_load_n=max_load_n,
                           speed_m_per_s=1e-3 * speed_mm_per_min / 60.0, progress=lambda f: show("pressing", f),
                           inputs=contact_hash(contact))
    print_bench(write_bench(result, out))
    if contact:
        say(f"the foot has the fitted contact of {contact}")
    say(f"written to {out}")


def print_bench(table: dict[str, Any]) -> None:
    """The table of settings, and how long it took."""
    grid = Table("fulcrum (mm)", "stiffness (N/mm)", "published", "mid-range (mm)", "load (N)", title="Bench")
    for row in table["settings"]:
        published = row["published_n_per_mm"]
        grid.add_row(f"{row['fulcrum_mm']:.0f}", f"{row['stiffness_n_per_mm']:.2f}",
                     "prediction" if published is None else f"{published:.1f}",
                     f"{row['mid_range_displacement_mm']:.2f}", f"{row['max_load_n']:.0f}")
    if table["heel_stiffness_n_per_mm"] is not None:
        published = f"{table['heel_published_n_per_mm']:.1f}"
        grid.add_row("heel", f"{table['heel_stiffness_n_per_mm']:.2f}", published, "", "")
    console.print(grid)
    refined = f", {table['refined_steps']} cut into smaller ones" if table["refined_steps"] else ""
    say(f"{table['simulated_s']:.0f} s simulated in {table['wall_s']:.2f} s (compilation, {table['compile_s']:.1f} s, "
        f"apart), {table['unconverged_steps']} steps unconverged{refined}")


@app.command()
def export(
    out: Out,
    model: Model = None,
    contact: Contact = None,
    fulcrum_mm: Annotated[float, typer.Option(
        help="Where the fulcrum stands, from the keel's posterior end, in the files in which it cannot move.")] = 108.0,
    form: Annotated[str, typer.Option(
        "--format", help="sdf (Drake, and what else reads SDFormat), mjcf (MuJoCo), or both.")] = "both",
    springs: Annotated[bool, typer.Option(
        help="Write the keel's springs into vsf_foot.sdf; without them wire_foot brings them. "
        "The files in which the fulcrum stands always have them.")] = True,
    collision: Annotated[bool, typer.Option(help="Write contact spheres as collision shapes into the SDF.")] = True,
) -> None:
    """Writes the rigid foot with its lumped springs as SDF and MJCF.

    vsf_foot.sdf is for find_foot and wire_foot, which bring the movable fulcrum; the other files are whole without
    this package, at one position of it. What a format cannot carry stands in the comment at the top of each file.
    """
    from vsf_drake.files import sha256, write_text
    from vsf_drake.model_file import check_fulcrum
    from vsf_drake.plants.export import foot_mjcf, foot_sdf
    from vsf_drake.report.results_folder import ResultsFolder
    from vsf_drake.schema import to_plain
    from vsf_drake.simulation.archive import provenance, result_folder
    from vsf_drake.yaml_file import dump

    ResultsFolder(kind="export", command="export", sidecar="export.yaml").check(out)
    foot, fulcrum_m = model_of(model, contact).foot, 1e-3 * fulcrum_mm
    if form not in ("sdf", "mjcf", "both"):
        raise InputError(f"{form!r} is not known", where="format", right="Known are sdf, mjcf, both")
    if form == "mjcf" and not (springs and collision):
        raise InputError("an MJCF file always has springs and contact spheres", where="format",
                         right="Leave --no-springs and --no-collision out, or write SDF")
    check_fulcrum(fulcrum_m, foot, where="fulcrum")
    fixed, texts = f"vsf_foot_at_{1e3 * fulcrum_m:g}mm", {}
    if form != "mjcf":
        texts = {"vsf_foot.sdf": foot_sdf(foot, springs=springs, collision=collision),
                 f"{fixed}.sdf": foot_sdf(foot, fulcrum_m=fulcrum_m, collision=collision)}
    if form != "sdf":
        texts[f"{fixed}.xml"] = foot_mjcf(foot, fulcrum_m=fulcrum_m)
    inputs = contact_hash(contact) | ({} if model is None else {f"model: {model.name}": sha256(model)})
    with result_folder(out, "export") as folder:
        for name, text in texts.items():
            write_text(folder / name, text)
        write_text(folder / "export.yaml", dump({
            "kind": "export", "fulcrum_m": fulcrum_m,
            **({} if form == "mjcf" else {"springs_of_movable": springs, "collision_spheres_of_sdf": collision}),
            "files_sha256": {name: sha256(folder / name) for name in texts}, "foot": to_plain(foot),
            "provenance": provenance(inputs)}))
    for name in texts:
        say(f"written {out / name}")


@app.command()
def show(
    what: Annotated[str, typer.Option(metavar="foot|bench|person", help="What to show.")] = "foot",
    model: Model = None,
    contact: Contact = None,
    subject: Annotated[Path | None, typer.Option(parser=path, help=(
        "subject.yaml or a trial manifest, for a person; default: the embedded reference subject."))] = None,
    keel_joints: Annotated[bool, typer.Option(
        "--keel-joints", help="A slider for each joint of the keel too, added to what the load does.")] = False,
    port: Annotated[int | None, typer.Option(help="Port to serve on; default: any free one.")] = None,
    browser: Annotated[bool, typer.Option(help="Open the page in the desktop's browser.")] = True,
    html: Annotated[Path | None, typer.Option(parser=path, help=(
        "Write one page that opens without a network, with an animation instead of sliders, and end."))] = None,
) -> None:
    """Shows the model in a browser, with sliders for every joint, the fulcrum and a load on the keel."""
    from vsf_drake.files import resource
    from vsf_drake.motion.trial_record import load_subject
    from vsf_drake.report.show.serve import show_model, write_model_page

    if what == "person" and subject is None:
        subject = resource("data/reference_subject/subject.yaml")
    person, shown = None if subject is None else load_subject(subject), model_of(model, contact)
    if html is not None:
        write_model_page(what, shown, html, person, keel_joints=keel_joints)
        say(f"written to {html}")
        return

    def tell(line: str) -> None:
        say(line)
        console.file.flush()  # whoever reads it through a pipe waits for the address

    show_model(what, shown, person, port=port, browser=browser, keel_joints=keel_joints, say=tell)


@app.command()
def stand(
    subject: Annotated[Path, typer.Argument(
        parser=path, help="subject.yaml, or a trial manifest, whose subject stands.")],
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

    STANDING.check(out)
    person = load_subject(subject)
    if contact:
        check_person(person, load_contact(contact), file=contact)
    stood_on = model_of(model, contact)
    with progress() as show:
        standing = simulate_standing(
            person, stood_on, fulcrum_m=1e-3 * fulcrum_mm, duration_s=duration_s, upright=upright,
            progress=lambda f: show("standing", f))
    if contact:
        note = (f"The model has the fitted contact of {contact.name} (SHA-256 {sha256(contact)}); what the fit adds to "
                "offsets and joint angles belongs to its recordings and is left out.")
        standing = dataclasses.replace(standing, notes=(note, *standing.notes))
    _print_standing(write_standing(standing, out))
    say(f"written to {out}")


def _print_standing(table: dict[str, Any]) -> None:
    """The table of forces and drift, the verdict and what it took."""
    grid = Table("", "value", title=Text(f"{table['subject']}, standing {table['duration_s']:g} s"), show_header=False)
    angles, legs = table["pelvis_deg"], table["leg_length_mm"]
    for row in (
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
    ):
        grid.add_row(*row)
    console.print(grid)
    if not table["stands"]:
        warn("This person does not stand still on the model: see drift, force and notes.")
    for note in table["notes"]:
        say(f"- {note}")
