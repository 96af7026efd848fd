"""A recording with what a contact fit found of it: the fitted model, offsets and joint angles over
the gait cycle."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.interpolate import BPoly

from vsf_drake.base.errors import require
from vsf_drake.base.files import sha256
from vsf_drake.base.schema import check
from vsf_drake.base.sentences import say
from vsf_drake.model.contact_file import FittedContact, FittedTrial, fitted_model
from vsf_drake.model.parameters import Subject
from vsf_drake.motion.events import USUAL_STANCE_S, Stance, known_stances
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory, periodic_bsplines, window_bsplines
from vsf_drake.motion.trial import Trial

MASS_TOLERANCE, STATURE_TOLERANCE = 0.05, 0.02
"""Shares by which a person may differ from day to day and still be the same (choices)."""
APPLIED = "A fitted contact was applied"
# s, m, rad; and N: numbers that differ by less are the same, whatever computed them
_GRAIN = 1e-6
_GRAIN_N = 1e-3


def trial_with(
    trial: Trial,
    contact: FittedContact,
    *,
    file: str | Path | None = None,
    stances: Sequence[Stance] | None = None,
) -> Trial:
    """`trial` as the fit sees it: its model with the fitted values, its offsets and coordinates
    with what they add.

    Height, path and curves that were fitted to a recording alone are taken only for that recording,
    told by its `fingerprint`. Curves over the gait cycle are laid on the plate's stances, or on the
    given ones, which a trial without a plate needs (`walks.recorded_walk.with_contact` predicts
    them). Notes say what was applied, and where the contact's shell is not known and another than
    the model's is stated; the hash of `file` joins the trial's inputs. Refused for another person,
    side or length of foot, a model that lacks a zone, or a trial that has a fitted contact
    already."""
    check_person(trial.subject, contact, file=file)
    require(
        not any(note.startswith(APPLIED) for note in trial.notes),
        "the trial has a fitted contact already",
        trial.name,
        file=file,
    )
    model = fitted_model(trial.model, contact, file=file)
    recorded = fingerprint(trial)
    here = next((fitted for fitted in contact.trials if fitted.fingerprint == recorded), None)
    offsets = {
        key: value
        + contact.values.get(f"offset.{key.rsplit('_', 1)[0]}", 0.0)
        + (here.height_m if here and key == "height_m" else 0.0)
        for key, value in vars(trial.offsets).items()
    }
    notes = say(
        "trial",
        "contact",
        applied=APPLIED,
        file=file and Path(file).name,
        strategy=contact.strategy,
        values=len(contact.values),
        curves=[curve.coordinate for curve in contact.curves],
        own=here is not None,
        path=here and here.path,
        converged=contact.converged,
        unknown_shell=contact.foot_length_m is None and trial.model.foot.shell_ratio != 1.0,
        length_m=trial.model.foot.length_m,
    )
    return dataclasses.replace(
        trial,
        model=model,
        offsets=check(GeometricOffsets(**offsets), file=file),
        trajectory=_trajectory(trial, contact, here, trial if stances is None else stances),
        notes=(*trial.notes, *notes),
        inputs=trial.inputs
        | ({} if file is None else {f"contact: {Path(file).name}": sha256(file)}),
    )


def under_law(trial: Trial, law: str | None) -> Trial:
    """`trial` with that contact law in its model, or its own for None; a note says so.

    Refused where a contact was fitted with another."""
    own = trial.model.contact_law
    if law in (None, own):
        return trial
    require(
        not any(note.startswith(APPLIED) for note in trial.notes),
        f"the contact of {trial.name} was fitted with {own}",
        "law",
        f"Its numbers are no others' law: give --contact what `vsf-drake fit --law {law}` wrote, "
        "or name the trial without a contact (`simulate` of an embedded one: --contact none)",
    )
    return dataclasses.replace(
        trial,
        model=dataclasses.replace(trial.model, contact_law=law),
        notes=(*trial.notes, *say("trial", "law", law=law)),
    )


def check_person(
    subject: Subject, contact: FittedContact, *, file: str | Path | None = None
) -> None:
    """Raises InputError if `contact` was fitted to somebody else, or to the other side."""
    fitted = contact.subject
    require(
        subject.prosthetic_side == fitted.prosthetic_side,
        f"it was fitted to a prosthesis on the {fitted.prosthetic_side}, this person has one "
        f"on the {subject.prosthetic_side}",
        "subject.prosthetic_side",
        file=file,
    )
    for key, unit, tolerance in (
        ("mass_kg", "kg", MASS_TOLERANCE),
        ("stature_m", "m", STATURE_TOLERANCE),
    ):
        own = getattr(subject, key)
        theirs = getattr(fitted, key)
        require(
            abs(own - theirs) <= tolerance * theirs,
            f"it was fitted to a person of {theirs:g} {unit}, this one has {own:g} {unit}",
            f"subject.{key}",
            "A contact is one person's: fit it to this one's trials",
            file=file,
        )


def fingerprint(trial: Trial) -> str:
    """64 hexadecimal digits of what was recorded: kinematics, plates and window, rounded to what
    can be measured.

    The same in any process and wherever the files are; paths, names, person, model and fulcrum do
    not enter.
    """
    digest = hashlib.sha256()

    def add(name: str, values: np.ndarray, grain: float) -> None:
        counts = np.rint(np.nan_to_num(np.asarray(values, dtype=float)) / grain).astype("<i8")
        digest.update(
            f"\0{name} {counts.shape}\0".encode() + np.ascontiguousarray(counts).tobytes()
        )

    add("window", np.array([trial.start_s, trial.end_s]), _GRAIN)
    add("time", trial.trajectory.time_s, _GRAIN)
    for i in np.argsort(trial.trajectory.names):
        add(trial.trajectory.names[i], trial.trajectory.values[:, i], _GRAIN)
    for side, plate in sorted(trial.plates.items()):
        add(f"{side} time", plate.time_s, _GRAIN)
        add(f"{side} force", plate.force_W, _GRAIN_N)
        add(f"{side} centre of pressure", plate.cop_W, _GRAIN)
    return digest.hexdigest()


def _trajectory(
    trial: Trial,
    contact: FittedContact,
    own: FittedTrial | None,
    cycle: Trial | Sequence[Stance],
) -> CoordinateTrajectory:
    motion = trial.trajectory
    time = motion.time_s
    added = list[tuple[str, np.ndarray | float]]()
    added += [
        (name.removeprefix("coordinate."), value)
        for name, value in contact.values.items()
        if name.startswith("coordinate.")
    ]
    if contact.curves:
        phase = gait_phase(cycle, file=trial.path)(time)
        added += [
            (
                curve.coordinate,
                periodic_bsplines(len(curve.coefficients))(phase) @ np.array(curve.coefficients),
            )
            for curve in contact.curves
        ]
    added += [
        (
            name,
            window_bsplines(trial.start_s, trial.end_s, len(coefficients))(time)
            @ np.array(coefficients),
        )
        for name, coefficients in (own.path | own.curves if own else {}).items()
    ]
    if not added:
        return motion
    motion.ordered(list(dict(added)))  # names what is missing
    sums = np.zeros_like(motion.values)
    for name, perturbation in added:
        sums[:, motion.names.index(name)] += perturbation
    return motion.with_values(motion.values + sums)


# Where in the gait cycle an instant lies, told by strikes and lift-offs of the prosthetic foot.
#
#     phase    k at the k-th strike of the prosthetic foot, k + STANCE_SHARE at its lift-off
#
# Between these instants the phase is the quintic through them whose second derivative vanishes at
# each and whose rate there is the harmonic mean of the mean rates before and after, at most
# 1.25 times the smaller one: its derivative then has positive Bernstein coefficients, so that the
# phase rises all the way, and it is C2 in time. Before the first and after the last stance it is a
# straight line at that stance's own mean rate.


STANCE_SHARE = 0.62  # foot-off of slow walking: Schwartz 2008, doi 10.1016/j.jbiomech.2008.03.015
STEEPEST = 1.25  # largest rate at an instant over the smaller of the mean rates beside it


def gait_phase(
    source: Trial | Sequence[Stance], *, file: Path | None = None
) -> Callable[[np.ndarray], np.ndarray]:
    """The phase (n,), in cycles, of times (n,) s; it rises and is C2.

    The source is a trial, whose prosthetic plate tells its stances, or the stances of the
    prosthetic foot in order of time. Only `whole` ones count; one missed in between counts as a
    cycle. Where none is, the first that was seen at one end is taken to last USUAL_STANCE_S, or as
    long as it was seen. InputError, of `file`, where neither a strike nor a lift-off was seen."""
    if isinstance(source, Trial):
        stances: Sequence[Stance] = known_stances(source.prosthetic_plate)
        file = source.path
    else:
        stances = source
    seen = [stance for stance in stances if stance.whole]
    cut = [stance for stance in stances if stance.starts or stance.ends]
    if cut and not seen:
        lasts = max(cut[0].duration_s, USUAL_STANCE_S)
        start = cut[0].start_s if cut[0].starts else cut[0].end_s - lasts
        seen = [Stance(start, start + lasts)]
    require(
        seen,
        "neither strike nor lift-off of the prosthetic foot was seen",
        "window",
        "The fitted angles are laid over the gait cycle, which is told by one of them: take a "
        "longer part of the walk",
        file=file,
    )
    if any(later.start_s <= earlier.end_s for earlier, later in pairwise(seen)):
        raise ValueError("stances must follow each other")

    # Phases at strikes and lift-offs; strikes further apart than a stride count as so many cycles.
    stride_s = np.mean([stance.duration_s for stance in seen]) / STANCE_SHARE
    cycles = np.cumsum(
        [
            0,
            *(
                max(1, round((later.start_s - earlier.start_s) / stride_s))
                for earlier, later in pairwise(seen)
            ),
        ]
    )
    phases = (cycles[:, None] + [0.0, STANCE_SHARE]).ravel()
    instants = np.array([(stance.start_s, stance.end_s) for stance in seen]).ravel()

    # Rates there: harmonic means, at most STEEPEST times the smaller neighbour; second derivatives
    # are zero.
    rates = STANCE_SHARE / np.array([stance.duration_s for stance in (seen[0], seen[-1])])
    mean = np.diff(phases) / np.diff(instants)
    before = mean[:-1]
    after = mean[1:]
    inner = np.minimum(
        2.0 * before * after / (before + after), STEEPEST * np.minimum(before, after)
    )
    slopes = np.concatenate([rates[:1], inner, rates[1:]])
    between = BPoly.from_derivatives(
        instants, np.column_stack([phases, slopes, np.zeros(len(slopes))])
    )

    def phase(times: np.ndarray) -> np.ndarray:
        times = np.asarray(times, dtype=float)
        early = np.minimum(times - instants[0], 0.0)
        late = np.maximum(times - instants[-1], 0.0)
        return np.asarray(
            between(np.clip(times, instants[0], instants[-1])) + rates[0] * early + rates[1] * late
        )

    return phase
