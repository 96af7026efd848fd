"""What the validation is made of: its inputs with their walks, its options, and what one of its
sections found."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.base.files import sha256
from vsf_drake.base.progress import Progress, part_of
from vsf_drake.model.bench_curves import BenchCurves, load_bench_curves
from vsf_drake.model.contact_file import FittedContact, load_contact
from vsf_drake.model.parameters import ModelParameters
from vsf_drake.model.setting import AtSetting
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.results import WalkResult
from vsf_drake.validation.options import StudyOptions
from vsf_drake.walks.comparison import Comparison, compare
from vsf_drake.walks.metrics import WalkMetrics, known_curves, walk_metrics, warnings
from vsf_drake.walks.numbers import by_setting
from vsf_drake.walks.offsets import OffsetFit
from vsf_drake.walks.prediction import recording_of
from vsf_drake.walks.recorded_walk import check_named_once, labels_of, walk_trial, with_contact

FITTED, HELD_OUT, OFFSETS_FITTED = "fitted", "held out", "offsets fitted"
"""What a walk's agreement with its plate is worth: the fit has seen it, has not, or its offsets
were fitted to it."""
PLATELESS = "no plate"  # in place of these where no force was measured
Table_co = TypeVar("Table_co", covariant=True)


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyWalk:
    """One trial of the study: what was recorded, and what was simulated."""

    label: str  # its name, unlike that of any other walk of the study
    role: str  # FITTED, HELD_OUT, OFFSETS_FITTED or PLATELESS
    recorded: Trial  # as it was read
    trial: Trial  # as it was walked: with the fitted contact, or with fitted offsets
    result: WalkResult
    comparison: Comparison  # with the plate under the prosthetic foot
    metrics: WalkMetrics
    """with the null model of fitted trials, or of all others where none was fitted"""
    warnings: tuple[str, ...]  # sentences on what of it is doubtful

    @property
    def setting(self) -> AtSetting:
        """The condition: where the fulcrum stood, or which passive foot it was."""
        return self.trial.setting

    @property
    def fulcrum_mm(self) -> float:
        """Where the fulcrum stood, from the keel's posterior end A, or the keel is clamped."""
        return round(1e3 * self.trial.fulcrum_m, 6)


