"""C3D: markers and force plates of a trial in the binary format of most laboratories.

Read by our own few lines rather than by ezc3d, which needs ten times the file's size in memory and
ends the process (segmentation fault) on some damaged files; the tests compare the two.

The format is that of the C3D user guide (Motion Lab Systems, https://www.c3d.org). Everything is
checked against the file's size before anything is reserved. Force plates (type 3: Kistler,
https://isbweb.org/software/movanal/vaughan/kistler.pdf; types 6 and 7, which the guide has not:
Visual3D, https://wiki.has-motion.com, FP_Type) have a frame P of their own: x from corner 2 to
corner 1, y from corner 4 to corner 1, both in the surface, z = x x y, by rule into the floor. Type
5 is not read: its channels times its matrix are three forces and moments (Visual3D, BTK), but the
two differ on their unit.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.files import opened
from vsf_drake.base.sentences import say
from vsf_drake.base.text_table import as_label
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.formats import units
from vsf_drake.motion.formats.recording import LARGEST, RawPlate, RawTrial

MASSES_KG = (20.0, 250.0)
STATURES_M = (0.8, 2.5)
PLACEHOLDER = 1.0  # what programs write as mass and height where nobody was measured
MOST_FRAMES = 100_000_000
MOST_PLATES = 64
MOST_RECORDS = 100_000
MOST_16_BITS = 65535  # what the header says as last frame where there are more
LOADED_N, FAR_M = 50.0, 0.3
"""A centre of pressure this far off a plate that carries so much is not on it, whatever the
noise."""
SMALLEST_M2 = 1e-3
# an offset that is subtracted is told from this on
TOLD_N = 1.0
MOST_CORRECTION_MM = 50.0
"""A correction of the centre of pressure larger than this at a plate's corner is none (Kistler's
published ones: up to 30 mm)."""
_BLOCK = 512
_INTEL = 84
_DEC = 85
_MIPS = 86
# bytes of each type of parameter: text, 8-bit and 16-bit integers, 32-bit floats
_SIZES = {-1: 1, 1: 1, 2: 2, 4: 4}
# analog channels of each type of plate
_CHANNELS = {1: 6, 2: 6, 3: 8, 4: 6, 6: 12, 7: 8}
# rows and columns of the matrix that the channels of a type are multiplied by
_CALIBRATED = {4: (6, 6), 6: (12, 12), 7: (8, 8)}
_BY_SENSORS = (3, 6, 7)  # types whose channels are forces of four sensors
_NOT_POSITIONS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")
"""Parameters of POINT that list the labels of computed quantities stored as points (Vicon)."""
_DAMAGED = "Is the file damaged?"


def read_c3d(path: Path, *, length_unit: str | None = None) -> RawTrial:
    """A C3D file in its laboratory frame, SI; refused where it is truncated or damaged, or its unit
    unknown."""
    c3d = _C3d(path)
    rate = c3d.number("POINT:RATE") or c3d.rate_hz
    if not (np.isfinite(rate) and 0.0 < rate < 1e6):
        raise InputError(f"the frame rate {rate:g} makes no sense", file=path, where="POINT:RATE")
    factor = units.file_length_factor(
        " ".join(c3d.texts("POINT:UNITS")[:1]), length_unit, path, "POINT:UNITS"
    )
    notes: list[str] = []
    start = (c3d.first_frame - 1) / rate
    fast = rate * c3d.subframes
    labels, kept = _labels(c3d, notes)
    positions = None
    if labels:
        positions = c3d.read_points(kept, length_m=factor)
        unseen = np.isnan(positions[..., 0]).all(axis=0)
        first = units.first_of_each(labels, notes, lambda i: bool(unseen[i]))
        if len(first) < len(labels):
            labels = [labels[i] for i in first]
            positions = positions[:, first]
    if c3d.subframes != c3d.stated_subframes and c3d.channels:
        notes += say(
            "files",
            "said",
            file=path.name,
            said=f"{c3d.stated_subframes} analog samples a frame",
            used=f"its parameters say {c3d.subframes}, which was used",
        )
    plates = _read_plates(c3d, factor, notes)
    if positions is None and not plates:
        raise InputError(
            "has neither labelled markers nor force plates that can be read",
            file=path,
            right=" ".join(notes) or "Export the trial with its marker labels",
        )
    stated = c3d.number("ANALOG:RATE")
    if plates and stated and abs(stated / fast - 1.0) > 1e-3:
        notes += say(
            "files",
            "analog_rate",
            file=path.name,
            stated=stated,
            subframes=c3d.subframes,
            rate=fast,
        )
    screen = "".join(c3d.texts("POINT:Y_SCREEN")[:1]).strip().lower()
    screen = screen if screen[:1] in ("+", "-") else f"+{screen}"
    return RawTrial(
        labels,
        positions,
        rate,
        start,
        plates,
        fast,
        start,
        notes=notes,
        up=screen if screen[1:] in ("x", "y", "z") else None,
        person=_person(c3d, notes),
    )


def c3d_labels(path: Path) -> list[str]:
    """The labels of a C3D file's markers, in its order."""
    return _labels(_C3d(path), [])[0]


