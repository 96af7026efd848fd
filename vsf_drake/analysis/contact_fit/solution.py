"""What a contact fit found, and the way to it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from vsf_drake.analysis.contact_fit.mapping import HEIGHT, TrialMap
from vsf_drake.analysis.contact_fit.multistart import FitProgress, run_searches
from vsf_drake.analysis.contact_fit.problem import ContactFit, Evaluation
from vsf_drake.analysis.contact_fit.solve import Search
from vsf_drake.analysis.contact_fit.uncertainty import Uncertainty, uncertainty
from vsf_drake.contact_file import FittedContact, FittedSubject, FittedTrial, JointCurve
from vsf_drake.errors import FitError
from vsf_drake.motion.fitted_trial import fingerprint
from vsf_drake.simulation.provenance import provenance

JOINT = "joint"
ALIKE = 2.0
"""Searches whose cost is within this of the lowest fit the data as well: a likelihood ratio of exp(-2) (a choice)."""


@dataclass(frozen=True, eq=False)
class ContactFitSolution:
    """The end of a fit. Reading `values`, or making a contact file, of one that failed raises FitError.

    Attributes:
        fit: the problem. strategy: JOINT.
        success: whether a search converged at a point where the walks are sound.
        message: how it ended, in words.
        u: (P,) best point found, whatever `success` says.
        evaluation: the residuals there. uncertainty: there.
        searches: every search. best: which of them u is from.
        wall_s: of the whole fit.
    """

    fit: ContactFit
    success: bool
    message: str
    u: np.ndarray
    evaluation: Evaluation
    uncertainty: Uncertainty
    searches: tuple[Search, ...]
    best: int
    wall_s: float
    strategy: str = JOINT

    @property
    def values(self) -> dict[str, float]:
        """The fitted parameters, the frozen ones too, by name.

        Raises:
            FitError: the fit failed.
        """
        self._check()
        return self.fit.parameters.values(self.u)

    @property
    def walk_values(self) -> dict[str, float]:
        """Variables of a walk (`Walker.walk(values=...)`) that every trial of this subject shares; those that the fit
        left at the model's are not named.

        Raises:
            FitError: the fit failed.
        """
        self._check()
        variables = self.fit.walker.variables
        values = TrialMap(self.fit.parameters, variables, None, None).at(self.u).values
        return {name: value for name, value in values.items()
                if name in variables and value != variables[name].default}

    def contact(self, verdict: tuple[str, ...] = ()) -> FittedContact:
        """The content of `contact.yaml`, with a verdict in words.

        Raises:
            FitError: the fit failed.
        """
        values = self.values
        subject = self.fit.walker.subject
        curves: dict[str, list[float]] = {}
        for name, value in values.items():
            if name.startswith("curve."):
                curves.setdefault(name.split(".")[1], []).append(value)
        return FittedContact(
            format="vsf_drake contact 1", strategy=self.strategy, converged=True, verdict=verdict,
            subject=FittedSubject(mass_kg=subject.mass_kg, stature_m=subject.stature_m,
                                  prosthetic_side=subject.prosthetic_side),
            values=self.walk_values,
            curves=tuple(JointCurve(coordinate=name, coefficients=tuple(c)) for name, c in curves.items()),
            trials=tuple(self._own(label, trial, values)
                         for label, trial in zip(self.fit.labels, self.fit.trials, strict=True)),
            provenance={**provenance({}), "seed": self.fit.options.seed, "solver": self.fit.options.solver})

    def spread(self) -> dict[str, float]:
        """Largest difference of each free parameter among searches that fit alike (see ALIKE), in its unit."""
        alike = [s.u for s in self.searches if s.cost <= self.searches[self.best].cost + ALIKE]
        values = [self.fit.parameters.values(u) for u in alike]
        return {name: float(np.ptp([v[name] for v in values])) for name in self.fit.parameters.names}

    def _own(self, label: str, trial: Any, values: Mapping[str, float]) -> FittedTrial:
        paths: dict[str, list[float]] = {}
        for name, value in values.items():
            if name.startswith(f"trial.{label}.path."):
                paths.setdefault(name.removeprefix(f"trial.{label}.path.").split(".")[0], []).append(value)
        heights = {name: value for name, value in values.items() if name.endswith(".height") and name != HEIGHT}
        own = heights.get(f"trial.{label}.height", 0.0) - (np.mean([*heights.values()]) if heights else 0.0)
        return FittedTrial(name=label, fingerprint=fingerprint(trial), height_m=float(own),
                           path={name: tuple(c) for name, c in paths.items()})

    def _check(self) -> None:
        if not self.success:
            raise FitError(f"the fit failed: {self.message}")


def solve(
    fit: ContactFit, *, progress: Callable[[FitProgress], None] | None = None, resume: Mapping[str, Any] | None = None,
    checkpoint: Callable[[dict[str, Any]], None] | None = None
) -> ContactFitSolution:
    """Fits, from several starts.

    Args:
        progress, resume, checkpoint: see `multistart.run_searches`.

    Raises:
        InputError: `resume` is of another problem.
        FitError: the simulation fails wherever a search starts.
    """
    began = time.perf_counter()
    searches = run_searches(fit, progress=progress, resume=resume, checkpoint=checkpoint)
    best = min(range(len(searches)), key=lambda i: (not searches[i].success, searches[i].cost))
    found = searches[best]
    if not np.isfinite(found.cost):
        raise FitError(f"the simulation fails wherever a search starts: {found.message}")
    evaluation = fit.evaluate(found.u)
    success, message = found.success, found.message
    if not success:
        message = f"no search converged; the best one ended with: {found.message}"
    unsound = _unsound(fit, found.u) if success else ""
    if unsound:
        success, message = False, unsound
    return ContactFitSolution(
        fit=fit, success=success, message=message, u=found.u, evaluation=evaluation,
        uncertainty=uncertainty(fit.parameters, found.u, evaluation.terms, fit.options.noise), searches=searches,
        best=best, wall_s=time.perf_counter() - began)


def _unsound(fit: ContactFit, u: np.ndarray) -> str:
    """What is wrong with the walks at u in the step of the report; nothing if they are sound."""
    for trial, label in zip(fit.trials, fit.labels, strict=True):
        _, result, _, _ = fit.terms_of(trial, label).walk(u, step_s=fit.options.report_step_s)
        if not result.converged:
            return f"{result.unconverged_steps} steps of the walk {label} did not converge"
    return ""


def plain_options(fit: ContactFit) -> dict[str, Any]:
    """The options as plain values."""
    return asdict(fit.options)
