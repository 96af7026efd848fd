"""C3D: markers and force plates of a trial in the binary format of most laboratories.

Read by our own few lines rather than by ezc3d, which needs ten times the file's size in memory and ends the process
(segmentation fault) on some damaged files; the tests compare the two.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.c3d_data import (
    C3dDescription,
    Layout,
    read_analog,
    read_description,
    read_layout,
    read_points,
)
from vsf_drake.motion.formats.recording import RawForces, RawMarkers, RawPlate, RawTrial
from vsf_drake.motion.formats.text import (
    file_length_factor,
    first_of_each,
    length_factor,
    moment_factor,
    pieces,
    without_prefix,
)

MASSES_KG, STATURES_M = (20.0, 250.0), (0.8, 2.5)
_NOT_POSITIONS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")
"""Parameters of POINT that list the labels of computed quantities stored as points (Vicon)."""


def read_c3d(path: Path, *, length_unit: str | None = None) -> RawTrial:
    """Reads a C3D file into its laboratory frame, SI.

    Raises:
        InputError: the file is truncated or damaged, or its unit is unknown.
    """
    c3d = read_description(path)
    layout = read_layout(c3d)
    rate = c3d.number("POINT:RATE") or c3d.header.rate_hz
    if not (np.isfinite(rate) and 0.0 < rate < 1e6):
        raise InputError(f"the frame rate {rate:g} makes no sense", file=path, where="POINT:RATE")
    factor = file_length_factor(" ".join(c3d.texts("POINT:UNITS")[:1]), length_unit, path, "POINT:UNITS")
    notes: list[str] = []
    start = (layout.first_frame - 1) / rate
    labels, kept = _labels(c3d, layout, notes)
    markers = None
    if labels:
        positions = read_points(c3d, layout, kept, length_m=factor)
        unseen = np.isnan(positions[..., 0]).all(axis=0)
        first = first_of_each(labels, notes, empty=lambda i: bool(unseen[i]))
        if len(first) < len(labels):
            labels, positions = [labels[i] for i in first], positions[:, first]
        markers = RawMarkers(labels, positions, rate, start)
    if layout.subframes != c3d.header.subframes and layout.channels:
        notes.append(f"The header of {path.name} says {c3d.header.subframes} analog samples a frame; its parameters "
                     f"and the numbers that a frame holds say {layout.subframes}, which was used.")
    forces = read_plates(c3d, layout, length_m=factor, rate_hz=rate, start_s=start, notes=notes)
    if markers is None and forces is None:
        raise InputError("has neither labelled markers nor force plates that can be read", file=path,
                         right=" ".join(notes) or "Export the trial with its marker labels")
    stated = c3d.number("ANALOG:RATE")
    if forces is not None and stated and abs(stated / forces.rate_hz - 1.0) > 1e-3:
        notes.append(f"ANALOG:RATE of {path.name} says {stated:g} Hz; {layout.subframes} samples a frame make "
                     f"{forces.rate_hz:g} Hz, which was used.")
    return RawTrial(markers, forces, up=_axis(c3d.texts("POINT:Y_SCREEN")), notes=notes, person=_person(c3d, notes))


def c3d_labels(path: Path) -> list[str]:
    """The labels of a C3D file's markers, in its order."""
    c3d = read_description(path)
    return _labels(c3d, read_layout(c3d), [])[0]


def _labels(c3d: C3dDescription, layout: Layout, notes: list[str]) -> tuple[list[str], list[int]]:
    """The markers' labels and which points they are: what is computed or has no name is left out."""
    labels = c3d.all_texts("POINT:LABELS")[:layout.points]
    computed = {label for name in _NOT_POSITIONS for label in c3d.all_texts(f"POINT:{name}")}
    kept = [i for i, label in enumerate(labels) if label and not label.startswith("*") and label not in computed]
    left_out = [label for label in labels if label in computed and label]
    if left_out:
        notes.append(f"{len(left_out)} computed quantities stored as points were left out ({left_out[0]}, ...).")
    nameless = layout.points - len(kept) - len(left_out)
    if nameless:
        notes.append(f"{nameless} points of {c3d.path.name} without a label were left out.")
    short, more = without_prefix([labels[i] for i in kept])
    notes += more
    return short, kept


