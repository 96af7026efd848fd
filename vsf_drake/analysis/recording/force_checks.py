"""Whether forces and motion belong to one person and one clock: mass, lag, contacts, centre of pressure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from vsf_drake.analysis.recording.check import (
    ALIGNMENT_BW_PER_DEG,
    DOUBTFUL_BW,
    FITTED_LAG_BW_PER_S,
    FITTED_SLIP_BW_PER_M_PER_S,
    GOOD_BW,
    HEIGHT_BW_PER_MM,
    Check,
    at_most,
    cost,
    grade,
)
from vsf_drake.analysis.recording.foot import FootMotion, flat_phase, floor_point, slip_velocity
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


# How well a foot stands: sole angle, height and its drift, slip, swing clearance.
#
# The model follows the recorded shank, so whatever a foot does here that a foot on the ground cannot do becomes force:
# a rising sole unloads, a sliding one rubs. The intact foot's force does not act on the prosthesis while
# every joint is prescribed, so its errors are good up to 10 % body weight and doubts at most.


ANGLE_DEG = (GOOD_BW / ALIGNMENT_BW_PER_DEG, 8.0)
"""Sole angle at foot-flat: 3 % body weight at 0.8 degrees; the second is the fit of the offsets' prior, since a
constant error of alignment is what that fit takes out."""
ROLLING_DEG = (5.0, 8.0)
"""The same for a rigid prosthetic foot under a turning shank: it passes through flat rather than keeping it. Choices:
a shank turns by about 10 degrees in mid-stance; the fit's prior."""
HEIGHT_MM = (5.0, 50.0)
"""Height of the flat sole. The first is a choice: shoes give and skin moves by that much, and 1 mm costs 3 % body
weight before, nothing after the fit of the offsets; the second is that fit's prior."""
DRIFT_MM = (GOOD_BW / HEIGHT_BW_PER_MM, 10.0)
"""Change of height within and between foot-flats, which no constant height takes out: 3 % body weight at 1.1 mm. The
second is a choice, what a shoe gives under the ball: the prosthesis hangs from the shank, so that a foot's own drift
tells how far the markers can be trusted rather than entering the force as it is."""
INTACT_DRIFT_MM = DOUBTFUL_BW / HEIGHT_BW_PER_MM
"""Drift of an intact foot that is good: 10 % body weight of its own force, 3.6 mm."""
STANDING_SLIP_M_PER_S = ((-0.08, -0.03), (0.0, 0.03))
"""Forward and inward velocities between which a rigid prosthetic foot seems to slip where a real one rests: its socket
turns and its keel bends under the shank. What walks known not to slip show, at every stiffness."""
OTHER_LEG = 0.5
"""Share of a slip of the intact foot that is expected in the prosthetic leg's angles (a choice: one session's errors
are of one size, but not the same)."""
CLEARANCE_MM = (10.0, 0.0)
"""Height of the lowest point in mid-swing: with 8 mm a prototype's foot dragged (its keel sags); below 0 it cuts."""
INTACT_CLEARANCE_MM = 5.0
"""The same for the intact foot, whose ankle is prescribed and does not sag (a choice: noise of its height)."""
CUT_MM = -15.0
"""A swing foot deeper in the ground than this makes a force that stops it."""
SWING = (0.25, 0.75)
"""Shares of the swing in which a foot that clears the ground is up (a choice)."""


def foot_checks(foot: FootMotion, stances: Sequence[Stance], cop_W: np.ndarray | None = None, *,
                usual_s: float | None = None) -> list[Check]:
    """Every check of one foot in stance.

    Args:
        foot: its motion. stances: its stances, in order.
        cop_W: (n, 3) m centre of pressure at the foot's times, NaN where there is none.
        usual_s: how long a stance of this walk lasts, for those that the record cuts; None: these are left out.
    """
    flats = {number: rows for number, stance in enumerate(stances, start=1)
             if (rows := flat_phase(foot, stance, usual_s=usual_s)) is not None}
    if not flats:
        mark = "doubtful" if foot.prosthetic else "good"
        return [Check("foot-flat", mark, None, "", f"The {foot.side} foot is not seen standing through the middle of a "
                      "stance: sole angle, height and slip cannot be told.", foot.side)]
    found = [check(foot, rows, number) for number, rows in flats.items() for check in (sole_angle, drift)]
    found += [slip(foot, rows, number, cop_W) for number, rows in flats.items()]
    found.append(height(foot, list(flats.values())))
    if len(flats) > 1:
        found.append(height_between(foot, list(flats.values())))
    return found


