"""Recorded trials as the model walks them."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from vsf_drake.base.errors import InputError
from vsf_drake.base.progress import Progress
from vsf_drake.base.sentences import say
from vsf_drake.model.contact_file import FittedContact
from vsf_drake.model.parameters import FootParameters
from vsf_drake.motion.events import USUAL_STANCE_S, find_stances
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import DEFAULT_STEP_S, Walker
from vsf_drake.walks.offsets import OffsetFit, fit_offsets

STEP_S = 2e-3  # the step of walks that are walked often
ONE_END_BW = (0.20, 0.08)
"""How far the force of a walk is off at most (body weights) that starts in mid-stance and whose
angles are laid out from lift-off alone, from TRANSIENT_S to lift-off: at any instant, and root mean
square. Measured as `simulation.options.TRANSIENT_BW`, on the held-out walks."""
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


def with_contact(trial: Trial, contact: FittedContact, *, file: str | Path | None = None) -> Trial:
    """`trial_with`. Without a plate, curves over the gait cycle are laid on the stances of the walk
    that the contact makes without them, and a note says so.

    Raises what `trial_with` and `Walker.walk` do."""
    if trial.plate is not None or not contact.curves:
        return trial_with(trial, contact, file=file)
    physics = trial_with(trial, replace(contact, curves=()))
    walk = Walker(physics.subject, physics.model).walk_trial(physics, step_s=STEP_S)
    stances = find_stances(walk.time_s, walk.grf_W[:, 2])
    laid = trial_with(trial, contact, file=file, stances=stances)
    return replace(
        laid,
        notes=(
            *laid.notes,
            *say("trial", "laid", stances=stances, lasts_s=USUAL_STANCE_S, off_bw=ONE_END_BW),
        ),
    )


def walk_trial(
    trial: Trial,
    *,
    with_fit: bool,
    step_s: float = DEFAULT_STEP_S,
    progress: Progress | None = None,
) -> tuple[WalkResult, OffsetFit | None]:
    """A trial simulated after fitting its geometric offsets if `with_fit`, and that fit."""
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
    walk = walker.walk_trial(
        trial,
        step_s=step_s,
        offsets=offsets,
        progress=None if progress is None else functools.partial(progress, "walking"),
    )
    return walker.result(walk, trial, offsets), fit


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
