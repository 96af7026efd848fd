"""C3D: markers and force plates of a trial in the binary format of most laboratories.

Read by our own few lines rather than by ezc3d, which needs ten times the file's size in memory and ends the process
(segmentation fault) on some damaged files; the tests compare the two.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.c3d_data import Layout, read_layout, read_points
from vsf_drake.motion.formats.c3d_parameters import C3dDescription, read_description
from vsf_drake.motion.formats.c3d_plates import read_plates
from vsf_drake.motion.formats.labels import first_of_each, without_prefix
from vsf_drake.motion.formats.raw import RawMarkers, RawTrial
from vsf_drake.motion.formats.units import file_length_factor

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
