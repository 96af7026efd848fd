"""A trial: everything that a manifest leads to, read, checked and brought to the model's frames and units."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from vsf_drake.errors import InputError
from vsf_drake.files import sha256
from vsf_drake.model_file import check_fulcrum, load_model
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.kinematics import read_kinematics
from vsf_drake.motion.manifest import (
    ForceColumns,
    GeometricOffsets,
    Manifest,
    load_manifest,
    named_file,
    to_si,
)
from vsf_drake.motion.plates import PlateRecording, assign_prefixes, read_plate
from vsf_drake.motion.storage import read_storage
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.treadmill import on_the_belt
from vsf_drake.motion.window import (
    Span,
    check_stances,
    choose_window,
    describe_scuffs,
    describe_stances,
    describe_treadmill,
)
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.resources import resource
from vsf_drake.schema import load_yaml


@dataclass(frozen=True, eq=False)
class Trial:
    """One recording of somebody walking, ready to drive the model. SI and radians.

    Attributes:
        path: the manifest.
        name: the manifest's `name`, or its file name without suffix.
        subject: the person.
        synthetic: whether the recording was constructed rather than measured.
        fulcrum_m: where the fulcrum stood, from the keel's posterior end A.
        start_s, end_s: the window: kinematics, forces and the manifest's wish all cover it.
        trajectory: the person's coordinates (see `motion.kinematics`), over the whole recording.
        plates: the force on each foot by "left" and "right", over the whole recording, in the world frame
            (x forward, y left, z up); the prosthetic side is always there, the other may be missing.
        notes: sentences on what was assumed, filled, turned or cut.
        model: the device's and the contact's parameters.
        inputs: SHA-256 of every file read, by its path as the manifest writes it.
        offsets: how the prosthesis sits under the person.
    """

    path: Path
    name: str
    subject: Subject
    synthetic: bool
    fulcrum_m: float
    start_s: float
    end_s: float
    trajectory: CoordinateTrajectory
    plates: dict[str, PlateRecording]
    notes: tuple[str, ...]
    model: ModelParameters
    inputs: dict[str, str]
    offsets: GeometricOffsets = GeometricOffsets()  # noqa: RUF009 (frozen: one default can serve all)

    @property
    def prosthetic_plate(self) -> PlateRecording:
        return self.plates[self.subject.prosthetic_side]


def default_model() -> ModelParameters:
    """The model of a manifest that names none: models/nominal.yaml, calibrated to the published bench end points."""
    return load_model(resource("models/nominal.yaml"))


def load_trial(path: str | Path) -> Trial:
    """Reads a trial manifest and every file it names.

    Files are in OpenSim's laboratory frame (x forward, y up, z right), in m, N, N m and the angle unit that their
    header states. Forces come back in the world frame W (x forward, y left, z up, ground z = 0); coordinates keep
    OpenSim's names and, for the pelvis, OpenSim's axes; angles are in rad, knee flexion positive.
    Recordings are not filtered.

    Args:
        path: the manifest, see `vsf_drake.motion.manifest` for its keys. Paths in it are relative to its folder.

    Returns:
        The trial. Read its `notes`: they say what was assumed.

    Raises:
        InputError: with a message that names file, and key, column, line or time:
            - a file is missing or is not what its key needs; markers are given instead of joint angles;
            - a key is unknown, doubled or missing; a value has the wrong type or is out of range; the fulcrum is
              out of the carriage's reach;
            - a table is truncated, has a doubled label or no `endheader`, or lacks a required column;
            - a needed cell is blank, NaN or no number; time does not increase or has a gap; too few rows;
            - angles cannot be in the unit stated, or no unit is stated; a pelvis position is not believable;
            - the column names do not tell which force is which foot; the prosthetic foot has no force;
            - a force points down or sideways, or is far from the body weight;
            - window, kinematics and forces do not overlap; the trial is shorter than one stance; the prosthetic
              foot carries no load in it.
    """
    path = Path(path)
    manifest = load_manifest(path)
    named = _named_files(path, manifest)
    subject = load_yaml(named["subject"], Subject)
    model = load_model(named["model"]) if "model" in named else default_model()
    fulcrum_m = check_fulcrum(1e-3 * manifest.prosthesis.fulcrum_mm, model.foot, file=path,
                              where="prosthesis.fulcrum_mm")
    storage = read_storage(named["kinematics"])
    trajectory, notes = read_kinematics(storage, prosthetic_side=subject.prosthetic_side, unit=manifest.kinematics_unit)
    plates, plate_notes = _read_plates(path, manifest, named["forces"], subject)
    speed = manifest.belt_speed_m_per_s
    trajectory, plates, belt_notes = on_the_belt(trajectory, plates, speed_m_per_s=speed)
    window, window_notes = _window(path, manifest, trajectory, plates, subject)
    written = {"subject": manifest.subject, "kinematics": str(manifest.kinematics),
               "forces": _force_file(manifest), "model": str(manifest.model)}
    inputs = {path.name: sha256(path)} | {written[key]: sha256(file) for key, file in named.items()}
    return Trial(path=path, name=manifest.name or path.stem, subject=subject, synthetic=manifest.synthetic,
                 fulcrum_m=fulcrum_m, start_s=window[0], end_s=window[1], trajectory=trajectory, plates=plates,
                 notes=notes + plate_notes + belt_notes + window_notes, model=model, inputs=inputs,
                 offsets=to_si(manifest.offsets))


def _force_file(manifest: Manifest) -> str:
    return manifest.forces.file if isinstance(manifest.forces, ForceColumns) else manifest.forces


def _named_files(path: Path, manifest: Manifest) -> dict[str, Path]:
    named = {"subject": named_file(path, "subject", manifest.subject),
             "kinematics": named_file(path, "kinematics", str(manifest.kinematics)),
             "forces": named_file(path, "forces", _force_file(manifest))}
    if manifest.model is not None:
        named["model"] = named_file(path, "model", manifest.model)
    return named


def _read_plates(path: Path, manifest: Manifest, file: Path,
                 subject: Subject) -> tuple[dict[str, PlateRecording], tuple[str, ...]]:
    storage = read_storage(file)
    stated = manifest.forces
    mapping = {"right": stated.right, "left": stated.left} if isinstance(stated, ForceColumns) else None
    if mapping is not None and not any(mapping.values()):
        mapping = None
    prefixes = assign_prefixes(storage, mapping)
    if subject.prosthetic_side not in prefixes:
        raise InputError(f"there is no force for the {subject.prosthetic_side} (prosthetic) foot", file=path,
                         where=f"forces.{subject.prosthetic_side}", right=f"Name its prefix in {file.name}")
    plates: dict[str, PlateRecording] = {}
    notes = list(storage.notes)
    for side, prefix in prefixes.items():
        plates[side], more = read_plate(storage, prefix, mass_kg=subject.mass_kg)
        notes.extend(more)
    notes += [f"There is no force plate for the {side} foot." for side in ("right", "left") if side not in plates]
    return plates, tuple(notes)


def _window(path: Path, manifest: Manifest, trajectory: CoordinateTrajectory, plates: dict[str, PlateRecording],
            subject: Subject) -> tuple[Span, tuple[str, ...]]:
    side = subject.prosthetic_side
    time = plates[side].time_s
    window, notes = choose_window(manifest.window, (trajectory.start_s, trajectory.end_s),
                                  (float(time[0]), float(time[-1])), file=path)
    notes += check_stances(window, plates[side], side, mass_kg=subject.mass_kg, file=path)
    for other, plate in plates.items():
        if other != side:
            stances = find_stances(plate.time_s, plate.force_W[:, 2])
            notes += describe_stances(window, stances, other) + describe_scuffs(window, plate, other)
    return window, notes + describe_treadmill(window, plates[side])