def c3d_subjects(path: Path) -> list[str]:
    """The names of the persons in a C3D file, as Vicon writes them (SUBJECTS:NAMES)."""
    return [name for name in _C3d(path).all_texts("SUBJECTS:NAMES") if name]


def _labels(c3d: _C3d, notes: list[str]) -> tuple[list[str], list[int]]:
    labels = c3d.all_texts("POINT:LABELS")[: c3d.points]
    computed = {label for name in _NOT_POSITIONS for label in c3d.all_texts(f"POINT:{name}")}
    kept = [
        i
        for i, label in enumerate(labels)
        if label and not label.startswith("*") and label not in computed
    ]
    left_out = [label for label in labels if label in computed and label]
    notes += say(
        "files",
        "points",
        file=c3d.path.name,
        computed=left_out,
        nameless=c3d.points - len(kept) - len(left_out),
    )
    return [labels[i] for i in kept], kept


def _person(c3d: _C3d, notes: list[str]) -> dict[str, float]:
    facts = {}
    for name, key, factors, (low, high) in (
        ("BODYMASS", "mass_kg", (1.0,), MASSES_KG),
        ("HEIGHT", "stature_m", (1e-3, 1e-2, 1.0), STATURES_M),
    ):
        value = c3d.number(f"PROCESSING:{name}")
        fitting = [
            value * factor
            for factor in factors
            if value and value != PLACEHOLDER and low <= value * factor <= high
        ]
        if fitting:
            facts[key] = fitting[0]
        elif value:
            notes += say(
                "files",
                "person",
                file=c3d.path.name,
                name=name,
                value=value,
                placeholder=value == PLACEHOLDER,
            )
    return facts


# Force plates: a force and a torque about the centre of the plate's surface.


def _read_plates(c3d: _C3d, length_m: float, notes: list[str]) -> list[RawPlate]:
    used = c3d.number("FORCE_PLATFORM:USED")
    if not used or used < 0 or not c3d.channels:
        return []
    if used > MOST_PLATES:
        raise InputError(
            f"{used:g} force plates are stated",
            file=c3d.path,
            where="FORCE_PLATFORM:USED",
            right=_DAMAGED,
        )
    plates = list[RawPlate]()
    broken = list[InputError]()
    for i in range(int(used)):
        try:
            plate = _read_plate(c3d, i, length_m, notes)
            plates += [plate] if plate is not None else []
        except InputError as error:
            if not (error.where or "").startswith("FORCE_PLATFORM:"):
                raise
            broken.append(error)
            notes += say("files", "broken_plate", file=c3d.path.name, plate=i + 1, error=error)
    if broken and not plates:
        raise broken[0]
    return plates


