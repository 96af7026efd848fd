"""The section "roll-over": inclined loading, the ISO 22675 loading profile, and roll-over shapes in walking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from vsf_drake.analysis.bench_metrics import stiffness
from vsf_drake.analysis.comparison import (
    THRESHOLD_N,
    StanceComparison,
    filtered_while_loaded,
    percent_instants,
    resample,
)
from vsf_drake.analysis.validation.study import (
    Progress,
    Section,
    Spread,
    Study,
    StudyWalk,
    reached,
    spread,
)
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.manifest import mount_of
from vsf_drake.parameters import GRAVITY, FootParameters
from vsf_drake.plants.foot import set_mount, sole_height
from vsf_drake.plants.gait import make_gait
from vsf_drake.sentences import say
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, PUBLISHED_SPEED_M_PER_S
from vsf_drake.simulation.roll_over import Following, RollOver, RollOverRun, in_mount_frame

LEAST_FORCE_N, MOST_FORCE_N = 50.0, 5000.0
STEPS_PER_MM, ISO_STEPS = 160.0, 1200
QUICK_STEPS_PER_MM, QUICK_ISO_STEPS, QUICK_POSITIONS_M = 40.0, 600, (0.066, 0.108, 0.151)
Curves = dict[str, np.ndarray]


@dataclass(frozen=True, kw_only=True)
class InclinedRow:
    """The foot pressed at an angle to 600 N."""

    angle_deg: float
    fulcrum_mm: float
    displacement_mm: float
    stiffness_n_per_mm: float
    energy_stored_j: float
    zones_loaded: tuple[str, ...]
    unconverged_steps: int


@dataclass(frozen=True, kw_only=True)
class RollShape:
    """What describes rolling over; None where it cannot be known."""

    radius_m: float | None
    effective_foot_length_ratio: float | None  # to the length of the foot
    mean_moment_arm_m: float | None


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


@dataclass(frozen=True, kw_only=True)
class Footfall:
    """The shape of one footfall, of the model and of the plate, seen from the recorded shank."""

    label: str
    fulcrum_mm: float
    ends_at: str  # OPPOSITE_STRIKE or TOE_OFF
    leg_length_m: float
    model: RollShape
    measured: RollShape


@dataclass(frozen=True, kw_only=True)
class RollOverCondition:
    """The footfalls at one position: what describes their shapes by its key, and `radius_leg_lengths`."""

    fulcrum_mm: float
    model: Mapping[str, Spread]
    measured: Mapping[str, Spread]


@dataclass(frozen=True, kw_only=True)
class RollOverTable:
    """The section on rolling over."""

    inclined: tuple[InclinedRow, ...]
    iso: Iso
    walks: tuple[Footfall, ...]  # their curves are `walk_0_...` and so on
    conditions: tuple[RollOverCondition, ...]
    synthetic: bool


def roll_over_section(study: Study, *, progress: Progress | None = None) -> Section[RollOverTable]:
    """Everything about rolling over; InputError if the force of the profile is no force to test a foot with."""
    given, quick, foot = study.options.iso_force_n, study.options.quick, study.model.foot
    if given is not None and not LEAST_FORCE_N <= given <= MOST_FORCE_N:
        raise InputError(
            f"{given:g} N is no force to roll a foot over with",
            where="iso_force_n",
            right=f"Give the level's largest force, {LEAST_FORCE_N:g} to {MOST_FORCE_N:g} N",
        )
    force = float(study.walks[0].recorded.subject.mass_kg * GRAVITY if given is None else given)
    wanted = QUICK_POSITIONS_M if quick else PUBLISHED_FULCRUMS_M
    fulcrums = reached(foot, wanted)

    def part(start: float, share: float, more: str = "") -> Progress:
        return lambda what, fraction: (
            progress(what + more, start + share * fraction) if progress else None
        )

    inclined, curves, failed = _inclined_loading(
        foot,
        fulcrums,
        steps_per_mm=QUICK_STEPS_PER_MM if quick else STEPS_PER_MM,
        progress=part(0.0, 0.3),
    )
    rolled, more, failed_rolls = iso_roll_over(
        foot,
        fulcrums,
        force_n=force,
        steps=QUICK_ISO_STEPS if quick else ISO_STEPS,
        progress=part(0.3, 0.4),
    )
    rough, _, failed_rough = iso_roll_over(
        foot,
        fulcrums,
        force_n=force,
        steps=QUICK_ISO_STEPS,
        friction=True,
        progress=part(0.7, 0.1, " with friction"),
    )
    missing = [
        *say("roll_over", "unreached", positions_m=[x for x in wanted if x not in fulcrums]),
        *failed,
        *failed_rolls,
        *failed_rough,
    ]
    rows: list[Footfall] = []
    for i, walk in enumerate(study.walks):
        part(0.8, 0.2)("roll-over shapes", i / len(study.walks))
        shapes, unknown = walked_shapes(walk)
        missing += unknown
        for row, seen in shapes:
            for side, points in seen.items():
                curves |= {
                    f"walk_{len(rows)}_{side}_{axis}_m": column
                    for axis, column in zip(("forward", "up"), points.T, strict=True)
                }
            rows.append(row)
    conditions = tuple(
        _condition(x, [row for row in rows if row.fulcrum_mm == x])
        for x in sorted({row.fulcrum_mm for row in rows})
    )
    iso = Iso(
        force_n=force,
        force_from="weight" if given is None else "given",
        positions=tuple(rolled),
        follows=bool(rolled) and all(row.follows for row in rolled),
        with_friction=tuple(rough),
    )
    return Section(
        table=RollOverTable(
            inclined=tuple(inclined),
            iso=iso,
            walks=tuple(rows),
            conditions=conditions,
            synthetic=study.synthetic,
        ),
        arrays={**curves, **more},
        missing=tuple(missing),
    )


def _condition(fulcrum_mm: float, rows: Sequence[Footfall]) -> RollOverCondition:
    def means(shapes: Sequence[RollShape]) -> dict[str, Spread]:
        radii = [
            None if (r := shape.radius_m) is None else r / row.leg_length_m
            for row, shape in zip(rows, shapes, strict=True)
        ]
        return {"radius_leg_lengths": spread(radii)} | {
            field.name: spread(getattr(shape, field.name) for shape in shapes)
            for field in fields(RollShape)
        }

    return RollOverCondition(
        fulcrum_mm=fulcrum_mm,
        model=means([row.model for row in rows]),
        measured=means([row.measured for row in rows]),
    )


# The foot pressed at an angle, as structural tests press feet: the peaks of the ISO 22675 profile, rounded.
#
# Below zero loads the heel. The platen is level and without friction, the foot pitched by minus the angle, toes up; it
# moves along the platen's normal, along which force and displacement are taken.

ANGLES_DEG = (-15.0, 20.0)
LARGEST_LOAD_N = 600.0
CURVE_POINTS = 201
"""Points of a saved curve, loading and unloading."""
BORNE_N = 1.0
"""Load (N) from which a sphere is said to bear."""


def _inclined_loading(
    foot: FootParameters, fulcrums_m: Sequence[float], *, steps_per_mm: float, progress: Progress
) -> tuple[list[InclinedRow], Curves, list[str]]:
    """Presses the foot to 600 N and lets go, at both angles and every fulcrum position (m), at 50 mm/min: rows, curves
    by name (`inclined_A_F_...` with angle and position in whole degrees and mm), and sentences on what failed."""
    machine = RollOver(foot, friction=False)
    sites = machine.machine.foot.sites
    rows: list[InclinedRow] = []
    curves: Curves = {}
    missing = []
    cases = [(angle, fulcrum) for angle in ANGLES_DEG for fulcrum in fulcrums_m]
    for i, (angle, fulcrum) in enumerate(cases):
        progress("pressing the inclined foot", i / len(cases))
        try:
            run = machine.press(
                fulcrum_m=fulcrum,
                pitch_rad=-np.radians(angle),
                max_load_n=LARGEST_LOAD_N,
                speed_m_per_s=PUBLISHED_SPEED_M_PER_S,
                steps_per_mm=steps_per_mm,
            )
        except SimulationError as error:
            missing.append(
                f"Inclined loading at {angle:+g} degrees, fulcrum {1e3 * fulcrum:g} mm: {error}."
            )
            continue
        displacement = np.append(
            0.0, float(machine.touch_height(-np.radians(angle))[0]) - run.mount[:, 1]
        )
        load = np.append(0.0, run.grf_W[:, 2])
        peak = int(np.argmax(load))
        x, f = displacement[: peak + 1], load[: peak + 1]
        bearing = run.sphere_normal_n[peak - 1] > BORNE_N
        rows.append(
            InclinedRow(
                angle_deg=angle,
                fulcrum_mm=1e3 * fulcrum,
                stiffness_n_per_mm=1e-3 * stiffness(x, f),
                displacement_mm=1e3 * float(np.interp(LARGEST_LOAD_N, f, x)),
                energy_stored_j=float(np.trapezoid(f, x)),
                zones_loaded=tuple(
                    name
                    for i, name in enumerate(sites.zone_names)
                    if bearing[sites.zone == i].any()
                ),
                unconverged_steps=run.unconverged_steps,
            )
        )
        at = np.union1d(np.round(np.linspace(0, len(load) - 1, CURVE_POINTS)).astype(int), [peak])
        name = f"inclined_{'minus' if angle < 0 else 'plus'}{abs(angle):.0f}_{1e3 * fulcrum:.0f}"
        curves |= {f"{name}_displacement_m": displacement[at], f"{name}_load_n": load[at]}
    return rows, curves, missing


# The loading profile of ISO 22675: force and tilt over a stance of 600 ms.
#
# Polynomials in the time in milliseconds, valid from 0 to 600. They came to us second-hand and were checked against
# their own features only (peaks of 1.000 at 151 ms and 0.987 at 447.5 ms, a valley of 0.668 between them), not against
# the standard's text. Force is a share of the first peak's, F_1cmax. Tilt below zero lowers the platform's front:
# heel loading.

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
    """(n,) tilt of the platform (rad) at the times (n,) s from 0 to DURATION_S, negative with its front down."""
    return np.asarray(np.radians(np.polyval(_TILT_DEG, 1e3 * time_s)))


# The roll-over shape of each walk of a study, from the model's centre of pressure and from the plate's.
#
# Both are seen from the same frame, which owes the simulation nothing: the recorded residual shank's, its origin where
# the pylon's lower end is with the socket unloaded. What the socket gives under load is thus part of the shape.

OPPOSITE_STRIKE, TOE_OFF = "opposite heel strike", "toe-off"


class RollOverFrames(NamedTuple):
    """Poses in W over n instants."""

    time_s: np.ndarray
    origin: np.ndarray  # (n, 3) m
    axes: np.ndarray  # (n, 3, 3), forward, left and up as columns

    def at(self, time_s: np.ndarray) -> RollOverFrames:
        """The same at other times, on straight lines between the known ones."""
        poses = resample(
            time_s, self.time_s, np.column_stack([self.origin, self.axes.reshape(-1, 9)])
        )
        return RollOverFrames(time_s, poses[:, :3], poses[:, 3:].reshape(-1, 3, 3))

    def seen(self, points_W: np.ndarray) -> np.ndarray:
        """(n, 2) forward and up of points (n, 3) in W, one for each instant."""
        return np.asarray(np.einsum("nij,ni->nj", self.axes, points_W - self.origin)[:, [0, 2]])


def walked_shapes(walk: StudyWalk) -> tuple[list[tuple[Footfall, Curves]], list[str]]:
    """Every footfall that is recorded and simulated as a whole with its curves, "model" and "measured", (101, 2) over
    the measured stance and NaN outside the shape; and sentences on what is not there."""
    plate, result = walk.recorded.prosthetic_plate, walk.result
    whole = [item for item in walk.comparison.stances if item.inside]
    if not whole:
        return [], say("roll_over", "no_shape", label=walk.label)
    shank, heel, leg = _shank(walk)
    shapes = []
    for item in whole:
        end, kind = _end(walk, item)
        instants = percent_instants(item.measured)
        seen, sides = Curves(), dict[str, RollShape]()
        for name, time, force, cop, free in (
            ("model", result.time_s, result.grf_W, result.cop_W, result.free_moment_nm),
            ("measured", plate.time_s, plate.force_W, plate.cop_W, plate.free_moment_nm),
        ):
            smooth = filtered_while_loaded(cop[:, :2], time, force[:, 2], cop, instants)
            smooth[instants > end + 1e-9] = np.nan
            seen[name] = shank.at(instants).seen(np.column_stack([smooth, np.zeros(len(smooth))]))
            sides[name] = described(
                seen[name],
                heel_m=heel,
                foot_length_m=result.foot_length_m,
                arm_m=_arm(shank, item, time, force, cop, free),
            )
        shapes.append(
            (
                Footfall(
                    label=walk.label,
                    fulcrum_mm=walk.fulcrum_mm,
                    ends_at=kind,
                    leg_length_m=leg,
                    **sides,
                ),
                seen,
            )
        )
    return shapes, say(
        "roll_over",
        "partly",
        label=walk.label,
        has_cop=plate.has_cop,
        until_toe_off=sum(row.ends_at == TOE_OFF for row, _ in shapes),
    )


def _shank(walk: StudyWalk) -> tuple[RollOverFrames, float, float]:
    """The shank over the walk; where the heel is on the forward axis (m); the prosthetic leg's length (m)."""
    trial, offsets = walk.trial, walk.trial.offsets
    gait = make_gait(trial.subject, trial.model)
    person, plant = gait.person, gait.plant
    context = plant.CreateDefaultContext()
    set_mount(context, person.foot, **mount_of(offsets))
    ankle = np.array([0.0, 0.0, -person.body.residual_length - person.body.pylon_length])
    shank = person.segments[f"shank_{trial.subject.prosthetic_side}"]
    p_KHeel = [trial.model.foot.heel_x_m, 0.0, sole_height(trial.model.foot)]
    X_PK = plant.CalcRelativeTransform(
        context, person.socket.distal, person.foot.frame.body_frame()
    )
    origin, axes = [], []
    for q in walk.result.q:
        plant.SetPositions(context, q)
        X_WS = shank.EvalPoseInWorld(context)
        origin.append(X_WS @ ankle)
        axes.append(X_WS.rotation().matrix())
    return (
        RollOverFrames(walk.result.time_s, np.array(origin), np.array(axes)),
        float((X_PK @ p_KHeel)[0]),
        person.body.prosthetic_leg_length,
    )


