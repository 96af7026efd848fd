"""Morris screening and Sobol indices of any function of shares of the factors' ranges, through SALib.

A design is points (rows, k) in the unit cube; what it gives is values (rows, outputs), NaN where there is none. Morris'
trajectories and Saltelli's blocks are whole or dropped: each is a sample of its own, so that dropping one removes
information but shifts no other. Dropping is not blind to the cause: where values are missing because
the extreme points fail, the rest says less about those. The counts are therefore part of what comes out.

Morris 1991 (doi 10.1080/00401706.1991.10484804), mu* of Campolongo 2007 (doi 10.1016/j.envsoft.2006.10.004); Sobol
indices by the estimators of Saltelli 2010 (doi 10.1016/j.cpc.2009.09.018); SALib (doi 10.21105/joss.00097).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

LEVELS = 4
"""Of Morris' grid; a trajectory then steps over two thirds of each range."""
RESAMPLES = 1000
LEAST_TRAJECTORIES, LEAST_BLOCKS = 4, 16
"""Below this many whole samples there is no result."""
_FLAT = 1e-9
"""An output that varies by less than this share of its size does not vary."""


@dataclass(frozen=True, eq=False)
class Design:
    """Points at which a function is wanted.

    Attributes:
        points: (rows, k) in the unit cube. block: rows of one trajectory or of one of Saltelli's blocks.
        names: of the k factors. groups: of each factor its group, where indices are of groups; else None.
    """

    points: np.ndarray
    block: int
    names: tuple[str, ...]
    groups: tuple[str, ...] | None = None

    @property
    def labels(self) -> tuple[str, ...]:
        """What indices are of: the factors, or the groups in the order in which they first appear."""
        return self.names if self.groups is None else tuple(dict.fromkeys(self.groups))

    @property
    def problem(self) -> dict[str, Any]:
        """The same for SALib."""
        return {"num_vars": len(self.names), "names": list(self.names), "bounds": [[0.0, 1.0]] * len(self.names),
                "groups": None if self.groups is None else list(self.groups)}

    def whole(self, y: np.ndarray) -> np.ndarray:
        """(rows,) whether the row belongs to a block all of whose values y (rows,) are finite."""
        return np.repeat(np.isfinite(y.reshape(-1, self.block)).all(axis=1), self.block)


def morris_design(names: Sequence[str], trajectories: int, seed: int) -> Design:
    """Trajectories that move every factor once; k + 1 points each."""
    from SALib.sample import morris  # noqa: PLC0415 (it takes half a second to import)

    problem = Design(np.zeros((0, len(names))), 1, tuple(names)).problem
    return Design(morris.sample(problem, trajectories, num_levels=LEVELS, seed=_seed(seed)), len(names) + 1,
                  tuple(names))


def sobol_design(names: Sequence[str], samples: int, seed: int, *, groups: Sequence[str] | None = None) -> Design:
    """Saltelli's blocks of k + 2 points (groups + 2 where indices are of groups) on a scrambled Sobol sequence.

    Args:
        samples: blocks, a power of two.
    """
    from SALib.sample import sobol  # noqa: PLC0415

    empty = Design(np.zeros((0, len(names))), 1, tuple(names), None if groups is None else tuple(groups))
    points = sobol.sample(empty.problem, samples, calc_second_order=False, seed=_seed(seed))
    return Design(points, len(empty.labels) + 2, empty.names, empty.groups)


def morris_rows(design: Design, y: np.ndarray, seed: int) -> list[dict[str, Any]] | None:
    """Elementary effects of one output over the whole of each range, by factor; None of too few whole trajectories.

    Args:
        y: (rows,) of the design, NaN where unknown.

    Returns:
        Rows with name, mu, mu_star, mu_star_conf (half of the 95 % bootstrap interval), sigma; all in y's unit.
    """
    from SALib.analyze import morris  # noqa: PLC0415

    kept = design.whole(y)
    if np.count_nonzero(kept) < LEAST_TRAJECTORIES * design.block:
        return None
    found = morris.analyze(design.problem, design.points[kept], y[kept], num_resamples=RESAMPLES, num_levels=LEVELS,
                           seed=_seed(seed))
    return _rows(design.names, found, {"mu": "mu", "mu_star": "mu_star", "mu_star_conf": "mu_star_conf",
                                       "sigma": "sigma"})


def sobol_rows(design: Design, y: np.ndarray, seed: int) -> list[dict[str, Any]] | None:
    """Shares of the variance of one output, by factor or group; None of too few whole blocks or of a constant output.

    Args:
        y: (rows,) of the design, NaN where unknown.

    Returns:
        Rows with name, s1, s1_conf, st, st_conf (first-order and total index, half of the 95 % bootstrap
        intervals), s1_wide and st_wide: whether the interval is wider than the index.
    """
    from SALib.analyze import sobol  # noqa: PLC0415

    kept = design.whole(y)
    if np.count_nonzero(kept) < LEAST_BLOCKS * design.block or np.ptp(y[kept]) <= _FLAT * np.abs(y[kept]).max():
        return None
    found = sobol.analyze(design.problem, y[kept], calc_second_order=False, num_resamples=RESAMPLES, seed=_seed(seed))
    rows = _rows(design.labels, found, {"s1": "S1", "s1_conf": "S1_conf", "st": "ST", "st_conf": "ST_conf"})
    for row in rows:
        row |= {f"{index}_wide": bool(2.0 * row[f"{index}_conf"] > row[index]) for index in ("s1", "st")}
    return rows


def dropped(design: Design, y: np.ndarray) -> int:
    """How many blocks were dropped."""
    return int(np.count_nonzero(~design.whole(y))) // design.block


def ranked(rows: Sequence[Mapping[str, Any]] | None, key: str) -> list[str]:
    """Names by falling value of `key`."""
    return [row["name"] for row in sorted(rows or (), key=lambda row: -row[key])]


def _rows(names: Sequence[str], found: Mapping[str, Any], keys: Mapping[str, str]) -> list[dict[str, Any]]:
    return [{"name": name} | {own: float(found[theirs][i]) for own, theirs in keys.items()}
            for i, name in enumerate(names)]


def _seed(seed: int) -> int:
    """SALib takes a seed of 0 for none."""
    return seed + 1
