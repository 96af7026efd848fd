"""What a contact fit found, and the way to it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.analysis.comparison import Comparison
from vsf_drake.analysis.contact_fit.mapping import OFFSET_HEIGHT, TrialMap
from vsf_drake.analysis.contact_fit.paper_solution import PaperSolution
from vsf_drake.analysis.contact_fit.parameters import FitParameter, FitParameters, owner
from vsf_drake.analysis.contact_fit.problem import ContactFit, Evaluation
from vsf_drake.analysis.contact_fit.solve import FitProgress, Search, Uncertainty, run_searches, search, uncertainty
from vsf_drake.analysis.contact_fit.terms import Term
from vsf_drake.bench_curves import BenchMeasurement
from vsf_drake.contact_file import FORMAT, FittedContact, FittedSubject, FittedTrial, JointCurve, variable_unit
from vsf_drake.errors import FitError, SimulationError
from vsf_drake.motion.fitted_trial import fingerprint
from vsf_drake.motion.trajectory import periodic_bsplines
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.results import WalkResult

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
        self.check()
        return self.fit.parameters.values(self.u)

    @property
    def walk_values(self) -> dict[str, float]:
        """Variables of a walk (`Walker.walk(values=...)`) that every trial of this subject shares; those that the fit
        left at the model's are not named.

        Raises:
            FitError: the fit failed.
        """
        self.check()
        variables = self.fit.walker.variables
        return {name: value for name, value in self._walk_values(None).items()
                if name in variables and value != variables[name].default}

    def contact(self, verdict: tuple[str, ...] = ()) -> FittedContact:
        """The content of `contact.yaml`, with a verdict in words.

        Raises:
            FitError: the fit failed.
        """
        self.check()
        subject = self.fit.walker.subject
        shared = self._walk_values(None)
        return FittedContact(
            format=FORMAT, strategy=self.strategy, converged=True, verdict=verdict,
            subject=FittedSubject(mass_kg=subject.mass_kg, stature_m=subject.stature_m,
                                  prosthetic_side=subject.prosthetic_side),
            values=self.walk_values,
            curves=tuple(JointCurve(coordinate=name, coefficients=c) for name, c in _splines(shared, "curve").items()),
            trials=tuple(self._own(label, trial, shared)
                         for label, trial in zip(self.fit.labels, self.fit.trials, strict=True)),
            provenance={**provenance({}), "seed": self.fit.options.seed, "solver": self.fit.options.solver})

    def spread(self) -> dict[str, float]:
        """Largest difference of each free parameter among searches that fit alike (see ALIKE), in its unit."""
        alike = [s.u for s in self.searches if s.cost <= self.searches[self.best].cost + ALIKE]
        values = [self.fit.parameters.values(u) for u in alike]
        return {name: float(np.ptp([v[name] for v in values])) for name in self.fit.parameters.names}

    def noise_ratios(self) -> list[tuple[Term, float]]:
        """Each series of residuals with their root mean square over the noise that was assumed."""
        return [(term, float(np.sqrt(np.mean(term.residual**2)))) for term in self.evaluation.terms
                if term.name != "prior"]

    @property
    def trials(self) -> tuple[Trial, ...]:
        return self.fit.trials

    @property
    def labels(self) -> tuple[str, ...]:
        return self.fit.labels

    @property
    def series(self) -> tuple[str, ...]:
        return self.fit.options.series

    @property
    def bench(self) -> BenchMeasurement | None:
        return self.fit.bench

    @property
    def report_step_s(self) -> float:
        return self.fit.options.report_step_s

    def predict(
        self, trial: Trial, label: str | None, *, step_s: float, fulcrum_m: float | None = None
    ) -> tuple[Comparison, WalkResult]:
        """A trial's walk with the fitted parameters beside its plate; `label` None if the trial was not fitted.

        Raises:
            FitError: the fit failed. SimulationError: the walk diverges.
        """
        self.check()
        comparison, result, _, _ = self.fit.terms_of(trial, label).walk(self.u, step_s=step_s, fulcrum_m=fulcrum_m)
        return comparison, result

    def bench_stiffness(self) -> np.ndarray:
        """(m,) N/m of the fitted foot on the bench, the heel last if it was measured. Raises FitError if it failed."""
        self.check()
        return self.fit.bench_stiffness(self.u)

    def bench_displacement(self) -> np.ndarray:
        """(m,) m, its mid-range displacement there, where that was measured. Raises FitError if the fit failed."""
        self.check()
        return self.fit.bench_displacement(self.u)

    def refitted_without(self, labels: Sequence[str]) -> ContactFitSolution:
        """The same fit without these trials, searched once from this solution on.

        Raises:
            FitError: this fit failed, or the search did not converge, or no trial is left.
        """
        self.check()
        fit = self.fit
        kept = [(trial, label) for trial, label in zip(fit.trials, fit.labels, strict=True) if label not in labels]
        if not kept:
            raise FitError("no trial is left to fit")
        parameters = FitParameters(item for item in fit.parameters.items if owner(item.name) not in labels)
        fewer = ContactFit([trial for trial, _ in kept], bench=fit.bench, parameters=parameters, options=fit.options,
                           walker=fit.walker, labels=[label for _, label in kept])
        began = time.perf_counter()
        solution = _finished(fewer, (search(fewer, parameters.u(self.values)),), began)
        solution.check()
        return solution

    def check(self) -> None:
        """Raises FitError if the fit failed."""
        if not self.success:
            raise FitError(f"the fit failed: {self.message}")

    def _own(self, label: str, trial: Trial, shared: Mapping[str, float]) -> FittedTrial:
        own = self._walk_values(label)
        return FittedTrial(name=label, fingerprint=fingerprint(trial), path=_splines(own, "path"),
                           height_m=own.get(OFFSET_HEIGHT, 0.0) - shared.get(OFFSET_HEIGHT, 0.0))

    def _walk_values(self, label: str | None) -> dict[str, float]:
        """All values of a walk, courses too, of a fitted trial or of any other."""
        return TrialMap(self.fit.parameters, self.fit.walker.variables, label, None).at(self.u).values


def _splines(values: Mapping[str, float], kind: str) -> dict[str, tuple[float, ...]]:
    """Coefficients by coordinate of the courses of a kind."""
    found: dict[str, list[float]] = {}
    for name, value in values.items():
        if name.startswith(f"course.{kind}."):
            found.setdefault(name.split(".")[2], []).append(value)
    return {name: tuple(coefficients) for name, coefficients in found.items()}


def solve(
    fit: ContactFit, *, progress: Callable[[FitProgress], None] | None = None, resume: Mapping[str, Any] | None = None,
    checkpoint: Callable[[dict[str, Any]], None] | None = None
) -> ContactFitSolution:
    """Fits, from several starts.

    Args:
        progress, resume, checkpoint: see `solve.run_searches`.

    Raises:
        InputError: `resume` is of another problem.
        FitError: the simulation fails wherever a search starts.
    """
    began = time.perf_counter()
    return _finished(fit, run_searches(fit, progress=progress, resume=resume, checkpoint=checkpoint), began)


def _finished(fit: ContactFit, searches: tuple[Search, ...], began: float) -> ContactFitSolution:
    order = sorted(range(len(searches)), key=lambda i: (not searches[i].success, searches[i].cost))
    if not np.isfinite(searches[order[0]].cost):
        raise FitError(f"the simulation fails wherever a search starts: {searches[order[0]].message}")
    best, success = order[0], False
    message = f"no search converged; the best one ended with: {searches[best].message}"
    for i in (i for i in order if searches[i].success):
        unsound = _unsound(fit, searches[i].u)
        if not unsound:
            best, success, message = i, True, searches[i].message
            break
        message = unsound
    found = searches[best]
    evaluation = fit.evaluate(found.u)
    return ContactFitSolution(
        fit=fit, success=success, message=message, u=found.u, evaluation=evaluation,
        uncertainty=uncertainty(fit.parameters, found.u, evaluation.terms, fit.options.noise), searches=searches,
        best=best, wall_s=time.perf_counter() - began)


def _unsound(fit: ContactFit, u: np.ndarray) -> str:
    """What is wrong with the walks at u in the step of the report; nothing if they are sound."""
    for trial, label in zip(fit.trials, fit.labels, strict=True):
        try:
            _, result, _, _ = fit.terms_of(trial, label).walk(u, step_s=fit.options.report_step_s)
        except SimulationError as error:
            return f"the walk {label} fails at the step of the report: {error}"
        if not result.converged:
            return f"{result.unconverged_steps} steps of the walk {label} did not converge"
    return ""


# A row a parameter, as a fit's table has them: value, error, prior, and what makes either doubtful.


_PHASES = np.linspace(0.0, 1.0, 201)


def joint_rows(solution: ContactFitSolution) -> list[dict[str, Any]]:
    """Of every parameter of a joint fit that succeeded, the frozen ones too, in their order.

    `value_in_prior_sd` and `interval_in_prior_sd` are the value and its interval in the search's coordinate.
    `spread_over_starts` is None unless several searches fit alike.
    """
    values, known = solution.values, solution.uncertainty
    lowest = solution.searches[solution.best].cost
    several = sum(s.cost <= lowest + ALIKE for s in solution.searches) > 1
    spread = solution.spread() if several else {}
    rows = []
    for item in solution.fit.parameters.items:
        row = _row(item, values[item.name])
        if not item.frozen:
            i = known.names.index(item.name)
            low, high = known.interval[i]
            row |= {
                "standard_error": known.standard_error[i], "interval_95": [low, high],
                "share_of_prior": known.share_of_prior[i], "at_bound": item.name in known.at_bound,
                "spread_over_starts": spread.get(item.name), "value_in_prior_sd": item.to_u(values[item.name]),
                "interval_in_prior_sd": [item.to_u(float(low)), item.to_u(float(high))]}
        rows.append(row)
    return rows


def paper_rows(solution: PaperSolution) -> list[dict[str, Any]]:
    """Of every variable that the paper's procedure set; nothing but value and start is known."""
    start = solution.paper.initial_values
    return [_plain_row(name, variable_unit(name), value, start.get(name)) for name, value in
            solution.walk_values.items()]


