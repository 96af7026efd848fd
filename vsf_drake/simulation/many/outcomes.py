"""What became of one member of a sweep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from vsf_drake.errors import VsfError
from vsf_drake.simulation.many.cases import WalkCase


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
