"""The paper's fit as something that can be judged and written down as the joint one is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vsf_drake.analysis.comparison import Comparison, compare
from vsf_drake.analysis.contact_fit.paper import PaperFit, PaperOptions, fit_like_the_paper
from vsf_drake.analysis.contact_fit.recordings import RESULTANT, check_recordings, labels_of
from vsf_drake.analysis.contact_fit.terms import bench_of
from vsf_drake.bench_curves import BenchMeasurement
from vsf_drake.contact_file import FORMAT, FittedContact, FittedSubject, FittedTrial
from vsf_drake.errors import FitError, SimulationError
from vsf_drake.motion.fitted_trial import fingerprint
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import DEFAULT_STEP_S, Walker

PAPER = "paper"


@dataclass(frozen=True, eq=False)
class PaperSolution:
    """The end of a fit by the paper's procedure; see `table.Fitted` for what it can be asked.

    Attributes:
        paper: what the procedure ended with. success: whether by its own stopping rule; message: how, in words.
        unsound: what is wrong with the walks at the end, in the step of the report; nothing if they are sound.
    """

    trials: tuple[Trial, ...]
    labels: tuple[str, ...]
    walker: Walker
    bench: BenchMeasurement | None
    paper: PaperFit
    unsound: str = ""
    strategy: str = PAPER
    series: tuple[str, ...] = (RESULTANT,)
    report_step_s: float = DEFAULT_STEP_S

    @property
    def success(self) -> bool:
        return self.paper.converged and not self.unsound

    @property
    def message(self) -> str:
        return self.unsound or self.paper.stopped_by

    @property
    def wall_s(self) -> float:
        return self.paper.wall_s

    @property
    def walk_values(self) -> dict[str, float]:
        """Variables of a walk that the fit set. Raises FitError if it failed."""
        self.check()
        return dict(self.paper.values)

    def check(self) -> None:
        """Raises FitError if the fit failed."""
        if not self.success:
            raise FitError(f"the fit failed: {self.message}")

    def predict(
        self, trial: Trial, label: str | None, *, step_s: float, fulcrum_m: float | None = None
    ) -> tuple[Comparison, WalkResult]:
        """A trial's walk with the fitted contact beside its plate; no trial has anything of its own here.

        Raises:
            FitError: the fit failed. SimulationError: the walk diverges.
        """
        walk = self.walker.walk(
            trial.trajectory, fulcrum_m=trial.fulcrum_m if fulcrum_m is None else fulcrum_m, start_s=trial.start_s,
            end_s=trial.end_s, step_s=step_s, offsets=trial.offsets, values=self.walk_values)
        result = self.walker.result(walk, trial, trial.offsets, energy=False)
        return compare(result, trial.prosthetic_plate), result

    def bench_stiffness(self) -> np.ndarray:
        """(m,) N/m of the fitted foot on the bench, the heel last if it was measured.

        Raises:
            FitError: the fit failed. ValueError: there is no bench. SimulationError: the foot gives way on it.
        """
        if self.bench is None:
            raise ValueError("this fit has no bench")
        return bench_of(self.walker.model.foot, self.bench).evaluate(self.walk_values)[0]

    def bench_displacement(self) -> np.ndarray:
        """(m,) m, its mid-range displacement there; errors as of `bench_stiffness`."""
        if self.bench is None:
            raise ValueError("this fit has no bench")
        return bench_of(self.walker.model.foot, self.bench).displacement(self.walk_values)[0]

    def refitted_without(self, labels: Sequence[str]) -> None:
        """The paper fits one trial: there is nothing to leave out."""

    def contact(self, verdict: tuple[str, ...] = ()) -> FittedContact:
        """The content of `contact.yaml`, with a verdict in words. Raises FitError if the fit failed."""
        subject = self.walker.subject
        return FittedContact(
            format=FORMAT, strategy=self.strategy, converged=True, verdict=verdict, values=self.walk_values,
            subject=FittedSubject(mass_kg=subject.mass_kg, stature_m=subject.stature_m,
                                  prosthetic_side=subject.prosthetic_side),
            trials=tuple(FittedTrial(name=label, fingerprint=fingerprint(trial))
                         for label, trial in zip(self.labels, self.trials, strict=True)),
            provenance={**provenance({}), "seed": self.paper.seed})


def solve_like_the_paper(
    trials: Sequence[Trial], *, bench: BenchMeasurement | None = None, options: PaperOptions | None = None,
    progress: Callable[[int, float, float], None] | None = None, resume: Mapping[str, Any] | None = None,
    checkpoint: Callable[[Mapping[str, Any]], None] | None = None
) -> PaperSolution:
    """`paper.fit_like_the_paper` on checked trials; the bench only judges it.

    Raises:
        InputError: see `recordings.check_recordings` and `paper.fit_like_the_paper`.
        SimulationError: every walk of an iteration fails.
    """
    check_recordings(trials, series=(RESULTANT,))
    walker = Walker(trials[0].subject, trials[0].model)
    paper = fit_like_the_paper(trials, options, walker=walker, progress=progress, resume=resume, checkpoint=checkpoint)
    solution = PaperSolution(trials=tuple(trials), labels=labels_of(trials), walker=walker, bench=bench, paper=paper)
    return replace(solution, unsound=_unsound(solution)) if paper.converged else solution


def _unsound(solution: PaperSolution) -> str:
    for trial, label in zip(solution.trials, solution.labels, strict=True):
        try:
            _, result = solution.predict(trial, label, step_s=solution.report_step_s)
        except SimulationError as error:
            return f"the walk {label} fails at the step of the report: {error}"
        if not result.converged:
            return f"{result.unconverged_steps} steps of the walk {label} did not converge"
    return ""
