"""A trial: everything that a manifest leads to, or a laboratory's recordings, brought to the
model's frames."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.files import resource, sha256
from vsf_drake.base.schema import load_yaml
from vsf_drake.base.sentences import say
from vsf_drake.model.model_file import in_shell, load_model, stated_fulcrum
from vsf_drake.model.parameters import (
    GRAVITY,
    PELVIS_TRANSLATIONS,
    ModelParameters,
    Subject,
    person_coordinates,
)
from vsf_drake.model.setting import AtSetting, moves, setting_of
from vsf_drake.motion import manifest as manifests
from vsf_drake.motion.contacts import Assignment, PlateContact, assign_plates
from vsf_drake.motion.events import (
    MINIMUM_S,
    Span,
    Stance,
    common,
    find_scuffs,
    stances_on,
    united,
    words,
)
from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.formats.recording import (
    SIDES,
    Plate,
    PlateRecording,
    Recording,
    world_to_os,
)
from vsf_drake.motion.formats.tables import read_storage, write_opensim
from vsf_drake.motion.import_options import TrialOptions
from vsf_drake.motion.manifest import (
    NO_FORCES,
    ForceColumns,
    GeometricOffsets,
    Manifest,
    Window,
    load_manifest,
    named_file,
)
from vsf_drake.motion.markers.calibration import calibrate
from vsf_drake.motion.markers.joints import orientations_of
from vsf_drake.motion.markers.maps import SHIPPED, MarkerMap, choose_map, load_marker_map
from vsf_drake.motion.markers.person_facts import (
    LEAST_MASS_KG,
    MOST_MASS_KG,
    PersonFacts,
    with_files,
)
from vsf_drake.motion.markers.posture import prepared
from vsf_drake.motion.markers.segments import Calibration, TrackedMotion
from vsf_drake.motion.opensim import (
    HEAVIEST_BW,
    LIGHTEST_BW,
    assign_prefixes,
    read_kinematics,
    read_plate,
)
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.wanted_part import track_wanted

PLACEHOLDER_KG = 70.0
"""Stands for a mass that only the walk tells until the plates are assigned; then the person is
calibrated again, since the weight says how far the prosthesis was pressed together."""
# a pelvis that has to move farther (RMS) does not belong to the leg: lengths or joint centres are
# wrong
LARGE_M = 0.05
LONGEST_STRIDE_S = 2.5
CONTRADICTED = (0.52, 1.25)
"""Share of a stated mass that plates may carry. More: vertical momentum (6 % of the weight over a
step), gauges, shoes and a bag (a choice). Less: a harness or a rail may bear half of it; pounds
taken for kilograms leave 0.45."""
# what a pound is, and how near to it a ratio suggests pounds
POUND_KG = 0.45359237
LIKE_POUNDS = 0.1


UNUSABLE_RECORDING = "UNUSABLE RECORDING"
NO_PLATE = "NO PLATE"  # how the note of a trial begins without forces


@dataclass(frozen=True, kw_only=True)
class RecordingMark:
    """How good a recording is, as `recording` found; results that are made of it carry it
    on."""

    mark: str  # good, doubtful or unusable
    expected_error_bw: float
    """of the force predicted from it (body weights, root mean square over stance)"""
    verdict: str  # mark and error in words, with what makes most of it

    @property
    def note(self) -> str:
        """What stands among the notes of a result; of an unusable recording it begins with
        UNUSABLE_RECORDING."""
        if self.mark == "unusable":
            return f"{UNUSABLE_RECORDING}{self.verdict.removeprefix(self.mark)}"
        return f"Recording: {self.verdict}"


@dataclass(frozen=True, eq=False)
class Trial:
    """One recording of somebody walking, ready to drive the model. SI and radians."""

    path: Path  # the manifest, or the recording where there is none
    name: str  # as the manifest says, or its file's name without suffix
    subject: Subject
    synthetic: bool  # constructed rather than measured
    fulcrum_m: float  # where the fulcrum stood, from A; of a passive foot its clamp
    start_s: float  # the window: kinematics, forces and the manifest's request all cover it
    end_s: float
    trajectory: CoordinateTrajectory  # see `motion.opensim`; over the whole recording
    plates: dict[str, PlateRecording]
    """by side, over the whole recording; the prosthetic side is there, or none is"""
    notes: tuple[str, ...]  # sentences on what was assumed, filled, turned or cut
    model: ModelParameters
    inputs: dict[str, str]  # SHA-256 of every file read, by its path as the manifest writes it
    # frozen: one default can serve all
    offsets: GeometricOffsets = GeometricOffsets()  # noqa: RUF009
    unmeasured: dict[str, tuple[Span, ...]] = field(default_factory=dict)
    """By side, when the foot stands on ground that no plate measures, so that its force is unknown
    though `plates` says zero: found in a trial from markers, else as its manifest says."""
    rest_n: dict[str, float] = field(default_factory=dict)
    """By side, vertical force that the plate showed unloaded and that `plates` still has where the
    foot stands, as the manifest says; without those that show none."""
    cutoff_hz: float | None = None  # of the markers' filter; None where there was none
    belt_speed_m_per_s: float = 0.0  # of the treadmill from whose belt the trial is seen
    judged: RecordingMark | None = None  # None where nobody examined it
    recording: Recording | None = None  # this and the rest: what a trial from markers was made of
    calibration: Calibration | None = None
    tracked: TrackedMotion | None = None
    contacts: tuple[PlateContact, ...] = ()

    @property
    def setting(self) -> AtSetting:
        """Where the fulcrum stood, or which passive foot it was."""
        return setting_of(self.model.foot, self.fulcrum_m)

    @property
    def plate(self) -> PlateRecording | None:
        """Under the prosthetic foot, with the spans in which its force is unknown; None where no
        force was measured."""
        return self._plate(self.subject.prosthetic_side)

    @property
    def prosthetic_plate(self) -> PlateRecording:
        """The same for what cannot do without it; InputError where no force was measured."""
        plate = self.plate
        if plate is None:
            raise InputError(
                f"no force was measured on the {self.subject.prosthetic_side} (prosthetic) foot, "
                "and this needs it",
                file=self.path,
                where="forces",
                right="Name the file of the forces, or leave the trial out; without them "
                "`simulate --contact`, `validate --contact`, `tune --contact` and `check` work",
            )
        return plate

    @property
    def intact_plate(self) -> PlateRecording | None:
        """That under the other foot, likewise."""
        return next(
            (self._plate(side) for side in self.plates if side != self.subject.prosthetic_side),
            None,
        )

    def _plate(self, side: str) -> PlateRecording | None:
        plate = self.plates.get(side)
        spans = self.unmeasured.get(side, ())
        return dataclasses.replace(plate, unknown_s=spans) if plate and spans else plate


def default_model() -> ModelParameters:
    """The model of a manifest that names none: models/nominal.yaml, calibrated to the published
    bench end points."""
    return load_model(resource("models/nominal.yaml"))


def model_in_shell(
    model: ModelParameters, length_mm: float | None, *, file: Path | None = None
) -> tuple[ModelParameters, list[str]]:
    """`model` with its foot in a shell of that length, its own for None, and a note on what is
    stated, in the manifest `file` if that is given. InputError where the two make no foot."""
    if length_mm is None:
        return model, []
    group = "prosthesis.foot_length_mm, foot."
    foot = in_shell(model.foot, 1e-3 * length_mm, file=file, group=group)
    ahead_mm = 1e3 * (sum(foot.keel.element_lengths_m) - foot.heel_x_m - foot.length_m)
    return dataclasses.replace(model, foot=foot), say(
        "trial", "shell", length_mm=length_mm, ahead_mm=ahead_mm, passive=not moves(foot)
    )


def load_subject(path: str | Path) -> Subject:
    """Reads subject.yaml, or the subject that a trial manifest names (a file with the key
    `subject`)."""
    path = Path(path)
    manifests.refuse_recording(path)
    if "subject" in manifests.keys_of(path):
        path = named_file(path, "subject", load_manifest(path).subject)
    return load_yaml(path, Subject)


def load_trial(path: str | Path) -> Trial:
    """Reads a trial manifest and every file it names. Read the trial's `notes`: they say what was
    assumed.

    With markers, see `trial_from_recordings`. With joint angles, files are in OpenSim's laboratory
    frame (x forward, y up, z right), in m, N, N m and the angle unit that their header states;
    nothing is filtered. Forces come back in the world frame W (x forward, y left, z up, ground z =
    0); coordinates keep OpenSim's names and, for the pelvis, OpenSim's axes; angles are in rad,
    knee flexion positive. See `vsf_drake.motion.manifest` for the keys. Refused where the columns
    do not tell the feet, the plates contradict the mass, or window, kinematics and forces share
    less than a stance of the prosthetic foot. Without forces (`Trial.plate` is None) nothing of
    this is checked, and the window is that of the kinematics.
    """
    path = Path(path)
    manifest = load_manifest(path)
    forces = (
        manifest.forces
        if isinstance(manifest.forces, ForceColumns)
        else ForceColumns(file=manifest.forces or "")
    )
    if forces.file == NO_FORCES:
        forces = ForceColumns(file="")
    sides = {"right": forces.right, "left": forces.left}
    options = TrialOptions(
        hip=manifest.hip_centre,
        plate_sides=sides if any(sides.values()) else None,
        window=manifest.window,
        cutoff_hz=None if manifest.already_filtered else manifest.marker_cutoff_hz,
        belt_speed_m_per_s=manifest.belt_speed_m_per_s,
        unknown_force=vars(manifest.unknown_force),
    )
    written = {
        "subject": manifest.subject,
        "kinematics": manifest.kinematics,
        "markers": manifest.markers,
        "standing": manifest.standing,
        "forces": forces.file or None,
        "model": manifest.model,
    }
    if manifest.marker_map not in SHIPPED:
        written["marker_map"] = manifest.marker_map
    named = {
        key: named_file(path, key, value) for key, value in written.items() if value is not None
    }
    if manifest.markers is not None and named.get("forces") == named["markers"]:
        del named["forces"]
    model = load_model(named["model"]) if "model" in named else default_model()
    model, shell_notes = model_in_shell(model, manifest.prosthesis.foot_length_mm, file=path)
    fulcrum_m = stated_fulcrum(
        manifest.prosthesis.fulcrum_mm, model.foot, file=path, where="prosthesis.fulcrum_mm"
    )
    inputs = {path.name: sha256(path)} | {
        str(written[key]): sha256(file) for key, file in named.items()
    }
    if manifest.markers is None:
        trial = _trial_from_angles(path, manifest, named, options, model, fulcrum_m)
    else:
        person, stated = manifests.load_stated_subject(named["subject"])
        axes = vars(manifest.laboratory)
        standing = read_trial(named["standing"], **axes) if "standing" in named else None
        walk = read_trial(named["markers"], forces=named.get("forces"), **axes)
        if manifest.forces == NO_FORCES:
            walk = dataclasses.replace(walk, plates=())
        marker_map = None
        if manifest.marker_map is not None:
            marker_map = load_marker_map(named.get("marker_map", manifest.marker_map))
        options = dataclasses.replace(options, stated=stated)
        trial = trial_from_recordings(
            standing, walk, marker_map, person, options, fulcrum_m=fulcrum_m, model=model, path=path
        )
    trial = dataclasses.replace(
        trial,
        name=manifest.name or path.stem,
        synthetic=manifest.synthetic,
        notes=(*trial.notes, *shell_notes),
        inputs=inputs,
        offsets=manifests.to_si(manifest.offsets),
        rest_n={side: newton for side, newton in vars(manifest.plate_rest_n).items() if newton},
    )
    check_mass(trial, file=named["subject"])
    return trial


def _trial_from_angles(
    path: Path,
    manifest: Manifest,
    named: dict[str, Path],
    options: TrialOptions,
    model: ModelParameters,
    fulcrum_m: float,
) -> Trial:
    subject = load_yaml(named["subject"], Subject)
    trajectory, notes = read_kinematics(
        read_storage(named["kinematics"]),
        prosthetic_side=subject.prosthetic_side,
        unit=manifest.kinematics_unit,
    )
    read: dict[str, tuple[PlateRecording, list[str]]] = {}
    if "forces" in named:
        storage = read_storage(named["forces"])
        prefixes = assign_prefixes(storage, options.plate_sides)
        require(
            subject.prosthetic_side in prefixes,
            f"there is no force for the {subject.prosthetic_side} (prosthetic) foot",
            f"forces.{subject.prosthetic_side}",
            f"Name its prefix in {storage.path.name}; or "
            "is the subject's prosthetic_side the other one? If it was on no plate, leave forces "
            "out",
            file=path,
        )
        read = {
            side: read_plate(storage, prefix, mass_kg=subject.mass_kg)
            for side, prefix in prefixes.items()
        }
        notes += [*storage.notes, *(note for _, more in read.values() for note in more)]
        notes += say(
            "trial", "no_plates", sides=[side for side in SIDES if side not in read], alone=False
        )
    return _made(
        path,
        subject,
        trajectory,
        {side: plate for side, (plate, _) in read.items()},
        options,
        notes=notes,
        unmeasured={side: united(spans) for side, spans in options.unknown_force.items() if spans},
        fulcrum_m=fulcrum_m,
        model=model,
    )


def _made(
    path: Path,
    subject: Subject,
    trajectory: CoordinateTrajectory,
    plates: dict[str, PlateRecording],
    options: TrialOptions,
    *,
    notes: Sequence[str],
    unmeasured: dict[str, tuple[Span, ...]],
    **more: Any,
) -> Trial:
    """The trial on its belt, with its window; `more` are other fields."""
    trajectory, plates, belt_notes = on_the_belt(
        trajectory, plates, speed_m_per_s=options.belt_speed_m_per_s
    )
    window, window_notes = trial_window(
        path,
        options.window,
        trajectory,
        plates,
        subject,
        unmeasured,
        around_stances_s=options.around_stances_s,
    )
    return Trial(
        path=path,
        name=path.stem,
        subject=subject,
        synthetic=False,
        start_s=window[0],
        end_s=window[1],
        trajectory=trajectory,
        plates=plates,
        notes=(*notes, *belt_notes, *window_notes),
        inputs={},
        unmeasured=unmeasured,
        belt_speed_m_per_s=options.belt_speed_m_per_s,
        **more,
    )


# From markers and force plates: calibrate, track, give the plates to the feet.


def trial_from_recordings(
    standing: Recording | None,
    walk: Recording,
    marker_map: MarkerMap | None,
    person: PersonFacts,
    options: TrialOptions = TrialOptions(),
    *,
    fulcrum_m: float,
    standing_fulcrum_m: float | None = None,
    calibration: Calibration | None = None,
    model: ModelParameters | None = None,
    path: Path | None = None,
) -> Trial:
    """The trial of a person who walks over force plates with markers on.

    Args:
        standing: the standing trial of the same session; None: the walk itself calibrates, which is
            doubtful.
        marker_map: what the labels are; None: the shipped map that finds most of them.
        person: what is stated; a mass that is not is a file's, or taken from the forces (standing
            trial or walk).
        fulcrum_m: where the fulcrum stood; `standing_fulcrum_m` in the standing trial, if
            elsewhere.
        calibration: of the same person and map, from before; then `standing` is not looked at.
        path: the manifest, for messages; the walk's file if None.

    Plates that do not carry the prosthetic foot alone are left out, and a note says so: it is then
    a walk without plates.
    """
    path = walk.path if path is None else path
    model = model or default_model()
    force_file = walk.force_path or walk.path
    person, notes = with_files(person, standing, walk)
    if marker_map is None:
        marker_map, more = choose_map(walk if standing is None else standing)
        notes += more
    walk = prepared(walk, marker_map)
    notes += walk.notes
    source = walk if standing is None else standing
    by = partial(
        calibrate,
        source,
        marker_map,
        hip=options.hip,
        model=model,
        fulcrum_m=fulcrum_m if standing_fulcrum_m is None else standing_fulcrum_m,
    )
    weighed = True
    if calibration is None:
        calibration, weighed = _calibrated(
            by, person, on_plates=bool(standing is not None and source.plates)
        )
        notes += (
            [f"Standing trial: {note}" for note in standing.notes] if standing is not None else []
        )
    notes += calibration.notes
    walk, tracked = track_wanted(walk, calibration, options)
    if options.cutoff_hz is None:
        notes += say("trial", "already_filtered")
    assignment = Assignment({}, (), {})
    if walk.plates:
        assignment = assign_plates(walk, tracked, stated=options.plate_sides)
    assignment = dataclasses.replace(
        assignment,
        unmeasured={
            side: united(
                [*assignment.unmeasured.get(side, ()), *options.unknown_force.get(side, ())]
            )
            for side in SIDES
        },
    )
    if not weighed:
        mass, more = mass_from_walk(walk, assignment)
        calibration, _ = _calibrated(by, dataclasses.replace(person, mass_kg=mass))
        notes += more
    subject, stated_notes = manifests.with_stated(calibration.subject, options.stated)
    calibration = dataclasses.replace(calibration, subject=subject)
    for foot, plate in assignment.plates.items():
        peak = float(plate.force_W[:, 2].max()) / (subject.mass_kg * GRAVITY)
        require(
            peak <= HEAVIEST_BW,
            f"the vertical force on the {foot} foot is {peak:.1f} times the body weight of "
            f"{subject.mass_kg:.3g} kg",
            "forces",
            "Check the unit of the forces and the subject's mass_kg",
            file=force_file,
        )
    side = subject.prosthetic_side
    values, reach_notes = reaching_pelvis(tracked, calibration, subject)
    trajectory = dataclasses.replace(tracked, values=values).trajectory(
        person_coordinates(side), source=str(walk.path)
    )
    notes = (
        list(dict.fromkeys([*notes, *stated_notes, *tracked.notes, *assignment.notes]))
        + reach_notes
    )
    notes += say(
        "trial",
        "no_plates",
        sides=[s for s in SIDES if walk.plates and s not in assignment.plates],
        alone=True,
    )
    missed = side not in assignment.plates  # as without plates
    return _made(
        path,
        subject,
        trajectory,
        {} if missed else assignment.plates,
        options,
        notes=notes,
        unmeasured={} if missed else assignment.unmeasured,
        fulcrum_m=fulcrum_m,
        model=model,
        recording=walk,
        calibration=calibration,
        tracked=tracked,
        contacts=assignment.contacts,
        cutoff_hz=options.cutoff_hz,
    )


def _calibrated(
    by: partial[Calibration], person: PersonFacts, *, on_plates: bool = False
) -> tuple[Calibration, bool]:
    if person.mass_kg is not None or on_plates:
        try:
            return by(person), True
        except InputError as error:
            if person.mass_kg is not None or not (error.where or "").startswith("mass_kg"):
                raise
    return by(dataclasses.replace(person, mass_kg=PLACEHOLDER_KG)), False


# The pelvis where the model's own prosthetic leg reaches the measured foot.
#
# Segments posed by their own markers come apart at the joints by a centimetre or two. The model's
# do not: hung from the measured pelvis, its foot would bob by the sum of these errors, and 1 mm of
# height is 3 % of body weight in the force. So the pelvis's path is moved by as much as puts the
# prosthetic ankle where the foot's markers show it; angles stay.
#
# Known weakness: markers of a prosthesis move with what its socket gives under load, which the
# model's own socket gives once more. A nearly rigid socket instead, on two walks of able-bodied
# people, changed the resultant's error by -0.04 to +0.02 body weights and tripled that of the
# fore-aft force.


def reaching_pelvis(
    tracked: TrackedMotion, calibration: Calibration, subject: Subject
) -> tuple[np.ndarray, list[str]]:
    """`tracked.values` with the pelvis moved, for the lengths of `subject`, and a note on how
    far."""
    moved = tracked.feet[subject.prosthetic_side].ankle_W - model_ankle(
        tracked, calibration, subject
    )
    values = np.array(tracked.values)
    values[:, :3] += world_to_os(moved)
    large = np.sqrt(np.mean(np.sum(moved**2, axis=1))) > LARGE_M
    return values, say(
        "trial",
        "pelvis",
        side=subject.prosthetic_side,
        mean_mm=1e3 * moved.mean(axis=0),
        spread_mm=1e3 * moved.std(axis=0),
        large=large,
    )


def model_ankle(tracked: TrackedMotion, calibration: Calibration, subject: Subject) -> np.ndarray:
    """(n, 3) m, where the prosthetic ankle would be under the measured pelvis with the subject's
    lengths."""
    side = subject.prosthetic_side

    # Down the chain: hip and thigh as the subject has them, ankle as marked in the shank.
    R_W, p_WPelvis = orientations_of(tracked.values)
    outward = -1.0 if side == "right" else 1.0
    p_PHip = np.array([subject.hip_forward_m, subject.hip_lateral_m, subject.hip_up_m])
    thigh = np.array([0.0, 0.0, subject.prosthetic_thigh_length_m])
    hip = p_WPelvis + R_W["pelvis"] @ (p_PHip * [1.0, outward, 1.0])
    knee = hip - R_W[f"thigh_{side}"] @ thigh
    return np.asarray(knee + R_W[f"shank_{side}"] @ calibration.segments[f"foot_{side}"].p_PB)


def write_trial_files(trial: Trial, folder: str | Path, stem: str) -> tuple[str, str]:
    """Writes the two `opensim_files` of a trial; their names.

    Both are in OpenSim's frame. Angles are in degrees, with both ankles where the trial comes from
    markers. What the trial's belt carried stays carried: the files are of a floor at rest."""
    columns = dict(zip(trial.trajectory.names, trial.trajectory.values.T, strict=True))
    if trial.tracked is not None:
        columns = dict(zip(trial.tracked.names, trial.tracked.values.T, strict=True)) | columns
        columns = {name: columns[name] for name in (*trial.trajectory.names, *columns)}
    return write_opensim(
        Path(folder),
        stem,
        time_s=trial.trajectory.time_s,
        coordinates=columns,
        metres=PELVIS_TRANSLATIONS,
        force_time_s=next(iter(trial.plates.values())).time_s,
        plates={
            side: Plate(side, plate.force_W, plate.cop_W, plate.free_moment_nm)
            for side in SIDES
            if (plate := trial.plates.get(side)) is not None
        },
        source="synthetic" if trial.synthetic else "from a recording",
    )


