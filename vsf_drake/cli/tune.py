"""`vsf-drake tune` and `schedule`: the setting of the foot that costs a person least, for all or each of the tasks."""

from __future__ import annotations

import dataclasses
import re
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vsf_drake.analysis.tuning.common import COSTS, DESIGN, FREE_COSTS, WEIGHTED, check_name
from vsf_drake.cli.app import Contact, Out, Seed, app, interrupted, path, print_text, progress, say
from vsf_drake.errors import FitError, InputError

if TYPE_CHECKING:
    import numpy as np

    from vsf_drake.analysis.tuning import level1, level2
    from vsf_drake.analysis.tuning.inputs import TuningTrials
    from vsf_drake.analysis.tuning.schedule import Schedule, Task
    from vsf_drake.analysis.tuning.table import TuningTable

    Options = level1.TuningOptions | level2.StrideOptions
    Arrays = dict[str, np.ndarray]

Cost = Annotated[
    str,
    typer.Option(
        metavar=f"{'|'.join(FREE_COSTS)}|{WEIGHTED}",
        help="The cost to be minimised; activation only at level 2.",
    ),
]
Weights = Annotated[
    str | None,
    typer.Option(
        metavar="COST=NUMBER,...",
        help="Weights of the costs in --cost weighted, each divided by its value at the recorded setting.",
    ),
]
Level = Annotated[
    int,
    typer.Option(
        min=1,
        max=2,
        help="1: the recorded motion is kept. 2: the motion adapts "
        "(trajectory optimisation of a stride).",
    ),
]
Range = Annotated[
    tuple[float, float] | None,
    typer.Option(
        metavar="LOW HIGH",
        help="Range of fulcrum positions (mm) to choose from. Default: the carriage's reach.",
    ),
]
Joints = Annotated[
    str | None,
    typer.Option(
        metavar="JOINT,...",
        help="Level 1: joints whose moments count, of hip_flexion, hip_adduction, hip_rotation, "
        "knee_angle, knee_adduction, knee_rotation.",
    ),
]
Workers = Annotated[
    int | None, typer.Option(help="Threads for the walks. Default: one per core.", min=1)
]
Quick = Annotated[
    bool, typer.Option("--quick", help="A coarse sweep, one start, no second solver as a check.")
]

Asked = dict[str, Any]  # options as they were given, for the results; those left out are not in it
Show = Callable[[str, float], None]
_ONLY = {
    **dict.fromkeys(("intervals", "method", "speed"), (2, ", where the motion is free")),
    "joints": (1, "; level 2 has all joints of the sagittal plane"),
    "pareto": (1, ""),
}
"""The level that has an option, where the other has not, and why."""
_OPTIONS = {
    name: f"--{name.replace('_', '-')}"
    for name in (
        "cost",
        "weights",
        "design",
        "pareto",
        "intervals",
        "method",
        "joints",
        "warm_start",
        "seed",
        "resolution_mm",
    )
}
_OPTIONS |= {"bounds_mm": "--fulcrum-range", "speed_m_per_s": "--speed", "trials": "TRIAL.yaml"}
"""By what the analysis calls them."""
_READ = 0.1  # share of the bar at which a schedule's trials are read


