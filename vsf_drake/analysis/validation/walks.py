"""Walks of the validation: one trial, with a fitted contact or with offsets fitted to its plate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from vsf_drake.analysis.offsets import OffsetFit, fit_offsets
from vsf_drake.contact_file import load_contact
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import DEFAULT_STEP_S, Walker

_TYPICAL_EVALUATIONS = 25


@dataclass(frozen=True)
class ValidatedWalk:
    """One trial of the validation: what was recorded (as it was walked), what was simulated, with which offsets."""

    trial: Trial
    result: WalkResult
    fit: OffsetFit | None


def validate_walk(
    manifest: str | Path, *, with_fit: bool = True, contact: str | Path | None = None, step_s: float = DEFAULT_STEP_S,
    progress: Callable[[str, float], None] | None = None
) -> ValidatedWalk:
    """Simulates the trial of `manifest`, after fitting the geometric offsets if `with_fit`.

    Args:
        contact: a contact file, whose numbers replace the model's (`motion.fitted_trial`). It has offsets of its own:
            `with_fit` must be False.
        progress: called with what is being done and the finished fraction of it (the fit: a guess).

    Raises:
        InputError, SimulationError: see `load_trial`, `load_contact`, `trial_with`, `fit_offsets`, `Walker.walk`.
        ValueError: a contact, and `with_fit`.
    """
    if with_fit and contact is not None:
        raise ValueError("a fitted contact has its offsets already: they are not fitted on top")
    trial = load_trial(manifest)
    if contact is not None:
        trial = trial_with(trial, load_contact(contact), file=contact)
    return walk_trial(trial, with_fit=with_fit, step_s=step_s, progress=progress)


def walk_trial(
    trial: Trial, *, with_fit: bool, step_s: float = DEFAULT_STEP_S,
    progress: Callable[[str, float], None] | None = None
) -> ValidatedWalk:
    """Simulates a trial that was read, after fitting its geometric offsets if `with_fit`.

    Raises:
        InputError, SimulationError: see `fit_offsets`, `Walker.walk`.
    """
    walker = Walker(trial.subject, trial.model)
    fit = None
    if with_fit:
        fit = fit_offsets(trial, walker=walker, progress=progress and (
            lambda n, _: progress("fitting offsets", min(0.99, n / _TYPICAL_EVALUATIONS))))
    offsets = fit.offsets if fit else trial.offsets
    walk = walker.walk(trial.trajectory, fulcrum_m=trial.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s,
                       step_s=step_s, offsets=offsets, progress=progress and (lambda f: progress("walking", f)))
    return ValidatedWalk(trial=trial, result=walker.result(walk, trial, offsets), fit=fit)