# Body mass from the force plates of a walk.


def mass_from_walk(walk: Recording, assignment: Assignment) -> tuple[float, list[str]]:
    """Mean vertical force of both feet over the strides in which both stand on plates throughout,
    in kg, and a note.

    Over a stride the body's vertical momentum returns, so the mean force is the weight.
    """
    time = walk.force_time_s
    vertical = np.sum([plate.force_W[:, 2] for plate in assignment.plates.values()], axis=0)
    strikes = {
        side: [c.start_s for c in assignment.contacts if c.side == side and c.start_seen]
        for side in assignment.plates
    }
    strides = [
        (start, end)
        for strikes_of_foot in strikes.values()
        for start, end in pairwise(strikes_of_foot)
        if end - start < LONGEST_STRIDE_S and _measured((start, end), assignment.unmeasured)
    ]
    if len(assignment.plates) < 2 or not strides:
        what = (
            "the body mass is not stated, and there is no stride in which both feet stand on "
            "plates throughout"
        )
    else:
        mass = (
            float(np.mean([float(np.mean(vertical[(time >= a) & (time < b)])) for a, b in strides]))
            / GRAVITY
        )
        if LEAST_MASS_KG <= mass <= MOST_MASS_KG:
            return mass, say("trial", "mass", mass_kg=mass, strides=strides)
        what = f"the plates carry {mass * GRAVITY:.0f} N over a stride, which is nobody's weight"
    raise InputError(
        what,
        file=walk.force_path or walk.path,
        where="mass_kg (--mass-kg)",
        right="State the body mass, prosthesis included",
    )


