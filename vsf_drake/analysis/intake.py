"""A laboratory's recordings of one person to trials that drive the model, with an account of how good each is."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vsf_drake.analysis.inverse_kinematics import refined
from vsf_drake.analysis.recording.check import FITTED_HIP_BW_PER_DEG, Check
from vsf_drake.analysis.recording.examine import examine, weighed
from vsf_drake.analysis.recording.foot import Examined
from vsf_drake.errors import InputError
from vsf_drake.files import sha256, user_path
from vsf_drake.model_file import check_fulcrum
from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.manifest import Window
from vsf_drake.motion.markers.maps import MarkerMap, load_marker_map
from vsf_drake.motion.markers.person_facts import PersonFacts, check_facts, with_files
from vsf_drake.motion.markers.posture import MID_FULCRUM_M
from vsf_drake.motion.markers.schema import Calibration
from vsf_drake.motion.trial import PLACEHOLDER_KG, trial_from_recordings
from vsf_drake.motion.trial_record import Trial, check_mass, default_model
from vsf_drake.parameters import ContactZone, FootParameters, ModelParameters

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


# One walk to one trial: read, calibrated, tracked, weighed, as the options of an import say.


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


# Which files belong together: the standing trial, the walks, their forces; and what their results are called.


BESIDE = ("{}.mot", "{}_grf.mot", "{}.sto", "{}_grf.sto", "{}.csv", "{}_grf.csv", "{}.forces")
"""Names of a force file beside `walk.trc`, the first that exists counts; {} is the walk's name without suffix."""
RESERVED = ("subject", "model", "standing", "import")
"""Names that a result folder needs for itself."""


@dataclass(frozen=True)
class FileSet:
    """The files of one person.

    Attributes:
        standing: the standing trial; None where a walk stands for it.
        walks, forces: as many of each; None for a walk that has its forces in itself.
        standing_forces: of the standing trial, where they are in a file of their own.
        found: the force files that nobody named but that lie beside their walk.
    """

    standing: Path | None
    walks: tuple[Path, ...]
    forces: tuple[Path | None, ...]
    standing_forces: Path | None = None
    found: tuple[Path, ...] = ()

    def all(self) -> list[Path]:
        """Every file, each once."""
        named = (self.standing, self.standing_forces, *self.walks, *self.forces)
        return list(dict.fromkeys(path for path in named if path is not None))

    def notes(self, walk: Path) -> tuple[str, ...]:
        """What was assumed about the files of a walk."""
        forces = self.forces[self.walks.index(walk)]
        if forces is None or forces not in self.found:
            return ()
        return (f"Forces were taken from {forces.name}, which lies beside {walk.name}.",)


def gather(standing: Path, walks: Sequence[Path], forces: Sequence[Path] = ()) -> FileSet:
    """The files that belong together.

    Args:
        standing: the standing trial; one of `walks` where there is none.
        walks: one or more.
        forces: the walks' force files in the walks' order, or none.

    Raises:
        InputError: a file is missing, a walk is given twice, or there are not as many forces as walks.
    """
    walks = [user_path(path) for path in walks]
    forces = [user_path(path) for path in forces]
    standing = user_path(standing)
    for path in (standing, *walks, *forces):
        if not path.is_file():
            raise InputError("is a folder" if path.is_dir() else "there is no such file", file=path)
    real = [path.resolve() for path in walks]
    for number, path in enumerate(real):
        if path in real[:number]:
            raise InputError("is given twice", file=walks[number], right="Name every walk once")
    if forces and len(forces) != len(walks):
        raise InputError(f"{len(forces)} force files do not fit {len(walks)} walks", where="--forces",
                         right="Repeat --forces once for each walk, in the walks' order")
    beside = [None if forces else beside_of(path) for path in walks]
    alone = standing.resolve() in real
    return FileSet(None if alone else standing, tuple(walks), tuple(forces) if forces else tuple(beside),
                   None if alone else beside_of(standing), tuple(path for path in beside if path is not None))


def beside_of(path: Path) -> Path | None:
    """The force file beside a .trc file, if there is one."""
    if path.suffix.lower() != ".trc":
        return None
    candidates = (path.with_name(name.format(path.stem)) for name in BESIDE)
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def walk_names(walks: Sequence[Path]) -> list[str]:
    """A name for the files made from each walk: its own without suffix, made unique."""
    names: list[str] = []
    for path in walks:
        stem = "".join(c if c.isprintable() else "_" for c in path.stem) or "walk"
        if stem.casefold() in RESERVED:
            stem = f"{stem}_trial"
        name, number = stem, 2
        while name.casefold() in (n.casefold() for n in names):
            name, number = f"{stem}_{number}", number + 1
        names.append(name)
    return names


# Feet of other sizes: each dimension scales on its own.


def scale_foot(
    foot: FootParameters, *, length: float = 1.0, width: float = 1.0, thickness: float = 1.0, height: float = 1.0
) -> FootParameters:
    """`foot` with its dimensions multiplied; material, masses and contact laws stay.

    Args:
        length: keel elements, fulcrum range, load point, sphere x, pylon position, foot length.
        width: keel width, sphere y.
        thickness: keel thickness (stiffness goes with its cube).
        height: build height, foam thickness, rise of the spheres.

    Raises:
        InputError: a ratio is not positive.
    """
    for name, ratio in (("length", length), ("width", width), ("thickness", thickness), ("height", height)):
        if not ratio > 0.0:
            raise InputError(f"{ratio:g} is not a ratio of sizes", where=name, right="It must be positive")
    keel = dataclasses.replace(
        foot.keel, element_lengths_m=_times(foot.keel.element_lengths_m, length), width_m=foot.keel.width_m * width,
        thickness_m=foot.keel.thickness_m * thickness)
    fulcrum = dataclasses.replace(
        foot.fulcrum, rearmost_m=foot.fulcrum.rearmost_m * length, foremost_m=foot.fulcrum.foremost_m * length)

    def scaled(zone: ContactZone) -> ContactZone:
        return dataclasses.replace(zone, x_mm=_times(zone.x_mm, length), y_mm=_times(zone.y_mm, width),
                                   rise_mm=_times(zone.rise_mm, height))

    return dataclasses.replace(
        foot, keel=keel, fulcrum=fulcrum, zones=tuple(scaled(zone) for zone in foot.zones),
        load_point_m=foot.load_point_m * length, length_m=foot.length_m * length, heel_x_m=foot.heel_x_m * length,
        pylon_x_m=foot.pylon_x_m * length,
        series_patch_m=foot.series_patch_m * length, build_height_m=foot.build_height_m * height,
        foam_thickness_m=foot.foam_thickness_m * height)


def _times(values: tuple[float, ...], ratio: float) -> tuple[float, ...]:
    return tuple(value * ratio for value in values)
