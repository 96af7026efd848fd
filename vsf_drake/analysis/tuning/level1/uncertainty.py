"""How well the best fulcrum position is known, and whether it matters.

An optimum is worth what sets it apart. Three answers, and the interval holds them all:

    trials      how far the optima of single trials are from each other
    draws       where the cost is least with other contacts that the data would have allowed (below)
    flatness    where the cost is above its minimum by less than FLAT of its size, or, with enough trials, by less than
                can be told from zero by their paired differences (t test, 95 %)

Trials that were walked at one setting are repetitions of each other; those of different settings are different motions.
Only repetitions tell how uncertain anything is, so that spreads are taken within such groups.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from vsf_drake.analysis.contact_fit.parameters import REFERENCE_DEPTH_M, standard_parameters
from vsf_drake.analysis.contact_fit.solve import SURE_SHARE
from vsf_drake.analysis.tuning.level1.costs import CONSISTENCY
from vsf_drake.analysis.tuning.level1.problem import StiffnessTuning
from vsf_drake.analysis.tuning.level1.sweep import SettingSweep, Share, lowest, positions, sweep
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.sentences import say
from vsf_drake.simulation.walk import Walker

FLAT = 0.01  # share of a cost's size below which a difference is none (a choice)
FEWEST_FREEDOMS = 2  # degrees of freedom from which a t test is made: with one it allows anything
CONFIDENCE = 0.975
Groups = Sequence[float | str]  # one a trial: trials of the same one repeat each other


@dataclass(frozen=True)
class Difference:
    """By how much a curve differs between the settings where it is highest and lowest."""

    range: float  # mean over groups of that difference
    spread: float | None  # standard deviation of it over repetitions; None if unknown

    def matters(self, size: float) -> bool | None:
        """Whether the range is above FLAT of `size` and above the spread; None if that cannot be known."""
        if not self.range > FLAT * size:
            return False
        return None if self.spread is None else self.range > self.spread


def difference(each: np.ndarray, groups: Groups) -> Difference:
    """Of curves (T, m) whose T trials belong to groups; positions where a curve is unknown do not count."""
    known = np.isfinite(each).all(axis=0)
    if not known.any():
        return Difference(float("nan"), None)
    ranges, squares = [], 0.0
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
    """How well the best position is known; `uncertainty` and `matters` are of the cost's range over the positions."""

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
    """From the sweep of T trials of these groups, the optimum (mm), the draws and the cost's size; allowed_bw: change
    of force beyond which nobody would walk the given motion; gain: over the recorded settings, in sizes of the cost."""
    each = swept.per_trial
    optima = np.array([lowest(swept.fulcrum_mm, row)[0] for row in each])
    drawn = [at for at, _ in (draw.lowest() for draw in draws) if np.isfinite(at)]
    flat = flat_range(swept.fulcrum_mm, each, groups, fulcrum_mm, size)

    # The interval holds what is as good as the optimum, the optima of all draws, and the optimum moved by as much as
    # those of single trials are off the mean of their repetitions.
    apart = [
        optima[i] - optima[rows].mean() for rows in _members(groups) for i in rows if len(rows) > 1
    ]
    shifts = np.clip(fulcrum_mm + np.array(apart), swept.fulcrum_mm[0], swept.fulcrum_mm[-1])
    ends = [value for value in (fulcrum_mm, *flat, *drawn, *shifts) if np.isfinite(value)]

    # Without repetitions the draws say by how much the cost's range varies.
    width, by_draws = difference(each, groups), False
    if width.spread is None and len(drawn) > 1:
        ranges = [np.nanmax(draw.cost) - np.nanmin(draw.cost) for draw in draws]
        width, by_draws = Difference(width.range, float(np.std(ranges, ddof=1))), True
    matters = width.matters(size)
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
    """(low, high) mm around the optimum where the mean of curves (T, m) cannot be told from its minimum."""
    excess = each - np.array([np.interp(best_mm, fulcrum_mm, row) for row in each])[:, None]
    allowed = np.full(len(fulcrum_mm), FLAT * size)
    freedoms = _freedoms(groups)
    if freedoms >= FEWEST_FREEDOMS:
        left = np.concatenate(
            [excess[rows] - excess[rows].mean(axis=0) for rows in _members(groups)]
        )
        error = np.sqrt(np.sum(left**2, axis=0) / freedoms / len(each))
        allowed = np.maximum(allowed, student.ppf(CONFIDENCE, freedoms) * error)
    at = int(np.abs(fulcrum_mm - best_mm).argmin())
    with np.errstate(invalid="ignore"):
        worse = np.flatnonzero(~(excess.mean(axis=0) <= allowed))
    low = max(worse[worse < at], default=-1) + 1
    high = min(worse[worse > at], default=len(fulcrum_mm)) - 1
    return min(float(fulcrum_mm[low]), best_mm), max(float(fulcrum_mm[high]), best_mm)


