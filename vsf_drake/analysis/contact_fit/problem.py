"""The joint contact fit as a mathematical program.

    minimise    1/2 sum_trials sum_series weight^2 |model(u) - measured|^2 / sd^2
              + 1/2 sum_bench  |stiffness(u) - measured|^2 / sd^2, mid-range displacement likewise where it was measured
              + 1/2 sum_priors u_p^2
    subject to  low <= u <= high

over u, the parameters in standard deviations of their prior (`parameters`), with exact derivatives, but for the
direction of walking and the instants at which a foot counts as loaded, which are taken as they are.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractValue
from pydrake.solvers import MathematicalProgram

from vsf_drake.analysis.contact_fit.mapping import TrialMap
from vsf_drake.analysis.contact_fit.parameters import FitParameters, owner, standard_parameters
from vsf_drake.analysis.contact_fit.recordings import (
    COP,
    FORCES,
    RESULTANT,
    SERIES,
    FitNoise,
    check_recordings,
    labels_of,
)
from vsf_drake.analysis.contact_fit.terms import BenchTerms, Term, TrialTerms
from vsf_drake.bench_curves import BenchMeasurement
from vsf_drake.errors import InputError
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.walk import Walker


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The fit's residuals at one point.

    Attributes:
        residual: (m,) weighted. jacobian: (m, P) by the search coordinates; P = 0 without derivatives.
        terms: what they are made of, the prior last.
    """

    residual: np.ndarray
    jacobian: np.ndarray
    terms: tuple[Term, ...]

    @property
    def cost(self) -> float:
        """Half the sum of the squared residuals."""
        return 0.5 * float(self.residual @ self.residual)


class ContactFit:
    """One subject's trials, and what is to be fitted to them.

    Args:
        trials: one or more, at one or more positions of the fulcrum.
        bench: the measured bench of this foot, so that what is fitted stays that foot; None to leave it out.
        parameters: what may change; `standard_parameters` by default. See `parameters.changed` to free or freeze some.
        options: how.
        walker: of the subject and the trials' model, built before; made here if None.
        labels: of the trials; their files' names if None.

    Attributes:
        labels: of the trials, by which parameters of a single trial are named.
        evaluations: how many points were evaluated.

    Raises:
        InputError: the trials cannot be fitted together (see `recordings.check_recordings`), or a parameter is none.
    """

    def __init__(
        self, trials: Sequence[Trial], *, bench: BenchMeasurement | None = None,
        parameters: FitParameters | None = None, options: ContactFitOptions | None = None, walker: Walker | None = None,
        labels: Sequence[str] | None = None
    ) -> None:
        self.options = options or ContactFitOptions()
        check_recordings(trials, series=self.options.series)
        self.trials, self.bench = tuple(trials), bench
        if bench is not None and not isinstance(bench, BenchMeasurement):
            raise InputError(f"is a {type(bench).__name__}, no BenchMeasurement", where="bench",
                             right="Give what load_bench_file returns")
        if labels is not None and len(labels) != len(self.trials):
            raise InputError(f"{len(labels)} labels for {len(self.trials)} trials", where="labels")
        self.labels = labels_of(self.trials) if labels is None else tuple(labels)
        subject, model = self.trials[0].subject, self.trials[0].model
        self.walker = walker or Walker(subject, model)
        if (self.walker.subject, self.walker.model) != (subject, model):
            raise InputError("is of another subject or model than the trials", where="walker")
        self.parameters = parameters or standard_parameters(
            self.walker.variables, subject.prosthetic_side, self.labels)
        self._check_own_parameters()
        self.evaluations = 0
        self._terms = [self.terms_of(trial, label) for trial, label in zip(self.trials, self.labels, strict=True)]
        self._bench = None if bench is None else BenchTerms(
            model.foot, bench, self.parameters, self.walker.variables)
        self._last: tuple[np.ndarray, bool, Evaluation] | None = None

    def terms_of(self, trial: Trial, label: str | None) -> TrialTerms:
        """The comparison of any trial under this fit's parameters; `label` None if it has none of its own."""
        if label is not None and (label not in self.labels or self.trials[self.labels.index(label)] is not trial):
            raise InputError(f"{label!r} is not this trial's label", where="label",
                             right="A trial that was not fitted has none: give None")
        return TrialTerms(self.walker, trial, label or trial.path.stem,
                          TrialMap(self.parameters, self.walker.variables, label, trial), noise=self.options.noise,
                          series=self.options.series, step_s=self.options.step_s)

    def evaluate(self, u: np.ndarray, *, derivatives: bool = True) -> Evaluation:
        """The residuals at u (P,); trials are walked side by side.

        Raises:
            SimulationError: a walk, or the bench, fails there.
        """
        u = np.asarray(u, dtype=float)
        if self._last is not None and np.array_equal(self._last[0], u) and self._last[1] >= derivatives:
            return self._last[2]
        self.evaluations += 1
        found: list[Term] = []
        if len(self._terms) == 1:
            found += self._terms[0].terms(u, derivatives=derivatives)
        else:
            with ThreadPoolExecutor(min(len(self._terms), os.cpu_count() or 1)) as pool:
                for terms in pool.map(lambda trial: trial.terms(u, derivatives=derivatives), self._terms):
                    found += terms
        if self._bench is not None:
            found += self._bench.terms(u, derivatives=derivatives)
        found.append(self._prior(u, derivatives))
        evaluation = Evaluation(
            residual=np.concatenate([term.weight * term.residual for term in found]),
            jacobian=np.vstack([term.weight * term.by for term in found]), terms=tuple(found))
        self._last = (u.copy(), derivatives, evaluation)
        return evaluation

    def bench_stiffness(self, u: np.ndarray) -> np.ndarray:
        """(m,) N/m on the bench at u, the heel last if it was measured.

        Raises:
            ValueError: the fit has no bench.
            SimulationError: the foot gives way.
        """
        if self._bench is None:
            raise ValueError("this fit has no bench")
        return self._bench.stiffness(u)

    def bench_displacement(self, u: np.ndarray) -> np.ndarray:
        """(m,) m of mid-range displacement on the bench at u, in the order of `bench_stiffness`.

        Raises:
            ValueError: the fit has no bench, or none with displacements.
            SimulationError: the foot gives way.
        """
        if self._bench is None:
            raise ValueError("this fit has no bench")
        return self._bench.displacement(u)

    def program(self, evaluate: Callable[..., Evaluation] | None = None) -> MathematicalProgram:
        """The fit for Drake's solvers: bounded variables u and one cost with its gradient.

        Args:
            evaluate: in place of this fit's own, e.g. to count points or to survive those that fail.
        """
        evaluate = evaluate or self.evaluate
        program = MathematicalProgram()
        u = program.NewContinuousVariables(len(self.parameters), "u")
        program.AddBoundingBoxConstraint(*self.parameters.bounds, u)

        def cost(x: np.ndarray) -> float | AutoDiffXd:
            if x.dtype != object:
                return evaluate(x, derivatives=False).cost
            at = evaluate(ExtractValue(x).ravel())
            gradient = at.jacobian.T @ at.residual
            seeds = np.array([entry.derivatives() for entry in x])
            return AutoDiffXd(at.cost, gradient @ seeds)

        program.AddCost(cost, vars=u)
        program.SetInitialGuess(u, self.parameters.start)
        return program

    def _prior(self, u: np.ndarray, derivatives: bool) -> Term:
        rows = np.flatnonzero(self.parameters.with_prior)
        by = np.eye(len(u))[rows] if derivatives else np.zeros((len(rows), 0))
        return Term(name="prior", trial="prior", times_s=None, residual=u[rows], by=by, weight=1.0)

    def _check_own_parameters(self) -> None:
        for name in self.parameters.by_name:
            if owner(name) not in (None, *self.labels):
                raise InputError(f"{name} belongs to no trial of this fit", where="parameters",
                                 right=f"The trials are: {', '.join(self.labels)}")


