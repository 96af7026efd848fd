"""`vsf-drake sweep`: many walks over trials, fulcrum positions and values of the model's
variables."""

from __future__ import annotations

import dataclasses
import math
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vsf_drake.base.errors import InputError, SimulationError, require
from vsf_drake.base.schema import option, quantity
from vsf_drake.cli.app import (
    Contact,
    OptionalOut,
    Trials,
    Workers,
    app,
    check_contact_use,
    contact_hash,
    fitted_trials,
    interrupted,
    needed,
    print_text,
    progress,
    read_trials,
    say,
    warn,
)
from vsf_drake.cli.options import from_fields, number_of
from vsf_drake.cli.recordings import judged
from vsf_drake.simulation.options import LawOptions, StepOptions

if TYPE_CHECKING:
    from vsf_drake.motion.trial import Trial
    from vsf_drake.simulation.variables import Variable
    from vsf_drake.walks.offsets import OffsetFit
    from vsf_drake.walks.sweep_table import SweepRow, SweepTable

SHIFT = "fulcrum.shift"
# walks that a sweep may have: their numbers are in memory at the end, some kilobytes each
MOST = 100_000
MANY = 2_000  # walks above which a sweep has to be meant


@dataclass(frozen=True, kw_only=True)
class SweepRequest(StepOptions, LawOptions):
    """What is swept, and how."""

    fulcrum_mm: str | None = option(
        None,
        "Fulcrum positions from the keel's posterior end, or a list, 66,87,108 or "
        "12N/mm,16N/mm. Default: each trial's own.",
        metavar="LOW:HIGH:COUNT",
    )
    vary: tuple[str, ...] = option(
        (),
        "Values of a variable, or a list: NAME=A,B,C; may be repeated, for a grid. "
        "With --sample: NAME, or NAME=LOW:HIGH.",
        metavar="NAME=LOW:HIGH:COUNT",
    )
    sample: int | None = quantity(
        None,
        unit="1",
        low=1,
        source="choice",
        help="Instead of a grid: this many sets of values that fill the bounds (Latin hypercube).",
    )
    seed: int = quantity(0, unit="1", low=0, source="choice", help="Seed of the sample.")
    fit_offsets: bool = option(
        False,
        "First fit height, fore-aft position and alignment of the prosthesis, once a trial.",
    )
    parquet: bool = option(False, "Write sweep.parquet, too; needs the extra `tables`.")
    yes: bool = option(False, "Confirm that thousands of walks are intended.")
    list_variables: bool = option(
        False,
        "Only print the variables of the trials: name, unit, value, bounds.",
        flag="--list",
    )


@app.command()
@from_fields
def sweep(
    trials: Trials,
    out: OptionalOut = None,
    contact: Contact = None,
    workers: Workers = None,
    *,
    asked: SweepRequest,
) -> None:
    """Simulates every combination and compares each walk with its force plate.

    Finished walks are kept in the folder's cache: after an interruption the same command continues
    where it stopped, and a larger sweep with the same trials computes only what is new. Values are
    in the units that --list prints. A walk that fails is a row that says why; the exit code is 3
    only if all of them fail.
    """
    if asked.list_variables:
        from vsf_drake.model.setting import moves
        from vsf_drake.simulation.walk import Walker

        for trial in read_trials(trials, contact, law=asked.law):
            own = Walker(trial.subject, trial.model).variables
            if moves(trial.model.foot):
                own = _within_reach(own, [trial], [[]])
            else:
                own = {name: variable for name, variable in own.items() if name != SHIFT}
            print_text("variables", trial=trial, variables=own.values())
        return
    check_contact_use(contact, fit_offsets=asked.fit_offsets)
    from vsf_drake.report.outputs import check_sweep_folder
    from vsf_drake.simulation.batch import WalkCase, grid_values, sample_values, simulate_batch
    from vsf_drake.walks.plate_score import plate_scorer
    from vsf_drake.walks.sweep_table import sweep_table

    out = needed(out)
    sample = asked.sample
    positions = () if asked.fulcrum_mm is None else places_said(asked.fulcrum_mm)
    axes = [axis(text, sampled=sample is not None) for text in asked.vary]
    require(
        axes or (positions and sample is None),
        "there is nothing to vary",
        "sweep",
        "Give --vary, or --fulcrum-mm without --sample; --list prints the names",
    )
    check_count(
        len(trials)
        * max(1, len(positions))
        * (sample or math.prod(len(item.values) for item in axes)),
        meant=asked.yes,
    )
    loaded, variables, places = _loaded(
        trials, contact, axes, positions, sampled=sample is not None, asked=asked
    )
    check_sweep_folder(out, loaded.values(), parquet=asked.parquet)
    places_mm = dict.fromkeys(round(1e3 * place, 9) for own in places.values() for place in own)
    plan: dict[str, object] = {
        "fulcrum_mm": tuple(places_mm) or None,
        "step_ms": asked.step_ms,
        "fit_offsets": asked.fit_offsets,
        "contact": contact_hash(contact),
        "law": asked.law,
        "sample": None,
    }
    if sample is None:
        grid = {item.name: item.values for item in axes}
        plan["vary"], sets = grid, grid_values(grid)
    else:
        bounded = {
            name: dataclasses.replace(variables[name], low=values[0], high=values[1])
            if values
            else variables[name]
            for name, values in axes
        }
        plan["sample"] = {
            "count": sample,
            "seed": asked.seed,
            "bounds": {k: [v.low, v.high] for k, v in bounded.items()},
            "method": "Latin hypercube, of the logarithm where the lower bound is above 0",
        }
        sets = sample_values(bounded, list(bounded), sample, asked.seed)
    fits = _fitted(loaded) if asked.fit_offsets else {}
    offsets = {name: (fits[name] if fits else trial).offsets for name, trial in loaded.items()}
    plan["offsets"] = offsets
    cases = [
        WalkCase(
            trial=trial,
            values=values,
            fulcrum_m=place,
            label="" if name == trial.name else name,
            offsets=offsets[name],
            step_s=1e-3 * asked.step_ms,
        )
        for name, trial in loaded.items()
        for place in places[name] or (None,)
        for values in sets
    ]
    varied = {item.name: variables[item.name] for item in axes}
    try:
        outcomes = simulate_batch(
            cases,
            keep=(),
            score=plate_scorer,
            workers=workers,
            cache=out / "cache",
            progress=True,
        )
        table, rows = sweep_table(
            outcomes, loaded, variables=varied, fulcrum=bool(positions), plan=plan, fits=fits
        )
        _written(table, rows, out, parquet=asked.parquet)
    except KeyboardInterrupt:
        interrupted(
            f"; the finished walks are in {out / 'cache'}: the same command goes on from them"
        )
    print_text("sweep", **vars(table))
    say(f"written to {out / 'sweep.csv'}{', sweep.parquet' * asked.parquet}")
    if table.failed == table.walks:
        sys.exit(SimulationError.exit_code)


