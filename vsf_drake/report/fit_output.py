"""What a contact fit leaves on disk: the contact, its table, curves, figures and page. All of it or nothing."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.contact_file import FittedContact, save_contact
from vsf_drake.errors import InputError
from vsf_drake.files import replaced, sha256
from vsf_drake.json_file import read_json, write_json
from vsf_drake.npz_file import read_npz
from vsf_drake.report.fit_figures import fit_figures
from vsf_drake.report.fit_page import fit_page
from vsf_drake.report.style import save_figure
from vsf_drake.simulation.archive import check_target, remove_result, result_folder

FIT = "fit"
CONTACT, TABLE, CURVES, PAGE, CHECKPOINT = "contact.yaml", "fit.json", "fit.npz", "report.html", "checkpoint.json"


def check_fit_folder(out: Path) -> None:
    """Whether a fit can go to `out`: a new or empty folder, or that of an earlier fit, finished or not.

    Raises:
        InputError: it cannot be written, or holds anything else.
    """
    check_target(out, FIT, lambda out: (out / TABLE).exists() or (out / CHECKPOINT).exists(),
                 names=(CONTACT, TABLE, CURVES, PAGE, CHECKPOINT))
    if (out / TABLE).exists() and _table(out / TABLE).get("kind") != FIT:
        raise InputError("is not the table of a fit", file=out / TABLE, right="Choose another folder")


def clear_fit(out: Path, *, checkpoint: bool = True) -> None:
    """Removes what an earlier fit left in `out`, its checkpoint too unless told otherwise; files of others stay.

    Raises:
        InputError: a file cannot be removed.
    """
    with _writing(out):
        remove_result(out, FIT, (CONTACT,))
        if checkpoint:
            (out / CHECKPOINT).unlink(missing_ok=True)


def write_fit(
    table: Mapping[str, Any], curves: Mapping[str, np.ndarray], out: Path, *, contact: FittedContact | None = None
) -> dict[str, Any]:
    """Writes everything of a fit to `out`; what an earlier fit left there goes, and so does the checkpoint.

    Args:
        table, curves: of `analysis.contact_fit.table`.
        contact: what was fitted; not for a fit that failed.

    Returns:
        What fit.json holds.

    Raises:
        InputError: `out` cannot be written.
        ValueError: a contact is given with the table of a fit that failed.
    """
    if contact is not None and not table["success"]:
        raise ValueError("a fit that failed leaves no contact")
    figures = fit_figures(table, curves)
    files = [TABLE, PAGE, *(f"{name}{suffix}" for name in figures for suffix in (".png", ".svg")),
             *([CURVES] if curves else []), *([CONTACT] if contact is not None else [])]
    written = {**table, "files": sorted(files)}
    with _writing(out), result_folder(out, FIT, stale=(CONTACT,)) as folder:
        if curves:
            with replaced(folder / CURVES, "wb") as stream:
                np.savez_compressed(stream, allow_pickle=False, **dict(curves))
        written["arrays_sha256"] = sha256(folder / CURVES) if curves else None
        write_json(folder / TABLE, written)
        with replaced(folder / PAGE) as stream:
            stream.write(fit_page(written, figures))
        for name, figure in figures.items():
            save_figure(figure, folder / name)
        if contact is not None:
            save_contact(contact, folder / CONTACT)
    with _writing(out):
        (out / CHECKPOINT).unlink(missing_ok=True)
    return written


def read_fit(folder: str | Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Table and curves that `write_fit` left in `folder`; `fit_figures` and `fit_page` make the rest of them.

    Raises:
        InputError: a file is missing or damaged, or the two do not belong together.
    """
    table, path = _table(Path(folder) / TABLE), Path(folder) / CURVES
    if table.get("kind") != FIT:
        raise InputError("is not the table of a fit", file=Path(folder) / TABLE)
    if table["arrays_sha256"] is None:
        return table, {}
    if sha256(path) != table["arrays_sha256"]:
        raise InputError(f"is not the file that {TABLE} describes (its SHA-256 differs)", file=path)
    return table, read_npz(path)


def _table(path: Path) -> dict[str, Any]:
    return read_json(path, right="A fit leaves one")


@contextlib.contextmanager
def _writing(out: Path) -> Iterator[None]:
    """Faults of the file system as InputError."""
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror or error})", file=out) from None
