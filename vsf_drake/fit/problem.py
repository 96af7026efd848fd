"""A contact fit as a problem: trials of one person, a bench, and the residuals of both with exact
derivatives.

    minimise    1/2 sum_trials sum_series weight^2 |model(u) - measured|^2 / sd^2
              + 1/2 sum_bench  |stiffness(u) - measured|^2 / sd^2, mid-range
                              displacement likewise where it was measured
              + 1/2 sum_priors u_p^2
    subject to  low <= u <= high

over u, the parameters in standard deviations of their prior (`parameters`), with exact derivatives,
but for the direction of walking and the instants at which a foot counts as loaded, which are taken
as they are. That is the joint strategy; the paper's procedure (`paper`) walks the same trials and
has an objective of its own.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractValue
from pydrake.solvers import MathematicalProgram

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.base.schema import to_plain
from vsf_drake.base.threads import side_by_side
from vsf_drake.fit.options import COP, FORCES, PAPER, RESULTANT, ContactFitOptions, PaperOptions
from vsf_drake.fit.parameters import (
    FitParameters,
    TrialMap,
    WalkValues,
    owner,
    standard_parameters,
)
from vsf_drake.model.bench_curves import BenchMeasurement
from vsf_drake.model.parameters import GRAVITY, FootParameters
from vsf_drake.motion.events import known_stances
from vsf_drake.motion.fitted_trial import APPLIED, fingerprint
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.batch.cases import digest
from vsf_drake.simulation.bench_stiffness import BenchStiffness
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import Walk, Walker, trial_request
from vsf_drake.walks.comparison import Comparison, compare, compare_sensitivity
from vsf_drake.walks.recorded_walk import labels_of

T = TypeVar("T")
BENCH = "bench"
MID_RANGE = "mid-range displacement"
PRIOR = "prior"
STRIDE = 4
"""Every fourth instant of a series at 500 Hz, every fourth percent of a stance: they are no more
independent."""
_LEAST_RESULTANT_N = 1.0
"""Below this a resultant's direction, and with it its derivative, means nothing."""


@dataclass(frozen=True, eq=False)
class ResidualTerm:
    """One series of residuals: (n,) model minus measurement in standard deviations, (n, P) by the
    search coordinates (P = 0 where no derivatives were asked for), and the weight of each in the
    cost (`FitNoise.weight`)."""

    name: str  # of the series, as in `FitNoise`
    trial: str  # its label, or "bench" or "prior"
    times_s: np.ndarray | None
    """(n,) when each was measured; None where errors are independent of each other"""
    residual: np.ndarray
    by: np.ndarray
    weight: float = 1.0


@dataclass(frozen=True, eq=False)
class FitEvaluation:
    """The fit's weighted residuals (m,) at one point, their Jacobian (m, P), and the terms they are
    made of, the prior last."""

    residual: np.ndarray
    jacobian: np.ndarray
    terms: tuple[ResidualTerm, ...]

    @property
    def cost(self) -> float:
        """Half the sum of the squared residuals."""
        return 0.5 * float(self.residual @ self.residual)