def _fitted(trials: Mapping[str, Trial]) -> dict[str, OffsetFit]:
    """The fit of each trial's offsets to its plate; warns of what is doubtful in them."""
    from vsf_drake.walks.offsets import fit_offsets

    fits = {}
    with progress() as show:
        for i, (name, trial) in enumerate(trials.items()):
            show(f"{name}: fitting the offsets", i / len(trials))
            fits[name] = fit_offsets(trial)
    for name, fit in fits.items():
        for doubt in fit.doubts:
            warn(f"{name}: {doubt}")
    return fits


def _written(table: SweepTable, rows: Sequence[SweepRow], out: Path, *, parquet: bool) -> None:
    """Writes the results, or says that nothing of them is there and what is."""
    from vsf_drake.report.outputs import write_sweep

    try:
        write_sweep(table, rows, out, parquet=parquet)
    except InputError as error:
        kept = (
            f"No table was written; the finished walks are in {out / 'cache'}: the same command "
            "goes on from them"
        )
        raise InputError(
            error.what, file=error.file, where=error.where, right=error.right or kept
        ) from None


def _loaded(
    trials: list[Path],
    contact: Path | None,
    axes: list[Axis],
    positions: Sequence[float | str],
    *,
    sampled: bool,
    asked: SweepRequest,
) -> tuple[dict[str, Trial], dict[str, Variable], dict[str, list[float]]]:
    """Trials by a name that is theirs alone, the variables of the first, and the fulcrum positions
    (m) of each; each can take what is asked for. Warns of a foot that was fitted to nobody."""
    from vsf_drake.model.model_file import check_movable
    from vsf_drake.simulation.fulcrum_place import fulcrum_place
    from vsf_drake.simulation.variables import check_names, check_values
    from vsf_drake.simulation.walk import Walker
    from vsf_drake.walks.metrics import unfitted_note

    for i, file in enumerate(trials):
        require(
            file.resolve() not in [other.resolve() for other in trials[:i]],
            "the trial stands twice",
            file=file,
        )
    recorded = read_trials(trials, None)
    loaded = judged(fitted_trials(recorded, contact, law=asked.law))
    for trial in loaded:
        require(
            trial.plate is not None,
            "no force was measured, and a sweep is of errors against the plate",
            "forces",
            "Leave it out; `simulate --fulcrum-mm` walks it at another setting",
            file=trial.path,
        )
    if contact is None:
        warn(unfitted_note(loaded[0], offsets_fitted=asked.fit_offsets))
    names = [trial.name for trial in loaded]
    variables: dict[str, Variable] = {}
    for file, trial in zip(trials, loaded, strict=True):
        own = Walker(trial.subject, trial.model).variables
        try:
            check_names([item.name for item in axes], own, where="--vary")
            for item in axes:
                for value in item.values:
                    check_values({item.name: value}, own)
        except InputError as error:
            where = (error.where or "").removeprefix("values").strip("[]'")
            # dozens of names, which --list has in columns
            listed = (error.right or "").startswith("There are: ")
            raise InputError(
                error.what,
                file=file if len(trials) > 1 else None,
                where="--vary" if where == "--vary" else f"--vary {where}",
                right="--list prints the names" if listed else error.right,
            ) from None
        variables = variables or own
        if any(item.name == SHIFT for item in axes):
            check_movable(trial.model.foot, f"Leave --vary {SHIFT} out", file)
    named = [
        name if names.count(name) == 1 else f"{name} ({file})"
        for name, file in zip(names, trials, strict=True)
    ]
    places = {
        name: [
            fulcrum_place(said, trial.model.foot, file=trial.path, where="--fulcrum-mm")
            for said in positions
        ]
        for name, trial in zip(named, recorded, strict=True)
    }
    if sampled and any(item.name == SHIFT and not item.values for item in axes):
        variables = _within_reach(variables, loaded, list(places.values()))
    return dict(zip(named, loaded, strict=True)), variables, places


