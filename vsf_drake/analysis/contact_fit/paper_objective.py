"""The objective of the paper's contact fit, and the stiffness from which it starts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.comparison import Comparison, compare
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.motion.trial_record import Trial
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
