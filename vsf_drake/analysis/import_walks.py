"""A laboratory's recordings of one person to trials that drive the model, with an account of how good each is."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vsf_drake.analysis.inverse_kinematics import refined
from vsf_drake.analysis.metrics import walk_metrics
from vsf_drake.analysis.recording import FITTED_HIP_BW_PER_DEG, Check
from vsf_drake.analysis.recording.examine import Examined, examine, weighed
from vsf_drake.analysis.recording.motion_checks import SAME_FOOT
from vsf_drake.analysis.validation.study import STEP_S, walk_trial
from vsf_drake.errors import InputError, VsfError
from vsf_drake.files import sha256, user_path
from vsf_drake.model_file import check_fulcrum
from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.markers.maps import MarkerMap, load_marker_map
from vsf_drake.motion.markers.person_facts import PersonFacts, check_facts, with_files
from vsf_drake.motion.markers.posture import MID_FULCRUM_M
from vsf_drake.motion.markers.segments import Calibration
from vsf_drake.motion.trial import (
    PLACEHOLDER_KG,
    Trial,
    TrialOptions,
    check_mass,
    default_model,
    trial_from_recordings,
)
from vsf_drake.parameters import FootParameters
from vsf_drake.sentences import say

WEIGHED = 0.02  # error of a body mass that the plates tell (`mass_from_walk`: one or two percent)
BESIDE = ("{}.mot", "{}_grf.mot", "{}.sto", "{}_grf.sto", "{}.csv", "{}_grf.csv", "{}.forces")
"""Names of a force file beside `walk.trc`, the first that exists counts; {} is the walk's name without suffix."""
AROUND_STANCES_S = 0.3
"""What a walk keeps before and after its stances on plates: the 0.25 s that are scored, and a little to settle in."""
RESERVED = ("subject", "model", "standing", "import")  # names that a result folder needs for itself


@dataclass(frozen=True, kw_only=True)
class ImportOptions(TrialOptions):
    """How to read and what is known beside the files."""

    person: PersonFacts
    marker_map: str | None = (
        None  # a shipped map's name or a file; None: the one that fits the labels best
    )
    fulcrum_mm: tuple[
        float, ...
    ] = ()  # one for all walks, or one for each in their order; none: mid-range
    laboratory: Mapping[str, str | None] = field(
        default_factory=dict
    )  # up, forward, length_unit, as for `read_trial`
    scale_prosthesis: bool = (
        False  # whether the model's prosthetic foot becomes as long as the person's
    )
    inverse_kinematics: bool = False  # whether the angles are those of a global inverse kinematics
    around_stances_s: float | None = AROUND_STANCES_S
    synthetic: bool = False  # nobody walked


@dataclass(frozen=True, eq=False)
class ImportedWalks:
    """What came of the files."""

    items: tuple[Examined, ...]  # one per walk that could be used, all of one subject and one model
    names: tuple[str, ...]  # a file name for each
    failures: dict[str, str]  # by file, why it could not be used
    scaled: bool  # whether `items` have a model of their own
    scaling: tuple[
        str, ...
    ]  # what --scale-prosthesis changes, in a sentence, where the foot's lengths differ
    inputs: dict[str, str]  # SHA-256 by file


def import_walks(
    files: FileSet, options: ImportOptions, *, progress: Callable[[str, float], None] | None = None
) -> ImportedWalks:
    """Reads, calibrates, tracks and checks every walk; `progress` is told what is done and the finished fraction.

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
            next((trial.calibration for trial in made.values()), None) if standing is None else None
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
            progress(f"importing {walk.name}", number / len(files.walks))
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
    trials, model_notes, scaling = _one_model(list(made.values()), options, progress)
    items, names = [], []
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
            notes = tuple(dict.fromkeys((*beside, *model_notes, *scaling, *trial.notes)))
            told = dataclasses.replace(trial, notes=notes, synthetic=options.synthetic)
            items.append(
                examine(
                    told,
                    cutoff_hz=options.cutoff_hz,
                    stated=_statements(trials[0], standing, person),
                    belt_speed_m_per_s=options.belt_speed_m_per_s,
                )
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
        tuple(items),
        tuple(names),
        {str(path): str(error) for path, error in failures.items()},
        options.scale_prosthesis,
        tuple(scaling),
        hashes,
    )


def _fulcrums(options: ImportOptions, walks: int) -> tuple[float, ...]:
    stated = options.fulcrum_mm or (1e3 * MID_FULCRUM_M,)
    if len(stated) not in (1, walks):
        raise InputError(
            f"{len(stated)} positions are given for {walks} walks",
            where="--fulcrum-mm",
            right="Give one for all walks, or one for each in their order",
        )
    foot = default_model().foot
    return tuple(
        check_fulcrum(1e-3 * position, foot, where="--fulcrum-mm")
        for position in (stated if len(stated) == walks else stated * walks)
    )


def _one_model(
    trials: list[Trial], options: ImportOptions, progress: Callable[[str, float], None] | None
) -> tuple[list[Trial], list[str], list[str]]:
    """The trials with the model that they share, notes on it, and what scaling the foot changes where it matters."""
    notes = [] if options.fulcrum_mm else say("import", "mid_range", fulcrum_m=MID_FULCRUM_M)
    calibration = trials[0].calibration if trials else None
    if calibration is None:
        return trials, notes, []
    own = trials[0].model.foot.length_m
    length = calibration.lengths_m[f"foot_{trials[0].subject.prosthetic_side}"]
    effect: list[str] = []
    if abs(length / own - 1.0) > SAME_FOOT:
        if progress:
            progress("walking with a foot as long as the recorded one", 0.9)
        effect = _scaling_effect(trials[0], length / own, options)
    if not options.scale_prosthesis:
        return trials, notes, effect
    scaled = [_scaled(trial, length / own, options) for trial in trials]
    return scaled, notes + say("import", "scaled", length_m=length, ratio=length / own), effect


def _scaled(trial: Trial, ratio: float, options: ImportOptions) -> Trial:
    """With a foot `ratio` times as long, and its keel as much thicker: as stiff with the fulcrum at the same part (a
    choice)."""
    model = dataclasses.replace(
        trial.model, foot=scale_foot(trial.model.foot, length=ratio, thickness=ratio)
    )
    return dataclasses.replace(
        trial,
        model=model,
        fulcrum_m=check_fulcrum(
            trial.fulcrum_m * (1.0 if options.fulcrum_mm else ratio),
            model.foot,
            where="--fulcrum-mm",
        ),
    )


def _scaling_effect(trial: Trial, ratio: float, options: ImportOptions) -> list[str]:
    """What a foot `ratio` times as long changes of a walk's errors, the offsets fitted to its plate each time."""
    try:
        pair = trial, _scaled(trial, ratio, options)
        errors = [
            walk_metrics(
                walk_trial(each, with_fit=True, step_s=STEP_S).result, each.prosthetic_plate
            )
            for each in pair
        ]
    except VsfError as error:
        return say("import", "scaling_unknown", error=error)
    return say(
        "import", "scaling", walk=trial.path.name, errors=errors, scaled=options.scale_prosthesis
    )


