"""Which parameters a fit has free, and how well each was known before: --free, --freeze, --prior
and --prior-file."""

from __future__ import annotations

import dataclasses
import difflib
import fnmatch
import functools
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import yaml

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.yaml_file import read_yaml
from vsf_drake.fit.parameters import FitParameter, FitParameters


def with_frozen(
    parameters: FitParameters, free: Sequence[str], freeze: Sequence[str]
) -> FitParameters:
    """The parameters with those frozen and free that the patterns name: a name, or one with "*" for
    any characters.

    Where several patterns fit a parameter, the longest decides: --freeze 'socket.*' --free
    socket.tz.stiffness.
    """
    for option, patterns in (("--free", free), ("--freeze", freeze)):
        for pattern in patterns:
            _check_pattern(pattern, parameters, where=option)
    items = []
    for item in parameters.items:
        own = _longest((*freeze, *free), item.name)
        items.append(item if own is None else dataclasses.replace(item, frozen=own in freeze))
    require(
        not all(item.frozen for item in items),
        "all parameters are frozen",
        "--freeze",
        "Leave at least one free",
    )
    return FitParameters(items)


def prior_widths(options: Sequence[str], file: Path | None) -> dict[str, str]:
    """Standard deviations of priors as text by pattern, those of the file first; InputError for
    what is none."""
    widths = {} if file is None else _read_widths(file)
    seen: dict[str, str] = {}
    for text in options:
        name, equals, width = text.rpartition("=")
        require(
            name and equals and width,
            f"{text!r} is no prior",
            "--prior",
            "Write NAME=SD, for example curve.*=1.5deg",
        )
        require(
            seen.setdefault(name, width) == width,
            f"{name} is given {seen[name]} and {width}",
            "--prior",
            "Decide for one",
        )
    return {**widths, **seen}


def _read_widths(file: Path) -> dict[str, str]:
    node = read_yaml(file)
    if not isinstance(node, yaml.MappingNode) or not all(
        isinstance(value, yaml.ScalarNode) for _, value in node.value
    ):
        raise InputError(
            "holds no names with standard deviations",
            file=file,
            right="Write a line NAME: SD for each",
        )
    widths: dict[str, str] = {}
    for key, value in node.value:
        require(key.value not in widths, "stands twice", key.value, "Decide for one", file=file)
        widths[key.value] = value.value
    return widths


UNITS = {"deg": ("rad", math.pi / 180.0), "mm": ("m", 1e-3)}
"""Behind a number of a prior, and what it is in the parameter's own unit."""


def with_priors(parameters: FitParameters, widths: Mapping[str, str]) -> FitParameters:
    """The parameters with these standard deviations of their priors, in the parameter's unit, deg
    or mm; of its logarithm where that is searched. Where several patterns fit, the longest decides.
    InputError for what none has."""
    items = []
    for pattern in widths:
        _check_pattern(pattern, parameters, where="--prior")
    for item in parameters.items:
        own = _longest(widths, item.name)
        items.append(
            item if own is None else dataclasses.replace(item, scale=_width(item, own, widths[own]))
        )
    return FitParameters(items)


def _width(item: FitParameter, pattern: str, text: str) -> float:
    number = text.strip()
    unit = next((unit for unit in UNITS if text.strip().endswith(unit)), "")
    refused = functools.partial(InputError, where=f"--prior {pattern}")
    try:
        width = float(number.removesuffix(unit))
    except ValueError:
        raise refused(
            f"{text!r} is no number", right=f"Give a number in {item.unit}, or with deg or mm"
        ) from None
    if unit:
        own, factor = UNITS[unit]
        if item.unit != own or item.logarithmic:
            raise refused(
                f"{item.name} is not measured in {unit}",
                right="Give the standard deviation of its logarithm"
                if item.logarithmic
                else f"Its unit is {item.unit}",
            )
        width *= factor
    if not 0.0 < width < math.inf:
        raise refused(f"a standard deviation of {text} is none", right="It must be above 0")
    most = max(
        abs(math.log(end / item.mean)) if item.logarithmic else abs(end - item.mean)
        for end in (item.low, item.high)
    )
    if width > most:
        raise refused(
            f"{text} is wider than the bounds of {item.name}, {item.low:g} to {item.high:g} "
            f"{item.unit}",
            right=f"It can be {most:g} at most"
            + (", of the logarithm" if item.logarithmic else ""),
        )
    return width


def _check_pattern(pattern: str, parameters: FitParameters, *, where: str) -> None:
    """InputError if no parameter has a name that fits."""
    names = list(parameters.by_name)
    if not any(_fits(pattern, name) for name in names):
        families = [f"{family}.*" for family in dict.fromkeys(name.split(".")[0] for name in names)]
        near = difflib.get_close_matches(pattern, [*names, *families], n=3)
        raise InputError(
            f"there is no parameter {pattern!r}",
            where=where,
            right=(
                f"Did you mean {', '.join(near)}?"
                if near
                else f"There are {', '.join(families)}; fit.json of any fit lists them all"
            ),
        )


def _longest(patterns: Iterable[str], name: str) -> str | None:
    """The one that decides; None where none fits."""
    return max((one for one in patterns if _fits(one, name)), key=len, default=None)


def _fits(pattern: str, name: str) -> bool:
    return name == pattern or fnmatch.fnmatchcase(name, pattern)
