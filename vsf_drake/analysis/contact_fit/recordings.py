"""Which recordings make one fit: one subject, one model, whole stances, each with what is compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

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
    """Raises InputError unless these can be fitted, and judged by `held_out`, together.

    Raises:
        InputError: there is none; two are the same recording, one of them perhaps held out; subject, side or model
            differ; a plate saw only part of the stance, or has no centre of pressure where that is compared.
    """
    for name, given in (("trials", trials), ("held_out", held_out)):
        if isinstance(given, (Trial, str, bytes)) or not all(isinstance(trial, Trial) for trial in given):
            raise InputError("is no list of trials", where=name, right="Give a list of what load_trial returns")
    if not trials:
        raise InputError("there is no trial to fit", where="trials")
    known: dict[str, tuple[Trial, bool]] = {}
    for trial, out in [(t, False) for t in trials] + [(t, True) for t in held_out]:
        other = known.get(fingerprint(trial))
        known[fingerprint(trial)] = (trial, out)
        if other is not None:
            if other[1] != out:
                raise InputError(f"is fitted and held out: it is the same recording as {other[0].path}",
                                 file=trial.path, right="A held-out trial must be one that the fit has not seen")
            raise InputError(f"is the same recording as {other[0].path}", file=trial.path, right="Give it once")
    first = trials[0]
    for trial in (*trials, *held_out):
        if any(note.startswith(APPLIED) for note in trial.notes):
            raise InputError("has a fitted contact already", file=trial.path,
                             right="Fit the trial as it was recorded: what one fit found would be lost in the next")
        _check_same(first, trial)
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
        both = [(name, getattr(b, name), getattr(a, name)) for name in vars(a)]
        told = "; ".join(f"{name} {own} and {other}" for name, own, other in both if own != other)
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


# How wrong measurement and model are expected to be together, and how long an error lasts.
#
# Residuals are in units of their standard deviation. Errors of neighbouring instants are alike: as long as
# `correlation_s` lasts, n samples tell no more than one. So n residuals of a series with spacing dt weigh together as
# n dt / (2 correlation_s) independent ones (the integral time of an exponential correlation), which keeps
# priors from being outvoted by a sampling rate.


FORCES = ("fore_aft", "lateral", "vertical")
RESULTANT = "resultant"
COP = ("cop_fore_aft",)
SERIES = (*FORCES, RESULTANT, *COP)


@dataclass(frozen=True, kw_only=True)
class FitNoise:
    """Standard deviations of model minus measurement, choices: half of what McGeehan 2021 (doi 10.1115/1.4050456) is
    left with on its fitted trial, 5.3 % body weight and 5.7 % foot length.

    Attributes:
        fore_aft, lateral, vertical, resultant: of the force, in body weights.
        cop_fore_aft: of the centre of pressure, in foot lengths.
        correlation_s: s, of the exponential correlation of errors in time. Errors of motion are as slow as the motion
            (6 Hz: 1 / (2 pi 6 Hz) = 27 ms), those of the model last as long as a phase of stance; a choice between.
    """

    fore_aft: float = 0.025
    lateral: float = 0.025
    vertical: float = 0.025
    resultant: float = 0.025
    cop_fore_aft: float = 0.03
    correlation_s: float = 0.05

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < 1.0:
                raise InputError(f"{value!r} is no standard deviation or time", where=f"noise.{field.name}",
                                 right="It must be a positive number below 1: parts of body weight or foot length "
                                       "(not percent), or seconds")

    def weight(self, spacing_s: float) -> float:
        """What each of many residuals in units of its standard deviation counts for, at most 1."""
        return float(min(1.0, np.sqrt(spacing_s / (2.0 * self.correlation_s))))

    def correlation(self, times_s: np.ndarray) -> np.ndarray:
        """(n, n) correlation of the errors at the times (n,)."""
        apart = np.abs(times_s[:, None] - times_s[None, :])
        return np.asarray(np.exp(-apart / self.correlation_s))
