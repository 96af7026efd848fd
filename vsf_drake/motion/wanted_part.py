"""A walk that cannot be followed as a whole: of a long recording only what is used is demanded, the
window, or what lies around the loads on plates."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.base.sentences import say
from vsf_drake.motion.contacts import assign_plates
from vsf_drake.motion.events import Span, common, find_stances, united, within
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.import_options import AROUND_STANCES_S, TrialOptions
from vsf_drake.motion.markers.segments import Calibration, TrackedMotion
from vsf_drake.motion.markers.tracking import track

MARGINS_S = (1.0, AROUND_STANCES_S)
"""What is tried around loads on plates: a step, from which the events are told more surely, and
what a walk keeps of its window."""


def track_wanted(
    walk: Recording, calibration: Calibration, options: TrialOptions
) -> tuple[Recording, TrackedMotion]:
    """The walk and its motion (see `track`); where a marker is lost or exchanged outside what is
    used, the part that is used, with a note.

    That is the stated window, else one pass over the plates, the longest of those that can be
    followed from its first load to its last and on which the prosthetic foot is carried. Refused as
    `track` does where there is none.
    """

    def follow(part: Recording) -> TrackedMotion:
        return track(
            part, calibration, cutoff_hz=options.cutoff_hz, longest_gap_s=options.longest_gap_s
        )

    try:
        return walk, follow(walk)
    except InputError as fault:
        for span, needed in _wanted(walk, options):
            inside = within(walk.marker_time_s, [span])
            part = dataclasses.replace(
                walk,
                markers={label: path[inside] for label, path in walk.markers.items()},
                marker_start_s=float(walk.marker_time_s[inside][0]),
            )
            try:
                tracked = follow(part)
                carried = _carries(part, tracked, calibration, options)
            except InputError:
                continue
            covered = within(np.array(needed), [(tracked.time_s[0], tracked.time_s[-1])]).all()
            if covered and carried:
                notes = say(
                    "trial", "wanted_part", used=span, stated=options.window, fault=fault.what
                )
                return part, dataclasses.replace(tracked, notes=(*notes, *tracked.notes))
        raise


def _wanted(walk: Recording, options: TrialOptions) -> Iterator[tuple[Span, Span]]:
    """Parts of the markers' record to try in its place, the most loaded first, and what each must
    show at least."""
    time = walk.marker_time_s
    if not len(time):
        return
    record = float(time[0]), float(time[-1])
    needed = [
        stance.span
        for plate in walk.plates
        for stance in find_stances(walk.force_time_s, plate.force_n[:, 2])
    ]
    if options.window is not None:
        start = options.window.start_s
        end = options.window.end_s
        needed = [(record[0] if start is None else start, record[1] if end is None else end)]
    spans = sorted(part for part in (common(span, record) for span in needed) if part is not None)

    def loaded_s(part: Span) -> float:
        return sum(end - start for start, end in spans if part[0] <= start and end <= part[1])

    for margin_s in MARGINS_S:
        around = united((start - margin_s, end + margin_s) for start, end in spans)
        for start, end in sorted(around, key=loaded_s, reverse=True):
            part = max(start, record[0]), min(end, record[1])
            if part != record:
                least = [span for span in spans if start <= span[0] and span[1] <= end]
                yield part, (least[0][0], max(span[1] for span in least))


def _carries(
    part: Recording, tracked: TrackedMotion, calibration: Calibration, options: TrialOptions
) -> bool:
    """Whether some plate carries the prosthetic foot alone; True without plates."""
    if not part.plates:
        return True
    assignment = assign_plates(part, tracked, stated=options.plate_sides)
    return calibration.subject.prosthetic_side in assignment.plates