def _end(walk: StudyWalk, item: StanceComparison) -> tuple[float, str]:
    """When the shape ends (s), and by what."""
    other = "left" if walk.recorded.subject.prosthetic_side == "right" else "right"
    plate = walk.recorded.plates.get(other)
    if plate is not None:
        for stance in find_stances(plate.time_s, plate.force_W[:, 2], threshold_n=THRESHOLD_N):
            if stance.start_seen and item.measured.start_s < stance.start_s < item.measured.end_s:
                return stance.start_s, OPPOSITE_STRIKE
    return item.measured.end_s, TOE_OFF


def _arm(
    shank: RollOverFrames,
    item: StanceComparison,
    time: np.ndarray,
    force: np.ndarray,
    cop: np.ndarray,
    free: np.ndarray,
) -> float | None:
    """Mean moment arm (m) over the measured stance: moment of the ground's force about the ankle, toe up."""
    rows = (time >= item.measured.start_s) & (time <= item.measured.end_s)
    frames = shank.at(time[rows])
    moment = np.cross(cop[rows] - frames.origin, force[rows])
    moment[:, 2] += free[rows]
    return mean_moment_arm(
        time[rows], -np.einsum("ni,ni->n", moment, frames.axes[:, :, 1]), force[rows, 2]
    )


