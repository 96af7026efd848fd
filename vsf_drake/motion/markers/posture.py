"""The stretch of a recording from which a person is calibrated, its prosthesis under load, and
which way one faces."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.sentences import say
from vsf_drake.model.model_file import bending_stiffness
from vsf_drake.model.parameters import GRAVITY, MID_FULCRUM_MM, FootParameters, ModelParameters
from vsf_drake.motion.formats.read import axis_name
from vsf_drake.motion.formats.recording import SIDES, Recording
from vsf_drake.motion.markers.maps import FoundMarkers, MarkerMap

# length of the stretch that is averaged (a choice: longer than a period of postural sway's fast
# part)
QUIET_S = 1.0
NOT_NEEDED = ("trochanter", "head_top")  # roles that the anatomical frames do without
SEEN_PART = 0.2  # a marker counts if it is seen in this part of the stretch at least (a choice)
# most RMS distance of a marker from its mean there: quiet standing sways by millimetres (a choice)
STILL_M = 0.010
# a recording in which both heels travel farther than this against the pelvis is a walk (a choice)
STEPPING_M = 0.20
# heel and forefoot marker of a flat foot stand at most so far above their lowest (a choice)
LOW_M = 0.04
# and rise or sink more slowly than this, over twice the lag (a choice)
SLOW_M_PER_S = 0.10
LAG_S = 0.02
FLAT_M = 0.005  # of those frames, such near the median heights are the flat ones (a choice)
# of a foot on the floor, thick shoes too (a choice)
HIGHEST_FOOT_MARKER_M = 0.15
LOWEST_FOOT_MARKER_M = -0.02


@dataclass(frozen=True, eq=False)
class Posture:
    """Where markers are, from which anatomical frames are made."""

    labelled: FoundMarkers  # what the labels are
    points: dict[str, np.ndarray]
    """(n, 3) m by label; n = 1, the mean, if `still`, else all of a walk, NaN if unseen"""
    still: bool  # whether the person stood
    foot_flat: dict[str, np.ndarray]  # (n,) bool by side
    start_s: float  # the stretch
    end_s: float
    notes: tuple[str, ...] = ()

    def at(self, role: str) -> np.ndarray | None:
        """(n, 3) of the marker with this role, None without one."""
        return self.points.get(self.labelled.roles.get(role, ""))

    def needed(self, role: str) -> np.ndarray:
        """(n, 3) of the marker with a role that every map must have."""
        return self.points[self.labelled.roles[role]]

    def pelvis_back(self) -> np.ndarray:
        """(n, 3) midway between the PSIS, or the sacrum's marker without them."""
        right, left = (self.at(f"psis_{side}") for side in SIDES)
        return self.needed("sacrum") if right is None or left is None else 0.5 * (right + left)

    def forefoot(self, side: str) -> np.ndarray:
        """(n, 3), the mean of the markers to which the foot points."""
        return np.asarray(
            np.mean([self.points[label] for label in forefoot_labels(self.labelled, side)], axis=0)
        )


def forefoot_labels(labelled: FoundMarkers, side: str) -> tuple[str, ...]:
    """The markers whose mean the foot points to: second metatarsal head, else first and fifth, else
    toe tip."""
    choices = (("toe",), ("met1", "met5"), ("toe_tip",))
    roles = next(
        roles for roles in choices if all(f"{role}_{side}" in labelled.roles for role in roles)
    )
    return tuple(labelled.roles[f"{role}_{side}"] for role in roles)