def check_mass(trial: Trial, *, file: str | Path | None) -> None:
    """Refuses a body mass that the plates contradict: mean vertical force over weight is outside
    CONTRADICTED.

    Over steps, from the strike of one foot to that of the other, each time with the other foot on
    its plate. Without such a step, any mass passes.
    """
    stances = stances_on(trial.plates)
    strikes = sorted(
        (s.start_s, side) for side, carried in stances.items() for s in carried if s.start_seen
    )
    steps = [
        (start, end)
        for (start, first), (end, second) in pairwise(strikes)
        if first != second
        and _measured((start, end), trial.unmeasured)
        and all(
            any(s.start_s <= at <= s.end_s for s in stances[side])
            for side, at in ((second, start), (first, end))
        )
    ]
    if not steps:
        return
    duration = sum(end - start for start, end in steps)
    force = (
        sum(
            float(np.mean(plate.force_W[(plate.time_s >= start) & (plate.time_s < end), 2]))
            * (end - start)
            for plate in trial.plates.values()
            for start, end in steps
        )
        / duration
    )
    carried = force / GRAVITY
    stated = trial.subject.mass_kg
    if not CONTRADICTED[0] <= carried / stated <= CONTRADICTED[1]:
        pounds = abs(stated * POUND_KG / carried - 1.0) < LIKE_POUNDS
        raise InputError(
            f"the plates contradict a mass of {stated:g} kg: over {duration:.2f} s in which they "
            f"carry both feet, the mean vertical force is the weight of {carried:.1f} kg",
            file=file,
            where="mass_kg",
            right=f"Is it in pounds? {stated:g} lb are {stated * POUND_KG:.1f} kg"
            if pounds
            else "Give the mass in kg, prosthesis included, or check the unit of the forces",
        )


