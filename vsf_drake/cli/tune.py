"""`vsf-drake tune`: the setting of the foot that costs a person least."""

from __future__ import annotations

import dataclasses
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsf_drake.base.errors import FitError, InputError, require
from vsf_drake.base.progress import Progress
from vsf_drake.cli.app import Contact, Out, app, interrupted, path, print_text, progress, say
from vsf_drake.cli.options import Asked, fields_of, flags, from_fields, named_as_options
from vsf_drake.cli.recordings import AcceptUnusable, judged
from vsf_drake.simulation.options import LawOptions
from vsf_drake.tuning.common import (
    COSTS,
    DESIGN,
    FREE_COSTS,
    WEIGHTED,
    FreeMotionOptions,
    GivenMotionOptions,
    check_name,
)

if TYPE_CHECKING:
    import numpy as np

    from vsf_drake.optimal_control.stride import StrideOptions
    from vsf_drake.tuning.inputs import TuningTrials
    from vsf_drake.tuning.options import TuningOptions
    from vsf_drake.tuning.table import TuningTable

    Options = TuningOptions | StrideOptions
    Arrays = dict[str, np.ndarray]

_OPTIONS = fields_of(GivenMotionOptions, FreeMotionOptions)
_ONLY = {
    **dict.fromkeys(("intervals", "method", "speed_m_per_s"), (2, ", where the motion is free")),
    "joints": (1, "; level 2 has all joints of the sagittal plane"),
    "pareto": (1, ""),
}
"""The level that has an option, where the other has not, and why."""
LEVEL_2 = {"alignment": "alignment_rad"}
"""What level 2 calls variables of the design, where that is another name."""
_IN_RESULTS = {"bounds_mm": "fulcrum_range_mm", "speed_m_per_s": "speed"}
"""What results call options that were given, where that is not the field's name."""


@app.command()
@from_fields
def tune(
    trials: Annotated[
        list[Path] | None,
        typer.Argument(
            parser=path,
            metavar="[TRIAL.yaml...]",
            help="Trial manifests of one person; without any, the embedded synthetic subject.",
        ),
    ] = None,
    cost: Annotated[
        str,
        typer.Option(
            metavar=f"{'|'.join(FREE_COSTS)}|{WEIGHTED}",
            help="The cost to be minimised; activation only at level 2.",
        ),
    ] = "joint_load",
    out: Out = Path("tuning"),
    level: Annotated[
        int,
        typer.Option(
            min=1,
            max=2,
            help="1: the recorded motion is kept. 2: the motion adapts "
            "(trajectory optimisation of a stride).",
        ),
    ] = 1,
    contact: Contact = None,
    *,
    asked_law: LawOptions,
    search: Annotated[Asked, GivenMotionOptions, FreeMotionOptions],
    warm_start: Annotated[
        Path | None,
        typer.Option(
            parser=path,
            metavar="FILE",
            help="Folder, or tuning.json in it, of an earlier tuning to begin from as well.",
        ),
    ] = None,
    quick: Annotated[
        bool,
        typer.Option("--quick", help="A coarse sweep, one start, no second solver as a check."),
    ] = False,
    accept_unusable: AcceptUnusable = False,
) -> None:
    """Finds the setting of the foot with the least cost for a person and their motion, and its
    uncertainty.

    It also reports the cost over the whole range of the fulcrum, compared with the uncertainty. A
    tuning that did not end at an optimum ends with exit code 4: its results are written, and marked
    as not optimal. So are those of a tuning that Ctrl-C ended.
    """
    _check(cost, level, search)
    asked = {"cost": cost, "level": level, "quick": quick, "law": asked_law.law}
    asked |= {_IN_RESULTS.get(name, name): value for name, value in search.items()}
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.report.tuning.chapters import TUNING, write_tuning
    from vsf_drake.report.tuning.reading import compared
    from vsf_drake.tuning.inputs import load_tuning_trials
    from vsf_drake.walks.metrics import UNFITTED

    options = _level_options(level, quick, search)
    TUNING.check(out)
    warm = None if warm_start is None else read_warm_start(warm_start)
    with progress() as show, named_as_options(LawOptions):
        try:
            given = load_tuning_trials(
                trials or (),
                contact=contact,
                law=asked_law.law,
                level=level,
                quick=quick,
                progress=show,
                judge=partial(judged, accept=accept_unusable),
            )
            table, arrays = _tuned_trials(
                given, asked, options, show, warm=warm, warm_file=warm_start
            )
        except KeyboardInterrupt:
            interrupted(" before anything was found; nothing was written")
        show("writing the report", 0.99)
        write_tuning(out, table, arrays)
    if not table.optimal and "interrupted" in table.status:
        interrupted(f"; what was found by then is in {out}, marked as NOT OPTIMAL")
    if not table.optimal:
        raise FitError(
            f"NOT OPTIMAL: {table.status.removesuffix('.')}. What was found is in {out}, marked "
            f"so; see {out / PAGE}"
        )
    places = [] if table.cost is None else compared(table, table.cost_at, table.cost)
    print_text("tuning", t=table, places=places, unfitted=UNFITTED)
    say(f"written to {out / PAGE}")