class ContactFit:
    """One subject's trials, and what is to be fitted to them.

    Args:
        bench: the measured bench of this foot, so that what is fitted stays that foot. A fit by the
            paper's strategy is only judged by it.
        parameters: of a joint fit; `standard_parameters` by default. `parameters.changed` frees or
            freezes some.
        walker: of the subject and the trials' model, built before.
        labels: of the trials, by which parameters of a single trial are named; their files' names
            by default.

    Attributes:
        evaluations: how many points were evaluated.
        shared: what all trials share, from the parameters to a walk's variables.
        machine: presses this foot as the bench did, if there is one.

    Raises:
        InputError: the trials cannot be fitted together (see `check_recordings`), or a parameter is
            none.
    """

    def __init__(
        self,
        trials: Sequence[Trial],
        *,
        bench: BenchMeasurement | None = None,
        parameters: FitParameters | None = None,
        options: ContactFitOptions | PaperOptions | None = None,
        walker: Walker | None = None,
        labels: Sequence[str] | None = None,
    ) -> None:
        self.options = options or ContactFitOptions()
        check_recordings(trials, series=self.options.series)
        self.trials = tuple(trials)
        self.bench = bench
        self.labels = labels_of(self.trials) if labels is None else tuple(labels)
        if len(self.labels) != len(self.trials):
            raise InputError(
                f"{len(self.labels)} labels for {len(self.trials)} trials", where="labels"
            )
        subject = self.trials[0].subject
        model = self.trials[0].model
        self.walker = walker or Walker(subject, model)
        if (self.walker.subject, self.walker.model) != (subject, model):
            raise InputError("is of another subject or model than the trials", where="walker")
        self.parameters = parameters or standard_parameters(
            self.walker.variables, subject.prosthetic_side, self.labels, bench=bench is not None
        )
        for name in self.parameters.by_name:
            if owner(name) not in (None, *self.labels):
                raise InputError(
                    f"{name} belongs to no trial of this fit",
                    where="parameters",
                    right=f"The trials are: {', '.join(self.labels)}",
                )
        self.evaluations = 0
        self._terms = (
            []
            if self.options.strategy == PAPER
            else [
                self.terms_of(trial, label)
                for trial, label in zip(self.trials, self.labels, strict=True)
            ]
        )
        self.shared = TrialMap(self.parameters, self.walker.variables, None, None)
        self.machine = None if bench is None else bench_of(model.foot, bench)
        self._last: tuple[np.ndarray, tuple[float, float], bool, FitEvaluation] | None = None

    @property
    def joint(self) -> ContactFitOptions:
        """The options of a fit by the joint strategy."""
        assert isinstance(self.options, ContactFitOptions)
        return self.options

    @property
    def key(self) -> str:
        """A hash of all that decides how the fit goes: recordings, parameters, options, model,
        bench."""
        options = {
            name: value
            for name, value in to_plain(self.options).items()
            if name not in self.options.only_ends
        }
        return digest(
            {
                "trials": [
                    (label, fingerprint(trial), trial.fulcrum_m, to_plain(trial.offsets))
                    for label, trial in zip(self.labels, self.trials, strict=True)
                ],
                "parameters": to_plain(self.parameters.items),
                "options": options,
                "model": to_plain(self.walker.model),
                "subject": to_plain(self.walker.subject),
                "bench": to_plain(self.bench),
            }
        )

    def resumed(self, state: Mapping[str, Any], read: Callable[[dict[str, Any]], T]) -> T:
        """What `read` makes of a checkpoint without its key; InputError if it is damaged or was
        left by another fit."""
        if state.get("key") != self.key:
            raise InputError(
                "was left by a fit of other trials, parameters or options",
                where="resume",
                right="Give the same ones again, or begin anew",
            )
        try:
            return read({name: value for name, value in state.items() if name != "key"})
        except (KeyError, TypeError, ValueError) as error:
            raise InputError("is no state of such a fit", where="resume") from error

    def with_parameters(self, parameters: FitParameters) -> ContactFit:
        """The same trials and bench with other parameters, or priors."""
        return ContactFit(
            self.trials,
            bench=self.bench,
            parameters=parameters,
            options=self.options,
            walker=self.walker,
            labels=self.labels,
        )

    def walk(self, trial: Trial, **changes: Any) -> tuple[Comparison, WalkResult]:
        """A trial's walk beside its plate, `changes` as `Walker.walk_trial` takes them;
        SimulationError if it diverges."""
        walk = self.walker.walk_trial(trial, **changes)
        result = self.walker.result(walk, trial, trial.offsets, energy=False)
        return compare(result, trial.prosthetic_plate), result

    def walks(
        self, trial: Trial, changes: Sequence[Mapping[str, Any]], **shared: Any
    ) -> list[Walk | SimulationError]:
        """A trial's walks side by side, each with its `changes` and the `shared` ones, or why one
        failed; nothing is recorded of single spheres."""
        requests = [trial_request(trial, **shared, **own) for own in changes]
        found = list[Walk | SimulationError]()
        for walk in self.walker.walk_each(requests, sites=False):
            if not isinstance(walk, Walk | SimulationError):
                raise walk
            found.append(walk)
        return found

    def terms_of(self, trial: Trial, label: str | None) -> TrialTerms:
        """The comparison of any trial under this fit's parameters; `label` None if it has none of
        its own."""
        if label is not None and (
            label not in self.labels or self.trials[self.labels.index(label)] is not trial
        ):
            raise InputError(
                f"{label!r} is not this trial's label",
                where="label",
                right="A trial that was not fitted has none: give None",
            )
        return TrialTerms(self, trial, label)

    def evaluate(
        self,
        u: np.ndarray,
        *,
        derivatives: bool = True,
        noise: float = 1.0,
        step_s: float | None = None,
    ) -> FitEvaluation:
        """The residuals at u (P,); trials are walked side by side. SimulationError if a walk, or
        the bench, fails.

        For the way to a minimum, not for its end: `noise` times as much of it as is assumed, in
        walks and bench, so that the prior counts for more; `step_s` of the walks, in place of the
        options'.
        """
        u = np.asarray(u, dtype=float)
        step_s = step_s or self.options.step_s
        how = (noise, step_s)
        if (
            self._last is not None
            and np.array_equal(self._last[0], u)
            and self._last[1] == how
            and (self._last[2] >= derivatives)
        ):
            return self._last[3]
        self.evaluations += 1
        with self._on_threads() as pool:
            each = pool.map(
                lambda trial: trial.terms(u, derivatives=derivatives, step_s=step_s), self._terms
            )
            terms = [term for of_trial in each for term in of_trial]
        evaluation = self._evaluation(u, terms, derivatives=derivatives, noise=noise)
        self._last = (u.copy(), how, derivatives, evaluation)
        return evaluation

    def costs(self, points: np.ndarray) -> np.ndarray:
        """(n,) the costs at points (n, P), inf where a walk, or the bench, fails; the walks of a
        trial go side by side."""
        self.evaluations += len(points)
        with self._on_threads() as pool:
            each = [*pool.map(lambda trial: trial.terms_at(points), self._terms)]
        costs = np.full(len(points), np.inf)
        for i, u in enumerate(points):
            terms = list[ResidualTerm]()
            try:
                for of_trial in each:
                    terms += raised(of_trial[i])
                costs[i] = self._evaluation(u, terms, derivatives=False).cost
            except SimulationError:
                continue
        return costs

    def _on_threads(self) -> AbstractContextManager[ThreadPoolExecutor]:
        """Threads for the trials."""
        return side_by_side(min(len(self._terms), os.cpu_count() or 1))

    def _evaluation(
        self,
        u: np.ndarray,
        terms: Sequence[ResidualTerm],
        *,
        derivatives: bool,
        noise: float = 1.0,
    ) -> FitEvaluation:
        """All residuals at u (P,), with those `terms` of the trials."""
        prior = [p for p, item in enumerate(self.parameters.free) if item.prior]
        terms = [
            replace(term, weight=term.weight / noise)
            for term in [*terms, *self._bench_terms(u, derivatives)]
        ]
        terms.append(
            ResidualTerm(
                name=PRIOR,
                trial=PRIOR,
                times_s=None,
                residual=u[prior],
                by=np.eye(len(u))[prior] if derivatives else np.zeros((len(prior), 0)),
            )
        )
        return FitEvaluation(
            residual=np.concatenate([term.weight * term.residual for term in terms]),
            jacobian=np.vstack([term.weight * term.by for term in terms]),
            terms=tuple(terms),
        )

    def bench_stiffness(self, u: np.ndarray) -> np.ndarray:
        """(m,) N/m on the bench at u, the heel last if it was measured; SimulationError if the foot
        gives way."""
        if self.machine is None:
            raise ValueError("this fit has no bench")
        return self.machine.evaluate(self.shared.at(u).values)[0]

    def _bench_terms(self, u: np.ndarray, derivatives: bool) -> list[ResidualTerm]:
        bench = self.bench
        machine = self.machine
        if bench is None or machine is None:
            return []
        at = self.shared.at(u)
        names = at.names if derivatives else ()
        rows = [
            (
                BENCH,
                machine.evaluate,
                bench.stiffness_n_per_m,
                bench.heel_stiffness_n_per_m,
                bench.uncertainty_n_per_m,
            ),
            (
                MID_RANGE,
                machine.displacement,
                bench.mid_range_m,
                bench.heel_mid_range_m,
                bench.mid_range_uncertainty_m,
            ),
        ]
        terms = []
        for name, press, forefoot, heel, sd in rows:
            if forefoot is not None and sd is not None:
                model, by = press(at.values, names)
                measured = np.array([*forefoot, *([] if heel is None else [heel])])
                terms.append(
                    ResidualTerm(
                        name=name,
                        trial=BENCH,
                        times_s=None,
                        residual=(model - measured) / sd,
                        by=(by @ at.by if derivatives else np.zeros((len(model), 0))) / sd,
                    )
                )
        return terms

    def program(self, evaluate: Callable[..., FitEvaluation] | None = None) -> MathematicalProgram:
        """The fit for Drake's solvers: bounded variables u and one cost with its gradient;
        `evaluate` stands in for this fit's own, e.g. to count points or to survive those that
        fail."""
        evaluate = evaluate or self.evaluate
        program = MathematicalProgram()
        u = program.NewContinuousVariables(len(self.parameters), "u")
        program.AddBoundingBoxConstraint(*self.parameters.bounds, u)

        def cost(x: np.ndarray) -> float | AutoDiffXd:
            if x.dtype != object:
                return evaluate(x, derivatives=False).cost
            at = evaluate(ExtractValue(x).ravel())
            gradient = at.jacobian.T @ at.residual
            return AutoDiffXd(at.cost, gradient @ np.array([entry.derivatives() for entry in x]))

        program.AddCost(cost, vars=u)
        program.SetInitialGuess(u, self.parameters.start)
        return program