def curve_rows(values: Mapping[str, float]) -> list[dict[str, Any]]:
    """Of every joint angle with a smooth error over the gait cycle: the largest value of that curve, and where."""
    coefficients: dict[str, list[float]] = {}
    for name, value in values.items():
        if name.startswith("curve."):
            coefficients.setdefault(name.split(".")[1], []).append(value)
    rows = []
    for coordinate, c in coefficients.items():
        curve = np.degrees(periodic_bsplines(len(c))(_PHASES) @ np.array(c))
        i = int(np.argmax(np.abs(curve)))
        rows.append({"coordinate": coordinate, "largest_deg": float(curve[i]),
                     "at_percent_of_cycle": float(100.0 * _PHASES[i])})
    return rows


def _row(item: FitParameter, value: float) -> dict[str, Any]:
    return _plain_row(item.name, item.unit, value, item.start) | {
        "frozen": item.frozen, "low": item.low, "high": item.high, "prior_mean": item.mean, "prior_scale": item.scale,
        "prior": item.prior, "logarithmic": item.logarithmic, "why": item.why}


def _plain_row(name: str, unit: str, value: float, start: float | None) -> dict[str, Any]:
    return {
        "name": name, "unit": unit, "value": value, "start": start, "frozen": False, "at_bound": False,
        "standard_error": None, "interval_95": None, "share_of_prior": None, "spread_over_starts": None,
        "value_in_prior_sd": None, "interval_in_prior_sd": None, "low": None, "high": None, "prior_mean": None,
        "prior_scale": None, "prior": False, "logarithmic": False, "why": ""}
