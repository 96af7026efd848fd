"""What the validation is made of: its inputs with their walks, its options, and what one of its sections found."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from vsf_drake.analysis.comparison import Comparison, compare
from vsf_drake.analysis.contact_fit.problem import labels_of
from vsf_drake.analysis.metrics import WalkMetrics, stance_curve, walk_metrics, warnings
from vsf_drake.analysis.offsets import OffsetFit, fit_offsets
from vsf_drake.bench_curves import BenchCurves, load_bench_curves
from vsf_drake.contact_file import FittedContact, load_contact
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.files import resource, sha256
from vsf_drake.motion.fitted_trial import fingerprint, trial_with
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.parameters import FootParameters, ModelParameters
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import DEFAULT_STEP_S, Walker

FITTED, HELD_OUT, OFFSETS_FITTED = "fitted", "held out", "offsets fitted"
"""What a walk's agreement with its plate is worth: the fit has seen it, has not, or its offsets were fitted to it."""
Table_co = TypeVar("Table_co", covariant=True)
Progress = Callable[[str, float], None]
"""Called with what is being done and the finished fraction of it."""
SETTINGS, REPEATS, TIERS = ("low", "medium", "high"), 3, ("laboratory", "exact")
"""Of the embedded trials."""
KEEP, STEP_S = ("time_s", "grf_W", "cop_W", "energy_j"), 2e-3
"""What sections that walk often keep of a walk, and the step of these walks."""
_EMBEDDED = "data/reference_subject"
_TYPICAL_EVALUATIONS = 25


@dataclass(frozen=True, kw_only=True)
class StudyOptions:
    """How much of the validation is done, and how."""

    quick: bool = False  # the short form: fewer walks, coarser steps, small samples
    full: bool = False  # with the sections that take longest, and energies in finer steps
    seed: int = 0  # of all that is random
    workers: int | None = (
        None  # processes for many walks; None for one a core. The numbers do not depend on it
    )
    iso_force_n: float | None = (
        None  # largest of the ISO 22675 loading profile; None for the subject's weight
    )

    @property
    def step_s(self) -> float:
        """Step (s) of the walks that are reported."""
        return 2e-3 if self.quick else DEFAULT_STEP_S


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyWalk:
    """One trial of the study: what was recorded, and what was simulated."""

    label: str  # its name, unlike that of any other walk of the study
    role: str  # FITTED, HELD_OUT or OFFSETS_FITTED
    recorded: Trial  # as it was read
    trial: Trial  # as it was walked: with the fitted contact, or with fitted offsets
    result: WalkResult
    comparison: Comparison  # with the plate under the prosthetic foot
    metrics: WalkMetrics  # with a null model where there is another trial to make it of
    warnings: tuple[str, ...]  # sentences on what of it is doubtful

    @property
    def fulcrum_mm(self) -> float:
        """Where the fulcrum stood, from the keel's posterior end A: the condition."""
        return round(1e3 * self.trial.fulcrum_m, 6)


