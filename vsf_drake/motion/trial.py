"""A trial: everything that a manifest leads to, read, checked and brought to the model's frames; and written."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.files import replaced, sha256
from vsf_drake.model_file import check_fulcrum, load_model
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.formats.recording import Plate, Recording
from vsf_drake.motion.from_markers import trial_from_recordings
from vsf_drake.motion.kinematics import PELVIS_TRANSLATIONS, read_kinematics
from vsf_drake.motion.manifest import ForceColumns, Manifest, load_manifest, load_stated_subject, named_file, to_si
from vsf_drake.motion.markers.maps import SHIPPED, load_marker_map
from vsf_drake.motion.plates import SIDES, PlateRecording, assign_prefixes, read_plate, world_to_os
from vsf_drake.motion.storage import read_storage, write_storage
from vsf_drake.motion.trial_record import Trial, check_mass, default_model
from vsf_drake.motion.window import on_the_belt, trial_window
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.schema import load_yaml

__all__ = ["Trial", "default_model", "load_trial"]


def load_trial(path: str | Path) -> Trial:
    """Reads a trial manifest and every file it names.

    With markers, see `motion.from_markers`; the plates are given to the feet by where their load acts. With joint
    angles, files are in OpenSim's laboratory frame (x forward, y up, z right), in m, N, N m and the angle unit that
    their header states. Forces come back in the world frame W (x forward, y left, z up, ground z = 0); coordinates keep
    OpenSim's names and, for the pelvis, OpenSim's axes; angles are in rad, knee flexion positive.
    Recordings are not filtered.

    Args:
        path: the manifest, see `vsf_drake.motion.manifest` for its keys. Paths in it are relative to its folder.

    Returns:
        The trial. Read its `notes`: they say what was assumed.

    Raises:
        InputError: with a message that names file, and key, column, line or time:
            - a file is missing or is not what its key needs; markers do not tell the motion;
            - a key is unknown, doubled or missing; a value has the wrong type or is out of range; the fulcrum is
              out of the carriage's reach;
            - a table is truncated, has a doubled label or no `endheader`, or lacks a required column;
            - a needed cell is blank, NaN or no number; time does not increase or has a gap; too few rows;
            - angles cannot be in the unit stated, or no unit is stated; a pelvis position is not believable;
            - the column names do not tell which force is which foot; the prosthetic foot has no force;
            - a force points down or sideways, or is far from the body weight; the plates contradict the mass;
            - window, kinematics and forces do not overlap; the trial is shorter than one stance; the prosthetic
              foot carries no load in it.
    """
    path = Path(path)
    manifest = load_manifest(path)
    named = _named_files(path, manifest)
    model = load_model(named["model"]) if "model" in named else default_model()
    fulcrum_m = check_fulcrum(1e-3 * manifest.prosthesis.fulcrum_mm, model.foot, file=path,
                              where="prosthesis.fulcrum_mm")
    written = {"subject": manifest.subject, "kinematics": str(manifest.kinematics), "markers": str(manifest.markers),
               "standing": str(manifest.standing), "marker_map": str(manifest.marker_map),
               "forces": str(_force_file(manifest)), "model": str(manifest.model)}
    inputs = {path.name: sha256(path)} | {written[key]: sha256(file) for key, file in named.items()}
    trial = (_trial_from_angles if manifest.markers is None else _trial_from_markers)(
        path, manifest, named, model, fulcrum_m, inputs)
    check_mass(trial, file=named["subject"])
    return trial


def _trial_from_angles(path: Path, manifest: Manifest, named: dict[str, Path], model: ModelParameters,
                       fulcrum_m: float, inputs: dict[str, str]) -> Trial:
    subject = load_yaml(named["subject"], Subject)
    storage = read_storage(named["kinematics"])
    trajectory, notes = read_kinematics(storage, prosthetic_side=subject.prosthetic_side, unit=manifest.kinematics_unit)
    plates, plate_notes = _read_plates(path, manifest, named["forces"], subject)
    speed = manifest.belt_speed_m_per_s
    trajectory, plates, belt_notes = on_the_belt(trajectory, plates, speed_m_per_s=speed)
    window, window_notes = trial_window(path, manifest.window, trajectory, plates, subject)
    return Trial(path=path, name=manifest.name or path.stem, subject=subject, synthetic=manifest.synthetic,
                 fulcrum_m=fulcrum_m, start_s=window[0], end_s=window[1], trajectory=trajectory, plates=plates,
                 notes=notes + plate_notes + belt_notes + window_notes, model=model, inputs=inputs,
                 offsets=to_si(manifest.offsets))


def _trial_from_markers(path: Path, manifest: Manifest, named: dict[str, Path], model: ModelParameters,
                        fulcrum_m: float, inputs: dict[str, str]) -> Trial:
    person, stated = load_stated_subject(named["subject"])
    laboratory = {"up": manifest.laboratory.up, "forward": manifest.laboratory.forward,
                  "length_unit": manifest.laboratory.length_unit}
    standing = None
    if "standing" in named:
        standing = read_trial(named["standing"], **laboratory)
    walk = read_trial(named["markers"], forces=named.get("forces"), **laboratory)
    marker_map = None
    if manifest.marker_map is not None:
        marker_map = load_marker_map(named.get("marker_map", manifest.marker_map))
    sides = None
    if isinstance(manifest.forces, ForceColumns) and (manifest.forces.right or manifest.forces.left):
        sides = {"right": manifest.forces.right, "left": manifest.forces.left}
    return trial_from_recordings(
        standing, walk, marker_map, person, fulcrum_m=fulcrum_m, stated=stated, hip=manifest.hip_centre,
        cutoff_hz=None if manifest.already_filtered else manifest.marker_cutoff_hz, plate_sides=sides,
        window=manifest.window, belt_speed_m_per_s=manifest.belt_speed_m_per_s, model=model,
        offsets=to_si(manifest.offsets), path=path, name=manifest.name, synthetic=manifest.synthetic, inputs=inputs)


def _force_file(manifest: Manifest) -> str | None:
    return manifest.forces.file if isinstance(manifest.forces, ForceColumns) else manifest.forces


def _named_files(path: Path, manifest: Manifest) -> dict[str, Path]:
    values = {"subject": manifest.subject, "kinematics": manifest.kinematics, "markers": manifest.markers,
              "standing": manifest.standing, "forces": _force_file(manifest), "model": manifest.model}
    if manifest.marker_map is not None and manifest.marker_map not in SHIPPED:
        values["marker_map"] = manifest.marker_map
    named = {key: named_file(path, key, value) for key, value in values.items() if value is not None}
    if manifest.markers is not None and named.get("forces") == named["markers"]:
        del named["forces"]
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
                         where=f"forces.{subject.prosthetic_side}", right=f"Name its prefix in {file.name}; or is the "
                         "subject's prosthetic_side the other one?")
    plates: dict[str, PlateRecording] = {}
    notes = list(storage.notes)
    for side, prefix in prefixes.items():
        plates[side], more = read_plate(storage, prefix, mass_kg=subject.mass_kg)
        notes.extend(more)
    notes += [f"There is no force plate for the {side} foot." for side in ("right", "left") if side not in plates]
    return plates, tuple(notes)


# A trial written as OpenSim files: joint angles and ground reaction forces.


def write_trial_files(trial: Trial, folder: str | Path, stem: str) -> tuple[str, str]:
    """Writes `<stem>_ik.mot` and `<stem>_grf.mot`, which a manifest takes as `kinematics` and `forces`.

    Both are in OpenSim's frame (x forward, y up, z right). Angles are in degrees, with both ankles where the trial
    comes from markers. Forces are ground_force_r_vx, ... with the centre of pressure on the floor, ground_force_r_px,
    ..., and the free moment as the vertical torque, ground_torque_r_y; all zero where a foot is not loaded. What the
    trial's belt carried stays carried: the files are those of a floor at rest.

    Returns:
        The names of the two files.

    Raises:
        InputError: a file cannot be written.
    """
    folder = Path(folder)
    names, values = list(trial.trajectory.names), trial.trajectory.values
    if trial.tracked is not None:
        more = [name for name in trial.tracked.names if name not in names]
        extra = trial.tracked.values[:, [trial.tracked.names.index(name) for name in more]]
        names, values = names + more, np.column_stack([values, extra])
    shown = np.column_stack([column if name in PELVIS_TRANSLATIONS else np.degrees(column)
                             for name, column in zip(names, values.T, strict=True)])
    kinematics, forces = f"{stem}_ik.mot", f"{stem}_grf.mot"
    label = "synthetic" if trial.synthetic else "from a recording"
    write_storage(folder / kinematics, time_s=trial.trajectory.time_s, names=names, values=shown, in_degrees=True,
                  title=f"{stem} joint angles, {label}")
    plates = {side[0]: Plate(side, plate.force_W, plate.cop_W, plate.free_moment_nm)
              for side in SIDES if (plate := trial.plates.get(side)) is not None}
    write_forces_mot(folder / forces, time_s=next(iter(trial.plates.values())).time_s, plates=plates,
                     title=f"{stem} ground reaction forces, {label}")
    return kinematics, forces


# Back to OpenSim: markers as TRC, plates as external loads in MOT or STO; x forward, y up, z right.


_FACTORS = {"m": 1.0, "mm": 1e3}


def write_trc(path: str | Path, markers: Recording | Mapping[str, np.ndarray], *, rate_hz: float | None = None,
              start_s: float = 0.0, unit: str = "m") -> None:
    """Writes markers to a TRC file in OpenSim's frame, in full precision; an existing file is replaced at the end.

    Args:
        markers: a recording, or (frames, 3) m in W by label; gaps (NaN) become blank cells.
        rate_hz: frames per second; that of the recording if None.
        start_s: time of the first frame, where no recording is given.
        unit: "m", which reads back exactly, or "mm".

    Raises:
        ValueError: no markers, shapes that differ, no rate, a label that is empty or holds a tab, another unit.
        InputError: the file cannot be written.
    """
    if isinstance(markers, Recording):
        rate_hz, start_s, markers = rate_hz or markers.marker_rate_hz, markers.marker_start_s, markers.markers
    if unit not in _FACTORS:
        raise ValueError(f"unit must be one of {', '.join(_FACTORS)}, not {unit!r}")
    if not markers or not rate_hz:
        raise ValueError("there are no markers, or no rate")
    if any(not label.strip() or set(label) & set("\t\r\n") for label in markers):
        raise ValueError("every marker needs a label, without tabs")
    places = [world_to_os(place) * _FACTORS[unit] for place in markers.values()]
    frames = len(places[0])
    if any(place.shape != (frames, 3) for place in places):
        raise ValueError("every marker must be (frames, 3)")
    labels = "\t\t\t".join(markers)
    axes = "\t".join(f"{axis}{k}" for k in range(1, len(places) + 1) for axis in "XYZ")
    rate = repr(float(rate_hz))
    table = np.concatenate(places, axis=1)
    with replaced(path, "w") as stream:
        stream.write(f"PathFileType\t4\t(X/Y/Z)\t{Path(path).name}\n"
                     "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\t"
                     "OrigNumFrames\n"
                     f"{rate}\t{rate}\t{frames}\t{len(places)}\t{unit}\t{rate}\t1\t{frames}\n"
                     f"Frame#\tTime\t{labels}\t\t\n\t\t{axes}\n\n")
        for i, row in enumerate(table):
            cells = ("" if np.isnan(cell) else repr(float(cell)) for cell in row)
            stream.write("\t".join([str(i + 1), repr(float(start_s + i / rate_hz)), *cells]) + "\n")


def write_forces_mot(
    path: str | Path, *, time_s: np.ndarray, plates: Mapping[str, Plate], title: str | None = None
) -> None:
    """Writes plates as OpenSim's external loads (.mot or .sto), in N, m and N m.

    Columns are ground_force_<key>_vx to _vz and _px to _pz, and ground_torque_<key>_x to _z; the key is "r" or "l", or
    a plate's name. Where a plate is not loaded, its centre of pressure is written as 0, for OpenSim needs numbers; a
    plate that has none under load gets no such columns.

    Args:
        time_s: (samples,) s.
        plates: by key, in W.
        title: the file's first line; its name if None.

    Raises:
        ValueError: the shapes do not fit.
        InputError: the file cannot be written.
    """
    names: list[str] = []
    values: list[np.ndarray] = []
    for key, plate in plates.items():
        zero = np.zeros(len(plate.force_n))
        moment = np.column_stack([zero, zero, plate.free_moment_nm])
        tables = {f"ground_force_{key}_v": plate.force_n, f"ground_force_{key}_p": plate.cop_m,
                  f"ground_torque_{key}_": moment}
        if np.isnan(plate.cop_m).all() and (plate.force_n[:, 2] > THRESHOLD_N).any():
            del tables[f"ground_force_{key}_p"]
        for stem, vectors in tables.items():
            names += [stem + axis for axis in "xyz"]
            values.append(np.nan_to_num(world_to_os(vectors)) + 0.0)
    if not names:
        raise ValueError("there are no plates")
    write_storage(path, time_s=time_s, names=names, values=np.concatenate(values, axis=1), title=title)
