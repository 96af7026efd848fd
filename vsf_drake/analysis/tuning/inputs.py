"""The trials that a foot is tuned to: read, with a fitted contact or with offsets fitted to their plates."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from vsf_drake.analysis.contact_fit.recordings import labels_of
from vsf_drake.analysis.offsets import fit_offsets
from vsf_drake.analysis.validation.study import SETTINGS, embedded_contact, embedded_trials
from vsf_drake.contact_file import load_contact
from vsf_drake.errors import InputError
from vsf_drake.files import user_path
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.schema import load_yaml, quantity

Progress = Callable[[str, float], None]
"""Called with what is being done and the finished fraction of it."""
NO_CONTACT = (
    "No fitted contact was given: the foot's contact is the model file's, and only where the prosthesis sits was "
    "fitted, to each trial's own plate.")
_TYPICAL_EVALUATIONS = 25.0


@dataclass(frozen=True, eq=False)
class TuningTrials:
    """Trials as they are to be walked.

    Attributes:
        trials: in the order in which they were named. labels: a short name for each.
        notes: what a user should know of them.
    """

    trials: tuple[Trial, ...]
    labels: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def recorded_mm(self) -> list[float]:
        """Where the fulcrum stood in each trial (mm from A)."""
        return [round(1e3 * trial.fulcrum_m, 9) for trial in self.trials]

    @property
    def synthetic(self) -> bool:
        """Whether any of them was constructed rather than measured."""
        return any(trial.synthetic for trial in self.trials)

    @property
    def inputs(self) -> dict[str, str]:
        """SHA-256 of every file that was read, by trial and name."""
        return {f"{label}: {file}": digest for label, trial in zip(self.labels, self.trials, strict=True)
                for file, digest in trial.inputs.items()}

    @property
    def reach_mm(self) -> tuple[float, float]:
        """Between which positions (mm from A) the carriage of every trial's foot can stand."""
        feet = [trial.model.foot.fulcrum for trial in self.trials]
        return 1e3 * max(foot.rearmost_m for foot in feet), 1e3 * min(foot.foremost_m for foot in feet)


def embedded_tuning_trials(*, level: int, quick: bool = False) -> tuple[Path, ...]:
    """Manifests of synthetic trials that ship with the package: walks at the middle setting, of the laboratory tier.

    Three for level 1, whose repetition tells what a difference is worth; one if `quick`, and for level 2. Motions that
    were walked at several settings make no good person to begin with: each belongs to its own setting.
    """
    middle = [path for path in embedded_trials(quick=quick or level > 1) if path.stem.startswith(f"{SETTINGS[1]}_")]
    return tuple(middle)


def load_tuning_trials(
    manifests: Sequence[str | Path], *, contact: str | Path | None = None, level: int = 1,
    quick: bool = False, progress: Progress | None = None
) -> TuningTrials:
    """Reads trials of one person; without any, the embedded ones with the contact that was fitted to them.

    Args:
        contact: a contact file (`vsf-drake fit`). Without one, height, fore-aft position and alignment of the
            prosthesis are fitted to each trial's plate.
        level, quick: see `embedded_tuning_trials`, whose trials are taken where none is named.

    Raises:
        InputError: a file cannot be read or used; a trial is named twice; the trials are of several persons.
        SimulationError: a trial whose offsets are to be fitted cannot be walked.
    """
    if not manifests:
        manifests, contact = embedded_tuning_trials(level=level, quick=quick), contact or embedded_contact()
    files = [Path(manifest).resolve() for manifest in manifests]
    for i, file in enumerate(files):
        if file in files[:i]:
            raise InputError("is named twice", file=manifests[i], right="Name every trial once")
    trials = [load_trial(manifest) for manifest in manifests]
    check_one_person(trials)
    labels = labels_of(trials)
    if contact is not None:
        fitted = load_contact(contact)
        return TuningTrials(tuple(trial_with(trial, fitted, file=contact) for trial in trials), labels, ())
    found, notes = [], [NO_CONTACT]
    for i, (trial, label) in enumerate(zip(trials, labels, strict=True)):
        def show(count: int, cost: float, label: str = label, i: int = i) -> None:
            if progress:
                share = count / (count + _TYPICAL_EVALUATIONS)
                progress(f"{label}: fitting offsets, cost {cost:.1f}", (i + share) / len(trials))

        fit = fit_offsets(trial, progress=show)
        if not fit.success or fit.at_bound:
            ended = f"ended on a bound ({', '.join(fit.at_bound)})" if fit.at_bound else f"failed: {fit.message}"
            notes.append(f"{label}: the fit of its offsets {ended}.")
        found.append(dataclasses.replace(trial, offsets=fit.offsets))
    return TuningTrials(tuple(found), labels, tuple(notes))


