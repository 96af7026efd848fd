"""Where a marker was while nobody saw it: from a rigid cluster, or by a spline. Pure functions of arrays."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from vsf_drake.motion.markers.clusters import needs_joint_centre
from vsf_drake.motion.markers.poses import rigid_poses

SPLINE_FRAMES = 4
"""Frames on either side of a gap that shape the spline across it."""


def placed_by_cluster(p_BM: np.ndarray, p_WM: np.ndarray, own: int,
                      gap: tuple[int, int]) -> tuple[int, int, np.ndarray]:
    """Where point `own` of a rigid cluster is in a gap.

    It has the offset from the others' pose that it has at the gap's edges, in the segment's frame, passed linearly from
    one edge to the other.

    Args:
        p_BM: (k, 3) m, all points in the segment's frame.
        p_WM: (frames, k, 3) m, NaN where not seen.
        own: which of the k points.
        gap: its frames [start, stop).

    Returns:
        The frames [start, stop) that could be filled, and (stop - start, 3) m there: all of the gap where enough others
        are seen throughout, at an end of the recording as far out as they are seen without a break; else none.
    """
    (start, stop), frames = gap, len(p_WM)
    nothing = start, start, np.empty((0, 3))
    first, last = max(start - 1, 0), min(stop + 1, frames)
    seen = np.isfinite(p_WM[:, :, 0])
    if (first, last) == (start, stop):
        return nothing
    inward = slice(first, last) if start > 0 else slice(last - 1, None, -1)
    reach = np.logical_and.accumulate(seen[inward], axis=0).sum(axis=0)
    reach[own] = 0
    others = _enough(p_BM, reach, last - first if start > 0 and stop < frames else 2)
    if not others:
        return nothing
    known_frames = min(reach[others])
    if start == 0:
        first = start = last - int(known_frames)
    elif stop == frames:
        last = stop = first + int(known_frames)
    poses = rigid_poses(p_BM[others], p_WM[first:last, others])
    offset_B = np.einsum("nji,nj->ni", poses.R_WB, p_WM[first:last, own] - poses.p_WB) - p_BM[own]
    known, every = np.flatnonzero(np.isfinite(offset_B[:, 0])), np.arange(last - first)
    blended = np.stack([np.interp(every, known, offset_B[known, i]) for i in range(3)], axis=1)
    placed = np.einsum("nij,nj->ni", poses.R_WB, p_BM[own] + blended) + poses.p_WB
    return start, stop, placed[start - first:stop - first]


def _enough(p_BM: np.ndarray, reach: np.ndarray, least: int) -> list[int]:
    """The points seen longest that determine a pose, and all that are seen as long; none if none reach `least`."""
    by_reach = sorted(range(len(p_BM)), key=lambda k: -int(reach[k]))
    for count in range(1, len(by_reach) + 1):
        if reach[by_reach[count - 1]] < least:
            return []
        if not needs_joint_centre(p_BM[by_reach[:count]]):
            return [k for k in by_reach if reach[k] >= reach[by_reach[count - 1]]]
    return []


def splined(path: np.ndarray, start: int, stop: int) -> bool:
    """Fills `path` (frames, 3) in [start, stop) by a cubic spline through its neighbours; False if a side has none."""
    known = np.flatnonzero(np.isfinite(path[:, 0]))
    left, right = known[known < start][-SPLINE_FRAMES:], known[known >= stop][:SPLINE_FRAMES]
    if not left.size or not right.size:
        return False
    around = np.concatenate((left, right))
    path[start:stop] = CubicSpline(around, path[around])(np.arange(start, stop))
    return True
