"""`vsf-drake certify`: do other engines compute the same foot from its files?"""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from vsf_drake.base.errors import VsfError
from vsf_drake.cli.app import (
    Contact,
    Model,
    Out,
    app,
    input_hashes,
    model_of,
    print_text,
    progress,
    say,
)


@app.command()
def certify(
    out: Out,
    engine: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="An engine that must be there: drake, opensim, mujoco or exudyn. May be given "
            "several times. Default: all that are installed.",
        ),
    ] = None,
    model: Model = None,
    contact: Contact = None,
) -> None:
    """Has other engines compute the foot from its exported files, each in a process of its own, and
    compares what they find.

    An engine that is not installed is said not to have run. The exit code is 0 where all that ran
    agree, 1 where they do not.
    """
    from vsf_drake.engines.certificate.run import certify as run
    from vsf_drake.report.certificate_page import CERTIFICATE, write_certificate
    from vsf_drake.report.results_folder import PAGE

    CERTIFICATE.check(out)
    with progress() as show:
        found = run(
            model_of(model, contact).foot,
            engines=engine or None,
            inputs=input_hashes(model, contact),
            progress=show,
        )
        show("writing the page", 0.97)
        write_certificate(out, found)
    print_text("certificate", c=found, labels={each.name: each.label for each in found.engines})
    say(f"written to {out / PAGE}, certificate.json")
    if not found.agreed:
        sys.exit(VsfError.exit_code)