def check_one_person(trials: Sequence[Trial]) -> None:
    """Raises InputError unless all trials are of one subject, with the prosthesis on one side."""
    first = trials[0]
    for trial in trials[1:]:
        if trial.subject != first.subject:
            raise InputError(f"is of another subject than {first.path}", file=trial.path, where="subject",
                             right="A setting is one person's: tune one subject at a time")


# Tasks for which a device stores one setting each: named trials, and what tells the tasks apart.
#
# On the command line a task is LABEL=TRIAL.yaml, and one label may be given several trials. A file tells more:
#
#     tasks:
#       - {label: slow, trials: [low_1.yaml, low_2.yaml], speed_m_per_s: 0.8}
#       - {label: fast, trials: [high_1.yaml], speed_m_per_s: 1.4, slope_deg: 0, carried_kg: 5}
#
# Paths are relative to the file. A descriptor is what the device can sense; those that are left out are not known.


DESCRIPTORS = {"speed_m_per_s": "m/s", "slope_deg": "°", "carried_kg": "kg"}
"""What may tell tasks apart, with its unit: walking speed, slope (uphill +), carried load."""


@dataclass(frozen=True, kw_only=True)
class ListedTask:
    """One task of a task file."""

    label: str
    trials: tuple[str, ...]
    speed_m_per_s: float | None = quantity(None, unit="m/s", low=0.0, high=10.0, source="measured or set")
    slope_deg: float | None = quantity(None, unit="deg", low=-45.0, high=45.0, source="measured, uphill +")
    carried_kg: float | None = quantity(None, unit="kg", low=0.0, high=200.0, source="measured")


@dataclass(frozen=True, kw_only=True)
class TaskFile:
    """A task file."""

    tasks: tuple[ListedTask, ...]


@dataclass(frozen=True)
class Task:
    """What one setting is for.

    Attributes:
        label: its name. manifests: of its trials. descriptors: by name of DESCRIPTORS, None where not known.
    """

    label: str
    manifests: tuple[Path, ...]
    descriptors: Mapping[str, float | None]


def read_tasks(words: Sequence[str]) -> tuple[Task, ...]:
    """Tasks as they are named on the command line: LABEL=TRIAL.yaml, or task files.

    Raises:
        InputError: a word is neither; a file cannot be read; a label is empty or has two sets of descriptors; there are
            fewer than two tasks; a trial is in two.
    """
    found: dict[str, Task] = {}
    for word in words:
        for task in _named(word) if "=" in word else _listed(user_path(word)):
            known = found.get(task.label)
            if known is not None and (dict(known.descriptors) != dict(task.descriptors)):
                raise InputError(f"{task.label!r} is described in two ways", where="TASKS",
                                 right="Give every task a label of its own")
            before = () if known is None else known.manifests
            found[task.label] = Task(task.label, (*before, *task.manifests), task.descriptors)
    tasks = tuple(found.values())
    if len(tasks) < 2:
        raise InputError(f"{len(tasks)} task{'s' * (len(tasks) != 1)} make no schedule", where="TASKS",
                         right="Name two or more: LABEL=TRIAL.yaml, or a task file; `vsf-drake tune` finds one setting")
    owner: dict[Path, str] = {}
    for task in tasks:
        for manifest in task.manifests:
            other = owner.setdefault(manifest.resolve(), task.label)
            if other != task.label or [m.resolve() for m in task.manifests].count(manifest.resolve()) > 1:
                raise InputError("is named twice", file=manifest, where=f"{other} and {task.label}",
                                 right="Every trial belongs to one task, once")
    return tasks


def _named(word: str) -> list[Task]:
    label, _, manifest = word.partition("=")
    if not label.strip() or not manifest.strip():
        raise InputError(f"{word!r} is no task", where="TASKS", right="Write LABEL=TRIAL.yaml")
    return [Task(label.strip(), (user_path(manifest),), dict.fromkeys(DESCRIPTORS))]


def _listed(path: Path) -> list[Task]:
    tasks = []
    for i, task in enumerate(load_yaml(path, TaskFile).tasks):
        where = f"tasks[{i}]"
        if not task.label.strip():
            raise InputError("is empty", file=path, where=f"{where}.label", right="Give the task a name")
        if not task.trials:
            raise InputError("names no trial", file=path, where=f"{where}.trials")
        tasks.append(Task(task.label.strip(), tuple(path.parent / name for name in task.trials),
                          {name: getattr(task, name) for name in DESCRIPTORS}))
    labels = [task.label for task in tasks]
    for label in labels:
        if labels.count(label) > 1:
            raise InputError(f"has two tasks {label!r}", file=path, where="tasks", right="Give each a label of its own")
    return tasks
