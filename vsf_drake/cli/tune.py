"""`vsf-drake tune`: the fulcrum position, and what else of the foot, with the least cost for this person."""

from __future__ import annotations

import difflib
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from vsf_drake.cli.app import INTERRUPTED, Contact, app, console, errors, file_of, progress
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
    from vsf_drake.report.tuning.output import PAGE, check_tuning_folder, write_tuning

    out, contact, warm_start = user_path(out), file_of(contact), file_of(warm_start)
    check_tuning_folder(out)
    warm = None if warm_start is None else read_warm_start(warm_start)
    try:
        with progress() as show:
            given = load_tuning_trials([user_path(path) for path in trials or ()], contact=contact, level=level,
                                       quick=quick, progress=show)
            table, arrays = tune_trials(given, options, show=show, warm=warm)
            show("writing the report", 0.99)
            written = write_tuning(out, table, arrays)
    except KeyboardInterrupt:
        errors.print("interrupted before anything was found; nothing was written", highlight=False)
        sys.exit(INTERRUPTED)
    if was_interrupted(written):
        errors.print(f"interrupted; what was found by then is in {out}, marked as NOT OPTIMAL", highlight=False,
                     soft_wrap=True, markup=False)
        sys.exit(INTERRUPTED)
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
    from vsf_drake.report.tuning.output import ARRAYS, TABLE, read_tuning

    folder = path if path.is_dir() else path.parent
    if not path.is_dir() and path.name not in (TABLE, ARRAYS):
        raise InputError("is no tuning" if path.exists() else "there is no such file", file=path, where="--warm-start",
                         right=f"Name the folder of an earlier tuning, or {TABLE} in it")
    table, arrays = read_tuning(folder)
    return WarmStart(file=path, table=table, arrays=arrays)


# A tuning, and a schedule, on the screen.


def print_tuning(table: Mapping[str, Any]) -> None:
    """The answer in words, the outcomes, what is not met and what one should know."""
    from vsf_drake.report.tuning.words import answer, first_line

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


# Options of `vsf-drake tune` and `schedule`: their words read and checked before anything else is done.


SINGLE = ("joint_load", "metabolic", "push_off", "tracking")
WEIGHTED = "weighted"
DESIGN = ("heel_stiffness", "alignment", "keel_thickness")
METHODS = ("hermite_simpson", "trapezoidal")
MOTION_GIVEN, MOTION_FREE = 1, 2
OPTION_OF = {"cost": "--cost", "weights": "--weights", "design": "--design", "bounds_mm": "--fulcrum-range",
             "pareto": "--pareto", "intervals": "--intervals", "method": "--method", "joints": "--joints",
             "warm_start": "--warm-start", "seed": "--seed", "trials": "TRIAL.yaml"}
"""By what the analysis calls it."""


@dataclass(frozen=True, kw_only=True)
class TuneOptions:
    """What was asked for; None where the analysis decides."""

    cost: str
    weights: dict[str, float] | None = None
    level: int = MOTION_GIVEN
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
        if self.level not in (MOTION_GIVEN, MOTION_FREE):
            raise InputError(f"{self.level} is no level", where="--level",
                             right="1: the motion is given. 2: the motion adapts")
        if self.weights is not None and self.cost != WEIGHTED:
            raise InputError(f"cannot go with --cost {self.cost}", where="--weights",
                             right=f"Give --cost {WEIGHTED}, or leave it out")
        for option, given in (("--intervals", self.intervals), ("--method", self.method)):
            if given is not None and self.level == MOTION_GIVEN:
                raise InputError("is an option of level 2, where the motion is free", where=option,
                                 right="Leave it out, or give --level 2")
        if self.joints is not None and self.level == MOTION_FREE:
            raise InputError("is an option of level 1; level 2 has all joints of the sagittal plane", where="--joints",
                             right="Leave it out, or give --level 1")
        if self.intervals is not None and self.intervals < 1:
            raise InputError(f"{self.intervals} intervals are none", where="--intervals")
        if self.method is not None and self.method not in METHODS:
            raise _unknown("--method", self.method, METHODS)
        if self.fulcrum_range_mm is not None:
            _check_range(*self.fulcrum_range_mm)

    def told(self) -> dict[str, object]:
        """For the results."""
        return {name: value for name, value in vars(self).items() if value is not None}


def read_weights(text: str | None) -> dict[str, float] | None:
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


def read_names(text: str | None, option: str, known: Sequence[str] | None = None) -> tuple[str, ...] | None:
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


def read_pareto(text: str | None) -> tuple[str, ...] | None:
    """Two costs, `A,B`."""
    names = read_names(text, "--pareto", SINGLE)
    if names is not None and len(names) != 2:
        raise InputError(f"names {len(names)} cost{'s' * (len(names) != 1)}", where="--pareto",
                         right="Give two, separated by a comma")
    return names


def as_option(error: InputError, warm_start: Path | None = None) -> InputError:
    """The same mistake, named as the command line names it."""
    where = str(error.where or "").partition("[")[0]
    if error.file is not None or where not in OPTION_OF:
        return error
    file = warm_start if where == "warm_start" else None
    return InputError(error.what, file=file, where=OPTION_OF[where], right=error.right)


def _check_range(low: float, high: float) -> None:
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"{low:g} to {high:g} mm is no range", where="--fulcrum-range",
                         right="Give the lower end first: 66 151")


def _unknown(option: str, name: str, known: Sequence[str]) -> InputError:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    right = f"Did you mean {near[0]}?" if near else f"There are: {', '.join(known)}"
    return InputError(f"there is no {name!r}", where=option, right=right)