def sole_angle(foot: FootMotion, rows: np.ndarray, number: int | None = None) -> Check:
    """Mean angle of the sole against the floor at foot-flat."""
    angle = float(np.degrees(np.mean(foot.pitch_rad[rows])))
    name, where = "sole angle at foot-flat", _where(foot, number)
    way = "up" if angle > 0 else "down"
    if foot.undeformed:
        sentence = (f"{where} is {abs(angle):.1f}° toe {way} on average in mid-stance as a rigid body under its shank; "
                    "the keel's bending, which is left out here, takes up a part.")
        return Check(name, grade(angle, *ROLLING_DEG), angle, "deg", sentence, foot.side, number)
    share = cost(ALIGNMENT_BW_PER_DEG * abs(angle))
    sentence = (f"{where} is {abs(angle):.1f}° toe {way} when it stands flat: {share} of body weight in "
                f"{_whose(foot)}.")
    limits = _limits(foot, ANGLE_DEG, DOUBTFUL_BW / ALIGNMENT_BW_PER_DEG)
    return Check(name, _mark(foot, grade(angle, *limits)), angle, "deg", sentence, foot.side, number)


def drift(foot: FootMotion, rows: np.ndarray, number: int | None = None) -> Check:
    """Change of the foot's height from the beginning to the end of foot-flat (straight line through it).

    Of the ball of the foot, about which a heel that begins to rise turns without being drift.
    """
    name, where = "height drift through foot-flat", _where(foot, number)
    time = foot.time_s[rows]
    height_m = foot.ankle_W[rows, 2] if foot.undeformed else foot.ball_m[rows]
    value = 1e3 * float(np.polyfit(time - time[0], height_m, 1)[0] * (time[-1] - time[0]))
    way = "rises" if value > 0 else "sinks"
    if foot.undeformed:
        sentence = (f"{where}: the ankle {way} by {abs(value):.1f} mm through mid-stance, as it does over a bending "
                    "keel; of a foot that is not tracked itself no drift can be told from that.")
        return Check(name, "good", value, "mm", sentence, foot.side, number)
    sentence = (f"{where} {way} by {abs(value):.1f} mm while it stands flat: {cost(HEIGHT_BW_PER_MM * abs(value))} of "
                "body weight in the vertical force, though an alignment takes out what is steady.")
    mark = _mark(foot, grade(value, *_limits(foot, DRIFT_MM, INTACT_DRIFT_MM)))
    return Check(name, mark, value, "mm", sentence, foot.side, number)


def slip(foot: FootMotion, rows: np.ndarray, number: int | None = None, cop_W: np.ndarray | None = None) -> Check:
    """Mean slip of the sole at foot-flat, at the centre of pressure where it is known; m/s, and mm in the sentence."""
    point = floor_point(foot)
    if cop_W is not None:
        point = np.where(np.isfinite(cop_W).all(axis=1, keepdims=True), cop_W, point)
    velocity = slip_velocity(foot, point)[rows].mean(axis=0)
    speed, lasted = float(np.hypot(*velocity)), float(foot.time_s[rows[-1]] - foot.time_s[rows[0]])
    sentence = (f"{_where(foot, number)} slides at {speed:.3f} m/s ({1e3 * speed * lasted:.1f} mm in {lasted:.2f} s) "
                "while it stands flat")
    if foot.undeformed:
        velocity *= [1.0, 1.0 if foot.side == "right" else -1.0]
        velocity -= np.clip(velocity, *np.transpose(STANDING_SLIP_M_PER_S))
        sentence += f", as a rigid body under its shank, {np.hypot(*velocity):.3f} m/s beyond what socket and keel do"
    share = float(np.hypot(*(velocity * FITTED_SLIP_BW_PER_M_PER_S)))
    if foot.prosthetic:
        sentence += f": {cost(share)} of body weight in the force even if the offsets are fitted."
    else:
        share *= OTHER_LEG
        sentence += f": {cost(share)} of body weight in the prosthetic foot's force, if its leg errs half as much."
    mark = _mark(foot, grade(share, GOOD_BW, DOUBTFUL_BW))
    return Check("slip at foot-flat", mark, speed, "m/s", sentence, foot.side, number, share)