class TrialTerms:
    """One trial under a fit's parameters: its walk, and its residuals with derivatives."""

    def __init__(self, fit: ContactFit, trial: Trial, label: str | None) -> None:
        self.fit = fit
        self.trial = trial
        self.label = label or trial.path.stem
        self.map = TrialMap(fit.parameters, fit.walker.variables, label, trial)

    def walk(self, u: np.ndarray, *, step_s: float | None = None) -> tuple[Comparison, WalkResult]:
        """The trial's walk at u beside its plate."""
        return self.fit.walk(
            self.trial,
            values=self.map.at(u).values,
            step_s=step_s or self.fit.options.step_s,
            perturbations=self.map.perturbations,
        )

    def terms(
        self, u: np.ndarray, *, derivatives: bool, step_s: float | None = None
    ) -> list[ResidualTerm]:
        """The residuals at u."""
        at = self.map.at(u)
        names = at.names if derivatives else ()
        [walk] = self._walks([at], step_s=step_s, with_respect_to=names)
        return self._terms(raised(walk), at)

    def terms_at(self, points: np.ndarray) -> list[list[ResidualTerm] | SimulationError]:
        """The residuals at points (n, P) without derivatives, or why a walk failed."""
        every = [self.map.at(u) for u in points]
        return [
            walk if isinstance(walk, SimulationError) else self._terms(walk, at)
            for at, walk in zip(every, self._walks(every), strict=True)
        ]

    def _walks(
        self,
        every: Sequence[WalkValues],
        *,
        step_s: float | None = None,
        with_respect_to: Sequence[str] = (),
    ) -> list[Walk | SimulationError]:
        return self.fit.walks(
            self.trial,
            [{"values": at.values} for at in every],
            step_s=step_s or self.fit.options.step_s,
            perturbations=self.map.perturbations,
            with_respect_to=with_respect_to,
        )

    def _terms(self, walk: Walk, at: WalkValues) -> list[ResidualTerm]:
        """The residuals of a walk with these values, with derivatives if it has some."""
        c = compare(walk, self.trial.prosthetic_plate)
        rows = np.flatnonzero(c.scored)[:: max(1, round(STRIDE * 2e-3 / c.step_s))]
        model = c.model[rows]
        measured = c.measured[rows]
        by = np.zeros((len(rows), 3, 0))
        cop_by: tuple[np.ndarray, ...] = ()
        if walk.sensitivity is not None:
            found = compare_sensitivity(c, walk, walk.sensitivity)
            by = found.model[rows] @ at.by
            cop_by = tuple(cop[::STRIDE] @ at.by for cop in found.cop)
        weight_n = self.trial.subject.mass_kg * GRAVITY
        size = np.linalg.norm(model, axis=1)
        # d|F| = F / |F| . dF
        direction = model / np.maximum(size, _LEAST_RESULTANT_N)[:, None]
        forces = {name: ((model - measured)[:, i], by[:, i]) for i, name in enumerate(FORCES)} | {
            RESULTANT: (
                size - np.linalg.norm(measured, axis=1),
                np.einsum("ni,nip->np", direction, by),
            )
        }
        series = self.fit.options.series
        of_forces = [
            self._term(name, c.time_s[rows], *(part / weight_n for part in forces[name]))
            for name in series
            if name in forces
        ]
        of_centres = []
        length = self.fit.walker.model.foot.length_m
        for name in (name for name in series if name in COP):
            axis = COP.index(name)
            for i, stance in enumerate(c.stances):
                error = (stance.model_cop - stance.measured_cop)[::STRIDE, axis] / length
                slope = cop_by[i][:, axis] / length if cop_by else np.zeros((len(error), 0))
                instants = np.linspace(stance.measured.start_s, stance.measured.end_s, len(error))
                # Where either foot is not loaded there is no centre to compare; the force says so.
                of_centres.append(
                    self._term(name, instants, np.nan_to_num(error), np.nan_to_num(slope))
                )
        return of_forces + of_centres

    def _term(
        self, name: str, times: np.ndarray, error: np.ndarray, by: np.ndarray
    ) -> ResidualTerm:
        noise = self.fit.joint.noise
        sd = getattr(noise, name)
        spacing = float(np.median(np.diff(times))) if len(times) > 1 else 2.0 * noise.correlation_s
        return ResidualTerm(
            name=name,
            trial=self.label,
            times_s=times,
            residual=error / sd,
            by=by / sd,
            weight=noise.weight(spacing),
        )