def find_posture(recording: Recording, labelled: FoundMarkers) -> Posture:
    """The quietest `QUIET_S` of the recording, averaged; or the whole of it if it is a walk; feet
    on the floor z = 0.
    """
    labels = list(
        dict.fromkeys(
            (*labelled.roles.values(), *(m for s in labelled.segments.values() for m in s))
        )
    )
    needed = {label for role, label in labelled.roles.items() if not role.startswith(NOT_NEEDED)}
    x = np.stack([recording.markers[label] for label in labels], axis=1)
    rate = recording.marker_rate_hz or 1.0
    width = max(1, min(len(x), round(QUIET_S * rate)))
    start, moved = _quietest(
        x, width, np.array([label in needed for label in labels]), labels, recording
    )
    time = recording.marker_time_s
    worst = int(np.nanargmax(moved))
    if moved[worst] <= STILL_M:
        mean, seen = _mean(x[start : start + width])
        points = {label: mean[None, k] for k, label in enumerate(labels) if seen[k] >= SEEN_PART}
        posture = Posture(
            labelled,
            points,
            True,
            {side: np.array([True]) for side in SIDES},
            float(time[start]),
            float(time[start + width - 1]),
        )
    elif _steps(recording, labelled) > STEPPING_M:
        points = {label: x[:, k] for k, label in enumerate(labels)}
        flat = {side: _foot_flat(points, labelled, side, recording) for side in SIDES}
        posture = Posture(
            labelled,
            points,
            False,
            flat,
            float(time[0]),
            float(time[-1]),
            tuple(say("markers", "walk_for_standing")),
        )
    else:
        raise InputError(
            f"nobody stands still: in the quietest {width / rate:.1f} s it moves "
            f"{1e3 * moved[worst]:.0f} mm RMS",
            file=recording.path,
            where=f"marker {labels[worst]}, from {time[start]:.2f} s",
            right=(
                f"A standing trial needs {QUIET_S:g} s in which no marker moves more than "
                f"{1e3 * STILL_M:.0f} mm RMS"
            ),
        )
    for side in SIDES:
        for label in (labelled.roles[f"heel_{side}"], *forefoot_labels(labelled, side)):
            height = float(np.nanmean(posture.points[label][posture.foot_flat[side], 2]))
            require(
                LOWEST_FOOT_MARKER_M <= height <= HIGHEST_FOOT_MARKER_M,
                f"is {height:.3f} m above the floor while the foot is flat on it",
                f"marker {label}",
                "The floor must be at height zero, in the file's unit; "
                "check the unit, the upward axis and the laboratory's origin",
                file=recording.path,
            )
    return posture


def _quietest(
    x: np.ndarray, width: int, needed: np.ndarray, labels: list[str], recording: Recording
) -> tuple[int, np.ndarray]:
    seen = np.isfinite(x).all(axis=2)
    # small numbers: squares are subtracted
    from_mean = np.where(seen[..., None], x - np.nan_to_num(_mean(x)[0]), 0.0)

    def window_sum(values: np.ndarray) -> np.ndarray:
        total = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
        return np.asarray(total[width:] - total[:-width])

    # Variance over every window at once: E|x|^2 - |E x|^2, of sums that run along.
    count = window_sum(seen.astype(float))
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = window_sum(from_mean) / count[..., None]
        moved = np.sqrt(
            np.maximum(
                window_sum(np.sum(from_mean**2, axis=2)) / count - np.sum(mean**2, axis=2), 0.0
            )
        )
    counted = count >= SEEN_PART * width
    usable = counted[:, needed].all(axis=1)
    if not usable.any():
        rare = int(np.argmin(np.where(needed, counted.mean(axis=0), np.inf)))
        raise InputError(
            f"is not seen together with the others within any {width} frames",
            file=recording.path,
            where=f"marker {labels[rare]}",
            right="The standing trial must show all markers at a time",
        )
    most = np.where(usable, np.max(np.where(counted, moved, 0.0), axis=1), np.inf)
    start = int(np.argmin(most))
    return start, np.where(counted[start], moved[start], 0.0)


