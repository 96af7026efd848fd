"""`vsf-drake export`: the foot as a model file for Drake, MuJoCo and others."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from vsf_drake.cli.app import Contact, Model, Out, app, console, contact_hash, file_of, model_of
from vsf_drake.errors import InputError
from vsf_drake.files import user_path


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

    out = ResultsFolder(kind="export", command="export", sidecar="export.yaml").check(user_path(out))
    model, contact = file_of(model), file_of(contact)
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
    with result_folder(out, "export") as folder:
        for name, text in texts.items():
            write_text(folder / name, text)
        sidecar: dict[str, Any] = {
            "kind": "export", "fulcrum_m": fulcrum_m,
            **({} if form == "mjcf" else {"springs_of_movable": springs, "collision_spheres_of_sdf": collision}),
            "files_sha256": {name: sha256(folder / name) for name in texts}, "foot": to_plain(foot),
            "provenance": provenance(contact_hash(contact) | (
                {} if model is None else {f"model: {model.name}": sha256(model)}))}
        write_text(folder / "export.yaml", dump(sidecar))
    for name in texts:
        console.print(f"written {out / name}", soft_wrap=True)
