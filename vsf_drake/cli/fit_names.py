"""Parameters of a fit by name or prefix: which are to be free, which frozen."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Sequence
from typing import TYPE_CHECKING

from vsf_drake.errors import InputError

if TYPE_CHECKING:
    from vsf_drake.analysis.contact_fit import FitParameters


def check_patterns(free: Sequence[str], freeze: Sequence[str]) -> None:
    """Raises InputError for a pattern that is to be both."""
    both = [pattern for pattern in free if pattern in freeze]
    if both:
        raise InputError(f"{both[0]} is to be free and frozen", where="--free", right="Decide for one")


def with_frozen(parameters: FitParameters, free: Sequence[str], freeze: Sequence[str]) -> FitParameters:
    """The parameters with those frozen and free that the patterns name: a name, or a prefix that ends in "*".

    Where several patterns fit a parameter, the longest decides: --freeze 'socket.*' --free socket.tz.stiffness.

    Raises:
        InputError: a pattern fits no parameter, or all are frozen.
    """
    names = list(parameters.by_name)
    for option, patterns in (("--free", free), ("--freeze", freeze)):
        for pattern in patterns:
            if not any(_fits(pattern, name) for name in names):
                raise InputError(f"there is no parameter {pattern!r}", where=option, right=_near(pattern, names))
    items = []
    for item in parameters.items:
        fitting = [(len(pattern), frozen) for patterns, frozen in ((free, False), (freeze, True))
                   for pattern in patterns if _fits(pattern, item.name)]
        items.append(dataclasses.replace(item, frozen=max(fitting)[1]) if fitting else item)
    if all(item.frozen for item in items):
        raise InputError("all parameters are frozen", where="--freeze", right="Leave at least one free")
    return type(parameters)(items)


def _fits(pattern: str, name: str) -> bool:
    return name.startswith(pattern[:-1]) if pattern.endswith("*") else name == pattern


def _near(pattern: str, names: Sequence[str]) -> str:
    prefixes = dict.fromkeys(".".join(name.split(".")[:i]) for name in names for i in range(1, name.count(".") + 1))
    known = {**{name: name for name in names}, **{prefix: f"{prefix}.*" for prefix in prefixes}}
    near = difflib.get_close_matches(pattern.rstrip("*."), known, n=3, cutoff=0.6)
    if near:
        return f"Did you mean {', '.join(known[name] for name in near)}?"
    families = dict.fromkeys(name.split(".")[0] for name in names)
    return f"Their names begin with {', '.join(families)}; fit.json of any fit lists them all"