@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """Everything that the sections of the validation are computed from."""

    walks: tuple[StudyWalk, ...]  # at least one, by fulcrum position and name
    failed: tuple[
        tuple[str, str], ...
    ] = ()  # (label, why) of the trials that could not be read or walked
    model: ModelParameters  # the device, with the fitted contact where there is one
    contact: FittedContact | None = None
    contact_name: str = ""  # of its file
    bench: BenchCurves | None = None  # measured load-displacement curves
    bench_problem: str | None = None  # why a file that was given is not used
    options: StudyOptions
    inputs: Mapping[str, str] = field(
        default_factory=dict
    )  # SHA-256 by name of every file that was read

    @property
    def synthetic(self) -> bool:
        """Whether any walk was constructed rather than recorded; of the bench `bench.synthetic` tells."""
        return any(walk.trial.synthetic for walk in self.walks)

    def conditions(self) -> dict[float, tuple[StudyWalk, ...]]:
        """Walks by fulcrum position (mm), softest first."""
        positions = sorted({walk.fulcrum_mm for walk in self.walks})
        return {x: tuple(walk for walk in self.walks if walk.fulcrum_mm == x) for x in positions}

    @property
    def shown(self) -> StudyWalk:
        """The walk that stands for all to look at: a held-out one of the middle condition if there is one."""
        conditions = [*self.conditions().values()]
        middle = conditions[len(conditions) // 2]
        return next((walk for walk in middle if walk.role == HELD_OUT), middle[0])


@dataclass(frozen=True, kw_only=True, eq=False)
class Section(Generic[Table_co]):
    """What one section of the validation found; names end in their unit."""

    table: Table_co  # a record; None in it for what is unknown
    arrays: dict[str, np.ndarray] = field(
        default_factory=dict
    )  # curves, names without "/"; NaN where there is nothing
    missing: tuple[str, ...] = ()  # sentences on what is not there, and why


def known(values: Iterable[float | None]) -> np.ndarray:
    """Those of the numbers that are neither None nor NaN."""
    numbers = np.array([*values], dtype=float).ravel()
    return np.asarray(numbers[np.isfinite(numbers)])


def finite(value: float | np.floating[Any]) -> float | None:
    """The number, as records have it: None if it is not known."""
    return float(value) if np.isfinite(value) else None


def rms(values: Iterable[float | None]) -> float:
    """Root mean square of what is known; NaN if nothing is."""
    numbers = known(values)
    return float(np.sqrt(np.mean(numbers**2))) if numbers.size else float("nan")


@dataclass(frozen=True)
class Spread:
    """Mean and sample standard deviation of what is known, None where that is too little, and how much it is."""

    mean: float | None
    sd: float | None
    n: int


def spread(values: Iterable[float | None]) -> Spread:
    """Over what is known of the numbers."""
    numbers = known(values)
    return Spread(
        float(numbers.mean()) if numbers.size else None,
        float(numbers.std(ddof=1)) if numbers.size > 1 else None,
        numbers.size,
    )


def reached(foot: FootParameters, fulcrums_m: Iterable[float]) -> list[float]:
    """Those of the positions (m from A) that the carriage reaches."""
    low, high = foot.fulcrum.rearmost_m - 1e-9, foot.fulcrum.foremost_m + 1e-9
    return [float(x) for x in fulcrums_m if low <= x <= high]


def walkers_of(trials: Iterable[Trial]) -> list[Walker]:
    """What walks each trial; those of one person on one device share it."""
    walkers: list[Walker] = []
    for trial in trials:
        same = (one for one in walkers if (one.subject, one.model) == (trial.subject, trial.model))
        walkers.append(next(same, None) or Walker(trial.subject, trial.model))
    return walkers


def embedded_trials(tier: str = TIERS[0], *, quick: bool = False) -> tuple[Path, ...]:
    """Manifests of the trials that ship with the package, three a setting; one a setting if `quick`.

    All are synthetic, and say so. The tier `exact` is without errors of measurement, `laboratory` has them.
    """
    if tier not in TIERS:
        raise ValueError(f"there is no tier {tier!r}; there are {', '.join(TIERS)}")
    numbers = (2,) if quick else range(1, REPEATS + 1)
    return tuple(
        resource(f"{_EMBEDDED}/{tier}/{setting}_{number}.yaml")
        for setting in SETTINGS
        for number in numbers
    )


def embedded_contact(tier: str = TIERS[0]) -> Path:
    """The contact that was fitted to low_1 and high_1 of a tier of the embedded trials, and to their bench."""
    return resource(f"{_EMBEDDED}/{tier}/contact.yaml")


def embedded_contact_beside(manifest: str | Path) -> Path | None:
    """The embedded contact of the tier that a manifest stands in; None where it is none of the embedded ones."""
    beside = Path(manifest).with_name("contact.yaml")
    return (
        beside
        if beside.is_file() and sha256(beside) in map(sha256, map(embedded_contact, TIERS))
        else None
    )


def embedded_bench() -> Path:
    """Load-displacement curves of the embedded trials' foot: the virtual laboratory's, synthetic."""
    return resource(f"{_EMBEDDED}/bench_curves.csv")


def check_named_once(manifests: Sequence[str | Path]) -> None:
    """Raises InputError if two of the manifests are one file."""
    files = [Path(manifest).resolve() for manifest in manifests]
    for i, file in enumerate(files):
        if file in files[:i]:
            raise InputError("is named twice", file=manifests[i], right="Name every trial once")


def make_study(
    manifests: Sequence[str | Path],
    *,
    contact: str | Path | None = None,
    bench: str | Path | None = None,
    options: StudyOptions | None = None,
    progress: Progress | None = None,
) -> Study:
    """Reads and walks every trial.

    With a fitted contact (a contact file) each is walked as the fit says; without one, after its offsets were fitted to
    its own plate. A trial that cannot be read or walked is kept apart with the reason and stops no other; `bench`, a
    file of load-displacement curves, likewise. InputError if there is no trial, one twice, or no usable one or contact;
    SimulationError if the only trial cannot be walked.
    """
    options = options or StudyOptions()
    if not manifests:
        raise InputError("there is no trial", right="Name at least one manifest")
    check_named_once(manifests)
    fitted = None if contact is None else load_contact(contact)
    curves, problem = (None, None) if bench is None else _bench(bench)
    inputs = {
        f"{kind}: {Path(file).name}": sha256(file)
        for kind, file, used in (("contact", contact, fitted), ("bench", bench, curves))
        if file is not None and used is not None
    }
    read: list[tuple[Trial, Trial]] = []
    failed: list[tuple[str, str]] = []
    for manifest in map(Path, manifests):
        try:
            recorded = load_trial(manifest)
            read.append(
                (
                    recorded,
                    recorded if fitted is None else trial_with(recorded, fitted, file=contact),
                )
            )
        except InputError as error:
            failed.append((manifest.stem, str(error)))
    walked: list[tuple[str, Trial, ValidatedWalk]] = []
    for i, (label, (recorded, trial)) in enumerate(
        zip(labels_of([one for one, _ in read]), read, strict=True)
    ):

        def show(what: str, fraction: float, label: str = label, i: int = i) -> None:
            if progress:
                progress(f"{label}: {what}", (i + fraction) / len(read))

        try:
            walked.append(
                (
                    label,
                    recorded,
                    walk_trial(
                        trial, with_fit=fitted is None, step_s=options.step_s, progress=show
                    ),
                )
            )
        except (InputError, SimulationError) as error:
            failed.append((label, str(error)))
            if isinstance(error, SimulationError) and len(manifests) == 1:
                raise
    if not walked:
        raise InputError(
            "no trial can be used: " + "; ".join(f"{label}: {why}" for label, why in failed)
        )
    walks = [_study_walk(i, walked, fitted) for i in range(len(walked))]
    return Study(
        walks=tuple(sorted(walks, key=lambda walk: (walk.fulcrum_mm, walk.label))),
        failed=tuple(failed),
        model=walked[0][2].trial.model,
        contact=fitted,
        contact_name="" if contact is None else Path(contact).name,
        bench=curves,
        bench_problem=problem,
        options=options,
        inputs=inputs
        | {
            f"{label}: {file}": digest
            for label, trial, _ in walked
            for file, digest in trial.inputs.items()
        },
    )


def _bench(file: str | Path) -> tuple[BenchCurves | None, str | None]:
    """The curves of a file, or why it is not used."""
    try:
        if Path(file).suffix.lower() in (".yaml", ".yml"):
            raise InputError(
                "is what a fit takes of a bench; the validation compares whole curves",
                file=file,
                right="Give a CSV with fulcrum_mm, displacement_mm and load_n",
            )
        return load_bench_curves(file), None
    except InputError as error:
        return None, str(error)


def _study_walk(
    i: int, walked: list[tuple[str, Trial, ValidatedWalk]], fitted: FittedContact | None
) -> StudyWalk:
    """The i-th walk; its null model is made of the fitted trials, or of all others where none was fitted."""
    label, recorded, walk = walked[i]
    prints = set() if fitted is None else {trial.fingerprint for trial in fitted.trials}
    seen = [fingerprint(trial) in prints for _, trial, _ in walked]
    others = [
        trial for j, (_, trial, _) in enumerate(walked) if j != i and (seen[j] or not any(seen))
    ]
    plate, result = recorded.prosthetic_plate, walk.result
    comparison = compare(result, plate)
    curves = [stance_curve(t.prosthetic_plate, subject_mass_kg=t.subject.mass_kg) for t in others]
    candidates = [
        walk_metrics(result, plate, comparison=comparison, null_curve=curve)
        for curve in curves
        if curve is not None
    ] or [walk_metrics(result, plate, comparison=comparison)]
    errors = [metrics.null_model_grf_rmse_bw for metrics in candidates]
    metrics = candidates[int(np.argmin([np.inf if error is None else error for error in errors]))]
    return StudyWalk(
        label=label,
        role=OFFSETS_FITTED if fitted is None else FITTED if seen[i] else HELD_OUT,
        recorded=recorded,
        trial=walk.trial
        if walk.fit is None
        else dataclasses.replace(walk.trial, offsets=walk.fit.offsets),
        result=result,
        comparison=comparison,
        metrics=metrics,
        warnings=tuple(warnings(result, comparison, metrics, walk.fit)),
    )


@dataclass(frozen=True)
class ValidatedWalk:
    """One trial of the validation: what was recorded (as it was walked), what was simulated, with which offsets."""

    trial: Trial
    result: WalkResult
    fit: OffsetFit | None


def validate_walk(
    manifest: str | Path,
    *,
    with_fit: bool = True,
    contact: str | Path | None = None,
    step_s: float = DEFAULT_STEP_S,
    progress: Progress | None = None,
) -> ValidatedWalk:
    """Simulates the trial of `manifest`, after fitting the geometric offsets if `with_fit`.

    The numbers of a contact file replace the model's; it has offsets of its own, so `with_fit` must then be False.
    InputError if a file cannot be used, SimulationError if the walk fails.
    """
    if with_fit and contact is not None:
        raise ValueError("a fitted contact has its offsets already: they are not fitted on top")
    trial = load_trial(manifest)
    if contact is not None:
        trial = trial_with(trial, load_contact(contact), file=contact)
    return walk_trial(trial, with_fit=with_fit, step_s=step_s, progress=progress)


def walk_trial(
    trial: Trial,
    *,
    with_fit: bool,
    step_s: float = DEFAULT_STEP_S,
    progress: Progress | None = None,
) -> ValidatedWalk:
    """Simulates a trial that was read, after fitting its geometric offsets if `with_fit`."""
    walker = Walker(trial.subject, trial.model)
    fit = None
    if with_fit:
        fit = fit_offsets(
            trial,
            walker=walker,
            progress=progress
            and (lambda n, _: progress("fitting offsets", min(0.99, n / _TYPICAL_EVALUATIONS))),
        )
    offsets = fit.offsets if fit else trial.offsets
    walk = walker.walk(
        trial.trajectory,
        fulcrum_m=trial.fulcrum_m,
        start_s=trial.start_s,
        end_s=trial.end_s,
        step_s=step_s,
        offsets=offsets,
        progress=progress and (lambda f: progress("walking", f)),
    )
    return ValidatedWalk(trial=trial, result=walker.result(walk, trial, offsets), fit=fit)
