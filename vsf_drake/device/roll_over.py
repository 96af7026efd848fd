"""The foot alone rolled over: the load of ISO 22675, and what describes a roll-over shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import trapezoid

from vsf_drake.base.errors import SimulationError
from vsf_drake.base.progress import Progress
from vsf_drake.base.sentences import say
from vsf_drake.model.parameters import FootParameters
from vsf_drake.model.setting import setting_of
from vsf_drake.simulation.roll_over import (
    Following,
    Rolling,
    RollOver,
    RollOverRun,
    in_mount_frame,
)

Curves = dict[str, np.ndarray]


@dataclass(frozen=True, kw_only=True)
class RollShape:
    """What describes rolling over; None where it cannot be known."""

    radius_m: float | None
    effective_foot_length_ratio: float | None  # to the length of the foot
    mean_moment_arm_m: float | None
    radius_after_heel_m: float | None = None
    """of a footfall without the landing on its heel, see `validation.roll_over_section`"""


@dataclass(frozen=True, kw_only=True)
class IsoRow(RollShape):
    """The foot under the loading profile of ISO 22675; its shape is that up to the second peak."""

    fulcrum_mm: float
    follows: bool  # within 1 % of the largest force
    residual_n: float
    deflection_heel_mm: float
    deflection_forefoot_mm: float
    dorsiflexing_moment_nm: float
    plantarflexing_moment_nm: float
    stored_forefoot_j: float
    return_ratio: float
    lost_by_sliding_j: float
    unconverged_steps: int


@dataclass(frozen=True, kw_only=True)
class Iso:
    """The profile at every fulcrum position, to its first peak `force_n`."""

    force_n: float
    force_from: str  # "weight" or "given"
    follows: bool
    positions: tuple[IsoRow, ...]
    with_friction: tuple[IsoRow, ...]


# The loading profile of ISO 22675: force and tilt over a stance of 600 ms.
#
# Polynomials in the time in milliseconds, valid from 0 to 600. They came to us second-hand and were
# checked against their own features only (peaks of 1.000 at 151 ms and 0.987 at 447.5 ms, a valley
# of 0.668 between them), not against the standard's text. Force is a share of the first peak's,
# F_1cmax. Tilt below zero lowers the platform's front: heel loading.

DURATION_S = 0.6
_FORCE = 1e-6 * np.array(
    [
        5.12306842296552e-9,
        -9.2037374110419e-6,
        5.98882225167948e-3,
        -1.67101914899229,
        164.651497111425,
        3624.95690883228,
        0.0,
    ]
)
_TILT_DEG = 1e-3 * np.array([2.45074e-9, -3.75984e-6, 1.77519e-3, -0.108409, 20.7217, -20041.0])


def force_share(time_s: np.ndarray) -> np.ndarray:
    """(n,) F / F_1cmax at the times (n,) s from 0 to DURATION_S; never below zero."""
    return np.asarray(np.maximum(np.polyval(_FORCE, 1e3 * time_s), 0.0))


def tilt_rad(time_s: np.ndarray) -> np.ndarray:
    """(n,) tilt of the platform (rad) at the times (n,) s from 0 to DURATION_S, negative with its
    front down."""
    return np.asarray(np.radians(np.polyval(_TILT_DEG, 1e3 * time_s)))


# The foot rolled over by the loading profile of ISO 22675, at each fulcrum position
# (`simulation.roll_over`), with the platform's friction left out, so that the guide of the line
# bears what is sideways; no joint at the pylon's top.

SECOND_PEAK_S = 0.4475
"""The shape ends at the second peak of the force: later the load only leaves the toe."""
# half and twice of it change no quantity by more than 0.6 % (225 cells, nominal foot)
STEP_S = 1e-3
ROLL_CURVE_POINTS = 301


@dataclass(frozen=True, kw_only=True, eq=False)
class Load:
    """A stance: n + 1 instants from 0, evenly spaced."""

    name: str
    time_s: np.ndarray
    tilt_rad: np.ndarray
    """of the ground against the plane across the pylon, negative with its front down: heel
    loading"""
    force_bw: np.ndarray  # along the pylon, over body weight; 0 at first
    shape_ends_s: float
    """when the roll-over shape ends: the second peak, later the load only leaves the toe"""

    @property
    def duration_s(self) -> float:
        """Of the stance."""
        return float(self.time_s[-1])


def iso_22675(step_s: float = STEP_S) -> Load:
    """The loading profile of ISO 22675, its first peak the body weight (no load level of the
    standard)."""
    time = np.linspace(0.0, DURATION_S, round(DURATION_S / step_s) + 1)
    return Load(
        name="ISO 22675",
        time_s=time,
        tilt_rad=tilt_rad(time),
        force_bw=force_share(time),
        shape_ends_s=SECOND_PEAK_S,
    )


def iso_roll_over(
    foot: FootParameters,
    fulcrums_m: Sequence[float],
    *,
    force_n: float,
    steps: int,
    friction: bool = False,
    progress: Progress | None = None,
) -> tuple[list[IsoRow], Curves, list[str]]:
    """Rolls the foot at every fulcrum position (m), to F_1cmax = `force_n` (N), the profile's first
    peak, in as many steps: rows, curves by name, and sentences on what failed and, without
    friction, on what does not follow.

    With `friction`, the foot's own with the platform, the tilt axis matters: it is put into the
    platform's surface, under the pylon (a choice). The foot slides under a line that is held.
    """
    machine = RollOver(foot, friction=friction)
    load = iso_22675(DURATION_S / steps)
    force = force_n * load.force_bw
    kept = np.unique(np.round(np.linspace(1, steps, ROLL_CURVE_POINTS)).astype(int)) - 1
    curves = {
        "iso_time_s": load.time_s[1:][kept],
        "iso_tilt_deg": np.degrees(load.tilt_rad[1:][kept]),
        "iso_wanted_n": force[1:][kept],
    }
    rows: list[IsoRow] = []
    missing: list[str] = []
    if progress:
        progress("rolling the foot over", 0.0)
    outcomes = machine.roll_side_by_side(
        [
            Rolling(fulcrum_m=fulcrum, time_s=load.time_s, tilt_rad=load.tilt_rad, force_n=force)
            for fulcrum in fulcrums_m
        ]
    )
    for fulcrum, outcome in zip(fulcrums_m, outcomes, strict=True):
        place = (
            f"The ISO 22675 profile, {setting_of(foot, fulcrum).setting_words}"
            f"{', with friction' if friction else ''}"
        )
        if isinstance(outcome, SimulationError):
            missing.append(f"{place}: {outcome}.")
            continue
        row, own = rolled_row(machine, *outcome, fulcrum, load)
        rows.append(row)
        if not row.follows and not friction:
            missing += say("roll_over", "not_followed", place=place, residual_n=row.residual_n)
        curves |= {f"iso_{1e3 * fulcrum:.0f}_{name}": values[kept] for name, values in own.items()}
    return rows, curves, missing


def energy_taken(run: RollOverRun) -> tuple[np.ndarray, np.ndarray]:
    """(n,) J that keel, fulcrum and foam hold as strain, and that they have taken in, what they
    lost included."""
    e = run.energy
    strain = e["keel_strain"] + e["fulcrum_strain"] + e["contact_strain"]
    return strain, strain + (
        e["keel_loss"] + e["fulcrum_loss"] + e["contact_loss"] + e["friction_loss"]
    )


def returned_late(time_s: np.ndarray, strain_j: np.ndarray, taken_j: np.ndarray) -> float:
    """J given back after the most strain of the second half of a stance (n,) that ends with the
    last time: strain held and energy taken in, as of `energy_taken`."""
    late = time_s > 0.5 * time_s[-1]
    fullest = int(np.argmax(np.where(late, strain_j, 0.0)))
    return float(taken_j[fullest:].max() - taken_j[-1])


def rolled_row(
    machine: RollOver, run: RollOverRun, following: Following, fulcrum: float, load: Load
) -> tuple[IsoRow, Curves]:
    """The row of a foot that was rolled under a load, and its curves."""
    foot = machine.parameters
    cop = in_mount_frame(run.cop_W, run.mount)
    arm = run.cop_W - np.column_stack([run.mount[:, 0], np.zeros(len(cop)), run.mount[:, 1]])
    moment = arm[:, 0] * run.grf_W[:, 2] - arm[:, 2] * run.grf_W[:, 0]
    strain, taken_in = energy_taken(run)
    steps = np.diff(taken_in, prepend=0.0)
    taken = float(steps[steps > 0.0].sum())
    given = -float(steps[steps < 0.0].sum())
    half = run.time_s <= 0.5 * load.duration_s
    rolled = run.time_s <= load.shape_ends_s
    shape = described(
        np.where(rolled[:, None], cop, np.nan),
        heel_m=foot.heel_x_m - foot.pylon_x_m,
        foot_length_m=foot.length_m,
        arm_m=mean_moment_arm(run.time_s, moment, following.force_n),
    )
    row = IsoRow(
        **vars(shape),
        fulcrum_mm=1e3 * fulcrum,
        follows=bool(following.follows),
        residual_n=float(following.residual_n),
        deflection_heel_mm=1e3 * float(following.deflection_m[half].max()),
        deflection_forefoot_mm=1e3 * float(following.deflection_m[~half].max()),
        dorsiflexing_moment_nm=float(np.nanmax(moment)),
        plantarflexing_moment_nm=-float(np.nanmin(moment)),
        stored_forefoot_j=float(strain[~half].max()),
        return_ratio=given / taken,
        lost_by_sliding_j=float(run.energy["friction_loss"][-1]),
        unconverged_steps=run.unconverged_steps,
    )
    return row, {
        "force_n": following.force_n,
        "deflection_mm": 1e3 * following.deflection_m,
        "cop_forward_m": cop[:, 0],
        "cop_up_m": cop[:, 1],
        "moment_nm": moment,
        "strain_j": strain,
    }


# The roll-over shape of a foot: its arc, its effective length, and the mean moment arm about the
# ankle.
#
# Hansen, Childress & Knox 2004; Hansen, Sam & Childress 2004 (J. Prosthet. Orthot. 16), not read at
# their source. As used here:
#
# - effective foot length ratio: from the heel, the rear end of the foot, to the shape's front end,
#   along the shank frame's forward axis, over the length of the foot;
# - arc: the circle whose distances from the points of the shape have the least sum of squares, the
#   points evenly spaced along the shape rather than in time, so that no part counts more because
#   the load rests there;
# - mean moment arm: "the ratio of sagittal ankle moment impulse to ground reaction force impulse"
#   (abstract of Adamczyk 2020, doi 10.1115/1.4045817); here the impulse of the vertical force is
#   taken.

_SPACING_M = 1e-3
_STRAIGHT = 20.0
"""Radius in lengths of the shape beyond which it counts as straight (a choice)."""
_FEWEST = 5
_MOST_STEPS = 50


def fit_arc(points_m: np.ndarray) -> np.ndarray | None:
    """(3,) centre (forward, up) and radius (m) of the circle nearest to points (n, 2), by
    Gauss-Newton on their distances; None where the points are too few, or nearly on a line: then a
    radius means nothing."""
    points = points_m[np.isfinite(points_m).all(axis=1)]
    size = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    if len(points) < _FEWEST or size == 0.0:
        return None
    origin = points.mean(axis=0)
    p = (points - origin) / size
    # from the circle with the least sum of (d^2 - r^2)^2: 2 c.p + (r^2 - c^2) = p^2 is linear
    start, _, rank, _ = np.linalg.lstsq(
        np.column_stack([2.0 * p, np.ones(len(p))]), np.sum(p**2, axis=1), rcond=None
    )
    if rank < len(start):
        return None
    circle = np.append(start[:2], np.sqrt(start[2] + start[:2] @ start[:2]))
    for _ in range(_MOST_STEPS):
        away = p - circle[:2]
        distance = np.linalg.norm(away, axis=1)
        slopes = np.column_stack([-away / distance[:, None], -np.ones(len(p))])
        change = np.linalg.lstsq(slopes, circle[2] - distance, rcond=None)[0]
        circle = circle + change
        if np.abs(change).max() < 1e-12 * max(1.0, circle[2]):
            break
    if not (np.isfinite(circle[2]) and 0.0 < circle[2] < _STRAIGHT):
        return None
    return np.append(origin, 0.0) + size * circle


def described(
    points_m: np.ndarray, *, heel_m: float, foot_length_m: float, arm_m: float | None
) -> RollShape:
    """What describes a roll-over shape, the centre of pressure (n, 2) forward and up in the shank's
    frame, NaN where there is none; `heel_m` is where the rear end of the foot, from which
    `foot_length_m` counts, is on the forward axis. None where it cannot be known."""
    points = points_m[np.isfinite(points_m).all(axis=1)]
    ratio = (float(points[:, 0].max()) - heel_m) / foot_length_m if len(points) else None
    return RollShape(
        radius_m=arc_radius(points), effective_foot_length_ratio=ratio, mean_moment_arm_m=arm_m
    )


def arc_radius(points_m: np.ndarray) -> float | None:
    """Radius (m) of the arc of a shape (n, 2), its points set evenly along it; None as `fit_arc`
    has it."""
    points = points_m[np.isfinite(points_m).all(axis=1)]
    if len(points) < 2:
        return None
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    at = np.linspace(0.0, along[-1], max(2, round(along[-1] / _SPACING_M) + 1))
    circle = fit_arc(np.column_stack([np.interp(at, along, column) for column in points.T]))
    return None if circle is None else float(circle[2])


def mean_moment_arm(
    time_s: np.ndarray, moment_nm: np.ndarray, vertical_n: np.ndarray
) -> float | None:
    """Impulse of the moment about the ankle (toe up positive) over that of the vertical force (m);
    where the moment is NaN neither counts. None without load."""
    known = np.isfinite(moment_nm)
    force = np.where(known, vertical_n, 0.0)
    impulse = float(trapezoid(force, time_s))
    if impulse <= 0.0:
        return None
    return float(trapezoid(np.where(known, moment_nm, 0.0), time_s)) / impulse