def _read_plate(c3d: _C3d, i: int, length_m: float, notes: list[str]) -> RawPlate | None:
    types = c3d.values("FORCE_PLATFORM:TYPE").ravel(order="F")
    kind = int(types[i]) if i < len(types) and np.isfinite(types[i]) else 0
    if kind not in _CHANNELS:
        notes += say("files", "unread_plate", file=c3d.path.name, plate=i + 1, kind=kind)
        return None
    corners = _of_plate(c3d, "CORNERS", i, 12).reshape(4, 3) * length_m
    x = corners[0] - corners[1]
    y = corners[0] - corners[3]
    z = np.cross(x, y)
    bent = (
        float(np.linalg.norm(z)) < 0.1 * float(np.linalg.norm(x) * np.linalg.norm(y)) or not x.any()
    )
    if (
        bent
        or np.linalg.norm(np.cross(corners[2] - corners[0], corners[3] - corners[1])) / 2.0
        < SMALLEST_M2
    ):
        notes += say("files", "unread_plate", file=c3d.path.name, plate=i + 1, kind=None)
        return None
    channels = [int(c) - 1 for c in _of_plate(c3d, "CHANNEL", i, _CHANNELS[kind])]
    if min(channels) < 0 or max(channels) >= c3d.channels:
        raise InputError(
            f"force plate {i + 1} uses analog channels {min(channels) + 1} to "
            f"{max(channels) + 1}; there are {c3d.channels}",
            file=c3d.path,
            where="FORCE_PLATFORM:CHANNEL",
        )
    raw = c3d.read_analog(channels)
    axes = np.column_stack([v / np.linalg.norm(v) for v in (x, np.cross(z, x), z)])
    centre = corners.mean(axis=0)
    origin = _of_plate(c3d, "ORIGIN", i, 3) * length_m
    if kind in _CALIBRATED:
        raw = _calibrated(c3d, i, kind, raw, notes)
    if not (raw.max(initial=0.0) < LARGEST and raw.min(initial=0.0) > -LARGEST):
        raise InputError(
            "an analog sample is not a believable number",
            file=c3d.path,
            where=f"force plate {i + 1}",
        )
    raw = _zeroed(c3d, i, kind, raw, notes)
    stated = c3d.all_texts("ANALOG:UNITS")
    text = stated[channels[3]] if channels[3] < len(stated) else ""
    factor = units.length_factor(text) if kind == 1 else units.moment_factor(text)
    by_sensors = kind in _BY_SENSORS
    unit = length_m if factor is None or by_sensors else factor
    half = np.abs((corners - centre) @ axes)[:, :2].max(axis=0)
    choices = [unit] + [
        other for other in (1.0, 1e-3) if not np.isclose(other, unit) and not by_sensors
    ]
    choice = next(
        (choice for choice in choices if _on_plate(kind, raw, origin, choice, half)), unit
    )
    if choice != unit:
        notes += say("files", "other_moments", plate=i + 1, used=choice, stated=unit)
    notes += say("files", "documented", plate=i + 1, kind=kind) if kind in (6, 7) else []
    load = _load(kind, raw, origin, choice)
    if kind in (3, 7):
        _correct_cop(c3d, i, load, half, in_mm=bool(np.isclose(length_m, 1e-3)), notes=notes)
    force, point, torque = (vectors @ axes.T for vectors in load)
    return RawPlate(
        str(i + 1), force, point + centre if kind == 1 else centre, torque, corners=corners
    )


def _calibrated(c3d: _C3d, i: int, kind: int, raw: np.ndarray, notes: list[str]) -> np.ndarray:
    """The channels (n, columns) times the plate's calibration matrix; of type 4 as they are where
    there is none."""
    matrices = np.atleast_3d(c3d.values("FORCE_PLATFORM:CAL_MATRIX"))
    rows, columns = _CALIBRATED[kind]
    there = matrices.shape[0] >= rows and matrices.shape[1] >= columns and matrices.shape[2] > i
    if not there and kind == 4:
        notes += say("files", "no_calibration", plate=i + 1)
        return raw
    require(
        there,
        f"has no {rows} x {columns} matrix, which force plate {i + 1} of type {kind} needs",
        "FORCE_PLATFORM:CAL_MATRIX",
        file=c3d.path,
    )
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(raw @ matrices[:rows, :columns, i].T)


