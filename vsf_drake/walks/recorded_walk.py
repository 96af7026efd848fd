"""Recorded trials as the model walks them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from vsf_drake.base.errors import InputError
from vsf_drake.base.progress import Progress
from vsf_drake.model.contact_file import load_contact
from vsf_drake.model.parameters import FootParameters
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import DEFAULT_STEP_S, Walker
from vsf_drake.walks.offsets import OffsetFit, fit_offsets

STEP_S = 2e-3  # the step of walks that are walked often
_TYPICAL_EVALUATIONS = 25


def reached(foot: FootParameters, fulcrums_m: Iterable[float]) -> list[float]:
    """Those of the positions (m from A) that the carriage reaches."""
    low = foot.fulcrum.rearmost_m - 1e-9
    high = foot.fulcrum.foremost_m + 1e-9
    return [float(x) for x in fulcrums_m if low <= x <= high]


def walkers_of(trials: Iterable[Trial]) -> list[Walker]:
    """What walks each trial; those of one person on one device share it."""
    walkers: list[Walker] = []
    for trial in trials:
        same = (one for one in walkers if (one.subject, one.model) == (trial.subject, trial.model))
        walkers.append(next(same, None) or Walker(trial.subject, trial.model))
    return walkers


def check_named_once(manifests: Sequence[str | Path]) -> None:
    """Raises InputError if two of the manifests are one file."""
    files = [Path(manifest).resolve() for manifest in manifests]
    for i, file in enumerate(files):
        if file in files[:i]:
            raise InputError("is named twice", file=manifests[i], right="Name every trial once")


@dataclass(frozen=True)
class ValidatedWalk:
    """One trial of the validation: what was recorded (as it was walked), what was simulated, with
    which offsets."""

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

    The numbers of a contact file replace the model's; it has offsets of its own, so `with_fit` must
    then be False. InputError if a file cannot be used, SimulationError if the walk fails.
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


def labels_of(trials: Sequence[Trial]) -> tuple[str, ...]:
    """A short name for each: the manifest's file name, with as many folders as tell it from the
    others."""
    parts = [trial.path.with_suffix("").parts for trial in trials]
    names = []
    for own in parts:
        count = 1
        while count < len(own) and sum(other[-count:] == own[-count:] for other in parts) > 1:
            count += 1
        names.append("/".join(own[-count:]))
    return tuple(names)
