"""`vsf-drake show`: the model to look at and to move."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vsf_drake.cli.app import Contact, Model, app, console, file_of, model_of
from vsf_drake.files import user_path


@app.command()
def show(
    what: Annotated[str, typer.Option(metavar="foot|bench|person", help="What to show.")] = "foot",
    model: Model = None,
    contact: Contact = None,
    subject: Annotated[Path | None, typer.Option(
        help="subject.yaml or a trial manifest, for a person; default: the embedded reference subject.")] = None,
    keel_joints: Annotated[bool, typer.Option(
        "--keel-joints", help="A slider for each joint of the keel too, added to what the load does.")] = False,
    port: Annotated[int | None, typer.Option(help="Port to serve on; default: any free one.")] = None,
    browser: Annotated[bool, typer.Option(help="Open the page in the desktop's browser.")] = True,
    html: Annotated[Path | None, typer.Option(
        help="Write one page that opens without a network, with an animation instead of sliders, and end.")] = None,
) -> None:
    """Shows the model in a browser, with sliders for every joint, the fulcrum and a load on the keel."""
    from vsf_drake.files import resource
    from vsf_drake.motion.trial_record import load_subject
    from vsf_drake.report.show.serve import show_model, write_model_page

    if what == "person":
        person = load_subject(user_path(subject) if subject else resource("data/reference_subject/subject.yaml"))
    else:
        person = load_subject(user_path(subject)) if subject else None
    shown = model_of(file_of(model), file_of(contact))
    if html is not None:
        html = user_path(html)
        write_model_page(what, shown, html, person, keel_joints=keel_joints)
        console.print(f"written to {html}", highlight=False, markup=False)
        return
    show_model(what, shown, person, port=port, browser=browser, keel_joints=keel_joints, say=_say)


def _say(line: str) -> None:
    console.print(line, highlight=False, markup=False, soft_wrap=True)
    console.file.flush()  # whoever reads it through a pipe waits for the address
