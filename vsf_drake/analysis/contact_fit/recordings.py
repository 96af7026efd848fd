"""Which recordings make one fit: one subject, one model, whole stances, each with what is compared."""

from __future__ import annotations

from collections.abc import Sequence

from vsf_drake.analysis.contact_fit.options import COP
from vsf_drake.errors import InputError
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.fitted_trial import APPLIED, fingerprint
from vsf_drake.motion.trial_record import Trial


def labels_of(trials: Sequence[Trial]) -> tuple[str, ...]:
    """A short name for each: the manifest's file name, with as many folders as tell it from the others."""
    parts = [trial.path.with_suffix("").parts for trial in trials]
    names = []
    for own in parts:
        count = 1
        while count < len(own) and sum(other[-count:] == own[-count:] for other in parts) > 1:
            count += 1
        names.append("/".join(own[-count:]))
    return tuple(names)


def check_recordings(trials: Sequence[Trial], held_out: Sequence[Trial] = (), *, series: Sequence[str]) -> None:
    """Makes sure that these can be fitted, and judged by `held_out`, together.

    Raises:
        InputError: there is none; two are the same recording, one of them perhaps held out; subject, side or model
            differ; a plate saw only part of the stance, or has no centre of pressure where that is compared.
    """
    for name, given in (("trials", trials), ("held_out", held_out)):
        if isinstance(given, Trial) or not all(isinstance(trial, Trial) for trial in given):
            raise InputError("is no list of trials", where=name, right="Give a list of what load_trial returns")
    if not trials:
        raise InputError("there is no trial to fit", where="trials")
    known: dict[str, tuple[Trial, bool]] = {}
    for trial, out in [(t, False) for t in trials] + [(t, True) for t in held_out]:
        other, other_out = known.get(fingerprint(trial), (None, out))
        if other is not None:
            told, right = ("is", "Give it once") if out == other_out else (
                "is fitted and held out: it is", "A held-out trial must be one that the fit has not seen")
            raise InputError(f"{told} the same recording as {other.path}", file=trial.path, right=right)
        known[fingerprint(trial)] = (trial, out)
    for trial in (*trials, *held_out):
        if any(note.startswith(APPLIED) for note in trial.notes):
            raise InputError("has a fitted contact already", file=trial.path,
                             right="Fit the trial as it was recorded: what one fit found would be lost in the next")
        _check_same(trials[0], trial)
        _check_stances(trial)
        if any(name in COP for name in series) and not trial.prosthetic_plate.has_cop:
            raise InputError("its plate has no centre of pressure, which is to be compared", file=trial.path,
                             where="forces", right="Leave the centre of pressure out of the comparison, or the trial")


def _check_same(first: Trial, trial: Trial) -> None:
    a, b = first.subject, trial.subject
    if a.prosthetic_side != b.prosthetic_side:
        raise InputError(
            f"its prosthesis is on the {b.prosthetic_side}, that of {first.path} on the {a.prosthetic_side}",
            file=trial.path, where="subject", right="Fit one subject at a time")
    if a != b:
        told = "; ".join(f"{name} {own} and {getattr(a, name)}" for name, own in vars(b).items()
                         if own != getattr(a, name))
        raise InputError(f"is of another subject than {first.path}: {told}", file=trial.path, where="subject",
                         right="Fit one subject at a time")
    if trial.model != first.model:
        raise InputError(f"has another model than {first.path}", file=trial.path, where="model",
                         right="Trials that are fitted together share the model of the foot")


def _check_stances(trial: Trial) -> None:
    plate = trial.prosthetic_plate
    stances = [s for s in find_stances(plate.time_s, plate.force_W[:, 2])
               if s.end_s > trial.start_s and s.start_s < trial.end_s]
    if not stances:
        raise InputError("its plate saw no stance of the prosthetic foot in the trial's window", file=trial.path,
                         where="forces")
    for stance in stances:
        if not (stance.complete and stance.start_s >= trial.start_s and stance.end_s <= trial.end_s):
            raise InputError(
                f"the plate saw only part of the stance at {stance.start_s:.2f} to {stance.end_s:.2f} s, or the window "
                f"of {trial.start_s:.2f} to {trial.end_s:.2f} s cuts it", file=trial.path, where="window",
                right="Choose a window that holds whole stances only")
