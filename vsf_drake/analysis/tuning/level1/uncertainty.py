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
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from vsf_drake.analysis.contact_fit.parameters import REFERENCE_DEPTH_M, standard_parameters
from vsf_drake.analysis.contact_fit.solve import SURE_SHARE
from vsf_drake.analysis.tuning.level1.costs import CONSISTENCY
from vsf_drake.analysis.tuning.level1.problem import StiffnessTuning
from vsf_drake.analysis.tuning.level1.sweep import Sweep, lowest, positions, sweep
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.simulation.walk import Walker

FLAT = 0.01
"""Share of a cost's size below which a difference is none (a choice)."""
FEWEST_FREEDOMS = 2
"""Degrees of freedom from which a t test is made: with one it allows anything."""
CONFIDENCE = 0.975


@dataclass(frozen=True)
class FulcrumUncertainty:
    """Of the best fulcrum position.

    Attributes:
        low_mm, high_mm: the interval.
        per_trial_mm, draws_mm: optima by trial and by draw. flat_mm: (low, high) of what is as good as the optimum.
        range, spread, matters: of the cost, see `Difference`.
        meaning, sentence: in words, what the interval holds and whether the setting matters.
    """

    low_mm: float
    high_mm: float
    per_trial_mm: tuple[float, ...]
    draws_mm: tuple[float, ...]
    flat_mm: tuple[float, float]
    range: float
    spread: float | None
    matters: bool | None
    meaning: str
    sentence: str


@dataclass(frozen=True)
class Difference:
    """By how much a curve differs between the settings where it is highest and lowest.

    Attributes:
        range: mean over groups of that difference. spread: standard deviation of it over repetitions; None if unknown.
    """

    range: float
    spread: float | None

    def matters(self, size: float) -> bool | None:
        """Whether the range is above FLAT of `size` and above the spread; None if that cannot be known."""
        if not self.range > FLAT * size:
            return False
        return None if self.spread is None else self.range > self.spread


def difference(each: np.ndarray, groups: Sequence) -> Difference:
    """Of curves (T, m) whose T trials belong to groups; positions where a curve is unknown do not count."""
    known = np.isfinite(each).all(axis=0)
    if not known.any():
        return Difference(float("nan"), None)
    ranges, squares, freedoms = [], 0.0, 0
    for rows in _members(groups):
        own = each[rows][:, known]
        mean = own.mean(axis=0)
        pair = own[:, int(mean.argmax())] - own[:, int(mean.argmin())]
        ranges.append(float(pair.mean()))
        squares, freedoms = squares + float(np.sum((pair - pair.mean()) ** 2)), freedoms + len(rows) - 1
    return Difference(float(np.mean(ranges)), float(np.sqrt(squares / freedoms)) if freedoms else None)


def fulcrum_uncertainty(
    found: Sweep, fulcrum_mm: float, draws: tuple[Draw, ...], groups: Sequence, *, size: float, unit: str,
    allowed_bw: float, gain: float
) -> FulcrumUncertainty:
    """From the sweep of T trials of these groups, the optimum (mm), the draws and the cost's size.

    Args:
        allowed_bw: change of force (body weights) beyond which nobody would walk the given motion.
        gain: by how much the optimum is better than the recorded settings, in sizes of the cost.
    """
    each = found.per_trial
    optima = np.array([lowest(found.fulcrum_mm, row)[0] for row in each])
    drawn = tuple(draw.fulcrum_mm for draw in draws if np.isfinite(draw.fulcrum_mm))
    flat = flat_range(found.fulcrum_mm, each, groups, fulcrum_mm, size)
    apart = [optima[i] - optima[rows].mean() for rows in _members(groups) for i in rows if len(rows) > 1]
    shifts = np.clip(fulcrum_mm + np.array(apart), found.fulcrum_mm[0], found.fulcrum_mm[-1])
    width, of = difference(each, groups), ""
    if width.spread is None and len(drawn) > 1:
        ranges = [np.nanmax(draw.sweep.cost) - np.nanmin(draw.sweep.cost) for draw in draws]
        width, of = Difference(width.range, float(np.std(ranges, ddof=1))), "from draw to draw of the contact"
    parts = [f"as good within {FLAT:.0%} of the cost's size"
             + (" or what repeated trials can tell" if _freedoms(groups) >= FEWEST_FREEDOMS else "")
             + f": {flat[0]:.0f} to {flat[1]:.0f} mm"]
    if len(optima) > 1:
        parts.append(f"single trials are best from {np.nanmin(optima):.0f} to {np.nanmax(optima):.0f} mm")
    if drawn:
        parts.append(f"{len(drawn)} draws of the contact from {min(drawn):.0f} to {max(drawn):.0f} mm")
    ends = [value for value in (fulcrum_mm, *flat, *drawn, *shifts) if np.isfinite(value)]
    matters = width.matters(size)
    return FulcrumUncertainty(
        low_mm=float(min(ends)), high_mm=float(max(ends)), per_trial_mm=tuple(map(float, optima)), draws_mm=drawn,
        flat_mm=flat, range=width.range, spread=width.spread, matters=matters, meaning="; ".join(parts),
        sentence=" ".join([_sentence(width, size, unit, matters, of or "from trial to trial"),
                           *_near(found, groups, size, allowed_bw), _gain(gain)]))


