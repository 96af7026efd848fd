"""How well the best fulcrum position is known, and whether it matters.

An optimum is worth what sets it apart. Three answers, and the interval holds them all:

    trials      how far the optima of single trials are from each other
    draws       where the cost is least with contacts that the data would have allowed (`fit.draws`)
    flatness    where the cost is above its minimum by less than FLAT of its size, or, with enough
                trials, by less than can be told from zero by their paired differences (t test,
                95 %)

Trials that were walked at one setting are repetitions of each other; those of different settings
are different motions. Only repetitions tell how uncertain anything is, so that spreads are taken
within such groups.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.base.sentences import say
from vsf_drake.fit.draws import contact_draws
from vsf_drake.tuning.costs import CONSISTENCY
from vsf_drake.tuning.problem import StiffnessTuning
from vsf_drake.tuning.sweep import SettingSweep, Share, lowest, positions, sweep

FLAT = 0.01  # share of a cost's size below which a difference is none (a choice)
FEWEST_FREEDOMS = 2  # degrees of freedom from which a t test is made: with one it allows anything
CONFIDENCE = 0.975
Groups = Sequence[float | str]  # one a trial: trials of the same one repeat each other


@dataclass(frozen=True)
class Difference:
    """By how much a curve differs between the settings where it is highest and lowest."""

    range: float  # mean over groups of that difference
    spread: float | None  # standard deviation of it over repetitions; None if unknown

    def matters(self, least: float) -> bool | None:
        """Whether the range is above `least` and above the spread; None if that cannot be known."""
        if not self.range > least:
            return False
        return None if self.spread is None else self.range > self.spread


def difference(each: np.ndarray, groups: Groups) -> Difference:
    """Of curves (T, m) whose T trials belong to groups; positions where a curve is unknown do not
    count."""
    known = np.isfinite(each).all(axis=0)
    if not known.any():
        return Difference(float("nan"), None)
    ranges = []
    squares = 0.0
    for rows in _members(groups):
        own = each[rows][:, known]
        mean = own.mean(axis=0)
        pair = own[:, int(mean.argmax())] - own[:, int(mean.argmin())]
        ranges.append(float(pair.mean()))
        squares += float(np.sum((pair - pair.mean()) ** 2))
    freedoms = _freedoms(groups)
    return Difference(
        float(np.mean(ranges)), float(np.sqrt(squares / freedoms)) if freedoms else None
    )


@dataclass(frozen=True)
class Worth:
    """How well the best position is known; `uncertainty` and `matters` are of the cost's range over
    the positions."""

    interval_mm: tuple[float, float]
    interval_meaning: str  # what it holds, in words
    uncertainty: float | None
    matters: bool | None
    sentence: str


def fulcrum_uncertainty(
    swept: SettingSweep,
    fulcrum_mm: float,
    draws: Sequence[SettingSweep],
    groups: Groups,
    *,
    size: float,
    unit: str,
    allowed_bw: float,
    gain: float,
) -> Worth:
    """From the sweep of T trials of these groups, the optimum (mm), the draws and the cost's size;
    allowed_bw: change of force beyond which nobody would walk the given motion; gain: over the
    recorded settings, in sizes of the cost."""
    each = swept.per_trial
    optima = np.array([lowest(swept.fulcrum_mm, row)[0] for row in each])
    drawn = [at for at, _ in (draw.lowest() for draw in draws) if np.isfinite(at)]
    flat = flat_range(swept.fulcrum_mm, each, groups, fulcrum_mm, size)

    # The interval holds what is as good as the optimum, the optima of all draws, and the optimum
    # moved by as much as those of single trials are off the mean of their repetitions.
    apart = [
        optima[i] - optima[rows].mean() for rows in _members(groups) for i in rows if len(rows) > 1
    ]
    shifts = np.clip(fulcrum_mm + np.array(apart), swept.fulcrum_mm[0], swept.fulcrum_mm[-1])
    ends = [value for value in (fulcrum_mm, *flat, *drawn, *shifts) if np.isfinite(value)]

    # Without repetitions the draws say by how much the cost's range varies.
    width = difference(each, groups)
    by_draws = False
    if width.spread is None and len(drawn) > 1:
        ranges = [np.nanmax(draw.cost) - np.nanmin(draw.cost) for draw in draws]
        width = Difference(width.range, float(np.std(ranges, ddof=1)))
        by_draws = True
    matters = width.matters(FLAT * size)
    near, believable = swept.believable(allowed_bw)
    rest = each - swept.terms.get(CONSISTENCY, 0.0)
    meaning = say(
        "level1",
        "interval",
        flat_share=FLAT,
        flat=flat,
        repeated=_freedoms(groups) >= FEWEST_FREEDOMS,
        optima=(np.nanmin(optima), np.nanmax(optima)) if len(optima) > 1 else None,
        drawn=drawn,
    )
    worth = say(
        "level1",
        "worth",
        range=width.range,
        spread=width.spread,
        size=size,
        unit=unit,
        matters=matters,
        by_draws=by_draws,
        allowed_bw=allowed_bw,
        near=believable if near.sum() > 1 else None,
        near_range=difference(rest[:, near], groups).range,
        held=CONSISTENCY in swept.terms,
        gain=gain,
        flat_share=FLAT,
    )
    return Worth(
        (float(min(ends)), float(max(ends))), meaning[0], width.spread, matters, " ".join(worth)
    )


def flat_range(
    fulcrum_mm: np.ndarray, each: np.ndarray, groups: Groups, best_mm: float, size: float
) -> tuple[float, float]:
    """(low, high) mm around the optimum: the nearest positions at which the mean of curves (T, m)
    is known to be above its minimum, or the ends. What lies between two positions is known at
    neither."""
    excess = each - np.array([np.interp(best_mm, fulcrum_mm, row) for row in each])[:, None]
    allowed = np.full(len(fulcrum_mm), FLAT * size)
    freedoms = _freedoms(groups)
    if freedoms >= FEWEST_FREEDOMS:
        left = np.concatenate(
            [excess[rows] - excess[rows].mean(axis=0) for rows in _members(groups)]
        )
        error = np.sqrt(np.sum(left**2, axis=0) / freedoms / len(each))
        allowed = np.maximum(allowed, stdtrit(freedoms, CONFIDENCE) * error)
    at = int(np.abs(fulcrum_mm - best_mm).argmin())
    with np.errstate(invalid="ignore"):
        worse = np.flatnonzero(~(excess.mean(axis=0) <= allowed))
    low = max(worse[worse < at], default=0)
    high = min(worse[worse > at], default=len(fulcrum_mm) - 1)
    return min(float(fulcrum_mm[low]), best_mm), max(float(fulcrum_mm[high]), best_mm)


def _members(groups: Groups) -> list[list[int]]:
    return [
        [i for i, other in enumerate(groups) if other == name] for name in dict.fromkeys(groups)
    ]


def _freedoms(groups: Groups) -> int:
    return len(groups) - len(set(groups))


SPACING_MM = 10.0  # of the sweep of each draw; a parabola finds the minimum between (a choice)


def drawn_sweeps(
    tuning: StiffnessTuning, x: np.ndarray, progress: Share
) -> tuple[list[SettingSweep], list[str]]:
    """A sweep, but for the fulcrum at x (P,), for each of the options' draws that walk, and why
    others do not."""
    first = tuning.parts[0]
    if any(part.walker.model != first.walker.model for part in tuning.parts):
        return [], ["the trials' models differ, so that one draw cannot be for all"]
    values = contact_draws(
        first.walker, first.trial.subject.prosthetic_side, tuning.options.draws, tuning.options.seed
    )
    sweeps: list[SettingSweep] = []
    failed: list[str] = []
    for k, base in enumerate(values):
        try:
            sweeps.append(
                sweep(
                    tuning,
                    positions(tuning, x, SPACING_MM),
                    step_s=tuning.options.search_step_s,
                    base=base,
                )
            )
        except (InputError, SimulationError) as error:  # no stance at the trial's own setting
            failed.append(str(error))
        progress((k + 1) / len(values))
    return sweeps, failed
