"""Whether forces and motion belong to one person and one clock, and whether feet stand and swing as
a foot can."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import trapezoid

from vsf_drake.laws.beam import overhung_stiffness, section_inertia
from vsf_drake.model.bench_curves import PUBLISHED_N_PER_M
from vsf_drake.model.parameters import GRAVITY, ModelParameters
from vsf_drake.motion.events import Span, Stance, longest_run, overlap_s, runs, within
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.markers.segments import from_line
from vsf_drake.motion.trajectory import columns_at, low_pass, spacing
from vsf_drake.recording import DOUBTFUL_BW, GOOD_BW, Check, at_most, checked, grade
from vsf_drake.recording.foot import (
    MIDDLE,
    FootMotion,
    floor_point,
    shares_of,
    slip_velocity,
)

ALIGNMENT_BW_PER_DEG = 0.037
HEIGHT_BW_PER_MM = 0.028
FITTED_LAG_BW_PER_S, FITTED_SLIP_BW_PER_M_PER_S = 2.5, (0.6, 0.25)
"""What a fit of the offsets leaves of a lag, and of a slip of the whole person fore-aft and
sideways."""
MASS = (0.03, 0.10)  # error of the mass: a force is that share of body weight off
# where only one foot is measured: a rigid trunk's acceleration is good to a few percent
MASS_ONE_FOOT = (0.06, 0.15)
MASS_CHECK = "mass from the forces"
MASS_BW = 0.67
"""Root mean square of the resultant over stance and 0.25 s around it, by which the force in body
weights is off for a mass that is off by its whole self. Measured, as FITTED_REST, SETTING_BW_PER_M
and the likes in `motion_checks`, on walks of two synthetic persons and confirmed on a third
(studies/results/recording_faults.json)."""
REST_SHARE, REST_S, REST_EDGE_S = 0.1, 0.1, 0.03
"""A plate is at rest where it carries less than this share of its peak, for at least this long,
without so much at both ends (choices)."""
REST_N = 5.0  # a plate that was zeroed before the walk shows less (a choice)
ZERO = "zero of "  # begins the check's name, before the plate's
FITTED_REST = 0.75
"""Share of a vertical offset of the plate by which the predicted force is off, once the offsets of
the foot are fitted to it."""
LEAST_S = 0.25  # shortest measured time that tells a mass or a lag (a choice)
LAG_S = (0.015, 0.030)
"""One and two frames at 67 Hz (choices): 10 ms at 100 deg/s of hip are 1 degree or 7.5 % body
weight, but a rigid trunk tells the body's acceleration to 10 ms or so only."""
TOLD_S = 0.010
LARGEST_LAG_S = 0.15
LAG_CUTOFF_HZ = 6.0
MOST_OF_IT = 0.8  # share of the known time that a shift must leave to be judged by it (a choice)
BELIEVABLE_R = 0.9
"""Correlation of force and acceleration below which no lag is read from it: of 1.5 s of walking one
standard deviation (see `lag`) is 10 ms there, as TOLD_S, and 13 ms at 0.85. Nine synthetic walks
without a lag show up to 9 ms above it and up to 53 ms below (trunks that shift in the pelvis)."""
STEPS_HZ = 2.0  # of people who walk at the usual speed (a choice)
LIFT_OFF_S = 0.030
"""By so much later than the intact foot's motion tells does its plate feel it lift off: 21 to 42 ms
on 18 synthetic walks."""
EVENT_LAG_S = (0.025, 0.045)
"""Lag that several events tell: their median in 36 synthetic walks without one is 21 ms at most, in
walks of four people 20. The second is a choice."""
FEW_EVENTS, FEW_EVENT_LAG_S = 3, (0.040, 0.080)
"""Of fewer events each is known to 35 ms only."""
# beside the line from heel to toe: half a foot and as much as it curves; twice that (choices)
OUTSIDE_M = (0.07, 0.14)
LOADED_N = 50.0
LEVER = (0.15, 0.03)
"""Spread of the load's place ahead of and behind the body, and its distance beside it, over the
body's height, below which the direction of a force says nothing: a stance spans about 0.4, feet
stand about 0.08 beside (choices)."""
# sideways over vertical force below which its sign says nothing (a choice): usual are 0.03 to 0.06
LEAST_SHEAR = 0.01
SHEAR = "direction of the force"
STRONG_N = 200.0
LEAST_AGREEMENT = 0.25
"""Slope of the fore-aft force against the place of the load below which the one does not follow the
other (a choice; walks known to be right show 0.55 to 0.8)."""