@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """Everything that the sections of the validation are computed from."""

    walks: tuple[StudyWalk, ...]  # at least one, by setting and name
    failed: tuple[tuple[str, str], ...] = ()
    """(label, why) of the trials that could not be read or walked"""
    model: ModelParameters  # the device, with the fitted contact where there is one
    contact: FittedContact | None = None
    contact_name: str = ""  # of its file
    bench: BenchCurves | None = None  # measured load-displacement curves
    options: StudyOptions
    inputs: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 by name of every file that was read"""

    @property
    def synthetic(self) -> bool:
        """Whether any walk was constructed rather than recorded; of the bench `bench.synthetic`
        tells."""
        return any(walk.trial.synthetic for walk in self.walks)

    @property
    def passive(self) -> bool:
        """Whether a foot of it is passive, so that nothing is told of settings."""
        return any(walk.setting.fulcrum_mm is None for walk in self.walks)

    def conditions(self) -> dict[AtSetting, list[StudyWalk]]:
        """Walks by setting, softest first."""
        return by_setting(self.walks)

    @property
    def compared(self) -> Study:
        """The same with the walks alone that have a plate, of which there may be none."""
        walks = tuple(walk for walk in self.walks if walk.role != PLATELESS)
        return dataclasses.replace(self, walks=walks)

    @property
    def shown(self) -> StudyWalk:
        """The walk that stands for all to look at: a held-out one of the middle condition if there
        is one; with a plate if any walk has one."""
        conditions = [*by_setting(self.compared.walks or self.walks).values()]
        middle = conditions[len(conditions) // 2]
        return next((walk for walk in middle if walk.role == HELD_OUT), middle[0])


@dataclass(frozen=True, kw_only=True, eq=False)
class Section(Generic[Table_co]):
    """What one section of the validation found; names end in their unit."""

    table: Table_co  # a record; None in it for what is unknown
    arrays: dict[str, np.ndarray] = field(default_factory=dict)
    """curves, names without "/"; NaN where there is nothing"""
    missing: tuple[str, ...] = ()  # sentences on what is not there, and why


@contextlib.contextmanager
def told(missing: list[str], what: str) -> Iterator[None]:
    """What cannot be done within is a sentence among `missing`, and stops nothing else."""
    try:
        yield
    except (InputError, SimulationError) as error:
        missing.append(f"{what}: {error}.")


def make_study(
    manifests: Sequence[str | Path],
    *,
    contact: str | Path | None = None,
    bench: str | Path | None = None,
    options: StudyOptions | None = None,
    progress: Progress | None = None,
    judge: Callable[[Sequence[Trial]], Sequence[Trial]] = list,
) -> Study:
    """Reads and walks every trial.

    With a fitted contact (a contact file) each is walked as the fit says; without one, after its
    offsets were fitted to its own plate. A trial that cannot be read or walked is kept apart with
    the reason and stops no other. `judge` says what the recordings are worth: see `Trial.judged`.
    InputError before anything is walked if `bench`, a file of load-displacement curves, or the
    contact cannot be used, or if there is no trial, or one twice; later if none is usable.
    SimulationError if the only trial cannot be walked.
    """
    options = options or StudyOptions()
    if not manifests:
        raise InputError("there is no trial", right="Name at least one manifest")
    check_named_once(manifests)
    fitted = None if contact is None else load_contact(contact)
    curves = None if bench is None else _bench(bench)
    inputs = {
        f"{kind}: {Path(file).name}": sha256(file)
        for kind, file, used in (("contact", contact, fitted), ("bench", bench, curves))
        if file is not None and used is not None
    }
    failed: list[tuple[str, str]] = []

    @contextlib.contextmanager
    def apart(label: str) -> Iterator[None]:
        """A trial that cannot be used is kept apart."""
        try:
            yield
        except (InputError, SimulationError) as error:
            failed.append((label, str(error)))
            if isinstance(error, SimulationError) and len(manifests) == 1:
                raise

    every: list[Trial] = []
    for manifest in map(Path, manifests):
        with apart(manifest.stem):
            every.append(load_trial(manifest))
    read: list[tuple[Trial, Trial]] = []
    for recorded in judge(every) if every else ():
        with apart(recorded.path.stem):
            trial = recorded if fitted is None else with_contact(recorded, fitted, file=contact)
            read.append((recorded, trial))
    walked: list[_Walked] = []
    labels = labels_of([recorded for recorded, _ in read])
    for i, (label, (recorded, trial)) in enumerate(zip(labels, read, strict=True)):
        show = part_of(progress, i / len(read), 1.0 / len(read), name=f"{label}: ")
        with apart(label):
            walk = walk_trial(trial, with_fit=fitted is None, step_s=options.step_s, progress=show)
            walked.append(_Walked(label, recorded, trial, *walk))
    if not walked:
        raise InputError(
            "no trial can be used: " + "; ".join(f"{label}: {why}" for label, why in failed)
        )
    walks = [_study_walk(i, walked, fitted) for i in range(len(walked))]
    return Study(
        walks=tuple(sorted(walks, key=lambda walk: (walk.setting.setting_order, walk.label))),
        failed=tuple(failed),
        model=walked[0].trial.model,
        contact=fitted,
        contact_name="" if contact is None else Path(contact).name,
        bench=curves,
        options=options,
        inputs=inputs
        | {
            f"{one.label}: {file}": digest
            for one in walked
            for file, digest in one.recorded.inputs.items()
        },
    )


def _bench(file: str | Path) -> BenchCurves:
    if Path(file).suffix.lower() in (".yaml", ".yml"):
        raise InputError(
            "is what a fit takes of a bench; the validation compares whole curves",
            file=file,
            right="Give a CSV with fulcrum_mm, displacement_mm and load_n",
        )
    return load_bench_curves(file)


class _Walked(NamedTuple):
    """What `_study_walk` judges: a trial as it was read, and walked."""

    label: str
    recorded: Trial
    trial: Trial
    result: WalkResult
    fit: OffsetFit | None


def _study_walk(i: int, walked: Sequence[_Walked], fitted: FittedContact | None) -> StudyWalk:
    """The i-th walk."""
    label, recorded, trial, result, fit = walked[i]
    prints = set() if fitted is None else {trial.fingerprint for trial in fitted.trials}
    seen = [fitted is not None and recording_of(one.recorded, fitted) in prints for one in walked]
    others = [one.recorded for j, one in enumerate(walked) if j != i and (seen[j] or not any(seen))]
    plate = recorded.plate
    comparison = compare(result, plate)
    metrics = walk_metrics(result, plate, comparison=comparison, others=known_curves(others))
    role = FITTED if seen[i] else HELD_OUT
    if plate is None:
        role = PLATELESS
    elif fitted is None:
        role = OFFSETS_FITTED
    return StudyWalk(
        label=label,
        role=role,
        recorded=recorded,
        trial=trial if fit is None else dataclasses.replace(trial, offsets=fit.offsets),
        result=result,
        comparison=comparison,
        metrics=metrics,
        warnings=tuple(warnings(result, comparison, metrics, fit)),
    )
