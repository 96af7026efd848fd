"""The files that `vsf-drake export` leaves: the foot as SDFormat and MJCF, and what they were made from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vsf_drake.errors import InputError
from vsf_drake.files import sha256
from vsf_drake.model_file import check_fulcrum
from vsf_drake.parameters import FootParameters
from vsf_drake.plants.export import foot_mjcf, foot_sdf
from vsf_drake.schema import to_plain
from vsf_drake.simulation.archive import provenance, result_folder
from vsf_drake.yaml_file import dump

FORMATS = ("sdf", "mjcf", "both")
MOVABLE = "vsf_foot.sdf"
"""The foot whose support `wire_foot` brings."""
FIXED = "vsf_foot_at_{:g}mm"
"""The foot whose support stands still, without ending."""
SIDECAR = "export.yaml"


def write_export(
    foot: FootParameters, out: str | Path, *, fulcrum_m: float, form: str = "both", springs: bool = True,
    collision: bool = True, inputs: dict[str, str] | None = None
) -> dict[str, Any]:
    """Writes the models and their sidecar to the folder `out`, all or nothing; returns the sidecar.

    Args:
        fulcrum_m: where the support stands (m from A) in the files in which it stands still.
        form: one of FORMATS.
        springs: whether MOVABLE has the keel's springs.
        collision: whether the SDF files have collision spheres.
        inputs: SHA-256 by name of the files that the parameters come from.

    Raises:
        InputError: there is no such format, it is MJCF alone, which is whole and leaves nothing out, the fulcrum is out
            of reach, or `out` cannot be written.
    """
    if form not in FORMATS:
        raise InputError(f"{form!r} is not known", where="format", right=f"Known are {', '.join(FORMATS)}")
    if form == "mjcf" and not (springs and collision):
        raise InputError("an MJCF file always has springs and contact spheres", where="format",
                         right="Leave --no-springs and --no-collision out, or write SDF")
    check_fulcrum(fulcrum_m, foot, where="fulcrum")
    texts = {}
    if form in ("sdf", "both"):
        texts[MOVABLE] = foot_sdf(foot, springs=springs, collision=collision)
        texts[FIXED.format(1e3 * fulcrum_m) + ".sdf"] = foot_sdf(foot, fulcrum_m=fulcrum_m, collision=collision)
    if form in ("mjcf", "both"):
        texts[FIXED.format(1e3 * fulcrum_m) + ".xml"] = foot_mjcf(foot, fulcrum_m=fulcrum_m)
    with result_folder(out, "export") as folder:
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
        sidecar = {
            "kind": "export", "fulcrum_m": fulcrum_m,
            **({} if form == "mjcf" else {"springs_of_movable": springs, "collision_spheres_of_sdf": collision}),
            "files_sha256": {name: sha256(folder / name) for name in texts},
            "foot": to_plain(foot), "provenance": provenance(inputs)}
        (folder / SIDECAR).write_text(dump(sidecar), encoding="utf-8")
    return sidecar
