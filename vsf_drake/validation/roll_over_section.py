"""The section "roll-over": inclined loading, the ISO 22675 loading profile, and roll-over shapes in
walking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.base.progress import Progress, part_of
from vsf_drake.base.sentences import say
from vsf_drake.device.inclined import HEEL_DEG, TOE_DEG, InclinedRow, press_inclined
from vsf_drake.device.roll_over import (
    Curves,
    Iso,
    RollShape,
    arc_radius,
    described,
    iso_roll_over,
    mean_moment_arm,
)
from vsf_drake.model.parameters import GRAVITY, FootParameters
from vsf_drake.motion.events import known_stances
from vsf_drake.motion.manifest import mount_of
from vsf_drake.plants.foot import set_mount, sole_height
from vsf_drake.plants.gait import make_gait
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, PUBLISHED_SPEED_M_PER_S
from vsf_drake.simulation.roll_over import RollOver
from vsf_drake.validation.study import Section, Study, StudyWalk, told
from vsf_drake.walks.comparison import (
    PERCENT,
    StanceComparison,
    filtered_while_loaded,
    percent_instants,
    resample,
)
from vsf_drake.walks.numbers import Spread, by_fulcrum, spread
from vsf_drake.walks.recorded_walk import reached

LEAST_FORCE_N = 50.0
MOST_FORCE_N = 5000.0
STEPS_PER_MM = 160.0
ISO_STEPS = 1200
QUICK_STEPS_PER_MM = 40.0
QUICK_ISO_STEPS = 600
QUICK_POSITIONS_M = (0.066, 0.108, 0.151)
HEEL_PERCENT = 10.0
"""Of stance, in which the foot lands on its heel (a choice); the circle nearest to the whole shape
hangs on it most."""


@dataclass(frozen=True, kw_only=True)
class Footfall:
    """The shape of one footfall, of the model and of the plate, seen from the recorded shank."""

    label: str
    fulcrum_mm: float
    ends_at: str  # OPPOSITE_STRIKE or TOE_OFF
    leg_length_m: float
    model: RollShape
    measured: RollShape
    heel_apart_m: float | None = None
    """mean distance of the two shapes over the first HEEL_PERCENT of stance"""
    later_apart_m: float | None = None  # and over the rest


@dataclass(frozen=True, kw_only=True)
class RollOverCondition:
    """The footfalls at one position: what describes their shapes by its key, and
    `radius_leg_lengths`."""

    fulcrum_mm: float
    model: Mapping[str, Spread]
    measured: Mapping[str, Spread]

    def off(self, name: str) -> float | None:
        """By how many percent the model's mean misses the plate's."""
        model = self.model[name].mean
        measured = self.measured[name].mean
        return None if model is None or measured is None else 100.0 * (model / measured - 1.0)


@dataclass(frozen=True, kw_only=True)
class RollOverTable:
    """The section on rolling over."""

    inclined: tuple[InclinedRow, ...]
    iso: Iso
    walks: tuple[Footfall, ...]  # their curves are `walk_0_...` and so on
    conditions: tuple[RollOverCondition, ...]
    synthetic: bool
    heel_percent: float = HEEL_PERCENT


def roll_over_section(study: Study, *, progress: Progress | None = None) -> Section[RollOverTable]:
    """Everything about rolling over; InputError if the force of the profile is no force to test a
    foot with."""
    given = study.options.iso_force_n
    quick = study.options.quick
    foot = study.model.foot
    if given is not None and not LEAST_FORCE_N <= given <= MOST_FORCE_N:
        raise InputError(
            f"{given:g} N is no force to roll a foot over with",
            where="iso_force_n",
            right=f"Give the level's largest force, {LEAST_FORCE_N:g} to {MOST_FORCE_N:g} N",
        )
    force = float(study.walks[0].recorded.subject.mass_kg * GRAVITY if given is None else given)
    wanted = QUICK_POSITIONS_M if quick else PUBLISHED_FULCRUMS_M
    fulcrums = reached(foot, wanted)

    show = part_of(progress)
    inclined, curves, failed = _inclined_loading(
        foot,
        fulcrums,
        steps_per_mm=QUICK_STEPS_PER_MM if quick else STEPS_PER_MM,
        progress=part_of(progress, 0.0, 0.3),
    )
    rolled, more, failed_rolls = iso_roll_over(
        foot,
        fulcrums,
        force_n=force,
        steps=QUICK_ISO_STEPS if quick else ISO_STEPS,
        progress=part_of(progress, 0.3, 0.4),
    )
    rough, _, failed_rough = iso_roll_over(
        foot,
        fulcrums,
        force_n=force,
        steps=QUICK_ISO_STEPS,
        friction=True,
        progress=lambda what, fraction: show(f"{what} with friction", 0.7 + 0.1 * fraction),
    )
    missing = [
        *say("roll_over", "unreached", positions_m=[x for x in wanted if x not in fulcrums]),
        *failed,
        *failed_rolls,
        *failed_rough,
    ]
    rows: list[Footfall] = []
    for i, walk in enumerate(study.walks):
        show("roll-over shapes", 0.8 + 0.2 * i / len(study.walks))
        shapes, unknown = walked_shapes(walk)
        missing += unknown
        for row, seen in shapes:
            for side, points in seen.items():
                curves |= {
                    f"walk_{len(rows)}_{side}_{axis}_m": column
                    for axis, column in zip(("forward", "up"), points.T, strict=True)
                }
            rows.append(row)
    conditions = tuple(_condition(x, own) for x, own in by_fulcrum(rows).items())
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
    def means(side: str) -> dict[str, Spread]:
        shapes = [getattr(row, side) for row in rows]
        found = {
            field.name: spread(getattr(shape, field.name) for shape in shapes)
            for field in fields(RollShape)
        }
        radii = [
            shape.radius_m and shape.radius_m / row.leg_length_m
            for row, shape in zip(rows, shapes, strict=True)
        ]
        return {"radius_leg_lengths": spread(radii), **found}

    return RollOverCondition(
        fulcrum_mm=fulcrum_mm, model=means("model"), measured=means("measured")
    )


LARGEST_LOAD_N = 600.0
CURVE_POINTS = 201
"""Points of a saved curve, loading and unloading."""


def _inclined_loading(
    foot: FootParameters, fulcrums_m: Sequence[float], *, steps_per_mm: float, progress: Progress
) -> tuple[list[InclinedRow], Curves, list[str]]:
    """Presses the foot to 600 N and lets go, on heel and toe and at every fulcrum position (m), at
    50 mm/min: rows, curves by name (`inclined_A_F_...` with angle and position in whole degrees and
    mm), and sentences on what failed."""
    machine = RollOver(foot, friction=False)
    rows: list[InclinedRow] = []
    curves: Curves = {}
    missing: list[str] = []
    cases = [(angle, fulcrum) for angle in (HEEL_DEG, TOE_DEG) for fulcrum in fulcrums_m]
    for i, (angle, fulcrum) in enumerate(cases):
        progress("pressing the inclined foot", i / len(cases))
        where = f"Inclined loading at {angle:+g} degrees, fulcrum {1e3 * fulcrum:g} mm"
        with told(missing, where):
            row, curve = press_inclined(
                machine,
                angle_deg=angle,
                fulcrum_m=fulcrum,
                load_n=LARGEST_LOAD_N,
                speed_m_per_s=PUBLISHED_SPEED_M_PER_S,
                steps_per_mm=steps_per_mm,
            )
            rows.append(row)
            every = np.round(np.linspace(0, len(curve.load_n) - 1, CURVE_POINTS)).astype(int)
            at = np.union1d(every, [curve.peak])
            sign = "minus" if angle < 0 else "plus"
            name = f"inclined_{sign}{abs(angle):.0f}_{1e3 * fulcrum:.0f}"
            curves |= {
                f"{name}_displacement_m": curve.displacement_m[at],
                f"{name}_load_n": curve.load_n[at],
            }
    return rows, curves, missing


# The roll-over shape of each walk of a study, from the model's centre of pressure and from the
# plate's.
#
# Both are seen from the same frame, which owes the simulation nothing: the recorded residual
# shank's, its origin where the pylon's lower end is with the socket unloaded. What the socket gives
# under load is thus part of the shape.

OPPOSITE_STRIKE = "opposite heel strike"
TOE_OFF = "toe-off"


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
    """Every footfall that is recorded and simulated as a whole with its curves, "model" and
    "measured", (101, 2) over the measured stance and NaN outside the shape; and sentences on what
    is not there."""
    result = walk.result
    whole = [item for item in walk.comparison.stances if item.inside]
    if not whole:
        return [], say("roll_over", "no_shape", label=walk.label)
    plate = walk.recorded.prosthetic_plate
    shank, heel, leg = _shank(walk)
    landing = PERCENT < HEEL_PERCENT
    shapes = []
    for item in whole:
        end, kind = _end(walk, item)
        instants = percent_instants(item.measured)
        seen = Curves()
        sides = dict[str, RollShape]()
        for name, time, force, cop, free in (
            ("model", result.time_s, result.grf_W, result.cop_W, result.free_moment_nm),
            ("measured", plate.time_s, plate.force_W, plate.cop_W, plate.free_moment_nm),
        ):
            smooth = filtered_while_loaded(cop[:, :2], time, force[:, 2], cop, instants)
            smooth[instants > end + 1e-9] = np.nan
            seen[name] = shank.at(instants).seen(np.column_stack([smooth, np.zeros(len(smooth))]))
            shape = described(
                seen[name],
                heel_m=heel,
                foot_length_m=result.foot_length_m,
                arm_m=_arm(shank, item, time, force, cop, free),
            )
            sides[name] = replace(shape, radius_after_heel_m=arc_radius(seen[name][~landing]))
        apart = np.linalg.norm(seen["model"] - seen["measured"], axis=1)
        shapes.append(
            (
                Footfall(
                    label=walk.label,
                    fulcrum_mm=walk.fulcrum_mm,
                    ends_at=kind,
                    leg_length_m=leg,
                    heel_apart_m=spread(apart[landing]).mean,
                    later_apart_m=spread(apart[~landing]).mean,
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
    """The shank over the walk; where the heel is on the forward axis (m); the prosthetic leg's
    length (m)."""
    trial = walk.trial
    offsets = walk.trial.offsets
    gait = make_gait(trial.subject, trial.model)
    person = gait.person
    plant = gait.plant
    context = plant.CreateDefaultContext()
    set_mount(context, person.foot, **mount_of(offsets))
    ankle = np.array([0.0, 0.0, -person.body.residual_length - person.body.pylon_length])
    shank = person.segments[f"shank_{trial.subject.prosthetic_side}"]
    p_KHeel = [trial.model.foot.heel_x_m, 0.0, sole_height(trial.model.foot)]
    X_PK = plant.CalcRelativeTransform(
        context, person.socket.distal, person.foot.frame.body_frame()
    )
    origin = []
    axes = []
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
    plate = walk.recorded.intact_plate
    if plate is not None:
        for stance in known_stances(plate):
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
    """Mean moment arm (m) over the measured stance: moment of the ground's force about the ankle,
    toe up."""
    rows = (time >= item.measured.start_s) & (time <= item.measured.end_s)
    frames = shank.at(time[rows])
    moment = np.cross(cop[rows] - frames.origin, force[rows])
    moment[:, 2] += free[rows]
    return mean_moment_arm(
        time[rows], -np.einsum("ni,ni->n", moment, frames.axes[:, :, 1]), force[rows, 2]
    )
