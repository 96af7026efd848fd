"""How a foot moved, and when it stood flat. Arrays only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.motion.events import Stance
from vsf_drake.motion.runs import longest_run

FLAT_RAD = np.radians(1.5)
"""A foot is flat while its sole is within this of its usual angle in mid-stance: a few times what filtered markers
scatter, and no more than 3 mm at the middle of a foot that begins to roll (a choice)."""
MIDDLE = (0.25, 0.45)
"""Shares of stance in which every foot of a walk is flat: after the forefoot is down, before the heel rises."""
SEARCH = (0.10, 0.70)
"""Shares of stance in which flat instants are looked for."""
TURNS_RAD = np.radians(3.0)
"""A foot that turns by more than this in `MIDDLE`, a fifth of stance, does not stand (a choice: twice `FLAT_RAD`)."""
SHORTEST_FLAT_S = 0.10
"""A foot that keeps its angle for less than this (a prosthesis under a turning shank) is judged over `MIDDLE`."""
FEWEST_FRAMES = 3
SLACK_S = 0.05
"""By which mid-stance may reach over an end of the record (a choice: a third of it)."""
BALL = 0.7
"""Heel to ball as a share of the foot's length, on which the heel turns when it rises (a usual figure)."""


@dataclass(frozen=True, eq=False)
class FootMotion:
    """Points of one foot over time, in W.

    Attributes:
        side: "right" or "left".
        time_s: (n,) s, evenly spaced.
        heel_W, toe_W, ankle_W: (n, 3) m; heel and toe on the sole, at one height when it is flat.
        lowest_m: (n,) m, height of the foot's lowest point.
        prosthetic: whether this is the prosthesis.
        undeformed: whether the foot was put under the shank as a rigid body, or has its markers on a part that turns
            with the shank, where the sole of a prosthetic foot bends and stays flat.
    """

    side: str
    time_s: np.ndarray
    heel_W: np.ndarray
    toe_W: np.ndarray
    ankle_W: np.ndarray
    lowest_m: np.ndarray
    prosthetic: bool = False
    undeformed: bool = False

    @property
    def pitch_rad(self) -> np.ndarray:
        """(n,) angle of the sole against the floor, toe up +."""
        along = self.toe_W - self.heel_W
        return np.arctan2(along[:, 2], np.hypot(along[:, 0], along[:, 1]))

    @property
    def height_m(self) -> np.ndarray:
        """(n,) height of the middle of the sole."""
        return 0.5 * (self.heel_W[:, 2] + self.toe_W[:, 2])

    @property
    def ball_m(self) -> np.ndarray:
        """(n,) height of the sole under the ball of the foot."""
        return (1.0 - BALL) * self.heel_W[:, 2] + BALL * self.toe_W[:, 2]

    def rows(self, start_s: float, end_s: float) -> np.ndarray:
        """(n,) bool: the frames from `start_s` to `end_s`."""
        return (self.time_s >= start_s) & (self.time_s <= end_s)


def shares(stance: Stance, share: tuple[float, float]) -> tuple[float, float]:
    """The instants (s) at two shares of a stance."""
    return stance.start_s + share[0] * stance.duration_s, stance.start_s + share[1] * stance.duration_s


def whole(stance: Stance, usual_s: float | None) -> Stance | None:
    """The stance with the end that the record cuts placed so that it lasts `usual_s`; None where that is unknown."""
    if stance.complete:
        return stance
    if usual_s is None or not (stance.start_seen or stance.end_seen):
        return None
    if stance.start_seen:
        return Stance(stance.start_s, max(stance.end_s, stance.start_s + usual_s))
    return Stance(min(stance.start_s, stance.end_s - usual_s), stance.end_s)


def flat_phase(foot: FootMotion, stance: Stance, *, usual_s: float | None = None) -> np.ndarray | None:
    """Indices of the frames in which the foot stands flat in `stance`; None if mid-stance is not in the record.

    The longest run within 1.5 degrees of the sole's usual angle in mid-stance; mid-stance for a foot that keeps none.
    """
    laid_out = whole(stance, usual_s)
    if laid_out is None or not foot.time_s[0] <= shares(laid_out, MIDDLE)[0] + SLACK_S:
        return None
    stance = laid_out
    middle = np.flatnonzero(foot.rows(*shares(stance, MIDDLE)))
    if len(middle) < FEWEST_FRAMES or foot.time_s[-1] < shares(stance, MIDDLE)[1] - SLACK_S:
        return None
    pitch = foot.pitch_rad
    usual = float(np.median(pitch[middle]))
    longest = longest_run(foot.rows(*shares(stance, SEARCH)) & (np.abs(pitch - usual) < FLAT_RAD))
    if len(longest) < FEWEST_FRAMES or foot.time_s[longest[-1]] - foot.time_s[longest[0]] < SHORTEST_FLAT_S:
        return middle
    return longest


def turns_in_stance(foot: FootMotion, stances: Sequence[Stance], *, usual_s: float | None = None) -> bool:
    """Whether the foot keeps turning through mid-stance, as markers on the stiff part of a bending foot do.

    A stance that the record cuts counts if its mid-stance is there, laid out to last `usual_s`.
    """
    laid_out = [stance for stance in (whole(stance, usual_s) for stance in stances) if stance is not None
                and foot.time_s[0] <= shares(stance, MIDDLE)[0] and shares(stance, MIDDLE)[1] <= foot.time_s[-1]]
    ranges = [float(np.ptp(foot.pitch_rad[rows])) for stance in laid_out
              if (rows := foot.rows(*shares(stance, MIDDLE))).any()]
    return bool(ranges) and float(np.median(ranges)) > TURNS_RAD


def slip_velocity(foot: FootMotion, point_W: np.ndarray) -> np.ndarray:
    """(n, 2) horizontal velocity (m/s) of that part of the foot, taken as rigid, which is at `point_W` (n, 3).

    NaN where the point is. With the centre of pressure as point it is the slip of the sole under the load.
    """
    origin, R = _frame(foot)
    fixed = np.einsum("nji,nj->ni", R, np.asarray(point_W) - origin)
    R_dot, v = np.gradient(R, foot.time_s, axis=0), np.gradient(origin, foot.time_s, axis=0)
    return (v + np.einsum("nij,nj->ni", R_dot, fixed))[:, :2]


def floor_point(foot: FootMotion) -> np.ndarray:
    """(n, 3) m: the floor under the middle of the sole."""
    middle = 0.5 * (foot.heel_W + foot.toe_W)
    return np.column_stack([middle[:, :2], np.zeros(len(middle))])


def _frame(foot: FootMotion) -> tuple[np.ndarray, np.ndarray]:
    """Origin (n, 3) and axes (n, 3, 3) of the foot from its three points: x to the toe, y left."""
    x = foot.toe_W - foot.heel_W
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(foot.ankle_W - foot.heel_W, x)
    y = y / np.linalg.norm(y, axis=1, keepdims=True)
    return foot.heel_W, np.stack([x, y, np.cross(x, y)], axis=2)
