"""When: stances in a recording, on the plates and in the motion, the one that a stride begins with, and its period."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from vsf_drake.analysis.tuning.recorded_projection import FEET, BodyPoints, SagittalChain
from vsf_drake.errors import InputError
from vsf_drake.motion.contacts import TOLERANCE_S, WIDEN_S
from vsf_drake.motion.events import Stance, find_stances, kinematic_stances, walking_direction
from vsf_drake.motion.markers.segments import FootTrack
from vsf_drake.motion.trial_record import Trial

Span = tuple[float, float]
LEAST_WAY_M = 0.3  # a pelvis that gets no farther than this over the recording does not walk over the ground


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


def moved_stances(time_s: np.ndarray, points: BodyPoints, chain: SagittalChain) -> dict[str, list[Stance]]:
    """By "P" and "I", as the motion of heel and toe tells."""
    feet = {}
    for s in FEET:
        rows = chain.rows(f"sphere {s}")
        x, bottom = chain.local[rows].real, points.places[:, rows] - np.outer(points.radius[rows], (0.0, 0.0, 1.0))
        feet[s] = FootTrack(heel_W=bottom[:, x <= x.min() + 1e-6].mean(axis=1),
                            toe_W=bottom[:, x >= x.max() - 1e-6].mean(axis=1), ankle_W=points.of(f"ankle {s}")[:, 0])
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
    """(2,) unit vector in the floor along which the pelvis travels; InputError if it hardly does."""
    way = (points.pelvis[-1] - points.pelvis[0])[:2]
    length = float(np.linalg.norm(way))
    if length < LEAST_WAY_M:
        raise InputError(f"the pelvis gets only {length:.2f} m ahead", file=file, where="kinematics",
                         right="On a treadmill, give the manifest its belt_speed_m_per_s")
    return way / length


def within_stride(stances: Sequence[Stance], moved: Sequence[Stance], start_s: float,
                  period_s: float) -> tuple[Span | None, str]:
    """A foot's stance within the stride (start from 0 to the period, end after it), and how it was found: a whole one
    on the plates tells it; else a strike and a lift-off that belong to two stances; else the motion."""
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
    """The prosthetic stance that a stride begins with: the first whole one in the window, or one whose strike is seen;
    InputError if there is none."""
    inside = [x for x in stances if window[0] - 1e-9 <= x.start_s <= window[1]]
    whole = [x for x in inside if x.complete and x.end_s <= window[1] + 1e-9]
    struck = [x for x in inside if x.start_seen]
    if whole or struck:
        return (whole or struck)[0]
    seen = ", ".join(f"{x.start_s:.3f} to {x.end_s:.3f} s" for x in stances) or "none"
    raise InputError(f"the plate shows no strike of the prosthetic foot from {window[0]:.3f} to {window[1]:.3f} s",
                     file=file, where="forces", right=f"Its stances are: {seen}")


# How long a stride takes: from what both ends of a recording have in common, or from two like events of one foot.


LEAST_SHARE, MOST_SHARE = 0.5, 0.75
"""Stance may take this share of a stride: walking, from fast to slow (choices; 0.62 is usual)."""
STRIDES_S = (0.7, 2.2)  # where no stance is known
LEAST_OVERLAP_S = 0.1  # the recording must outlast the stride by this for its two ends to be compared
NEAR_EVENTS_S = 0.06  # kinematic events are wrong by up to 0.035 s each (see `motion.contacts`)
GRID_S = 0.005
SAMPLES = 200
LARGEST_CLOSING = np.radians(8.0)
"""Ends of a stride that differ by more than this are not the same instant of two strides (a choice)."""


def find_period(time_s: np.ndarray, motion: np.ndarray, forces: Sequence[tuple[np.ndarray, np.ndarray]],
                loaded: Mapping[str, Sequence[Stance]], moved: Mapping[str, Sequence[Stance]], *,
                stated_s: float | None = None, file: object = None) -> tuple[float, str]:
    """The stride of a recording in seconds, and in words by what.

    Two strikes or two lift-offs of one foot on the plates tell it; else two of them in the motion, sharpened by
    the self-similarity nearby; else the self-similarity alone: the time by which the recording is shifted against
    itself with the least squares of the differences of all angles, of their rates and of the forces, each over its
    own spread. InputError where the recording holds no whole stride, or does not repeat itself.

    Args:
        time_s: (n,) s. motion: (n, m) joint angles, rad.
        forces: times (j,) s and forces (j, 2) N of each foot; NaN where a force is not known.
        loaded: stances on the plates by FEET. moved: the same by the feet's motion. stated_s: a stride that is known.
    """
    alike = _Alike(time_s, motion, forces)

    def period(seconds: float, method: str) -> tuple[float, str]:
        closing = alike.closing(seconds)
        if closing > LARGEST_CLOSING:
            raise InputError(
                f"its two ends, {seconds:.3f} s apart ({method}), differ by {np.degrees(closing):.1f}° RMS", file=file,
                where="kinematics", right="A periodic stride needs steady walking")
        return seconds, method

    record = float(time_s[-1] - time_s[0])
    if stated_s is not None:
        if not STRIDES_S[0] <= stated_s <= min(STRIDES_S[1], record):
            raise InputError(f"{stated_s:g} s is no stride of a motion of {record:.2f} s", where="period_s",
                             right=f"It must be from {STRIDES_S[0]:g} to {STRIDES_S[1]:g} s")
        return period(stated_s, "what was asked for")
    lengths = [s.duration_s for stances in (*loaded.values(), *moved.values()) for s in stances if s.complete]
    low, high = STRIDES_S
    if lengths:
        low, high = np.median(lengths) / MOST_SHARE, np.median(lengths) / LEAST_SHARE
    if record < low:
        raise InputError(f"the motion lasts {record:.2f} s, a stride at least {low:.2f} s", file=file,
                         where="kinematics", right="A periodic stride needs a whole one: record longer")
    for stances, where in ((loaded, "the plates"), (moved, "the motion of the foot")):
        for foot, what, seconds, count in _intervals(stances, low, high):
            method = f"{count + 1} {what} of the {FEET[foot]} foot in {where}"
            bracket = (seconds - NEAR_EVENTS_S, min(seconds + NEAR_EVENTS_S, record - LEAST_OVERLAP_S))
            if stances is moved and bracket[1] - bracket[0] > NEAR_EVENTS_S:
                return period(alike.best(*bracket)[0], f"{method}, sharpened by self-similarity")
            return period(seconds, method)
    high = min(high, record - LEAST_OVERLAP_S)
    if low >= high:
        raise InputError(f"the motion lasts {record:.2f} s and shows no two strikes of one foot; a stride takes at "
                         f"least {low:.2f} s", file=file, where="kinematics", right="Record longer")
    seconds, inside = alike.best(low, high)
    if not inside:
        raise InputError(f"the motion does not repeat itself between {low:.2f} and {high:.2f} s", file=file,
                         where="kinematics", right="A periodic stride needs steady walking over more than a stride")
    return period(seconds, "self-similarity of the motion and the forces")


def _intervals(stances: Mapping[str, Sequence[Stance]], low: float,
               high: float) -> Iterator[tuple[str, str, float, int]]:
    """Foot, kind of event, mean interval and how many, wherever one event of a foot was seen more than once."""
    for what, attribute, seen in (("strikes", "start_s", "start_seen"), ("lift-offs", "end_s", "end_seen")):
        for foot, own in stances.items():
            instants = [getattr(stance, attribute) for stance in own if getattr(stance, seen)]
            steps = [b - a for a, b in pairwise(instants) if low <= b - a <= high]
            if steps:
                yield foot, what, float(np.mean(steps)), len(steps)


class _Alike:
    """A recording beside itself, shifted in time."""

    def __init__(self, time_s: np.ndarray, motion: np.ndarray,
                 forces: Sequence[tuple[np.ndarray, np.ndarray]]) -> None:
        self.start, self.end = float(time_s[0]), float(time_s[-1])
        grid, self.angles = np.arange(self.start, self.end, GRID_S), CubicSpline(time_s, motion)
        self.parts = [(part, float(np.sqrt(np.sum(self.angles(grid, order).std(axis=0) ** 2))))
                      for order, part in enumerate((self.angles, self.angles.derivative()))]
        for force_time_s, force in forces:
            known = np.isfinite(force).all(axis=1)
            if known.any() and (spread := float(np.sqrt(np.sum(force[known].std(axis=0) ** 2)))) > 0.0:
                self.parts.append((_linear(force_time_s, force), spread))

    def _times(self, seconds: float) -> np.ndarray:
        # As many for every shift: a number that changes with it would put steps into the cost.
        return np.linspace(self.start, self.end - seconds, SAMPLES)

    def cost(self, seconds: float) -> float:
        """Mean square of the differences, each over its own spread."""
        times = self._times(seconds)
        total = 0.0
        for part, spread in self.parts:
            difference = part(times + seconds) - part(times)
            known = np.isfinite(difference).all(axis=1)
            if known.any():
                total += float(np.mean(np.sum(difference[known] ** 2, axis=1))) / spread**2
        return total

    def best(self, low: float, high: float) -> tuple[float, bool]:
        """The shift with the least cost, and whether it lies inside the bracket."""
        shifts = np.arange(low, high, GRID_S)
        costs = [self.cost(shift) for shift in shifts]
        at = int(np.argmin(costs))
        near = (max(low, shifts[at] - 2 * GRID_S), min(high, shifts[at] + 2 * GRID_S))
        found = minimize_scalar(self.cost, bounds=near, method="bounded", options={"xatol": 1e-5})
        return float(found.x), 0 < at < len(shifts) - 1

    def closing(self, seconds: float) -> float:
        """RMS difference of the angles; NaN without an overlap."""
        if self.end - self.start <= seconds:
            return float("nan")
        times = self._times(seconds)
        return float(np.sqrt(np.mean((self.angles(times + seconds) - self.angles(times)) ** 2)))


def _linear(time_s: np.ndarray, values: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """A force between its samples, unknown beside unknown ones."""
    return lambda times: np.column_stack([np.interp(times, time_s, column, left=np.nan, right=np.nan)
                                          for column in values.T])
