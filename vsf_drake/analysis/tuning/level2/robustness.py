"""The best stride with other contacts that the data would have allowed as well."""

from __future__ import annotations

import dataclasses

import numpy as np

from vsf_drake.analysis.tuning.level1.draws import contact_draws
from vsf_drake.analysis.tuning.level2.outcomes import outcomes
from vsf_drake.analysis.tuning.level2.search import Progress, StrideSearch
from vsf_drake.analysis.tuning.level2.solution import DrawnStride, StrideSolution
from vsf_drake.analysis.tuning.level2.stride import MM
from vsf_drake.simulation.sagittal.model import SagittalModel


def drawn_strides(found: StrideSolution, progress: Progress | None) -> list[DrawnStride]:
    """Searches again from the optimum with each of the options' draws (see `level1.draws` for what is drawn)."""
    tuning, search, best = found.tuning, found.search, found.stride_or_best
    drawn = contact_draws(tuning.walker, tuning.trial.subject.prosthetic_side, tuning.options.draws,
                          tuning.options.seed)
    rows = []
    for i, values in enumerate(drawn):
        model = SagittalModel(tuning.walker, offsets=tuning.trial.offsets, values=values)
        other = StrideSearch(dataclasses.replace(tuning.stride, model=model), search.grid, search.smoothing,
                             search.cost, search.sizes, progress)
        solution = other.free(best.last, f"drawn contact {i + 1} of {len(drawn)}", i / len(drawn))
        if solution.status == "interrupted":
            raise KeyboardInterrupt
        good = solution.success
        rows.append(DrawnStride(
            f"drawn contact {i + 1}", float(solution.last.p[0]) / MM if good else float("nan"),
            solution.last_cost if good else float("nan"), outcomes(solution, other.costs) if good else {}))
    return rows


def spread(rows: list[DrawnStride], name: str) -> float | None:
    """Standard deviation of an outcome over the draws; None of fewer than two."""
    known = [row.outcomes[name] for row in rows if name in row.outcomes]
    return float(np.std(known, ddof=1)) if len(known) > 1 else None
