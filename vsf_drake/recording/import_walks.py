"""A laboratory's recordings of one person to trials that drive the model, with an account of how
good each is."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsf_drake.base.errors import InputError, VsfError, require
from vsf_drake.base.files import opened, sha256, user_path
from vsf_drake.base.progress import Progress
from vsf_drake.base.sentences import say
from vsf_drake.model.model_file import check_foot, check_fulcrum
from vsf_drake.model.parameters import SIDES, FootParameters
from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.import_options import ImportOptions
from vsf_drake.motion.markers.maps import MarkerMap, load_marker_map
from vsf_drake.motion.markers.person_facts import PersonFacts, check_facts, with_files
from vsf_drake.motion.markers.posture import MID_FULCRUM_M
from vsf_drake.motion.markers.segments import Calibration
from vsf_drake.motion.trial import (
    PLACEHOLDER_KG,
    Trial,
    check_mass,
    default_model,
    trial_from_recordings,
)
from vsf_drake.recording import FITTED_HIP_BW_PER_DEG, Check, checked, expected_error
from vsf_drake.recording.examine import Examined, examine, settings_compared, weighed
from vsf_drake.recording.force_checks import SLIP, ZERO
from vsf_drake.recording.inverse_kinematics import refined
from vsf_drake.recording.motion_checks import SAME_FOOT, SHELL_M
from vsf_drake.walks.metrics import walk_metrics
from vsf_drake.walks.recorded_walk import STEP_S, walk_trial

CLEARLY_BW = 0.01
"""By so much (body weights) less the misfit must be with the prosthesis on the other side to say so
(a choice: a third of what still counts as good)."""
INTACT_SLIP_BW_PER_M_PER_S = 0.3
"""Weight of the intact foot's slip in that misfit (a choice: half of what the prosthetic foot's
does to the force)."""
WEIGHED = 0.02  # error of a body mass that the plates tell (`mass_from_walk`: one or two percent)
BESIDE = ("{}.mot", "{}_grf.mot", "{}.sto", "{}_grf.sto", "{}.csv", "{}_grf.csv", "{}.forces")
"""Names of a force file beside `walk.trc`, the first that exists counts; {} is the walk's name
without suffix."""
# of the time of an import with inverse kinematics, what goes before that (for the progress bar)
TRACKED_SHARE = 0.2
RESERVED = ("subject", "model", "standing", "import")  # names that a result folder needs for itself


@dataclass(frozen=True, eq=False)
class ImportedWalks:
    """What came of the files."""

    items: tuple[Examined, ...]  # one per walk that could be used, all of one subject and one model
    names: tuple[str, ...]  # a file name for each
    failures: dict[str, str]  # by file, why it could not be used
    scaled: bool  # whether `items` have a model of their own
    told: tuple[str, ...]
    """of all walks: what was taken out of them, what --scale-prosthesis changes"""
    inputs: dict[str, str]  # SHA-256 by file


def import_walks(
    files: FileSet, options: ImportOptions, *, progress: Progress | None = None
) -> ImportedWalks:
    """Reads, calibrates, tracks and checks every walk; `progress` is told what is done and the
    finished fraction.

    Of several walks, one that cannot be used is only listed; refused if none can.
    """
    check_facts(options.person)
    fulcrums_m = _fulcrums(options, len(files.walks))
    marker_map = None if options.marker_map is None else load_marker_map(options.marker_map)
    standing = None
    if files.standing is not None:
        standing = read_trial(files.standing, forces=files.standing_forces, **options.laboratory)
    made: dict[Path, Trial] = {}
    failures: dict[Path, InputError] = {}

    def make(walk: Path, person: PersonFacts) -> Trial:
        own = (
            next(
                (
                    trial.calibration
                    for trial in made.values()
                    if trial.subject.prosthetic_side == person.prosthetic_side
                ),
                None,
            )
            if standing is None
            else None
        )
        return _make_trial(
            files,
            files.walks.index(walk),
            standing,
            marker_map,
            dataclasses.replace(options, person=person),
            fulcrums_m,
            own,
        )

    for number, walk in enumerate(files.walks):
        if progress:
            share = TRACKED_SHARE if options.inverse_kinematics else 1.0
            progress(f"importing {walk.name}", share * number / len(files.walks))
        try:
            made[walk] = make(walk, options.person)
        except InputError as error:
            failures[walk] = error
    masses = [trial.subject.mass_kg for trial in made.values()]
    if len(set(masses)) > 1:  # one person weighs one mass
        mass = float(np.median(masses))
        one = dataclasses.replace(options.person, mass_kg=mass)
        note = say("import", "median_mass", mass_kg=mass, masses=masses)
        made = {walk: _noted(make(walk, one), note) for walk in made}
    other_side = _other_side(make, made, options.person)
    if options.inverse_kinematics:
        made = _all_refined(made, failures, options, progress)
    trials, model_notes, scaling = _one_model(list(made.values()), options, progress)
    repeated = (
        say("import", "standing_named_twice", file=files.repeated.name) if files.repeated else []
    )
    items = []
    names = []
    for trial, walk, name in zip(trials, made, walk_names(list(made)), strict=True):
        person = with_files(options.person, standing, trials[0].recording)[0]
        forces = files.forces[files.walks.index(walk)]
        beside = (
            say("import", "forces_beside", forces=forces.name, walk=walk.name)
            if forces in files.beside
            else []
        )
        try:
            check_mass(trial, file=walk)
            notes = tuple(dict.fromkeys((*repeated, *beside, *model_notes, *scaling, *trial.notes)))
            told = dataclasses.replace(trial, notes=notes, synthetic=options.synthetic)
            items.append(
                examine(told, stated=[*_statements(trials[0], standing, person), *other_side])
            )
            names.append(name)
        except InputError as error:
            failures[walk] = error
    if not items:
        different = {str(error): error for error in failures.values()}
        if len(different) == 1:
            raise next(iter(different.values()))
        raise InputError(
            "none of the walks can be used:\n" + "\n".join(f"- {message}" for message in different)
        )
    read = dict.fromkeys((files.standing, files.standing_forces, *files.walks, *files.forces))
    hashes = {str(path): sha256(path) for path in read if path is not None and path.is_file()}
    return ImportedWalks(
        tuple(settings_compared(items)),
        tuple(names),
        {str(path): str(error) for path, error in failures.items()},
        options.scale_prosthesis,
        (*repeated, *scaling),
        hashes,
    )


def _all_refined(
    made: Mapping[Path, Trial],
    failures: dict[Path, InputError],
    options: ImportOptions,
    progress: Progress | None,
) -> dict[Path, Trial]:
    """The walks after a global inverse kinematics; those that it cannot solve are put among the
    failures."""
    solved: dict[Path, Trial] = {}
    for number, (walk, trial) in enumerate(made.items()):
        if progress:
            progress(
                f"inverse kinematics of {walk.name}",
                TRACKED_SHARE + (1.0 - TRACKED_SHARE) * number / len(made),
            )
        try:
            solved[walk] = refined(
                trial, cutoff_hz=options.cutoff_hz, longest_gap_s=options.longest_gap_s
            )
        except InputError as error:
            failures[walk] = error
    return solved


def _fulcrums(options: ImportOptions, walks: int) -> tuple[float, ...]:
    stated = options.fulcrum_mm
    require(
        stated,
        "must be stated, no recording tells it",
        "fulcrum_mm (--fulcrum-mm)",
        "Give where the fulcrum stood, in mm from the keel's posterior end, 66 (soft) to 151 "
        "(stiff)",
    )
    require(
        len(stated) in (1, walks),
        f"{len(stated)} positions are given for {walks} walks",
        "--fulcrum-mm",
        "Give one for all walks, or one for each in their order",
    )
    foot = default_model().foot
    return tuple(
        check_fulcrum(1e-3 * position, foot, where="--fulcrum-mm")
        for position in (stated if len(stated) == walks else stated * walks)
    )


def _one_model(
    trials: list[Trial], options: ImportOptions, progress: Progress | None
) -> tuple[list[Trial], list[str], list[str]]:
    """The trials with the model that they share, notes on it, and what scaling the foot changes
    where it matters."""
    calibration = trials[0].calibration if trials else None
    if calibration is None:
        return trials, [], []
    own = trials[0].model.foot.length_m
    length = calibration.lengths_m[f"foot_{trials[0].subject.prosthetic_side}"]
    effect: list[str] = []
    works = SHELL_M[0] <= length <= SHELL_M[1]
    if options.scale_prosthesis:
        require(
            works,
            f"the recorded foot is {1e3 * length:.0f} mm long; shells of {1e3 * SHELL_M[0]:.0f} to "
            f"{1e3 * SHELL_M[1]:.0f} mm are made from the model's",
            "--scale-prosthesis",
            "Leave it out, and name a model of that length in the manifests (model)",
        )
    if works and abs(length / own - 1.0) > SAME_FOOT:
        if progress:
            progress("walking with a foot as long as the recorded one", 0.9)
        effect = _scaling_effect(trials[0], length / own, options)
    if not options.scale_prosthesis:
        return trials, [], effect
    scaled = [_scaled(trial, length / own) for trial in trials]
    return (
        scaled,
        say(
            "import",
            "scaled",
            length_m=length,
            ratio=length / own,
            keel_m=sum(scaled[0].model.foot.keel.element_lengths_m),
            tip_m=scaled[0].model.foot.heel_x_m + length,
        ),
        effect,
    )


def _scaled(trial: Trial, ratio: float) -> Trial:
    """The same device in a shell `ratio` times as long."""
    return dataclasses.replace(
        trial,
        model=dataclasses.replace(
            trial.model, foot=check_foot(scale_shell(trial.model.foot, ratio))
        ),
    )


def _other_side(
    make: Callable[[Path, PersonFacts], Trial], made: Mapping[Path, Trial], person: PersonFacts
) -> list[Check]:
    """A doubt of the stated side, where the recordings that bear both fit the model clearly better
    on average with the prosthesis on the other one: of a single walk that may be chance. None where
    that side can be tried on none."""
    errors_bw = []
    for walk, trial in made.items():
        [other] = [side for side in SIDES if side != trial.subject.prosthetic_side]
        try:
            swapped = make(
                walk,
                dataclasses.replace(person, prosthetic_side=other, mass_kg=trial.subject.mass_kg),
            )
        except InputError:
            continue
        errors_bw.append([_misfit_bw(examine(each)) for each in (trial, swapped)])
    if not errors_bw:
        return []
    as_stated_bw, swapped_bw = np.mean(errors_bw, axis=0).tolist()
    if as_stated_bw - swapped_bw < CLEARLY_BW:
        return []
    return [
        checked(
            "other_side",
            "side of the prosthesis",
            "doubtful",
            as_stated_bw - swapped_bw,
            "1",
            needed=True,
            stated=trial.subject.prosthetic_side,
            other=other,
            errors_bw=(as_stated_bw, swapped_bw),
        )
    ]


def _misfit_bw(item: Examined) -> float:
    """The expected error with what slips under the intact foot, which a stiff ankle taken for a
    moving one, and the other way round, shows, and without the plates' zeros, which tell no side
    (body weights)."""
    slips = [
        check.value
        for check in item.checks
        if check.name == SLIP and check.side != item.trial.subject.prosthetic_side and check.value
    ]
    error_bw = expected_error(check for check in item.checks if not check.name.startswith(ZERO))
    return math.hypot(error_bw, INTACT_SLIP_BW_PER_M_PER_S * max(slips, default=0.0))


def _scaling_effect(trial: Trial, ratio: float, options: ImportOptions) -> list[str]:
    """What a foot `ratio` times as long changes of a walk's errors, the offsets fitted to its plate
    each time."""
    try:
        pair = trial, _scaled(trial, ratio)
        errors = [
            walk_metrics(walk_trial(each, with_fit=True, step_s=STEP_S)[0], each.prosthetic_plate)
            for each in pair
        ]
    except VsfError as error:
        return say("import", "scaling_unknown", error=error)
    return say(
        "import", "scaling", walk=trial.path.name, errors=errors, scaled=options.scale_prosthesis
    )


def scale_shell(foot: FootParameters, ratio: float) -> FootParameters:
    """`foot` with a shell `ratio` times as long about A: its ends, its contact points, and what it
    weighs beside keel and carriage (a choice). The device has one size: keel, fulcrum, reach, load
    point, pylon and all laws stay."""
    keel = foot.keel
    device_kg = (
        sum(keel.element_lengths_m) * keel.width_m * keel.thickness_m * keel.density_kg_m3
        + foot.fulcrum.carriage_mass_kg
    )
    zones = tuple(
        dataclasses.replace(zone, x_mm=tuple(ratio * x for x in zone.x_mm)) for zone in foot.zones
    )
    return dataclasses.replace(
        foot,
        zones=zones,
        length_m=ratio * foot.length_m,
        heel_x_m=ratio * foot.heel_x_m,
        mass_kg=device_kg + ratio * (foot.mass_kg - device_kg),
    )


def _statements(trial: Trial, standing: Recording | None, person: PersonFacts) -> list[Check]:
    subject = trial.subject
    rows = (
        (person.mass_kg is None, "mass", "body mass", subject.mass_kg, "kg", WEIGHED),
        (person.stature_m is None, "stature", "stature", subject.stature_m, "m", None),
        (standing is None, "standing", "standing trial", None, "", 2 * FITTED_HIP_BW_PER_DEG),
    )
    return [
        Check(name, "doubtful", value, unit, say("import", part, subject=subject)[0], cost_bw=cost)
        for unknown, part, name, value, unit, cost in rows
        if unknown
    ]


def _make_trial(
    files: FileSet,
    number: int,
    standing: Recording | None,
    marker_map: MarkerMap | None,
    options: ImportOptions,
    fulcrums_m: Sequence[float],
    calibration: Calibration | None,
) -> Trial:
    walk = files.walks[number]
    forces = files.forces[number]
    recording = read_trial(walk, forces=forces, **options.laboratory)
    require(
        recording.plates,
        "has no force plates, and no force file lies beside it",
        "--forces",
        " ".join(note for note in recording.notes if note.startswith("Force plate"))
        or "Name the walk's force file (.mot, .sto, .csv or .forces). Where nobody measured "
        "forces, write a manifest with `markers` and without `forces`",
        file=walk,
    )
    used = [
        path for path in (walk, forces, files.standing, files.standing_forces) if path is not None
    ]

    def make(person: PersonFacts) -> Trial:
        trial = trial_from_recordings(
            standing,
            recording,
            marker_map,
            person,
            options,
            fulcrum_m=fulcrums_m[number],
            calibration=calibration,
            standing_fulcrum_m=None if len(set(fulcrums_m)) == 1 else MID_FULCRUM_M,
        )
        require(
            trial.plate is not None,
            f"no plate carries the {trial.subject.prosthetic_side} (prosthetic) foot alone",
            "forces",
            " ".join(note for note in trial.notes if note.startswith("Plate"))
            + " A manifest with `markers` takes it as a walk without plates",
            file=forces or walk,
        )
        return dataclasses.replace(trial, inputs={path.name: sha256(path) for path in used})

    try:
        trial = make(options.person)
    except InputError as error:
        if options.person.mass_kg is not None or not (error.where or "").startswith("mass_kg"):
            raise
        felt = weighed(make(dataclasses.replace(options.person, mass_kg=PLACEHOLDER_KG)))
        if felt.value is None:
            raise error from None
        trial = _noted(
            make(dataclasses.replace(options.person, mass_kg=felt.value)),
            say("import", "impulse_mass", mass_kg=felt.value),
        )
    return trial


def _noted(trial: Trial, notes: list[str]) -> Trial:
    return dataclasses.replace(trial, notes=(*trial.notes, *notes))


# Which files belong together: the standing trial, the walks, their forces; and what their results
# are called.


@dataclass(frozen=True)
class FileSet:
    """The files of one person."""

    standing: Path | None  # None where a walk stands for it
    walks: tuple[Path, ...]
    forces: tuple[Path | None, ...]  # one for each walk; None where it has its forces in itself
    standing_forces: Path | None = None  # where they are in a file of their own
    beside: tuple[Path, ...] = ()
    """the force files that nobody named but that lie beside their walk"""
    repeated: Path | None = None
    """the standing trial, where it was named among the walks, too, and taken out of them"""


def gather(standing: Path | None, walks: Sequence[Path], forces: Sequence[Path] = ()) -> FileSet:
    """The files that belong together: without a standing trial (None) the walks calibrate
    themselves; `forces` are the walks' force files in their order, or none. A standing trial among
    the walks, as a shell's *.c3d names it, is taken out of them."""
    standing = None if standing is None else user_path(standing)
    walks = [user_path(p) for p in walks]
    forces = [user_path(p) for p in forces]
    for path in (*([] if standing is None else [standing]), *walks, *forces):
        with opened(path):
            pass
    every = len(walks)
    walks = [path for path in walks if standing is None or path.resolve() != standing.resolve()]
    require(
        walks,
        "the standing trial is the only file",
        "STATIC WALK...",
        "Name a walk after it; a walk without a standing trial is calibrated from itself "
        "with --no-standing",
        file=standing,
    )
    real = [path.resolve() for path in walks]
    for number, path in enumerate(real):
        require(
            path not in real[:number],
            "is given twice",
            right="Name every walk once",
            file=walks[number],
        )
    require(
        not forces or len(forces) == len(walks),
        f"{len(forces)} force files do not fit {len(walks)} walks",
        "--forces",
        "Repeat --forces once for each walk, in the walks' order",
    )
    beside = [None if forces else forces_beside(path) for path in walks]
    return FileSet(
        standing,
        tuple(walks),
        tuple(forces or beside),
        None if standing is None else forces_beside(standing),
        tuple(path for path in beside if path is not None),
        standing if len(walks) < every else None,
    )


def forces_beside(path: Path) -> Path | None:
    """The force file of like name beside a .trc, if there is one."""
    names = BESIDE if path.suffix.lower() == ".trc" else ()
    return next(
        (force for name in names if (force := path.with_name(name.format(path.stem))).is_file()),
        None,
    )


def walk_names(walks: Sequence[Path]) -> list[str]:
    """A name for the files made from each walk: its own without suffix, made unique."""
    names: list[str] = []
    for path in walks:
        stem = "".join(c if c.isprintable() else "_" for c in path.stem) or "walk"
        if stem.casefold() in RESERVED:
            stem = f"{stem}_trial"
        name = stem
        number = 2
        while name.casefold() in (n.casefold() for n in names):
            name = f"{stem}_{number}"
            number = number + 1
        names.append(name)
    return names