@app.command()
def tune(
    trials: Annotated[
        list[Path] | None,
        typer.Argument(
            parser=path,
            metavar="[TRIAL.yaml...]",
            help="Trial manifests of one person; without any, the embedded synthetic subject.",
        ),
    ] = None,
    cost: Cost = "joint_load",
    out: Out = Path("tuning"),
    weights: Weights = None,
    level: Level = 1,
    contact: Contact = None,
    design: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help=f"Variables that are chosen besides the fulcrum: {', '.join(DESIGN)}.",
        ),
    ] = None,
    fulcrum_range: Range = None,
    joints: Joints = None,
    intervals: Annotated[
        int | None, typer.Option(help="Level 2: intervals of the stride.", show_default="40")
    ] = None,
    method: Annotated[
        str | None,
        typer.Option(
            metavar="hermite_simpson|trapezoidal",
            help="Level 2: method of collocation.",
            show_default="hermite_simpson",
        ),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            metavar="M/S", help="Level 2: the speed to walk at.", show_default="the recorded one"
        ),
    ] = None,
    pareto: Annotated[
        str | None, typer.Option(metavar="A,B", help="Two costs whose trade-off is reported.")
    ] = None,
    warm_start: Annotated[
        Path | None,
        typer.Option(
            parser=path,
            metavar="FILE",
            help="Folder, or tuning.json in it, of an earlier tuning to begin from as well.",
        ),
    ] = None,
    seed: Seed = 0,
    workers: Workers = None,
    quick: Quick = False,
) -> None:
    """Finds the setting of the foot with the least cost for a person and their motion, and its uncertainty.

    It also reports the cost over the whole range of the fulcrum, compared with the uncertainty. A tuning that
    did not end at an optimum ends with exit code 4: its results are written, and marked as not optimal. So are those of
    a tuning that Ctrl-C ended.
    """
    asked = _asked(
        cost,
        weights,
        level,
        design=_names(design, "--design", DESIGN) or (),
        pareto=_names(pareto, "--pareto", COSTS),
        joints=_names(joints, "--joints"),
        fulcrum_range_mm=fulcrum_range,
        intervals=intervals,
        method=method,
        speed=speed,
        seed=seed,
        workers=workers,
        quick=quick,
    )
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.analysis.metrics import UNFITTED
    from vsf_drake.analysis.tuning.inputs import load_tuning_trials
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.report.tuning.chapters import TUNING, write_tuning
    from vsf_drake.report.tuning.reading import compared

    options = _level_options(asked)
    TUNING.check(out)
    warm = None if warm_start is None else read_warm_start(warm_start)
    with progress() as show:
        try:
            given = load_tuning_trials(
                trials or (), contact=contact, level=level, quick=quick, progress=show
            )
            table, arrays = _tuned_trials(
                given, asked, options, show, warm=warm, warm_file=warm_start
            )
        except KeyboardInterrupt:
            interrupted(" before anything was found; nothing was written")
        show("writing the report", 0.99)
        write_tuning(out, table, arrays)
    _check_ended(table, table.status.removesuffix("."), out / PAGE, stopped=_was_interrupted(table))
    places = [] if table.cost is None else compared(table, table.cost_at, table.cost)
    print_text("tuning", t=table, places=places, unfitted=UNFITTED)
    say(f"written to {out / PAGE}")


@app.command()
def schedule(
    tasks: Annotated[
        list[str],
        typer.Argument(
            metavar="TASKS...",
            help="LABEL=TRIAL.yaml, repeated; or a task file (YAML) with label, trials, speed_m_per_s, "
            "slope_deg and carried_kg of each.",
        ),
    ],
    cost: Cost = "joint_load",
    out: Out = Path("schedule"),
    weights: Weights = None,
    level: Level = 1,
    contact: Contact = None,
    fulcrum_range: Range = None,
    joints: Joints = None,
    resolution_mm: Annotated[
        float | None,
        typer.Option(
            help="Steps in which the carriage stops, from the lower end of its range; default none."
        ),
    ] = None,
    seed: Seed = 0,
    workers: Workers = None,
    quick: Quick = False,
) -> None:
    """Tunes the fulcrum to each task separately: a table to store, and how much it saves over one setting for all.

    A task whose tuning did not end at an optimum makes the whole table one that may not be stored: it is written,
    marked so, and the exit code is 4.
    """
    asked = _asked(
        cost,
        weights,
        level,
        design=(),
        fulcrum_range_mm=fulcrum_range,
        joints=_names(joints, "--joints"),
        seed=seed,
        workers=workers,
        quick=quick,
    )
    from vsf_drake.analysis.tuning.schedule import read_tasks

    listed = read_tasks(tasks)
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.report.tuning.chapters import SCHEDULE, bought, write_schedule

    options = _level_options(asked)
    SCHEDULE.check(out)
    with progress() as show:
        try:
            given, reach_mm = _tasks_trials(listed, contact, asked, resolution_mm, show)
            policy, stopped = _tuned_tasks(
                listed, given, asked, options, reach_mm, resolution_mm, show
            )
        except KeyboardInterrupt:
            interrupted(" before any task had a result; nothing was written")
        show("writing the report", 0.99)
        write_schedule(out, policy)
    bad = "; ".join(f"{row.label}: {row.status}" for row in policy.tasks if not row.optimal)
    _check_ended(policy, bad, out / PAGE, stopped=stopped)
    print_text("schedule", t=policy, buys=bought(policy))
    say(f"written to {out / PAGE}; {SCHEDULE.table} beside it is for the controller")


def _check_ended(result: TuningTable | Schedule, why: str, page: Path, *, stopped: bool) -> None:
    if stopped:
        interrupted(f"; what was found by then is in {page.parent}, marked as NOT OPTIMAL")
    if not result.optimal:
        raise FitError(
            f"NOT OPTIMAL: {why}. What was found is in {page.parent}, marked so; see {page}"
        )


def read_warm_start(file: Path) -> tuple[TuningTable, Arrays]:
    """Table and arrays of an earlier tuning, by its folder or a file in it; InputError if there is none."""
    from vsf_drake.analysis.tuning.table import tuning_of
    from vsf_drake.report.tuning.chapters import TUNING

    if not file.is_dir() and file.name not in (TUNING.table, TUNING.arrays):
        raise InputError(
            "is no tuning" if file.exists() else "there is no such file",
            file=file,
            where="--warm-start",
            right=f"Name the folder of an earlier tuning, or {TUNING.table} in it",
        )
    saved, arrays = TUNING.read(file if file.is_dir() else file.parent)
    try:
        return tuning_of(saved, ("design",)), arrays
    except ValueError as error:
        raise InputError(f"cannot be used ({error})", file=file, where="--warm-start") from None


