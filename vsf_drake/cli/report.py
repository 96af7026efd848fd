"""`vsf-drake report`: the report of a validation made again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vsf_drake.cli.app import app, console


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(help="Folder that `vsf-drake validate --out` wrote.")],
) -> None:
    """Makes the report of a validation again from its saved results; nothing is simulated."""
    from vsf_drake.report.validation.output import PAGE, remake_report

    folder = folder.expanduser()
    for sentence in remake_report(folder):
        console.print(f"! {sentence}", style="bold yellow", highlight=False, markup=False)
    console.print(f"written to {folder / PAGE}", highlight=False, markup=False)
