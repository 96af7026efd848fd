"""`vsf-drake report`: the report of a validation, a tuning or a schedule made again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vsf_drake.cli.app import app, console
from vsf_drake.files import user_path


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(help="Folder that `validate`, `tune` or `schedule` wrote with --out.")],
) -> None:
    """Makes a report again from its saved results; nothing is simulated."""
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.report.tuning.output import SCHEDULE, TUNING
    from vsf_drake.report.validation.output import VALIDATION

    folder = user_path(folder)
    kind = next((kind for kind in (TUNING, SCHEDULE) if (folder / kind.table).is_file()), VALIDATION)
    for sentence in kind.remake(folder):
        console.print(f"! {sentence}", style="bold yellow", highlight=False, markup=False)
    console.print(f"written to {folder / PAGE}", highlight=False, markup=False)
