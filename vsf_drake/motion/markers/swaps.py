"""Markers that jump, and markers that exchange places, for a few frames or throughout."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.markers.clusters import pose_data, segment_poses
from vsf_drake.motion.markers.gaps import FilledMarkers
from vsf_drake.motion.markers.identity import LOST_JOINT_M, joint_gaps
from vsf_drake.motion.markers.poses import FEWEST_MARKERS, RigidPoses, rigid_poses
from vsf_drake.motion.markers.schema import PARENTS

FASTEST_M_S = 10.0
"""Twice what a foot in swing reaches in the fastest walk."""
SMALLEST_JUMP_M = 0.05
"""At a high frame rate noise alone is fast; what moves less than this is left to the residuals."""
SWAP_M = 0.025
"""A residual below this may still be skin motion."""
SWAP_GAIN = 0.5
"""Two markers are exchanged if exchanging them back halves the residual."""
SWAPPED_THROUGHOUT = 0.8
"""Share of the frames beyond which the labels differ from the standing trial's."""
MOST_TRIED = 25
"""Frames, evenly spread over the suspect ones, on which exchanges are tried (a choice: they take time)."""
RELABEL = "Correct the labels in the capture software"


def check_jumps(recording: Recording, filled: FilledMarkers, times: np.ndarray) -> None:
    """Refuses a marker that is somewhere else from one seen frame to the next.

    Raises:
        InputError: names the marker and the time, and the other one if two exchange places.
    """
    jumps = []
    for label, path in filled.markers.items():
        frames = np.flatnonzero(filled.seen[label])
        step = np.linalg.norm(np.diff(path[frames], axis=0), axis=1)
        too_far = np.flatnonzero(step > np.maximum(FASTEST_M_S * np.diff(times[frames]), SMALLEST_JUMP_M))
        jumps += [(int(frames[k + 1]), int(frames[k]), label, float(step[k])) for k in too_far]
    if not jumps:
        return
    frame, before, label, step_m = min(jumps, key=lambda jump: (jump[0], -jump[3]))
    own = filled.markers[label]
    for other, path in filled.markers.items():
        crossed = (own[frame] - path[before], path[frame] - own[before])
        if other != label and max(np.linalg.norm(crossed, axis=1)) < step_m / 2:
            raise InputError(f"markers {label} and {other} exchange places at {times[frame]:.3f} s",
                             file=recording.path, right=RELABEL)
    raise InputError(f"marker {label} jumps by {1e3 * step_m:.0f} mm at {times[frame]:.3f} s, faster than anybody "
                     "walks", file=recording.path, right=f"{RELABEL}, or delete the marker there")


def check_swaps(recording: Recording, filled: FilledMarkers, poses: Mapping[str, RigidPoses],
                times: np.ndarray) -> None:
    """Refuses two markers whose exchange explains why some frames do not fit.

    Two of one segment are known by what they leave of the distances to its pose; those of two segments, and two of
    three on one segment, whose mirror image fits by turning over, by segments that come apart at the joints.

    Raises:
        InputError: names both and the time.
    """
    _check_residuals(recording, filled, poses, times)
    _check_joints(recording, filled, poses, times)


def _check_residuals(recording: Recording, filled: FilledMarkers, poses: Mapping[str, RigidPoses],
                     times: np.ndarray) -> None:
    for name, segment in filled.segments.items():
        p_BM, p_WM = pose_data(name, segment, filled.markers, poses)
        suspect = np.flatnonzero(poses[name].residual_m.max(axis=1) > SWAP_M)
        if len(p_BM) < FEWEST_MARKERS or not suspect.size:
            continue
        own = _rms(poses[name].residual_m[suspect])
        gains = {}
        for a, b in combinations(range(len(segment.labels)), 2):
            exchanged = p_WM[suspect]
            exchanged[:, [a, b]] = exchanged[:, [b, a]]
            gains[a, b] = _rms(rigid_poses(p_BM, exchanged).residual_m) / own
        (a, b), gain = max(gains.items(), key=lambda item: (int((item[1] < SWAP_GAIN).sum()), -item[1].min()))
        frames = suspect[gain < SWAP_GAIN]
        if not frames.size:
            continue
        raise _exchanged(f"{segment.labels[a]} and {segment.labels[b]} of the {name.replace('_', ' ')}", frames,
                         recording, times)


def _check_joints(recording: Recording, filled: FilledMarkers, poses: Mapping[str, RigidPoses],
                  times: np.ndarray) -> None:
    gaps = _gaps(filled, poses)
    suspect = np.flatnonzero(np.max(list(gaps.values()), axis=0) > LOST_JOINT_M)
    if not suspect.size:
        return
    tried = suspect[np.linspace(0, suspect.size - 1, min(MOST_TRIED, suspect.size)).astype(int)]
    apart = {name for name, gap in gaps.items() if gap[tried].max() > LOST_JOINT_M}
    involved = apart | {str(PARENTS[name]) for name in apart}
    labels = [label for name, segment in filled.segments.items() if name in involved for label in segment.labels]
    seen = {label: path[tried] for label, path in filled.markers.items()}
    worst = {(a, b): _worst_gap(filled, seen | {a: seen[b], b: seen[a]}) for a, b in combinations(labels, 2)}
    if not worst:
        return
    (a, b), left = min(worst.items(), key=lambda item: item[1])
    if left < SWAP_GAIN * LOST_JOINT_M:
        raise _exchanged(f"{a} and {b}", suspect, recording, times)


def _gaps(filled: FilledMarkers, poses: Mapping[str, RigidPoses]) -> dict[str, np.ndarray]:
    return {name: joint_gaps(name, segment, poses) for name, segment in filled.segments.items() if PARENTS[name]}


def _worst_gap(filled: FilledMarkers, markers: Mapping[str, np.ndarray]) -> float:
    """Largest distance (m) at any joint in the median frame; infinite where a pose is lost."""
    gaps = np.max(list(_gaps(filled, segment_poses(filled.segments, markers)).values()), axis=0)
    return float(np.median(np.nan_to_num(gaps, nan=np.inf)))


def _exchanged(pair: str, frames: np.ndarray, recording: Recording, times: np.ndarray) -> InputError:
    if frames.size > SWAPPED_THROUGHOUT * len(times):
        return InputError(f"markers {pair} are exchanged with respect to the standing trial", file=recording.path,
                          right="Correct the labels in one of the two files")
    return InputError(f"markers {pair} exchange places at {times[frames[0]]:.3f} s (for {frames.size} frames in all)",
                      file=recording.path, right=RELABEL)


def _rms(residual: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(np.mean(residual**2, axis=1)))