def height(foot: FootMotion, flats: Sequence[np.ndarray]) -> Check:
    """Mean height of the sole at foot-flat over all stances."""
    value = 1e3 * float(np.mean([foot.height_m[rows].mean() for rows in flats]))
    name, where = "sole height at foot-flat", _where(foot, None)
    way = "above" if value > 0 else "below"
    if foot.undeformed:
        sentence = (f"{where}, as a rigid body, is {abs(value):.1f} mm {way} the floor in mid-stance; heel and keel "
                    "give by some 10 to 60 mm under body weight. See its height at touch-down.")
        return Check(name, "good", value, "mm", sentence, foot.side)
    sentence = (f"{where} stands flat {abs(value):.1f} mm {way} the floor: "
                f"{cost(HEIGHT_BW_PER_MM * abs(value))} of body weight in {_whose(foot)}.")
    return Check(name, _mark(foot, grade(value, *HEIGHT_MM)), value, "mm", sentence, foot.side)


def height_between(foot: FootMotion, flats: Sequence[np.ndarray]) -> Check:
    """Range of the sole's height at foot-flat over the stances."""
    levels = [1e3 * float(foot.height_m[rows].mean()) for rows in flats]
    value = max(levels) - min(levels)
    name, where = "height between stances", _where(foot, None)
    limits = _limits(foot, DRIFT_MM, INTACT_DRIFT_MM)
    limits = (5 * limits[0], 5 * limits[1]) if foot.undeformed else limits
    sentence = (f"{where} stands at heights that differ by {value:.1f} mm from stance to stance: one height of the "
                "prosthesis cannot fit all of them" + (", though a bending keel may." if foot.undeformed else "."))
    share = HEIGHT_BW_PER_MM * value / 2 / (5 if foot.undeformed else 1) if foot.prosthetic else None
    return Check(name, _mark(foot, grade(value, *limits)), value, "mm", sentence, foot.side, cost_bw=share)


def clearance(foot: FootMotion, stances: Sequence[Stance]) -> list[Check]:
    """Least height of the foot's lowest point in mid-swing, over all swings; for the foot that the model has."""
    found = []
    for number, (before, after) in enumerate(pairwise(stances), start=1):
        start, length = before.end_s, after.start_s - before.end_s
        rows = foot.rows(start + SWING[0] * length, start + SWING[1] * length)
        if rows.any() and before.end_seen and after.start_seen:
            found.append((float(1e3 * foot.lowest_m[rows].min()), number))
    if not found:
        return []
    value, number = min(found)
    clear = value >= (CLEARANCE_MM[0] if foot.prosthetic else INTACT_CLEARANCE_MM)
    mark = "good" if clear else "doubtful" if value >= CUT_MM else "unusable"
    brushes = ("it may brush the ground" + (", as keel and socket sag in swing." if foot.prosthetic else
                                                          "; a toe that bends in life is stiff there."))
    meaning = ("it swings clear." if clear else brushes if value >= CLEARANCE_MM[1] else
               "it cuts the ground in mid-swing.")
    sentence = f"The model's {foot.side} foot clears the floor by {value:.0f} mm in swing: {meaning}"
    return [Check("swing clearance", _mark(foot, mark), value, "mm", sentence, foot.side, number)]


def _where(foot: FootMotion, number: int | None) -> str:
    name = f"The {foot.side} ({'prosthetic' if foot.prosthetic else 'intact'}) foot"
    return f"{name} in stance {number}" if number else name


def _limits(foot: FootMotion, limits: tuple[float, float], intact_good: float) -> tuple[float, float]:
    """The limits of a foot: an intact one, whose force is not what is asked for, is good up to 10 % body weight."""
    return limits if foot.prosthetic else (intact_good, max(limits[1], intact_good))


