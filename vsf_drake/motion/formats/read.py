"""Any laboratory's trial file to a `Recording` in the world frame: axes, floor, centre of
pressure."""

from __future__ import annotations

import re
from itertools import combinations
from pathlib import Path

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.base.sentences import say
from vsf_drake.motion.events import THRESHOLD_N, common
from vsf_drake.motion.formats import MARKER_FILES
from vsf_drake.motion.formats.c3d import c3d_labels, read_c3d
from vsf_drake.motion.formats.forces import FORCE_FILES, read_forces
from vsf_drake.motion.formats.recording import Plate, RawPlate, RawTrial, Recording, floor_load
from vsf_drake.motion.formats.tables import read_trc, trc_labels

# of one person's markers
LARGEST_M = 10.0
SMALLEST_M = 0.02
SMALLEST_WHOLE_M = 0.25
TALLEST_M = 2.5  # markers that reach farther are not only a person's
FARTHEST_M = 200.0
AXES = "xyz"
TRAVEL_M = 0.5  # a person whose markers travel farther than this walks through the laboratory
LEVEL = 0.999  # cosine of the tilt (2.6 degrees) up to which a plate is level
# so many markers are taken for a person's (both legs at least), who extends most along the vertical
WHOLE_MARKERS = 12
# a person's height is never less than this share of their length or width (arms spread)
NARROW = 0.6
# markers whose lowest lies this far below the floor, their middle below it too, stand on their head
BELOW_M = 0.3
# labels of feet, and of what is above the legs, however it is called
_FEET = re.compile(r"hee|toe|cal|mt\d|mal|ank|foot", re.IGNORECASE)
_ABOVE = re.compile(r"asi|psi|sacr|head|hd|sho(?!e)|c7|clav|acr|ster", re.IGNORECASE)
STRONG_N = 100.0
BASELINE_N = 5.0  # an unloaded plate that shows more than this was not zeroed
FLOOR_M = 0.02  # plates this near z = 0 lie in the floor at 0; farther ones show where the floor is
# of a walking person's ground reaction, at its strongest, this share at least is vertical
VERTICAL_SHARE = 0.8


def read_trial(
    path: str | Path,
    *,
    forces: str | Path | None = None,
    up: str | None = None,
    forward: str | None = None,
    length_unit: str | None = None,
) -> Recording:
    """Reads markers and force plates of a trial into W (x forward, y left, z up, floor at z = 0),
    in m, N and N m.

    Args:
        path: a .c3d or .trc file; or a force file alone (.mot, .sto, .csv, Cortex .forces).
        forces: the force file beside a .trc, or beside a .c3d without plates, in the same
            laboratory frame.
        up: the laboratory's vertical axis, "x", "y" or "z", with "-" where it points down; None as
            the file says.
        forward: its axis of walking; None for that along which the markers travel, or its own where
            they do not.
        length_unit: of positions ("mm", "m", "cm", "in"), instead of what the file states.
    """
    path = Path(path)
    force_path = None if forces is None else Path(forces)
    suffix = path.suffix.lower()
    if suffix in FORCE_FILES:
        if force_path is not None:
            raise InputError(
                "is a force file itself",
                file=path,
                right="Give the marker file (.c3d or .trc) first",
            )
        trial = read_forces(path, length_unit=length_unit)
        force_path = path
    elif suffix in MARKER_FILES:
        trial = _read_markers(path, length_unit)
        if force_path is not None:
            _join(trial, path, force_path, length_unit)
    else:
        raise InputError(
            f"files that end in {suffix or 'nothing'} are not read",
            file=path,
            right=f"Use {', '.join(MARKER_FILES + FORCE_FILES)}",
        )
    return _in_world(trial, path, force_path, up=up, forward=forward)


def list_labels(path: str | Path) -> list[str]:
    """The labels of the markers in a .c3d or .trc file, in its order; InputError for any other
    file."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in MARKER_FILES:
        raise InputError("is no marker file", file=path, right=f"Use {' or '.join(MARKER_FILES)}")
    return c3d_labels(path) if suffix == ".c3d" else trc_labels(path)


def _read_markers(path: Path, length_unit: str | None) -> RawTrial:
    """A marker file in the user's unit; in its own where only that makes a person of it (a force
    file's was meant)."""
    read = read_c3d if path.suffix.lower() == ".c3d" else read_trc
    trial = read(path, length_unit=length_unit)
    try:
        _check_size(trial, path)
    except InputError as wrong:
        if length_unit is None:
            raise
        try:
            trial = read(path)
            _check_size(trial, path)
        except InputError:
            raise wrong from None
        trial.notes += say("files", "own_unit", file=path.name, unit=length_unit)
    return trial


