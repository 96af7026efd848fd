"""`vsf-drake tune`: the fulcrum position, and what else of the foot, with the least cost for this person."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from vsf_drake.cli.app import INTERRUPTED, Contact, app, console, errors, file_of, progress
from vsf_drake.cli.tune_options import (
    DESIGN,
    TuneOptions,
    read_names,
    read_pareto,
    read_weights,
)
from vsf_drake.errors import FitError, InputError
from vsf_drake.files import user_path

Cost = Annotated[str, typer.Option(
    metavar="joint_load|metabolic|push_off|tracking|weighted", help="What is to be least.")]
Weights = Annotated[str | None, typer.Option(
    metavar="COST=NUMBER,...", help="Of the costs in --cost weighted, each over its size at the recorded setting.")]
Level = Annotated[int, typer.Option(
    help="1: the recorded motion is kept. 2: the motion adapts (trajectory optimisation of a stride).")]
Range = Annotated[tuple[float, float] | None, typer.Option(
    metavar="LOW HIGH", help="Fulcrum positions (mm) to choose from; default the carriage's reach.")]
Joints = Annotated[str | None, typer.Option(
    metavar="JOINT,...", help="Level 1: joints whose moments count, of hip_flexion, hip_adduction, hip_rotation, "
    "knee_angle, knee_adduction, knee_rotation.")]
Quick = Annotated[bool, typer.Option("--quick", help="A coarse sweep, one start, no solver asked for confirmation.")]


@app.command()
def tune(
    trials: Annotated[list[Path] | None, typer.Argument(
        metavar="[TRIAL.yaml...]", help="Trial manifests of one person; without any, the embedded synthetic "
        "subject.")] = None,
    cost: Cost = "joint_load",
    out: Annotated[Path, typer.Option(help="Folder for the results; created if needed.")] = Path("tuning"),
    weights: Weights = None,
    level: Level = 1,
    contact: Contact = None,
    design: Annotated[str | None, typer.Option(
        metavar="NAME,...", help=f"What is chosen besides the fulcrum: {', '.join(DESIGN)}.")] = None,
    fulcrum_range: Range = None,
    joints: Joints = None,
    intervals: Annotated[int | None, typer.Option(
        help="Level 2: intervals of the stride.", show_default="40")] = None,
    method: Annotated[str | None, typer.Option(
        metavar="hermite_simpson|trapezoidal", help="Level 2: of the collocation.",
        show_default="hermite_simpson")] = None,
    pareto: Annotated[str | None, typer.Option(metavar="A,B", help="Two costs whose trade-off is told.")] = None,
    warm_start: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Folder, or tuning.json in it, of an earlier tuning to begin from as well.")] = None,
    seed: Annotated[int, typer.Option(help="Of all that is random.", min=0)] = 0,
    workers: Annotated[int | None, typer.Option(help="Threads for the walks; default one a core.", min=1)] = None,
    quick: Quick = False,
) -> None:
    """Finds the setting of the foot with the least cost for a person and their motion, and what that is worth.

    The cost over the whole range of the fulcrum comes with it, and how it compares with the uncertainty. A tuning that
    did not end at an optimum ends with exit code 4: its results are written, and marked as not optimal. So are those of
    a tuning that Ctrl-C ended.
    """
    options = TuneOptions(
        cost=cost, weights=read_weights(weights), level=level, design=read_names(design, "--design", DESIGN) or (),
        fulcrum_range_mm=fulcrum_range, intervals=intervals, method=method, pareto=read_pareto(pareto),
        joints=read_names(joints, "--joints"), seed=seed, workers=workers, quick=quick)
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.analysis.tuning.inputs import load_tuning_trials
    from vsf_drake.cli.tune_run import tune_trials, was_interrupted
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.report.tuning.output import TUNING

    out, contact, warm_start = user_path(out), file_of(contact), file_of(warm_start)
    TUNING.check(out)
    warm = None if warm_start is None else read_warm_start(warm_start)
    with progress() as show:
        try:
            given = load_tuning_trials([user_path(path) for path in trials or ()], contact=contact, level=level,
                                       quick=quick, progress=show)
            table, arrays = tune_trials(given, options, show=show, warm=warm)
        except KeyboardInterrupt:
            errors.print("interrupted before anything was found; nothing was written", highlight=False)
            sys.exit(INTERRUPTED)
        show("writing the report", 0.99)
        written = TUNING.write(out, table, arrays)
    if was_interrupted(written):
        errors.print(f"interrupted; what was found by then is in {out}, marked as NOT OPTIMAL", highlight=False,
                     soft_wrap=True, markup=False)
        raise SystemExit(INTERRUPTED) from KeyboardInterrupt()
    if not written["optimal"]:
        raise FitError(f"NOT OPTIMAL: {written['status'].removesuffix('.')}. What was found is in {out}, marked so; "
                       f"see {out / PAGE}")
    print_tuning(written)
    console.print(f"written to {out}; open {PAGE} first", highlight=False, markup=False, soft_wrap=True)


def read_warm_start(path: Path) -> Any:
    """An earlier tuning, by its folder or a file in it.

    Raises:
        InputError: there is none, or it cannot be read.
    """
    from vsf_drake.cli.tune_run import WarmStart
    from vsf_drake.report.tuning.output import TUNING

    folder = path if path.is_dir() else path.parent
    if not path.is_dir() and path.name not in (TUNING.table, TUNING.arrays):
        raise InputError("is no tuning" if path.exists() else "there is no such file", file=path, where="--warm-start",
                         right=f"Name the folder of an earlier tuning, or {TUNING.table} in it")
    table, arrays = TUNING.read(folder)
    return WarmStart(file=path, table=table, arrays=arrays)


# A tuning, and a schedule, on the screen.


def print_tuning(table: Mapping[str, Any]) -> None:
    """The answer in words, the outcomes, what is not met and what one should know."""
    from vsf_drake.report.tuning.chapters import answer, first_line

    say(first_line(table))
    for sentence in answer(table):
        say(f"- {sentence}")
    if table["outcomes"]:
        grid = Table("outcome", "unit", "softest", "optimum", "stiffest", "matters", box=None, pad_edge=False)
        for row in table["outcomes"]:
            numbers = ("–" if row[key] is None else f"{row[key]:.4g}" for key in ("softest", "optimum", "stiffest"))
            grid.add_row(*map(Text, (row["label"], row["unit"], *numbers,
                                     {True: "yes", False: "NO", None: "–"}[row["matters"]])))
        console.print(grid)
    for check in table["checks"]:
        if check["met"] is False:
            warn(f"not met: {check['label']}. {check['sentence']}")
    for note in table["notes"]:
        say(f"  {note}")


def say(line: str) -> None:
    """A line as it is."""
    console.print(line, highlight=False, markup=False, soft_wrap=True)


def warn(line: str) -> None:
    """A line that stands out."""
    console.print(f"! {line}", style="bold yellow", highlight=False, markup=False, soft_wrap=True)


