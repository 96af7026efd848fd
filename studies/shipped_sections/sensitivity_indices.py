"""Morris screening and Sobol indices of any function of shares of the factors' ranges, through
SALib.

A design is points (rows, k) in the unit cube; what it gives is values (rows, outputs), NaN where
there is none. Morris' trajectories and Saltelli's blocks are whole or dropped, and counted: where
values are missing because extreme points fail, the rest says less about those.

Morris 1991 (doi 10.1080/00401706.1991.10484804), mu* of Campolongo 2007 (doi
10.1016/j.envsoft.2006.10.004); Sobol indices by the estimators of Saltelli 2010 (doi
10.1016/j.cpc.2009.09.018); SALib (doi 10.21105/joss.00097).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from SALib.analyze import morris as morris_effects
from SALib.analyze import sobol as sobol_indices
from SALib.sample import morris as morris_sample
from SALib.sample import sobol as sobol_sample

from vsf_drake.validation.sensitivity_section import Effect, Index

LEVELS = 4
"""Of Morris' grid; a trajectory then steps over two thirds of each range."""
RESAMPLES = 1000
LEAST_TRAJECTORIES, LEAST_BLOCKS = 4, 16
"""Below this many whole samples there is no result."""
_FLAT = 1e-9
"""An output that varies by less than this share of its size does not vary."""


@dataclass(frozen=True, eq=False)
class SamplingDesign:
    """Points at which a function is wanted."""

    points: np.ndarray  # (rows, k) in the unit cube
    block: int  # rows of one trajectory or of one of Saltelli's blocks
    labels: tuple[str, ...]
    """what indices are of: the factors, or their groups in the order of first appearance"""
    problem: dict[str, Any]  # the same for SALib

    def whole(self, y: np.ndarray) -> np.ndarray:
        """(rows,) whether the row belongs to a block all of whose values y (rows,) are finite."""
        return np.repeat(np.isfinite(y.reshape(-1, self.block)).all(axis=1), self.block)


def _problem(names: Sequence[str], groups: Sequence[str] | None = None) -> dict[str, Any]:
    return {
        "num_vars": len(names),
        "names": list(names),
        "bounds": [[0.0, 1.0]] * len(names),
        "groups": groups and list(groups),
    }


def morris_design(names: Sequence[str], trajectories: int, seed: int) -> SamplingDesign:
    """Trajectories that move every factor once; k + 1 points each."""
    problem = _problem(names)
    return SamplingDesign(
        morris_sample.sample(problem, trajectories, num_levels=LEVELS, seed=_seed(seed)),
        len(names) + 1,
        tuple(names),
        problem,
    )


def sobol_design(
    names: Sequence[str], samples: int, seed: int, *, groups: Sequence[str] | None = None
) -> SamplingDesign:
    """`samples` (a power of two) of Saltelli's blocks of k + 2 points, groups + 2 where indices are
    of the factors' groups, on a scrambled Sobol sequence."""
    problem = _problem(names, groups)
    labels = tuple(dict.fromkeys(groups or names))
    points = sobol_sample.sample(problem, samples, calc_second_order=False, seed=_seed(seed))
    return SamplingDesign(points, len(labels) + 2, labels, problem)


def morris_rows(design: SamplingDesign, y: np.ndarray, seed: int) -> tuple[Effect, ...] | None:
    """Elementary effects of one output y (rows,) by factor, in y's unit. None of too few whole
    trajectories."""
    whole = design.whole(y)
    if np.count_nonzero(whole) < LEAST_TRAJECTORIES * design.block:
        return None
    effects = morris_effects.analyze(
        design.problem,
        design.points[whole],
        y[whole],
        num_resamples=RESAMPLES,
        num_levels=LEVELS,
        seed=_seed(seed),
    )
    keys = ("mu", "mu_star", "mu_star_conf", "sigma")
    return tuple(
        Effect(name=name, **{key: float(effects[key][i]) for key in keys})
        for i, name in enumerate(design.labels)
    )


def sobol_rows(design: SamplingDesign, y: np.ndarray, seed: int) -> tuple[Index, ...] | None:
    """Shares of the variance of one output y (rows,), by factor or group. None of too few whole
    blocks or of a constant output."""
    whole = design.whole(y)
    if (
        np.count_nonzero(whole) < LEAST_BLOCKS * design.block
        or np.ptp(y[whole]) <= _FLAT * np.abs(y[whole]).max()
    ):
        return None
    indices = sobol_indices.analyze(
        design.problem, y[whole], calc_second_order=False, num_resamples=RESAMPLES, seed=_seed(seed)
    )
    keys = {"s1": "S1", "s1_conf": "S1_conf", "st": "ST", "st_conf": "ST_conf"}
    return tuple(
        Index(name=name, **{own: float(indices[key][i]) for own, key in keys.items()})
        for i, name in enumerate(design.labels)
    )


def dropped(design: SamplingDesign, y: np.ndarray) -> int:
    """How many blocks were dropped."""
    return int(np.count_nonzero(~design.whole(y))) // design.block


def _seed(seed: int) -> int:
    """SALib takes a seed of 0 for none."""
    return seed + 1
