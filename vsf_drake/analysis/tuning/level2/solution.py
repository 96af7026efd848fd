"""What a tuning with a free motion ended with."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsf_drake.analysis.collocation.solution import TrajectorySolution
from vsf_drake.analysis.tuning.level2.search import Fixed, StrideSearch
from vsf_drake.analysis.tuning.level2.stride import MM
from vsf_drake.analysis.tuning.level2.tuning import StrideTuning
from vsf_drake.errors import FitError


@dataclass(frozen=True)
class StrideCheck:
    """One check: its value with unit, what it should be, whether it is (None: nothing is demanded), and in words."""

    name: str
    label: str
    value: float | None
    unit: str
    target: str
    met: bool | None
    sentence: str


@dataclass(frozen=True, eq=False)
class DrawnStride:
    """The optimum with one drawn contact: position and cost, NaN if none was found, and its outcomes."""

    what: str
    fulcrum_mm: float
    cost: float
    outcomes: dict[str, float]


@dataclass(eq=False)
class StrideSolution:
    """Searches of one tuning. `fulcrum_mm`, `cost` and `stride` demand an optimum.

    Attributes:
        tracked: the recorded stride as a possible motion. sweep: the best stride at each fixed position.
        free: where each search with the fulcrum free began (mm), and how it ended.
        checks, confirmed, simulated: see `checks`. drawn: the optimum with drawn contacts.
        message: how it ended. doing: what it was at last. wall_s: that it took.
    """

    tuning: StrideTuning
    tracked: TrajectorySolution
    search: StrideSearch
    sweep: list[Fixed] = field(default_factory=list)
    free: list[tuple[float, TrajectorySolution]] = field(default_factory=list)
    checks: list[StrideCheck] = field(default_factory=list)
    confirmed: list[dict[str, Any]] = field(default_factory=list)
    simulated: dict[str, np.ndarray] = field(default_factory=dict)
    drawn: list[DrawnStride] = field(default_factory=list)
    message: str = ""
    doing: str = "tracking the recording"
    wall_s: float = 0.0

    @property
    def best(self) -> TrajectorySolution | None:
        """The best optimum with the fulcrum free; None if no search converged."""
        good = [solution for _, solution in self.free if solution.success]
        return min(good, key=lambda solution: solution.last_cost) if good else None

    @property
    def success(self) -> bool:
        """Whether there is an optimum and nothing ended the tuning before it was checked."""
        return self.best is not None and not self.message.startswith("interrupted")

    @property
    def stride(self) -> TrajectorySolution:
        """The optimal stride.

        Raises:
            FitError: there is none.
        """
        if not self.success or self.best is None:
            raise FitError(f"this tuning has no optimum: {self.message}")
        return self.best

    @property
    def stride_or_best(self) -> TrajectorySolution:
        """The optimum, for what is done with it before the tuning has ended."""
        if self.best is None:
            raise FitError(f"this tuning has no optimum: {self.message}")
        return self.best

    @property
    def cost_unit(self) -> str:
        """Costs are relative to the tracked stride's."""
        return "1"

    @property
    def fulcrum_mm(self) -> float:
        """The best position from A."""
        return float(self.stride.p[0]) / MM

    @property
    def cost(self) -> float:
        """The cost there."""
        return self.stride.cost

    @property
    def shown(self) -> TrajectorySolution:
        """The best there is, optimum or not."""
        fixed = [row.solution for row in self.sweep if row.solution is not None]
        return self.best or min(fixed, key=lambda s: s.last_cost, default=self.tracked)