def read_warm_start(file: Path) -> tuple[TuningTable, Arrays]:
    """Table and arrays of an earlier tuning, by its folder or a file in it; InputError if there is
    none."""
    from vsf_drake.report.tuning.chapters import TUNING
    from vsf_drake.tuning.table import tuning_of

    require(
        file.is_dir() or file.name in (TUNING.table, TUNING.arrays),
        "is no tuning" if file.exists() else "there is no such file",
        "--warm-start",
        f"Name the folder of an earlier tuning, or {TUNING.table} in it",
        file=file,
    )
    saved, arrays = TUNING.read(file if file.is_dir() else file.parent)
    try:
        return tuning_of(saved, ("design",)), arrays
    except ValueError as error:
        raise InputError(f"cannot be used ({error})", file=file, where="--warm-start") from None


def _check(cost: str, level: int, search: Asked) -> None:
    """Raises InputError for what does not go together."""
    check_name(cost, (*FREE_COSTS, WEIGHTED), "--cost")
    for name in search.get("design", ()):
        check_name(name, DESIGN, "--design")
    require(
        level > 1 or cost in (*COSTS, WEIGHTED),
        f"{cost} is a cost of level 2, where the motion is free",
        "--cost",
        "Give --level 2 with it, or another cost",
    )
    require(
        "weights" not in search or cost == WEIGHTED,
        f"cannot go with --cost {cost}",
        "--weights",
        f"Give --cost {WEIGHTED}, or leave it out",
    )
    for name, (own, why) in _ONLY.items():
        require(
            name not in search or own == level,
            f"is an option of level {own}{why}",
            flags(_OPTIONS[name])[0],
            f"Leave it out, or give --level {own}",
        )


def _level_options(level: int, quick: bool, search: Asked) -> Options:
    from vsf_drake.optimal_control.stride import StrideOptions
    from vsf_drake.tuning.options import TuningOptions

    short: Asked = {"starts": 1, "confirm": (), "draws": 0}
    with named_as_options(GivenMotionOptions, FreeMotionOptions):
        if level == 1:
            short |= {"sweep_mm": 5.0, "more_starts": 0}
            return TuningOptions(**(short if quick else {}) | search)
        short |= {"intervals": 20, "positions": 5}
        given = (short if quick else {}) | search
        given["design"] = tuple(LEVEL_2.get(name, name) for name in search.get("design", ()))
        given.pop("workers", None)
        return StrideOptions(**given)


def _tuned_trials(
    given: TuningTrials,
    asked: Asked,
    options: Options,
    show: Progress,
    *,
    warm: tuple[TuningTable, Arrays] | None = None,
    warm_file: Path | None = None,
) -> tuple[TuningTable, Arrays]:
    """Table and arrays; an interrupt leaves what there was by then, marked as not optimal, or
    passes before that."""
    from vsf_drake.tuning.table import Provenance

    with named_as_options(
        GivenMotionOptions,
        FreeMotionOptions,
        cost="--cost",
        trials="TRIAL.yaml",
        warm_start=f"{warm_file}: --warm-start",
    ):
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


def _solved(
    given: TuningTrials,
    cost: str,
    options: Options,
    show: Progress,
    warm: tuple[TuningTable, Arrays] | None,
) -> tuple[TuningTable, Arrays]:
    from vsf_drake.optimal_control import solve as level2
    from vsf_drake.optimal_control.saved import stride_arrays, stride_table
    from vsf_drake.optimal_control.search import StrideTuning
    from vsf_drake.tuning import solve as level1
    from vsf_drake.tuning.options import TuningOptions
    from vsf_drake.tuning.problem import StiffnessTuning
    from vsf_drake.tuning.solution import tuning_arrays, tuning_table

    old, old_arrays = warm or (None, None)
    if isinstance(options, TuningOptions):
        begin = None if old is None else {row.name: row.value for row in old.design}
        if begin is not None and old is not None and old.fulcrum_mm is not None:
            begin["fulcrum"] = old.fulcrum_mm
        tuning = StiffnessTuning(given.trials, cost=cost, labels=given.labels, options=options)
        solution = level1.solve(tuning, progress=show, warm_start=begin)
        return tuning_table(solution), tuning_arrays(solution)
    free = StrideTuning(given.trials, cost=cost, labels=given.labels, options=options)
    stride = level2.solve(free, progress=show, warm_start=old_arrays)
    return stride_table(stride), stride_arrays(stride)