def _zeroed(c3d: _C3d, i: int, kind: int, raw: np.ndarray, notes: list[str]) -> np.ndarray:
    """The channels less their mean over what FORCE_PLATFORM:ZERO names, if the plate is unloaded
    there.

    It names frames, as the file counts them or from its first one on; as some write it, samples:
    the first reading that lies within the file counts. Most programs name the first ten frames,
    whoever stands on the plate. The channels of type 1, centres of pressure among them, stay.
    """
    ends = c3d.values("FORCE_PLATFORM:ZERO").ravel(order="F")[:2]
    if kind == 1 or len(ends) < 2 or not (np.abs(ends) < LARGEST).all() or not ends.any():
        return raw
    first = max(int(ends[0]), 1) - 1
    last = int(ends[1])
    cropped = c3d.first_frame - 1
    readings = (
        ("frames", (first - cropped) * c3d.subframes, (last - cropped) * c3d.subframes),
        ("frames", first * c3d.subframes, last * c3d.subframes),
        ("samples", first, last),
    )
    words, start, stop = next(
        (each for each in readings if 0 <= each[1] < each[2] <= len(raw)), ("", 0, 0)
    )
    if not words:
        return raw
    vertical = _load(kind, raw[start:stop], np.zeros(3), 1.0)[0][:, 2]
    mean = abs(float(vertical.mean()))
    if not (mean < LOADED_N and np.ptp(vertical) < THRESHOLD_N):
        return raw
    if mean > TOLD_N:
        notes += say(
            "files", "zeroed", plate=i + 1, words=words, ends=(first + 1, last), vertical=mean
        )
    return np.asarray(raw - raw[start:stop].mean(axis=0))


def _correct_cop(
    c3d: _C3d,
    i: int,
    load: tuple[np.ndarray, np.ndarray, np.ndarray],
    half: np.ndarray,
    *,
    in_mm: bool,
    notes: list[str],
) -> None:
    """Moves the centre of pressure of a load in P (see `_load`) as Kistler's correction says, by
    changing its torque; `half` (2,) m is half the plate's size.

    Kistler, Multicomponent force plate for biomechanics type 9287C, instruction manual, 8.4.3: with
    a_x and a_y in mm, less ((P1 a_y^4 + P2 a_y^2 + P3) a_x^3 + (P4 a_y^4 + P5 a_y^2 + P6) a_x), and
    likewise for a_y. The file has the six of x and then of y (ezc3d), or x and y by turns (C3D user
    guide of 2008: 2 x 6); the wrong reading moves the corners by decimetres.
    """
    flat = c3d.values("FORCE_PLATFORM:FPCOPPOLY").ravel(order="F")[12 * i : 12 * i + 12]
    if not flat.any():
        return
    corner = 1e3 * half[None]
    orders = (flat.reshape(2, 6), flat.reshape(6, 2).T) if len(flat) == 12 else ()
    fitting = [
        each
        for each in orders
        if in_mm and (np.abs(_cop_correction(each, corner)) < MOST_CORRECTION_MM).all()
    ]
    notes += say("files", "cop_correction", plate=i + 1, applied=bool(fitting))
    if not fitting:
        return
    force, _, torque = load
    on = np.flatnonzero(np.abs(force[:, 2]) > THRESHOLD_N)
    vertical = force[on, 2]
    cop = np.column_stack([-torque[on, 1], torque[on, 0]]) / vertical[:, None]
    less = 1e-3 * _cop_correction(fitting[0], 1e3 * cop)
    less[(np.abs(cop) > half).any(axis=1)] = 0.0
    torque[on, 0] -= less[:, 1] * vertical
    torque[on, 1] += less[:, 0] * vertical


