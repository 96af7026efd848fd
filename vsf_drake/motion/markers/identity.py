"""Whether the markers of a walk are those of the standing trial: same unit, same person, same places.

A least-squares pose hides a wrong marker by sharing its error out; the distances it leaves do not. What is refused here
is what no skin motion explains.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.markers.gaps import FilledMarkers
from vsf_drake.motion.markers.poses import RigidPoses, determines, pose_data, rigid_poses, subset
from vsf_drake.motion.markers.schema import PARENTS, SegmentMarkers

OTHER_UNIT = 5.0
"""A person is never five times as large as another: a scale beyond this is another unit."""
OTHER_PERSON = 0.10
"""Skin motion changes distances of markers on one segment by some percent; a tenth over all of them is another body."""
NEAR_M = 0.08
"""Distances below this say little about scale."""
LOST_JOINT_M = 0.08
"""Two segments that place their joint this far apart (RMS), several times the worst skin motion, do not belong
together."""
ASTRAY_RMS_M = 0.04
"""RMS over the trial beyond which a marker is not where the standing trial had it. Skin over the thigh moves by up to
about 30 mm."""
MOST_ASTRAY = 3
"""Segments with markers astray beyond which it is not a marker that is wrong but the standing trial."""


def scale_of(segments: Mapping[str, SegmentMarkers], markers: Mapping[str, np.ndarray]) -> float:
    """Median over all pairs of markers on one segment: their distance (median over time) over that at standing."""
    ratios = []
    for segment in segments.values():
        for a, b in combinations(range(len(segment.labels)), 2):
            standing = float(np.linalg.norm(segment.p_BM[a] - segment.p_BM[b]))
            if standing >= NEAR_M:
                apart = np.linalg.norm(markers[segment.labels[a]] - markers[segment.labels[b]], axis=1)
                ratios.append(float(np.median(apart)) / standing)
    return float(np.median(ratios)) if ratios else 1.0


def check_scale(recording: Recording, filled: FilledMarkers) -> None:
    """Refuses a walk whose markers lie farther apart, or closer, than the calibration's.

    Raises:
        InputError: another unit, or another person.
    """
    scale = scale_of(filled.segments, filled.markers)
    if not 1 / OTHER_UNIT < scale < OTHER_UNIT:
        raise InputError(f"its markers lie {scale:.3g} times as far apart as in the standing trial: one of the two "
                         "files is in another unit than it says", file=recording.path,
                         right="Give laboratory.length_unit (--length-unit) where a file states the wrong one")
    if abs(scale - 1) > OTHER_PERSON:
        raise InputError(f"its markers lie {scale:.2f} times as far apart as in the standing trial, which seems to be "
                         "of another person", file=recording.path, right="Give the standing trial of the same session")


def check_places(recording: Recording, filled: FilledMarkers, poses: Mapping[str, RigidPoses]) -> None:
    """Refuses markers that are not where the calibration has them, and segments that do not meet at their joint.

    Raises:
        InputError: names the marker that is farthest astray; or the joint, and that the standing trial seems to be of
            another person.
    """
    astray = sorted((astray for name, segment in filled.segments.items()
                     for astray in _astray(name, segment, filled, poses[name])), reverse=True)
    gap, apart = max((joint_gap(name, segment, poses), name) for name, segment in filled.segments.items()
                     if PARENTS[name] is not None)
    segments_astray = {name for _, name, _ in astray}
    if len(segments_astray) > MOST_ASTRAY or (gap > LOST_JOINT_M and len(segments_astray) != 1):
        raise InputError(
            f"the segments do not fit together (the {apart.replace('_', ' ')} is {1e3 * gap:.0f} mm from its joint): "
            "the standing trial seems to be of another person or of another placement of the markers",
            file=recording.path, right="Give the standing trial of the same session")
    if astray:
        rms, name, label = astray[0]
        words = name.replace("_", " ")
        without = {each: _without(each, name, filled, poses) for each in filled.segments[name].labels}
        label, left = min(without.items(), key=lambda item: item[1])
        own = residual_rms(filled.segments[name], filled, poses[name])[label]
        if left > 0.5 * rms:
            shown = ", ".join(f"{each} {1e3 * far:.0f}" for far, _, each in astray)
            raise InputError(f"markers of the {words} are not at their places in the standing trial (mm RMS: {shown}), "
                             "and no single one of them, nor an exchange, explains it", file=recording.path,
                             right="Check all labels of this segment in both files")
        raise InputError(
            f"marker {label} is {1e3 * own:.0f} mm (RMS) from its place on the {words} in the standing trial, and "
            f"without it the others are within {1e3 * left:.0f} mm: it was moved, or it is labelled wrongly in one of "
            "the two files", file=recording.path, right="Correct its label, or leave it out of the marker map")


def _without(label: str, name: str, filled: FilledMarkers, poses: Mapping[str, RigidPoses]) -> float:
    """Largest RMS residual (m) of a segment's other markers if `label` is left out; infinite where too few remain."""
    segment = subset(filled.segments[name], tuple(own for own in filled.segments[name].labels if own != label))
    if not determines(name, segment.p_BM):
        return float("inf")
    return max(residual_rms(segment, filled, rigid_poses(*pose_data(name, segment, filled.markers, poses))).values())


def joint_gaps(name: str, segment: SegmentMarkers, poses: Mapping[str, RigidPoses]) -> np.ndarray:
    """(n,) m, distance of a segment's origin from where its parent has it."""
    return np.linalg.norm(poses[name].p_WB - poses[str(PARENTS[name])].points(segment.p_PB), axis=1)


def joint_gap(name: str, segment: SegmentMarkers, poses: Mapping[str, RigidPoses]) -> float:
    """RMS (m) of `joint_gaps`."""
    return float(np.sqrt(np.mean(joint_gaps(name, segment, poses) ** 2)))


def residual_rms(segment: SegmentMarkers, filled: FilledMarkers, poses: RigidPoses) -> dict[str, float]:
    """RMS residual (m) of each marker over the frames in which it was seen."""
    return {label: float(np.sqrt(np.mean(poses.residual_m[filled.seen[label], k] ** 2)))
            for k, label in enumerate(segment.labels) if filled.seen[label].any()}


def _astray(name: str, segment: SegmentMarkers, filled: FilledMarkers,
            poses: RigidPoses) -> list[tuple[float, str, str]]:
    return [(rms, name, label) for label, rms in residual_rms(segment, filled, poses).items() if rms > ASTRAY_RMS_M]