def _measured(span: Span, unmeasured: dict[str, tuple[Span, ...]]) -> bool:
    return not any(common(span, other) for spans in unmeasured.values() for other in spans)


# The part of a recording to simulate, where kinematics, forces and manifest overlap; a treadmill's
# belt.


DEFAULT_STANCE_S = 0.5
MINIMUM_LOAD_N = 200.0
BACKWARD_M_PER_S = -0.3


def trial_window(
    path: Path,
    requested: Window | None,
    trajectory: CoordinateTrajectory,
    plates: dict[str, PlateRecording],
    subject: Subject,
    unmeasured: Mapping[str, Sequence[Span]] | None = None,
    *,
    around_stances_s: float | None = None,
) -> tuple[Span, list[str]]:
    """The window of a trial (s), and notes on it and on the stances in it; `path` is the manifest,
    for messages.

    Without plates it is the requested part of the kinematics, refused where that is shorter than
    the shortest stance. With them, and without a requested window, the stretch between the
    `unmeasured` ones of the prosthetic foot that holds most of its stances is taken, and of that
    what is within `around_stances_s` of them, if it is given; a requested one is kept. Refused
    where window, kinematics and forces do not overlap, or the prosthetic foot has hardly any load
    or less than 0.15 s of a stance, or the window is shorter than a stance.
    """
    side = subject.prosthetic_side
    moved = trajectory.start_s, trajectory.end_s
    if not plates:
        window, notes = _choose_window(requested, moved, moved, path, (), ())
        require(
            window[1] - window[0] >= MINIMUM_S,
            f"the trial of {words(window)} is shorter than any stance ({MINIMUM_S:g} s)",
            "window",
            file=path,
        )
        return window, notes + say("trial", "plateless", begins=NO_PLATE)
    plate = plates[side]
    stances = stances_on(plates)
    record = float(plate.time_s[0]), float(plate.time_s[-1])
    window, notes = _choose_window(
        requested,
        moved,
        record,
        path,
        (unmeasured or {}).get(side, ()),
        stances[side],
    )
    carried = [s for s in stances[side] if common(s.span, window)]
    if requested is None and around_stances_s is not None and carried:
        near = (
            common(
                window,
                (
                    round(carried[0].start_s - around_stances_s, 3),
                    round(carried[-1].end_s + around_stances_s, 3),
                ),
            )
            or window
        )
        notes += (
            say("trial", "trimmed", window=window, near=near, around_s=around_stances_s)
            if near != window
            else []
        )
        window = near
    _check_stances(window, plate, stances[side], side, subject.mass_kg, path)
    for s in sorted(plates, key=lambda s: s != side):
        in_window = [
            (
                c.span,
                [
                    end
                    for end, seen in (
                        ("start", c.starts and c.start_s >= window[0]),
                        ("end", c.ends and c.end_s <= window[1]),
                    )
                    if not seen
                ],
            )
            for c in stances[s]
            if common(c.span, window)
        ]
        scuffs = [c.span for c in find_scuffs(plates[s].time_s, plates[s].force_W[:, 2])]
        notes += say(
            "trial",
            "foot",
            side=s,
            prosthetic=s == side,
            stances=in_window,
            scuffs=[scuff for scuff in scuffs if common(scuff, window)],
        )
    at = (
        (plate.time_s >= window[0])
        & (plate.time_s <= window[1])
        & (plate.force_W[:, 2] > MINIMUM_LOAD_N)
    )
    at[1:] &= at[:-1]
    if plate.has_cop and at.sum() >= 3:  # runs backward under the foot as on a moving belt?
        speed = float(np.median(np.gradient(plate.cop_W[at, 0], plate.time_s[at])))
        notes += say("trial", "treadmill", speed=speed) if speed <= BACKWARD_M_PER_S else []
    return window, notes


