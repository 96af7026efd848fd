"""A recording with what a contact fit found of it: the fitted model, offsets and joint angles."""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path

import numpy as np

from vsf_drake.contact_file import FittedContact, FittedTrial, model_with
from vsf_drake.errors import InputError
from vsf_drake.files import sha256
from vsf_drake.motion.gait_cycle import gait_phase
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory, periodic_bsplines, window_bsplines
from vsf_drake.motion.trial_record import Trial
from vsf_drake.parameters import Subject
from vsf_drake.schema import check

MASS_TOLERANCE, STATURE_TOLERANCE = 0.05, 0.02
"""Shares by which a person may differ from day to day and still be the same (choices)."""
APPLIED = "A fitted contact was applied"
_GRAIN = 1e-6
"""s, m, rad: numbers that differ by less are the same, whatever computed them."""
_GRAIN_N = 1e-3


def trial_with(trial: Trial, contact: FittedContact, *, file: str | Path | None = None) -> Trial:
    """`trial` as the fit sees it: its model with the fitted values, its offsets and coordinates with what they add.

    Shifts and curves are added to the recorded samples. The height and the path that were fitted to a recording are
    taken only for that recording, told by its `fingerprint`. A note says what was applied.

    Args:
        file: where the contact was read from; its hash joins the trial's inputs.

    Raises:
        InputError: the contact was fitted to another person or another side; the model lacks a zone; a number is out of
            range; the trial has a fitted contact already; a curve needs a whole stance and there is none.
    """
    check_person(trial.subject, contact, file=file)
    if any(note.startswith(APPLIED) for note in trial.notes):
        raise InputError("the trial has a fitted contact already", file=file, where=trial.name)
    print_ = fingerprint(trial)
    own = next((fitted for fitted in contact.trials if fitted.fingerprint == print_), None)
    added = {"height_m": "offset.height", "fore_aft_m": "offset.fore_aft", "alignment_rad": "offset.alignment"}
    offsets = {key: getattr(trial.offsets, key) + contact.values.get(name, 0.0)
               + (own.height_m if own and key == "height_m" else 0.0) for key, name in added.items()}
    parts = [f"{len(contact.values)} values"]
    if contact.curves:
        parts.append(f"curves of {', '.join(curve.coordinate for curve in contact.curves)}")
    note = (f"{APPLIED}{'' if file is None else f' from {Path(file).name}'} (strategy {contact.strategy}): "
            f"{', '.join(parts)}")
    if own is not None:
        note += ", with the height that was fitted to this trial" + (" and its path" if own.path else "")
    note += "." if contact.converged else "; ITS FIT DID NOT CONVERGE."
    return dataclasses.replace(
        trial, model=model_with(trial.model, contact.values, file=file),
        offsets=check(GeometricOffsets(**offsets), file=file), trajectory=_trajectory(trial, contact, own),
        notes=(*trial.notes, note),
        inputs=trial.inputs | ({} if file is None else {f"contact: {Path(file).name}": sha256(file)}))


def check_person(subject: Subject, contact: FittedContact, *, file: str | Path | None = None) -> None:
    """Raises InputError if `contact` was fitted to somebody else, or to the other side."""
    fitted = contact.subject
    if subject.prosthetic_side != fitted.prosthetic_side:
        raise InputError(f"it was fitted to a prosthesis on the {fitted.prosthetic_side}, this person has one on the "
                         f"{subject.prosthetic_side}", file=file, where="subject.prosthetic_side")
    for key, unit, tolerance in (("mass_kg", "kg", MASS_TOLERANCE), ("stature_m", "m", STATURE_TOLERANCE)):
        own, theirs = getattr(subject, key), getattr(fitted, key)
        if abs(own - theirs) > tolerance * theirs:
            raise InputError(f"it was fitted to a person of {theirs:g} {unit}, this one has {own:g} {unit}", file=file,
                             where=f"subject.{key}", right="A contact is one person's: fit it to this one's trials")


def fingerprint(trial: Trial) -> str:
    """64 hexadecimal digits of what was recorded: kinematics, plates and window, rounded to what can be measured.

    The same in any process and wherever the files are; paths, names, person, model and fulcrum do not enter.
    """
    found = hashlib.sha256()

    def add(name: str, values: np.ndarray, grain: float) -> None:
        counts = np.rint(np.nan_to_num(np.asarray(values, dtype=float)) / grain).astype("<i8")
        found.update(f"\0{name} {counts.shape}\0".encode() + np.ascontiguousarray(counts).tobytes())

    add("window", np.array([trial.start_s, trial.end_s]), _GRAIN)
    add("time", trial.trajectory.time_s, _GRAIN)
    for i in np.argsort(trial.trajectory.names):
        add(trial.trajectory.names[i], trial.trajectory.values[:, i], _GRAIN)
    for side, plate in sorted(trial.plates.items()):
        add(f"{side} time", plate.time_s, _GRAIN)
        add(f"{side} force", plate.force_W, _GRAIN_N)
        add(f"{side} centre of pressure", plate.cop_W, _GRAIN)
    return found.hexdigest()


def _trajectory(trial: Trial, contact: FittedContact, own: FittedTrial | None) -> CoordinateTrajectory:
    motion = trial.trajectory
    added: dict[str, np.ndarray] = {}

    def add(name: str, values: np.ndarray | float) -> None:
        added[name] = added.get(name, np.zeros(len(motion.time_s))) + values

    for name, value in contact.values.items():
        if name.startswith("coordinate."):
            add(name.removeprefix("coordinate."), value)
    if contact.curves:
        phase = gait_phase(trial)(motion.time_s)
        for curve in contact.curves:
            add(curve.coordinate, periodic_bsplines(len(curve.coefficients))(phase) @ np.array(curve.coefficients))
    for name, coefficients in (own.path if own else {}).items():
        basis = window_bsplines(trial.start_s, trial.end_s, len(coefficients))
        add(name, basis(motion.time_s) @ np.array(coefficients))
    if not added:
        return motion
    motion.ordered(list(added))  # names what is missing
    values = np.array(motion.values)
    for name, course in added.items():
        values[:, motion.names.index(name)] += course
    return CoordinateTrajectory(motion.time_s, values, motion.names, source=motion.source)
