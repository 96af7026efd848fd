"""What is read off the walked designs of the sensitivity study, by output."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from vsf_drake.analysis.validation.sensitivity.screening import Design, dropped, sobol_rows
from vsf_drake.analysis.validation.sensitivity.walks import OUTPUTS

PERCENTILES = (5, 50, 95)


@dataclass(frozen=True, eq=False)
class Walked:
    """A design and `values` (rows, trials, len(OUTPUTS)) at its points, NaN where unknown."""

    design: Design
    values: np.ndarray

    def of(self, output: int) -> np.ndarray:
        """(rows,) mean of an output over the trials."""
        return np.asarray(self.values[:, :, output].mean(axis=1))

    def independent(self, output: int) -> np.ndarray:
        """(n,) an output at the independent points of Saltelli's design: the first and the last of each whole block."""
        y = self.of(output)
        return y[self.design.whole(y)].reshape(-1, self.design.block)[:, [0, -1]].ravel()


def index_rows(walked: Walked | None, seed: int) -> dict[str, list[dict[str, Any]] | None]:
    """Sobol indices by output."""
    return {name: None if walked is None else sobol_rows(walked.design, walked.of(i), seed)
            for i, name in enumerate(OUTPUTS)}


def interaction(rows: Sequence[Mapping[str, Any]] | None) -> tuple[float | None, float | None]:
    """Share of the variance that no index of first order has, and half of its 95 % interval (as if they erred
    independently)."""
    if rows is None:
        return None, None
    return 1.0 - sum(row["s1"] for row in rows), float(np.linalg.norm([row["s1_conf"] for row in rows]))


def spread(walked: Walked | None, output: int) -> dict[str, float] | None:
    """Mean, standard deviation and PERCENTILES of an output over the uncertainty."""
    y = np.empty(0) if walked is None else walked.independent(output)
    if len(y) < 2:
        return None
    return {"mean": float(y.mean()), "sd": float(y.std(ddof=1)),
            **{f"p{p:02d}": float(np.percentile(y, p)) for p in PERCENTILES}}


def explained(every: Walked | None, few: Walked | None, output: int) -> float | None:
    """Variance with a few factors varied over that with every one varied."""
    if every is None or few is None:
        return None
    both = [walked.independent(output) for walked in (every, few)]
    return float(both[1].var() / both[0].var()) if min(map(len, both)) > 1 and both[0].var() > 0.0 else None


def stability(by_condition: Sequence[Sequence[float] | None]) -> float | None:
    """The lowest rank correlation of mu* between two conditions; None of fewer than two."""
    some = [effects for effects in by_condition if effects is not None]
    pairs = [spearmanr(some[i], some[j]).statistic for i in range(len(some)) for j in range(i)]
    return known(min(pairs)) if pairs else None


def agreement(sizes: Sequence[float] | None, local: np.ndarray | None) -> float | None:
    """Rank correlation of mu* and what another way says."""
    return None if sizes is None or local is None else known(spearmanr(sizes, local).statistic)


def dropped_samples(*walked: Walked | None) -> dict[str, dict[str, int | None]]:
    """By output, how many trajectories, blocks for groups and blocks for factors were dropped; None of no design."""
    names = ("trajectories", "group_blocks", "factor_blocks")
    return {output: {name: None if part is None else dropped(part.design, part.of(i))
                     for name, part in zip(names, walked, strict=True)} for i, output in enumerate(OUTPUTS)}


def known(value: float) -> float | None:
    """The value, or None if it is not finite."""
    return float(value) if np.isfinite(value) else None
