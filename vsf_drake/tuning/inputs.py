"""The trials that a foot is tuned to: read, with a fitted contact or with offsets fitted to their
plates."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from vsf_drake.base.errors import require
from vsf_drake.base.progress import Progress
from vsf_drake.model.contact_file import load_contact
from vsf_drake.motion.fitted_trial import under_law
from vsf_drake.motion.trial import NO_PLATE, Trial, load_trial
from vsf_drake.recording import MARKS
from vsf_drake.tuning.common import digests
from vsf_drake.walks.embedded import SETTINGS, embedded_contact, embedded_trials
from vsf_drake.walks.metrics import unfitted_note
from vsf_drake.walks.offsets import fit_offsets
from vsf_drake.walks.recorded_walk import check_named_once, labels_of, with_contact

_TYPICAL_EVALUATIONS = 25.0


@dataclass(frozen=True, eq=False)
class TuningTrials:
    """Trials as they are to be walked, a short name for each, and what a user should know of
    them."""

    trials: tuple[Trial, ...]
    labels: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def recorded_mm(self) -> list[float]:
        """Where the fulcrum stood in each trial (mm from A)."""
        return [round(1e3 * trial.fulcrum_m, 9) for trial in self.trials]

    @property
    def inputs(self) -> dict[str, str]:
        """SHA-256 by trial and file."""
        return digests(self.labels, self.trials)


def embedded_tuning_trials(*, level: int, quick: bool = False) -> tuple[Path, ...]:
    """Manifests of synthetic trials that ship with the package: walks at the middle setting, of the
    laboratory tier, three for level 1, whose repetition tells what a difference is worth; one if
    `quick`, and for level 2."""
    every = embedded_trials(quick=quick or level > 1)
    return tuple(path for path in every if path.stem.startswith(f"{SETTINGS[1]}_"))


def load_tuning_trials(
    manifests: Sequence[str | Path],
    *,
    contact: str | Path | None = None,
    law: str | None = None,
    level: int = 1,
    quick: bool = False,
    progress: Progress | None = None,
    judge: Callable[[Sequence[Trial]], Sequence[Trial]] = tuple,
) -> TuningTrials:
    """Reads trials of one person; without any, the `embedded_tuning_trials` with the contact that
    was fitted to them. Without a contact file, height, fore-aft position and alignment of the
    prosthesis are fitted to each trial's plate. `law` is the contact law, by default that of the
    contact file, else of the trial's model. `judge` says what the recordings are worth, or
    refuses them: see `Trial.judged`.
    """
    if not manifests:
        manifests = embedded_tuning_trials(level=level, quick=quick)
        contact = contact or embedded_contact()
    check_named_once(manifests)
    trials = tuple(load_trial(manifest) for manifest in manifests)
    check_one_person(trials)
    trials, labels = tuple(judge(trials)), labels_of(trials)
    marks = [
        f"{label}: {trial.judged.note}"
        for trial, label in zip(trials, labels, strict=True)
        if trial.judged and trial.judged.mark != MARKS[0]
    ]
    marks += [
        f"{label}: {note}"
        for trial, label in zip(trials, labels, strict=True)
        for note in trial.notes
        if note.startswith(NO_PLATE)
    ]
    if contact is not None:
        fitted = load_contact(contact)
        walked = (with_contact(trial, fitted, file=contact) for trial in trials)
        return TuningTrials(tuple(under_law(trial, law) for trial in walked), labels, tuple(marks))
    trials = tuple(under_law(trial, law) for trial in trials)
    fitted_trials = []
    notes = [unfitted_note(trials[0], offsets_fitted=True), *marks]
    for i, (trial, label) in enumerate(zip(trials, labels, strict=True)):

        def show(count: int, cost: float, label: str = label, i: int = i) -> None:
            if progress:
                share = count / (count + _TYPICAL_EVALUATIONS)
                progress(f"{label}: fitting offsets, cost {cost:.1f}", (i + share) / len(trials))

        fit = fit_offsets(trial, progress=show)
        notes += [f"{label}: {doubt}" for doubt in fit.doubts]
        fitted_trials.append(dataclasses.replace(trial, offsets=fit.offsets))
    return TuningTrials(tuple(fitted_trials), labels, tuple(notes))


def check_one_person(trials: Sequence[Trial]) -> None:
    """Raises InputError unless all trials are of one subject, with the prosthesis on one side."""
    for trial in trials[1:]:
        require(
            trial.subject == trials[0].subject,
            f"is of another subject than {trials[0].path}",
            "subject",
            "A setting is one person's: tune one subject at a time",
            file=trial.path,
        )