def flat_range(
    fulcrum_mm: np.ndarray, each: np.ndarray, groups: Sequence, best_mm: float, size: float
) -> tuple[float, float]:
    """(low, high) mm around the optimum where the mean of curves (T, m) cannot be told from its minimum."""
    excess = each - np.array([np.interp(best_mm, fulcrum_mm, row) for row in each])[:, None]
    allowed = np.full(len(fulcrum_mm), FLAT * size)
    freedoms = _freedoms(groups)
    if freedoms >= FEWEST_FREEDOMS:
        left = np.concatenate([excess[rows] - excess[rows].mean(axis=0) for rows in _members(groups)])
        error = np.sqrt(np.sum(left**2, axis=0) / freedoms / len(each))
        allowed = np.maximum(allowed, student.ppf(CONFIDENCE, freedoms) * error)
    with np.errstate(invalid="ignore"):
        same = excess.mean(axis=0) <= allowed
    at = int(np.abs(fulcrum_mm - best_mm).argmin())
    ends = []
    for way in (-1, 1):
        j = at
        while 0 <= j + way < len(same) and same[j + way]:
            j += way
        ends.append(float(fulcrum_mm[j]))
    return min(ends[0], best_mm), max(ends[1], best_mm)


def _members(groups: Sequence) -> list[list[int]]:
    return [[i for i, other in enumerate(groups) if other == name] for name in dict.fromkeys(groups)]


def _freedoms(groups: Sequence) -> int:
    return len(groups) - len(set(groups))


def _near(found: Sweep, groups: Sequence, size: float, allowed_bw: float) -> list[str]:
    """A sentence on the cost where the given motion can be believed; nothing if that is at most one position."""
    near = found.believable(allowed_bw)
    if near.sum() < 2:
        return []
    low, high = found.fulcrum_mm[near][[0, -1]]
    rest = found.per_trial - found.terms.get(CONSISTENCY, 0.0)
    width = difference(rest[:, near], groups).range
    apart = " without the part of the force's change" if CONSISTENCY in found.terms else ""
    return [f"Where the force stays within {allowed_bw:.0%} body weight of that at the recorded setting, from "
            f"{low:.0f} to {high:.0f} mm, the cost{apart} varies by {width / size:.1%} of its size."]


def _gain(gain: float) -> str:
    if gain < 0.0:
        return f"Against the recorded settings, each trial at its own, the best one for all loses {-gain:.1%}."
    told = f"Against the recorded setting the best one gains {gain:.1%}"
    return f"{told}." if gain > FLAT else f"{told}, which is next to nothing."


