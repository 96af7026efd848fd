"""`vsf-drake schedule`: one fulcrum position for each task, as the device's controller would store them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from vsf_drake.cli.app import INTERRUPTED, Contact, app, console, errors, file_of, progress
from vsf_drake.cli.tune import Cost, Joints, Level, Quick, Range, Weights
from vsf_drake.cli.tune_options import TuneOptions, read_names, read_weights
from vsf_drake.errors import FitError
from vsf_drake.files import user_path


@app.command()
def schedule(
    tasks: Annotated[list[str], typer.Argument(
        metavar="TASKS...", help="LABEL=TRIAL.yaml, repeated; or a task file (YAML) with label, trials, speed_m_per_s, "
        "slope_deg and carried_kg of each.")],
    cost: Cost = "joint_load",
    out: Annotated[Path, typer.Option(help="Folder for the results; created if needed.")] = Path("schedule"),
    weights: Weights = None,
    level: Level = 1,
    contact: Contact = None,
    fulcrum_range: Range = None,
    joints: Joints = None,
    resolution_mm: Annotated[float | None, typer.Option(
        help="Steps in which the carriage stops, from the lower end of its range; default none.")] = None,
    seed: Annotated[int, typer.Option(help="Of all that is random.", min=0)] = 0,
    workers: Annotated[int | None, typer.Option(help="Threads for the walks; default one a core.", min=1)] = None,
    quick: Quick = False,
) -> None:
    """Tunes the fulcrum to every task by itself: a table to store, and what it buys over one setting for all.

    A task whose tuning did not end at an optimum makes the whole table one that may not be stored: it is written,
    marked so, and the exit code is 4.
    """
    options = TuneOptions(cost=cost, weights=read_weights(weights), level=level, fulcrum_range_mm=fulcrum_range,
                          joints=read_names(joints, "--joints"), seed=seed, workers=workers, quick=quick)
    from vsf_drake.analysis.tuning.schedule import read_tasks

    listed = read_tasks(tasks)
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.cli.tune import say, warn
    from vsf_drake.cli.tune_run import check_resolution, tune_tasks
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.report.tuning.chapters import schedule_words
    from vsf_drake.report.tuning.output import SCHEDULE, write_schedule

    out, contact = user_path(out), file_of(contact)
    SCHEDULE.check(out)
    with progress() as show:
        try:
            given = check_resolution(listed, contact, options, resolution_mm, show)
            table, interrupted = tune_tasks(listed, given, options, resolution_mm=resolution_mm, show=show)
        except KeyboardInterrupt:
            errors.print("interrupted before any task had a result; nothing was written", highlight=False)
            sys.exit(INTERRUPTED)
        show("writing the report", 0.99)
        written = write_schedule(out, table)
    if interrupted:
        errors.print(f"interrupted; what was found by then is in {out}, marked as NOT OPTIMAL", highlight=False,
                     soft_wrap=True, markup=False)
        raise SystemExit(INTERRUPTED) from KeyboardInterrupt()
    if not written["optimal"]:
        bad = "; ".join(f"{row['label']}: {row['status']}" for row in written["tasks"] if not row["optimal"])
        raise FitError(f"NOT OPTIMAL: {bad}. What was found is in {out}, marked so; see {out / PAGE}")
    for sentence in schedule_words(written):
        say(f"- {sentence}")
    for note in written["notes"]:
        warn(note)
    console.print(f"written to {out}; {SCHEDULE.table} is for the controller, open {PAGE} first", soft_wrap=True)
