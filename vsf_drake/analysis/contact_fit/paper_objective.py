"""The objective of the paper's contact fit, and the stiffness from which it starts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.stats import truncnorm

from vsf_drake.analysis.comparison import Comparison, compare
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.variables import Variable, check_values
from vsf_drake.simulation.walk import Walker

SOFTEST_N_PER_MM, STIFFEST_N_PER_MM, RAISE = 0.1, 1000.0, 1.1
"""Stiffness of one sphere at which the search for the initial guess begins and gives up, and the ratio of two of its
steps (choices): 24 spheres of the softest carry 70 N at 30 mm, the thickness of the foam."""


@dataclass(frozen=True)
class Score:
    """What one scenario came to.

    Attributes:
        objective_n2: infinite if a walk failed.
        simulations: walks that were run.
        error: of the walk that failed, which is the last of them.
    """

    objective_n2: float
    simulations: int
    error: SimulationError | None = None


class PaperObjective:
    """Sum of squared differences (N²) of the resultant ground reaction force, of one or several trials.

    Resultants are lengths of the vectors low-passed at 40 Hz, on the model's instants, over each measured stance
    ± 0.25 s.

    Args:
        trials: at least one. walker: of their subject. step_s: of the walks. workers: threads.

    Raises:
        InputError: a trial has another subject than the walker, or another model than the first trial.
    """

    def __init__(self, trials: Sequence[Trial], walker: Walker, *, step_s: float, workers: int) -> None:
        for trial in trials:
            for what, own, common in (("subject", trial.subject, walker.subject),
                                      ("model", trial.model, trials[0].model)):
                if own != common:
                    raise InputError(f"is a trial with another {what}", file=trial.path, where=what,
                                     right="A contact fit takes trials of one subject with one prosthesis")
        self.trials, self.walker, self.step_s, self.workers = tuple(trials), walker, step_s, workers

    def compare(self, trial: Trial, values: Mapping[str, float]) -> Comparison:
        """A trial's walk with these values beside its plate.

        Raises:
            SimulationError: the walk fails.
            InputError: there is no measured stance in the trial's window.
        """
        walk = self.walker.walk(trial.trajectory, fulcrum_m=trial.fulcrum_m, start_s=trial.start_s,
                                end_s=trial.end_s, step_s=self.step_s, offsets=trial.offsets, values=values)
        c = compare(self.walker.result(walk, trial, trial.offsets, energy=False), trial.prosthetic_plate)
        if not c.scored.any():
            raise InputError("the prosthetic foot's plate is not loaded in the window", file=trial.path, where="window")
        return c

    def score(self, values: Mapping[str, float]) -> Score:
        """One scenario; a walk that fails makes it lose."""
        total = 0.0
        for i, trial in enumerate(self.trials, start=1):
            try:
                total += float(np.sum(differences(self.compare(trial, values)) ** 2))
            except SimulationError as error:
                return Score(np.inf, i, error)
        return Score(total, len(self.trials))

    def scores(self, scenarios: Sequence[Mapping[str, float]]) -> list[Score]:
        """Of several scenarios, on threads; an interruption waits for those that run, not for the rest."""
        if self.workers == 1:
            return [self.score(values) for values in scenarios]
        with ThreadPoolExecutor(self.workers) as pool:
            futures = [pool.submit(self.score, values) for values in scenarios]
            try:
                return [future.result() for future in futures]
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise

    def carries(self, values: Mapping[str, float]) -> bool:
        """Whether the model's vertical force, taken over all measured stances, is on average at least the plates'.

        Raises:
            SimulationError: a walk fails.
        """
        surplus = 0.0
        for trial in self.trials:
            c = self.compare(trial, values)
            for stance in c.stances:
                rows = c.within(stance.measured.start_s, stance.measured.end_s)
                surplus += float(np.sum(c.model[rows, 2] - c.measured[rows, 2]))
        return surplus >= 0.0

    def carrying_stiffness(self, values: Callable[[float], Mapping[str, float]]) -> tuple[float, int, int]:
        """The initial guess's stiffness (N/mm), raised from SOFTEST_N_PER_MM in steps of RAISE until it `carries`.

        A walk that fails does not carry.

        Args:
            values: the initial guess, by its stiffness.

        Returns:
            Stiffness, walks that were run, walks that failed.

        Raises:
            InputError: it never carries.
            SimulationError: every walk fails.
        """
        stiffness, steps, failed, last = SOFTEST_N_PER_MM, 0, 0, None
        while stiffness <= STIFFEST_N_PER_MM:
            steps += 1
            try:
                if self.carries(values(stiffness)):
                    return stiffness, steps * len(self.trials), failed
            except SimulationError as error:
                failed, last = failed + 1, error
            stiffness *= RAISE
        if last is not None and failed == steps:
            raise last
        raise InputError(
            f"the prosthetic foot does not carry the recorded load with spheres of up to {STIFFEST_N_PER_MM:g} N/mm",
            file=self.trials[0].path, where="offsets",
            right="Check the height of the prosthesis, and that kinematics and forces share time and frame")


def differences(c: Comparison) -> np.ndarray:
    """(k,) N, resultant of the model less the plate's at the scored instants."""
    return np.linalg.norm(c.model[c.scored], axis=1) - np.linalg.norm(c.measured[c.scored], axis=1)


