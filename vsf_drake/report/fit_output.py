"""What a contact fit leaves on disk: the contact, its table, curves, figures and page. All of it or nothing."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.contact_file import FittedContact, save_contact
from vsf_drake.errors import InputError
from vsf_drake.files import write_text
from vsf_drake.report.fit_figures import fit_figures
from vsf_drake.report.fit_page import fit_page
from vsf_drake.report.results_folder import PAGE, ResultsFolder
from vsf_drake.report.style import save_figure
from vsf_drake.simulation.archive import remove_result

CONTACT, CHECKPOINT = "contact.yaml", "checkpoint.json"
FIT = ResultsFolder(
    kind="fit", command="fit", table="fit.json", arrays="fit.npz", known=lambda table: table.get("kind") == "fit",
    damaged_too=False,
    names=(CONTACT, PAGE, CHECKPOINT), stale=(CONTACT,), unfinished=lambda out: (out / CHECKPOINT).exists())


def clear_fit(out: Path, *, checkpoint: bool = True) -> None:
    """Removes what an earlier fit left in `out`, its checkpoint too unless told otherwise; files of others stay.

    Raises:
        InputError: a file cannot be removed.
    """
    try:
        remove_result(out, FIT.kind, (CONTACT,))
        if checkpoint:
            (out / CHECKPOINT).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", file=out) from None


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
    files = [FIT.table, PAGE, *(f"{name}{suffix}" for name in figures for suffix in (".png", ".svg")),
             *([FIT.arrays] if curves else []), *([CONTACT] if contact is not None else [])]

    def more(folder: Path, written: dict[str, Any]) -> None:
        write_text(folder / PAGE, fit_page(written, figures))
        for name, figure in figures.items():
            save_figure(figure, folder / name)
        if contact is not None:
            save_contact(contact, folder / CONTACT)

    written = FIT.write(out, {**table, "files": sorted(files)}, curves or None, more=more)
    (out / CHECKPOINT).unlink(missing_ok=True)
    return written