def _person(c3d: C3dDescription, notes: list[str]) -> dict[str, float]:
    """Body mass (kg) and stature (m) that Vicon's software writes, where somebody may weigh and measure so much."""
    found = {}
    for name, key, factors, (low, high) in (("BODYMASS", "mass_kg", (1.0,), MASSES_KG),
                                            ("HEIGHT", "stature_m", (1e-3, 1e-2, 1.0), STATURES_M)):
        value = c3d.number(f"PROCESSING:{name}")
        fitting = [value * factor for factor in factors if low <= value * factor <= high] if value else []
        if fitting:
            found[key] = fitting[0]
        elif value:
            notes.append(f"PROCESSING:{name} of {c3d.path.name} says {value:g}, which is nobody's, and was not used.")
    return found


def _axis(texts: list[str]) -> str | None:
    text = texts[0].strip().lower() if texts else ""
    text = text if text[:1] in ("+", "-") else f"+{text}"
    return text if text[1:] in ("x", "y", "z") else None


# Force plates of a C3D file: types 1 to 4 to a force and a torque about the centre of the plate's surface.
#
# The plate's own frame P follows from its corners: x from corner 2 to corner 1, y from corner 4 to corner 1, both in
# the surface, z = x x y, by rule into the floor. Formulas: C3D user guide (Motion Lab Systems, https://www.c3d.org),
# chapter on force plates; type 3 Kistler (https://isbweb.org/software/movanal/vaughan/kistler.pdf).


CHANNELS = {1: 6, 2: 6, 3: 8, 4: 6}
"""Analog channels of each type."""
LOADED_N = 50.0
FAR_M = 0.3
"""A centre of pressure this far off a plate is not on it, whatever the noise."""
MOST_PLATES = 64
SMALLEST_M2 = 1e-3
LARGEST = 1e9
"""No force, moment or position is as large, in any unit."""


def read_plates(c3d: C3dDescription, layout: Layout, *, length_m: float, rate_hz: float, start_s: float,
                notes: list[str]) -> RawForces | None:
    """The plates of a C3D file in its laboratory frame, SI.

    Args:
        length_m: metres in the unit of the file's points, corners and origins.
        rate_hz: of the points.
        start_s: time of the first frame.
        notes: is added to.

    Raises:
        InputError: the parameters of all plates are incomplete or name channels that do not exist.
    """
    used = c3d.number("FORCE_PLATFORM:USED")
    if not used or used < 0 or not layout.channels:
        return None
    if used > MOST_PLATES:
        raise InputError(f"{used:g} force plates are stated", file=c3d.path, where="FORCE_PLATFORM:USED",
                         right="Is the file damaged?")
    plates, broken = [], list[InputError]()
    for i in range(int(used)):
        try:
            plate = _read_plate(c3d, layout, i, length_m, notes)
        except InputError as error:
            if not (error.where or "").startswith("FORCE_PLATFORM:"):
                raise
            broken.append(error)
            notes.append(f"Force plate {i + 1} of {c3d.path.name} was left out, and what stood on it counts as not "
                         f"measured: {error.where} {error.what}.")
            continue
        if plate is not None:
            plates.append(plate)
    if broken and not plates:
        raise broken[0]
    return RawForces(plates, rate_hz * layout.subframes, start_s) if plates else None