def _mean(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean position of each marker over the frames (NaN if never seen) and the part of frames in
    which it is seen."""
    seen = np.isfinite(x).all(axis=2)
    count = seen.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(seen[..., None], x, 0.0).sum(axis=0) / count[:, None], count / len(x)


def _steps(recording: Recording, labelled: FoundMarkers) -> float:
    at = {role: recording.markers[label][:, :2] for role, label in labelled.roles.items()}
    away = [at[f"heel_{side}"] - 0.5 * (at["asis_right"] + at["asis_left"]) for side in SIDES]
    seen = [path[np.isfinite(path).all(axis=1)] for path in away]
    return min(float(np.max(np.ptp(path, axis=0))) if len(path) else 0.0 for path in seen)


def _foot_flat(
    points: dict[str, np.ndarray], labelled: FoundMarkers, side: str, recording: Recording
) -> np.ndarray:
    heights = [
        points[labelled.roles[f"heel_{side}"]][:, 2],
        np.mean([points[label][:, 2] for label in forefoot_labels(labelled, side)], axis=0),
    ]
    hz = recording.marker_rate_hz or 1.0
    lag = max(1, round(LAG_S * hz))
    quiet = np.ones(len(heights[0]), dtype=bool)
    for z in heights:
        require(
            np.isfinite(z).any(),
            "heel and forefoot are never seen",
            f"{side} foot",
            file=recording.path,
        )
        rate = np.full(len(z), np.nan)
        rate[lag:-lag] = (z[2 * lag :] - z[: -2 * lag]) / (2 * lag) * hz
        with np.errstate(invalid="ignore"):
            quiet &= (np.abs(rate) < SLOW_M_PER_S) & (z < np.nanmin(z) + LOW_M)
    require(
        quiet.any(),
        "is never flat on the floor, so its sole cannot be told",
        f"{side} foot",
        "Calibrate from a standing trial or a longer walk",
        file=recording.path,
    )
    flat = quiet & np.all([np.abs(z - np.median(z[quiet])) <= FLAT_M for z in heights], axis=0)
    flat = flat if flat.any() else quiet
    leg = [
        label
        for role, label in labelled.roles.items()
        if not role.startswith(NOT_NEEDED)
        and (role.startswith(("asis", "psis", "sacrum")) or role.endswith(side))
    ]
    seen = np.stack([np.isfinite(points[label]).all(axis=1) & flat for label in leg])
    require(
        seen.all(axis=0).any(),
        f"is not seen together with the others of pelvis and {side} leg while the foot is flat",
        f"marker {leg[int(np.argmin(seen.sum(axis=1)))]}",
        "Fill its gaps, leave it out of the marker map, or give a standing trial",
        file=recording.path,
    )
    return flat


# How much a prosthesis gives under the person who stands on it while it is measured: markers show
# it as long as it is under load, the model's length is the unloaded one. Statics for small
# deflections, the sole held flat: contact spheres against the rigid heel block and against a keel
# of sprung joints, pinned at its end A and carried by the fulcrum; the socket in series, along the
# limb.


# share of the weight on the prosthesis in standing, where it was not measured (a choice: even)
STANDING_SHARE = 0.5
# in mid-stance at 1.1 m/s: Schwartz et al. (2008, doi 10.1016/j.jbiomech.2008.03.015)
WALKING_SHARE = 0.85
MID_FULCRUM_M = 1e-3 * MID_FULCRUM_MM  # where the fulcrum is taken to have stood
LEAST_LOAD_N, NEAR_M, SAME_WEIGHT = 50.0, 0.2, 0.1
"""A plate carries a foot if it bears so much, its centre of pressure is so near to that ankle and
twice as far from the other; the feet carry the person if their loads make up the weight to this
part (choices)."""


def settling(load_n: float, model: ModelParameters, *, fulcrum_m: float = MID_FULCRUM_M) -> float:
    """Metres by which the sole comes nearer to the residual limb under `load_n` (N) along the
    pylon."""
    if load_n <= 0.0:
        return 0.0
    depth = brentq(lambda d: _flat_sole_force(d, model.foot, fulcrum_m) - load_n, 0.0, 0.1)
    return float(depth) + load_n / model.socket.tz.stiffness


def _flat_sole_force(depth: float, foot: FootParameters, fulcrum_m: float) -> float:
    """N on the flat sole pressed `depth` (m) into the ground."""
    x, rise, k, n = (
        np.array(column)
        for column in zip(
            *(
                (1e-3 * x, 1e-3 * rise, zone.stiffness, zone.exponent)
                for zone in foot.zones
                for x, rise in zip(zone.x_mm, zone.rise_mm, strict=True)
            ),
            strict=True,
        )
    )
    lengths = np.array(foot.keel.element_lengths_m)
    joints = np.concatenate(([0.0], np.cumsum(lengths) - 0.5 * lengths))
    bending = bending_stiffness(foot.keel)

    # Joints turn by theta and raise the keel at x by sum_j theta_j (x - x_j), j behind x; behind
    # the fulcrum's reach is the rigid heel block.
    springs: np.ndarray = np.diag(np.concatenate(([0.0], bending / lengths)))
    at_fulcrum = np.maximum(0.0, fulcrum_m - joints)
    springs += foot.fulcrum.stiffness_n_per_m * np.outer(at_fulcrum, at_fulcrum)
    lever = np.maximum(0.0, x[:, None] - joints) * (x >= foot.fulcrum.rearmost_m)[:, None]

    # Newton's method on springs theta = lever^T force, force_i = k_i (depth - rise_i - (lever
    # theta)_i)^n_i.
    theta = np.zeros(len(joints))
    for _ in range(50):
        pressed = np.maximum(0.0, depth - rise - lever @ theta)
        force = k * pressed**n
        stiffness = np.where(pressed > 0.0, k * n * pressed ** (n - 1.0), 0.0)
        step = np.linalg.solve(
            springs + lever.T @ (stiffness[:, None] * lever), springs @ theta - lever.T @ force
        )
        theta -= step
        if np.abs(step).max() < 1e-12:
            break
    return float(force.sum())


def measured_under(
    standing: Recording,
    posture: Posture,
    ankles_W: Mapping[str, np.ndarray],
    prosthetic_side: str,
    mass_kg: float,
) -> tuple[float, str]:
    """N on the prosthesis while its length was measured, and where that is from: plates if each
    foot stands on its own.

    `ankles_W` is where the feet stand, (3,) m by side.
    """
    weight = mass_kg * GRAVITY
    if not posture.still:
        return WALKING_SHARE * weight, say("markers", "load", still=False, share=WALKING_SHARE)[0]
    loads = dict.fromkeys(ankles_W, 0.0)
    time = standing.force_time_s
    during = (time >= posture.start_s) & (time <= posture.end_s)
    for plate in standing.plates:
        vertical = plate.force_n[during, 2]
        cop = plate.cop_m[during, :2]
        if not len(vertical) or not np.isfinite(cop).all() or np.mean(vertical) < LEAST_LOAD_N:
            continue
        away = {
            side: float(np.linalg.norm(cop.mean(axis=0) - ankle[:2]))
            for side, ankle in ankles_W.items()
        }
        near, far = sorted(away, key=lambda side: away[side])
        if away[near] < NEAR_M and away[near] < 0.5 * away[far]:
            loads[near] += float(np.mean(vertical))
    if min(loads.values()) > 0.0 and abs(sum(loads.values()) / weight - 1.0) < SAME_WEIGHT:
        share = loads[prosthetic_side] / sum(loads.values())
        return share * weight, say("markers", "load", still=True, share=share)[0]
    return STANDING_SHARE * weight, say("markers", "load", still=True, share=None)[0]


# Which way a person faces: recordings whose x is not ahead of them, and those whose axes form a
# left hand.
#
# A file whose axes were renamed without a sign (x, z, y for x, y, z) shows a person's mirror image:
# every left marker lies to the right of its right one. So it does where every left label is
# exchanged with its right one. Force plates tell the two apart, where a file has their corners: by
# the C3D rule their third axis points into the floor.


# of markers that must all lie exchanged before axes are doubted rather than labels (a choice)
FEWEST_PAIRS = 4
# a pelvis that faces farther from x shows that x is not forward (a choice)
ASIDE_RAD = np.radians(60.0)
# length of the mean of the unit vectors that a person faces, below which they turn round (a choice)
SAME_WAY = 0.5
NOTE = (
    "Every left marker lies to the right of its right one: the file's axes were taken for a left "
    "hand's and the recording mirrored sideways. If instead the labels left and right are "
    "exchanged, the sides are wrong."
)


def prepared(recording: Recording, marker_map: MarkerMap) -> Recording:
    """`recording` with its labels in the map's spelling, in a right-handed frame whose x is ahead
    of the person.

    Turned by quarter turns about the vertical, with a note, if the pelvis faces another axis than
    x.
    """
    recording = right_handed(marker_map.rename(recording), marker_map)
    points = _points(recording, marker_map)
    if not {"asis", "back"} <= {*points}:
        return recording
    directions = facing(points["asis"], points["back"])
    directions = directions[np.isfinite(directions).all(axis=1)]
    mean = directions.mean(axis=0) if len(directions) else np.zeros(3)
    angle = float(np.arctan2(mean[1], mean[0]))
    if np.linalg.norm(mean) < SAME_WAY or abs(angle) < ASIDE_RAD:
        return recording
    turn = 0.5 * np.pi * round(angle / (0.5 * np.pi))
    x, y = np.round([np.cos(turn), np.sin(turn)])
    R = np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]])
    return _turned(
        recording, R, *say("markers", "faces", axis=axis_name(R[0] @ recording.rotation_W))
    )


def right_handed(recording: Recording, marker_map: MarkerMap) -> Recording:
    """`recording`, mirrored sideways (y) with a note if every left marker is to the right of its
    right one.

    Free moments keep their sign: where axes are merely renamed, the vertical moment is carried over
    as it was.
    """
    if not _is_mirrored(recording, marker_map):
        return recording
    corners = [plate.corners_m for plate in recording.plates if plate.corners_m is not None]
    # clockwise from above
    require(
        not (corners and all(np.cross(c[0] - c[1], c[0] - c[3])[2] < 0.0 for c in corners)),
        "every left marker lies to the right of its right one, though its force plates lie "
        "in a right-handed frame: left and right labels are exchanged",
        right="Correct the labels, or exchange right and left in a marker map of your own",
        file=recording.path,
    )
    return _turned(recording, np.diag([1.0, -1.0, 1.0]), NOTE)


def _turned(recording: Recording, R: np.ndarray, note: str) -> Recording:
    plates = tuple(
        dataclasses.replace(
            plate,
            force_n=plate.force_n @ R.T,
            cop_m=plate.cop_m @ R.T,
            corners_m=None if plate.corners_m is None else plate.corners_m @ R.T,
        )
        for plate in recording.plates
    )
    return dataclasses.replace(
        recording,
        markers={label: x @ R.T for label, x in recording.markers.items()},
        plates=plates,
        rotation_W=R @ recording.rotation_W,
        notes=(*recording.notes, note),
    )


def _is_mirrored(recording: Recording, marker_map: MarkerMap) -> bool:
    """Whether every pair of left and right markers lies exchanged while pelvis and feet agree on
    what is forward."""
    points = _points(recording, marker_map)
    roles = [role.removesuffix("_right") for role in points if role.endswith("_right")]
    pairs = {
        role: (points[f"{role}_right"], points[f"{role}_left"])
        for role in roles
        if f"{role}_left" in points
    }
    fore = next((role for role in ("toe", "toe_tip", "met1", "met5") if role in pairs), None)
    known = {"asis", "back", "heel_right", "heel_left"} <= {*points}
    if len(pairs) < FEWEST_PAIRS or not known or fore is None:
        return False
    forward = facing(points["asis"], points["back"])
    left = np.cross([0.0, 0.0, 1.0], forward)
    ahead = [
        typical(toe - heel, forward) for toe, heel in zip(pairs[fore], pairs["heel"], strict=True)
    ]
    apart = [typical(on_left - on_right, left) for on_right, on_left in pairs.values()]
    return min(ahead) > 0 and all(distance < 0 for distance in apart if np.isfinite(distance))


def facing(front: np.ndarray, back: np.ndarray) -> np.ndarray:
    """(n, 3) horizontal unit vectors from the back of the pelvis to its front."""
    forward = (front - back) * [1.0, 1.0, 0.0]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(forward / np.linalg.norm(forward, axis=1, keepdims=True))


def typical(vector: np.ndarray, along: np.ndarray) -> float:
    """Median over the frames of the component of `vector` along `along`; NaN without any."""
    part = np.sum(vector * along, axis=1)
    part = part[np.isfinite(part)]
    return float(np.median(part)) if len(part) else float("nan")


def _points(recording: Recording, marker_map: MarkerMap) -> dict[str, np.ndarray]:
    labels = {
        role: next((s for s in spellings if s in recording.markers), None)
        for role, spellings in marker_map.roles.items()
    }
    points = {role: recording.markers[label] for role, label in labels.items() if label is not None}
    points |= {
        role: 0.5 * (points[f"{role}_right"] + points[f"{role}_left"])
        for role in ("asis", "psis")
        if {f"{role}_{side}" for side in SIDES} <= {*points}
    }
    back = [points[role] for role in ("psis", "sacrum") if role in points]
    return points | ({"back": back[0]} if back else {})
