"""What a contact fit finds, by either strategy."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vsf_drake.base.errors import FitError, SimulationError
from vsf_drake.base.tables import Headline, LabelledArrays, Tabular, record_arrays
from vsf_drake.base.threads import one_thread
from vsf_drake.fit.options import JOINT
from vsf_drake.fit.paper import PaperEnd, search_like_the_paper
from vsf_drake.fit.parameters import OFFSET_HEIGHT, FitParameters, TrialMap, owner
from vsf_drake.fit.problem import PRIOR, ContactFit, FitEvaluation
from vsf_drake.fit.solve import FitSearch, Uncertainty, run_searches, search, uncertainty_at
from vsf_drake.model.contact_file import (
    DEVICE,
    FORMAT,
    FittedContact,
    FittedSubject,
    FittedTrial,
    JointCurve,
    variable_unit,
)
from vsf_drake.motion.fitted_trial import fingerprint
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.results import WalkResult
from vsf_drake.walks.comparison import Comparison

FAR, SEVERAL, WIDER = 3.0, 2, 2.0
"""Where so many parameters end further than FAR standard deviations from the centre of their prior,
these priors are made so much wider, once: of a hundred that were right, fewer than one in three
hundred fits would have two (a choice).
"""
ALIKE = 2.0
"""Searches whose cost is within this of the lowest fit the data as well: a likelihood ratio of
exp(-2) (a choice)."""


@dataclass(frozen=True)
class NoiseRatio:
    """Root mean square of a series of residuals over the noise that was assumed."""

    trial: str
    series: str
    ratio: float


@dataclass(frozen=True)
class Contradiction:
    """Parameters that the data pull further from their prior than it allows, and the fit with wider
    priors of these."""

    sd_away: Mapping[str, float]  # by name, in standard deviations of the prior as it was
    factor: float  # by which it was widened
    cost: float  # with the priors as they were
    cost_widened: float | None
    """None where that fit did not converge: it is not the one that is told"""


@dataclass(frozen=True, kw_only=True)
class ParameterRow:
    """One parameter; of the paper's only value and start are known.

    `value_in_prior_sd` and `interval_in_prior_sd` are the value and its interval in the search's
    coordinate. `spread_over_starts`, the largest difference among searches that fit alike, is None
    unless there are several.
    """

    name: str
    unit: str
    value: float
    start: float | None
    frozen: bool = False
    at_bound: bool = False
    interval_95: tuple[float, float] | None = None
    share_of_prior: float | None = None
    spread_over_starts: float | None = None
    value_in_prior_sd: float | None = None
    interval_in_prior_sd: tuple[float, float] | None = None
    low: float | None = None
    high: float | None = None
    prior_mean: float | None = None
    prior_scale: float | None = None
    logarithmic: bool = False  # `prior_scale` is that of the value's logarithm


@dataclass(frozen=True, eq=False)
class JointEnd:
    """Where the searches of a joint fit ended: u (P,), the best point found, and what holds
    there."""

    u: np.ndarray
    evaluation: FitEvaluation
    uncertainty: Uncertainty
    searches: tuple[FitSearch, ...]
    best: int  # the search that u is from
    late: bool = False
    """a limit of wall time cut a search, or left some out: another run may end elsewhere"""

    def alike(self) -> list[FitSearch]:
        """The searches that went to the end themselves and fit as well as the best one (see
        ALIKE)."""
        return [
            s
            for s in self.searches
            if not s.met and s.cost <= self.searches[self.best].cost + ALIKE
        ]

    def noise_ratios(self) -> tuple[NoiseRatio, ...]:
        """Of each series of residuals."""
        return tuple(
            NoiseRatio(term.trial, term.name, float(np.sqrt(np.mean(term.residual**2))))
            for term in self.evaluation.terms
            if term.name != PRIOR
        )


@dataclass(frozen=True, eq=False)
class ContactFitSolution(Tabular):
    """The end of a fit. Whatever reads or applies what one that failed has found raises
    FitError."""

    fit: ContactFit
    success: bool  # a search converged at a point where the walks are sound
    message: str  # how it ended
    end: JointEnd | PaperEnd
    wall_s: float
    contradiction: Contradiction | None = None  # of priors and data; then `fit` has the wider ones

    @property
    def values(self) -> dict[str, float]:
        """Fitted parameters by name, the frozen ones too; of the paper's fit the variables of a
        walk that it set."""
        self.check()
        return (
            dict(self.end.values)
            if isinstance(self.end, PaperEnd)
            else self.fit.parameters.values(self.end.u)
        )

    @property
    def walk_values(self) -> dict[str, float]:
        """Variables of a walk (`Walker.walk(values=...)`) that every trial of this subject shares;
        those that a joint fit left at the model's are not named, but for keel and support: a
        contact is that of the device it was fitted on."""
        variables = self.fit.walker.variables
        shared = self.all_values(None)
        return {name: variables[name].default for name in DEVICE} | {
            name: value
            for name, value in shared.items()
            if isinstance(self.end, PaperEnd)
            or (name in variables and value != variables[name].default)
        }

    def contact(self, verdict: tuple[str, ...] = ()) -> FittedContact:
        """The content of `contact.yaml`, with a verdict in words."""
        subject = self.fit.walker.subject
        shared = self.all_values(None)
        own = [
            (label, trial, self.all_values(label))
            for label, trial in zip(self.fit.labels, self.fit.trials, strict=True)
        ]
        solver = {"solver": self.fit.joint.solver} if isinstance(self.end, JointEnd) else {}
        return FittedContact(
            format=FORMAT,
            law=self.fit.walker.model.contact_law,
            strategy=self.fit.options.strategy,
            converged=True,
            foot_length_m=self.fit.walker.model.foot.length_m,
            verdict=verdict,
            values=self.walk_values,
            subject=FittedSubject(
                mass_kg=subject.mass_kg,
                stature_m=subject.stature_m,
                prosthetic_side=subject.prosthetic_side,
            ),
            curves=tuple(
                JointCurve(coordinate=name, coefficients=c)
                for name, c in _splines(shared, "curve").items()
            ),
            trials=tuple(
                FittedTrial(
                    name=label,
                    fingerprint=fingerprint(trial),
                    path=_splines(values, "path"),
                    curves=_splines(values, "slow"),
                    height_m=values.get(OFFSET_HEIGHT, 0.0) - shared.get(OFFSET_HEIGHT, 0.0),
                )
                for label, trial, values in own
            ),
            provenance={**provenance({}), "seed": self.fit.options.seed, **solver},
        )

    def predict(
        self, trial: Trial, label: str | None, *, step_s: float, fulcrum_m: float | None = None
    ) -> tuple[Comparison, WalkResult]:
        """A trial's walk with the fitted parameters beside its plate; `label` None if the trial was
        not fitted, `fulcrum_m` (m from A) where the fulcrum is if not where it stood."""
        fitted = self.fitted_for(trial, label)
        where = {} if fulcrum_m is None else {"fulcrum_m": fulcrum_m}
        return self.fit.walk(trial, step_s=step_s, **where, **fitted)

    def fitted_for(self, trial: Trial, label: str | None) -> dict[str, Any]:
        """The `values` and `perturbations` of the trial's walk with the fitted parameters. FitError
        if the fit failed."""
        self.check()
        if isinstance(self.end, PaperEnd):
            return {"values": self.end.values}
        own = self.fit.terms_of(trial, label).map
        return {"values": own.at(self.end.u).values, "perturbations": own.perturbations}

    def parameter_rows(self) -> tuple[ParameterRow, ...]:
        """Every parameter with its value and what is known of it. FitError if the fit failed."""
        end = self.end
        values = self.values
        if isinstance(end, PaperEnd):
            return tuple(
                ParameterRow(
                    name=name,
                    unit=variable_unit(name),
                    value=value,
                    start=end.initial_values.get(name),
                )
                for name, value in values.items()
            )
        told = end.uncertainty
        rows = []
        alike = [self.fit.parameters.values(s.u) for s in end.alike()]
        for item in self.fit.parameters.items:
            row = ParameterRow(
                name=item.name,
                unit=item.unit,
                value=values[item.name],
                start=item.start,
                frozen=item.frozen,
                low=item.low,
                high=item.high,
                prior_mean=item.mean,
                prior_scale=item.scale,
                logarithmic=item.logarithmic,
            )
            if not item.frozen:
                i = told.names.index(item.name)
                ends = [one[item.name] for one in alike]
                low, high = map(float, told.interval[i])
                share = float(told.share_of_prior[i])
                row = replace(
                    row,
                    interval_95=(low, high),
                    share_of_prior=share if math.isfinite(share) else None,
                    at_bound=item.name in told.at_bound,
                    spread_over_starts=float(np.ptp(ends)) if len(ends) > 1 else None,
                    value_in_prior_sd=item.to_u(row.value),
                    interval_in_prior_sd=(item.to_u(low), item.to_u(high)),
                )
            rows.append(row)
        return tuple(rows)

    def labelled(self) -> LabelledArrays:
        """One row a parameter: value, start and 95 % interval, each in the `unit` of its row."""
        columns = {
            "name": {"meaning": "parameter"},
            "unit": {"meaning": "of the numbers of the row"},
            "value": {"unit": "by row", "meaning": "fitted value"},
            "start": {"unit": "by row", "meaning": "where the search began"},
            "low_95": {"unit": "by row", "meaning": "95 % interval, lower end"},
            "high_95": {"unit": "by row", "meaning": "95 % interval, upper end"},
            "share_of_prior": {"unit": "1", "meaning": "standard error over that of the prior"},
            "frozen": {"meaning": "whether it was not fitted"},
            "at_bound": {"meaning": "whether it ended on a bound"},
        }
        rows = []
        for row in self.parameter_rows():
            low, high = row.interval_95 or (None, None)
            rows.append({**vars(row), "low_95": low, "high_95": high})
        strategy = self.fit.options.strategy
        return record_arrays(rows, columns, {"strategy": strategy, "synthetic": self._synthetic})

    def headline(self) -> Headline:
        """How many parameters were found, and which lie on a bound."""
        rows = self.parameter_rows() if self.success else ()
        return Headline(
            kind="Contact fit",
            name=", ".join(self.fit.labels),
            synthetic=self._synthetic,
            failure="" if self.success else self.message,
            facts=(
                ("Fitted parameters", sum(not row.frozen for row in rows), ""),
                *((f"On a bound: {row.name}", row.value, row.unit) for row in rows if row.at_bound),
                ("Time", self.wall_s, "s"),
            ),
        )

    @property
    def _synthetic(self) -> bool:
        bench = self.fit.bench
        return any(trial.synthetic for trial in self.fit.trials) or (
            bench is not None and bench.synthetic
        )

    def refitted_without(self, labels: Sequence[str]) -> ContactFitSolution:
        """The same joint fit without these trials, searched once from this solution on. Raises
        FitError, too, where the search does not converge or no trial is left."""
        self.check()
        fit = self.fit
        began = time.perf_counter()
        left = [
            (trial, label)
            for trial, label in zip(fit.trials, fit.labels, strict=True)
            if label not in labels
        ]
        if not left:
            raise FitError("no trial is left to fit")
        parameters = FitParameters(
            item for item in fit.parameters.items if owner(item.name) not in labels
        )
        fewer = ContactFit(
            [trial for trial, _ in left],
            bench=fit.bench,
            parameters=parameters,
            options=fit.options,
            walker=fit.walker,
            labels=[label for _, label in left],
        )
        solution = _finished(fewer, (search(fewer, parameters.u(self.values), near=True),), began)
        solution.check()
        return solution

    def opened(self) -> ContactFitSolution:
        """The same, to be read although it failed; whoever reads it must say that it did not
        converge."""
        return replace(self, success=True)

    def check(self) -> None:
        """Raises FitError if the fit failed."""
        if not self.success:
            raise FitError(f"the fit failed: {self.message}")

    def all_values(self, label: str | None) -> dict[str, float]:
        """All values of a walk, perturbations too, of a fitted trial or (None) of any other."""
        self.check()
        if isinstance(self.end, PaperEnd):
            return self.end.values
        return (
            TrialMap(self.fit.parameters, self.fit.walker.variables, label, None)
            .at(self.end.u)
            .values
        )

    def checked(self) -> ContactFitSolution:
        """The solution, or a failed one that says so where its walks are not sound in the step of
        the report."""
        for trial, label in zip(self.fit.trials, self.fit.labels, strict=True):
            try:
                _, result = self.predict(trial, label, step_s=self.fit.options.report_step_s)
            except SimulationError as error:
                why = f"the walk {label} fails at the step of the report: {error}"
                return replace(self, success=False, message=why)
            if not result.converged:
                why = f"{result.unconverged_steps} steps of the walk {label} did not converge"
                return replace(self, success=False, message=why)
        return self


def _splines(values: Mapping[str, float], kind: str) -> dict[str, tuple[float, ...]]:
    """Coefficients by coordinate of the perturbations of a kind."""
    by_coordinate: dict[str, list[float]] = {}
    for name, value in values.items():
        if name.startswith(f"perturbation.{kind}."):
            by_coordinate.setdefault(name.split(".")[2], []).append(value)
    return {name: tuple(coefficients) for name, coefficients in by_coordinate.items()}


@one_thread()
def solve(
    fit: ContactFit,
    *,
    progress: Callable[[str, float], None] | None = None,
    resume: Mapping[str, Any] | None = None,
    checkpoint: Callable[[dict[str, Any]], None] | None = None,
) -> ContactFitSolution:
    """Fits: from several starts, or by the paper's procedure, as the fit's options say.

    Args:
        progress: called after each evaluation, or iteration, with what is being done and the
            finished share.
        resume: what `checkpoint` was last called with by a fit of the same problem; it goes on from
            there.
        checkpoint: called with plain values after each search, or iteration.

    Raises:
        InputError: `resume` is of another problem, or damaged; by the paper's procedure the foot
            carries nobody.
        FitError: the simulation fails wherever a search starts.
        SimulationError: every walk of an iteration of the paper's procedure fails.
    """
    began = time.perf_counter()
    if fit.options.strategy == JOINT:
        searches = run_searches(fit, progress=progress, resume=resume, checkpoint=checkpoint)
        found = _widened(_finished(fit, searches, began), began)
        limit_s = fit.joint.time_limit_s
        if limit_s is None or (
            len(searches) == fit.joint.starts and not any(s.cut for s in searches)
        ):
            return found
        told = (
            f"the limit of {limit_s:g} s of wall time ended the fit in search {len(searches)} of "
            f"{fit.joint.starts}, so that another run may end elsewhere"
        )
        assert isinstance(found.end, JointEnd)
        return replace(found, message=f"{found.message}; {told}", end=replace(found.end, late=True))
    end = search_like_the_paper(fit, progress=progress, resume=resume, checkpoint=checkpoint)
    solution = ContactFitSolution(
        fit=fit, success=end.converged, message=end.stopped_by, end=end, wall_s=end.state.wall_s
    )
    return solution.checked() if end.converged else solution


def far_parameters(end: JointEnd) -> dict[str, float]:
    """Those further than FAR standard deviations from the centre of their prior, the furthest
    first."""
    far = {
        name: float(u) for name, u in zip(end.uncertainty.names, end.u, strict=True) if abs(u) > FAR
    }
    return dict(sorted(far.items(), key=lambda item: -abs(item[1])))


def _widened(solution: ContactFitSolution, began: float) -> ContactFitSolution:
    """The same where the data agree with the priors; else with the priors that they contradict
    widened, once."""
    fit = solution.fit
    end = solution.end
    assert isinstance(end, JointEnd)
    priors = {item.name for item in fit.parameters.free if item.prior}
    far = {name: u for name, u in far_parameters(end).items() if name in priors}
    if not solution.success or len(far) < SEVERAL:
        return solution
    values = fit.parameters.values(end.u)
    wider = fit.parameters
    for name in far:
        wider = wider.changed([name], scale=WIDER * wider.by_name[name].scale)
    again = fit.with_parameters(wider)
    found = _finished(again, (search(again, wider.u(values), near=True, hops=True),), began)
    told = Contradiction(
        sd_away=far,
        factor=WIDER,
        cost=end.evaluation.cost,
        cost_widened=found.end.evaluation.cost
        if found.success and isinstance(found.end, JointEnd)
        else None,
    )
    if not found.success or not isinstance(found.end, JointEnd):
        return replace(solution, contradiction=told, wall_s=found.wall_s)
    return replace(
        found,
        end=replace(
            found.end, searches=(*end.searches, *found.end.searches), best=len(end.searches)
        ),
        contradiction=told,
    )


def _finished(fit: ContactFit, searches: tuple[FitSearch, ...], began: float) -> ContactFitSolution:
    """At the lowest converged search whose walks are sound; else a failed solution at the best."""

    def at(i: int, *, success: bool, message: str) -> ContactFitSolution:
        u = searches[i].u
        end = JointEnd(
            u=u,
            evaluation=fit.evaluate(u),
            searches=searches,
            best=i,
            uncertainty=uncertainty_at(fit, u, searches[i].apart),
        )
        return ContactFitSolution(
            fit=fit, success=success, message=message, end=end, wall_s=time.perf_counter() - began
        )

    order = sorted(range(len(searches)), key=lambda i: (not searches[i].success, searches[i].cost))
    best = searches[order[0]]
    if not np.isfinite(best.cost):
        raise FitError(f"the simulation fails wherever a search starts: {best.message}")
    message = f"no search converged; the best one ended with: {best.message}"
    for i in (i for i in order if searches[i].success):
        solution = at(i, success=True, message=searches[i].message).checked()
        if solution.success:
            return solution
        message = solution.message
    return at(order[0], success=False, message=message)