def _read_plate(c3d: C3dDescription, layout: Layout, i: int, length_m: float, notes: list[str]) -> RawPlate | None:
    types = c3d.values("FORCE_PLATFORM:TYPE").ravel(order="F")
    kind = int(types[i]) if i < len(types) and np.isfinite(types[i]) else 0
    if kind not in CHANNELS:
        notes.append(f"Force plate {i + 1} of {c3d.path.name} is of type {kind}, which is not read: it was left out.")
        return None
    corners = _of_plate(c3d, "CORNERS", i, 12).reshape(4, 3) * length_m
    if _area(corners) < SMALLEST_M2 or _is_bent(corners):
        notes.append(f"Force plate {i + 1} of {c3d.path.name} has no corners that span a surface: it was left out.")
        return None
    raw = read_analog(c3d, layout, _channels(c3d, layout, i, CHANNELS[kind]))
    x = corners[0] - corners[1]
    z = np.cross(x, corners[0] - corners[3])
    axes = np.column_stack([v / np.linalg.norm(v) for v in (x, np.cross(z, x), z)])
    centre = corners.mean(axis=0)
    origin = _of_plate(c3d, "ORIGIN", i, 3) * length_m
    if kind == 4:
        calibration = _calibration(c3d, i, notes)
        for piece in pieces(len(raw), raw.shape[1]):
            with np.errstate(invalid="ignore", over="ignore"):
                raw[piece] = raw[piece] @ calibration.T
    if not (raw.max(initial=0.0) < LARGEST and raw.min(initial=0.0) > -LARGEST):
        raise InputError("an analog sample is not a believable number", file=c3d.path, where=f"force plate {i + 1}")
    unit = _moment_unit(c3d, i, kind, length_m)
    choices = [unit] + [other for other in (1.0, 1e-3) if not np.isclose(other, unit)]
    half = np.abs((corners - centre) @ axes)[:, :2].max(axis=0)
    for choice in choices if kind != 3 else choices[:1]:
        if _on_plate(kind, raw, origin, choice, half):
            break
    else:
        choice = unit
    if choice != unit:
        notes.append(f"The moments of force plate {i + 1} were read as multiples of {choice:g} N m: as {unit:g} N m, "
                     "which the file states, the centre of pressure would lie far off the plate.")
    force, torque = np.empty((len(raw), 3)), np.empty((len(raw), 3))
    point = np.empty((len(raw), 3)) if kind == 1 else centre.copy()
    for piece in pieces(len(raw), raw.shape[1]):
        f, p, t = _LOADS[kind](raw[piece], origin, choice)
        force[piece], torque[piece] = f @ axes.T, t @ axes.T
        if kind == 1:
            point[piece] = p @ axes.T + centre
    return RawPlate(str(i + 1), force, point, torque, corners=corners)


