"""A laboratory's recordings of one person to trials that drive the model, with an account of how good each is."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsf_drake.analysis.intake_files import FileSet, walk_names
from vsf_drake.analysis.intake_steps import IntakeOptions, make_trial, noted, read
from vsf_drake.analysis.recording.check import FITTED_HIP_BW_PER_DEG, Check
from vsf_drake.analysis.recording.evidence import Examined
from vsf_drake.analysis.recording.examine import examine
from vsf_drake.errors import InputError
from vsf_drake.files import sha256
from vsf_drake.model_file import check_fulcrum
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.markers.maps import load_marker_map
from vsf_drake.motion.markers.person_facts import PersonFacts, check_facts, with_files
from vsf_drake.motion.markers.settling import MID_FULCRUM_M
from vsf_drake.motion.trial import Trial
from vsf_drake.motion.trial_record import default_model
from vsf_drake.motion.walk_mass import check_mass
from vsf_drake.parameters import ModelParameters
from vsf_drake.plants.scaling import scale_foot

MID_FULCRUM_MM = 1e3 * MID_FULCRUM_M
"""Where the fulcrum is taken to be if nobody says."""
WEIGHED = 0.02
"""Error of a body mass that the plates of a walk or of a standing trial tell (`mass_from_walk`: one or two percent)."""


@dataclass(frozen=True, eq=False)
class Intake:
    """What came of the files.

    Attributes:
        items: one per walk that could be used, all of one subject and one model. names: a file name for each.
        failures: by file, why it could not be used.
        scaled: whether `items` have a model of their own.
        inputs: SHA-256 by file.
    """

    items: tuple[Examined, ...]
    names: tuple[str, ...]
    failures: dict[str, str]
    scaled: bool
    inputs: dict[str, str]


def take_in(files: FileSet, options: IntakeOptions, *, progress: Callable[[str, float], None] | None = None
            ) -> Intake:
    """Reads, calibrates, tracks and checks every walk.

    Args:
        files: the standing trial, the walks and their forces.
        progress: called with what is being done and the finished fraction.

    Raises:
        InputError: something that no recording tells is not stated; the standing trial cannot be used; or no
            walk can (of several walks, one that cannot be used is only listed).
    """
    check_facts(options.person)
    fulcrums_m = _fulcrums(options, len(files.walks))
    marker_map = None if options.marker_map is None else load_marker_map(options.marker_map)
    standing = None if files.standing is None else read(files.standing, files.standing_forces, options)
    made: dict[Path, Trial] = {}
    failures: dict[Path, InputError] = {}

    def make(walk: Path, known: IntakeOptions) -> Trial:
        own = next((trial.calibration for trial in made.values()), None) if standing is None else None
        return make_trial(files, files.walks.index(walk), standing, marker_map, known, fulcrums_m, own)

    for number, walk in enumerate(files.walks):
        if progress:
            progress(f"importing {walk.name}", number / len(files.walks))
        try:
            made[walk] = make(walk, options)
        except InputError as error:
            failures[walk] = error
    if not made:
        raise _nothing_left(list(failures.values()))
    masses = [trial.subject.mass_kg for trial in made.values()]
    if len(set(masses)) > 1:
        one, note = _one_mass(options, masses)
        made = {walk: noted(make(walk, one), note) for walk in made}
    trials, model_notes, scaled = _one_model(list(made.values()), options)
    stated = _statements(trials[0], standing, with_files(options.person, standing, trials[0].recording)[0])
    items, names = [], []
    for trial, walk, name in zip(trials, made, walk_names(list(made)), strict=True):
        notes = (*files.notes(walk), *model_notes, *trial.notes)
        trial = dataclasses.replace(trial, notes=tuple(dict.fromkeys(notes)))  # noqa: PLW2901 (the same, with notes)
        try:
            check_mass(trial, file=walk)
            items.append(examine(trial, cutoff_hz=options.cutoff_hz, stated=stated,
                                 belt_speed_m_per_s=options.belt_speed_m_per_s))
            names.append(name)
        except InputError as error:
            failures[walk] = error
    if not items:
        raise _nothing_left(list(failures.values()))
    return Intake(tuple(items), tuple(names), {str(path): str(error) for path, error in failures.items()}, scaled,
                  {str(path): sha256(path) for path in files.all() if path.is_file()})


def _one_mass(options: IntakeOptions, masses: Sequence[float]) -> tuple[IntakeOptions, str]:
    """One person weighs one mass: options with the median, where each walk told its own, and a note."""
    mass = float(np.median(masses))
    person = dataclasses.replace(options.person, mass_kg=mass)
    note = f"Body mass {mass:.1f} kg is the median of {', '.join(f'{m:.1f}' for m in masses)} kg, one from each walk."
    return dataclasses.replace(options, person=person), note


def _fulcrums(options: IntakeOptions, walks: int) -> tuple[float, ...]:
    """Where the fulcrum stood (m) in each walk.

    Raises:
        InputError: there are neither one nor as many as walks, or one is out of the carriage's reach.
    """
    stated = options.fulcrum_mm or (MID_FULCRUM_MM,)
    if len(stated) not in (1, walks):
        raise InputError(f"{len(stated)} positions are given for {walks} walks", where="--fulcrum-mm",
                         right="Give one for all walks, or one for each in their order")
    foot = default_model().foot
    return tuple(check_fulcrum(1e-3 * position, foot, where="--fulcrum-mm")
                 for position in (stated if len(stated) == walks else stated * walks))


def _one_model(trials: list[Trial], options: IntakeOptions) -> tuple[list[Trial], tuple[str, ...], bool]:
    """The trials with the model's foot as long as the person's, where that is asked for, and notes.

    Keel and thickness grow alike, so that the scaled foot is as stiff as the model's with its fulcrum at the same part
    of its length (a choice); stated positions of the fulcrum are taken as they are.
    """
    notes = [] if options.fulcrum_mm else [
        f"The fulcrum's position is not stated: {MID_FULCRUM_MM:g} mm, mid-range, is assumed (--fulcrum-mm)."]
    calibration = trials[0].calibration
    if not options.scale_prosthesis or calibration is None:
        return trials, tuple(notes), False
    model: ModelParameters = trials[0].model
    length = calibration.lengths_m[f"foot_{trials[0].subject.prosthetic_side}"]
    ratio = length / model.foot.length_m
    model = dataclasses.replace(model, foot=scale_foot(model.foot, length=ratio, thickness=ratio))
    moved = [dataclasses.replace(trial, model=model, fulcrum_m=check_fulcrum(
        trial.fulcrum_m * (1.0 if options.fulcrum_mm else ratio), model.foot, where="--fulcrum-mm"))
        for trial in trials]
    notes.append(f"The model's prosthetic foot is made {1e3 * length:.0f} mm long, {ratio:.3f} times its own length.")
    return moved, tuple(notes), True


def _statements(trial: Trial, standing: Recording | None, person: PersonFacts) -> list[Check]:
    """What was not measured but taken from somewhere else; one check for each."""
    subject, found = trial.subject, []
    if person.mass_kg is None:
        found.append(Check("body mass", "doubtful", subject.mass_kg, "kg", f"The body mass is not stated; "
                           f"{subject.mass_kg:.1f} kg comes from the force plates. Every force in body weights rests "
                           "on it (--mass-kg).", cost_bw=WEIGHED))
    if person.stature_m is None:
        found.append(Check("stature", "doubtful", subject.stature_m, "m", f"The stature is not stated; "
                           f"{subject.stature_m:.2f} m is estimated. It scales only what the markers do not measure, "
                           "such as the trunk (--stature-m)."))
    if standing is None:
        found.append(Check("standing trial", "doubtful", None, "", "The walk itself stands for the standing trial: "
                           "joint centres and the feet's level are averages over its frames, good to a centimetre and "
                           "a few degrees at best.", cost_bw=2 * FITTED_HIP_BW_PER_DEG))
    return found


def _nothing_left(errors: Sequence[InputError]) -> InputError:
    messages = list(dict.fromkeys(str(error) for error in errors))
    if len(messages) == 1:
        return errors[0]
    return InputError("none of the walks can be used:\n" + "\n".join(f"- {message}" for message in messages))
