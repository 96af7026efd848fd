"""Markers and plates from the laboratory frame to the world frame: rotation, floor, centre of pressure."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.events import THRESHOLD_N
from vsf_drake.motion.floor_load import floor_load
from vsf_drake.motion.formats.axes import AXES, LEVEL, STRONG_N
from vsf_drake.motion.formats.pieces import pieces, turn
from vsf_drake.motion.formats.raw import RawPlate
from vsf_drake.motion.formats.recording import Plate

BASELINE_N = 5.0
"""An unloaded plate that shows more than this was not zeroed."""
FLOOR_M = 0.02
"""Plates this near z = 0 lie in the floor at 0; farther ones show where the floor is."""
VERTICAL_SHARE = 0.8
"""Of a walking person's ground reaction, at its strongest, this share at least is vertical."""


def rotated(plate: RawPlate, rotation_W: np.ndarray, path: Path, notes: list[str]) -> RawPlate:
    """The plate in W, its force that on the person; the arrays given are those changed.

    Raises:
        InputError: the force is not mainly vertical, or a loaded plate is not level.
    """
    force, torque, point = plate.force, plate.torque, plate.point
    for vectors in (force, torque, point):
        if vectors is not None:
            turn(np.atleast_2d(vectors), rotation_W)
    if plate.twist is not None:
        torque[:, 2] += plate.twist
    corners = None if plate.corners is None else plate.corners @ rotation_W.T
    size = np.linalg.norm(force, axis=1)
    strong = size > max(STRONG_N, 0.3 * size.max(initial=0.0))
    if strong.any():
        mean = force[strong].mean(axis=0)
        if abs(mean[2]) < VERTICAL_SHARE * size[strong].mean():
            along = AXES[int(np.argmax(np.abs(rotation_W.T @ mean)))]
            raise InputError(f"the force of plate {plate.name} is mainly along the laboratory's {along}, which is not "
                             "what was taken as vertical", file=path,
                             right=f"Give laboratory.up (--up), probably {along}")
        if corners is not None and abs(_normal(corners)[2]) < LEVEL:
            angle = np.degrees(np.arccos(min(1.0, abs(_normal(corners)[2]))))
            raise InputError(f"plate {plate.name} is tilted by {angle:.1f} degrees: only level ground is modelled",
                             file=path, right="Use a recording on level plates")
        if mean[2] < 0.0:
            np.negative(force, out=force)
            np.negative(torque, out=torque)
            notes.append(f"The force of plate {plate.name} points down: it was taken as the person's on the plate and "
                         "turned.")
    return RawPlate(plate.name, force, point, torque, corners=corners)


def floor_height(plates: list[RawPlate], path: Path) -> float:
    """z of the floor as the loaded plates show it; 0 where they lie within 20 mm of 0.

    Raises:
        InputError: loaded plates lie at different heights.
    """
    heights = {}
    for plate in plates:
        loaded = plate.force[:, 2] > max(THRESHOLD_N, STRONG_N)
        if not loaded.any() or (plate.corners is None and plate.point is None):
            continue
        surface = plate.corners
        if surface is None:
            surface = np.broadcast_to(plate.point, plate.force.shape)[loaded]
        heights[plate.name] = float(np.median(surface[:, 2]))
    if not heights:
        return 0.0
    low, high = min(heights, key=heights.get), max(heights, key=heights.get)
    if heights[high] - heights[low] > FLOOR_M:
        step = 1e3 * (heights[high] - heights[low])
        raise InputError(f"plate {high} lies {step:.0f} mm above plate {low}: only level ground is modelled", file=path)
    middle = float(np.median(list(heights.values())))
    return middle if abs(middle) > FLOOR_M else 0.0


def on_the_floor(plate: RawPlate, notes: list[str]) -> Plate:
    """Force, centre of pressure on z = 0 and free moment of a plate that `rotated` gave."""
    count = len(plate.force)
    loaded = plate.force[:, 2] > THRESHOLD_N
    cop, moment = np.full((count, 3), np.nan), np.zeros(count)
    if plate.point is not None:
        point = np.broadcast_to(plate.point, plate.force.shape)
        for piece in pieces(count):
            on = loaded[piece]
            cop[piece][on], moment[piece][on] = floor_load(
                point[piece][on], plate.force[piece][on], plate.torque[piece][on])
        height = float(np.median(point[loaded, 2])) if loaded.any() else 0.0
        if abs(height) > 1e-3:
            notes.append(f"Plate {plate.name} lies at {1e3 * height:.1f} mm: its centre of pressure was taken to the "
                         "floor at 0.")
    else:
        moment[loaded] = plate.torque[loaded, 2]
        notes.append(f"There is no centre of pressure for plate {plate.name}.")
    _note_baseline(plate, notes)
    _note_off_plate(plate, cop, notes)
    return Plate(plate.name, plate.force, cop, moment, plate.corners)


def _note_baseline(plate: RawPlate, notes: list[str]) -> None:
    vertical = plate.force[:, 2]
    peak = vertical.max(initial=0.0)
    unloaded = vertical < (0.1 * peak if peak > STRONG_N else STRONG_N)
    if unloaded.sum() < 0.05 * len(vertical):
        return
    rest = np.median(plate.force[unloaded], axis=0)
    if np.linalg.norm(rest) > BASELINE_N:
        notes.append(f"Plate {plate.name} shows ({rest[0]:.1f}, {rest[1]:.1f}, {rest[2]:.1f}) N while it is unloaded; "
                     "nothing was subtracted.")


def _note_off_plate(plate: RawPlate, cop: np.ndarray, notes: list[str]) -> None:
    strong = plate.force[:, 2] > STRONG_N
    if plate.corners is None or not strong.any():
        return
    low, high = plate.corners[:, :2].min(axis=0) - FLOOR_M, plate.corners[:, :2].max(axis=0) + FLOOR_M
    outside = ((cop[strong, :2] < low) | (cop[strong, :2] > high)).any(axis=1).mean()
    if outside > 0.05:
        notes.append(f"The centre of pressure of plate {plate.name} lies off the plate in {100 * outside:.0f} % of the "
                     "loaded samples: its corners, origin or units may be wrong.")


def note_overlaps(plates: list[Plate], notes: list[str]) -> None:
    """Notes pairs of plates whose surfaces overlap by more than 10 mm (their corners may be wrong)."""
    for i, one in enumerate(plates):
        for other in plates[i + 1:]:
            if one.corners_m is not None and other.corners_m is not None and _overlap(one.corners_m, other.corners_m):
                notes.append(f"Plates {one.name} and {other.name} overlap: their corners may be wrong.")


def _overlap(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two rectangles in the floor overlap by more than 10 mm: no side of either separates them."""
    for corners in (one, other):
        for k in (1, 3):
            side = corners[k, :2] - corners[0, :2]
            across = side / np.linalg.norm(side)
            a, b = one[:, :2] @ across, other[:, :2] @ across
            if min(a.max(), b.max()) - max(a.min(), b.min()) < 0.01:
                return False
    return True


def _normal(corners: np.ndarray) -> np.ndarray:
    normal = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    return normal / np.linalg.norm(normal)
