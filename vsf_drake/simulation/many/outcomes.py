"""What became of one member of a sweep."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from vsf_drake.errors import InputError, VsfError
from vsf_drake.simulation.many.cases import WalkCase, shown, whole
from vsf_drake.simulation.variables import Variable


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkOutcome:
    """One finished member: its arrays, or why there are none.

    Attributes:
        case: what was asked for.
        failure: what went wrong, with the member's parameters; None if nothing did.
        unconverged_steps: how many steps were accepted without convergence; None if it failed.
        refined_steps: how many were cut into smaller ones to converge, which is no fault; None if it failed.
        wall_s: time that the walk took where it ran, also if it comes from the cache; None if it failed.
        from_cache: whether it was read rather than simulated.
        columns: names of the columns of those kept arrays whose columns are coordinates or energies.
        notes: on the run (an implausible load, a loaded start) and on its cache entry.
    """

    case: WalkCase
    failure: str | None = None
    unconverged_steps: int | None = None
    refined_steps: int | None = None
    wall_s: float | None = None
    from_cache: bool = False
    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    _arrays: Mapping[str, np.ndarray] = field(default_factory=dict, repr=False)

    @property
    def ok(self) -> bool:
        """Whether there are arrays."""
        return self.failure is None

    @property
    def arrays(self) -> Mapping[str, np.ndarray]:
        """What was kept, by name: shapes, units and frames as in `WalkResult`; read-only, as is the mapping:
        equal members share it.

        Raises:
            VsfError: this member failed.
        """
        if self.failure is not None:
            raise VsfError(f"a failed walk has no arrays: {self.failure}")
        return MappingProxyType(self._arrays)

    def column(self, name: str) -> np.ndarray:
        """(n,) history of one coordinate, if `q` was kept.

        Raises:
            VsfError: this member failed.
            KeyError: `q` was not kept or has no such column.
        """
        q, names = self.arrays["q"], self.columns["q"]
        if name not in names:
            raise KeyError(f"there is no coordinate {name}; there are {', '.join(names)}")
        return q[:, names.index(name)]


# Values for the members of a sweep: every combination on a grid, or a random sample that fills the bounds evenly.


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
