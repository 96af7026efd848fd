"""What a fit is worth: errors on trials that it has and has not seen, beside what they would be
without a model.

Null model of a trial: the harder null (`walks.null_model`) of the other fitted trials' measured
curves. Fulcrum sweep: the trial is walked with the fulcrum at positions over the whole carriage; a
model that stands for the foot errs least where the fulcrum really stood.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from vsf_drake.base.errors import FitError, InputError, SimulationError
from vsf_drake.base.files import flat
from vsf_drake.base.sentences import say
from vsf_drake.base.threads import one_thread
from vsf_drake.fit.parameters import owner
from vsf_drake.fit.problem import check_recordings, labels_with
from vsf_drake.fit.solution import ALIKE, ContactFitSolution, JointEnd, far_parameters
from vsf_drake.fit.solve import SURE_SHARE
from vsf_drake.model.bench_curves import BenchMeasurement, bench_doubts
from vsf_drake.model.parameters import FootParameters
from vsf_drake.model.setting import moves, setting_of
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.bench_stiffness import BenchStiffness
from vsf_drake.walks.angle_errors import AngleErrorRow, JudgedTrial, angle_error_rows
from vsf_drake.walks.comparison import rmse
from vsf_drake.walks.fulcrum_sweep import FulcrumSweep, sweep_positions, swept
from vsf_drake.walks.metrics import WalkMetrics, known_curves, walk_metrics
from vsf_drake.walks.null_model import several_settings
from vsf_drake.walks.plate_score import fulcrum_errors
from vsf_drake.walks.prediction import PHYSICS, LayerTable, layer_sentences, layer_table
from vsf_drake.walks.quantities import JUDGED, Judged, Scored, mean, quantity

FIRST = "> "
WARNING = "! "
"""How sentences of a verdict begin that page and screen show first."""
FITTED = "fitted"
HELD_OUT = "held out"
# within which a held-out trial's own height is looked for: 5 SD of a fitted trial's (its prior)
OWN_HEIGHT_M = 0.010
NOISE_TOO_SMALL = 1.2
"""Residuals larger than this many times what was assumed mean that errors are told too small (a
choice; with noise as assumed half of all series stay below 0.7, since the parameters take up some
of it and swing has none)."""


@dataclass(frozen=True, kw_only=True)
class PublishedFit:
    """What the model of McGeehan 2021 (doi 10.1115/1.4050456) was left with; two numbers: the least
    and the largest."""

    fitted_grf_rmse_bw: float = 0.053
    other_grf_rmse_bw: tuple[float, float] = (0.10, 0.14)
    bench_rmse_n_per_mm: float = 1.37
    mid_range_rmse_mm: float = 0.45


PUBLISHED = PublishedFit()
LEFT_OUT = (JUDGED, "cop_rmse_fl", "cop_ml_rmse_fl")


@dataclass(frozen=True, kw_only=True, eq=False)
class TrialCurves:
    """Model and plate of one trial: forces over time, the centre of pressure over the first
    stance."""

    time_s: np.ndarray  # (n,)
    model_bw: np.ndarray  # (n, 3) fore-aft, lateral, vertical
    measured_bw: np.ndarray
    cop_measured_fl: np.ndarray  # (101,) fore-aft; NaN where it is not known
    cop_model_fl: np.ndarray


@dataclass(frozen=True, kw_only=True)
class TrialScore(Judged):
    """One trial under a fit.

    Attributes:
        role: FITTED or HELD_OUT.
        metrics: with the null model of the other fitted trials.
        floor_grf_rmse_bw: what the true foot would be left with on this recording's motion, where
            that is known.
        own_height_m: of a held-out trial the height (foot up +) that was fitted to its own plate,
            if that was asked for; then nothing here is a prediction.
    """

    label: str
    role: str
    metrics: WalkMetrics
    curves: TrialCurves
    sweep: FulcrumSweep | None
    floor_grf_rmse_bw: float | None = None
    own_height_m: float | None = None

    @property
    def below_floor(self) -> bool:
        """Whether the fit is left with less than the true foot would be."""
        floor = self.floor_grf_rmse_bw
        return floor is not None and self.error_bw is not None and self.error_bw < floor

    def number(self, name: str) -> Any:
        """What it, its metrics or its sweep (`sweep_best_mm`) holds under this name."""
        if name == "sweep_best_mm":
            return self.sweep and self.sweep.best_mm
        return getattr(self, name, self.metrics.number(name))


@dataclass(frozen=True, kw_only=True)
class LeftOut(Scored):
    """A fit without the trials `left_out` (labels), judged by them: mean errors (LEFT_OUT), or why
    there are none."""

    kind: str  # "trial" or "stiffness"
    left_out: tuple[str, ...]
    failed: str = ""
    scores: Mapping[str, float | None] = flat()


@dataclass(frozen=True, kw_only=True)
class Beside:
    """A quantity of the bench at its fulcrum positions, and at the heel if that was measured, which
    stands apart and is not in the root mean square."""

    uncertainty: float
    measured: tuple[float, ...]
    model: tuple[float, ...]
    heel_measured: float | None
    heel_model: float | None
    rmse: float

    def rows(self, fulcrum_mm: Sequence[float | None]) -> list[tuple[float | str, float, float]]:
        """Where (mm, or the forefoot of a passive foot), measured and model, the heel last where
        it was measured."""
        places = ["forefoot" if mm is None else mm for mm in fulcrum_mm]
        rows: list[tuple[float | str, float, float]] = [
            *zip(places, self.measured, self.model, strict=True)
        ]
        if self.heel_measured is not None and self.heel_model is not None:
            rows.append(("heel", self.heel_measured, self.heel_model))
        return rows


@dataclass(frozen=True, kw_only=True)
class BenchRow:
    """Measurement and model on the bench; no quantity where the fit was not judged."""

    name: str
    synthetic: bool
    max_load_n: float
    fulcrum_mm: tuple[float | None, ...]  # None of a passive foot
    stiffness: Beside | None = None  # N/mm
    mid_range: Beside | None = None
    """mm, the platen's displacement at half of the largest load, where it was measured"""
    doubts: tuple[str, ...] = ()  # what speaks against the measurement itself