# The foot rolled over by the loading profile of ISO 22675, at each fulcrum position (`simulation.roll_over`), with the
# platform's friction left out, so that the guide of the line bears what is sideways; no joint at the pylon's top.

SECOND_PEAK_S = 0.4475
"""The shape ends at the second peak of the force: later the load only leaves the toe."""
ROLL_CURVE_POINTS = 301


def iso_roll_over(
    foot: FootParameters,
    fulcrums_m: Sequence[float],
    *,
    force_n: float,
    steps: int,
    friction: bool = False,
    progress: Progress | None = None,
) -> tuple[list[IsoRow], Curves, list[str]]:
    """Rolls the foot at every fulcrum position (m), to F_1cmax = `force_n` (N), the profile's first peak, in as many
    steps: rows, curves by name, and sentences on what failed and, without friction, on what does not follow.

    With `friction`, the foot's own with the platform, the tilt axis matters: it is put into the platform's surface,
    under the pylon (a choice). The foot slides under a line that is held.
    """
    machine = RollOver(foot, friction=friction)
    time = np.linspace(0.0, DURATION_S, steps + 1)
    tilt, force = tilt_rad(time), force_n * force_share(time)
    kept = np.unique(np.round(np.linspace(1, steps, ROLL_CURVE_POINTS)).astype(int)) - 1
    curves = {
        "iso_time_s": time[1:][kept],
        "iso_tilt_deg": np.degrees(tilt[1:][kept]),
        "iso_wanted_n": force[1:][kept],
    }
    rows: list[IsoRow] = []
    missing: list[str] = []
    for i, fulcrum in enumerate(fulcrums_m):
        if progress:
            progress("rolling the foot over", i / len(fulcrums_m))
        place = f"The ISO 22675 profile, fulcrum {1e3 * fulcrum:g} mm{', with friction' if friction else ''}"
        try:
            run, following = machine.roll(
                fulcrum_m=fulcrum, time_s=time, tilt_rad=tilt, force_n=force
            )
        except SimulationError as error:
            missing.append(f"{place}: {error}.")
            continue
        row, own = rolled_row(
            machine, run, following, fulcrum, duration_s=DURATION_S, shape_ends_s=SECOND_PEAK_S
        )
        rows.append(row)
        if not row.follows and not friction:
            missing += say("roll_over", "not_followed", place=place, residual_n=row.residual_n)
        curves |= {f"iso_{1e3 * fulcrum:.0f}_{name}": values[kept] for name, values in own.items()}
    return rows, curves, missing