# What the paper's contact fit varies, in the paper's units, and how it draws scenarios.
#
#     contact.ZONE.stiffness            k, N/mm^n      of each of the foot's zones
#     contact.ZONE.exponent             n
#     contact.ZONE.damping              b, N s/mm
#     contact.ZONE.full_damping_depth   mm
#     friction.*                        as in a walk (SI), only if asked for
#
# A normal distribution is not the same in other units. In these, a sphere 1 mm deep carries k whatever n is, so that n
# and k can be drawn independently of each other; in N/m^n they cannot.


FRICTION = ("friction.mu_static", "friction.mu_kinetic", "friction.threshold_velocity")
FULL_DAMPING_MM = 1.0
"""Depth of full damping in the initial guess (McGeehan 2021)."""
DAMPING_OVER_STIFFNESS = 0.5
"""Of the initial guess, N s/mm over N/mm (McGeehan 2021)."""
_MM_PER_M = 1e3


@dataclass(frozen=True, kw_only=True, eq=False)
class PaperSpace:
    """The parameters of one fit.

    Attributes:
        names: (P) of variables of a walk.
        start, low, high: (P,) initial guess and bounds, in the units above.
    """

    names: tuple[str, ...]
    start: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def values(self, x: np.ndarray) -> dict[str, float]:
        """The values of a walk's variables (SI) at x (P,)."""
        own = dict(zip(self.names, map(float, x), strict=True))
        found = dict(own)
        for name, value in own.items():
            if name.endswith(".stiffness"):
                found[name] = value * _MM_PER_M ** own[name.removesuffix("stiffness") + "exponent"]
            elif name.endswith(".damping"):
                found[name] = value * _MM_PER_M
            elif name.endswith(".full_damping_depth"):
                found[name] = value / _MM_PER_M
        return found

    def change(self, x: np.ndarray, other: np.ndarray) -> float:
        """Largest difference of a parameter between two points, over the distance of its bounds."""
        return float(np.max(np.abs(other - x) / (self.high - self.low)))

    def sample(self, centre: np.ndarray, *, count: int, spread: float, random: np.random.Generator) -> np.ndarray:
        """(count, P) scenarios: a Latin hypercube of normal distributions round `centre`, cut off at the bounds.

        Each parameter's distribution is cut into `count` slices of equal probability and each slice is met once (McKay,
        Beckman & Conover 1979, doi 10.1080/00401706.1979.10489755).

        Args:
            spread: standard deviation over the value at the centre, before cutting off.
        """
        columns = []
        for value, low, high in zip(centre, self.low, self.high, strict=True):
            share = (random.permutation(count) + random.uniform(size=count)) / count
            scale = spread * value
            drawn = truncnorm.ppf(share, (low - value) / scale, (high - value) / scale, loc=value, scale=scale)
            columns.append(np.clip(drawn, low, high))
        return np.column_stack(columns)


def paper_space(
    variables: Mapping[str, Variable], stiffness: float, *, fold: float, exponents: tuple[float, float],
    full_damping_mm: tuple[float, float], friction: bool
) -> PaperSpace:
    """The paper's initial guess with one stiffness for all zones, and bounds about it.

    Args:
        variables: of the walker.
        stiffness: N/mm.
        fold: bounds of stiffness and damping are their initial guess divided and multiplied by this.
        exponents, full_damping_mm: bounds.
        friction: whether the coefficients are varied as well, within the variables' own bounds.

    Raises:
        InputError: the initial guess lies outside of bounds, or a bound is out of the model's range.
    """
    damping = DAMPING_OVER_STIFFNESS * stiffness
    law = {"stiffness": (stiffness, stiffness / fold, fold * stiffness), "exponent": (1.0, *exponents),
           "damping": (damping, damping / fold, fold * damping),
           "full_damping_depth": (FULL_DAMPING_MM, *full_damping_mm)}
    rows = {f"contact.{zone}.{name}": row for zone in zones(variables) for name, row in law.items()}
    if friction:
        rows |= {name: (variables[name].default, variables[name].low, variables[name].high) for name in FRICTION}
    for name, (start, low, high) in rows.items():
        if not low <= start <= high or not low < high:
            raise InputError(f"the initial guess {start:g} of {name} does not lie in its bounds {low:g} to {high:g}",
                             where="bounds")
    table = np.array([*rows.values()])
    space = PaperSpace(names=tuple(rows), start=table[:, 0], low=table[:, 1], high=table[:, 2])
    for corner in (space.low, space.high):
        check_values(space.values(corner), variables)
    return space


def zones(variables: Mapping[str, Variable]) -> tuple[str, ...]:
    """The zones of the foot's spheres."""
    return tuple(name.split(".")[1] for name in variables
                 if name.startswith("contact.") and name.endswith(".stiffness"))
