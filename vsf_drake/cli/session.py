"""`vsf-drake session`: from a folder of recordings to a verdict."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from vsf_drake.base.errors import FitError, InputError
from vsf_drake.base.schema import option, same_as
from vsf_drake.cli.app import Out, app, fail, interrupted, path, print_text, progress, say
from vsf_drake.cli.options import from_fields, named_as_options
from vsf_drake.motion.import_options import ImportOptions
from vsf_drake.motion.manifest import Laboratory
from vsf_drake.motion.markers.person_facts import PersonFacts


@dataclass(frozen=True, kw_only=True)
class SessionRequest:
    """What the files of a session do not say themselves."""

    prosthetic_side: str | None = same_as(PersonFacts, "prosthetic_side")
    sex: str | None = same_as(PersonFacts, "sex")
    subject: Path | None = option(
        None, "YAML file of the person instead. Default: subject.yaml in the folder."
    )
    model: Path | None = same_as(ImportOptions, "model")
    foot_length_mm: float | None = same_as(ImportOptions, "foot_length_mm")
    synthetic: bool = same_as(ImportOptions, "synthetic")
    csv: bool = option(False, "Also write all curves as one tidy table, curves.csv.")
    excel: bool = option(False, "Also write them as curves.xlsx (needs pandas and openpyxl).")
    opensim: bool = option(False, "Also write the modelled walks for OpenSim.")


@app.command()
@from_fields
def session(
    folder: Annotated[
        Path, typer.Argument(parser=path, metavar="FOLDER", help="Folder of the recordings.")
    ],
    out: Out,
    asked: SessionRequest,
    laboratory: Laboratory,
) -> None:
    """From a folder of recordings of one person to a verdict: which walks, how good, how well they
    are predicted, what to record next.

    session.csv in the folder says which file is what; where it is missing it is written as the
    files look, and where something has to be stated first the command asks for it. Run again, it
    goes on, and repeats only what depends on what was changed.
    """
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.sessions.curves import WRITERS
    from vsf_drake.sessions.plan import unused
    from vsf_drake.sessions.run import session as run_session

    of_person = dict(vars(asked))
    curves = [kind for kind in WRITERS if of_person.pop(kind)]
    try:
        with progress() as show, named_as_options(SessionRequest):
            found = run_session(
                folder,
                out=out,
                laboratory=vars(laboratory),
                curves=curves,
                progress=show,
                **of_person,
            )
    except KeyboardInterrupt:
        interrupted(": the same command goes on from the steps that are done")
    print_text("session", t=found.table, left_out=unused(found.table.files))
    say(f"written to {out / PAGE}")
    for file, why in found.failures.items():
        fail(why if file in why else f"{file}: {why}")
    if not found.table.success:
        raise FitError(f"{found.verdict} See {out / found.table.pages['fit']}")
    if found.failures:
        sys.exit(InputError.exit_code)
