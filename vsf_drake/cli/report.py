"""`vsf-drake report`: the report of a validation or of a tuning made again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vsf_drake.cli.app import app, console


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(help="Folder that `validate`, `tune` or `schedule` wrote with --out.")],
) -> None:
    """Makes a report again from its saved results; nothing is simulated."""
    from vsf_drake.report.tuning import output as tuning
    from vsf_drake.report.validation import output as validation

    folder = folder.expanduser()
    remake = tuning.remake_tuning if (folder / tuning.TABLE).is_file() else validation.remake_report
    for sentence in remake(folder):
        console.print(f"! {sentence}", style="bold yellow", highlight=False, markup=False)
    console.print(f"written to {folder / validation.PAGE}", highlight=False, markup=False)