def _load_1(raw: np.ndarray, origin: np.ndarray, unit: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fx, Fy, Fz, Px, Py, Mz: centre of pressure from the surface's centre, free moment there."""
    zero = np.zeros(len(raw))
    return (raw[:, :3], np.column_stack([raw[:, 3] * unit, raw[:, 4] * unit, zero]),
            np.column_stack([zero, zero, raw[:, 5] * unit]))


def _load_2(raw: np.ndarray, origin: np.ndarray, unit: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fx, Fy, Fz, Mx, My, Mz about the sensor's origin, from which `origin` leads to the surface's centre."""
    force = raw[:, :3]
    lead = -origin if origin[2] > 0.0 else origin
    return force, np.zeros_like(force), raw[:, 3:6] * unit - np.cross(lead, force)


def _load_3(raw: np.ndarray, origin: np.ndarray, unit: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fx12, Fx34, Fy14, Fy23, Fz1 to Fz4 of sensors at (+-a, +-b) under the surface; `origin` is (a, b, depth)."""
    a, b = abs(origin[0]), abs(origin[1])
    x12, x34, y14, y23, z1, z2, z3, z4 = raw.T
    force = np.column_stack([x12 + x34, y14 + y23, z1 + z2 + z3 + z4])
    torque = np.column_stack([b * (z1 + z2 - z3 - z4), a * (z2 + z3 - z1 - z4), b * (x34 - x12) + a * (y14 - y23)])
    return force, np.zeros_like(force), torque - np.cross([0.0, 0.0, -abs(origin[2])], force)


_LOADS = {1: _load_1, 2: _load_2, 3: _load_3, 4: _load_2}


def _on_plate(kind: int, raw: np.ndarray, origin: np.ndarray, unit: float, half: np.ndarray) -> bool:
    """Whether most loaded samples press near the plate, of half sizes (2,) m; True where it is not loaded."""
    off = []
    for piece in pieces(len(raw), raw.shape[1]):
        force, point, torque = _LOADS[kind](raw[piece], origin, unit)
        on = np.abs(force[:, 2]) > LOADED_N
        f, t = force[on], torque[on]
        off.append(np.abs(point[on, :2] + np.column_stack([-t[:, 1], t[:, 0]]) / f[:, 2:3]))
    distance = np.concatenate(off) if off else np.empty((0, 2))
    return not len(distance) or bool((np.median(distance, axis=0, overwrite_input=True) < half + FAR_M).all())


def _moment_unit(c3d: C3dDescription, i: int, kind: int, length_m: float) -> float:
    """N m in the unit of the moment channels (type 1: metres in that of the position), as the file states it."""
    stated = c3d.all_texts("ANALOG:UNITS")
    channel = int(_of_plate(c3d, "CHANNEL", i, CHANNELS[kind])[3]) - 1
    text = stated[channel] if 0 <= channel < len(stated) else ""
    found = length_factor(text) if kind == 1 else moment_factor(text)
    return length_m if found is None or kind == 3 else found


def _calibration(c3d: C3dDescription, i: int, notes: list[str]) -> np.ndarray:
    matrices = c3d.values("FORCE_PLATFORM:CAL_MATRIX")
    if matrices.ndim == 2:
        matrices = matrices[:, :, None]
    if matrices.ndim != 3 or matrices.shape[0] < 6 or matrices.shape[1] < 6 or matrices.shape[2] <= i:
        notes.append(f"Force plate {i + 1} has no calibration matrix: its channels were taken as newtons.")
        return np.eye(6)
    return matrices[:6, :6, i]


def _of_plate(c3d: C3dDescription, name: str, i: int, size: int) -> np.ndarray:
    """The i-th plate's numbers of a parameter, in the file's order."""
    value = c3d.values(f"FORCE_PLATFORM:{name}")
    row = value.shape[0] if name == "CHANNEL" and value.ndim > 1 else size
    flat = value.ravel(order="F")[i * row:i * row + size]
    if len(flat) != size or not (np.abs(flat) < LARGEST).all():
        raise InputError(f"says nothing usable of force plate {i + 1}", file=c3d.path, where=f"FORCE_PLATFORM:{name}")
    return flat


def _channels(c3d: C3dDescription, layout: Layout, i: int, count: int) -> list[int]:
    channels = [int(c) - 1 for c in _of_plate(c3d, "CHANNEL", i, count)]
    if min(channels) < 0 or max(channels) >= layout.channels:
        raise InputError(f"force plate {i + 1} uses analog channels {min(channels) + 1} to {max(channels) + 1}; there "
                         f"are {layout.channels}", file=c3d.path, where="FORCE_PLATFORM:CHANNEL")
    return channels


def _is_bent(corners: np.ndarray) -> bool:
    """Whether the corners do not lie in one rectangle's order: sides that meet at corner 1 are along each other."""
    x, y = corners[0] - corners[1], corners[0] - corners[3]
    return float(np.linalg.norm(np.cross(x, y))) < 0.1 * float(np.linalg.norm(x) * np.linalg.norm(y)) or not x.any()


def _area(corners: np.ndarray) -> float:
    return float(np.linalg.norm(np.cross(corners[2] - corners[0], corners[3] - corners[1])) / 2.0)
