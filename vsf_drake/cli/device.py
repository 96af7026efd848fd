"""`vsf-drake bench`, `export`, `show`, `stand` and `simulate`: one foot, or one person on it."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Annotated

import typer

from vsf_drake.base.errors import require
from vsf_drake.cli import app as cli
from vsf_drake.cli.app import Contact, Model, Out, app, path, progress, say
from vsf_drake.cli.recordings import judged


@app.command()
def bench(
    out: Out,
    model: Model = None,
    contact: Contact = None,
    fulcrum_mm: Annotated[
        list[float] | None,
        typer.Option(
            metavar="MM",
            help=(
                "Fulcrum position from the keel's posterior end; may be repeated. Default: the "
                "paper's five."
            ),
        ),
    ] = None,
    max_load_n: Annotated[float, typer.Option(help="Load at which a pass ends.")] = 600.0,
    speed_mm_per_min: Annotated[float, typer.Option(help="Speed of the platen.")] = 50.0,
    heel: Annotated[bool, typer.Option(help="Test the heel too.")] = True,
) -> None:
    """Presses the foot in the testing machine: stiffness at each fulcrum position and at the
    heel."""
    from vsf_drake.report.outputs import BENCH, write_bench
    from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, run_bench

    BENCH.check(out)
    pressed = cli.model_of(model, contact)
    positions = [1e-3 * position for position in fulcrum_mm] if fulcrum_mm else PUBLISHED_FULCRUMS_M
    with progress() as show:
        result = run_bench(
            pressed,
            fulcrums_m=positions,
            heel=heel,
            max_load_n=max_load_n,
            speed_m_per_s=1e-3 * speed_mm_per_min / 60.0,
            progress=lambda f: show("pressing", f),
            inputs=cli.contact_hash(contact),
        )
    cli.print_text("bench", **vars(write_bench(result, out)))
    if contact:
        say(f"the foot has the fitted contact of {contact}")
    say(f"written to {out / 'bench.png'}, bench.json")


@app.command()
def export(
    out: Out,
    model: Model = None,
    contact: Contact = None,
    fulcrum_mm: Annotated[
        float,
        typer.Option(
            help=(
                "Fulcrum position, from the keel's posterior end, in the files in which it is "
                "fixed."
            )
        ),
    ] = 108.0,
    form: Annotated[
        str,
        typer.Option(
            "--format", help="sdf (Drake and other readers of SDFormat), mjcf (MuJoCo), or both."
        ),
    ] = "both",
    springs: Annotated[
        bool,
        typer.Option(
            help="Write the keel's springs into vsf_foot.sdf; otherwise wire_foot adds them. "
            "The files with a fixed fulcrum always have them."
        ),
    ] = True,
    collision: Annotated[
        bool, typer.Option(help="Write contact spheres as collision shapes into the SDF.")
    ] = True,
) -> None:
    """Writes the rigid foot with its lumped springs as SDF and MJCF.

    vsf_foot.sdf is for find_foot and wire_foot, which add the movable fulcrum; the other files are
    complete without this package, at one fulcrum position. The comment at the top of each file says
    what its format cannot hold.
    """
    from vsf_drake.base.files import sha256, write_text
    from vsf_drake.base.schema import to_plain
    from vsf_drake.base.yaml_file import dump
    from vsf_drake.model.model_file import check_fulcrum
    from vsf_drake.plants.export import foot_mjcf, foot_sdf
    from vsf_drake.report.results_folder import ResultsFolder
    from vsf_drake.simulation.archive import provenance, result_folder

    ResultsFolder(kind="export", command="export", sidecar="export.yaml").check(out)
    foot = cli.model_of(model, contact).foot
    fulcrum_m = 1e-3 * fulcrum_mm
    require(
        form in ("sdf", "mjcf", "both"),
        f"{form!r} is not known",
        "format",
        "Known are sdf, mjcf, both",
    )
    require(
        form != "mjcf" or (springs and collision),
        "an MJCF file always has springs and contact spheres",
        "format",
        "Leave --no-springs and --no-collision out, or write SDF",
    )
    check_fulcrum(fulcrum_m, foot, where="fulcrum")
    fixed = f"vsf_foot_at_{1e3 * fulcrum_m:g}mm"
    texts = {}
    if form != "mjcf":
        texts = {
            "vsf_foot.sdf": foot_sdf(foot, springs=springs, collision=collision),
            f"{fixed}.sdf": foot_sdf(foot, fulcrum_m=fulcrum_m, collision=collision),
        }
    if form != "sdf":
        texts[f"{fixed}.xml"] = foot_mjcf(foot, fulcrum_m=fulcrum_m)
    inputs = cli.contact_hash(contact) | (
        {} if model is None else {f"model: {model.name}": sha256(model)}
    )
    with result_folder(out, "export") as folder:
        for name, text in texts.items():
            write_text(folder / name, text)
        write_text(
            folder / "export.yaml",
            dump(
                {
                    "kind": "export",
                    "fulcrum_m": fulcrum_m,
                    **(
                        {}
                        if form == "mjcf"
                        else {"springs_of_movable": springs, "collision_spheres_of_sdf": collision}
                    ),
                    "files_sha256": {name: sha256(folder / name) for name in texts},
                    "foot": to_plain(foot),
                    "provenance": provenance(inputs),
                }
            ),
        )
    for name in texts:
        say(f"written {out / name}")


@app.command()
def show(
    what: Annotated[str, typer.Option(metavar="foot|bench|person", help="What to show.")] = "foot",
    model: Model = None,
    contact: Contact = None,
    subject: Annotated[
        Path | None,
        typer.Option(
            parser=path,
            help=(
                "subject.yaml or a trial manifest, for a person; default: the embedded reference "
                "subject."
            ),
        ),
    ] = None,
    keel_joints: Annotated[
        bool,
        typer.Option(
            "--keel-joints",
            help="Also a slider for each joint of the keel, added to the deflection by the load.",
        ),
    ] = False,
    port: Annotated[
        int | None, typer.Option(help="Port to serve on. Default: any free one.")
    ] = None,
    browser: Annotated[bool, typer.Option(help="Open the page in the desktop's browser.")] = True,
    html: Annotated[
        Path | None,
        typer.Option(
            parser=path,
            help=(
                "Write one page that opens without a network, with an animation instead of "
                "sliders, and exit."
            ),
        ),
    ] = None,
) -> None:
    """Shows the model in a browser, with sliders for every joint, the fulcrum and a load on the
    keel."""
    from vsf_drake.base.files import resource
    from vsf_drake.motion.trial import load_subject
    from vsf_drake.report.show.scene import show_model, write_model_page

    if what == "person" and subject is None:
        subject = resource("data/reference_subject/subject.yaml")
    person = None if subject is None else load_subject(subject)
    shown = cli.model_of(model, contact)
    if html is not None:
        write_model_page(what, shown, html, person, keel_joints=keel_joints)
        say(f"written to {html}")
        return

    def tell(line: str) -> None:
        say(line)
        cli.console.file.flush()  # whoever reads it through a pipe waits for the address

    show_model(what, shown, person, port=port, browser=browser, keel_joints=keel_joints, say=tell)


@app.command()
def stand(
    subject: Annotated[
        Path,
        typer.Argument(
            parser=path, help="subject.yaml, or a trial manifest that names the subject."
        ),
    ],
    out: Out,
    model: Model = None,
    contact: Contact = None,
    fulcrum_mm: Annotated[
        float, typer.Option(help="Fulcrum position from the keel's posterior end.")
    ] = 108.0,
    duration_s: Annotated[float, typer.Option(help="How long to stand.")] = 10.0,
    upright: Annotated[
        bool,
        typer.Option(
            "--upright",
            help="Hold the pelvis's angles; otherwise as many of them are free as stay stable.",
        ),
    ] = False,
) -> None:
    """Simulates standing at anatomically neutral angles: does the ground carry the weight, and how
    much each foot?"""
    from vsf_drake.base.files import sha256
    from vsf_drake.model.contact_file import load_contact
    from vsf_drake.motion.fitted_trial import check_person
    from vsf_drake.motion.trial import load_subject
    from vsf_drake.report.outputs import STANDING, write_standing
    from vsf_drake.simulation.standing import simulate_standing

    STANDING.check(out)
    person = load_subject(subject)
    if contact:
        check_person(person, load_contact(contact), file=contact)
    stood_on = cli.model_of(model, contact)
    with progress() as show:
        standing = simulate_standing(
            person,
            stood_on,
            fulcrum_m=1e-3 * fulcrum_mm,
            duration_s=duration_s,
            upright=upright,
            progress=lambda f: show("standing", f),
        )
    if contact:
        note = (
            f"The model has the fitted contact of {contact.name} (SHA-256 {sha256(contact)}); "
            "what the fit adds to offsets and joint angles belongs to its recordings and is left "
            "out."
        )
        standing = dataclasses.replace(standing, notes=(note, *standing.notes))
    cli.print_text("standing", **vars(write_standing(standing, out)))
    say(f"written to {out / 'standing.png'}, standing.json")


@app.command()
def simulate(
    trial: Annotated[Path, typer.Argument(parser=path, help="Trial manifest (YAML).")],
    out: Out,
    contact: Annotated[
        Path | None,
        typer.Option(
            parser=path,
            help=(
                "File that `fit` wrote; its values replace the model's. none: the unfitted foot. "
                "Default: the embedded contact for embedded trials, unless offsets are fitted, "
                "else none."
            ),
        ),
    ] = None,
    fit_offsets: Annotated[
        bool,
        typer.Option(
            "--fit-offsets",
            help="First fit height, fore-aft position and alignment of the prosthesis.",
        ),
    ] = False,
    fulcrum_mm: Annotated[
        float | None,
        typer.Option(
            help=(
                "Fulcrum position from the keel's posterior end, under the same motion. Default: "
                "the trial's."
            )
        ),
    ] = None,
    step_ms: Annotated[float, typer.Option(help="Step of the simulation.")] = 1.0,
    replay: Annotated[bool, typer.Option(help="Write the replay (HTML).")] = True,
    opensim: Annotated[
        bool, typer.Option("--opensim", help="Also write walk_ik.mot and walk_grf.mot for OpenSim.")
    ] = False,
) -> None:
    """Drives the person with recorded motion and compares the predicted ground reaction force with
    the force plate."""
    from vsf_drake.base.sentences import say as sentences
    from vsf_drake.model.contact_file import load_contact
    from vsf_drake.model.model_file import check_fulcrum
    from vsf_drake.motion.fitted_trial import trial_with
    from vsf_drake.report.outputs import WALK, write_walk
    from vsf_drake.simulation.walk import Walker
    from vsf_drake.walks.embedded import embedded_contact_beside
    from vsf_drake.walks.metrics import UNFITTED, unfitted_note
    from vsf_drake.walks.prediction import layers_of
    from vsf_drake.walks.quantities import JUDGED, quantity
    from vsf_drake.walks.recorded_walk import walk_trial

    embedded = embedded_contact_beside(trial) if contact is None and not fit_offsets else None
    contact = embedded if contact is None else None if contact == Path("none") else contact
    cli.check_contact_use(contact, fit_offsets=fit_offsets)
    require(
        not fit_offsets or fulcrum_mm is None,
        "cannot go with --fit-offsets: the plate is of the recorded setting",
        "--fulcrum-mm",
        "Leave one of them out; where the manifest's setting is wrong, correct it there",
    )
    WALK.check(out)
    fitted = None if contact is None else load_contact(contact)
    step_s = 1e-3 * step_ms
    layers = None
    [recorded] = judged(cli.read_trials([trial], None))
    if fitted is None:
        note = unfitted_note(recorded, offsets_fitted=fit_offsets)
        walked = dataclasses.replace(recorded, notes=(note, *recorded.notes))
    else:
        walked = trial_with(recorded, fitted, file=contact)
    moved = None
    layered = fitted is not None and bool(fitted.momentum or fitted.discrepancy)
    if fulcrum_mm is not None:
        fulcrum_m = check_fulcrum(1e-3 * fulcrum_mm, walked.model.foot, where="--fulcrum-mm")
    if fulcrum_mm is not None and not math.isclose(fulcrum_m, recorded.fulcrum_m, abs_tol=1e-6):
        [moved] = sentences(
            "other_setting", mm=fulcrum_mm, recorded_mm=1e3 * recorded.fulcrum_m, layered=layered
        )
        walked = dataclasses.replace(
            walked,
            fulcrum_m=fulcrum_m,
            notes=(moved, *walked.notes),
            name=f"{walked.name} (recorded at {1e3 * recorded.fulcrum_m:g} mm)",
        )
    with progress() as show:
        walk = walk_trial(walked, with_fit=fit_offsets, step_s=step_s, progress=show)
        if fitted is not None and layered and moved is None:
            show("predicting in layers", 1.0)
            layers = layers_of(
                recorded,
                recorded.name,
                fitted,
                walker=Walker(walked.subject, walked.model),
                step_s=step_s,
            )
    metrics = write_walk(
        walk.result, walk.trial, out, fit=walk.fit, layers=layers, replay=replay, opensim=opensim
    )
    why_not = "" if layers is None else layers.correction.why_not
    cli.print_text(
        "walk",
        **metrics | {"trial": recorded.name, "layers": layers},
        error_bw=metrics[JUDGED],
        percent=quantity(JUDGED).told,
        mm=1e3 * walked.fulcrum_m,
        embedded=embedded,
        unfitted=UNFITTED,
        moved=moved,
        not_corrected=sentences("not_corrected", "words", why_not=why_not) if why_not else (),
        learned=fitted is not None and fitted.discrepancy is not None,
    )
    say(
        f"written to {out / 'walk.png'}{', replay.html' * replay}, metrics.json"
        f"{', walk_ik.mot, walk_grf.mot' * opensim}"
    )
