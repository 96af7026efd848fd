"""Back to OpenSim: markers as TRC, plates as external loads in MOT or STO; x forward, y up, z right."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vsf_drake.files import replaced
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.formats.recording import Plate, Recording
from vsf_drake.motion.plates import world_to_os
from vsf_drake.motion.storage import write_storage

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
