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
    from vsf_drake.report.tuning import output as tuning
    from vsf_drake.report.tuning import schedule_output as schedule
    from vsf_drake.report.validation import output as validation

    folder = user_path(folder)
    others = ((tuning.TABLE, tuning.remake_tuning), (schedule.TABLE, schedule.remake_schedule))
    remake = next((make for table, make in others if (folder / table).is_file()), validation.remake_report)
    for sentence in remake(folder):
        console.print(f"! {sentence}", style="bold yellow", highlight=False, markup=False)
    console.print(f"written to {folder / validation.PAGE}", highlight=False, markup=False)
