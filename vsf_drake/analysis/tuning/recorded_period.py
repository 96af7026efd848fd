"""How long a stride takes: from what both ends of a recording have in common, or from two like events of one foot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from vsf_drake.errors import InputError
from vsf_drake.motion.events import Stance

LEAST_SHARE, MOST_SHARE = 0.5, 0.75
"""Stance may take this share of a stride: walking, from fast to slow (choices; 0.62 is usual)."""
STRIDES_S = (0.7, 2.2)
"""Where no stance is known."""
LEAST_OVERLAP_S = 0.1
"""The recording must outlast the stride by this for its two ends to be compared."""
NEAR_EVENTS_S = 0.06
"""Kinematic events are wrong by up to 0.035 s each (see `motion.kinematic_events`)."""
GRID_S = 0.005
SAMPLES = 200
FEET = {"P": "prosthetic", "I": "intact"}


@dataclass(frozen=True)
class Period:
    """Attributes: seconds: of one stride. method: in words. closing: RMS difference of all angles (rad) between both
    ends of the recording, one stride apart; NaN if they do not overlap. overlap_s: by how much they do."""

    seconds: float
    method: str
    closing: float
    overlap_s: float


def find_period(time_s: np.ndarray, motion: np.ndarray, forces: Sequence[tuple[np.ndarray, np.ndarray]],
                loaded: Mapping[str, Sequence[Stance]], moved: Mapping[str, Sequence[Stance]], *,
                stated_s: float | None = None, file: object = None) -> Period:
    """The stride of a recording.

    Two strikes or two lift-offs of one foot on the plates tell it; else two of them in the motion, sharpened by
    the self-similarity nearby; else the self-similarity alone: the time by which the recording is shifted against
    itself with the least squares of the differences of all angles, of their rates and of the forces, each over its
    own spread.

    Args:
        time_s: (n,) s. motion: (n, m) joint angles, rad.
        forces: times (j,) s and forces (j, 2) N of each foot; NaN where a force is not known.
        loaded: stances on the plates by "P" (prosthetic foot) and "I" (intact). moved: the same by the feet's motion.
        stated_s: the stride, if it is known already.

    Raises:
        InputError: the recording holds no whole stride, or does not repeat itself.
    """
    alike = _Alike(time_s, motion, forces)
    if stated_s is not None:
        if not STRIDES_S[0] <= stated_s <= min(STRIDES_S[1], time_s[-1] - time_s[0]):
            raise InputError(f"{stated_s:g} s is no stride of a motion of {time_s[-1] - time_s[0]:.2f} s",
                             where="period_s", right=f"It must be from {STRIDES_S[0]:g} to {STRIDES_S[1]:g} s")
        return _made(alike, float(stated_s), "what was asked for", file)
    lengths = [s.duration_s for stances in (*loaded.values(), *moved.values()) for s in stances if s.complete]
    low, high = STRIDES_S
    if lengths:
        low, high = np.median(lengths) / MOST_SHARE, np.median(lengths) / LEAST_SHARE
    record = float(time_s[-1] - time_s[0])
    if record < low:
        raise InputError(f"the motion lasts {record:.2f} s, a stride at least {low:.2f} s", file=file,
                         where="kinematics", right="A periodic stride needs a whole one; ask for the prosthetic "
                                                   "stance alone, or record longer")
    for stances, where in ((loaded, "the plates"), (moved, "the motion of the foot")):
        for foot, what, seconds, count in _intervals(stances, low, high):
            method = f"{count + 1} {what} of the {FEET[foot]} foot in {where}"
            if stances is loaded:
                return _made(alike, seconds, method, file)
            bracket = (seconds - NEAR_EVENTS_S, min(seconds + NEAR_EVENTS_S, record - LEAST_OVERLAP_S))
            if bracket[1] - bracket[0] > NEAR_EVENTS_S:
                return _made(alike, alike.best(*bracket)[0], f"{method}, sharpened by self-similarity", file)
            return _made(alike, seconds, method, file)
    high = min(high, record - LEAST_OVERLAP_S)
    if low >= high:
        raise InputError(f"the motion lasts {record:.2f} s and shows no two strikes of one foot; a stride takes at "
                         f"least {low:.2f} s", file=file, where="kinematics",
                         right="Ask for the prosthetic stance alone, or record longer")
    seconds, inside = alike.best(low, high)
    if not inside:
        raise InputError(f"the motion does not repeat itself between {low:.2f} and {high:.2f} s", file=file,
                         where="kinematics", right="A periodic stride needs steady walking over more than a stride; "
                                                   "ask for the prosthetic stance alone")
    return _made(alike, seconds, "self-similarity of the motion and the forces", file)


LARGEST_CLOSING = np.radians(8.0)
"""Ends of a stride that differ by more than this are not the same instant of two strides (a choice)."""


def _made(alike: _Alike, seconds: float, method: str, file: object) -> Period:
    closing, overlap = alike.closing(seconds)
    if closing > LARGEST_CLOSING:
        raise InputError(f"its two ends, {seconds:.3f} s apart ({method}), differ by {np.degrees(closing):.1f}° RMS",
                         file=file, where="kinematics", right="A periodic stride needs steady walking; ask for the "
                                                              "prosthetic stance alone")
    return Period(seconds, method, closing, overlap)


def _intervals(stances: Mapping[str, Sequence[Stance]], low: float, high: float):
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
        grid = np.arange(self.start, self.end, GRID_S)
        angles = CubicSpline(time_s, motion)
        self.angles = angles
        parts = [(angles, angles(grid).std(axis=0)), (angles.derivative(), angles(grid, 1).std(axis=0))]
        self.parts = [(part, float(np.sqrt(np.sum(spread**2)))) for part, spread in parts]
        for force_time_s, force in forces:
            known = np.isfinite(force).all(axis=1)
            if known.any() and (spread := float(np.sqrt(np.sum(force[known].std(axis=0) ** 2)))) > 0.0:
                self.parts.append((_Linear(force_time_s, force), spread))

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

    def closing(self, seconds: float) -> tuple[float, float]:
        """RMS difference of the angles, and the length of the overlap."""
        overlap = self.end - self.start - seconds
        if overlap <= 0.0:
            return float("nan"), 0.0
        times = self._times(seconds)
        return float(np.sqrt(np.mean((self.angles(times + seconds) - self.angles(times)) ** 2))), overlap


class _Linear:
    """A force between its samples, unknown beside unknown ones."""

    def __init__(self, time_s: np.ndarray, values: np.ndarray) -> None:
        self.time_s, self.values = time_s, values

    def __call__(self, times: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(times, self.time_s, column, left=np.nan, right=np.nan)
                                for column in self.values.T])
