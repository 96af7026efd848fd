"""From markers and force plates to a trial: calibrate, track, give the plates to the feet.

    standing, walk = read_trial("static.c3d"), read_trial("walk.c3d")
    trial = trial_from_recordings(standing, walk, None, PersonFacts(sex="male", prosthetic_side="right"),
                                  fulcrum_m=0.066)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.contacts import Assignment, assign_plates
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.kinematics import PELVIS_TRANSLATIONS, person_coordinates
from vsf_drake.motion.manifest import GeometricOffsets, Window, with_stated
from vsf_drake.motion.markers.calibration import calibrate
from vsf_drake.motion.markers.frames import prepared
from vsf_drake.motion.markers.gaps import LONGEST_GAP_S
from vsf_drake.motion.markers.joint_angles import COORDINATES, orientations_of
from vsf_drake.motion.markers.maps import MarkerMap, choose_map
from vsf_drake.motion.markers.person_facts import PersonFacts, with_files
from vsf_drake.motion.markers.posture import MID_FULCRUM_M
from vsf_drake.motion.markers.schema import Calibration, TrackedMotion
from vsf_drake.motion.markers.tracking import CUTOFF_HZ, track
from vsf_drake.motion.plates import HEAVIEST_BW, world_to_os
from vsf_drake.motion.trial_record import Trial, default_model, mass_from_walk
from vsf_drake.motion.window import on_the_belt, trial_window
from vsf_drake.parameters import GRAVITY, ModelParameters, Subject

PLACEHOLDER_KG = 70.0
"""Stands for a mass that only the walk tells until the plates are assigned; then the person is calibrated again, since
the weight says how far the prosthesis was pressed together."""


@dataclass(frozen=True, eq=False)
class MarkedWalk:
    """A walk from markers, with the forces on each foot.

    Attributes:
        recording: right-handed, with the marker map's labels.
        calibration: its subject is the person with all that was stated.
        tracked, assignment: motion and forces.
        notes: sentences on what was assumed.
    """

    recording: Recording
    calibration: Calibration
    tracked: TrackedMotion
    assignment: Assignment
    notes: tuple[str, ...]


def trial_from_recordings(
    standing: Recording | None, walk: Recording, marker_map: MarkerMap | None, person: PersonFacts, *,
    fulcrum_m: float, standing_fulcrum_m: float | None = None, stated: Mapping[str, float] | None = None,
    calibration: Calibration | None = None,
    hip: str = "harrington", cutoff_hz: float | None = CUTOFF_HZ, longest_gap_s: float = LONGEST_GAP_S,
    plate_sides: Mapping[str, str | None] | None = None, window: Window | None = None,
    belt_speed_m_per_s: float = 0.0, model: ModelParameters | None = None,
    offsets: GeometricOffsets = GeometricOffsets(),  # noqa: B008 (frozen: one default can serve all)
    path: Path | None = None, name: str | None = None, synthetic: bool = False,
    inputs: Mapping[str, str] | None = None,
) -> Trial:
    """The trial of a person who walks over force plates with markers on.

    Args:
        standing: the standing trial of the same session; None: the walk itself calibrates, which is doubtful.
        walk: markers and plates.
        marker_map: what the labels are; None: the shipped map that finds most of them.
        person: what is stated of the person; without a mass it is what a file states, or taken from the forces of the
            standing trial or of the walk.
        fulcrum_m: where the fulcrum stood.
        standing_fulcrum_m: where it stood in the standing trial, if elsewhere.
        stated: fields of `Subject` that are known better than the markers tell, by name; they win.
        calibration: of the same person and map, from before; then `standing` is not looked at.
        hip, cutoff_hz, longest_gap_s: see `calibrate` and `track`; a cut-off of None leaves the markers as they are.
        plate_sides: plate names by side, where the user says which plate is which foot.
        window, belt_speed_m_per_s, model, offsets, name, synthetic: as in the manifest.
        path: the manifest, for messages; the walk's file if None.
        inputs: SHA-256 by file, for the record.

    Raises:
        InputError: see `calibrate`, `track`, `assign_plates` and `load_trial`.
    """
    path = walk.path if path is None else path
    model = model or default_model()
    marked = walk_from_markers(standing, walk, marker_map, person, stated=stated, calibration=calibration, hip=hip,
                               cutoff_hz=cutoff_hz, longest_gap_s=longest_gap_s, plate_sides=plate_sides,
                               model=model,
                               fulcrum_m=fulcrum_m if standing_fulcrum_m is None else standing_fulcrum_m)
    subject, tracked, assignment = marked.calibration.subject, marked.tracked, marked.assignment
    side = subject.prosthetic_side
    if side not in assignment.plates:
        raise InputError(f"no plate carries the {side} (prosthetic) foot alone", file=walk.force_path or walk.path,
                         where="forces", right=" ".join(n for n in assignment.notes if n.startswith("Plate ")) or None)
    values, reach_notes = reaching_pelvis(tracked, marked.calibration, subject)
    trajectory = dataclasses.replace(tracked, values=values).trajectory(person_coordinates(side), source=str(walk.path))
    trajectory, plates, belt_notes = on_the_belt(trajectory, assignment.plates, speed_m_per_s=belt_speed_m_per_s)
    span, window_notes = trial_window(path, window, trajectory, plates, subject, assignment.unmeasured)
    missing = tuple(f"No plate carries the {s} foot alone." for s in ("right", "left") if s not in plates)
    return Trial(path=path, name=name or path.stem, subject=subject, synthetic=synthetic, fulcrum_m=fulcrum_m,
                 start_s=span[0], end_s=span[1], trajectory=trajectory, plates=plates,
                 notes=marked.notes + reach_notes + missing + belt_notes + window_notes, model=model,
                 inputs=dict(inputs or {}), offsets=offsets, unmeasured=assignment.unmeasured,
                 recording=marked.recording, calibration=marked.calibration, tracked=tracked,
                 contacts=assignment.contacts)


def walk_from_markers(
    standing: Recording | None, walk: Recording, marker_map: MarkerMap | None, person: PersonFacts, *,
    stated: Mapping[str, float] | None = None, calibration: Calibration | None = None, hip: str = "harrington",
    cutoff_hz: float | None = CUTOFF_HZ, longest_gap_s: float = LONGEST_GAP_S,
    plate_sides: Mapping[str, str | None] | None = None, model: ModelParameters | None = None,
    fulcrum_m: float = MID_FULCRUM_M,
) -> MarkedWalk:
    """Person, motion and forces on the feet; see `trial_from_recordings` for the arguments.

    Raises:
        InputError: see `calibrate`, `track` and `assign_plates`; or the body mass is not known, or a force exceeds
            four body weights.
    """
    person, stated_notes = with_files(person, standing, walk)
    notes = [*stated_notes]
    if marker_map is None:
        marker_map, note = choose_map(walk if standing is None else standing)
        notes.append(note)
    walk = prepared(walk, marker_map)
    notes += walk.notes
    by = partial(_calibrated, walk if standing is None else standing, marker_map, hip=hip, model=model,
                 fulcrum_m=fulcrum_m)
    weighed = True
    if calibration is None:
        calibration, weighed = by(person, alone=standing is None)
        if standing is not None:
            notes += [f"Standing trial: {note}" for note in standing.notes]
    notes += calibration.notes
    tracked = track(walk, calibration, cutoff_hz=cutoff_hz, longest_gap_s=longest_gap_s)
    if cutoff_hz is None:
        notes.append("The markers are said to be filtered already; they were not filtered again.")
    pelvis = tracked.values[:, [tracked.names.index(n) for n in ("pelvis_tx", "pelvis_tz", "pelvis_ty")]] * [1, -1, 1]
    assignment = assign_plates(walk, tracked.time_s, tracked.feet, pelvis,
                               stated=dict(plate_sides) if plate_sides else None)
    if not weighed:
        mass, note = mass_from_walk(walk, assignment)
        calibration, _ = by(dataclasses.replace(person, mass_kg=mass))
        notes.append(note)
    subject, more = with_stated(calibration.subject, stated or {})
    _check_size(walk, assignment, subject.mass_kg)
    calibration = dataclasses.replace(calibration, subject=subject)
    notes += [*more, *tracked.notes, *assignment.notes]
    return MarkedWalk(walk, calibration, tracked, assignment, tuple(dict.fromkeys(notes)))


def _calibrated(source: Recording, marker_map: MarkerMap, person: PersonFacts, *, alone: bool = False, hip: str,
                model: ModelParameters | None, fulcrum_m: float) -> tuple[Calibration, bool]:
    """The calibration, and whether its mass is known rather than a placeholder."""
    by = partial(calibrate, source, marker_map, hip=hip, model=model, fulcrum_m=fulcrum_m)
    if person.mass_kg is not None:
        return by(person), True
    if source.plates and not alone:
        try:
            return by(person), True
        except InputError as error:
            if not (error.where or "").startswith("mass_kg"):
                raise
    return by(dataclasses.replace(person, mass_kg=PLACEHOLDER_KG)), False


def _check_size(walk: Recording, assignment: Assignment, mass_kg: float) -> None:
    for side, plate in assignment.plates.items():
        peak = float(plate.force_W[:, 2].max()) / (mass_kg * GRAVITY)
        if peak > HEAVIEST_BW:
            raise InputError(f"the vertical force on the {side} foot is {peak:.1f} times the body weight of "
                             f"{mass_kg:.3g} kg", file=walk.force_path or walk.path, where="forces",
                             right="Check the unit of the forces and the subject's mass_kg")


# The pelvis where the model's own prosthetic leg reaches the measured foot.
#
# Every segment's pose comes from its own markers, so that segments come apart at the joints by a centimetre or two
# (skin motion, joint centres). The model's do not: hung from the measured pelvis, its foot would slide and bob by the
# sum of these errors, and 1 mm of height is 3 % of body weight in the force (a sensitivity found in this model). What
# counts for the force is where the foot is; so the pelvis's path is moved by as much as puts the prosthetic ankle where
# the foot's markers show it. Angles stay as measured.
#
# Known weakness: markers of a prosthesis lie below its socket and move with what the socket gives under load, which the
# model's own socket gives once more. What the load changes in stance is therefore flattened, by about the share that
# the socket has in the compliance of the whole. A nearly rigid socket instead was tried on two walks of able-bodied
# people: the resultant's error changed by -0.04 to +0.02 body weights, that of the fore-aft force tripled.


LARGE_M = 0.05
"""A pelvis that has to move farther (RMS) than this does not belong to the leg: lengths or joint centres are wrong."""


def reaching_pelvis(tracked: TrackedMotion, calibration: Calibration,
                    subject: Subject) -> tuple[np.ndarray, tuple[str, ...]]:
    """`tracked.values` with another pelvis translation, and a note that says how far it was moved.

    Args:
        subject: the model's person, with lengths as they will be used.
    """
    ankle = model_ankle(tracked, calibration, subject)
    moved = tracked.feet[subject.prosthetic_side].ankle_W - ankle
    values = np.array(tracked.values)
    values[:, [tracked.names.index(name) for name in PELVIS_TRANSLATIONS]] += world_to_os(moved)
    mean, spread = 1e3 * moved.mean(axis=0), 1e3 * moved.std(axis=0)
    note = (f"The pelvis was moved so that the model's {subject.prosthetic_side} (prosthetic) ankle is where its "
            "markers show it: forward, left, up by "
            + ", ".join(f"{m:+z.0f} ± {s:.0f}" for m, s in zip(mean, spread, strict=True)) + " mm.")
    if np.sqrt(np.mean(np.sum(moved**2, axis=1))) > LARGE_M:
        note += " That is much: the lengths of the leg or the joint centres are doubtful."
    return values, (note,)


def model_ankle(tracked: TrackedMotion, calibration: Calibration, subject: Subject) -> np.ndarray:
    """(n, 3) m, where the prosthetic ankle would be under the measured pelvis with the subject's lengths."""
    side = subject.prosthetic_side
    R_W, p_WPelvis = orientations_of(tracked.values[:, [tracked.names.index(name) for name in COORDINATES]])
    outward = -1.0 if side == "right" else 1.0
    measured = calibration.segments[f"thigh_{side}"].p_PB
    forward, lateral, up = (stated if stated is not None else found for stated, found in zip(
        (subject.hip_forward_m, subject.hip_lateral_m, subject.hip_up_m),
        (measured[0], outward * measured[1], measured[2]), strict=True))
    thigh = subject.prosthetic_thigh_length_m or subject.thigh_length_m or float(
        np.linalg.norm(calibration.segments[f"shank_{side}"].p_PB))
    hip = p_WPelvis + R_W["pelvis"] @ np.array([forward, outward * lateral, up])
    knee = hip + R_W[f"thigh_{side}"] @ np.array([0.0, 0.0, -thigh])
    return knee + R_W[f"shank_{side}"] @ calibration.segments[f"foot_{side}"].p_PB