# How a contact fit is to be done.


SOLVERS = ("gauss_newton", "snopt", "ipopt", "nlopt")


@dataclass(frozen=True, kw_only=True)
class ContactFitOptions:
    """Options of the joint fit.

    Attributes:
        series: what is compared, names of `recordings.SERIES`; the force components and the fore-aft centre of
            pressure by default, because the resultant alone accepts nonsense.
        noise: how wrong that is expected to be.
        starts: searches, the first from the parameters' own start, the others from the best of `screened` samples.
        screened: Latin hypercube samples of the prior that are tried for each further start.
        seed: of the samples.
        solver: "gauss_newton" (bounded trust region, scipy), "snopt" or "ipopt" (Drake, exact gradients), "nlopt"
            (global: DIRECT and then a local search, Drake).
        iterations: most evaluations of a search; for "nlopt" of its global part.
        tolerance: a search has converged when a step betters the cost by less than this part of it.
        step_s: of the walks during the search. report_step_s: of those that are reported.

    Raises:
        InputError: an option is none of what it may be.
    """

    series: tuple[str, ...] = (*FORCES, *COP)
    noise: FitNoise = field(default_factory=FitNoise)
    starts: int = 5
    screened: int = 12
    seed: int = 0
    solver: str = "gauss_newton"
    iterations: int = 100
    tolerance: float = 1e-5
    step_s: float = 2e-3
    report_step_s: float = 1e-3

    def __post_init__(self) -> None:
        unknown = [name for name in self.series if name not in SERIES]
        if unknown or not self.series or len(set(self.series)) != len(self.series):
            raise InputError(f"{unknown[0]!r} is not compared" if unknown else "must name series, each once",
                             where="series", right=f"There are: {', '.join(SERIES)}")
        if RESULTANT in self.series and any(name in FORCES for name in self.series):
            raise InputError("the resultant and its components are the same data twice", where="series",
                             right=f"Give {RESULTANT}, or some of {', '.join(FORCES)}")
        if not isinstance(self.noise, FitNoise):
            raise InputError(f"is a {type(self.noise).__name__}, no FitNoise", where="noise")
        if self.solver not in SOLVERS:
            raise InputError(f"{self.solver!r} is no solver", where="solver", right=f"There are: {', '.join(SOLVERS)}")
        for name, least in (("starts", 1), ("screened", 1), ("seed", 0), ("iterations", 1)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise InputError(f"{value!r} is not usable", where=name,
                                 right=f"It must be a whole number from {least} on")
        for name in ("tolerance", "step_s", "report_step_s"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value <= 0.01:
                raise InputError(f"{value!r} is not usable", where=name, right="It must be above 0 and at most 0.01")