def _asked(cost: str, weights: str | None, level: int, **others: Any) -> Asked:
    check_name(cost, (*FREE_COSTS, WEIGHTED), "--cost")
    if level == 1 and cost in FREE_COSTS and cost not in COSTS:
        raise InputError(
            f"{cost} is a cost of level 2, where the motion is free",
            where="--cost",
            right="Give --level 2 with it, or another cost",
        )
    if weights is not None and cost != WEIGHTED:
        raise InputError(
            f"cannot go with --cost {cost}",
            where="--weights",
            right=f"Give --cost {WEIGHTED}, or leave it out",
        )
    for name, (own, why) in _ONLY.items():
        if others.get(name) is not None and own != level:
            raise InputError(
                f"is an option of level {own}{why}",
                where=f"--{name}",
                right=f"Leave it out, or give --level {own}",
            )
    asked = {
        "cost": cost,
        "weights": None if weights is None else _weights(weights),
        "level": level,
    } | others
    return {name: value for name, value in asked.items() if value is not None}


def _weights(text: str) -> dict[str, float]:
    """`joint_load=1,push_off=0.5` as numbers by cost."""
    weights: dict[str, float] = {}
    for part in text.split(","):
        name, equals, number = (piece.strip() for piece in part.partition("="))
        if not equals:
            raise InputError(
                f"{part.strip()!r} is no weight",
                where="--weights",
                right="Write COST=NUMBER, separated by commas: joint_load=1,push_off=0.5",
            )
        if name in weights:
            raise InputError(
                f"{name} has two weights", where="--weights", right="Give every cost one"
            )
        try:
            weights[name] = float(number)
        except ValueError:
            raise InputError(f"{number!r} is no number", where=f"--weights {name}") from None
    return weights


def _names(text: str | None, option: str, known: Sequence[str] = ()) -> tuple[str, ...] | None:
    """Names separated by commas, those known by the command line checked."""
    if text is None:
        return None
    names = tuple(part.strip() for part in text.split(",") if part.strip())
    if not names:
        raise InputError("names nothing", where=option)
    return tuple(check_name(name, known, option) for name in names) if known else names


@contextmanager
def _named_as_options(warm_file: Path | None = None) -> Iterator[None]:
    """Mistakes that the analysis finds are named as the command line names them."""
    try:
        yield
    except InputError as error:
        name, _, part = re.sub(r"\[.*", "", str(error.where or "")).partition(".")
        if error.file is not None or name not in _OPTIONS:
            raise
        raise InputError(
            error.what,
            file=warm_file if name == "warm_start" else None,
            where=f"{_OPTIONS[name]} {part}".rstrip(),
            right=error.right,
        ) from None


def _level_options(asked: Asked) -> Options:
    from vsf_drake.analysis.tuning import level1, level2

    analysis = {"fulcrum_range_mm": "bounds_mm", "speed": "speed_m_per_s"}
    given = {
        analysis.get(name, name): value
        for name, value in asked.items()
        if name not in ("cost", "level", "quick")
    }
    with _named_as_options():
        if asked["level"] == 1:
            quick: Asked = {
                "sweep_mm": 5.0,
                "draws": 0,
                "confirm": (),
                "starts": 1,
                "more_starts": 0,
            }
            return level1.TuningOptions(**(quick if asked["quick"] else {}) | given)
        given["design"] = tuple(
            "alignment_rad" if name == "alignment" else name for name in given["design"]
        )
        given.pop("workers", None)
        quick = {"intervals": 20, "positions": 5, "starts": 1, "confirm": (), "draws": 0}
        return level2.StrideOptions(**(quick if asked["quick"] else {}) | given)


def _tuned_trials(
    given: TuningTrials,
    asked: Asked,
    options: Options,
    show: Show,
    *,
    warm: tuple[TuningTable, Arrays] | None = None,
    warm_file: Path | None = None,
) -> tuple[TuningTable, Arrays]:
    """Table and arrays; an interrupt leaves what there was by then, marked as not optimal, or passes before that."""
    from vsf_drake.analysis.tuning.table import Provenance

    with _named_as_options(warm_file):
        table, arrays = _solved(given, asked["cost"], options, show, warm)
    made = table.provenance or Provenance()
    made = dataclasses.replace(
        made,
        options={**asked, **made.options},
        inputs_sha256={**given.inputs, **made.inputs_sha256},
    )
    return dataclasses.replace(
        table,
        trials=given.labels,
        recorded_mm=tuple(given.recorded_mm),
        provenance=made,
        notes=(*given.notes, *table.notes),
    ), arrays


