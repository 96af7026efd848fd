"""What a user may vary in a sweep, from the words of the command line to numbers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.parameters import FulcrumParameters

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
