"""Values for the members of a sweep: every combination on a grid, or a random sample that fills the bounds evenly."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.simulation.many.cases import shown, whole
from vsf_drake.simulation.variables import Variable


def grid_values(axes: Mapping[str, Sequence[float]]) -> list[dict[str, float]]:
    """Every combination of the values in `axes` (by variable), the last one running fastest."""
    return [dict(zip(axes, map(float, row), strict=True)) for row in itertools.product(*axes.values())]


def sample_values(
    variables: Mapping[str, Variable], names: Sequence[str], count: int, seed: int
) -> list[dict[str, float]]:
    """A Latin hypercube over the bounds of `names` (McKay, Beckman & Conover 1979, doi 10.1080/00401706.1979.10489755).

    The range of each variable is cut into `count` equal slices and each slice is met once. Where the lower bound is
    above zero the logarithm is cut, because such bounds are ratios.

    Args:
        variables: a walker's, by name.
        count: how many sets of values, at least 1.
        seed: 0 or more; the same seed gives the same sets.

    Raises:
        InputError: a name is not one of `variables` or given twice, nothing is asked for, or `count` or `seed`
            is no such number.
    """
    if isinstance(names, str):
        raise InputError(f"{names!r} is one name, not a sequence of names", where="names", right=f"Give [{names!r}]")
    names, count, seed = [*names], whole(count, "count", 0), whole(seed, "seed", 0)
    for i, name in enumerate(names):
        if not isinstance(name, str):
            raise InputError(f"{shown(name)} is no name", where="names")
        if name not in variables or name in names[:i]:
            raise InputError(f"{name!r} is {'named twice' if name in variables else 'no variable of this walker'}",
                             where="names")
    if count < 1 or not names:
        raise InputError(f"{count} sets of {len(names)} values are none", where="count, names")
    random = np.random.default_rng(seed)
    columns = []
    for name in names:
        share = (random.permutation(count) + random.uniform(size=count)) / count
        low, high = variables[name].low, variables[name].high
        columns.append(low * (high / low) ** share if low > 0.0 else low + (high - low) * share)
    return [dict(zip(map(str, names), map(float, row), strict=True)) for row in zip(*columns, strict=True)]