def _was_interrupted(table: TuningTable) -> bool:
    return not table.optimal and "interrupted" in table.status


def _solved(
    given: TuningTrials,
    cost: str,
    options: Options,
    show: Show,
    warm: tuple[TuningTable, Arrays] | None,
) -> tuple[TuningTable, Arrays]:
    from vsf_drake.analysis.tuning import level1, level2

    if isinstance(options, level1.TuningOptions):
        begin = None if warm is None else {row.name: row.value for row in warm[0].design}
        if begin is not None and warm is not None and warm[0].fulcrum_mm is not None:
            begin["fulcrum"] = warm[0].fulcrum_mm
        tuning = level1.StiffnessTuning(
            given.trials, cost=cost, labels=given.labels, options=options
        )
        solution = level1.solve(tuning, progress=show, warm_start=begin)
        return level1.tuning_table(solution), level1.tuning_arrays(solution)
    free = level2.StrideTuning(given.trials, cost=cost, labels=given.labels, options=options)
    stride = level2.solve(free, progress=show, warm_start=None if warm is None else warm[1])
    return level2.stride_table(stride), level2.stride_arrays(stride)


def _tasks_trials(
    tasks: Sequence[Task],
    contact: Path | None,
    asked: Asked,
    resolution_mm: float | None,
    show: Show,
) -> tuple[list[TuningTrials], tuple[float, float]]:
    """The trials of every task, and the positions that all their carriages can take."""
    from vsf_drake.analysis.tuning.inputs import check_one_person, load_tuning_trials
    from vsf_drake.analysis.tuning.schedule import check_steps

    def loaded(i: int, task: Task) -> TuningTrials:
        return load_tuning_trials(
            task.manifests,
            contact=contact,
            level=asked["level"],
            progress=lambda what, share: show(what, _READ * (i + share) / len(tasks)),
        )

    given = [loaded(i, task) for i, task in enumerate(tasks)]
    check_one_person([trial for one in given for trial in one.trials])
    low, high = max(one.reach_mm[0] for one in given), min(one.reach_mm[1] for one in given)
    reach = asked.get("fulcrum_range_mm", (low, high))
    if reach[0] < low - 1e-6 or reach[1] > high + 1e-6:
        raise InputError(
            f"{reach[0]:g} to {reach[1]:g} mm is out of the carriage's reach",
            where="--fulcrum-range",
            right=f"It must lie within {low:g} to {high:g} mm",
        )
    with _named_as_options():
        check_steps(reach, resolution_mm)
    return given, reach


def _tuned_tasks(
    tasks: Sequence[Task],
    given: Sequence[TuningTrials],
    asked: Asked,
    options: Options,
    reach_mm: tuple[float, float],
    resolution_mm: float | None,
    show: Show,
) -> tuple[Schedule, bool]:
    """The policy, and whether Ctrl-C ended it early; before any result KeyboardInterrupt passes."""
    from vsf_drake.analysis.tuning.schedule import make_schedule
    from vsf_drake.analysis.tuning.table import Provenance
    from vsf_drake.simulation.archive import provenance

    began, stopped = time.perf_counter(), False
    tables: list[TuningTable] = []
    for i, (task, trials) in enumerate(zip(tasks, given, strict=True)):

        def report(what: str, share: float, label: str = task.label, i: int = i) -> None:
            show(f"{label}: {what}", _READ + (1.0 - _READ) * (i + share) / len(tasks))

        try:
            tables.append(_tuned_trials(trials, asked, options, report)[0])
        except KeyboardInterrupt:
            if not tables:
                raise
            stopped = True
        if stopped := stopped or _was_interrupted(tables[-1]):
            break
    tables += [
        dataclasses.replace(
            tables[0],
            optimal=False,
            status="it was not reached: interrupted",
            fulcrum_mm=None,
            cost=None,
            sweep=(),
            outcomes=(),
            fulcrum_interval_mm=None,
            trials=trials.labels,
            recorded_mm=tuple(trials.recorded_mm),
            synthetic=trials.synthetic,
        )
        for trials in given[len(tables) :]
    ]
    made = provenance(
        {name: digest for trials in given for name, digest in trials.inputs.items()}, asked["seed"]
    )
    policy = make_schedule(
        zip(tasks, tables, strict=True), reach_mm=reach_mm, resolution_mm=resolution_mm
    )
    return dataclasses.replace(
        policy,
        notes=tuple(dict.fromkeys(note for trials in given for note in trials.notes)),
        wall_s=time.perf_counter() - began,
        provenance=Provenance(**made, options={**asked, "resolution_mm": resolution_mm}),
    ), stopped
