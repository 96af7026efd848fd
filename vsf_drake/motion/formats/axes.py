"""From a laboratory's axes to the world frame: which way is up, which way the person goes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.recording import RawMarkers, RawTrial

AXES = "xyz"
TRAVEL_M = 0.5
"""A person whose markers travel farther than this walks through the laboratory."""
LEVEL = 0.999
"""Cosine of the tilt (2.6 degrees) up to which a plate is level."""
WHOLE_MARKERS = 12
"""So many markers are taken for a person's (both legs at least), who extends most along the vertical."""
NARROW = 0.6
"""A standing or walking person's height is never less than this share of their length or width (arms spread)."""
BELOW_M = 0.3
"""Markers whose lowest lies this far below the floor, and whose middle is below it too, stand on their head."""
STRONG_N = 100.0


def axis_vector(text: str, where: str) -> np.ndarray:
    """The unit vector of a signed axis such as "z", "+Z" or "-y".

    Raises:
        InputError: the text is no axis.
    """
    plain = str(text).strip().lower()
    sign = -1.0 if plain.startswith("-") else 1.0
    plain = plain[1:] if plain[:1] in ("+", "-") else plain
    if len(plain) != 1 or plain not in AXES:
        raise InputError(f"{text!r} is no axis", where=where,
                         right="Use x, y or z, with - in front where it points back")
    return sign * np.eye(3)[AXES.index(plain)]


def axis_name(vector: np.ndarray) -> str:
    """The signed name of a laboratory axis, "+x" to "-z"."""
    i = int(np.argmax(np.abs(vector)))
    return ("-" if vector[i] < 0.0 else "+") + AXES[i]


def rotation_to_world(trial: RawTrial, path: Path, *, up: str | None, forward: str | None,
                      notes: list[str]) -> np.ndarray:
    """(3, 3) that takes a vector of the laboratory frame to W, and notes on how it was chosen.

    Raises:
        InputError: `up` or `forward` is no axis, they are not perpendicular, nothing tells the vertical, or the
            markers contradict it.
    """
    vertical = axis_vector(up, "laboratory.up (--up)") if up is not None else _vertical(trial, path, notes)
    if trial.markers is not None:
        _check_upright(trial.markers, vertical, path)
    ahead = _ahead(trial.markers, vertical, notes) if forward is None else axis_vector(
        forward, "laboratory.forward (--forward)")
    if abs(ahead @ vertical) > 0.5:
        raise InputError(f"forward ({axis_name(ahead)}) lies along the vertical ({axis_name(vertical)})",
                         file=path, where="laboratory.forward (--forward)", right="Give a horizontal axis")
    return np.array([ahead, np.cross(vertical, ahead), vertical])


def _vertical(trial: RawTrial, path: Path, notes: list[str]) -> np.ndarray:
    """As the file states it, else normal to the plates, else by the format's convention."""
    normal = _plates_normal(trial)
    if trial.up is not None:
        stated = axis_vector(trial.up, "Y_SCREEN")
        if normal is None or abs(stated @ normal) > LEVEL:
            return stated
        notes.append(f"{path.name} states {trial.up} as the screen's vertical, but its force plates lie across "
                     f"{axis_name(normal)}: this was taken as up.")
        return normal
    if normal is not None:
        notes.append(f"{path.name} does not state the vertical; its force plates lie across {axis_name(normal)}, which "
                     "was taken as up.")
        return normal
    if trial.up_convention is not None:
        return axis_vector(trial.up_convention, "up")
    raise InputError("does not say which axis is vertical", file=path, right="Give laboratory.up (--up): x, y or z")


def _plates_normal(trial: RawTrial) -> np.ndarray | None:
    """The positive axis across which all plates lie; None where there is none."""
    corners = [p.corners for p in (trial.forces.plates if trial.forces else []) if p.corners is not None]
    if not corners:
        return None
    normals = np.abs([np.cross(c[2] - c[0], c[3] - c[1]) for c in corners])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    axis = int(np.argmax(normals.sum(axis=0)))
    return np.eye(3)[axis] if (normals[:, axis] > LEVEL).all() else None


def extents(positions: np.ndarray) -> np.ndarray:
    """(3,) m, the median over frames of how far the markers seen (at least 3) reach along each axis; NaN if none."""
    step = max(1, len(positions) // 200)
    some = positions[::step]
    some = some[(~np.isnan(some[..., 0])).sum(axis=1) >= 3]
    return np.median(np.nanmax(some, axis=1) - np.nanmin(some, axis=1), axis=0) if len(some) else np.full(3, np.nan)


def _check_upright(markers: RawMarkers, vertical: np.ndarray, path: Path) -> None:
    if len(markers.labels) < WHOLE_MARKERS:
        return
    reach = extents(markers.positions)
    if not np.isfinite(reach).all():
        return
    axis = int(np.argmax(np.abs(vertical)))
    if reach[axis] < NARROW * reach.max():
        tall = AXES[int(np.argmax(reach))]
        raise InputError(f"the markers extend {reach.max():.2f} m along {tall} and only {reach[axis]:.2f} m along "
                         f"{axis_name(vertical)}, which was taken as up", file=path,
                         right=f"Give laboratory.up (--up), probably {tall}")
    heights = markers.positions[::max(1, len(markers.positions) // 200)] @ vertical
    seen = ~np.isnan(heights).all(axis=1)
    lowest, middle = np.median(np.nanmin(heights[seen], axis=1)), np.nanmedian(heights)
    if lowest < -BELOW_M and middle < 0.0:
        raise InputError(f"the markers' middle lies {-middle:.2f} m below the floor, with {axis_name(vertical)} as up",
                         file=path, right="Give laboratory.up (--up), with its sign")


def travel(markers: RawMarkers) -> np.ndarray:
    """(3,) m that the markers travel during the recording: the median of their own, gaps left out."""
    steps = []
    for k in range(len(markers.labels)):
        place = markers.positions[:, k]
        seen = np.flatnonzero(~np.isnan(place[:, 0]))
        if len(seen) >= 2 and seen[-1] - seen[0] >= 0.2 * len(place):
            steps.append(place[seen[-1]] - place[seen[0]])
    return np.median(steps, axis=0) if steps else np.zeros(3)


def _ahead(markers: RawMarkers | None, vertical: np.ndarray, notes: list[str]) -> np.ndarray:
    """The horizontal laboratory axis nearest to the way the markers travel; the laboratory's own if they do not."""
    own = np.eye(3)[0] if abs(vertical[0]) < 0.5 else np.eye(3)[1]
    if markers is None:
        return own
    way = travel(markers)
    way = way - (way @ vertical) * vertical
    distance = float(np.linalg.norm(way))
    if distance <= TRAVEL_M:
        notes.append(f"The markers do not travel: forward is the laboratory's {axis_name(own)}.")
        return own
    ahead = np.zeros(3)
    i = int(np.argmax(np.abs(way)))
    ahead[i] = np.sign(way[i])
    notes.append(f"Forward is the laboratory's {axis_name(ahead)}, along which the markers travel {abs(way[i]):.2f} m.")
    return ahead
