"""`vsf-drake export`: the foot as a model file for Drake, MuJoCo and others."""

from __future__ import annotations

from typing import Annotated

import typer

from vsf_drake.cli.app import Contact, Model, Out, app, console, contact_hash, file_of, model_of, target


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
    from vsf_drake.files import sha256
    from vsf_drake.report.export_output import SIDECAR, write_export

    out = target(out, "export", sidecar=SIDECAR)
    model, contact = file_of(model), file_of(contact)
    foot = model_of(model, contact).foot
    inputs = contact_hash(contact) | ({} if model is None else {f"model: {model.name}": sha256(model)})
    written = write_export(foot, out, fulcrum_m=1e-3 * fulcrum_mm, form=form,
                           springs=springs, collision=collision, inputs=inputs)
    for name in written["files_sha256"]:
        console.print(f"written {out / name}", highlight=False, markup=False, soft_wrap=True)