def energy_taken(run: RollOverRun) -> tuple[np.ndarray, np.ndarray]:
    """(n,) J that keel, fulcrum and foam hold as strain, and that they have taken in, what they lost included."""
    e = run.energy
    strain = e["keel_strain"] + e["fulcrum_strain"] + e["contact_strain"]
    return strain, strain + (
        e["keel_loss"] + e["fulcrum_loss"] + e["contact_loss"] + e["friction_loss"]
    )


def rolled_row(
    machine: RollOver,
    run: RollOverRun,
    following: Following,
    fulcrum: float,
    *,
    duration_s: float,
    shape_ends_s: float,
) -> tuple[IsoRow, Curves]:
    """The row of a foot that was rolled under a profile of this duration, its shape up to `shape_ends_s`; its curves."""
    foot = machine.parameters
    cop = in_mount_frame(run.cop_W, run.mount)
    arm = run.cop_W - np.column_stack([run.mount[:, 0], np.zeros(len(cop)), run.mount[:, 1]])
    moment = arm[:, 0] * run.grf_W[:, 2] - arm[:, 2] * run.grf_W[:, 0]
    strain, taken_in = energy_taken(run)
    steps = np.diff(taken_in, prepend=0.0)
    taken, given = float(steps[steps > 0.0].sum()), -float(steps[steps < 0.0].sum())
    half = run.time_s <= 0.5 * duration_s
    rolled = run.time_s <= shape_ends_s
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