def _check_size(trial: RawTrial, path: Path) -> None:
    if trial.positions is None:
        return
    reach = float(np.linalg.norm(_extents(trial.positions)))
    count = len(trial.labels)
    smallest = SMALLEST_WHOLE_M if count >= WHOLE_MARKERS else SMALLEST_M
    if np.isfinite(reach) and (reach > LARGEST_M or (count >= 3 and reach < smallest)):
        raise InputError(
            f"the markers reach over {reach:.4g} m, which no person does",
            file=path,
            right="The stated unit is wrong: give laboratory.length_unit (--length-unit)",
        )
    farthest = max(
        np.fmax.reduce(trial.positions, axis=None, initial=0.0),
        -np.fmin.reduce(trial.positions, axis=None, initial=0.0),
    )
    if farthest > FARTHEST_M:
        raise InputError(
            f"a marker lies {farthest:.4g} m from the origin",
            file=path,
            right="Is the unit right? Otherwise give laboratory.length_unit (--length-unit)",
        )


def _join(trial: RawTrial, path: Path, force_path: Path, length_unit: str | None) -> None:
    if trial.plates:
        raise InputError(
            f"has {len(trial.plates)} force plates of its own",
            file=path,
            where="forces",
            right=f"Leave {force_path.name} out",
        )
    if force_path.suffix.lower() not in FORCE_FILES:
        raise InputError("is no force file", file=force_path, right=f"Use {', '.join(FORCE_FILES)}")
    more = read_forces(force_path, length_unit=length_unit)
    trial.plates = more.plates
    trial.force_rate_hz = more.force_rate_hz
    trial.force_start_s = more.force_start_s
    trial.notes += more.notes
    if trial.positions is None:
        return
    if trial.force_start_s is None:
        trial.force_start_s = trial.marker_start_s
        trial.notes += say("files", "untimed", file=force_path.name)
    seen, felt = (
        (start, start + (samples - 1) / rate)
        for start, samples, rate in (
            (trial.marker_start_s, len(trial.positions), trial.marker_rate_hz),
            (trial.force_start_s, len(trial.plates[0].force), trial.force_rate_hz),
        )
    )
    both = common(seen, felt)
    if both is None:
        raise InputError(
            f"covers {felt[0]:g} to {felt[1]:g} s, the markers {seen[0]:g} to {seen[1]:g} s",
            file=force_path,
            right="Markers and forces must overlap in time: are they of one trial?",
        )
    if max(abs(seen[0] - felt[0]), abs(seen[1] - felt[1])) > 1.0 / trial.marker_rate_hz:
        trial.notes += say("files", "cover", seen=seen, felt=felt, both=both)


def _in_world(
    trial: RawTrial, path: Path, force_path: Path | None, *, up: str | None, forward: str | None
) -> Recording:
    notes = trial.notes
    rotation = _rotation_to_world(trial, path, up=up, forward=forward)
    raw = [_rotated(plate, rotation, force_path or path, notes) for plate in trial.plates]
    floor = _floor_height(raw, force_path or path)
    notes += say("files", "floor", height_m=floor) if floor else []
    for plate in raw:
        for points in (plate.point, plate.corners):
            if points is not None:
                points[..., 2] -= floor
    plates = [_on_the_floor(plate, notes) for plate in raw]
    notes += [
        note
        for one, other in combinations(plates, 2)
        if _overlap(one.corners_m, other.corners_m)
        for note in say("files", "overlap", one=one.name, other=other.name)
    ]
    markers: dict[str, np.ndarray] = {}
    if trial.positions is not None:
        for label, path_W in zip(trial.labels, trial.positions.transpose(1, 0, 2), strict=True):
            markers[label] = path_W @ rotation.T - [0.0, 0.0, floor]
    return Recording(
        path,
        markers,
        None if trial.positions is None else trial.marker_rate_hz,
        tuple(plates),
        trial.force_rate_hz if plates else None,
        trial.marker_start_s,
        (trial.force_start_s or 0.0) if plates else 0.0,
        force_path,
        rotation,
        tuple(notes),
        trial.person,
    )


# From a laboratory's axes to the world frame: which way is up, which way the person goes.


