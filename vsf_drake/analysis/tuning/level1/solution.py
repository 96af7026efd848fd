"""What a tuning found, and the way to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.level1.checks import Check
from vsf_drake.analysis.tuning.level1.draws import Draw
from vsf_drake.analysis.tuning.level1.problem import Evaluation, StiffnessTuning
from vsf_drake.analysis.tuning.level1.search import Search
from vsf_drake.analysis.tuning.level1.settings import Setting
from vsf_drake.analysis.tuning.level1.sweep import Sweep
from vsf_drake.analysis.tuning.level1.tasks import Compromise, Task
from vsf_drake.analysis.tuning.level1.uncertainty import FulcrumUncertainty
from vsf_drake.errors import FitError

AT_BOUND = 1e-3
"""Share of a bound's width within which a variable counts as on the bound."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TuningSolution:
    """The end of a tuning. Reading `values`, `fulcrum_mm` or `cost` of one that failed raises FitError.

    What had not been reached when a tuning was interrupted is empty or None.

    Attributes:
        tuning: the problem.
        success: whether a search ended at a minimum that the sweep confirms and at which all walks converged.
        message: how it ended, in words.
        best: the best point found, whatever `success` says.
        searched: the search that `best` is from. searches: of the fulcrum's range. confirmed: by other solvers.
        coarse, sweep: the sweep that searches began from, and the fine one through the best setting.
        settings: what walks are like at the softest, best, stiffest and recorded setting.
        same_load: outcomes of `same_load` by name, (T, 4) at those settings.
        uncertainty: of the fulcrum position. draws: of the contact, and draw_failures: why some could not be walked.
        tasks, pareto, robustness: see `tasks`; robustness rows are (what, mm, cost).
        checks: what the solution was held against.
        notes: what a reader has to know. wall_s: of the whole.
    """

    tuning: StiffnessTuning
    success: bool
    message: str
    best: Evaluation
    searched: Search | None
    searches: tuple[Search, ...]
    confirmed: tuple[Search, ...]
    coarse: Sweep | None
    sweep: Sweep | None
    settings: tuple[Setting, ...]
    same_load: dict[str, np.ndarray]
    uncertainty: FulcrumUncertainty | None
    draws: tuple[Draw, ...]
    draw_failures: tuple[str, ...]
    tasks: tuple[Task, ...]
    pareto: tuple[Compromise, ...]
    robustness: tuple[tuple[str, float, float], ...]
    checks: tuple[Check, ...]
    notes: tuple[str, ...]
    wall_s: float

    def check(self) -> None:
        """Raises FitError if the tuning failed."""
        if not self.success:
            raise FitError(f"the tuning did not come to an optimum: {self.message}")

    @property
    def values(self) -> dict[str, float]:
        """What was tuned, by name, in the units of `tuning.design`. Raises FitError if the tuning failed."""
        self.check()
        return {variable.name: float(x) for variable, x in zip(self.tuning.design, self.best.x, strict=True)}

    @property
    def fulcrum_mm(self) -> float:
        """Of the best setting, from A. Raises FitError if the tuning failed."""
        self.check()
        return float(self.best.x[0])

    @property
    def cost(self) -> float:
        """Of the best setting, in the cost's unit. Raises FitError if the tuning failed."""
        self.check()
        return self.best.cost

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Names of what ended on a bound, whether the tuning failed or not."""
        u = self.tuning.to_u(self.best.x)
        return tuple(variable.name for variable, at in zip(self.tuning.design, u, strict=True)
                     if at < AT_BOUND or at > 1.0 - AT_BOUND)