def raised(found: T | SimulationError) -> T:
    """What was found, raising what failed."""
    if isinstance(found, SimulationError):
        raise found
    return found


def bench_of(foot: FootParameters, bench: BenchMeasurement) -> BenchStiffness:
    """The machine that presses this foot as it was measured. Raises InputError where its carriage
    does not reach."""
    return BenchStiffness(
        foot,
        fulcrums_m=bench.fulcrum_m,
        heel=bench.heel_stiffness_n_per_m is not None,
        max_load_n=bench.max_load_n,
    )


# Which recordings make one fit: one subject, one model, whole stances, each with what is compared.


def labels_with(fit: ContactFit, held_out: Sequence[Trial]) -> tuple[str, ...]:
    """Names of the fitted trials, and of others that tell these from them."""
    return (*fit.labels, *labels_of([*fit.trials, *held_out])[len(fit.trials) :])


def check_recordings(
    trials: Sequence[Trial], held_out: Sequence[Trial] = (), *, series: Sequence[str]
) -> None:
    """Makes sure that these can be fitted, and judged by `held_out`, together.

    Raises:
        InputError: there is none; two are the same recording, one of them perhaps held out;
            subject, side or model differ; a plate saw only part of the stance, or has no centre of
            pressure where that is compared.
    """
    for name, given in (("trials", trials), ("held_out", held_out)):
        if isinstance(given, Trial) or not all(isinstance(trial, Trial) for trial in given):
            raise InputError(
                "is no list of trials", where=name, right="Give a list of what load_trial returns"
            )
    if not trials:
        raise InputError("there is no trial to fit", where="trials")
    known: dict[str, tuple[Trial, bool]] = {}
    for trial, out in [(t, False) for t in trials] + [(t, True) for t in held_out]:
        other, other_out = known.get(fingerprint(trial), (None, out))
        if other is not None:
            what, right = (
                ("is", "Give it once")
                if out == other_out
                else (
                    "is fitted and held out: it is",
                    "A held-out trial must be one that the fit has not seen",
                )
            )
            raise InputError(
                f"{what} the same recording as {other.path}", file=trial.path, right=right
            )
        known[fingerprint(trial)] = (trial, out)
    for trial in (*trials, *held_out):
        _check_recording(trials[0], trial, series)


