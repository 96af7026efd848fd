"""Recordings as they were made, to play: motion, markers, plates and forces, and what is wrong
where it is."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from vsf_drake.base.files import write_text
from vsf_drake.motion.events import Span, common
from vsf_drake.motion.trial import Trial
from vsf_drake.recording.examine import Examined
from vsf_drake.report.replay import (
    Flaw,
    MarkerFrames,
    ReplayFrames,
    Shown,
    force_frames,
    replay_page,
)
from vsf_drake.report.style import MARK_COLOURS
from vsf_drake.walks.comparison import resample

REPLAY = "replay.html"
RATE_HZ = 50.0
LONGEST_S = 10.0  # of a walk that is shown, from the start of its window: 3 kB a frame
USED = (0.05, 0.45, 0.25)
UNUSED = (0.55, 0.55, 0.55)
"""Colours of markers that the motion was made of, and of others."""
ELSEWHERE = "#737373"  # of the time bar where the intact foot stands beside the plates
_SEVERITY = (ELSEWHERE, MARK_COLOURS["doubtful"], MARK_COLOURS["unusable"])


def write_recordings(items: Sequence[Examined], path: Path) -> None:
    """Writes trials to play, one at a time, as one HTML file that opens without a network."""
    write_text(
        path,
        replay_page(
            [[_recorded(item)] for item in items],
            "Recorded walks",
            "recorded.html.j2",
            synthetic=[item.trial.name for item in items if item.trial.synthetic],
            markers=any(item.trial.recording for item in items),
            longest_s=LONGEST_S,
        ),
    )


def _recorded(item: Examined) -> Shown:
    trial = item.trial
    lasts = min(trial.end_s - trial.start_s, LONGEST_S)
    steps = math.floor(lasts * RATE_HZ + 1e-6)
    time_s = trial.start_s + np.arange(steps + 1) / RATE_HZ
    return Shown(
        name=trial.name,
        subject=trial.subject,
        model=trial.model,
        offsets=trial.offsets,
        names=trial.trajectory.names,
        frames=ReplayFrames(
            rate_hz=RATE_HZ,
            time_s=time_s,
            q=trial.trajectory.sample(time_s)[0],
            fulcrum_m=np.full(len(time_s), trial.fulcrum_m),
            forces={
                f"{foot} measured": force_frames(time_s, plate.time_s, plate.force_W, plate.cop_W)
                for foot, plate in (("prosthetic", trial.plate), ("intact", trial.intact_plate))
                if plate is not None
            },
        ),
        markers=_markers(trial, time_s),
        plates=tuple(
            plate.corners_m
            for plate in (trial.recording.plates if trial.recording else ())
            if plate.corners_m is not None
        ),
        flaws=tuple(flaws(item)),
    )


def _markers(trial: Trial, time_s: np.ndarray) -> tuple[MarkerFrames, ...]:
    """Where the markers were seen, unfiltered, from the belt if there is one."""
    if trial.recording is None or trial.calibration is None:
        return ()
    used = {label for own in trial.calibration.segments.values() for label in own.labels}
    carried = np.outer(trial.belt_speed_m_per_s * time_s, [1.0, 0.0, 0.0])
    found = []
    for label, x in trial.recording.markers.items():
        p_W = resample(time_s, trial.recording.marker_time_s, x) + carried
        if np.isfinite(p_W).all(axis=1).any():
            found.append(MarkerFrames(label, p_W, USED if label in used else UNUSED))
    return tuple(found)


def flaws(item: Examined) -> Iterator[Flaw]:
    """What is wrong and when, once for each span: gaps in markers, forces that are unknown,
    doubtful stances."""
    trial = item.trial
    window = trial.start_s, trial.end_s
    doubt = MARK_COLOURS["doubtful"]
    found = [
        (gap.start_s, gap.end_s, doubt, f"{gap.label} not seen, filled by {gap.how}.")
        for gap in (trial.tracked.gaps if trial.tracked else ())
    ]
    found += [
        (
            *span,
            doubt if side == trial.subject.prosthetic_side else ELSEWHERE,
            f"force of the {side} foot unknown: it stands on no plate.",
        )
        for side, spans in trial.unmeasured.items()
        for span in spans
    ]
    found += [
        (*item.stances[check.side][check.stance - 1].span, MARK_COLOURS[check.mark], check.sentence)
        for check in item.checks
        if check.mark != "good"
        and check.side is not None
        and check.stance is not None
        and check.stance <= len(item.stances[check.side])
    ]
    together: dict[Span, list[tuple[str, str]]] = {}
    for start, end, colour, text in sorted(found):
        seen = common((start, end), window)
        if seen:
            together.setdefault(seen, []).append((colour, text))
    for span, own in together.items():
        worst = max((colour for colour, _ in own), key=_SEVERITY.index)
        yield Flaw(*span, worst, " ".join(text for _, text in own))
