"""How well markers, rigid segments and the standing trial fit together."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from vsf_drake.analysis.recording.check import FITTED_HIP_BW_PER_DEG, Check, at_most, grade, worst
from vsf_drake.motion.events import longest_run
from vsf_drake.motion.markers.schema import Gap

RESIDUAL_M = (0.010, 0.020)
"""Root mean square distance of a marker from its segment. The second is what OpenSim's guide on inverse kinematics
gives as usual limit; the first, half of it, is a choice: 10 mm over a segment of 0.4 m are 1.4 degrees."""
SEGMENT_M = 0.4
"""Length of a thigh or a shank: what a marker is off, over it, is the error of an angle."""
CLUSTER_M = (0.008, 0.015)
"""Departure of a segment's markers from a rigid body: skin moves by 5 to 15 mm on thighs (a choice)."""
JOINT_GAP_M = (0.020, 0.035)
"""Distance between two segments' ideas of one joint centre: hip regressions alone err by 10 to 15 mm, and skin moves.
Choices."""
GAP_S = (0.1, 0.2)
"""Longest gap filled without markers of the same segment to go by; the first is the default limit of filling."""
BY_CLUSTER_S = (1.0, float("inf"))
"""The same where the segment's other markers say where it was: without one of them for so long it rests on fewer."""
SAME_LENGTH = (0.03, 0.08)
"""Difference of two legs' lengths as a share: people differ by 1 %, joint centres are known to 2 % (choices)."""
SMOOTH_M = 2e-5
"""Content above twice the cut-off (m, root mean square) that no camera is without: marker noise is 0.1 mm and more, and
two decimals of a millimetre alone make 3e-6."""
LEAST_BAND = 0.15
"""Share of the spectrum that must lie above twice the cut-off to judge by it."""
NAMED = 4
"""How many of the worst are named in a sentence."""


def residuals(rms_m: Mapping[str, float]) -> Check | None:
    """Distance of each marker from where its segment's pose puts it."""
    check = _worst("marker residuals", rms_m, RESIDUAL_M, "Markers lie off their segments by up to {value:.1f} mm "
                   "({names})", "the standing trial and this walk are one person with one set of markers",
                   "has a marker moved, been swapped or renamed since the standing trial?")
    if check is None or check.value is None:
        return None
    angle_deg = float(np.degrees(1e-3 * check.value / SEGMENT_M))
    return dataclasses.replace(check, cost_bw=FITTED_HIP_BW_PER_DEG * angle_deg)


def cluster_motion(rms_m: Mapping[str, float]) -> Check | None:
    """How far each segment's markers move against each other."""
    return _worst("motion of rigid clusters", rms_m, CLUSTER_M, "Markers of one segment move against each other by up "
                  "to {value:.1f} mm ({names})", "skin does that", "skin alone does not: their angles are doubtful")


def joint_gaps(rms_m: Mapping[str, float]) -> Check | None:
    """How far two neighbouring segments disagree about their joint's centre."""
    return _worst("gaps in joints", rms_m, JOINT_GAP_M, "Neighbouring segments miss each other's joint centre by up to "
                  "{value:.1f} mm ({names})", "segments and joint centres fit", "joint centres, a swapped marker, or "
                  "the standing trial of another person; the model's joints have no gap and put it into the foot")


def gaps_filled(gaps: Sequence[Gap]) -> Check:
    """What was filled, and the longest of it."""
    if not gaps:
        return Check("gaps filled", "good", 0.0, "s", "No marker in use had a gap.")
    longest = max(gaps, key=lambda gap: gap.end_s - gap.start_s)
    value = longest.end_s - longest.start_s
    mark = worst(_gap_mark(gap) for gap in gaps)
    sentence = (f"{len(gaps)} gap{'s' if len(gaps) > 1 else ''} filled; the longest, {longest.label} from "
                f"{longest.start_s:.3f} to {longest.end_s:.3f} s, by {longest.how}")
    sentence += "." if mark == "good" else ". Not all of that is sure: see the list of gaps."
    return Check("gaps filled", mark, value, "s", sentence)


def _gap_mark(gap: Gap) -> str:
    limits = BY_CLUSTER_S if gap.how.startswith("rigid cluster") else GAP_S
    return grade(gap.end_s - gap.start_s - 1e-9, *limits)