def _axis_vector(text: str, where: str) -> np.ndarray:
    """The unit vector of a signed axis such as "z", "+Z" or "-y"; refused if it is none."""
    plain = str(text).strip().lower()
    sign = -1.0 if plain.startswith("-") else 1.0
    plain = plain[1:] if plain[:1] in ("+", "-") else plain
    if len(plain) != 1 or plain not in AXES:
        raise InputError(
            f"{text!r} is no axis",
            where=where,
            right="Use x, y or z, with - in front where it points back",
        )
    return np.asarray(sign * np.eye(3)[AXES.index(plain)])


def axis_name(vector: np.ndarray) -> str:
    """The signed name of a laboratory axis, "+x" to "-z"."""
    i = int(np.argmax(np.abs(vector)))
    return ("-" if vector[i] < 0.0 else "+") + AXES[i]


def _rotation_to_world(
    trial: RawTrial, path: Path, *, up: str | None, forward: str | None
) -> np.ndarray:
    """(3, 3) that takes a vector of the laboratory frame to W, with notes on how it was chosen."""
    vertical = (
        _axis_vector(up, "laboratory.up (--up)") if up is not None else _vertical(trial, path)
    )
    if trial.positions is not None:
        _check_upright(trial.positions, vertical, path)
    where = "laboratory.forward (--forward)"
    ahead = _ahead(trial, vertical) if forward is None else _axis_vector(forward, where)
    if abs(ahead @ vertical) > 0.5:
        raise InputError(
            f"forward ({axis_name(ahead)}) lies along the vertical ({axis_name(vertical)})",
            file=path,
            where=where,
            right="Give a horizontal axis",
        )
    return np.array([ahead, np.cross(vertical, ahead), vertical])


def _vertical(trial: RawTrial, path: Path) -> np.ndarray:
    """As the file states it, else normal to the plates, else by the format's convention, or along
    the only axis along which a person's markers extend far enough; turned where markers and floor
    say so.
    """
    surfaces = [plate.corners for plate in trial.plates if plate.corners is not None]
    normals = np.abs([_normal(corners) for corners in surfaces]).reshape(-1, 3)
    axis = int(np.argmax(normals.sum(axis=0)))
    level = len(normals) > 0 and bool((normals[:, axis] > LEVEL).all())
    up = None if trial.up is None else _axis_vector(trial.up, "Y_SCREEN")
    why = "stated"
    if level and (up is None or abs(up[axis]) <= LEVEL):
        up = np.asarray(np.eye(3)[axis])
        why = "plates"
    elif up is None:
        tall = _tall_axes(trial)
        up = None if trial.up_convention is None else _axis_vector(trial.up_convention, "up")
        if len(tall) == 1 and (up is None or not up[tall[0]]):
            up = np.asarray(np.eye(3)[tall[0]])
            why = "markers"
    floor = np.mean([corners @ up for corners in surfaces]) if level else None
    side = 0 if up is None else _side(trial, up, 0.0 if why == "markers" else floor)
    if up is None or (why == "markers" and not side):
        raise InputError(
            "does not say which axis is vertical",
            file=path,
            right="Give laboratory.up (--up): x, y or z",
        )
    up = -up if side < 0 else up
    if side < 0 or why != "stated":
        trial.notes += say(
            "files",
            "vertical",
            file=path.name,
            axis=axis_name(up),
            stated=trial.up,
            why=why,
            turned=side < 0,
        )
    return up


def _whole(trial: RawTrial) -> bool:
    """Whether there are so many markers that they are taken for a person's."""
    return trial.positions is not None and len(trial.labels) >= WHOLE_MARKERS


def _tall_axes(trial: RawTrial) -> np.ndarray:
    """The axes along which a person's markers extend far enough for the vertical; all three where
    they do not show a person."""
    reach = np.full(3, np.nan)
    if trial.positions is not None and _whole(trial):
        reach = _extents(trial.positions)
    tall = np.flatnonzero(reach >= NARROW * reach.max())
    return tall if reach.max() < TALLEST_M else np.arange(3)


