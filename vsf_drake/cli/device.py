"""`vsf-drake bench`, `export`, `show`, `stand` and `simulate`: one foot, or one person on it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsf_drake.base.errors import require
from vsf_drake.base.schema import choice, option
from vsf_drake.cli import app as cli
from vsf_drake.cli.app import Contact, Model, Out, app, path, progress, say
from vsf_drake.cli.options import PLACE, PLACES, PlaceOptions, from_fields, named_as_options
from vsf_drake.cli.recordings import judged
from vsf_drake.device.protocols import PROTOCOLS
from vsf_drake.simulation.options import BenchOptions, LawOptions, StandingOptions, StepOptions

if TYPE_CHECKING:
    from vsf_drake.engines.condensed_error import CondensedError
    from vsf_drake.model.parameters import FootParameters, ModelParameters


@dataclass(frozen=True, kw_only=True)
class BenchRequest(BenchOptions):
    """Which passes are made, or the clauses of which published test."""

    fulcrum: tuple[str, ...] = option(
        (),
        f"{PLACE}; may be repeated. Default: the paper's five; a passive foot has none.",
        flag="--fulcrum-mm",
        metavar=PLACES,
    )
    protocol: str | None = choice(
        None,
        options=tuple(PROTOCOLS),
        source="choice",
        metavar="|".join(PROTOCOLS),
        help="Answer the clauses of a published test instead, with a page: pressed at angles, "
        "rolled over, and what is not computed. --max-load-n is then also the first peak of the "
        "roll-over.",
    )


@app.command()
@from_fields
def bench(
    out: Out,
    model: Model = None,
    contact: Contact = None,
    *,
    asked: BenchRequest,
) -> None:
    """Presses the foot in the testing machine: stiffness at each fulcrum position and at the
    heel, or the clauses of a published test."""
    from vsf_drake.report.outputs import BENCH, write_bench
    from vsf_drake.simulation.bench import run_bench
    from vsf_drake.simulation.fulcrum_place import fulcrum_place

    device = cli.model_of(model).foot
    places_m = [fulcrum_place(said, device, where="--fulcrum-mm") for said in asked.fulcrum]
    if asked.protocol is not None:
        _by_protocol(out, model, contact, asked.protocol, asked, places_m)
        return
    BENCH.check(out)
    pressed = cli.model_of(model, contact)
    with progress() as show:
        result = run_bench(
            pressed,
            fulcrums_m=places_m or None,
            heel=asked.heel,
            max_load_n=asked.max_load_n,
            speed_m_per_s=1e-3 * asked.speed_mm_per_min / 60.0,
            progress=lambda f: show("pressing", f),
            inputs=cli.contact_hash(contact),
        )
    cli.print_text("bench", **vars(write_bench(result, out)))
    if contact:
        say(f"the foot has the fitted contact of {contact}")
    say(f"written to {out / 'bench.png'}, bench.json")


def _by_protocol(
    out: Path,
    model: Path | None,
    contact: Path | None,
    protocol: str,
    asked: BenchRequest,
    places_m: Sequence[float],
) -> None:
    """The clauses of a published test."""
    from vsf_drake.device.bench_protocol import bench_protocol
    from vsf_drake.report.protocol_page import CSV, PROTOCOL, write_protocol
    from vsf_drake.report.results_folder import PAGE

    require(asked.heel, "a protocol tests the heel", "--no-heel", "Leave it out")
    PROTOCOL.check(out)
    tested = cli.model_of(model, contact)
    names = {
        "fulcrums_m": "--fulcrum-mm",
        "speed_m_per_s": "--speed-mm-per-min",
    }
    with named_as_options(BenchRequest, **names), progress() as show:
        made = bench_protocol(
            tested,
            protocol,
            fulcrums_m=places_m or None,
            load_n=asked.max_load_n,
            speed_m_per_s=1e-3 * asked.speed_mm_per_min / 60.0,
            progress=show,
            inputs=cli.input_hashes(model, contact),
        )
        write_protocol(out, made)
    cli.print_text("protocol", t=made.table)
    say(f"written to {out / PAGE}, {CSV}, {PROTOCOL.table}")


_FORMATS = ("osim", "mjcf", "sdf")
_CONDENSED_FORMATS = ("osim", "mjcf")


@dataclass(frozen=True, kw_only=True)
class ExportRequest(PlaceOptions):
    """Which files of the foot are written, and for which of them the fulcrum is fixed where."""

    formats: tuple[str, ...] = choice(
        (),
        options=_FORMATS,
        source="choice",
        flag="--format",
        metavar="|".join(_FORMATS),
        shown="all that the form has",
        help="osim (OpenSim), mjcf (MuJoCo) or sdf (Drake and other readers of SDFormat). May be "
        "given several times.",
    )
    form: str = choice(
        "full",
        options=("full", "condensed"),
        source="choice",
        metavar="full|condensed",
        help="full, with all pieces of the keel, or condensed, two hinges and six contact "
        "spheres fitted to that, for optimal control: osim, mjcf and a table.",
    )
    springs: bool = option(
        True,
        "Write the keel's springs into vsf_foot.sdf; otherwise wire_foot adds them. "
        "The files with a fixed fulcrum always have them.",
    )
    collision: bool = option(
        True,
        "Write contact spheres as collision shapes into the SDF.",
    )
    discrete: bool = option(
        True,
        "Write the SDF with a fixed fulcrum for plants with a time step; otherwise for others.",
    )


@app.command()
@from_fields
def export(
    out: Out,
    model: Model = None,
    contact: Contact = None,
    *,
    asked: ExportRequest,
) -> None:
    """Writes the foot for OpenSim, MuJoCo and readers of SDFormat.

    vsf_foot.sdf is for find_foot and wire_foot, which add the movable fulcrum; the other files are
    complete without this package, at one fulcrum position. What a format cannot hold is said here,
    in export.yaml and at the top of the file.
    """
    from vsf_drake.base.files import sha256, write_text
    from vsf_drake.base.schema import to_plain
    from vsf_drake.base.yaml_file import dump
    from vsf_drake.engines.limits import cannot_hold
    from vsf_drake.report.results_folder import ResultsFolder
    from vsf_drake.simulation.archive import provenance, result_folder

    ResultsFolder(kind="export", command="export", sidecar="export.yaml").check(out)
    condensed = asked.form == "condensed"
    known = _CONDENSED_FORMATS if condensed else _FORMATS
    formats = asked.formats or known
    require(
        set(formats) <= set(known),
        "there is no condensed foot in SDFormat",
        "--format",
        "Take osim or mjcf, or --form full",
    )
    require(
        "sdf" in formats or (asked.springs and asked.collision and asked.discrete),
        "only SDF files are without springs or contact spheres, or for plants without a time step",
        "--format",
        "Leave --no-springs, --no-collision and --no-discrete out, or write the full foot as sdf",
    )
    exported = cli.model_of(model, contact)
    foot = exported.foot
    fulcrum_m = cli.place_of(asked, model)
    error = None
    if condensed:
        texts, error = _condensed_texts(foot, formats, fulcrum_m)
    else:
        texts = _full_texts(exported, formats, fulcrum_m, asked)
    limits = {
        name: cannot_hold(foot, name, law=exported.contact_law, condensed=condensed)
        for name in formats
        if name != "sdf" or asked.collision
    }
    inputs = cli.input_hashes(model, contact)
    with result_folder(out, "export") as folder:
        for name, text in texts.items():
            write_text(folder / name, text)
        write_text(
            folder / "export.yaml",
            dump(
                {
                    "kind": "export",
                    "form": asked.form,
                    "fulcrum_m": fulcrum_m,
                    "springs_of_movable": asked.springs,
                    "collision_spheres_of_sdf": asked.collision,
                    "discrete_sdf": asked.discrete,
                    "files_sha256": {name: sha256(folder / name) for name in texts},
                    "cannot_hold": limits,
                    "error_against_full": error and to_plain(error.worst),
                    "contact_law": exported.contact_law,
                    "foot": to_plain(foot),
                    "provenance": provenance(inputs),
                }
            ),
        )
    cli.print_text("export", out=out, files=list(texts), limits=limits, error=error)


def _full_texts(
    exported: ModelParameters, formats: Sequence[str], fulcrum_m: float, asked: ExportRequest
) -> dict[str, str]:
    """The files of the foot in all its pieces, by name."""
    from vsf_drake.engines.mjcf import foot_mjcf
    from vsf_drake.engines.osim import foot_osim
    from vsf_drake.engines.sdf import foot_sdf
    from vsf_drake.model.setting import moves

    foot = exported.foot
    law = exported.contact_law
    fixed = f"vsf_foot_at_{1e3 * fulcrum_m:g}mm" if moves(foot) else "vsf_foot_passive"
    texts = {}
    if "osim" in formats:
        texts[f"{fixed}.osim"] = foot_osim(foot, fulcrum_m=fulcrum_m, law=law)
    if "mjcf" in formats:
        texts[f"{fixed}.xml"] = foot_mjcf(foot, fulcrum_m=fulcrum_m, law=law)
    if "sdf" in formats:
        texts[f"{fixed}.sdf"] = foot_sdf(
            foot,
            fulcrum_m=fulcrum_m,
            collision=asked.collision,
            discrete=asked.discrete,
            law=law,
        )
        texts["vsf_foot.sdf"] = foot_sdf(
            foot, springs=asked.springs, collision=asked.collision, law=law
        )
    return texts


def _condensed_texts(
    foot: FootParameters, formats: Sequence[str], fulcrum_m: float
) -> tuple[dict[str, str], CondensedError]:
    """The files of the foot condensed to two hinges, by name, and its error."""
    from vsf_drake.engines.condensed import condense
    from vsf_drake.engines.condensed_error import error_against_full
    from vsf_drake.engines.condensed_files import condensed_csv, condensed_mjcf
    from vsf_drake.engines.condensed_osim import condensed_osim

    with progress() as show:
        show("condensing", 0.0)
        condensed = condense(foot)
        show("comparing with the full foot", 0.5)
        error = error_against_full(condensed)
    fixed = f"vsf_condensed_at_{1e3 * fulcrum_m:g}mm"
    texts = {"vsf_condensed.csv": condensed_csv(condensed, error)}
    if "osim" in formats:
        texts[f"{fixed}.osim"] = condensed_osim(condensed, error, fulcrum_m=fulcrum_m)
    if "mjcf" in formats:
        texts[f"{fixed}.xml"] = condensed_mjcf(condensed, error, fulcrum_m=fulcrum_m)
    return texts, error


@dataclass(frozen=True, kw_only=True)
class ShowRequest:
    """What is shown, and where."""

    what: str = option("foot", "What to show.", metavar="foot|bench|person")
    subject: Path | None = option(
        None,
        "subject.yaml or a trial manifest, for a person; default: the embedded reference subject.",
    )
    keel_joints: bool = option(
        False,
        "Also a slider for each joint of the keel, added to the deflection by the load.",
    )
    port: int | None = option(None, "Port to serve on. Default: any free one.")
    browser: bool = option(
        True,
        "Open the page in the desktop's browser.",
    )
    html: Path | None = option(
        None,
        "Write one page that opens without a network, with an animation instead of sliders, and "
        "exit.",
    )


@app.command()
@from_fields
def show(
    asked: ShowRequest,
    model: Model = None,
    contact: Contact = None,
) -> None:
    """Shows the model in a browser, with sliders for every joint, the fulcrum and a load on the
    keel."""
    from vsf_drake.base.files import resource
    from vsf_drake.motion.trial import load_subject
    from vsf_drake.report.show.scene import show_model, write_model_page

    subject = asked.subject
    if asked.what == "person" and subject is None:
        subject = resource("data/reference_subject/subject.yaml")
    person = None if subject is None else load_subject(subject)
    shown = cli.model_of(model, contact)
    if asked.html is not None:
        write_model_page(asked.what, shown, asked.html, person, keel_joints=asked.keel_joints)
        say(f"written to {asked.html}")
        return

    def tell(line: str) -> None:
        say(line)
        cli.console.file.flush()  # whoever reads it through a pipe waits for the address

    show_model(
        asked.what,
        shown,
        person,
        port=asked.port,
        browser=asked.browser,
        keel_joints=asked.keel_joints,
        say=tell,
    )


@app.command()
@from_fields
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
    *,
    place: PlaceOptions,
    asked: StandingOptions,
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
            fulcrum_m=cli.place_of(place, model),
            duration_s=asked.duration_s,
            upright=asked.upright,
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


@dataclass(frozen=True, kw_only=True)
class WalkRequest(StepOptions, LawOptions):
    """How a trial is walked, and what is written."""

    contact: Path | None = option(
        None,
        "File that `fit` wrote; its values replace the model's. none: the unfitted foot. "
        "Default: the embedded contact for embedded trials, unless offsets are fitted, else none.",
    )
    fit_offsets: bool = option(
        False, "First fit height, fore-aft position and alignment of the prosthesis."
    )
    fulcrum_mm: str | None = option(
        None, f"{PLACE}, under the same motion. Default: the trial's.", metavar=PLACES
    )
    replay: bool = option(
        True,
        "Write the replay (HTML).",
    )
    opensim: bool = option(False, "Also write walk_ik.mot and walk_grf.mot for OpenSim.")


@app.command()
@from_fields
def simulate(
    trial: Annotated[
        Path,
        typer.Argument(
            parser=path,
            metavar="TRIAL.yaml|FOLDER",
            help="Trial manifest, or a folder of them: each walk then has a folder in --out.",
        ),
    ],
    out: Out,
    asked: WalkRequest,
) -> None:
    """Drives the person with recorded motion and compares the predicted ground reaction force with
    the force plate, if the trial has one.

    The trials of a session's results are walked with its contact unless another is named.
    """
    from vsf_drake.report.fit_output import CONTACT
    from vsf_drake.report.session_page import FIT_FOLDER
    from vsf_drake.simulation.archive import RECORD_FILE

    if not trial.is_dir():
        _simulate(trial, out, asked)
        return
    own = trial / FIT_FOLDER / CONTACT
    if asked.contact is None and not asked.fit_offsets and own.is_file():
        asked = dataclasses.replace(asked, contact=own)
    manifests = cli.manifests_of([trial])
    taken = {folder.resolve() for folder in (trial, manifests[0].parent)}
    require(
        out.resolve() not in taken and not (out / RECORD_FILE).is_file(),
        "holds the trials or other results; each walk gets a folder of its own in it",
        "--out",
        "Choose another folder",
        file=out,
    )
    for manifest in manifests:
        _simulate(manifest, out / manifest.stem, asked)


def _simulate(trial: Path, out: Path, asked: WalkRequest) -> None:
    """One walk."""
    from vsf_drake.base.sentences import say as sentences
    from vsf_drake.model.contact_file import load_contact
    from vsf_drake.motion.trial import NO_PLATE
    from vsf_drake.report.outputs import WALK, write_walk
    from vsf_drake.simulation.fulcrum_place import fulcrum_place
    from vsf_drake.simulation.options import STARTS_LOADED
    from vsf_drake.simulation.walk import Walker
    from vsf_drake.walks.embedded import embedded_contact_beside
    from vsf_drake.walks.metrics import UNFITTED, unfitted_note
    from vsf_drake.walks.prediction import judged as judged_in_layers
    from vsf_drake.walks.prediction import layer_curves, predict
    from vsf_drake.walks.quantities import JUDGED, quantity
    from vsf_drake.walks.recorded_walk import walk_trial, with_contact

    embedded = None
    contact = None if asked.contact == Path("none") else asked.contact
    if asked.contact is None and not asked.fit_offsets:
        embedded = contact = embedded_contact_beside(trial)
    cli.check_contact_use(contact, fit_offsets=asked.fit_offsets)
    require(
        not asked.fit_offsets or asked.fulcrum_mm is None,
        "cannot go with --fit-offsets: the plate is of the recorded setting",
        "--fulcrum-mm",
        "Leave one of them out; where the manifest's setting is wrong, correct it there",
    )
    WALK.check(out)
    fitted = None if contact is None else load_contact(contact)
    step_s = 1e-3 * asked.step_ms
    layers = None
    person = None
    curves = None
    [recorded] = judged(cli.read_trials([trial], None))
    if fitted is None:
        note = unfitted_note(recorded, offsets_fitted=asked.fit_offsets)
        walked = dataclasses.replace(recorded, notes=(note, *recorded.notes))
    else:
        walked = with_contact(recorded, fitted, file=contact)
    [walked] = cli.under(asked.law, [walked])
    moved = None
    layered = fitted is not None and bool(fitted.momentum or fitted.person_curve)
    fulcrum_m = fulcrum_place(
        asked.fulcrum_mm,
        recorded.model.foot,
        default_m=recorded.fulcrum_m,
        where="--fulcrum-mm",
    )
    if not math.isclose(fulcrum_m, recorded.fulcrum_m, abs_tol=1e-6):
        [moved] = sentences(
            "other_setting",
            mm=1e3 * fulcrum_m,
            recorded_mm=1e3 * recorded.fulcrum_m,
            layered=layered,
        )
        walked = dataclasses.replace(
            walked,
            fulcrum_m=fulcrum_m,
            notes=(moved, *walked.notes),
            name=f"{walked.name} (recorded at {1e3 * recorded.fulcrum_m:g} mm)",
        )
    with progress() as show:
        result, fit = walk_trial(walked, with_fit=asked.fit_offsets, step_s=step_s, progress=show)
        if fitted is not None and layered and moved is None:
            show("predicting in layers", 1.0)
            walker = Walker(walked.subject, walked.model)
            in_layers = predict(walked, fitted, walker=walker, step_s=step_s)
            person = in_layers.person
            layers = judged_in_layers(in_layers, recorded, recorded.name, fitted)
            curves = layer_curves(in_layers, recorded, fitted)
    metrics = write_walk(
        result,
        walked,
        out,
        fit=fit,
        layers=layers,
        person=person,
        curves=curves,
        replay=asked.replay,
        opensim=asked.opensim,
    )
    why_not = "" if layers is None else layers.correction.why_not
    cli.print_text(
        "walk",
        **metrics | {"trial": recorded.name, "layers": layers},
        error_bw=metrics[JUDGED],
        person_peak_bw=person and person.force_n[:, 2].max() / metrics["body_weight_n"],
        percent=quantity(JUDGED).told,
        setting=walked.setting,
        embedded=embedded,
        first=(UNFITTED, NO_PLATE, STARTS_LOADED),
        moved=moved,
        by_phase=()
        if layers is None or layers.fitted
        else sentences("phases", phases=layers.phases),
        interval=person is not None and person.half_width_n is not None,
        not_corrected=sentences("not_corrected", "words", why_not=why_not) if why_not else (),
        learned=fitted is not None and fitted.person_curve is not None,
    )
    say(
        f"written to {out / 'walk.png'}{', replay.html' * asked.replay}, metrics.json"
        f"{', person_force.csv' * (person is not None)}"
        f"{', walk_ik.mot, walk_grf.mot' * asked.opensim}"
    )