def scale_foot(
    foot: FootParameters, *, length: float = 1.0, thickness: float = 1.0
) -> FootParameters:
    """`foot` with its dimensions along the keel and the keel's thickness multiplied; material and laws stay."""

    def times(values: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(value * length for value in values)

    keel = dataclasses.replace(
        foot.keel,
        element_lengths_m=times(foot.keel.element_lengths_m),
        thickness_m=foot.keel.thickness_m * thickness,
    )
    fulcrum = dataclasses.replace(
        foot.fulcrum,
        rearmost_m=foot.fulcrum.rearmost_m * length,
        foremost_m=foot.fulcrum.foremost_m * length,
    )
    along = ("load_point_m", "length_m", "heel_x_m", "pylon_x_m", "series_patch_m")
    return dataclasses.replace(
        foot,
        keel=keel,
        fulcrum=fulcrum,
        zones=tuple(dataclasses.replace(z, x_mm=times(z.x_mm)) for z in foot.zones),
        **{name: getattr(foot, name) * length for name in along},
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
    walk, forces = files.walks[number], files.forces[number]
    recording = read_trial(walk, forces=forces, **options.laboratory)
    if not recording.plates:
        raise InputError(
            "has no force plates, and no force file lies beside it",
            file=walk,
            where="--forces",
            right="Name the walk's force file (.mot, .sto, .csv or .forces)",
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
        return dataclasses.replace(trial, inputs={path.name: sha256(path) for path in used})

    try:
        trial = make(options.person)
    except InputError as error:
        if options.person.mass_kg is not None or not (error.where or "").startswith("mass_kg"):
            raise
        felt = weighed(
            make(dataclasses.replace(options.person, mass_kg=PLACEHOLDER_KG)),
            belt_speed_m_per_s=options.belt_speed_m_per_s,
        )
        if felt.value is None:
            raise error from None
        trial = _noted(
            make(dataclasses.replace(options.person, mass_kg=felt.value)),
            say("import", "impulse_mass", mass_kg=felt.value),
        )
    if not options.inverse_kinematics:
        return trial
    return refined(trial, cutoff_hz=options.cutoff_hz, longest_gap_s=options.longest_gap_s)


def _noted(trial: Trial, notes: list[str]) -> Trial:
    return dataclasses.replace(trial, notes=(*trial.notes, *notes))


# Which files belong together: the standing trial, the walks, their forces; and what their results are called.


@dataclass(frozen=True)
class FileSet:
    """The files of one person."""

    standing: Path | None  # None where a walk stands for it
    walks: tuple[Path, ...]
    forces: tuple[Path | None, ...]  # one for each walk; None where it has its forces in itself
    standing_forces: Path | None = None  # where they are in a file of their own
    beside: tuple[
        Path, ...
    ] = ()  # the force files that nobody named but that lie beside their walk


def gather(standing: Path, walks: Sequence[Path], forces: Sequence[Path] = ()) -> FileSet:
    """The files that belong together: `standing` is one of `walks` where there is no standing trial; `forces` are the
    walks' force files in their order, or none."""
    standing, walks, forces = (
        user_path(standing),
        [user_path(p) for p in walks],
        [user_path(p) for p in forces],
    )
    for path in (standing, *walks, *forces):
        if not path.is_file():
            raise InputError("is a folder" if path.is_dir() else "there is no such file", file=path)
    real = [path.resolve() for path in walks]
    for number, path in enumerate(real):
        if path in real[:number]:
            raise InputError("is given twice", file=walks[number], right="Name every walk once")
    if forces and len(forces) != len(walks):
        raise InputError(
            f"{len(forces)} force files do not fit {len(walks)} walks",
            where="--forces",
            right="Repeat --forces once for each walk, in the walks' order",
        )
    beside = [None if forces else _beside(path) for path in walks]
    alone = standing.resolve() in real
    return FileSet(
        None if alone else standing,
        tuple(walks),
        tuple(forces or beside),
        None if alone else _beside(standing),
        tuple(path for path in beside if path is not None),
    )


def _beside(path: Path) -> Path | None:
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
        name, number = stem, 2
        while name.casefold() in (n.casefold() for n in names):
            name, number = f"{stem}_{number}", number + 1
        names.append(name)
    return names