def _check_recording(first: Trial, trial: Trial, series: Sequence[str]) -> None:
    def refused(what: str, where: str | None, right: str | None) -> InputError:
        return InputError(what, file=trial.path, where=where, right=right)

    if any(note.startswith(APPLIED) for note in trial.notes):
        raise refused(
            "has a fitted contact already",
            None,
            "Fit the trial as it was recorded: what one fit found would be lost in the next",
        )
    a = vars(first.subject)
    b = vars(trial.subject)
    if a != b:
        differences = "; ".join(
            f"{name} {value} and {a[name]}" for name, value in b.items() if value != a[name]
        )
        raise refused(
            f"is of another subject than {first.path}: {differences}",
            "subject",
            "Fit one subject at a time",
        )
    if trial.model != first.model:
        raise refused(
            f"has another model than {first.path}",
            "model",
            "Trials that are fitted together share the model of the foot",
        )
    plate = trial.prosthetic_plate
    stances = [
        s for s in known_stances(plate) if s.end_s > trial.start_s and s.start_s < trial.end_s
    ]
    if not stances:
        raise refused(
            "its plate saw no stance of the prosthetic foot in the trial's window", "forces", None
        )
    for stance in stances:
        if not (
            stance.complete and stance.start_s >= trial.start_s and stance.end_s <= trial.end_s
        ):
            raise refused(
                f"the plate saw only part of the stance at {stance.start_s:.2f} to "
                f"{stance.end_s:.2f} s, or the window of {trial.start_s:.2f} to "
                f"{trial.end_s:.2f} s cuts it",
                "window",
                "Choose a window that holds whole stances only",
            )
    if any(name in COP for name in series) and not plate.has_cop:
        raise refused(
            "its plate has no centre of pressure, which is to be compared",
            "forces",
            "Leave the centre of pressure out of the comparison (--no-cop), or the trial",
        )