def _sentence(width: Difference, size: float, unit: str, matters: bool | None, of: str) -> str:
    unit = "" if unit == "1" else f" {unit}"
    told = (f"From the best to the worst position the cost changes by {width.range:.3g}{unit}, "
            f"{width.range / size:.0%} of its size")
    if width.spread is not None:
        told += f"; {of} that varies by {width.spread:.2g}{unit}"
    if matters is None:
        return f"{told}; one trial does not tell whether that is more than chance."
    return f"{told}: the setting {'matters' if matters else 'hardly matters to this cost'}."


# Other contacts that the data would have allowed as well, drawn around the one that walks.
#
# A contact file holds values, no covariance. What is drawn is half of what was believed before the fit, which is where
# the fit itself begins to call a parameter told by the data (`contact_fit.solve.SURE_SHARE`): so the spread is
# that of parameters that are just identified; of those that the data say nothing about it is too small. Geometry
# (offsets, joint angles) is not drawn: the force fixes it, and a draw alone would lift the foot off the ground.


SPACING_MM = 10.0
"""Of the sweep of each draw; a parabola finds the minimum between (a choice)."""


@dataclass(frozen=True)
class Draw:
    """One draw: the values it changed, where its cost is least and how much that is, and its sweep.

    NaN if every walk of the sweep fails.
    """

    values: dict[str, float]
    fulcrum_mm: float
    cost: float
    sweep: Sweep


def contact_draws(walker: Walker, side: str, count: int, seed: int) -> list[dict[str, float]]:
    """`count` sets of walk values: force and exponent of each zone's law, damping, friction, keel and support."""
    spread = {item.name: item.scale for item in standard_parameters(walker.variables, side, ()).items}
    own = {name: variable.default for name, variable in walker.variables.items()}
    zones = [name.split(".")[1] for name in own if name.startswith("contact.") and name.endswith(".stiffness")]
    plain = [name for name in ("keel.flexural_modulus", "fulcrum.stiffness", "friction.mu_static",
                               "friction.mu_kinetic", "friction.threshold_velocity") if name in spread]
    rng = np.random.default_rng([seed, 7])
    found = []
    for _ in range(count):
        values, slower = {}, math.exp(SURE_SHARE * spread["contact.damping_time"] * rng.standard_normal())
        for zone in zones:
            k, n, b = (own[f"contact.{zone}.{name}"] for name in ("stiffness", "exponent", "damping"))
            force = math.exp(SURE_SHARE * spread[f"contact.{zone}.force"] * rng.standard_normal())
            exponent = n + SURE_SHARE * spread[f"contact.{zone}.exponent"] * rng.standard_normal()
            exponent = min(max(exponent, min(n, 1.0)), max(n, 2.0))
            values[f"contact.{zone}.stiffness"] = force * k * REFERENCE_DEPTH_M ** (n - exponent)
            values[f"contact.{zone}.exponent"] = exponent
            values[f"contact.{zone}.damping"] = slower * force * b
        for name in plain:
            values[name] = own[name] * math.exp(SURE_SHARE * spread[name] * rng.standard_normal())
        found.append(values)
    return found


def drawn_optima(
    tuning: StiffnessTuning, x: np.ndarray, progress: Callable[[float], None] | None = None
) -> tuple[tuple[Draw, ...], tuple[str, ...]]:
    """The fulcrum with the least cost for each of the options' draws, the rest of the setting as in x (P,).

    Returns:
        The draws that walk, and why others do not.
    """
    first = tuning.parts[0]
    if any(part.walker.model != first.walker.model for part in tuning.parts):
        return (), ("the trials' models differ, so that one draw cannot be for all",)
    values = contact_draws(first.walker, first.trial.subject.prosthetic_side, tuning.options.draws, tuning.options.seed)
    grid = positions(tuning, SPACING_MM)
    found: list[Draw] = []
    failed: list[str] = []
    for k, base in enumerate(values):
        try:
            swept = sweep(tuning, grid, x, step_s=tuning.options.search_step_s, base=base)
        except (InputError, SimulationError) as error:  # no stance at the trial's own setting
            failed.append(str(error))
        else:
            found.append(Draw(base, *lowest(swept.fulcrum_mm, swept.cost), swept))
        if progress:
            progress((k + 1) / len(values))
    return tuple(found), tuple(failed)