# The roll-over shape of a foot: its arc, its effective length, and the mean moment arm about the ankle.
#
# Hansen, Childress & Knox 2004; Hansen, Sam & Childress 2004 (J. Prosthet. Orthot. 16), not read at their source. As
# used here:
#
# - effective foot length ratio: from the heel, the rear end of the foot, to the shape's front end, along the shank
#   frame's forward axis, over the length of the foot;
# - arc: the circle whose distances from the points of the shape have the least sum of squares, the points evenly spaced
#   along the shape rather than in time, so that no part counts more because the load rests there;
# - mean moment arm: "the ratio of sagittal ankle moment impulse to ground reaction force impulse" (abstract of Adamczyk
#   2020, doi 10.1115/1.4045817); here the impulse of the vertical force is taken.

_SPACING_M = 1e-3
_STRAIGHT = 20.0
"""Radius in lengths of the shape beyond which it counts as straight (a choice)."""
_FEWEST, _MOST_STEPS = 5, 50


def fit_arc(points_m: np.ndarray) -> np.ndarray | None:
    """(3,) centre (forward, up) and radius (m) of the circle nearest to points (n, 2), by Gauss-Newton on their
    distances; None where the points are too few, or nearly on a line: then a radius means nothing."""
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
    """What describes a roll-over shape, the centre of pressure (n, 2) forward and up in the shank's frame, NaN where
    there is none; `heel_m` is where the rear end of the foot, from which `foot_length_m` counts, is on the forward
    axis. None where it cannot be known."""
    points, circle = points_m[np.isfinite(points_m).all(axis=1)], None
    if len(points) > 1:
        along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
        at = np.linspace(0.0, along[-1], max(2, round(along[-1] / _SPACING_M) + 1))
        circle = fit_arc(np.column_stack([np.interp(at, along, column) for column in points.T]))
    ratio = (float(points[:, 0].max()) - heel_m) / foot_length_m if len(points) else None
    return RollShape(
        radius_m=None if circle is None else float(circle[2]),
        effective_foot_length_ratio=ratio,
        mean_moment_arm_m=arm_m,
    )


def mean_moment_arm(
    time_s: np.ndarray, moment_nm: np.ndarray, vertical_n: np.ndarray
) -> float | None:
    """Impulse of the moment about the ankle (toe up positive) over that of the vertical force (m); where the moment is
    NaN neither counts. None without load."""
    known = np.isfinite(moment_nm)
    force = np.where(known, vertical_n, 0.0)
    impulse = float(np.trapezoid(force, time_s))
    if impulse <= 0.0:
        return None
    return float(np.trapezoid(np.where(known, moment_nm, 0.0), time_s)) / impulse
