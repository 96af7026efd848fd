"""Stances in a recording, on the plates and in the motion, and the one stance that a stride begins with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vsf_drake.analysis.tuning.recorded_curves import BodyPoints
from vsf_drake.errors import InputError
from vsf_drake.motion.contacts import TOLERANCE_S, WIDEN_S
from vsf_drake.motion.events import Stance, find_stances, kinematic_stances, walking_direction
from vsf_drake.motion.markers.schema import FootTrack
from vsf_drake.motion.trial_record import Trial

Span = tuple[float, float]
LEAST_WAY_M = 0.3
"""A pelvis that gets no farther than this over the recording does not walk over the ground."""


def sides(trial: Trial) -> dict[str, str]:
    """ "right" or "left" by "P" (prosthetic) and "I" (intact)."""
    own = trial.subject.prosthetic_side
    return {"P": own, "I": "left" if own == "right" else "right"}


def loaded_stances(trial: Trial) -> dict[str, list[Stance]]:
    """By "P" and "I", what the plates saw within the recorded motion; a stance that the motion cuts is marked so."""
    found: dict[str, list[Stance]] = {}
    first, last = trial.trajectory.start_s, trial.trajectory.end_s
    for s, side in sides(trial).items():
        plate = trial.plates.get(side)
        own = [] if plate is None else find_stances(plate.time_s, plate.force_W[:, 2])
        missed = trial.unmeasured.get(side, ())
        found[s] = [Stance(max(x.start_s, first), min(x.end_s, last), x.start_seen and x.start_s >= first,
                           x.end_seen and x.end_s <= last)
                    for x in own if x.end_s > first and x.start_s < last
                    and not any(a < 0.5 * (x.start_s + x.end_s) < b for a, b in missed)]
    return found


def moved_stances(time_s: np.ndarray, points: BodyPoints, zero: BodyPoints) -> dict[str, list[Stance]]:
    """By "P" and "I", as the motion of heel and toe tells. zero: the points with every coordinate at zero."""
    feet = {}
    for s, place in (("P", 0), ("I", 1)):
        x = zero.spheres[s][0, :, 0]
        floor = np.array([0.0, 0.0, 1.0]) * points.radius[s][:, None]
        bottom = points.spheres[s] - floor
        feet[s] = FootTrack(heel_W=bottom[:, x <= x.min() + 1e-6].mean(axis=1),
                            toe_W=bottom[:, x >= x.max() - 1e-6].mean(axis=1), ankle_W=points.ankle[:, place])
    forward = walking_direction(feet, points.pelvis)
    return {s: kinematic_stances(time_s, foot, points.pelvis, forward_W=forward) for s, foot in feet.items()}


def unknown_spans(trial: Trial, loaded: Mapping[str, Sequence[Stance]],
                  moved: Mapping[str, Sequence[Stance]]) -> dict[str, tuple[Span, ...]]:
    """By "P" and "I", when the foot stands on ground that no plate measures: stated by the trial, or told by a stance
    in the motion of which more than 0.12 s is on no plate."""
    found: dict[str, tuple[Span, ...]] = {}
    for s, side in sides(trial).items():
        if trial.unmeasured.get(side):
            found[s] = tuple(trial.unmeasured[side])
            continue
        plate = trial.plates.get(side)
        spans = []
        for stance in moved[s] if plate is not None else ():
            start, end = max(stance.start_s, plate.time_s[0]), min(stance.end_s, plate.time_s[-1])
            own = [(x.start_s, x.end_s) for x in loaded[s] if min(x.end_s, end) > max(x.start_s, start)]
            edges = [start, *(edge for span in sorted(own) for edge in span), end]
            gap = max((b - a for a, b in zip(edges[::2], edges[1::2], strict=True)), default=0.0)
            if gap > min(TOLERANCE_S, 0.5 * (end - start)) and end > start:
                spans.append((min([start, *(a for a, _ in own)]) - WIDEN_S, max([end, *(b for _, b in own)]) + WIDEN_S))
        found[s] = tuple(spans)
    return found


def heading(points: BodyPoints, *, file: object = None) -> np.ndarray:
    """(2,) unit vector in the floor along which the pelvis travels.

    Raises:
        InputError: it hardly travels.
    """
    way = (points.pelvis[-1] - points.pelvis[0])[:2]
    length = float(np.linalg.norm(way))
    if length < LEAST_WAY_M:
        raise InputError(f"the pelvis gets only {length:.2f} m ahead", file=file, where="kinematics",
                         right="On a treadmill, give the manifest its belt_speed_m_per_s")
    return way / length


def within_stride(stances: Sequence[Stance], moved: Sequence[Stance], start_s: float,
                  period_s: float) -> tuple[Span | None, str]:
    """A foot's stance within the stride (start from 0 to the period, end after it), and how it was found.

    A whole stance on the plates tells it; else a strike and a lift-off that belong to two stances; else the motion.
    """
    for source, where in ((stances, "the plates"), (moved, "the motion of the foot")):
        whole = [x for x in source if x.complete]
        if whole:
            best = min(whole, key=lambda x: abs(0.5 * (x.start_s + x.end_s) - start_s - 0.5 * period_s))
            start = (best.start_s - start_s) % period_s
            return (start, start + best.duration_s), f"whole on {where}" if source is stances else f"whole in {where}"
        strikes = [x.start_s for x in source if x.start_seen]
        lifts = [x.end_s for x in source if x.end_seen]
        if strikes and lifts:
            start = (strikes[0] - start_s) % period_s
            length = (lifts[-1] - strikes[0]) % period_s
            return (start, start + length), f"pieced together from two parts in {where}"
    return None, "not seen"


def within(times: np.ndarray, stance: Span | None, period_s: float) -> np.ndarray:
    """(n,) whether times since phase 0 lie in a stance; all do where none is known."""
    return np.mod(times - stance[0], period_s) <= stance[1] - stance[0] if stance else np.ones(len(times), dtype=bool)


def first_strike(stances: Sequence[Stance], window: Span, *, file: object) -> Stance:
    """The prosthetic stance that a stride begins with: the first whole one in the window, or one whose strike is seen.

    Raises:
        InputError: there is none.
    """
    inside = [x for x in stances if window[0] - 1e-9 <= x.start_s <= window[1]]
    whole = [x for x in inside if x.complete and x.end_s <= window[1] + 1e-9]
    struck = [x for x in inside if x.start_seen]
    if whole or struck:
        return (whole or struck)[0]
    seen = ", ".join(f"{x.start_s:.3f} to {x.end_s:.3f} s" for x in stances) or "none"
    raise InputError(f"the plate shows no strike of the prosthetic foot from {window[0]:.3f} to {window[1]:.3f} s",
                     file=file, where="forces", right=f"Its stances are: {seen}")