def covered(
    time_s: np.ndarray,
    plates: Mapping[str, PlateRecording],
    measured: Mapping[str, Sequence[Stance]],
    moving: Mapping[str, Sequence[Stance]],
    *,
    margin_s: float = 0.03,
) -> np.ndarray:
    """(n,) bool: the instants at which the plates feel every foot that is on the ground, by the
    stances of each foot that plates saw and that its motion tells; those that no plate saw are
    widened by the margin."""

    def widened(stances: Sequence[Stance]) -> np.ndarray:
        return within(time_s, [(s.start_s - margin_s, s.end_s + margin_s) for s in stances])

    known = np.ones(len(time_s), dtype=bool)
    for side, stances in moving.items():
        seen = measured.get(side, ())
        unseen = [s for s in stances if not any(overlap_s(m, s) > 0.0 for m in seen)]
        known &= ~widened(unseen) | widened(seen)
    for plate in plates.values():
        known &= within(time_s, [(plate.time_s[0], plate.time_s[-1])])
    return known


def rest(time_s: np.ndarray, force_n: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """What a plate shows where nobody stands on it: the middles of such times, (k,) s, and its
    median force in each, (k, 3) N, of (n,) s and (n, 3) N. None where it is never at rest, or never
    loaded."""
    peak = float(force_n[:, 2].max(initial=0.0))
    if peak < STRONG_N:
        return None
    spans = [
        (time_s[start], time_s[stop - 1]) for start, stop in runs(force_n[:, 2] < REST_SHARE * peak)
    ]
    rows = [
        within(time_s, [(start + REST_EDGE_S, end - REST_EDGE_S)])
        for start, end in spans
        if end - start > REST_S + 2.0 * REST_EDGE_S
    ]
    if not rows:
        return None
    return (
        np.array([time_s[own].mean() for own in rows]),
        np.array([np.median(force_n[own], axis=0) for own in rows]),
    )


def at_rest(time_s: np.ndarray, force_n: np.ndarray, at_s: np.ndarray) -> np.ndarray:
    """(k, 3) N that a plate of (n,) s and (n, 3) N shows unloaded at times (k,) s, on straight
    lines between its rests; zero where that is below REST_N throughout, or it never rests."""
    found = rest(time_s, force_n)
    if found is None or np.abs(found[1]).max() < REST_N:
        return np.zeros((len(at_s), 3))
    return columns_at(at_s, *found)


def plate_zero(
    time_s: np.ndarray,
    force_n: np.ndarray,
    loads: Sequence[Stance],
    *,
    plate: str,
    side: str,
    prosthetic: bool,
    mass_kg: float,
    told_n: float = 0.0,
) -> Check | None:
    """What a plate, as it is called, shows at rest: vertical force (N), in the middle of that of a
    foot's `loads` where it is largest; or what it is told to have shown. (n,) s and (n, 3) N. None
    where it is never at rest."""
    found = rest(time_s, force_n)
    if found is None or not loads:
        return None
    middles = [0.5 * (load.start_s + load.end_s) for load in loads]
    at_loads = np.interp(middles, found[0], found[1][:, 2])
    value = told_n or float(max(at_loads, key=abs))
    share = abs(value) / (mass_kg * GRAVITY)
    cost_bw = FITTED_REST * share * (abs(value) > REST_N)
    mark = grade(cost_bw, GOOD_BW, DOUBTFUL_BW)
    return checked(
        "plate_zero",
        f"{ZERO}{plate}",
        mark if prosthetic else at_most(mark, "doubtful"),
        value,
        "N",
        side=side,
        cost_bw=cost_bw if prosthetic else None,
        plate=plate,
        share=share,
        zeroed=abs(value) <= REST_N,
        drift=0.0 if told_n else float(np.ptp(found[1][:, 2])),
        cut=not force_n[force_n[:, 2] < REST_N].any(),
    )


def untold_mass(mass_kg: float) -> Check:
    """What is said of the subject's mass where no force tells it."""
    return checked(
        "mass_untold",
        "body mass that no plate tells",
        "doubtful",
        None,
        "kg",
        needed=True,
        mass_kg=mass_kg,
    )


def mass(
    time_s: np.ndarray,
    vertical_n: np.ndarray,
    up_m_per_s: np.ndarray,
    known: np.ndarray,
    *,
    mass_kg: float,
    feet: int,
) -> Check:
    """The mass that the plates felt, against the subject's: impulse = m (g T + change of vertical
    velocity).

    (n,) N on all `feet` with plates, (n,) vertical velocity of the body's centre of mass, (n,) bool
    from `covered`.
    """
    rows = longest_run(known)
    duration = float(np.ptp(time_s[rows])) if len(rows) > 2 else 0.0
    if duration < LEAST_S:
        return untold_mass(mass_kg)
    impulse = float(trapezoid(vertical_n[rows], time_s[rows]))
    felt_kg = impulse / (GRAVITY * duration + float(up_m_per_s[rows[-1]] - up_m_per_s[rows[0]]))
    error = felt_kg / mass_kg - 1.0
    limits = MASS if feet > 1 else MASS_ONE_FOOT
    return checked(
        "mass",
        MASS_CHECK,
        grade(error, *limits),
        felt_kg,
        "kg",
        cost_bw=MASS_BW * abs(error) * (abs(error) > limits[0]),
        mass_kg=mass_kg,
        error=error,
        duration=duration,
        feet=feet,
    )


def lag(
    time_s: np.ndarray, vertical_n: np.ndarray, up_m_per_s2: np.ndarray, known: np.ndarray
) -> Check | None:
    """By how much the force comes after the motion (s), from the vertical acceleration of the
    body's centre: the shift at which both, at 6 Hz, correlate best, searched within 150 ms. None if
    untold, also where it is larger than TOLD_S but no more than twice its standard error."""
    rate = 1.0 / spacing(time_s)
    rows = longest_run(known)
    if len(rows) < 8 or time_s[rows[-1]] - time_s[rows[0]] < LEAST_S or rate <= 2.2 * LAG_CUTOFF_HZ:
        return None
    force, motion = (
        low_pass(series, rate_hz=rate, cutoff_hz=LAG_CUTOFF_HZ)
        for series in (vertical_n, up_m_per_s2)
    )

    # The correlation of force(t) with acceleration(t - shift) for every shift that leaves most of
    # the known time.
    steps = round(LARGEST_LAG_S * rate)
    shifts = np.arange(-steps, steps + 1)
    inside = [(rows - shift >= 0) & (rows - shift < len(motion)) for shift in shifts]
    with np.errstate(invalid="ignore", divide="ignore"):
        values = np.nan_to_num(
            [
                np.corrcoef(force[rows[i]], motion[rows[i] - shift])[0, 1]
                if i.mean() > MOST_OF_IT
                else -1.0
                for i, shift in zip(inside, shifts, strict=True)
            ],
            nan=-1.0,
        )
    best = int(np.argmax(values))
    if values[best] < BELIEVABLE_R or best in (0, len(shifts) - 1):
        return None
    value = float(shifts[best] / rate)

    # Least squares of a shift: what else is in the acceleration, r its correlation with the force,
    # moves the best shift by sqrt((1 / r² - 1) / (n - 3)) / (2 pi f), one standard deviation, of
    # n = 2 LAG_CUTOFF_HZ T independent samples that mean, size and shift are fitted to.
    free = 2.0 * LAG_CUTOFF_HZ * float(np.ptp(time_s[rows])) - 3.0
    sd_s = (
        np.sqrt((values[best] ** -2 - 1.0) / free) / (2.0 * np.pi * STEPS_HZ)
        if free > 0.0
        else np.inf
    )
    if TOLD_S < abs(value) <= 2.0 * sd_s:
        return None
    return checked(
        "lag",
        "lag of the forces",
        grade(value, *LAG_S),
        value,
        "s",
        events=0,
        correlation=values[best],
        cost_bw=FITTED_LAG_BW_PER_S * abs(value) * (abs(value) > TOLD_S),
    )


def event_lag(
    measured: Mapping[str, Sequence[Stance]],
    moving: Mapping[str, Sequence[Stance]],
    prosthetic_side: str,
) -> Check | None:
    """Median of events by the plates minus the same by the feet's motion (s): every touch-down, and
    the intact foot's lift-offs less LIFT_OFF_S. Coarser than `lag`, for recordings in which that
    tells nothing. None without a touch-down."""
    pairs = [
        (side, m, k)
        for side in measured
        for m in measured[side]
        for k in moving.get(side, ())
        if overlap_s(m, k) > 0.0
    ]
    events = [m.start_s - k.start_s for _, m, k in pairs if m.start_seen and k.start_seen]
    if not events:
        return None
    events += [
        m.end_s - k.end_s - LIFT_OFF_S
        for side, m, k in pairs
        if m.end_seen and k.end_seen and side != prosthetic_side
    ]
    value = float(np.median(events))
    limits = FEW_EVENT_LAG_S if len(events) < FEW_EVENTS else EVENT_LAG_S
    return checked(
        "lag",
        "lag of the forces at touch-down",
        grade(value, *limits),
        value,
        "s",
        events=len(events),
        cost_bw=FITTED_LAG_BW_PER_S * abs(value) * (abs(value) > limits[0]),
        known_s=limits[0],
    )


def cop_under_foot(foot: FootMotion, plate: PlateRecording, cop_W: np.ndarray) -> Check | None:
    """How far the centre of pressure (n, 3) at the foot's times lies beside the line from heel to
    toe, m: the 90th percentile over loaded frames."""
    load = np.interp(foot.time_s, plate.time_s, plate.force_W[:, 2], left=0.0, right=0.0)
    rows = (load > LOADED_N) & np.isfinite(cop_W).all(axis=1)
    if not rows.any():
        return None
    value = float(
        np.percentile(
            from_line(cop_W[rows, :2], foot.heel_W[rows, :2], foot.toe_W[rows, :2])[0], 90
        )
    )
    return checked(
        "cop_under_foot",
        "centre of pressure under the foot",
        grade(value, *OUTSIDE_M),
        value,
        "m",
        side=foot.side,
        needed=foot.prosthetic,
    )


def shear(plate: PlateRecording, body_W: np.ndarray, side: str) -> Check | None:
    """Whether the horizontal force of one foot points to the body: a wrong sign of an axis turns it
    away.

    The ground reaction of a walking person passes near the centre of mass (an inverted pendulum),
    `body_W` (n, 3) m at the plate's times, NaN where unknown. None where the load is too little
    displaced to tell.
    """
    known = np.isfinite(plate.cop_W[:, :2]).all(axis=1) & np.isfinite(body_W).all(axis=1)
    rows = known & (plate.force_W[:, 2] > STRONG_N)
    if np.count_nonzero(rows) < 10:
        return None

    # F_xy / F_z against (body - centre of pressure)_xy / height: alike for a pendulum; fore-aft by
    # slope, sideways by the quotient of medians, since a foot stays on one side of the body.
    lever = (body_W[rows, :2] - plate.cop_W[rows, :2]) / body_W[rows, 2:]
    slope = plate.force_W[rows, :2] / plate.force_W[rows, 2:]
    agreement = {}
    if np.ptp(lever[:, 0]) > LEVER[0]:
        agreement["fore-aft"] = float(np.polyfit(lever[:, 0], slope[:, 0], 1)[0])
    beside = float(np.median(lever[:, 1]))
    aside = float(np.median(slope[:, 1]))
    if abs(beside) > LEVER[1] and abs(aside) > LEAST_SHEAR:
        agreement["sideways"] = aside / beside
    if not agreement:
        return None
    away = [name for name, value in agreement.items() if value < 0.0]
    follows = agreement.get("fore-aft", 1.0) > LEAST_AGREEMENT
    mark = "unusable" if away else "good" if follows else "doubtful"
    return checked("shear", SHEAR, mark, min(agreement.values()), "1", side=side, away=away)


# How well a foot stands: sole angle, height and its drift, slip, swing clearance.
#
# The model follows the recorded shank, so whatever a foot does here that a foot on the ground
# cannot do becomes force: a rising sole unloads, a sliding one rubs. The intact foot's force does
# not act on the prosthesis while every joint is prescribed, so its errors are good up to 10 % body
# weight and warnings at most.


# sole at foot-flat; the offsets' fit takes it out
ANGLE_DEG = (GOOD_BW / ALIGNMENT_BW_PER_DEG, 8.0)
ROLLING_DEG = (5.0, 8.0)
"""The same for a rigid prosthetic foot under a shank that turns by about 10 degrees in mid-stance.
Choices."""
ROLL_DEG = (3.0, 15.0)
"""Roll of the prosthetic sole at foot-flat. 1 degree of inversion moves the model's centre of
pressure laterally by 0.7 to 1.7 mm (measured, four synthetic walks): 3 degrees by 2 % of a foot's
length at most. A sole at the second does not stand (a choice)."""
ROLL_MM_PER_DEG = (0.7, 1.7)
HEIGHT_MM = (5.0, 50.0)
"""Height of the flat sole. The first is a choice: shoes give and skin moves by that much; the
second is the fit's prior (1 mm costs 3 % body weight before, nothing after the fit of the
offsets)."""
DRIFT_MM = (GOOD_BW / HEIGHT_BW_PER_MM, 10.0)
"""Change of height within and between foot-flats, which no constant height takes out: 3 % body
weight at 1.1 mm. The second is what a shoe gives under the ball (a choice)."""
INTACT_DRIFT_MM = DOUBTFUL_BW / HEIGHT_BW_PER_MM  # good: 10 % body weight of its own force, 3.6 mm
SLIP = "slip at foot-flat"
STANDING_SLIP_M_PER_S = ((-0.08, -0.03), (0.0, 0.03))
"""Forward and inward velocities between which a rigid prosthetic foot seems to slip where a real
one rests: its socket turns and its keel bends under the shank. What walks known not to slip show,
at every stiffness."""
TURN_DEG = 5.0
"""By which a sole may turn on the floor while it stands flat (a choice): friction holds it. Walks
known to be right show up to 3, with the sign of hip rotation exchanged up to 29."""
TOE_OUT_DEG, TOE_IN_DEG = 7.0, 5.0
"""Feet point outward by about the first (a usual figure); inward by more than the second few do (a
choice: two standard deviations of some 6 degrees). A sign of hip rotation exchanged turns an
outward foot inward."""
FITTED_TOE_BW_PER_DEG = 0.009
"""What a fit of the offsets leaves of a prosthetic foot that is turned about the vertical: 16 % of
body weight for 17 degrees (measured on two walks)."""
STRIKE_MM = (-12.0, 22.0)
"""Where along the model's prosthetic foot, from its heel, the centre of pressure begins (choices):
walks known to be right show -6 to 16."""
FITTED_COP_BW_PER_MM = 5e-4
"""What the fit of the offsets itself makes of a centre of pressure that is off fore-aft, since it
moves the foot under it: 1.4 % of body weight for 30 mm (measured on one walk)."""
BENDING = "setting by the foot's bending"
BENT_BW, BENT_M, BENT_FRAMES = 0.2, (0.05, 0.23), 10
"""Least load, where it lies (from A), and frames of it by which bending is judged (choices)."""
BENT_PRIOR, BENT_NOISE_M = (0.015, 0.05), 0.004
"""Standard deviations of the foot's height (m) and angle (rad), and of the depth (choices)."""
BENT_FULCRUMS_M = np.arange(0.050, 0.200, 0.004)
SETTING_BW_PER_M = 1.3
"""By how much a fulcrum named wrongly changes the predicted force, the offsets fitted."""
# lowest point in mid-swing: with 8 mm a prototype's foot dragged; below 0 it cuts
CLEARANCE_MM = (10.0, 0.0)
# its ankle is prescribed and does not sag (a choice: noise of its height)
INTACT_CLEARANCE_MM = 5.0
CUT_MM = -15.0  # a swing foot deeper in the ground than this makes a force that stops it
SWING = (0.25, 0.75)  # shares of the swing in which a foot that clears the ground is up (a choice)
TOUCH_DOWN_MM = (10.0, 50.0)
"""Height of the lowest point when the plate feels it: heels come down at 0.4 m/s, so 10 ms are
4 mm, and are rounder or longer than the model's: walks whose height is known to be right show up to
8 mm. The second is the fit's prior."""
# the intact foot's spheres sink by 10 to 17 mm; the rest is for other shapes
INTACT_DEPTH_MM = 25.0
PUSH_OFF_BW = 1.2  # load on the forefoot at push-off, at most (a choice)
SOCKET_MM = 25.0  # what the nominal socket adds at the toe: 120 N m on 1000 N m/rad, 0.2 m away
# depth beyond what the foot gives that no fit of the offsets takes out (its prior)
TOO_DEEP_MM = 50.0


def foot_checks(
    foot: FootMotion,
    flats: Mapping[int, np.ndarray],
    cop_W: np.ndarray | None = None,
    *,
    heading_rad: float = 0.0,
) -> list[Check]:
    """Every check of one foot in stance, where it is flat (`foot.flat_phases`), with the centre of
    pressure (n, 3) m at the foot's times (NaN: none).

    The walk goes in the direction `heading_rad`, from x to the left +.
    """
    if not flats:
        return [
            _of(foot, "unseen", "foot-flat", "doubtful" if foot.prosthetic else "good", None, "")
        ]
    checks = [
        check(foot, rows, number)
        for number, rows in flats.items()
        for check in (sole_angle, drift, turn)
    ]
    checks += [slip(foot, rows, number, cop_W) for number, rows in flats.items()]
    return [
        *checks,
        toe_out(foot, [*flats.values()], heading_rad),
        *heights(foot, [*flats.values()]),
    ]


def _of(
    foot: FootMotion, part: str, name: str, mark: str, value: float | None, unit: str, **more: Any
) -> Check:
    """A check of a foot; an intact one's force is not what is asked for, and makes a doubt at
    most."""
    return checked(
        part,
        name,
        mark if foot.prosthetic else at_most(mark, "doubtful"),
        value,
        unit,
        side=foot.side,
        prosthetic=foot.prosthetic,
        undeformed=foot.undeformed,
        **more,
    )


def _limits(
    foot: FootMotion, limits: tuple[float, float], intact_good: float
) -> tuple[float, float]:
    """The limits of a foot: an intact one is good up to 10 % body weight of its own force."""
    return limits if foot.prosthetic else (intact_good, max(limits[1], intact_good))


def sole_angle(foot: FootMotion, rows: np.ndarray, number: int | None = None) -> Check:
    """Mean angle of the sole against the floor at foot-flat."""
    angle = float(np.degrees(np.mean(foot.pitch_rad[rows])))
    limits = (
        ROLLING_DEG
        if foot.undeformed
        else _limits(foot, ANGLE_DEG, DOUBTFUL_BW / ALIGNMENT_BW_PER_DEG)
    )
    return _of(
        foot,
        "sole_angle",
        "sole angle at foot-flat",
        grade(angle, *limits),
        angle,
        "deg",
        stance=number,
        share=ALIGNMENT_BW_PER_DEG * abs(angle),
    )


def roll_from_shank(
    foot: FootMotion, flats: Mapping[int, np.ndarray], labels: Sequence[str]
) -> Check:
    """That a foot's own markers, `labels`, do not show its roll, and how wrong the shank's may be:
    how far from level (root mean square, deg) it makes the sole at foot-flat; None where it never
    stands flat. The prosthetic ankle is rigid, so that there the shank's is the foot's."""
    value = None
    if flats and foot.roll_rad is not None and not foot.prosthetic:
        rolls = foot.roll_rad[np.concatenate(list(flats.values()))]
        value = float(np.degrees(np.sqrt(np.mean(rolls**2))))
    return _of(
        foot,
        "roll_from_shank",
        "roll of the foot",
        "good" if foot.prosthetic else "doubtful",
        value,
        "deg",
        labels=labels,
    )


def sole_roll(
    foot: FootMotion,
    rows: np.ndarray,
    model_foot: FootMotion,
    number: int | None = None,
    *,
    seen: bool,
    inversion_rad: float | None,
) -> Check | None:
    """Mean roll of the prosthetic sole against the floor at foot-flat, as recorded (`seen` by
    markers) and as the model's foot, which is inverted against its pylon by `inversion_rad` (None:
    not stated); the larger counts. None where it is not known."""
    if foot.roll_rad is None or model_foot.roll_rad is None:
        return None
    recorded = float(np.degrees(np.mean(foot.roll_rad[rows])))
    model = float(
        np.degrees(np.mean(np.interp(foot.time_s[rows], model_foot.time_s, model_foot.roll_rad)))
    )
    value = max((recorded, model), key=abs)
    level_rad = (inversion_rad or 0.0) - np.radians(model)
    return _of(
        foot,
        "sole_roll",
        "sole roll at foot-flat",
        grade(value, *ROLL_DEG),
        value,
        "deg",
        stance=number,
        recorded=recorded,
        model=model,
        seen=seen,
        stated=inversion_rad,
        level_rad=level_rad,
        shift_mm=[abs(value) * each for each in ROLL_MM_PER_DEG],
    )


def _change(foot: FootMotion, rows: np.ndarray, values: np.ndarray) -> float:
    """From the first to the last of the rows, on the straight line through what lies between."""
    time = foot.time_s[rows]
    return float(np.polyfit(time - time[0], values[rows], 1)[0] * (time[-1] - time[0]))


def drift(foot: FootMotion, rows: np.ndarray, number: int | None = None) -> Check:
    """Change of the foot's height from the beginning to the end of foot-flat (straight line through
    it): that of the ball of the foot, about which a heel that begins to rise turns without being
    drift."""
    height_m = foot.ankle_W[:, 2] if foot.undeformed else foot.ball_m
    value = 1e3 * _change(foot, rows, height_m)
    mark = "good" if foot.undeformed else grade(value, *_limits(foot, DRIFT_MM, INTACT_DRIFT_MM))
    return _of(
        foot,
        "drift",
        "height drift through foot-flat",
        mark,
        value,
        "mm",
        stance=number,
        share=HEIGHT_BW_PER_MM * abs(value),
    )


def turn(foot: FootMotion, rows: np.ndarray, number: int | None = None) -> Check:
    """By how much the sole turns about the vertical from the beginning to the end of foot-flat
    (straight line)."""
    value = float(np.degrees(_change(foot, rows, foot.yaw_rad)))
    turns = abs(value) > TURN_DEG
    return _of(
        foot,
        "turn",
        "turn of the sole on the floor",
        "doubtful" if turns else "good",
        value,
        "deg",
        stance=number,
        cost_bw=FITTED_TOE_BW_PER_DEG * abs(value) if turns and foot.prosthetic else None,
    )


def toe_out(foot: FootMotion, flats: Sequence[np.ndarray], heading_rad: float) -> Check:
    """Mean angle of the foot outward from the direction of walking, at foot-flat over all
    stances."""
    yaw = float(np.degrees(np.mean([foot.yaw_rad[rows].mean() for rows in flats]) - heading_rad))
    value = -yaw if foot.side == "right" else yaw
    inward = value < -TOE_IN_DEG
    cost_bw = FITTED_TOE_BW_PER_DEG * (TOE_OUT_DEG - value) if inward and foot.prosthetic else None
    return _of(
        foot,
        "toe_out",
        "direction of the foot",
        "doubtful" if inward else "good",
        value,
        "deg",
        cost_bw=cost_bw,
    )


def strike(foot: FootMotion, cop_W: np.ndarray, stances: Sequence[Stance]) -> Check | None:
    """Where along the model's prosthetic foot the centre of pressure (n, 3) m at its times begins:
    the rearmost 2 % of each whole stance, from the heel of the foot as it stands in mid-stance.
    None without one."""
    places = []
    for stance in (each for each in stances if each.complete):
        middle = int(np.argmin(np.abs(foot.time_s - np.mean(shares_of(stance, MIDDLE)))))
        along = foot.toe_W[middle] - foot.heel_W[middle]
        rows = foot.rows(*stance.span) & np.isfinite(cop_W).all(axis=1)
        if rows.any():
            place = (cop_W[rows] - foot.heel_W[middle]) @ along / np.linalg.norm(along)
            places.append(1e3 * float(np.percentile(place, 2)))
    if not places:
        return None
    value = float(np.mean(places))
    fits = STRIKE_MM[0] <= value <= STRIKE_MM[1]
    off = value - float(np.mean(STRIKE_MM))
    return _of(
        foot,
        "strike",
        "centre of pressure at heel strike",
        "good" if fits else "doubtful",
        value,
        "mm",
        off=off,
        cost_bw=None if fits else FITTED_COP_BW_PER_MM * abs(off),
    )


def bending(
    foot: FootMotion,
    model: ModelParameters,
    plate: PlateRecording,
    cop_W: np.ndarray,
    *,
    span: Span,
    mass_kg: float,
    fulcrum_m: float,
) -> Check | None:
    """Where the fulcrum would have to be (mm from A) for the model's foot to give as deep as its
    undeformed sole lies under the floor at the centre of pressure (n, 3) m, within `span`.

    The depth is a height and an angle that are free within BENT_PRIOR, and what the load presses
    down: the overhung keel (`laws.beam`) and the socket, axially and in flexion. Lengths and
    stiffness of the person's own foot are in it, so that it tells a setting only beside other walks
    (`examine.settings_compared`). None where too little of a stance is measured, of a foot whose
    support does not move, and of a keel that thins, for the beam is uniform.
    """
    keel = model.foot.keel
    reach = model.foot.fulcrum
    if reach.rearmost_m == reach.foremost_m or keel.tip_stiffness != 1.0:
        return None
    along = foot.toe_W - foot.heel_W
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    place = np.sum((cop_W - foot.heel_W) * along, axis=1)
    load_n = np.interp(foot.time_s, plate.time_s, plate.force_W[:, 2])
    x = place + 1e-3 * min(value for zone in model.foot.zones for value in zone.x_mm)
    rows = foot.rows(*span) & np.isfinite(x) & (load_n > BENT_BW * mass_kg * GRAVITY)
    rows &= (x > BENT_M[0]) & (x < BENT_M[1])
    if np.count_nonzero(rows) < BENT_FRAMES:
        return None
    x = x[rows]
    load_n = load_n[rows]
    lever = x - model.foot.pylon_x_m
    depth = -(foot.heel_W[:, 2] + place * along[:, 2])[rows]
    socket = model.socket
    depth -= load_n * (1.0 / socket.tz.stiffness + lever**2 / socket.flexion.stiffness)
    bending_stiffness = keel.flexural_modulus_pa * section_inertia(keel.width_m, keel.thickness_m)
    held = BENT_NOISE_M / np.array(BENT_PRIOR) * np.sqrt(len(x) / BENT_FRAMES)
    free = np.vstack([np.column_stack([np.ones_like(x), lever]), np.diag(held)])
    left = dict[float, float]()
    for support in BENT_FULCRUMS_M:
        beyond = np.maximum(x, support + 1e-6)
        gives = load_n / overhung_stiffness(
            bending_stiffness=bending_stiffness, support=support, load_point=beyond
        )
        wanted = np.append(depth - gives, [0.0, 0.0])
        found = np.linalg.lstsq(free, wanted, rcond=None)[0]
        left[float(support)] = float(np.sum((wanted - free @ found) ** 2))
    value = 1e3 * min(left, key=left.__getitem__)
    return _of(foot, "bending", BENDING, "good", value, "mm", named=1e3 * fulcrum_m)


def slip(
    foot: FootMotion, rows: np.ndarray, number: int | None = None, cop_W: np.ndarray | None = None
) -> Check:
    """Mean slip of the sole at foot-flat, at the centre of pressure where it is known; m/s, and mm
    in the sentence."""
    point = floor_point(foot)
    if cop_W is not None:
        point = np.where(np.isfinite(cop_W).all(axis=1, keepdims=True), cop_W, point)
    velocity = slip_velocity(foot, point)[rows].mean(axis=0)
    speed = float(np.hypot(*velocity))
    lasted = float(foot.time_s[rows[-1]] - foot.time_s[rows[0]])
    if foot.undeformed:
        velocity *= [1.0, 1.0 if foot.side == "right" else -1.0]
        velocity -= np.clip(velocity, *np.transpose(STANDING_SLIP_M_PER_S))
    share = float(np.hypot(*(velocity * FITTED_SLIP_BW_PER_M_PER_S)))
    return _of(
        foot,
        "slip",
        SLIP,
        grade(share, GOOD_BW if foot.prosthetic else DOUBTFUL_BW, DOUBTFUL_BW),
        speed,
        "m/s",
        stance=number,
        cost_bw=share if foot.prosthetic else None,
        share=share,
        lasted=lasted,
        beyond=float(np.hypot(*velocity)),
    )


def heights(foot: FootMotion, flats: Sequence[np.ndarray]) -> list[Check]:
    """Mean height of the sole at foot-flat over all stances, and its range where there are
    several."""
    means = 1e3 * np.array([foot.height_m[rows].mean() for rows in flats])
    value = float(np.mean(means))
    checks = [
        _of(
            foot,
            "height",
            "sole height at foot-flat",
            "good" if foot.undeformed else grade(value, *HEIGHT_MM),
            value,
            "mm",
            share=HEIGHT_BW_PER_MM * abs(value),
        )
    ]
    if len(flats) > 1:
        value = float(np.ptp(means))
        bends = 5 if foot.undeformed else 1
        low, high = _limits(foot, DRIFT_MM, INTACT_DRIFT_MM)
        checks.append(
            _of(
                foot,
                "height_between",
                "height between stances",
                grade(value, bends * low, bends * high),
                value,
                "mm",
                cost_bw=HEIGHT_BW_PER_MM * value / 2 / bends if foot.prosthetic else None,
            )
        )
    return checks


def clearance(foot: FootMotion, stances: Sequence[Stance]) -> Check | None:
    """Least height of the model foot's lowest point in mid-swing, over all swings; None where there
    is none."""
    lowest = []
    for number, (before, after) in enumerate(pairwise(stances), start=1):
        start = before.end_s
        length = after.start_s - before.end_s
        rows = foot.rows(start + SWING[0] * length, start + SWING[1] * length)
        if rows.any() and before.end_seen and after.start_seen:
            lowest.append((float(1e3 * foot.lowest_m[rows].min()), number))
    if not lowest:
        return None
    value, number = min(lowest)
    clear = value >= (CLEARANCE_MM[0] if foot.prosthetic else INTACT_CLEARANCE_MM)
    mark = "good" if clear else "doubtful" if value >= CUT_MM else "unusable"
    return _of(
        foot,
        "clearance",
        "swing clearance",
        mark,
        value,
        "mm",
        stance=number,
        above=value >= CLEARANCE_MM[1],
    )


def touch_down(foot: FootMotion, stances: Sequence[Stance]) -> Check | None:
    """Mean height of the model foot's lowest point at the plate's touch-downs; None if none was
    seen."""
    instants = [
        s.start_s
        for s in stances
        if s.start_seen and foot.time_s[0] <= s.start_s <= foot.time_s[-1]
    ]
    if not instants:
        return None
    value = 1e3 * float(np.mean(np.interp(instants, foot.time_s, foot.lowest_m)))
    return _of(
        foot, "touch_down", "height at touch-down", grade(value, *TOUCH_DOWN_MM), value, "mm"
    )


def depth(
    foot: FootMotion, stances: Sequence[Stance], *, mass_kg: float, fulcrum_m: float
) -> Check | None:
    """How deep the model's undeformed foot goes into the ground while the plate carries it, against
    what it gives."""
    rows = within(foot.time_s, [stance.span for stance in stances])
    if not rows.any():
        return None
    value = -1e3 * float(foot.lowest_m[rows].min())
    gives = INTACT_DEPTH_MM
    if foot.prosthetic:
        stiffness = float(np.interp(fulcrum_m, *np.transpose(PUBLISHED_N_PER_M)))
        gives = SOCKET_MM + 1e3 * PUSH_OFF_BW * mass_kg * GRAVITY / stiffness
    if value <= 0.0:
        mark = "doubtful" if -value < TOO_DEEP_MM else "unusable"
    else:
        mark = (
            "good" if value <= gives else "doubtful" if value < gives + TOO_DEEP_MM else "unusable"
        )
    return _of(foot, "depth", "depth in the ground", mark, value, "mm", gives=gives)