def _whose(foot: FootMotion) -> str:
    return "the force unless the offsets are fitted" if foot.prosthetic else "this foot's own force"


def _mark(foot: FootMotion, mark: str) -> str:
    return mark if foot.prosthetic else at_most(mark, "doubtful")


# How the feet of the model's person meet the model's ground, before anything is simulated. Arrays only.


TOUCH_DOWN_MM = (10.0, 50.0)
"""Height of the foot's lowest point when the plate feels it: a heel comes down at 0.4 m/s or so, so 10 ms are 4 mm, and
other heels are rounder or longer than the model's: walks of another prosthesis whose height is known to be right show
up to 8 mm. The second is the prior of the offsets' fit, which moves the prosthesis by as much."""
INTACT_DEPTH_MM = 25.0
"""Three spheres of the intact heel sink by 10 mm under body weight, the last two of its forefoot by 17 mm under 1.1
body weights; the rest is for the shape of other feet (a choice)."""
STIFFNESS_N_PER_MM = ((66.0, 10.0), (151.0, 32.0))
"""Forefoot stiffness at both ends of the carriage's reach (McGeehan 2021), straight in between."""
PUSH_OFF_BW = 1.2
"""Load on the forefoot at push-off, at most (a choice)."""
SOCKET_MM = 25.0
"""What the nominal socket adds at the toe: 120 N m on 1000 N m/rad, 0.2 m away."""
TOO_DEEP_MM = 50.0
"""Depth beyond what the foot gives that no fit of the offsets takes out (its prior)."""


def touch_down(foot: FootMotion, stances: Sequence[Stance]) -> Check | None:
    """Mean height of the model foot's lowest point at the plate's touch-downs; None if none was seen."""
    instants = [s.start_s for s in stances if s.start_seen and foot.time_s[0] <= s.start_s <= foot.time_s[-1]]
    if not instants:
        return None
    value = 1e3 * float(np.mean(np.interp(instants, foot.time_s, foot.lowest_m)))
    size = abs(value)
    mark = "good" if size < TOUCH_DOWN_MM[0] else "doubtful" if size < TOUCH_DOWN_MM[1] else "unusable"
    way = "above" if value > 0 else "below"
    sentence = f"The model's {foot.side} foot is {size:.1f} mm {way} its ground when the plate feels it touch down"
    late = "late" if value > 0 else "early"
    remedy = ("the fit of the offsets (--fit-offsets) may take it out" if foot.prosthetic else
              "the intact foot's force will not be right")
    sentence += ("." if mark == "good" else
                 f": it lands {late}. Lengths, angles or the pelvis's height are off by that; {remedy}.")
    return Check("height at touch-down", _mark(foot, mark), value, "mm", sentence, foot.side)


def depth(foot: FootMotion, stances: Sequence[Stance], *, mass_kg: float, fulcrum_m: float) -> Check | None:
    """How deep the model's undeformed foot goes into the ground while the plate carries it, against what it gives."""
    rows = np.zeros(len(foot.time_s), dtype=bool)
    for stance in stances:
        rows |= foot.rows(stance.start_s, stance.end_s)
    if not rows.any():
        return None
    value = -1e3 * float(foot.lowest_m[rows].min())
    gives = INTACT_DEPTH_MM
    if foot.prosthetic:
        position, stiffness = zip(*STIFFNESS_N_PER_MM, strict=True)
        gives = SOCKET_MM + PUSH_OFF_BW * mass_kg * GRAVITY / float(np.interp(1e3 * fulcrum_m, position, stiffness))
    name, where = "depth in the ground", f"The model's {foot.side} foot, undeformed,"
    if value <= 0.0:
        mark = "doubtful" if -value < TOO_DEEP_MM else "unusable"
        sentence = f"{where} never reaches the ground in stance ({-value:.0f} mm above it): no force would come of it."
    else:
        mark = "good" if value <= gives else "doubtful" if value < gives + TOO_DEEP_MM else "unusable"
        sentence = f"{where} goes {value:.0f} mm deep into the ground; under full load it gives by {gives:.0f} mm"
        sentence += "." if mark == "good" else ": it would be pressed harder than the plate says."
    return Check(name, _mark(foot, mark), value, "mm", sentence, foot.side)