def _side(trial: RawTrial, up: np.ndarray, floor: float | None) -> int:
    """1 where a person stands upright along `up`, -1 where on their head, 0 where the markers do
    not show it: pelvis, trunk and head above the feet, by their labels; else all of them above a
    floor at `floor` m, the lowest near it."""
    if trial.positions is None or not _whole(trial):
        return 0
    lower, upper = (
        _heights(trial.positions[:, [bool(kind.search(label)) for label in trial.labels]], up)[1]
        for kind in (_FEET, _ABOVE)
    )
    if abs(upper - lower) > BELOW_M:
        return 1 if upper > lower else -1
    lowest, _, highest = _heights(trial.positions, up)
    if floor is None or not np.isfinite(lowest):
        return 0
    stands = abs(lowest - floor) < BELOW_M < highest - floor
    hangs = abs(highest - floor) < BELOW_M < floor - lowest
    return int(stands) - int(hangs)


def _heights(positions: np.ndarray, up: np.ndarray) -> tuple[float, float, float]:
    """The lowest, middle and highest marker along `up` (m), as medians over frames; NaN where none
    is seen."""
    heights = positions[:: max(1, len(positions) // 200)] @ up
    seen = heights[~np.isnan(heights).all(axis=1)]
    if not seen.size:
        return np.nan, np.nan, np.nan
    lowest, highest = (float(np.median(end(seen, axis=1))) for end in (np.nanmin, np.nanmax))
    return lowest, float(np.nanmedian(seen)), highest


def _normal(corners: np.ndarray) -> np.ndarray:
    normal = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    return np.asarray(normal / np.linalg.norm(normal))


def _extents(positions: np.ndarray) -> np.ndarray:
    """(3,) m, the median over frames of how far the markers seen (at least 3) reach along each
    axis; NaN if none."""
    some = positions[:: max(1, len(positions) // 200)]
    some = some[(~np.isnan(some[..., 0])).sum(axis=1) >= 3]
    return (
        np.median(np.nanmax(some, axis=1) - np.nanmin(some, axis=1), axis=0)
        if len(some)
        else np.full(3, np.nan)
    )


def _check_upright(positions: np.ndarray, vertical: np.ndarray, path: Path) -> None:
    reach = _extents(positions)
    if positions.shape[1] < WHOLE_MARKERS or not np.isfinite(reach).all():
        return
    along = reach[int(np.argmax(np.abs(vertical)))]
    if along < NARROW * reach.max():
        tall = AXES[int(np.argmax(reach))]
        raise InputError(
            f"the markers extend {reach.max():.2f} m along {tall} and only {along:.2f} m along "
            f"{axis_name(vertical)}, which was taken as up",
            file=path,
            right=f"Give laboratory.up (--up), probably {tall}",
        )
    lowest, middle, _ = _heights(positions, vertical)
    if lowest < -BELOW_M and middle < 0.0:
        raise InputError(
            f"the markers' middle lies {-middle:.2f} m below the floor, with "
            f"{axis_name(vertical)} as up",
            file=path,
            right="Give laboratory.up (--up), with its sign",
        )


def _ahead(trial: RawTrial, vertical: np.ndarray) -> np.ndarray:
    """The horizontal laboratory axis nearest to the way the markers travel; the laboratory's own if
    they do not."""
    own = np.asarray(np.eye(3)[0 if abs(vertical[0]) < 0.5 else 1])
    if trial.positions is None:
        return own
    travels = []
    for place in trial.positions.transpose(1, 0, 2):
        seen = np.flatnonzero(~np.isnan(place[:, 0]))
        if len(seen) >= 2 and seen[-1] - seen[0] >= 0.2 * len(place):
            travels.append(place[seen[-1]] - place[seen[0]])
    way = np.median(travels, axis=0) if travels else np.zeros(3)
    way = way - (way @ vertical) * vertical
    i = int(np.argmax(np.abs(way)))
    walks = np.linalg.norm(way) > TRAVEL_M
    ahead = np.asarray(np.sign(way[i]) * np.eye(3)[i]) if walks else own
    trial.notes += say(
        "files", "forward", axis=axis_name(ahead), travel_m=abs(way[i]) if walks else None
    )
    return ahead


# Plates in the world frame.


def _rotated(plate: RawPlate, rotation_W: np.ndarray, path: Path, notes: list[str]) -> RawPlate:
    """The plate in W, its force that on the person, mainly vertical."""
    force = plate.force @ rotation_W.T
    torque = plate.torque @ rotation_W.T
    point = None if plate.point is None else plate.point @ rotation_W.T
    if plate.twist is not None:
        torque[:, 2] += plate.twist
    corners = None if plate.corners is None else plate.corners @ rotation_W.T
    size = np.linalg.norm(force, axis=1)
    strong = size > max(STRONG_N, 0.3 * size.max(initial=0.0))
    if strong.any():
        mean = force[strong].mean(axis=0)
        if abs(mean[2]) < VERTICAL_SHARE * size[strong].mean():
            along = AXES[int(np.argmax(np.abs(rotation_W.T @ mean)))]
            raise InputError(
                f"the force of plate {plate.name} is mainly along the laboratory's {along}, "
                "which is not what was taken as vertical",
                file=path,
                right=f"Give laboratory.up (--up), probably {along}",
            )
        if corners is not None and abs(_normal(corners)[2]) < LEVEL:
            angle = np.degrees(np.arccos(min(1.0, abs(_normal(corners)[2]))))
            raise InputError(
                f"plate {plate.name} is tilted by {angle:.1f} degrees: only level ground is "
                "modelled",
                file=path,
                right="Use a recording on level plates",
            )
        if mean[2] < 0.0:
            np.negative(force, out=force)
            np.negative(torque, out=torque)
            notes += say("files", "turned", plate=plate.name)
    return RawPlate(plate.name, force, point, torque, corners=corners)


def _floor_height(plates: list[RawPlate], path: Path) -> float:
    """z of the floor as the loaded plates show it; 0 where they lie within 20 mm of 0; refused at
    several heights."""
    heights = {}
    for plate in plates:
        loaded = plate.force[:, 2] > STRONG_N
        surface = plate.corners
        if surface is None and plate.point is not None:
            surface = np.broadcast_to(plate.point, plate.force.shape)[loaded]
        if loaded.any() and surface is not None:
            heights[plate.name] = float(np.median(surface[:, 2]))
    if not heights:
        return 0.0
    low, high = (pick(heights, key=lambda name: heights[name]) for pick in (min, max))
    if heights[high] - heights[low] > FLOOR_M:
        step = 1e3 * (heights[high] - heights[low])
        raise InputError(
            f"plate {high} lies {step:.0f} mm above plate {low}: only level ground is modelled",
            file=path,
        )
    middle = float(np.median(list(heights.values())))
    return middle if abs(middle) > FLOOR_M else 0.0


def _on_the_floor(plate: RawPlate, notes: list[str]) -> Plate:
    """Force, centre of pressure on z = 0 and free moment of a plate in W, with notes on what looks
    wrong."""
    vertical = plate.force[:, 2]
    corners = plate.corners
    loaded = vertical > THRESHOLD_N
    strong = vertical > STRONG_N
    cop = np.full((len(vertical), 3), np.nan)
    moment = np.zeros(len(vertical))
    height = 0.0
    outside = 0.0
    if plate.point is None:
        moment[loaded] = plate.torque[loaded, 2]
    else:
        point = np.broadcast_to(plate.point, plate.force.shape)
        cop[loaded], moment[loaded] = floor_load(
            point[loaded], plate.force[loaded], plate.torque[loaded]
        )
        height = float(np.median(point[loaded, 2])) if loaded.any() else 0.0
    peak = vertical.max(initial=0.0)
    unloaded = vertical < (0.1 * peak if peak > STRONG_N else STRONG_N)
    rest = (
        np.median(plate.force[unloaded], axis=0)
        if unloaded.sum() >= max(1.0, 0.05 * len(vertical))
        else np.zeros(3)
    )
    if corners is not None and strong.any():
        low = corners[:, :2].min(axis=0) - FLOOR_M
        high = corners[:, :2].max(axis=0) + FLOOR_M
        outside = ((cop[strong, :2] < low) | (cop[strong, :2] > high)).any(axis=1).mean()
    notes += say(
        "files",
        "plate",
        name=plate.name,
        cop=plate.point is not None,
        height_m=height,
        outside=outside,
        rest=rest if np.linalg.norm(rest) > BASELINE_N else None,
    )
    return Plate(plate.name, plate.force, cop, moment, corners)


def _overlap(one: np.ndarray | None, other: np.ndarray | None) -> bool:
    """Whether two rectangles in the floor overlap by more than 10 mm."""
    if one is None or other is None:
        return False
    for corners in (one, other):
        for k in (1, 3):
            side = corners[k, :2] - corners[0, :2]
            across = side / np.linalg.norm(side)
            a = one[:, :2] @ across
            b = other[:, :2] @ across
            if min(a.max(), b.max()) - max(a.min(), b.min()) < 0.01:
                return False
    return True