def _members(groups: Groups) -> list[list[int]]:
    return [
        [i for i, other in enumerate(groups) if other == name] for name in dict.fromkeys(groups)
    ]


def _freedoms(groups: Groups) -> int:
    return len(groups) - len(set(groups))


# Other contacts that the data would have allowed as well, drawn around the one that walks.
#
# A contact file holds values, no covariance. What is drawn is half of what was believed before the fit, which is where
# the fit itself begins to call a parameter told by the data (`contact_fit.solve.SURE_SHARE`): so the spread is
# that of parameters that are just identified; of those that the data say nothing about it is too small. Geometry
# (offsets, joint angles) is not drawn: the force fixes it, and a draw alone would lift the foot off the ground.


SPACING_MM = 10.0  # of the sweep of each draw; a parabola finds the minimum between (a choice)


def contact_draws(walker: Walker, side: str, count: int, seed: int) -> list[dict[str, float]]:
    """`count` sets of walk values: force and exponent of each zone's law, damping, friction, keel and support."""
    spread = {
        item.name: SURE_SHARE * item.scale
        for item in standard_parameters(walker.variables, side, ()).items
    }
    own = {name: variable.default for name, variable in walker.variables.items()}
    zones = [
        name.split(".")[1]
        for name in own
        if name.startswith("contact.") and name.endswith(".stiffness")
    ]
    plain = [
        name
        for name in (
            "keel.flexural_modulus",
            "fulcrum.stiffness",
            "friction.mu_static",
            "friction.mu_kinetic",
            "friction.threshold_velocity",
        )
        if name in spread
    ]
    rng = np.random.default_rng([seed, 7])

    def factor(name: str) -> float:
        return math.exp(spread[name] * rng.standard_normal())

    sets: list[dict[str, float]] = []
    for _ in range(count):
        values: dict[str, float] = {}
        slower = factor("contact.damping_time")
        for zone in zones:
            # F = k d^n with drawn F and n has at the reference depth d_0 the force: k' = f k d_0^(n - n')
            k, n, b = (
                own[f"contact.{zone}.{name}"] for name in ("stiffness", "exponent", "damping")
            )
            force = factor(f"contact.{zone}.force")
            exponent = n + spread[f"contact.{zone}.exponent"] * rng.standard_normal()
            exponent = min(max(exponent, min(n, 1.0)), max(n, 2.0))
            values[f"contact.{zone}.stiffness"] = force * k * REFERENCE_DEPTH_M ** (n - exponent)
            values[f"contact.{zone}.exponent"] = exponent
            values[f"contact.{zone}.damping"] = slower * force * b
        sets.append(values | {name: own[name] * factor(name) for name in plain})
    return sets


def drawn_sweeps(
    tuning: StiffnessTuning, x: np.ndarray, progress: Share
) -> tuple[list[SettingSweep], list[str]]:
    """A sweep, but for the fulcrum at x (P,), for each of the options' draws that walk, and why others do not."""
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
