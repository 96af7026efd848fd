"""`vsf-drake sweep`: many walks over trials, fulcrum positions and values of the model's variables."""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from vsf_drake.cli.app import Contact, app, check_contact_use, console, contact_hash, errors, file_of, progress
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.files import user_path
from vsf_drake.parameters import FulcrumParameters


@app.command()
def sweep(
    trials: Annotated[list[Path], typer.Argument(metavar="TRIAL.yaml...", help="Trial manifests.")],
    out: Annotated[Path | None, typer.Option(help="Folder for the results; created if needed.")] = None,
    fulcrum_mm: Annotated[str | None, typer.Option(
        metavar="LOW:HIGH:COUNT", help="Fulcrum positions from the keel's posterior end, or a list: 66,87,108. "
        "Default: each trial's own.")] = None,
    vary: Annotated[list[str] | None, typer.Option(
        metavar="NAME=LOW:HIGH:COUNT", help="Values of a variable, or a list: NAME=A,B,C; repeat it for a grid. "
        "With --sample: NAME, or NAME=LOW:HIGH.")] = None,
    sample: Annotated[int | None, typer.Option(
        help="Instead of a grid, so many sets of values that fill the bounds (Latin hypercube).")] = None,
    seed: Annotated[int, typer.Option(help="Of the sample.")] = 0,
    contact: Contact = None,
    fit_offsets: Annotated[bool, typer.Option(
        "--fit-offsets", help="First fit height, fore-aft position and alignment of the prosthesis, once a "
        "trial.")] = False,
    step_ms: Annotated[float, typer.Option(help="Step of the simulations.")] = 1.0,
    workers: Annotated[int | None, typer.Option(help="Processes. Default: one a core.")] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Thousands of walks are meant.")] = False,
    list_variables: Annotated[bool, typer.Option(
        "--list", help="Only print the variables of the trials: name, unit, value, bounds.")] = False,
) -> None:
    """Walks every combination and compares each walk with its force plate.

    Finished walks are kept in the folder's cache: after an interruption the same command goes on where it stopped,
    and a larger sweep with the same trials computes only what is new. Values are in the units that --list prints. A
    walk that fails is a row that says why; the exit code is 3 only if all of them fail.
    """
    contact = file_of(contact)
    if list_variables:
        _print_variables(trials, contact)
        return
    check_contact_use(contact, fit_offsets=fit_offsets)
    import vsf_drake.systems  # noqa: F401 (first: Drake looks through all modules there are for each template)
    from vsf_drake.report.sweep_output import check_sweep_folder, write_sweep, write_sweep_figure
    from vsf_drake.simulation.many import WalkCase, simulate_many
    from vsf_drake.simulation.walk import MAX_STEP_S

    if out is None:
        raise InputError("is missing", where="--out", right="Name the folder for the results")
    if not 0.0 < 1e-3 * step_ms <= MAX_STEP_S:
        raise InputError(f"{step_ms:g} ms is not a usable step", where="--step-ms",
                         right=f"It must be above 0 and at most {1e3 * MAX_STEP_S:g}")
    if sample is not None and sample < 1:
        raise InputError(f"{sample} sets of values are none", where="--sample")
    if seed < 0:
        raise InputError(f"{seed} is negative", where="--seed")
    if workers is not None and workers < 1:
        raise InputError(f"{workers} is no number of workers", where="--workers", right="Give 1 or more")
    positions = fulcrum_positions(fulcrum_mm)
    axes = [axis(text, sampled=sample is not None) for text in vary or ()]
    if not axes and (not positions or sample is not None):
        raise InputError("there is nothing to vary", where="sweep",
                         right="Give --vary, or --fulcrum-mm without --sample; --list prints the names")
    count = len(trials) * max(1, len(positions)) * (sample or _product(axes))
    check_count(count, meant=yes)
    out = user_path(out)
    loaded, variables = _loaded(trials, contact, axes, positions)
    fitted = contact_hash(contact)
    if any(item.name == SHIFT and item.bounds is None for item in axes) and sample is not None:
        variables = within_reach(variables, [
            (trial.fulcrum_m if mm is None else 1e-3 * mm, trial.model.foot.fulcrum)
            for trial in loaded.values() for mm in positions or (None,)])
    check_sweep_folder(out, loaded.values())
    sets = _sets(axes, variables, sample, seed)
    offsets = {name: _fitted(trial, name) if fit_offsets else trial.offsets for name, trial in loaded.items()}
    cases = [WalkCase(trial=trial, values=values, fulcrum_m=None if mm is None else 1e-3 * mm,
                      label="" if name == trial.name else name, offsets=offsets[name], step_s=1e-3 * step_ms)
             for name, trial in loaded.items() for mm in positions or (None,) for values in sets]
    varied = {item.name: variables[item.name] for item in axes}
    try:
        outcomes = simulate_many(cases, workers=workers, cache=out / "cache", progress=True)
        with progress() as show:
            table, rows = write_sweep(
                outcomes, loaded, out, variables=varied, fulcrum=bool(positions), show=lambda f: show("comparing", f),
                plan={"fulcrum_mm": positions or None, "step_ms": step_ms, "fit_offsets": fit_offsets,
                      "contact": fitted,
                      "offsets": offsets, **_plan(axes, variables, sample, seed)})
    except KeyboardInterrupt:
        errors.print(f"interrupted; the finished walks are in {out / 'cache'}: the same command goes on from them",
                     highlight=False, soft_wrap=True, markup=False)
        sys.exit(130)
    _print_sweep(table)
    write_sweep_figure(rows, table, out, varied)
    console.print(f"written to {out}", highlight=False, markup=False)
    if table["failed"] == table["walks"]:
        sys.exit(SimulationError.exit_code)


