"""`vsf-drake sweep`: many walks over trials, fulcrum positions and values of the model's variables."""

from __future__ import annotations

import dataclasses
import math
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np
import typer

from vsf_drake.cli.app import (
    Contact,
    OptionalOut,
    Trials,
    app,
    check_contact_use,
    contact_hash,
    interrupted,
    print_text,
    progress,
    read_trials,
    say,
    warn,
)
from vsf_drake.errors import InputError, SimulationError

if TYPE_CHECKING:
    from vsf_drake.motion.trial import Trial
    from vsf_drake.simulation.variables import Variable

SHIFT = "fulcrum.shift"
MOST = 20_000  # walks that a sweep may have: their series are in memory at the end, some 70 kB each for 1.2 s
MANY = 2_000  # walks above which a sweep has to be meant


@app.command()
def sweep(
    trials: Trials,
    out: OptionalOut = None,
    fulcrum_mm: Annotated[
        str | None,
        typer.Option(
            metavar="LOW:HIGH:COUNT",
            help="Fulcrum positions from the keel's posterior end, or a list: 66,87,108. "
            "Default: each trial's own.",
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=LOW:HIGH:COUNT",
            help="Values of a variable, or a list: NAME=A,B,C; may be repeated, for a grid. "
            "With --sample: NAME, or NAME=LOW:HIGH.",
        ),
    ] = None,
    sample: Annotated[
        int | None,
        typer.Option(
            help="Instead of a grid: this many sets of values that fill the bounds (Latin hypercube).",
            min=1,
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the sample.", min=0)] = 0,
    contact: Contact = None,
    fit_offsets: Annotated[
        bool,
        typer.Option(
            "--fit-offsets",
            help="First fit height, fore-aft position and alignment of the prosthesis, once a "
            "trial.",
        ),
    ] = False,
    step_ms: Annotated[float, typer.Option(help="Step of the simulations.")] = 1.0,
    workers: Annotated[
        int | None, typer.Option(help="Processes. Default: one per core.", min=1)
    ] = None,
    parquet: Annotated[
        bool, typer.Option("--parquet", help="Write sweep.parquet, too; needs the extra `tables`.")
    ] = False,
    yes: Annotated[
        bool, typer.Option("--yes", help="Confirm that thousands of walks are intended.")
    ] = False,
    list_variables: Annotated[
        bool,
        typer.Option(
            "--list", help="Only print the variables of the trials: name, unit, value, bounds."
        ),
    ] = False,
) -> None:
    """Simulates every combination and compares each walk with its force plate.

    Finished walks are kept in the folder's cache: after an interruption the same command continues where it stopped,
    and a larger sweep with the same trials computes only what is new. Values are in the units that --list prints. A
    walk that fails is a row that says why; the exit code is 3 only if all of them fail.
    """
    if list_variables:
        from vsf_drake.simulation.walk import Walker

        for trial in read_trials(trials, contact):
            own = Walker(trial.subject, trial.model).variables
            print_text("variables", trial=trial, variables=_within_reach(own, [trial], ()).values())
        return
    check_contact_use(contact, fit_offsets=fit_offsets)
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.analysis.offsets import fit_offsets as offsets_of
    from vsf_drake.analysis.sweep_table import sweep_table
    from vsf_drake.report.outputs import check_sweep_folder, write_sweep, write_sweep_figure
    from vsf_drake.simulation.batch import WalkCase, grid_values, sample_values, simulate_batch
    from vsf_drake.simulation.walk import MAX_STEP_S

    if out is None:
        raise InputError("is missing", where="--out", right="Name the folder for the results")
    if not 0.0 < 1e-3 * step_ms <= MAX_STEP_S:
        raise InputError(
            f"{step_ms:g} ms is not a usable step",
            where="--step-ms",
            right=f"It must be above 0 and at most {1e3 * MAX_STEP_S:g}",
        )
    positions = () if fulcrum_mm is None else values_of(fulcrum_mm, "--fulcrum-mm")
    axes = [axis(text, sampled=sample is not None) for text in vary or ()]
    if not axes and (not positions or sample is not None):
        raise InputError(
            "there is nothing to vary",
            where="sweep",
            right="Give --vary, or --fulcrum-mm without --sample; --list prints the names",
        )
    check_count(
        len(trials)
        * max(1, len(positions))
        * (sample or math.prod(len(item.values) for item in axes)),
        meant=yes,
    )
    loaded, variables = _loaded(
        trials, contact, axes, positions, sampled=sample is not None, fit_offsets=fit_offsets
    )
    check_sweep_folder(out, loaded.values(), parquet=parquet)
    plan: dict[str, object] = {
        "fulcrum_mm": positions or None,
        "step_ms": step_ms,
        "fit_offsets": fit_offsets,
        "contact": contact_hash(contact),
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
            "seed": seed,
            "bounds": {k: [v.low, v.high] for k, v in bounded.items()},
            "method": "Latin hypercube, of the logarithm where the lower bound is above 0",
        }
        sets = sample_values(bounded, list(bounded), sample, seed)
    plan["offsets"] = offsets = {name: trial.offsets for name, trial in loaded.items()}
    if fit_offsets:
        with progress() as show:
            for name, trial in loaded.items():
                show(f"{name}: fitting the offsets", 0.0)
                offsets[name] = offsets_of(trial).offsets
    cases = [
        WalkCase(
            trial=trial,
            values=values,
            fulcrum_m=None if mm is None else 1e-3 * mm,
            label="" if name == trial.name else name,
            offsets=offsets[name],
            step_s=1e-3 * step_ms,
        )
        for name, trial in loaded.items()
        for mm in positions or (None,)
        for values in sets
    ]
    varied = {item.name: variables[item.name] for item in axes}
    try:
        outcomes = simulate_batch(cases, workers=workers, cache=out / "cache", progress=True)
        with progress() as show:
            table, rows = sweep_table(
                outcomes,
                loaded,
                variables=varied,
                fulcrum=bool(positions),
                plan=plan,
                show=lambda f: show("comparing", f),
            )
            write_sweep(table, rows, out, parquet=parquet)
    except KeyboardInterrupt:
        interrupted(
            f"; the finished walks are in {out / 'cache'}: the same command goes on from them"
        )
    print_text("sweep", **vars(table))
    write_sweep_figure(table, rows, out)
    say(f"written to {out / 'sweep.csv'}{', sweep.parquet' * parquet}")
    if table.failed == table.walks:
        sys.exit(SimulationError.exit_code)


def _loaded(
    trials: list[Path],
    contact: Path | None,
    axes: list[Axis],
    positions: tuple[float, ...],
    *,
    sampled: bool,
    fit_offsets: bool,
) -> tuple[dict[str, Trial], dict[str, Variable]]:
    """Trials by a name that is theirs alone, and the variables of the first; each can take what is asked for. Warns of
    a foot that was fitted to nobody."""
    from vsf_drake.analysis.metrics import unfitted_note
    from vsf_drake.model_file import check_fulcrum
    from vsf_drake.simulation.variables import check_names, check_values
    from vsf_drake.simulation.walk import Walker

    for i, file in enumerate(trials):
        if file.resolve() in [other.resolve() for other in trials[:i]]:
            raise InputError("the trial stands twice", file=file)
    loaded = read_trials(trials, contact)
    if contact is None:
        warn(unfitted_note(loaded[0], offsets_fitted=fit_offsets))
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
            listed = (error.right or "").startswith(
                "There are: "
            )  # dozens of names, which --list has in columns
            raise InputError(
                error.what,
                file=file if len(trials) > 1 else None,
                where="--vary" if where == "--vary" else f"--vary {where}",
                right="--list prints the names" if listed else error.right,
            ) from None
        variables = variables or own
        for mm in positions:
            check_fulcrum(1e-3 * mm, trial.model.foot, where="--fulcrum-mm")
    if sampled and any(item.name == SHIFT and not item.values for item in axes):
        variables = _within_reach(variables, loaded, positions)
    return {
        name if names.count(name) == 1 else f"{name} ({file})": trial
        for name, file, trial in zip(names, trials, loaded, strict=True)
    }, variables


def _within_reach(
    variables: Mapping[str, Variable], trials: Sequence[Trial], positions: Sequence[float]
) -> dict[str, Variable]:
    """`variables` with bounds of `fulcrum.shift` that keep every carriage within its reach from each position (mm)."""
    places = [
        (trial.model.foot.fulcrum, at)
        for trial in trials
        for at in ([1e-3 * mm for mm in positions] or [trial.fulcrum_m])
    ]
    low = min(0.0, round(max(support.rearmost_m - at for support, at in places), 12))
    high = max(0.0, round(min(support.foremost_m - at for support, at in places), 12))
    if low == high:
        raise InputError(
            "the fulcrum positions leave it no room in the carriage's reach",
            where=f"--vary {SHIFT}",
            right=f"Give {SHIFT}=LOW:HIGH; walks out of reach then fail",
        )
    return {**variables, SHIFT: dataclasses.replace(variables[SHIFT], low=low, high=high)}


# What a user may vary in a sweep, from the words of the command line to numbers.


class Axis(NamedTuple):
    """One quantity with its values on a grid; for a sample with its two bounds, or none for the variable's own."""

    name: str
    values: tuple[float, ...] = ()


def axis(text: str, *, sampled: bool) -> Axis:
    """`NAME=LOW:HIGH:COUNT`, `NAME=A,B,C`, `NAME=A`; for a sample `NAME` or `NAME=LOW:HIGH`."""
    name, given, spec = (part.strip() for part in text.partition("="))
    where, ends = f"--vary {name}", spec.split(":")
    if sampled and not given:
        return Axis(name)
    if not given:
        raise InputError(
            "has no values",
            where=where,
            right=f"Give {name}=LOW:HIGH:COUNT or {name}=A,B,C; with --sample the name is enough",
        )
    if not sampled:
        return Axis(name, values_of(spec, where))
    if len(ends) != 2:
        raise InputError(
            f"{spec!r} are no bounds",
            where=where,
            right=f"With --sample give {name} or {name}=LOW:HIGH; the count is that of the sample",
        )
    return Axis(name, _rising(ends, where))


def values_of(text: str, where: str) -> tuple[float, ...]:
    """`66:151:5`, `66,87,108` or `66` as numbers."""
    if ":" not in text:
        values = tuple(_number(part, where) for part in text.split(","))
        if len(set(values)) != len(values):
            raise InputError(f"{text!r} names a value twice", where=where)
        return values
    parts = text.split(":")
    if len(parts) != 3:
        raise InputError(
            f"{text!r} is no range", where=where, right="Give LOW:HIGH:COUNT, or values with commas"
        )
    low, high = _rising(parts[:2], where)
    if not re.fullmatch(r"\s*[-+]?[0-9]{1,99}\s*", parts[2]):
        raise InputError(
            f"{parts[2]!r} is no count", where=where, right="It must be a whole number"
        )
    count = int(parts[2])
    if not 2 <= count <= MOST:
        raise InputError(
            f"{count} values are no range",
            where=where,
            right=f"COUNT must be between 2 and {MOST}; give a single value alone",
        )
    return tuple(float(round(value, 12)) for value in np.linspace(low, high, count))


def check_count(count: int, *, meant: bool) -> None:
    """Raises InputError if a sweep of `count` walks is too long, or long and not meant."""
    if count > MOST:
        raise InputError(
            f"{count} walks are more than one sweep can hold",
            where="sweep",
            right=f"Sweep at most {MOST} at a time",
        )
    if count > MANY and not meant:
        raise InputError(
            f"these are {count} walks, about {count * 70e-6:.1f} GB in the cache",
            where="sweep",
            right="Add --yes if that is meant",
        )


def _rising(ends: Sequence[str], where: str) -> tuple[float, float]:
    low, high = (_number(end, where) for end in ends)
    if not low < high:
        raise InputError(
            f"{low:g} to {high:g} does not rise", where=where, right="LOW must be below HIGH"
        )
    return low, high


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{text.strip()!r} is not a finite number", where=where)
    return value