def _within_reach(
    variables: Mapping[str, Variable], trials: Sequence[Trial], positions: Sequence[list[float]]
) -> dict[str, Variable]:
    """`variables` with bounds of `fulcrum.shift` that keep every carriage within its reach from
    each position (m) of its trial."""
    places = [
        (trial.model.foot.fulcrum, at)
        for trial, own in zip(trials, positions, strict=True)
        for at in own or [trial.fulcrum_m]
    ]
    low = min(0.0, round(max(support.rearmost_m - at for support, at in places), 12))
    high = max(0.0, round(min(support.foremost_m - at for support, at in places), 12))
    require(
        low != high,
        "the fulcrum positions leave it no room in the carriage's reach",
        f"--vary {SHIFT}",
        f"Give {SHIFT}=LOW:HIGH; walks out of reach then fail",
    )
    return {**variables, SHIFT: dataclasses.replace(variables[SHIFT], low=low, high=high)}


# What a user may vary in a sweep, from the words of the command line to numbers.


class Axis(NamedTuple):
    """One quantity with its values on a grid; for a sample with its two bounds, or none for the
    variable's own."""

    name: str
    values: tuple[float, ...] = ()


def axis(text: str, *, sampled: bool) -> Axis:
    """`NAME=LOW:HIGH:COUNT`, `NAME=A,B,C`, `NAME=A`; for a sample `NAME` or `NAME=LOW:HIGH`."""
    name, given, spec = (part.strip() for part in text.partition("="))
    where = f"--vary {name}"
    ends = spec.split(":")
    if sampled and not given:
        return Axis(name)
    require(
        given,
        "has no values",
        where,
        f"Give {name}=LOW:HIGH:COUNT or {name}=A,B,C; with --sample the name is enough",
    )
    if not sampled:
        return Axis(name, values_of(spec, where))
    require(
        len(ends) == 2,
        f"{spec!r} are no bounds",
        where,
        f"With --sample give {name} or {name}=LOW:HIGH; the count is that of the sample",
    )
    return Axis(name, _rising(ends, where))


def places_said(text: str) -> Sequence[float | str]:
    """Fulcrum positions: numbers in mm, or each as somebody says it."""
    if ":" in text:
        require(
            "/" not in text,
            f"{text!r} is a range of stiffnesses",
            "--fulcrum-mm",
            "A range is in mm, 66:151:5; stiffnesses are a list, 12N/mm,16N/mm",
        )
        return values_of(text, "--fulcrum-mm")
    said = [part.strip() for part in text.split(",")]
    require(len(set(said)) == len(said), f"{text!r} names a value twice", "--fulcrum-mm")
    return said


def values_of(text: str, where: str) -> tuple[float, ...]:
    """`66:151:5`, `66,87,108` or `66` as numbers."""
    if ":" not in text:
        values = tuple(number_of(part, where) for part in text.split(","))
        require(len(set(values)) == len(values), f"{text!r} names a value twice", where)
        return values
    parts = text.split(":")
    require(
        len(parts) == 3,
        f"{text!r} is no range",
        where,
        "Give LOW:HIGH:COUNT, or values with commas",
    )
    low, high = _rising(parts[:2], where)
    require(
        re.fullmatch(r"\s*[-+]?[0-9]{1,99}\s*", parts[2]),
        f"{parts[2]!r} is no count",
        where,
        "It must be a whole number",
    )
    count = int(parts[2])
    require(
        2 <= count <= MOST,
        f"{count} values are no range",
        where,
        f"COUNT must be between 2 and {MOST}; give a single value alone",
    )
    return tuple(float(round(value, 12)) for value in np.linspace(low, high, count))


def check_count(count: int, *, meant: bool) -> None:
    """Raises InputError if a sweep of `count` walks is too long, or long and not meant."""
    require(
        count <= MOST,
        f"{count} walks are more than one sweep can hold",
        "sweep",
        f"Sweep at most {MOST} at a time",
    )
    require(
        count <= MANY or meant,
        f"these are {count} walks",
        "sweep",
        "Add --yes if that is meant",
    )


def _rising(ends: Sequence[str], where: str) -> tuple[float, float]:
    low, high = (number_of(end, where) for end in ends)
    require(low < high, f"{low:g} to {high:g} does not rise", where, "LOW must be below HIGH")
    return low, high
