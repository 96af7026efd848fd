"""One walk to one trial: read, calibrated, tracked, weighed, as the options of an import say."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from vsf_drake.analysis.intake_files import FileSet
from vsf_drake.analysis.recording.examine import weighed
from vsf_drake.analysis.refinement import refined
from vsf_drake.errors import InputError
from vsf_drake.files import sha256
from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.from_markers import PLACEHOLDER_KG, trial_from_recordings
from vsf_drake.motion.manifest import Window
from vsf_drake.motion.markers.maps import MarkerMap
from vsf_drake.motion.markers.person_facts import PersonFacts
from vsf_drake.motion.markers.schema import Calibration
from vsf_drake.motion.markers.settling import MID_FULCRUM_M
from vsf_drake.motion.trial import Trial


@dataclass(frozen=True, kw_only=True)
class IntakeOptions:
    """How to read and what is known beside the files.

    Attributes:
        person, stated: as for `trial_from_recordings`.
        marker_map: a shipped map's name or a file; None: the one that fits the labels best.
        fulcrum_mm: one for all walks, or one for each in their order; none: mid-range.
        up, forward, length_unit: as for `read_trial`. plate_sides: plate names by side.
        hip, cutoff_hz, longest_gap_s, window, belt_speed_m_per_s: as for `trial_from_recordings`; a cut-off of
            None for recordings that are filtered already.
        scale_prosthesis: whether the model's prosthetic foot becomes as long as the person's.
        inverse_kinematics: whether the angles are those of a global inverse kinematics.
    """

    person: PersonFacts
    stated: Mapping[str, float] = field(default_factory=dict)
    marker_map: str | None = None
    fulcrum_mm: tuple[float, ...] = ()
    up: str | None = None
    forward: str | None = None
    length_unit: str | None = None
    plate_sides: Mapping[str, str | None] | None = None
    hip: str = "harrington"
    cutoff_hz: float | None = 6.0
    longest_gap_s: float = 0.1
    window: Window | None = None
    belt_speed_m_per_s: float = 0.0
    scale_prosthesis: bool = False
    inverse_kinematics: bool = False


def read(path: Path, forces: Path | None, options: IntakeOptions) -> Recording:
    """The recording of a file, as the options say how.

    Raises:
        InputError: see `read_trial`.
    """
    return read_trial(path, forces=forces, up=options.up, forward=options.forward, length_unit=options.length_unit)


def make_trial(files: FileSet, number: int, standing: Recording | None, marker_map: MarkerMap | None,
               options: IntakeOptions, fulcrums_m: Sequence[float], calibration: Calibration | None) -> Trial:
    """The trial of one walk.

    Args:
        number: of the walk. standing: None where a walk stands for it.
        fulcrums_m: of every walk. Where they differ, that of the standing trial is taken to be mid-range.
        calibration: of another walk, where no standing trial is there to make one.

    Raises:
        InputError: see `trial_from_recordings`; the walk has no forces; the mass cannot be told.
    """
    walk, forces = files.walks[number], files.forces[number]
    recording = read(walk, forces, options)
    if not recording.plates:
        raise InputError("has no force plates, and no force file lies beside it", file=walk, where="--forces",
                         right="Name the walk's force file (.mot, .sto, .csv or .forces)")
    used = [path for path in (walk, forces, files.standing, files.standing_forces) if path is not None]

    def make(person: PersonFacts) -> Trial:
        return trial_from_recordings(
            standing, recording, marker_map, person, fulcrum_m=fulcrums_m[number],
            standing_fulcrum_m=None if len(set(fulcrums_m)) == 1 else MID_FULCRUM_M, stated=options.stated,
            calibration=calibration, hip=options.hip, cutoff_hz=options.cutoff_hz,
            longest_gap_s=options.longest_gap_s, plate_sides=options.plate_sides, window=options.window,
            belt_speed_m_per_s=options.belt_speed_m_per_s, name=walk.stem,
            inputs={path.name: sha256(path) for path in used})

    try:
        trial = make(options.person)
    except InputError as error:
        if options.person.mass_kg is not None or not (error.where or "").startswith("mass_kg"):
            raise
        found = weighed(make(dataclasses.replace(options.person, mass_kg=PLACEHOLDER_KG)),
                        belt_speed_m_per_s=options.belt_speed_m_per_s)
        if found.value is None:
            raise error from None
        trial = noted(make(dataclasses.replace(options.person, mass_kg=found.value)),
                      f"Body mass {found.value:.1f} kg is the impulse of the forces while every foot on the ground was "
                      "on a plate, less what the body's motion took of it; it is good to a few percent: state mass_kg "
                      "(--mass-kg).")
    if not options.inverse_kinematics:
        return trial
    return refined(trial, cutoff_hz=options.cutoff_hz, longest_gap_s=options.longest_gap_s)


def noted(trial: Trial, note: str) -> Trial:
    """The trial with one more note."""
    return dataclasses.replace(trial, notes=(*trial.notes, note))
