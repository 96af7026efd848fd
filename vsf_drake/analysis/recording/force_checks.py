"""Whether forces and motion belong to one person and one clock: mass, lag, contacts, centre of pressure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vsf_drake.analysis.recording.check import FITTED_LAG_BW_PER_S, Check, grade
from vsf_drake.analysis.recording.foot import FootMotion
from vsf_drake.motion.events import Stance, longest_run
from vsf_drake.motion.filters import low_pass
from vsf_drake.motion.plates import PlateRecording
from vsf_drake.parameters import GRAVITY

MASS = (0.03, 0.10)
"""Error of the mass: a force is that share of body weight off."""
MASS_ONE_FOOT = (0.06, 0.15)
"""The same where only single support of one foot is measured: a rigid trunk tells the body's acceleration over a few
tenths of a second to a few percent (a choice)."""
LEAST_S = 0.25
"""Shortest measured time that tells a mass or a lag (a choice)."""
LAG_S = (0.015, 0.030)
"""Lag: 10 ms at 100 deg/s of hip are 1 degree or 7.5 % body weight, but a rigid trunk tells the body's
acceleration to 10 ms or so only; so the limits are choices of one and two frames at 67 Hz."""
TOLD_S = 0.010
LARGEST_LAG_S = 0.15
LAG_CUTOFF_HZ = 6.0
MOST_OF_IT = 0.8
"""Share of the known time that a shift must leave to be judged by it (a choice)."""
BELIEVABLE_R = 0.85
"""Correlation of force and acceleration below which no lag is read from it (a choice)."""
EVENT_LAG_S = (0.040, 0.080)
"""Touch-down from the foot's motion against the plate's: kinematic events are within 35 ms of 20 N."""
OUTSIDE_M = (0.07, 0.14)
"""Centre of pressure beside the line from heel to toe: half a foot's width and as much again as it curves; twice that.
Choices."""
LOADED_N = 50.0
LEVER = (0.15, 0.03)
"""Spread of the load's place ahead of and behind the body, and its distance beside it, over the body's height, below
which the direction of a force says nothing: a stance spans about 0.4, feet stand about 0.08 beside (choices)."""
LEAST_SHEAR = 0.01
"""Sideways force over the vertical one below which its sign says nothing (a choice): usual are 0.03 to 0.06."""
STRONG_N = 200.0


def covered(time_s: np.ndarray, plates: Mapping[str, PlateRecording], measured: Mapping[str, Sequence[Stance]],
            moving: Mapping[str, Sequence[Stance]], *, margin_s: float = 0.03) -> np.ndarray:
    """(n,) bool: the instants at which the plates feel every foot that is on the ground.

    Args:
        time_s: (n,) s.
        plates: by foot. measured: stances that the plates saw. moving: stances as the feet's motion tells them.
        margin_s: by which foot contacts that no plate saw are widened.
    """
    known = np.ones(len(time_s), dtype=bool)
    for side in ("right", "left"):
        on_plate = np.zeros(len(time_s), dtype=bool)
        for s in measured.get(side, ()):
            on_plate |= (time_s >= s.start_s - margin_s) & (time_s <= s.end_s + margin_s)
        for s in moving.get(side, ()):
            seen = [m for m in measured.get(side, ()) if min(m.end_s, s.end_s) > max(m.start_s, s.start_s)]
            if not seen:
                known &= ~((time_s >= s.start_s - margin_s) & (time_s <= s.end_s + margin_s)) | on_plate
    for plate in plates.values():
        known &= (time_s >= plate.time_s[0]) & (time_s <= plate.time_s[-1])
    return known


def total_vertical(time_s: np.ndarray, plates: Mapping[str, PlateRecording]) -> np.ndarray:
    """(n,) N on all feet at `time_s`."""
    total = np.zeros(len(time_s))
    for plate in plates.values():
        total += np.interp(time_s, plate.time_s, plate.force_W[:, 2])
    return total


def mass(time_s: np.ndarray, vertical_n: np.ndarray, up_m_per_s: np.ndarray, known: np.ndarray, *,
         mass_kg: float, feet: int) -> Check:
    """The mass that the plates felt, against the subject's: impulse = m (g T + change of vertical velocity).

    Args:
        time_s: (n,) s. vertical_n: (n,) N on all feet.
        up_m_per_s: (n,) vertical velocity of the body's centre of mass.
        known: (n,) bool, from `covered`. feet: how many feet have plates.
    """
    name, rows = "mass from the forces", longest_run(known)
    if len(rows) < 3 or time_s[rows[-1]] - time_s[rows[0]] < LEAST_S:
        return Check(name, "doubtful", None, "kg", "The mass cannot be told from the forces: there is no time in which "
                     f"every foot on the ground is on a plate. The subject's {mass_kg:.1f} kg are taken on trust.",
                     needed=True)
    start, end = rows[0], rows[-1]
    impulse = float(np.trapezoid(vertical_n[rows], time_s[rows]))
    duration = float(time_s[end] - time_s[start])
    found = impulse / (GRAVITY * duration + float(up_m_per_s[end] - up_m_per_s[start]))
    error = found / mass_kg - 1.0
    limits = MASS if feet > 1 else MASS_ONE_FOOT
    mark = grade(error, *limits)
    what = "agree with" if mark == "good" else "contradict"
    sentence = f"The forces over {duration:.2f} s belong to {found:.1f} kg; they {what} the subject's {mass_kg:.1f} kg"
    if mark != "good":
        sentence += f" ({100 * error:+.0f} %), and so every force in body weights is off by as much"
    sentence += "." if feet > 1 else ". Only one foot is measured: closer than some 5 % it cannot be told."
    return Check(name, mark, found, "kg", sentence, cost_bw=max(0.0, abs(error) - limits[0]))


def lag(time_s: np.ndarray, vertical_n: np.ndarray, up_m_per_s2: np.ndarray, known: np.ndarray) -> Check | None:
    """By how much the force comes after the motion, from the vertical acceleration of the body's centre; s.
    None if untold.

    The shift at which force and acceleration, both at 6 Hz, correlate best, searched within 150 ms.

    Args:
        time_s: (n,) s, evenly spaced; the rest as for `mass`.
    """
    rate, rows = 1.0 / float(np.median(np.diff(time_s))), longest_run(known)
    if len(rows) < 8 or time_s[rows[-1]] - time_s[rows[0]] < LEAST_S or rate <= 2.2 * LAG_CUTOFF_HZ:
        return None
    force, motion = (low_pass(series, rate_hz=rate, cutoff_hz=LAG_CUTOFF_HZ)
                     for series in (vertical_n, up_m_per_s2))
    steps = round(LARGEST_LAG_S * rate)
    shifts = np.arange(-steps, steps + 1)
    inside = [(rows - shift >= 0) & (rows - shift < len(motion)) for shift in shifts]
    values = np.array([_correlation(force[rows[i]], motion[rows[i] - shift]) if i.mean() > MOST_OF_IT else -1.0
                       for i, shift in zip(inside, shifts, strict=True)])
    best = int(np.argmax(values))
    if values[best] < BELIEVABLE_R or best in (0, len(shifts) - 1):
        return None
    value = float(shifts[best] / rate)
    return _lag_check("lag of the forces", value, grade(value, *LAG_S), TOLD_S,
                      f"by the body's vertical acceleration (correlation {values[best]:.2f})")


def event_lag(measured: Mapping[str, Sequence[Stance]], moving: Mapping[str, Sequence[Stance]]) -> Check | None:
    """Median of touch-down by the plates minus touch-down by the feet's motion; s. None without a pair.

    Several times coarser than `lag`, for recordings in which that tells nothing.
    """
    pairs = [m.start_s - k.start_s for side in measured for m in measured[side] for k in moving.get(side, ())
             if m.start_seen and k.start_seen and min(m.end_s, k.end_s) > max(m.start_s, k.start_s)]
    if not pairs:
        return None
    value = float(np.median(pairs))
    return _lag_check("lag of the forces at touch-down", value, grade(value, *EVENT_LAG_S), EVENT_LAG_S[0],
                      f"by {len(pairs)} touch-down{'s' if len(pairs) > 1 else ''}, each known to 35 ms or so",
                      fine="no coarse fault of the clocks, and a finer one cannot be told")


def _lag_check(name: str, value: float, mark: str, told_s: float, how: str, *, fine: str = "one clock") -> Check:
    way = "after" if value > 0 else "before"
    sentence = f"The forces come {1e3 * abs(value):.0f} ms {way} the motion, {how}"
    sentence += (f": {fine}." if mark == "good" else
                 ": 10 ms are about 1° of hip angle, or 7 % of body weight. Do both files count from one instant?")
    return Check(name, mark, value, "s", sentence, cost_bw=FITTED_LAG_BW_PER_S * abs(value) * (abs(value) > told_s))


def cop_under_foot(foot: FootMotion, plate: PlateRecording, cop_W: np.ndarray) -> Check | None:
    """How far the centre of pressure lies beside the line from heel to toe (90th percentile over loaded frames); m.

    Args:
        cop_W: (n, 3) m at the foot's times.
    """
    load = np.interp(foot.time_s, plate.time_s, plate.force_W[:, 2], left=0.0, right=0.0)
    rows = (load > LOADED_N) & np.isfinite(cop_W).all(axis=1)
    if not rows.any():
        return None
    heel, toe, cop = foot.heel_W[rows, :2], foot.toe_W[rows, :2], cop_W[rows, :2]
    along = toe - heel
    share = np.clip(np.sum((cop - heel) * along, axis=1) / np.maximum(np.sum(along**2, axis=1), 1e-12), 0.0, 1.0)
    value = float(np.percentile(np.linalg.norm(cop - heel - share[:, None] * along, axis=1), 90))
    mark = grade(value, *OUTSIDE_M)
    sentence = f"The centre of pressure stays within {1e3 * value:.0f} mm of the {foot.side} foot's middle line"
    sentence += (": plate and foot belong together." if mark == "good" else
                 ": is this the right plate, do plates and markers share one origin?")
    return Check("centre of pressure under the foot", mark, value, "m", sentence, foot.side, needed=True)


def shear(plate: PlateRecording, body_W: np.ndarray, side: str) -> Check | None:
    """Whether the horizontal force of one foot points to the body: a wrong sign of an axis turns it away.

    The ground reaction of a walking person passes near the centre of mass (an inverted pendulum), so its slope over
    the vertical follows that of the line from the centre of pressure to there: braking ahead of the body, driving
    behind it, inward beside it. None where the load is too little displaced to tell.

    Args:
        body_W: (n, 3) m, the centre of mass at the plate's times, NaN where unknown.
    """
    known = np.isfinite(plate.cop_W[:, :2]).all(axis=1) & np.isfinite(body_W).all(axis=1)
    rows = known & (plate.force_W[:, 2] > STRONG_N)
    if np.count_nonzero(rows) < 10:
        return None
    lever = (body_W[rows, :2] - plate.cop_W[rows, :2]) / body_W[rows, 2:]
    slope = plate.force_W[rows, :2] / plate.force_W[rows, 2:]
    away = []
    if np.ptp(lever[:, 0]) > LEVER[0]:
        away += [("fore-aft", float(np.polyfit(lever[:, 0], slope[:, 0], 1)[0]))]
    beside, aside = float(np.median(lever[:, 1])), float(np.median(slope[:, 1]))
    if abs(beside) > LEVER[1] and abs(aside) > LEAST_SHEAR:
        away += [("sideways", aside / beside)]
    if not away:
        return None
    names = [name for name, value in away if value < 0.0]
    value = min(value for _, value in away)
    if not names:
        return Check("direction of the force", "good", value, "1", f"The horizontal force on the {side} foot points to "
                     "the body, as in walking.", side)
    return Check("direction of the force", "unusable", value, "1", f"The {' and '.join(names)} force on the {side} "
                 "foot points away from the body, which would throw a person over: the sign of an axis of the plate or "
                 "of the force file is wrong.", side)


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt(np.sum(a * a) * np.sum(b * b)))
    return float(np.sum(a * b)) / size if size > 0.0 else -1.0