def _loaded(
    trials: list[Path], contact: Path | None, axes: list[Axis], positions: tuple[float, ...]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Trials by a name that is theirs alone, and the variables of the first; each can take what is asked for."""
    from vsf_drake.model_file import check_fulcrum
    from vsf_drake.simulation.walk import Walker

    paths = [user_path(path) for path in trials]
    for i, path in enumerate(paths):
        if path.resolve() in [other.resolve() for other in paths[:i]]:
            raise InputError("the trial stands twice", file=path)
    found = _read(paths, contact)
    names = [trial.name for trial in found]
    variables: dict[str, Any] = {}
    for path, trial in zip(paths, found, strict=True):
        own = Walker(trial.subject, trial.model).variables
        check_axes(axes, own, trial="" if len(paths) == 1 else str(path))
        variables = variables or own
        for mm in positions:
            check_fulcrum(1e-3 * mm, trial.model.foot, where="--fulcrum-mm")
    return {name if names.count(name) == 1 else f"{name} ({path})": trial
            for name, path, trial in zip(names, paths, found, strict=True)}, variables


def _read(paths: list[Path], contact: Path | None) -> list[Any]:
    """The trials, with the fitted contact if there is one."""
    from vsf_drake.contact_file import load_contact
    from vsf_drake.motion.fitted_trial import trial_with
    from vsf_drake.motion.trial import load_trial

    if contact is None:
        return [load_trial(path) for path in paths]
    fitted = load_contact(contact)
    return [trial_with(load_trial(path), fitted, file=contact) for path in paths]


def _sets(axes: list[Axis], variables: dict[str, Any], sample: int | None, seed: int) -> list[dict[str, float]]:
    from vsf_drake.simulation.many import grid_values, sample_values

    if sample is None:
        return grid_values({item.name: item.values for item in axes})
    return sample_values(with_bounds(axes, variables), [item.name for item in axes], sample, seed)


def _plan(axes: list[Axis], variables: dict[str, Any], sample: int | None, seed: int) -> dict[str, Any]:
    """What of a sweep's values is needed to repeat it."""
    if sample is None:
        return {"vary": {item.name: item.values for item in axes}, "sample": None}
    return {"sample": {
        "count": sample, "seed": seed, "method": "Latin hypercube, of the logarithm where the lower bound is above 0",
        "bounds": {name: [v.low, v.high] for name, v in with_bounds(axes, variables).items()}}}


def _fitted(trial: Any, name: str) -> Any:
    from vsf_drake.analysis.offsets import fit_offsets

    with progress() as show:
        show(f"{name}: fitting the offsets", 0.0)
        return fit_offsets(trial).offsets


def _product(axes: list[Axis]) -> int:
    count = 1
    for item in axes:
        count *= len(item.values)
    return count


def _print_variables(trials: list[Path], contact: Path | None) -> None:
    """A line a variable, in columns, for reading and for grep."""
    from vsf_drake.simulation.walk import Walker

    for trial in _read([user_path(path) for path in trials], contact):
        own = Walker(trial.subject, trial.model).variables
        found = within_reach(own, [(trial.fulcrum_m, trial.model.foot.fulcrum)]).values()
        rows = [("variable", "unit", "value", "low", "high", ""),
                *((v.name, v.unit, f"{v.default:.6g}", f"{v.low:.6g}", f"{v.high:.6g}",
                   "added to what is there" if v.added else "") for v in found)]
        wide = [max(len(row[i]) for row in rows) for i in range(5)]
        typer.echo(f"# {trial.name}, fulcrum at {1e3 * trial.fulcrum_m:g} mm")
        for row in rows:
            cells = [row[0].ljust(wide[0]), row[1].ljust(wide[1]), *(row[i].rjust(wide[i]) for i in (2, 3, 4)), row[5]]
            typer.echo("  ".join(cells).rstrip())


def _print_sweep(table: dict[str, Any]) -> None:
    """What came out, in a few lines."""
    lines = [f"{table['walks']} walks, {table['failed']} failed"]
    for trial in table["trials"]:
        best = trial["smallest_error"]
        if best is not None:
            varied = ", ".join(f"{name} {value:g}" for name, value in best["at"].items())
            lines.append(f"{trial['name']}: resultant force within {best['grf_rmse_bw']:.3f} BW at best, at {varied}")
        elif trial["finished"]:
            lines.append(f"{trial['name']}: no walk has a stance to compare")
    unconverged = f"{table['unconverged_steps']} steps unconverged"
    lines.append(unconverged + (f", {table['refined_steps']} cut into smaller ones" if table["refined_steps"] else ""))
    if table["with_notes"]:
        lines.append(f"! notes on {table['with_notes']} of {table['walks']} walks, perhaps doubts: see sweep.csv")
    for line in lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    for failure in table["failures"][:3]:
        console.print(f"! {failure}", style="bold yellow", highlight=False, markup=False, soft_wrap=True)
    if table["failed"] > 3:
        console.print(f"! and {table['failed'] - 3} more: see sweep.csv", style="bold yellow", highlight=False)


# What a user may vary in a sweep, from the words of the command line to numbers.


SHIFT = "fulcrum.shift"
MOST = 20_000
"""Walks that a sweep may have: their series are in memory at the end, some 70 kB each for 1.2 s."""
MANY = 2_000
"""Walks above which a sweep has to be meant."""


@dataclass(frozen=True)
class Axis:
    """One quantity with its values on a grid; for a sample only its bounds, or None for the variable's own."""

    name: str
    values: tuple[float, ...] = ()
    bounds: tuple[float, float] | None = None


def fulcrum_positions(text: str | None) -> tuple[float, ...]:
    """`66:151:5`, `66,87,108` or `66` -> mm; nothing for None.

    Raises:
        InputError: it is none of these.
    """
    return () if text is None else _values(text, "--fulcrum-mm")


def axis(text: str, *, sampled: bool) -> Axis:
    """`NAME=LOW:HIGH:COUNT`, `NAME=A,B,C`, `NAME=A`; for a sample `NAME` or `NAME=LOW:HIGH`.

    Raises:
        InputError: it is none of these.
    """
    name, given, spec = text.partition("=")
    name = name.strip()
    if not sampled:
        if not given:
            raise InputError("has no values", where=f"--vary {name}",
                             right=f"Give {name}=LOW:HIGH:COUNT or {name}=A,B,C; with --sample the name is enough")
        return Axis(name, _values(spec, f"--vary {name}"))
    if not given:
        return Axis(name)
    ends = spec.split(":")
    if len(ends) != 2:
        raise InputError(f"{spec!r} are no bounds", where=f"--vary {name}",
                         right=f"With --sample give {name} or {name}=LOW:HIGH; the count is that of the sample")
    low, high = (_number(end, f"--vary {name}") for end in ends)
    _rising(low, high, f"--vary {name}")
    return Axis(name, bounds=(low, high))


def check_axes(axes: Sequence[Axis], variables: Mapping[str, Any], *, trial: str = "") -> None:
    """Raises InputError for an unknown name (it tells the nearest), one that comes twice, or an unusable value."""
    from vsf_drake.simulation.variables import check_names, check_values

    try:
        check_names([item.name for item in axes], variables, where="--vary")
        for item in axes:
            for value in (*item.values, *(item.bounds or ())):
                check_values({item.name: value}, variables)
    except InputError as error:
        where = (error.where or "").removeprefix("values").strip("[]'")
        listed = (error.right or "").startswith("There are: ")  # dozens of names, which --list has in columns
        raise InputError(error.what, file=trial or None, where="--vary" if where == "--vary" else f"--vary {where}",
                         right="--list prints the names" if listed else error.right) from None


def within_reach(
    variables: Mapping[str, Any], fulcrums: Sequence[tuple[float, FulcrumParameters]]
) -> dict[str, Any]:
    """`variables` with bounds of `fulcrum.shift` that keep the carriage within its reach from each of `fulcrums`.

    Args:
        fulcrums: positions (m from the keel's posterior end), each with the support it is on.

    Raises:
        InputError: only a shift of zero does.
    """
    low = min(0.0, round(max(support.rearmost_m - at for at, support in fulcrums), 12))
    high = max(0.0, round(min(support.foremost_m - at for at, support in fulcrums), 12))
    if low == high:
        raise InputError("the fulcrum positions leave it no room in the carriage's reach", where=f"--vary {SHIFT}",
                         right=f"Give {SHIFT}=LOW:HIGH; walks out of reach then fail")
    return {**variables, SHIFT: dataclasses.replace(variables[SHIFT], low=low, high=high)}


def with_bounds(axes: Sequence[Axis], variables: Mapping[str, Any]) -> dict[str, Any]:
    """The variables of `axes`, each with the bounds that were asked for."""
    return {item.name: dataclasses.replace(variables[item.name], low=item.bounds[0], high=item.bounds[1])
            if item.bounds else variables[item.name] for item in axes}


def check_count(count: int, *, meant: bool) -> None:
    """Raises InputError if a sweep of `count` walks is too long, or long and not meant."""
    if count > MOST:
        raise InputError(f"{count} walks are more than one sweep can hold", where="sweep",
                         right=f"Sweep at most {MOST} at a time")
    if count > MANY and not meant:
        raise InputError(f"these are {count} walks, about {count * 70e-6:.1f} GB in the cache", where="sweep",
                         right="Add --yes if that is meant")


def _values(text: str, where: str) -> tuple[float, ...]:
    if ":" not in text:
        found = tuple(_number(part, where) for part in text.split(","))
        if len(set(found)) != len(found):
            raise InputError(f"{text!r} names a value twice", where=where)
        return found
    parts = text.split(":")
    if len(parts) != 3:
        raise InputError(f"{text!r} is no range", where=where, right="Give LOW:HIGH:COUNT, or values with commas")
    low, high = (_number(part, where) for part in parts[:2])
    try:
        count = int(parts[2])
    except ValueError:
        raise InputError(f"{parts[2]!r} is no count", where=where, right="It must be a whole number") from None
    _rising(low, high, where)
    if not 2 <= count <= MOST:
        raise InputError(f"{count} values are no range", where=where,
                         right=f"COUNT must be between 2 and {MOST}; give a single value alone")
    return tuple(float(round(value, 12)) for value in np.linspace(low, high, count))


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{text.strip()!r} is not a finite number", where=where)
    return value


def _rising(low: float, high: float, where: str) -> None:
    if not low < high:
        raise InputError(f"{low:g} to {high:g} does not rise", where=where, right="LOW must be below HIGH")