def _choose_window(
    requested: Window | None,
    kinematics: Span,
    forces: Span,
    file: Path,
    unmeasured: Sequence[Span],
    stances: Sequence[Stance],
) -> tuple[Span, list[str]]:
    span = (
        kinematics[0] if requested is None or requested.start_s is None else requested.start_s,
        kinematics[1] if requested is None or requested.end_s is None else requested.end_s,
    )
    part = common(span, kinematics)
    if part is None:
        raise InputError(
            f"the window of {words(span)} and the kinematics of {words(kinematics)} do not overlap",
            file=file,
            where="window",
        )
    both = common(part, forces)
    if both is None:
        raise InputError(
            f"the forces of {words(forces)} and the window of {words(part)} do not overlap",
            file=file,
            where="window" if requested else "forces",
            right="Do both recordings count time from the same instant?",
        )
    notes = []
    for cut, whole, to in ((part, span, "kinematics"), (both, part, "force record")):
        if max(abs(cut[0] - whole[0]), abs(cut[1] - whole[1])) > 1e-3 and (
            requested or to != "kinematics"
        ):
            notes += say("trial", "cut", whole=whole, part=cut, to=to)
    missed = [span for span in unmeasured if common(span, both)]
    if not missed:
        return both, notes

    def held(span: Span) -> float:
        return sum(max(0.0, min(s.end_s, span[1]) - max(s.start_s, span[0])) for s in stances)

    ends = [both[0], *(end for span in missed for end in span), both[1]]
    between = [
        (start, end) for start, end in zip(ends[::2], ends[1::2], strict=True) if end > start
    ]
    best = max(between, key=lambda span: (held(span), span[1] - span[0]), default=None)
    if requested is not None or best is None or held(best) < MINIMUM_S:
        best = None
    return best or both, notes + say("trial", "unmeasured", window=both, best=best, missed=missed)


