"""The trials that a foot is tuned to: read, with a fitted contact or with offsets fitted to their plates."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vsf_drake.analysis.contact_fit.problem import labels_of
from vsf_drake.analysis.metrics import unfitted_note
from vsf_drake.analysis.offsets import fit_offsets
from vsf_drake.analysis.tuning.common import Progress
from vsf_drake.analysis.validation.study import (
    SETTINGS,
    check_named_once,
    embedded_contact,
    embedded_trials,
)
from vsf_drake.contact_file import load_contact
from vsf_drake.errors import InputError
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import Trial, load_trial

_TYPICAL_EVALUATIONS = 25.0


@dataclass(frozen=True, eq=False)
class TuningTrials:
    """Trials as they are to be walked, a short name for each, and what a user should know of them."""

    trials: tuple[Trial, ...]
    labels: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def recorded_mm(self) -> list[float]:
        """Where the fulcrum stood in each trial (mm from A)."""
        return [round(1e3 * trial.fulcrum_m, 9) for trial in self.trials]

    @property
    def synthetic(self) -> bool:
        return any(trial.synthetic for trial in self.trials)

    @property
    def inputs(self) -> dict[str, str]:
        """SHA-256 by trial and file."""
        return {
            f"{label}: {file}": digest
            for label, trial in zip(self.labels, self.trials, strict=True)
            for file, digest in trial.inputs.items()
        }

    @property
    def reach_mm(self) -> tuple[float, float]:
        """Positions (mm from A) that every trial's carriage can take."""
        feet = [trial.model.foot.fulcrum for trial in self.trials]
        return 1e3 * max(foot.rearmost_m for foot in feet), 1e3 * min(
            foot.foremost_m for foot in feet
        )


def embedded_tuning_trials(*, level: int, quick: bool = False) -> tuple[Path, ...]:
    """Manifests of synthetic trials that ship with the package: walks at the middle setting, of the laboratory tier,
    three for level 1, whose repetition tells what a difference is worth; one if `quick`, and for level 2."""
    every = embedded_trials(quick=quick or level > 1)
    return tuple(path for path in every if path.stem.startswith(f"{SETTINGS[1]}_"))


def load_tuning_trials(
    manifests: Sequence[str | Path],
    *,
    contact: str | Path | None = None,
    level: int = 1,
    quick: bool = False,
    progress: Progress | None = None,
) -> TuningTrials:
    """Reads trials of one person; without any, the `embedded_tuning_trials` with the contact that was fitted to them.
    Without a contact file, height, fore-aft position and alignment of the prosthesis are fitted to each trial's plate.
    """
    if not manifests:
        manifests, contact = (
            embedded_tuning_trials(level=level, quick=quick),
            contact or embedded_contact(),
        )
    check_named_once(manifests)
    trials = tuple(load_trial(manifest) for manifest in manifests)
    check_one_person(trials)
    labels = labels_of(trials)
    if contact is not None:
        fitted = load_contact(contact)
        return TuningTrials(
            tuple(trial_with(trial, fitted, file=contact) for trial in trials), labels, ()
        )
    fitted_trials, notes = [], [unfitted_note(trials[0], offsets_fitted=True)]
    for i, (trial, label) in enumerate(zip(trials, labels, strict=True)):

        def show(count: int, cost: float, label: str = label, i: int = i) -> None:
            if progress:
                share = count / (count + _TYPICAL_EVALUATIONS)
                progress(f"{label}: fitting offsets, cost {cost:.1f}", (i + share) / len(trials))

        fit = fit_offsets(trial, progress=show)
        if not fit.success or fit.at_bound:
            ended = (
                f"ended on a bound ({', '.join(fit.at_bound)})"
                if fit.at_bound
                else f"failed: {fit.message}"
            )
            notes.append(f"{label}: the fit of its offsets {ended}.")
        fitted_trials.append(dataclasses.replace(trial, offsets=fit.offsets))
    return TuningTrials(tuple(fitted_trials), labels, tuple(notes))


def check_one_person(trials: Sequence[Trial]) -> None:
    """Raises InputError unless all trials are of one subject, with the prosthesis on one side."""
    for trial in trials[1:]:
        if trial.subject != trials[0].subject:
            raise InputError(
                f"is of another subject than {trials[0].path}",
                file=trial.path,
                where="subject",
                right="A setting is one person's: tune one subject at a time",
            )