def _cop_correction(coefficients: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(n, 2) mm that are too much in centres of pressure `at` (n, 2) mm, by coefficients (2, 6)."""
    p1, p2, p3, p4, p5, p6 = coefficients.T
    across = at[:, ::-1] ** 2
    with np.errstate(invalid="ignore", over="ignore"):
        cubic = (p1 * across + p2) * across + p3
        linear = (p4 * across + p5) * across + p6
        return np.asarray((cubic * at**2 + linear) * at)


def _load(
    kind: int, raw: np.ndarray, origin: np.ndarray, unit: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Force, point from the surface's centre and torque about it in P, each (n, 3), from the
    channels of a plate."""
    zero = np.zeros(len(raw))
    # Fx, Fy, Fz, the centre of pressure Px, Py and the free moment Mz there, in multiples of `unit`
    if kind == 1:
        return (
            raw[:, :3],
            np.column_stack([raw[:, 3] * unit, raw[:, 4] * unit, zero]),
            np.column_stack([zero, zero, raw[:, 5] * unit]),
        )
    lead = np.array([0.0, 0.0, -abs(origin[2])])
    # of sensors at (+-a, +-b) under the surface; `origin` is (a, b, depth)
    a = abs(origin[0])
    b = abs(origin[1])
    if kind == 6:
        sensors = raw.reshape(-1, 4, 3)
        force = sensors.sum(axis=1)
        at = np.array([[a, b, 0.0], [-a, b, 0.0], [-a, -b, 0.0], [a, -b, 0.0]])
        torque = np.cross(at, sensors).sum(axis=1)
    elif kind in (3, 7):
        x12, x34, y14, y23, z1, z2, z3, z4 = raw.T
        force = np.column_stack([x12 + x34, y14 + y23, z1 + z2 + z3 + z4])
        torque = np.column_stack(
            [b * (z1 + z2 - z3 - z4), a * (z2 + z3 - z1 - z4), b * (x34 - x12) + a * (y14 - y23)]
        )
    else:  # Fx to Mz about the sensor's origin, from which `origin` leads to the surface's centre
        force = raw[:, :3]
        torque = raw[:, 3:6] * unit
        lead = -origin if origin[2] > 0.0 else origin
    # moved: M_centre = M_origin - lead x F
    return force, np.zeros_like(force), torque - np.cross(lead, force)


def _on_plate(
    kind: int, raw: np.ndarray, origin: np.ndarray, unit: float, half: np.ndarray
) -> bool:
    """Whether most loaded samples press near the plate, of half sizes (2,) m; True where it is not
    loaded."""
    force, point, torque = _load(kind, raw, origin, unit)
    on = np.abs(force[:, 2]) > LOADED_N
    f = force[on]
    t = torque[on]
    off = np.abs(point[on, :2] + np.column_stack([-t[:, 1], t[:, 0]]) / f[:, 2:3])
    return not len(off) or bool((np.median(off, axis=0) < half + FAR_M).all())


def _of_plate(c3d: _C3d, name: str, i: int, size: int) -> np.ndarray:
    value = c3d.values(f"FORCE_PLATFORM:{name}")
    row = value.shape[0] if name == "CHANNEL" and value.ndim > 1 else size
    flat = value.ravel(order="F")[i * row : i * row + size]
    if len(flat) != size or row < size or not (np.abs(flat) < LARGEST).all():
        raise InputError(
            f"says nothing usable of force plate {i + 1}",
            file=c3d.path,
            where=f"FORCE_PLATFORM:{name}",
        )
    return flat


# The file: its header, its parameters, and its frames, which are read a chunk at a time.


class _C3d:
    """A C3D file: counts of points, channels, frames (from 1) and analog samples a frame; what its
    header says of them.
    """

    def __init__(self, path: Path) -> None:
        """Reads header and parameters; refuses what is missing, empty, no C3D file, damaged in them
        or truncated."""
        self.path = path
        with opened(path) as stream:
            self._size = os.fstat(stream.fileno()).st_size
            head = stream.read(_BLOCK)
            if not head:
                raise InputError("the file is empty", file=path)
            if len(head) < _BLOCK or head[1] != 0x50:
                raise InputError(
                    "is not a C3D file",
                    file=path,
                    where="header",
                    right="Its second byte must be 0x50"
                    if len(head) >= _BLOCK
                    else "It is too short",
                )
            start = (max(head[0], 1) - 1) * _BLOCK
            stream.seek(start)
            lead = stream.read(4)
            if len(lead) < 4:
                raise InputError(
                    "ends before its parameters", file=path, right="Is the file truncated?"
                )
            self._processor = lead[3] if lead[3] in (_INTEL, _DEC, _MIPS) else lead[3] + 83
            if self._processor not in (_INTEL, _DEC, _MIPS):
                raise InputError(
                    f"the processor type {lead[3]} is unknown",
                    file=path,
                    where="parameters",
                    right="It must be 84, 85 or 86: is the file damaged?",
                )
            words = [int(word) for word in self._integers(head, signed=False)]
            stream.seek(start)
            section = stream.read(max(lead[2], words[8] - 1 - start // _BLOCK, 1) * _BLOCK)
        with np.errstate(all="ignore"):
            self._scale, self.rate_hz = (
                float(self._floats(head[at : at + 4])[0]) for at in (12, 20)
            )
        self.points = words[1]
        self.stated_subframes = words[9]
        self._parameters = self._read_parameters(section)
        self._find_frames(words[2], words[3], words[4], words[8])

    def _integers(self, data: bytes, *, signed: bool = True) -> np.ndarray:
        return np.frombuffer(
            data, (">" if self._processor == _MIPS else "<") + ("i2" if signed else "u2")
        )

    def _floats(self, data: bytes) -> np.ndarray:
        """32-bit numbers; DEC's have their halves swapped and four times the value of IEEE's."""
        if self._processor == _DEC:
            halves = np.frombuffer(data, "<u2").reshape(-1, 2)[:, ::-1]
            return np.ascontiguousarray(halves).view("<f4").ravel() / np.float32(4.0)
        return np.frombuffer(data, "<f4" if self._processor == _INTEL else ">f4")

    def _read_parameters(self, section: bytes) -> dict[str, np.ndarray | list[str]]:
        """By "GROUP:NAME", arrays in Fortran order."""
        groups: dict[int, str] = {}
        parameters: list[tuple[int, str, np.ndarray | list[str]]] = []
        at = 4
        for _ in range(MOST_RECORDS):
            if at + 2 > len(section) or section[at] == 0:
                break
            length, group = (int(byte) for byte in np.frombuffer(section[at : at + 2], np.int8))
            name_end = at + 2 + abs(length)
            name = section[at + 2 : name_end].decode("latin-1").strip().upper()
            fits = name_end + 2 <= len(section) and group != 0
            value = self._read_value(section, name_end + 2) if fits and group > 0 else []
            if not fits or value is None:
                raise InputError(
                    "the parameter section is damaged",
                    file=self.path,
                    right="Export the trial again",
                    where=f"parameter {name}" if fits else f"parameters, byte {at}",
                )
            if group < 0:
                groups[-group] = name
            else:
                parameters.append((group, name, value))
            step = int(self._integers(section[name_end : name_end + 2], signed=False)[0])
            if step == 0:
                break
            at = name_end + step
        return {f"{groups.get(group, group)}:{name}": value for group, name, value in parameters}

    def _read_value(self, section: bytes, at: int) -> np.ndarray | list[str] | None:
        """The value of a parameter whose type byte is at `at`; None where it does not fit into the
        section."""
        if at + 2 > len(section):
            return None
        kind = section[at] - 256 * (section[at] > 127)
        count = section[at + 1]
        shape = tuple(section[at + 2 : at + 2 + count])
        if kind not in _SIZES or len(shape) != count or count > 7:
            return None
        items = int(np.prod(shape, dtype=object)) if shape else 1
        data = section[at + 2 + count : at + 2 + count + items * _SIZES[kind]]
        if len(data) != items * _SIZES[kind]:
            return None
        if kind == -1:
            width = shape[0] if shape else 1
            texts = (
                data[i * width : (i + 1) * width].decode("latin-1")
                for i in range(items // width if width else 0)
            )
            return [as_label(text).replace("\n", " ").replace("\t", " ") for text in texts]
        values = (
            np.frombuffer(data, np.int8)
            if kind == 1
            else (self._integers if kind == 2 else self._floats)(data)
        )
        return values.reshape(shape, order="F") if shape else values

    def texts(self, name: str) -> list[str]:
        value = self._parameters.get(name)
        return value if isinstance(value, list) else []

    def all_texts(self, name: str) -> list[str]:
        """A list that goes on in NAME2, NAME3, ... where it has more than 255 entries."""
        return [text for part in self._parts(name) for text in self.texts(part)]

    def _parts(self, name: str) -> Iterator[str]:
        yield name
        yield from itertools.takewhile(
            lambda part: len(self._parameters.get(part, ())),
            (f"{name}{i}" for i in itertools.count(2)),
        )

    def values(self, name: str) -> np.ndarray:
        """A parameter of numbers as float; empty where there is none."""
        value = self._parameters.get(name)
        return (
            np.zeros(0)
            if value is None or isinstance(value, list)
            else np.asarray(value, dtype=float)
        )

    def number(self, name: str) -> float | None:
        value = self.values(name).ravel(order="F")
        return float(value[0]) if value.size and np.isfinite(value[0]) else None

    def _find_frames(
        self, analog_per_frame: int, first_frame: int, last_frame: int, data_block: int
    ) -> None:
        """Where and how many the frames are; header and parameters that disagree are settled by the
        file's size."""
        block = int(data_block or self.number("POINT:DATA_START") or 0)
        scale = (
            self._scale if self.points == 0 or self._scale else self.number("POINT:SCALE") or 0.0
        )
        if block < 2 or not np.isfinite(scale):
            raise InputError(
                "the header does not say where the frames are",
                file=self.path,
                where="header",
                right=_DAMAGED,
            )
        self.subframes = self._subframes(analog_per_frame) if analog_per_frame else 0
        if analog_per_frame and not self.subframes:
            raise InputError(
                f"{analog_per_frame} analog numbers a frame fit neither {self.stated_subframes} "
                "samples a frame nor ANALOG:USED and ANALOG:RATE",
                file=self.path,
                where="header",
                right=_DAMAGED,
            )
        self.channels = analog_per_frame // self.subframes if self.subframes else 0
        self._start = (block - 1) * _BLOCK
        self._are_floats = scale < 0.0
        self._words = 4 * self.points + self.channels * self.subframes
        self._frame_bytes = self._words * (4 if self._are_floats else 2)
        if self._words == 0:
            raise InputError("has neither points nor analog channels", file=self.path)
        held = max(self._size - self._start, 0) // self._frame_bytes
        trial = self._trial_frames()
        by_header = last_frame - first_frame + 1
        long = self.number("POINT:FRAMES") if last_frame == MOST_16_BITS else None
        counts = [
            by_header,
            trial[1] - trial[0] + 1 if trial else 0,
            *(
                int(min(value, MOST_FRAMES))
                for value in (long, self.number("POINT:LONG_FRAMES"))
                if value
            ),
        ]
        stated = [frames for frames in counts if 0 < frames < MOST_FRAMES]
        self.frames = max((frames for frames in stated if frames <= held), default=0)
        if not self.frames:
            raise InputError(
                f"the header says {max(stated, default=0)} frames, the file holds {held}",
                file=self.path,
                right="Is the file truncated?",
            )
        if self.frames == by_header and last_frame == MOST_16_BITS:
            self.frames = self._frames_held(held)
        own = trial and trial[0] % (MOST_16_BITS + 1) == first_frame
        self.first_frame = trial[0] if trial and own else max(first_frame, 1)

    def _subframes(self, total: int) -> int:
        """Analog samples a frame of `total` numbers: as channels and rates agree, else the
        header's; 0 if none divides.
        """
        used, fast, slow = (
            self.number(name) or 0.0 for name in ("ANALOG:USED", "ANALOG:RATE", "POINT:RATE")
        )
        by_channels = total / used if used >= 1.0 else 0.0
        by_rate = fast / (slow or self.rate_hz or np.inf)
        agreed = by_channels if abs(by_rate - by_channels) < 1e-3 * by_channels else 0.0
        for subframes in (agreed, float(self.stated_subframes), by_channels, by_rate):
            if (
                1.0 <= subframes <= total
                and subframes == round(subframes)
                and total % subframes == 0
            ):
                return int(subframes)
        return 0

    def _frames_held(self, held: int) -> int:
        """The frames that the file holds, without zeros that fill its last block: for counts beyond
        16 bits."""
        size = self._frame_bytes
        with opened(self.path) as stream:
            stream.seek(self._start + max(held - 1 - _BLOCK // size, 0) * size)
            tail = stream.read()
        tail = tail[: len(tail) // size * size]
        while held > 1 and tail and not any(tail[-size:]):
            tail = tail[:-size]
            held = held - 1
        return held

    def _trial_frames(self) -> tuple[int, int] | None:
        """First and last frame by the parameters of TRIAL, two words of 16 bits each."""
        ends = []
        for name in ("TRIAL:ACTUAL_START_FIELD", "TRIAL:ACTUAL_END_FIELD"):
            words = self.values(name).ravel(order="F")
            if words.size < 2 or not np.isfinite(words[:2]).all():
                return None
            low, high = (int(word) % (MOST_16_BITS + 1) for word in words[:2])
            ends.append(low + high * (MOST_16_BITS + 1))
        return (ends[0], ends[1]) if 0 < ends[0] <= ends[1] else None

    def read_points(self, points: list[int], *, length_m: float) -> np.ndarray:
        """(frames, len(points), 3) m of the points asked for (from 0).

        NaN where the residual is negative, or all three numbers are zero.
        """
        scale = 1.0 if self._are_floats else abs(self._scale or self.number("POINT:SCALE") or 1.0)
        words = self._numbers()[:, : 4 * self.points].reshape(self.frames, self.points, 4)[
            :, points
        ]
        with np.errstate(invalid="ignore"):
            place = words[..., :3].astype(float)
        place[
            ~(np.abs(place) < LARGEST).all(axis=-1)
            | (place == 0.0).all(axis=-1)
            | ~(words[..., 3] >= 0.0)
        ] = np.nan
        place *= scale
        place *= length_m
        return place

    def read_analog(self, channels: list[int]) -> np.ndarray:
        """(samples, len(channels)) of the channels asked for (from 0), in their own units."""
        general = self.number("ANALOG:GEN_SCALE")
        unsigned = any(text.upper().startswith("UNSIGNED") for text in self.texts("ANALOG:FORMAT"))
        scales = self._per_channel("ANALOG:SCALE", channels, 1.0) * (
            1.0 if general is None else general
        )
        offsets = self._per_channel("ANALOG:OFFSET", channels, 0.0)
        if unsigned:
            offsets = np.where(offsets < 0.0, offsets + 65536.0, offsets)
        samples = self._numbers(signed=not unsigned)[:, 4 * self.points :].reshape(
            -1, self.channels
        )[:, channels]
        with np.errstate(invalid="ignore", over="ignore"):
            return np.asarray((samples - offsets) * scales)

    def _per_channel(self, name: str, channels: list[int], default: float) -> np.ndarray:
        value = np.concatenate([self.values(part).ravel(order="F") for part in self._parts(name)])
        return np.array([value[c] if c < len(value) else default for c in channels])

    def _numbers(self, *, signed: bool = True) -> np.ndarray:
        """(frames, words) as they stand in the file."""
        with opened(self.path) as stream:
            stream.seek(self._start)
            data = stream.read(self.frames * self._frame_bytes)
        numbers = self._floats(data) if self._are_floats else self._integers(data, signed=signed)
        return numbers.reshape(self.frames, self._words)