@dataclass(frozen=True, kw_only=True)
class SimulatedBench:
    """The fitted foot in the testing machine where nobody measured it: N/mm at the fulcrum
    positions of the fitted trials and at the heel, and the same of the model before the fit. None
    where the foot cannot bear the load."""

    fulcrum_mm: tuple[float | None, ...]  # None of a passive foot
    fitted_n_per_mm: tuple[float, ...] | None
    heel_n_per_mm: float | None
    model_n_per_mm: tuple[float, ...]
    model_heel_n_per_mm: float


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """All that speaks for and against a fit; `bench` is None without one, `simulated_bench` with
    one."""

    scores: tuple[TrialScore, ...]
    left_out: tuple[LeftOut, ...]
    bench: BenchRow | None
    angle_errors: tuple[AngleErrorRow, ...] = ()  # none where it was not asked for
    layers: LayerTable | None = None  # likewise
    simulated_bench: SimulatedBench | None = None

    def of(self, role: str) -> list[TrialScore]:
        """The trials of a role."""
        return [score for score in self.scores if score.role == role]

    def mean(self, role: str, key: str = JUDGED) -> float | None:
        """Mean of a metric over the trials of a role; None where there is none."""
        return mean(score.number(key) for score in self.of(role))


@one_thread()
def assess(
    solution: ContactFitSolution,
    held_out: Sequence[Trial] = (),
    *,
    sweep: bool = True,
    leave_out: bool = True,
    angle_errors: bool = True,
    layers: bool = True,
    own_height: bool = False,
    floors: Mapping[str, float] | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Assessment:
    """Judges a fit that succeeded, by trials of the same subject that were not fitted, too.

    A held-out trial is walked with what all trials share, and nothing of its own. Of its plate the
    model knows the instants of strike and lift-off, by which the shared curves are laid over the
    gait cycle.

    Args:
        sweep: whether to move the fulcrum over its range in every trial.
        leave_out: whether to fit again without each trial, and without each stiffness.
        angle_errors: whether to walk every trial with errors of hip and knee of its own, too.
        layers: whether to predict every trial with the person's momentum and the person's
            own curve, too.
        own_height: whether each held-out trial is judged at the height at which it meets its own
            plate best.
        floors: by label, the resultant error (BW) of the true foot on a recording's motion, where
            it is known.

    Raises:
        InputError: a held-out trial was fitted, or is of another subject. FitError,
            SimulationError: it failed.
    """
    solution.check()
    fit = solution.fit
    floors = floors or {}
    tell = progress or (lambda what, share: None)
    check_recordings(fit.trials, held_out, series=fit.options.series)
    names = labels_with(fit, held_out)
    unknown = set(floors) - set(names)
    if unknown:
        raise InputError(
            f"there is no trial {min(unknown)}",
            where="floors",
            right=f"There are: {', '.join(names)}",
        )
    heights = [height_of(solution, trial) if own_height else None for trial in held_out]
    held_out = [_raised(*pair) for pair in zip(held_out, heights, strict=True)]
    every = [*fit.trials, *held_out]
    scores = []
    for i, (trial, name) in enumerate(zip(every, names, strict=True)):
        tell(f"scoring {name}", i / len(names))
        others = [one for one in fit.trials if one is not trial]
        label = name if i < len(fit.trials) else None
        scores.append(_trial_score(solution, trial, label, name, others, sweep, floors.get(name)))
    for i, height in enumerate(heights, start=len(fit.trials)):
        if height is not None:
            scores[i] = replace(scores[i], own_height_m=height)
    joint = isinstance(solution.end, JointEnd)  # the paper's fit is of one trial
    left = _left_out(solution, tell) if leave_out and joint and len(fit.trials) > 1 else ()
    table = None
    rows = tuple[AngleErrorRow, ...]()
    contact = solution.contact() if angle_errors or layers else None
    if layers and contact:
        tell("predicting in layers", 1.0)
        table = layer_table(contact, fit.trials, held_out, names, step_s=fit.options.report_step_s)
    if angle_errors and contact:
        tell("walking with errors of hip and knee", 1.0)
        rows = angle_error_rows(
            [
                JudgedTrial(trial_with(trial, contact), score.role, score.null_bw)
                for trial, score in zip(every, scores, strict=True)
            ],
            step_s=fit.options.report_step_s,
            seed=fit.options.seed,
            in_layers=HELD_OUT,
            contact=None if table is None else table.teach(contact),
        )
    bench = bench_score(solution)
    return Assessment(
        scores=tuple(scores),
        left_out=left,
        bench=bench,
        angle_errors=rows,
        layers=table,
        simulated_bench=simulated_bench(solution) if joint and not bench else None,
    )


def height_of(solution: ContactFitSolution, trial: Trial) -> float:
    """The height (m, foot up +) at which the resultant of the fitted model is nearest to the
    trial's own plate."""

    def error(height_m: float) -> float:
        raised = _raised(trial, height_m)
        found = _error_bw(solution, raised, None, step_s=solution.fit.options.report_step_s)
        return np.inf if np.isnan(found) else found

    found = minimize_scalar(
        error, bounds=(-OWN_HEIGHT_M, OWN_HEIGHT_M), method="bounded", options={"xatol": 1e-5}
    )
    return float(found.x)


def _error_bw(solution: ContactFitSolution, trial: Trial, label: str | None, **how: float) -> float:
    """The error that a predicted walk is judged by; NaN where there is none."""
    try:
        comparison, result = solution.predict(trial, label, **how)
    except SimulationError:
        return np.nan
    found = walk_metrics(result, trial.prosthetic_plate, comparison=comparison).error_bw
    return np.nan if found is None else found


def _raised(trial: Trial, height_m: float | None) -> Trial:
    if height_m is None:
        return trial
    return replace(
        trial, offsets=replace(trial.offsets, height_m=trial.offsets.height_m + height_m)
    )


def _trial_score(
    solution: ContactFitSolution,
    trial: Trial,
    label: str | None,
    name: str,
    others: Sequence[Trial],
    sweep: bool,
    floor: float | None,
) -> TrialScore:
    comparison, result = solution.predict(trial, label, step_s=solution.fit.options.report_step_s)
    metrics = walk_metrics(
        result, trial.prosthetic_plate, comparison=comparison, others=known_curves(others)
    )
    weight = metrics.body_weight_n
    length = result.foot_length_m
    stance = comparison.stances[0]
    return TrialScore(
        label=name,
        role=FITTED if label else HELD_OUT,
        metrics=metrics,
        floor_grf_rmse_bw=floor,
        sweep=sweep_fulcrum(solution, trial, label) if sweep else None,
        curves=TrialCurves(
            time_s=comparison.time_s,
            model_bw=comparison.model / weight,
            measured_bw=comparison.measured / weight,
            cop_measured_fl=stance.measured_cop[:, 0] / length,
            cop_model_fl=stance.model_cop[:, 0] / length,
        ),
    )


def _left_out(
    solution: ContactFitSolution, tell: Callable[[str, float], None]
) -> tuple[LeftOut, ...]:
    fit = solution.fit
    settings: dict[float, tuple[str, ...]] = {}
    for trial, label in sorted(
        zip(fit.trials, fit.labels, strict=True), key=lambda pair: pair[0].fulcrum_m
    ):
        settings[trial.fulcrum_m] = (*settings.get(trial.fulcrum_m, ()), label)
    groups: list[tuple[str, tuple[str, ...]]] = [("trial", (label,)) for label in fit.labels]
    groups += [("stiffness", labels) for labels in settings.values() if len(settings) > 1]
    rows: dict[tuple[str, ...], LeftOut] = {}
    for i, (kind, labels) in enumerate(groups):
        tell(f"fitting without {', '.join(labels)}", i / len(groups))
        if labels not in rows:
            rows[labels] = _without(solution, kind, labels)
    return tuple(replace(rows[labels], kind=kind) for kind, labels in groups)


def _without(solution: ContactFitSolution, kind: str, labels: tuple[str, ...]) -> LeftOut:
    """What is known of a fit without these trials."""
    row = LeftOut(kind=kind, left_out=labels, scores=dict.fromkeys(LEFT_OUT))
    try:
        fewer = solution.refitted_without(labels)
        metrics = [
            _trial_score(fewer, trial, None, label, [], False, None).metrics
            for trial, label in zip(solution.fit.trials, solution.fit.labels, strict=True)
            if label in labels
        ]
    except (FitError, SimulationError) as error:
        return replace(row, failed=str(error))
    return replace(row, scores={name: mean(m.number(name) for m in metrics) for name in LEFT_OUT})


def bench_score(solution: ContactFitSolution) -> BenchRow | None:
    """The fitted foot on the bench; None where the fit has none."""
    bench = solution.fit.bench
    machine = solution.fit.machine
    if bench is None or machine is None:
        return None

    def beside(
        factor: float, sd: float, measured: Sequence[float], heel: float | None, model: np.ndarray
    ) -> Beside:
        forefoot = tuple(factor * x for x in measured)
        shown = tuple((factor * model).tolist())
        return Beside(
            uncertainty=factor * sd,
            measured=forefoot,
            model=shown[: len(forefoot)],
            heel_measured=None if heel is None else factor * heel,
            heel_model=None if heel is None else shown[len(forefoot)],
            rmse=rmse(np.array(shown[: len(forefoot)]), np.array(forefoot)),
        )

    values = solution.all_values(None)
    mid_range = None
    if bench.mid_range_m is not None and bench.mid_range_uncertainty_m is not None:
        mid_range = beside(
            1e3,
            bench.mid_range_uncertainty_m,
            bench.mid_range_m,
            bench.heel_mid_range_m,
            machine.displacement(values)[0],
        )
    return replace(
        bench_row(bench, solution.fit.walker.model.foot),
        mid_range=mid_range,
        stiffness=beside(
            1e-3,
            bench.uncertainty_n_per_m,
            bench.stiffness_n_per_m,
            bench.heel_stiffness_n_per_m,
            machine.evaluate(values)[0],
        ),
    )


def bench_row(bench: BenchMeasurement, foot: FootParameters) -> BenchRow:
    """A bench of `foot` that nothing was judged by."""
    return BenchRow(
        name=bench.name,
        synthetic=bench.synthetic,
        max_load_n=bench.max_load_n,
        doubts=tuple(bench_doubts(bench)),
        fulcrum_mm=tuple(setting_of(foot, x).fulcrum_mm for x in bench.fulcrum_m),
    )


def sweep_fulcrum(
    solution: ContactFitSolution, trial: Trial, label: str | None
) -> FulcrumSweep | None:
    """Error of one trial over the carriage's range; None of a passive foot."""
    if not moves(trial.model.foot):
        return None
    positions = sweep_positions(trial)
    errors = fulcrum_errors(
        solution.fit.walker, trial, positions, **solution.fitted_for(trial, label)
    )
    return swept(positions, errors, true_m=trial.fulcrum_m)


def verdict(solution: ContactFitSolution, assessment: Assessment) -> tuple[str, ...]:
    """What to make of a fit that succeeded, in sentences with the numbers that they come from."""
    return in_full(marked_verdict(solution, assessment))


def marked_verdict(solution: ContactFitSolution, assessment: Assessment) -> list[str]:
    """The same, those that warn with WARNING in front, and its short form with FIRST."""
    layers = assessment.layers
    layer = None if layers is None else layers.earned
    end = solution.end if isinstance(solution.end, JointEnd) else None
    known = None if end is None else end.uncertainty
    left_out = {
        kind: [row for row in assessment.left_out if row.kind == kind]
        for kind in ("trial", "stiffness")
    }
    if {row.left_out for row in left_out["stiffness"]} == {
        row.left_out for row in left_out["trial"]
    }:
        del left_out["stiffness"]  # one trial a stiffness: the same fits
    sentences = say(
        "fit_verdict",
        percent=quantity(JUDGED).told,
        told=assessment,
        synthetic=any(trial.synthetic for trial in solution.fit.trials),
        message=solution.message,
        contradiction=solution.contradiction,
        paper=PUBLISHED,
        one_setting=not several_settings(t.fulcrum_m for t in solution.fit.trials),
        passive=not moves(solution.fit.walker.model.foot),
        own_height_m=OWN_HEIGHT_M,
        disturbed=[
            row
            for row in assessment.angle_errors
            if row.role == HELD_OUT and row.sd_deg and row.walks and row.layer == (layer or PHYSICS)
        ],
        layer=layer,
        left_out=[*left_out.items()],
        end=end,
        noise_too_small=NOISE_TOO_SMALL,
        sure_share=SURE_SHARE,
        alike_within=ALIKE,
        shared=known and [name for name in known.names if owner(name) is None],
        pairs=known and [pair for pair in known.together if not any(map(owner, pair.names))],
        unidentified=known
        and [name for name in known.unidentified if not name.startswith(("curve.", "trial."))],
    )
    return sentences + (layer_sentences(layers) if layers else [])


def in_full(sentences: Iterable[str]) -> tuple[str, ...]:
    """The marked verdict without its short form and without marks."""
    return tuple(
        sentence.removeprefix(WARNING) for sentence in sentences if not sentence.startswith(FIRST)
    )


def simulated_bench(solution: ContactFitSolution) -> SimulatedBench:
    """Stiffness between 200 and 600 N, as the bench of McGeehan 2021 has it."""
    fit = solution.fit
    fulcrums = sorted({trial.fulcrum_m for trial in fit.trials})
    machine = BenchStiffness(fit.walker.model.foot, fulcrums_m=fulcrums, heel=True)
    *model, model_heel = (1e-3 * machine.evaluate({})[0]).tolist()
    try:
        *fitted, heel = (1e-3 * machine.evaluate(solution.all_values(None))[0]).tolist()
    except SimulationError:
        fitted = None
        heel = None
    return SimulatedBench(
        fulcrum_mm=tuple(setting_of(fit.walker.model.foot, x).fulcrum_mm for x in fulcrums),
        fitted_n_per_mm=None if fitted is None else tuple(fitted),
        heel_n_per_mm=heel,
        model_n_per_mm=tuple(model),
        model_heel_n_per_mm=model_heel,
    )


STEEPEST_FEW = 3
"""So many parameters with the steepest cost are named where a search did not converge."""


def failure(solution: ContactFitSolution) -> tuple[str, ...]:
    """Of a joint fit that did not converge: what its best point is, what stood in the way and what
    to do, in sentences."""
    end = solution.end
    assert isinstance(end, JointEnd)
    at = end.evaluation
    gradient = at.jacobian.T @ at.residual
    # what a step along one parameter alone would gain, were the residuals linear
    gain = 0.5 * gradient**2 / np.maximum(np.einsum("mp,mp->p", at.jacobian, at.jacobian), 1e-12)
    names = (item.name for item in solution.fit.parameters.free)
    steepest = sorted(zip(gain.tolist(), names, strict=True), reverse=True)[:STEEPEST_FEW]
    return tuple(
        say(
            "fit_failed",
            message=solution.message,
            end=end,
            far=far_parameters(end),
            steepest=[row for row in steepest if row[0] > 0.0],
            noise_too_small=NOISE_TOO_SMALL,
            iterations=solution.fit.joint.iterations,
        )
    )