def leg_lengths(lengths_m: Mapping[str, float]) -> list[Check]:
    """Right against left, for every length that is known on both sides."""
    found = []
    for key, right in lengths_m.items():
        left = lengths_m.get(key.removesuffix("_right") + "_left") if key.endswith("_right") else None
        if left is None or key.startswith("ankle"):
            continue
        value, what = left / right - 1.0, key.removesuffix("_right").replace("_", " ")
        mark = grade(value, *SAME_LENGTH)
        if not key.startswith("thigh"):  # below the knee a prosthesis may be as long as it likes
            mark = at_most(mark, "doubtful")
        sentence = f"The {what} is {1e3 * right:.0f} mm on the right and {1e3 * left:.0f} mm on the left"
        sentence += "." if mark == "good" else ": more than two legs of a person differ, unless the prosthesis does."
        found.append(Check(f"{what}, left against right", mark, value, "1", sentence))
    return found


def filtered_before(markers_m: Mapping[str, np.ndarray], rate_hz: float, *, cutoff_hz: float | None) -> Check | None:
    """Whether the markers had been low-passed before we did: is there nothing above twice the cut-off?

    Args:
        markers_m: (frames, 3) by label as recorded, NaN in gaps. rate_hz: of the frames.
        cutoff_hz: of our filter; None where it was left out because the recording is already filtered.
    """
    cutoff = cutoff_hz or 6.0
    if 2 * cutoff > (1 - LEAST_BAND) * rate_hz / 2:
        return None
    sizes = [size for values in markers_m.values() if (size := high_content(values, rate_hz, 2 * cutoff)) is not None]
    if not sizes:
        return None
    value = float(np.median(sizes))
    name, told = "filter applied before", f"Above {2 * cutoff:.0f} Hz the markers hold {1e3 * value:.3f} mm"
    if value > SMOOTH_M:
        if cutoff_hz is None:
            return Check(name, "doubtful", 1e3 * value, "mm", f"{told}: the recording was said to be filtered already, "
                         "but holds what a filter would have taken out. Leave --already-filtered away.")
        return Check(name, "good", 1e3 * value, "mm", f"{told}, as cameras give: it was filtered once, here.")
    if cutoff_hz is None:
        return Check(name, "good", 1e3 * value, "mm", f"{told}: filtered before, as was said, and not again.")
    return Check(name, "doubtful", 1e3 * value, "mm", f"{told}, less than any camera's noise: the recording was "
                 "filtered (or made) before; filtering twice costs 3.5 % of body weight. Give --already-filtered.")


def high_content(values: np.ndarray, rate_hz: float, above_hz: float) -> float | None:
    """Root mean square (m) of a marker's content above a frequency, over its longest unbroken stretch.

    A quadratic is taken out and a Hann window laid over it, so that its ends do not leak into the band. None if short.
    """
    run = longest_run(np.isfinite(values).all(axis=1))
    if len(run) < max(24, rate_hz / 2):
        return None
    x = np.arange(len(run)) / len(run)
    series = values[run] - np.stack([np.polyval(np.polyfit(x, column, 2), x) for column in values[run].T], axis=1)
    window = np.hanning(len(run))[:, None]
    power = np.abs(np.fft.rfft(series * window, axis=0)) ** 2
    band = np.fft.rfftfreq(len(run), 1.0 / rate_hz) > above_hz
    return float(np.sqrt(2.0 * power[band].sum() / (len(run) * np.sum(window**2))))


def _worst(name: str, values_m: Mapping[str, float], limits: tuple[float, float], told: str, fine: str,
           wrong: str) -> Check | None:
    known = {key: value for key, value in values_m.items() if np.isfinite(value)}
    if not known:
        return None
    ranked = sorted(known, key=known.__getitem__, reverse=True)
    value = known[ranked[0]]
    mark = grade(value, *limits)
    names = ", ".join(f"{key.replace('_', ' ')} {1e3 * known[key]:.1f}" for key in ranked[:NAMED])
    sentence = f"{told.format(value=1e3 * value, names=names)}: {fine if mark == 'good' else wrong}."
    return Check(name, mark, 1e3 * value, "mm", sentence.replace("?.", "?"))
