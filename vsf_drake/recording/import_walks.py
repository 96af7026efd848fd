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
from vsf_drake.base.schema import check
from vsf_drake.base.sentences import say
from vsf_drake.model.model_file import load_model
from vsf_drake.model.parameters import SHELLS_MM, SIDES, FootParameters, ModelParameters
from vsf_drake.model.setting import moves
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
    model_in_shell,
    trial_from_recordings,
)
from vsf_drake.recording import FITTED_HIP_BW_PER_DEG, Check, checked, expected_error
from vsf_drake.recording.examine import Examined, examine, settings_compared, weighed
from vsf_drake.recording.force_checks import SLIP, ZERO
from vsf_drake.recording.inverse_kinematics import refined
from vsf_drake.recording.motion_checks import SAME_FOOT
from vsf_drake.simulation.fulcrum_place import fulcrum_place
from vsf_drake.walks.metrics import WalkMetrics, walk_metrics
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
RESERVED = ("subject", "standing", "import", "model")  # names that a result folder needs for itself


@dataclass(frozen=True, eq=False)
class ImportedWalks:
    """What came of the files."""

    items: tuple[Examined, ...]  # one per walk that could be used, all of one subject and one model
    names: tuple[str, ...]  # a file name for each
    failures: dict[str, str]  # by file, why it could not be used
    model: ModelParameters | None  # of the foot in its own shell, where one is stated
    foot_length_mm: float | None  # of the shell, as stated
    told: tuple[str, ...]
    """of all walks: what was taken out of them, what a shell of another length changes"""
    inputs: dict[str, str]  # SHA-256 by file


def import_walks(
    files: FileSet, options: ImportOptions, *, progress: Progress | None = None
) -> ImportedWalks:
    """Reads, calibrates, tracks and checks every walk; `progress` is told what is done and the
    finished fraction.

    Of several walks, one that cannot be used is only listed; refused if none can.
    """
    check_facts(check(options).person)
    model = default_model() if options.model is None else load_model(options.model)
    fulcrums_m = _fulcrums(options, model.foot, len(files.walks))
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
            model,
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
    trials = list(made.values())
    shell = _shell_effect(trials, model, options, progress)
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
            notes = tuple(dict.fromkeys((*repeated, *beside, *shell, *trial.notes)))
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
    read = dict.fromkeys(
        (files.standing, files.standing_forces, *files.walks, *files.forces, options.model)
    )
    hashes = {str(path): sha256(path) for path in read if path is not None and path.is_file()}
    return ImportedWalks(
        tuple(settings_compared(items)),
        tuple(names),
        {str(path): str(error) for path, error in failures.items()},
        None if options.model is None else model,
        options.foot_length_mm,
        (*repeated, *shell),
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


def _fulcrums(options: ImportOptions, foot: FootParameters, walks: int) -> tuple[float, ...]:
    stated = options.fulcrum_mm
    require(
        stated or not moves(foot),
        "must be stated, no recording tells it",
        "fulcrum_mm (--fulcrum-mm)",
        "Give where the fulcrum stood, in mm from the keel's posterior end, 66 (soft) to 151 "
        "(stiff), or the forefoot's stiffness there, such as 16N/mm",
    )
    require(
        len(stated) in (0, 1, walks),
        f"{len(stated)} positions are given for {walks} walks",
        "--fulcrum-mm",
        "Give one for all walks, or one for each in their order",
    )
    said = stated if len(stated) == walks else (stated or (None,)) * walks
    return tuple(fulcrum_place(each, foot, where="--fulcrum-mm") for each in said)


def _shell_effect(
    trials: Sequence[Trial],
    model: ModelParameters,
    options: ImportOptions,
    progress: Progress | None,
) -> list[str]:
    """What the stated shell changes of the first walk's errors, the offsets fitted to its plate
    each time; of nothing stated, what one as long as the recorded foot would. None where that is
    as long as the model's, or is not known."""
    calibration = trials[0].calibration if trials else None
    if calibration is None:
        return []
    own_mm = 1e3 * model.foot.length_m
    stated_mm = options.foot_length_mm
    if stated_mm is None:
        length_mm = 1e3 * calibration.lengths_m[f"foot_{trials[0].subject.prosthetic_side}"]
        same_mm = SAME_FOOT * own_mm
    else:
        length_mm = stated_mm
        same_mm = 0.0
    if abs(length_mm - own_mm) <= same_mm or not SHELLS_MM[0] <= length_mm <= SHELLS_MM[1]:
        return []
    if progress:
        progress(f"walking in a shell of {length_mm:.0f} mm", 0.9)
    try:
        errors = [
            walk_metrics(walk_trial(each, with_fit=True, step_s=STEP_S)[0], each.prosthetic_plate)
            for each in (
                dataclasses.replace(trials[0], model=of)
                for of in (model, model_in_shell(model, length_mm)[0])
            )
        ]
    except VsfError as error:
        return say("import", "shell_unknown", length_mm=length_mm, error=error)
    return say(
        "import",
        "shell",
        walk=trials[0].path.name,
        errors=errors,
        length_mm=length_mm,
        stated=stated_mm is not None,
        helps=nearer(*errors),
    )


def nearer(one: WalkMetrics, other: WalkMetrics) -> bool:
    """Whether `other` has the resultant force nearer to the plate than `one`, and the centre of
    pressure (m, fore-aft) no farther."""
    if one.error_bw is None or other.error_bw is None:
        return False
    if one.cop_rmse_fl is None or other.cop_rmse_fl is None:
        return False
    cop_m = one.foot_length_m * one.cop_rmse_fl
    return other.error_bw < one.error_bw and other.foot_length_m * other.cop_rmse_fl <= cop_m


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
    own: ModelParameters,
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
    model, shell_notes = model_in_shell(own, options.foot_length_mm)
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
            model=model,
        )
        require(
            trial.plate is not None,
            f"no plate carries the {trial.subject.prosthetic_side} (prosthetic) foot alone",
            "forces",
            " ".join(note for note in trial.notes if note.startswith("Plate"))
            + " A manifest with `markers` takes it as a walk without plates",
            file=forces or walk,
        )
        trial = _noted(trial, shell_notes)
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
