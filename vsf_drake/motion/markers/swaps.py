"""Markers that jump, and markers that exchange places, for a few frames or throughout."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.markers.clusters import pose_data
from vsf_drake.motion.markers.gaps import FilledMarkers
from vsf_drake.motion.markers.poses import FEWEST_MARKERS, RigidPoses, rigid_poses

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
    """Refuses two markers of one segment whose exchange explains the residual of some frames.

    Raises:
        InputError: names both and the time.
    """
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
        pair = f"markers {segment.labels[a]} and {segment.labels[b]} of the {name.replace('_', ' ')}"
        if frames.size > SWAPPED_THROUGHOUT * len(times):
            raise InputError(f"{pair} are exchanged with respect to the standing trial", file=recording.path,
                             right="Correct the labels in one of the two files")
        raise InputError(f"{pair} exchange places at {times[frames[0]]:.3f} s (for {frames.size} frames in all)",
                         file=recording.path, right=RELABEL)


def _rms(residual: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(np.mean(residual**2, axis=1)))
