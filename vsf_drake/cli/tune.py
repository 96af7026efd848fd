"""`vsf-drake tune` and `schedule`: the setting of the foot that costs a person least, for all or each of the tasks."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from vsf_drake.cli.app import Contact, Seed, app, console, interrupted, path, progress, say, warn
from vsf_drake.errors import FitError, InputError

SINGLE = ("joint_load", "metabolic", "push_off", "tracking")
WEIGHTED = "weighted"
DESIGN = ("heel_stiffness", "alignment", "keel_thickness")
METHODS = ("hermite_simpson", "trapezoidal")

Cost = Annotated[str, typer.Option(metavar=f"{'|'.join(SINGLE)}|{WEIGHTED}", help="What is to be least.")]
Out = Annotated[Path, typer.Option(parser=path, help="Folder for the results; created if needed.")]
Weights = Annotated[str | None, typer.Option(
    metavar="COST=NUMBER,...", help="Of the costs in --cost weighted, each over its size at the recorded setting.")]
Level = Annotated[int, typer.Option(
    help="1: the recorded motion is kept. 2: the motion adapts (trajectory optimisation of a stride).")]
Range = Annotated[tuple[float, float] | None, typer.Option(
    metavar="LOW HIGH", help="Fulcrum positions (mm) to choose from; default the carriage's reach.")]
Joints = Annotated[str | None, typer.Option(
    metavar="JOINT,...", help="Level 1: joints whose moments count, of hip_flexion, hip_adduction, hip_rotation, "
    "knee_angle, knee_adduction, knee_rotation.")]
Workers = Annotated[int | None, typer.Option(help="Threads for the walks; default one a core.", min=1)]
Quick = Annotated[bool, typer.Option("--quick", help="A coarse sweep, one start, no solver asked for confirmation.")]


@app.command()
def tune(
    trials: Annotated[list[Path] | None, typer.Argument(
        parser=path, metavar="[TRIAL.yaml...]", help="Trial manifests of one person; without any, the embedded "
        "synthetic subject.")] = None,
    cost: Cost = "joint_load",
    out: Out = Path("tuning"),
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
        parser=path, metavar="FILE", help="Folder, or tuning.json in it, of an earlier tuning to begin from as well.",
    )] = None,
    seed: Seed = 0,
    workers: Workers = None,
    quick: Quick = False,
) -> None:
    """Finds the setting of the foot with the least cost for a person and their motion, and what that is worth.

    The cost over the whole range of the fulcrum comes with it, and how it compares with the uncertainty. A tuning that
    did not end at an optimum ends with exit code 4: its results are written, and marked as not optimal. So are those of
    a tuning that Ctrl-C ended.
    """
    two = _names(pareto, "--pareto", SINGLE)
    if two is not None and len(two) != 2:
        raise InputError(f"names {len(two)} cost{'s' * (len(two) != 1)}", where="--pareto",
                         right="Give two, separated by a comma")
    options = TuneOptions(
        cost=cost, weights=_weights(weights), level=level, design=_names(design, "--design", DESIGN) or (),
        fulcrum_range_mm=fulcrum_range, intervals=intervals, method=method, pareto=two,
        joints=_names(joints, "--joints"), seed=seed, workers=workers, quick=quick)
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.analysis.tuning.inputs import load_tuning_trials
    from vsf_drake.cli.tune_run import tune_trials, was_interrupted
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.report.tuning.chapters import TUNING

    TUNING.check(out)
    warm = None if warm_start is None else read_warm_start(warm_start)
    with progress() as show:
        try:
            given = load_tuning_trials(trials or (), contact=contact, level=level, quick=quick, progress=show)
            table, arrays = tune_trials(given, options, show=show, warm=warm)
        except KeyboardInterrupt:
            interrupted(" before anything was found; nothing was written")
        show("writing the report", 0.99)
        written = TUNING.write(out, table, arrays)
    if was_interrupted(written):
        interrupted(f"; what was found by then is in {out}, marked as NOT OPTIMAL")
    if not written["optimal"]:
        raise FitError(f"NOT OPTIMAL: {written['status'].removesuffix('.')}. What was found is in {out}, marked so; "
                       f"see {out / PAGE}")
    _print_tuning(written)
    say(f"written to {out}; open {PAGE} first")


def read_warm_start(file: Path) -> Any:
    """An earlier tuning, by its folder or a file in it.

    Raises:
        InputError: there is none, or it cannot be read.
    """
    from vsf_drake.cli.tune_run import WarmStart
    from vsf_drake.report.tuning.chapters import TUNING

    if not file.is_dir() and file.name not in (TUNING.table, TUNING.arrays):
        raise InputError("is no tuning" if file.exists() else "there is no such file", file=file, where="--warm-start",
                         right=f"Name the folder of an earlier tuning, or {TUNING.table} in it")
    table, arrays = TUNING.read(file if file.is_dir() else file.parent)
    return WarmStart(file=file, table=table, arrays=arrays)


def _print_tuning(table: dict[str, Any]) -> None:
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


@app.command()
def schedule(
    tasks: Annotated[list[str], typer.Argument(
        metavar="TASKS...", help="LABEL=TRIAL.yaml, repeated; or a task file (YAML) with label, trials, speed_m_per_s, "
        "slope_deg and carried_kg of each.")],
    cost: Cost = "joint_load",
    out: Out = Path("schedule"),
    weights: Weights = None,
    level: Level = 1,
    contact: Contact = None,
    fulcrum_range: Range = None,
    joints: Joints = None,
    resolution_mm: Annotated[float | None, typer.Option(
        help="Steps in which the carriage stops, from the lower end of its range; default none.")] = None,
    seed: Seed = 0,
    workers: Workers = None,
    quick: Quick = False,
) -> None:
    """Tunes the fulcrum to every task by itself: a table to store, and what it buys over one setting for all.

    A task whose tuning did not end at an optimum makes the whole table one that may not be stored: it is written,
    marked so, and the exit code is 4.
    """
    options = TuneOptions(cost=cost, weights=_weights(weights), level=level, fulcrum_range_mm=fulcrum_range,
                          joints=_names(joints, "--joints"), seed=seed, workers=workers, quick=quick)
    from vsf_drake.analysis.tuning.schedule import read_tasks

    listed = read_tasks(tasks)
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.cli.tune_run import check_resolution, tune_tasks
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.report.tuning.chapters import SCHEDULE, schedule_words, write_schedule

    SCHEDULE.check(out)
    with progress() as show:
        try:
            given = check_resolution(listed, contact, options, resolution_mm, show)
            table, stopped = tune_tasks(listed, given, options, resolution_mm=resolution_mm, show=show)
        except KeyboardInterrupt:
            interrupted(" before any task had a result; nothing was written")
        show("writing the report", 0.99)
        written = write_schedule(out, table)
    if stopped:
        interrupted(f"; what was found by then is in {out}, marked as NOT OPTIMAL")
    if not written["optimal"]:
        bad = "; ".join(f"{row['label']}: {row['status']}" for row in written["tasks"] if not row["optimal"])
        raise FitError(f"NOT OPTIMAL: {bad}. What was found is in {out}, marked so; see {out / PAGE}")
    for sentence in schedule_words(written):
        say(f"- {sentence}")
    for note in written["notes"]:
        warn(note)
    say(f"written to {out}; {SCHEDULE.table} is for the controller, open {PAGE} first")


# Options, their words read and checked before anything else is done.


@dataclass(frozen=True, kw_only=True)
class TuneOptions:
    """What was asked for; None where the analysis decides."""

    cost: str
    weights: dict[str, float] | None = None
    level: int = 1
    design: tuple[str, ...] = ()
    fulcrum_range_mm: tuple[float, float] | None = None
    intervals: int | None = None
    method: str | None = None
    pareto: tuple[str, ...] | None = None
    joints: tuple[str, ...] | None = None
    seed: int = 0
    workers: int | None = None
    quick: bool = False

    def __post_init__(self) -> None:
        """Raises InputError for what is not there, or cannot go together."""
        if self.cost not in (*SINGLE, WEIGHTED):
            raise _unknown("--cost", self.cost, (*SINGLE, WEIGHTED))
        if self.level not in (1, 2):
            raise InputError(f"{self.level} is no level", where="--level",
                             right="1: the motion is given. 2: the motion adapts")
        if self.weights is not None and self.cost != WEIGHTED:
            raise InputError(f"cannot go with --cost {self.cost}", where="--weights",
                             right=f"Give --cost {WEIGHTED}, or leave it out")
        for option, given in (("--intervals", self.intervals), ("--method", self.method)):
            if given is not None and self.level == 1:
                raise InputError("is an option of level 2, where the motion is free", where=option,
                                 right="Leave it out, or give --level 2")
        if self.joints is not None and self.level == 2:
            raise InputError("is an option of level 1; level 2 has all joints of the sagittal plane", where="--joints",
                             right="Leave it out, or give --level 1")
        if self.intervals is not None and self.intervals < 1:
            raise InputError(f"{self.intervals} intervals are none", where="--intervals")
        if self.method is not None and self.method not in METHODS:
            raise _unknown("--method", self.method, METHODS)
        if self.fulcrum_range_mm is not None:
            low, high = self.fulcrum_range_mm
            if not (math.isfinite(low) and math.isfinite(high) and low < high):
                raise InputError(f"{low:g} to {high:g} mm is no range", where="--fulcrum-range",
                                 right="Give the lower end first: 66 151")

    def told(self) -> dict[str, object]:
        """For the results."""
        return {name: value for name, value in vars(self).items() if value is not None}


def _weights(text: str | None) -> dict[str, float] | None:
    """`joint_load=1,push_off=0.5` as numbers by cost.

    Raises:
        InputError: a cost is unknown or named twice, a weight is no number from 0 on, or all are zero.
    """
    if text is None:
        return None
    found: dict[str, float] = {}
    for part in text.split(","):
        name, equals, number = (piece.strip() for piece in part.partition("="))
        if not equals:
            raise InputError(f"{part.strip()!r} is no weight", where="--weights",
                             right="Write COST=NUMBER, separated by commas: joint_load=1,push_off=0.5")
        if name not in SINGLE:
            raise _unknown("--weights", name, SINGLE)
        if name in found:
            raise InputError(f"{name} has two weights", where="--weights", right="Give every cost one")
        try:
            found[name] = float(number)
        except ValueError:
            raise InputError(f"{number!r} is no number", where=f"--weights {name}") from None
        if not math.isfinite(found[name]) or found[name] < 0.0:
            raise InputError(f"{number} is no weight", where=f"--weights {name}", right="Give a number from 0 on")
    if not any(found.values()):
        raise InputError("are all zero", where="--weights", right="Give one above 0")
    return found


def _names(text: str | None, option: str, known: Sequence[str] | None = None) -> tuple[str, ...] | None:
    """Names separated by commas; of `known`, if given.

    Raises:
        InputError: one is unknown or named twice.
    """
    if text is None:
        return None
    names = tuple(part.strip() for part in text.split(",") if part.strip())
    if not names:
        raise InputError("names nothing", where=option)
    for name in names:
        if known is not None and name not in known:
            raise _unknown(option, name, known)
        if names.count(name) > 1:
            raise InputError(f"names {name} twice", where=option)
    return names


def _unknown(option: str, name: str, known: Sequence[str]) -> InputError:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    right = f"Did you mean {near[0]}?" if near else f"There are: {', '.join(known)}"
    return InputError(f"there is no {name!r}", where=option, right=right)