def _check_stances(
    window: Span,
    plate: PlateRecording,
    stances: Sequence[Stance],
    side: str,
    mass_kg: float,
    file: Path,
) -> None:
    peak = float(plate.force_W[:, 2].max())
    weight = mass_kg * GRAVITY
    require(
        stances,
        f"the {side} (prosthetic) foot has no stance: its largest vertical force is {peak:.3g} N",
        "forces",
        "If no plate carried it, write `forces: none`: a walk without plates",
        file=file,
    )
    require(
        peak >= LIGHTEST_BW * weight,
        f"the {side} (prosthetic) foot is never loaded by more than {peak:.3g} N, "
        f"{peak / weight:.2f} times the body weight",
        "forces",
        "Check the unit of the forces and the subject's mass_kg",
        file=file,
    )
    listed = f"The stances of the {side} foot are {', '.join(words(s.span) for s in stances)}"
    shortest = min((s.duration_s for s in stances if s.complete), default=DEFAULT_STANCE_S)
    require(
        window[1] - window[0] >= shortest,
        f"the trial of {words(window)} is shorter than one stance ({shortest:.3f} s)",
        "window",
        listed,
        file=file,
    )
    require(
        max(min(s.end_s, window[1]) - max(s.start_s, window[0]) for s in stances) >= MINIMUM_S,
        f"the {side} (prosthetic) foot carries no load from {words(window)}",
        "window",
        listed,
        file=file,
    )


def on_the_belt(
    trajectory: CoordinateTrajectory, plates: dict[str, PlateRecording], *, speed_m_per_s: float
) -> tuple[CoordinateTrajectory, dict[str, PlateRecording], list[str]]:
    """A treadmill recording seen from its belt, where the ground stands still, and a note that says
    so.

    The pelvis and the centres of pressure move forward by speed (+ when the belt runs backward)
    times time.
    """
    if speed_m_per_s == 0.0:
        return trajectory, plates, []
    values = np.array(trajectory.values)
    values[:, trajectory.names.index("pelvis_tx")] += speed_m_per_s * trajectory.time_s
    carried = {
        side: dataclasses.replace(
            plate, cop_W=plate.cop_W + np.outer(speed_m_per_s * plate.time_s, [1, 0, 0])
        )
        for side, plate in plates.items()
    }
    return trajectory.with_values(values), carried, say("trial", "belt", speed=speed_m_per_s)
