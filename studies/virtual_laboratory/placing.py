"""Puts a motion on its feet, before anything is simulated.

Each foot is two supports, heel and forefoot, that rest on the floor, sunk in by what they shall
carry; both feet's forces and moments change the whole body's momenta; toes are clear of the floor
in swing; everything stays near published curves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from virtual_laboratory.balance import FUNCTIONS, PLATE, IntactPlate, Wrench, ask_balance
from virtual_laboratory.body import DEVICE, INTACT_FOOT, SHANK, MassPoints, body_points
from virtual_laboratory.fitting import Targets
from virtual_laboratory.motion import (
    COORDINATES,
    MOVING,
    TRUNK,
    Linearised,
    Person,
    Splines,
    cross,
    make_splines,
)
from virtual_laboratory.prosthesis import Prosthesis
from virtual_laboratory.supports import (
    Support,
    anchor,
    device_supports,
    intact_supports,
    target_centre,
)
from virtual_laboratory.targets import (
    RISE_M,
    Draw,
    harmonics,
    intact_force,
    prosthetic_force,
    roll_over,
)
from vsf_drake.model.parameters import GRAVITY

RATE_HZ = 200
"""Of the kinematics."""
MARGIN_S, AFTER_S = 0.34, 0.16
"""Recorded before the prosthetic foot's strike, and after the end of the intact foot's next
stance."""
PLACING = 5
"""Steps of the fit."""
STANDARD = {
    "pelvis_tx": 0.006,
    "pelvis_ty": 0.03,
    "pelvis_tz": 0.015,
    "pelvis_tilt": 0.02,
    "pelvis_list": 0.02,
    "pelvis_rotation": 0.015,
    "hip_flexion": 0.09,
    "hip_adduction": 0.035,
    "hip_rotation": 0.06,
    "knee_angle_r": 0.038,
    "knee_angle_l": 0.036,
    "knee_adduction": 0.02,
    "knee_rotation": 0.05,
    "ankle_angle": 0.1,
    "ankle_adduction": 0.04,
    "ankle_rotation": 0.04,
}
"""How far (m, rad) a coordinate may well be from its published curve; the pelvis, from its mean
path."""
TRUNK_STANDARD, PLATE_STANDARD = (
    (0.001,) * 3 + (0.02, 0.03, 0.06),
    (0.008, 0.02, 0.005, 0.004, 0.006, 0.001),
)
"""The same of the trunk (`motion.TRUNK`) and of the intact foot's plate (`balance.PLATE`)."""
REPEATED = 0.05
"""How far a correction may well be from itself a stride later, as a multiple of its standard: 0.06
to 0.3 degrees of an angle, 0.3 to 1.5 mm of the pelvis (a choice, below what people's strides
differ by)."""
ROUGHNESS_PER_S3, TRUNK_ROUGHNESS_PER_S3, PLATE_ROUGHNESS_PER_S3 = 6.0e3, 1.0e4, 5.0e3
"""Third derivative of a correction that goes with its standard, as a multiple of it."""
SUPPORT_M, INTACT_SUPPORT_M, ROLL_RAD, CLEARANCE_M = 5e-4, 2e-3, 0.01, 2e-3
"""Tolerated: place of a loaded support of either foot, roll and turn of a loaded foot, height of
the sole in swing."""
INTACT_N = 30.0
"""Tolerated load on the intact foot's spheres (N)."""
BALANCE, UNBALANCED = (5.0, 1.0), (1e6, 1e6)
"""Tolerated force (N) and moment (N m) on the whole body that no plate explains; the recording has
none. Without asking for a balance."""
LIFT_M, HELD_M, AWAY_S, NEAR_S = 0.024, 0.012, 0.10, 0.035
"""Wished height of the sole in swing and how far above it counts as near; so long after lift-off,
so long before strike."""


@dataclass
class Attempt:
    """The motion as it stands.

    Attributes:
        time_s: (N,) s at RATE_HZ from the prosthetic foot's strike.
        base: (N, 33) functions before the fit: coordinates, trunk, intact plate; c: (33, K)
            coefficients.
        ease: of each function, by which times STANDARD and the like it gives way.
    """

    draw: Draw
    time_s: np.ndarray
    base: np.ndarray
    splines: Splines
    c: np.ndarray
    ease: float | np.ndarray = 1.0

    @property
    def u(self) -> np.ndarray:
        """(N, 33) all functions."""
        moved: np.ndarray = self.base + self.splines.values @ self.c.T
        return moved

    @property
    def stride(self) -> np.ndarray:
        """(N,) whether an instant is of the stride that begins with the prosthetic foot's
        strike."""
        return (self.time_s >= 0.0) & (self.time_s < self.draw.stride_s)

    @property
    def q(self) -> np.ndarray:
        """(N, 21) m and rad."""
        return self.u[:, : len(COORDINATES)]


def recorded_time(draw: Draw) -> np.ndarray:
    """Instants (s) of the kinematics, from the wished heel strike."""
    end = draw.intact_strike_s + draw.intact_duty * draw.stride_s + AFTER_S
    before, after = round(MARGIN_S * RATE_HZ), round(end * RATE_HZ)
    return np.arange(-before, after + 1) / RATE_HZ


def standard_deviations() -> np.ndarray:
    """(33,) `STANDARD` by coordinate, then the trunk's and the plate's."""
    return np.array(
        [
            *(STANDARD.get(n) or STANDARD[n[:-2]] for n in COORDINATES),
            *TRUNK_STANDARD,
            *PLATE_STANDARD,
        ]
    )


def roughness() -> np.ndarray:
    """(33,) third derivative of a correction that is tolerated."""
    return standard_deviations() * np.repeat(
        [ROUGHNESS_PER_S3, TRUNK_ROUGHNESS_PER_S3, PLATE_ROUGHNESS_PER_S3],
        [len(COORDINATES), len(TRUNK), len(PLATE)],
    )


def start(draw: Draw, base: Callable[[Draw, np.ndarray], np.ndarray]) -> Attempt:
    time_s = recorded_time(draw)
    splines, motion = make_splines(time_s, draw.stride_s), base(draw, time_s)
    whole = np.column_stack([motion, np.zeros((len(time_s), FUNCTIONS - motion.shape[1]))])
    return Attempt(draw, time_s, whole, splines, np.zeros((FUNCTIONS, splines.values.shape[1])))


@dataclass(frozen=True)
class Stage:
    """What does not change while a motion is fitted.

    Attributes:
        points: mass points of the body without its prosthesis; worn: the prosthesis's, undeformed,
            on the shank.
        device, intact: supports; plate: the intact foot's as designed.
    """

    points: MassPoints
    worn: MassPoints
    device: list[Support]
    intact: list[Support]
    plate: IntactPlate


def set_stage(person: Person, draw: Draw, prosthesis: Prosthesis, time_s: np.ndarray) -> Stage:
    weight = person.subject.mass_kg * GRAVITY
    load = weight * intact_force(draw, time_s)
    intact = intact_supports(person, draw, load[:, 2], time_s)
    device = device_supports(person, draw, weight * prosthetic_force(draw, time_s)[:, 2], time_s)
    centre = np.zeros_like(load)
    for k, (heel, toe) in enumerate(zip(intact[::2], intact[1::2], strict=True)):
        part = (time_s - draw.intact_strike_s + (1 - k) * draw.stride_s) / (
            draw.intact_duty * draw.stride_s
        )
        rows = part > -0.1
        centre[rows] = heel.p_W + roll_over(part[rows])[:, None] * (toe.p_W - heel.p_W)
    high = np.array([0.0, 0.0, 5.0])
    prosthesis.reset(np.eye(3), high)
    mass = np.concatenate([prosthesis.device.masses, prosthesis.device.node_masses])
    worn = MassPoints(np.full(len(mass), SHANK), prosthesis.state.mass_x - high, mass)
    return Stage(
        body_points(person.handles, person.model.intact_foot, prosthesis.mass_kg),
        worn,
        device,
        intact,
        IntactPlate(load, centre),
    )


def place(
    person: Person, attempt: Attempt, stage: Stage, balance: tuple[float, float] = BALANCE
) -> None:
    """Puts both feet on the floor where they carry their forces."""
    draw, weight = attempt.draw, person.subject.mass_kg * GRAVITY
    prosthetic = weight * prosthetic_force(draw, attempt.time_s)
    points, wished = wished_balance(person, attempt, stage, prosthetic)
    _shift(person, attempt, stage.device)
    for _ in range(PLACING):
        body = person.linearise(attempt.u[:, :MOVING])
        targets = common_targets(person, attempt, stage, body, points, wished, balance)
        for support in stage.device:
            anchor(targets, body, support, SUPPORT_M)
        level(
            targets,
            body,
            DEVICE,
            prosthetic[:, 2] / weight,
            -np.radians(draw.toe_out_deg),
            ROLL_RAD,
        )
        attempt.c += targets.solve()


def rise_of_legs(person: Person, attempt: Attempt, stage: Stage) -> np.ndarray:
    """(3,) m for `targets.lifted`, of a motion that nothing but the legs' reach lifts."""
    place(person, attempt, stage, UNBALANCED)
    body = person.linearise(attempt.u[:, :MOVING])
    points = stage.points.together(stage.worn)
    height = (points.mass @ points.places(body.R_WB, body.p_WB))[:, 2] / points.mass.sum()
    part = np.arange(400) / 400.0
    height = np.interp(part * attempt.draw.stride_s, attempt.time_s, height)
    return harmonics(height, len(RISE_M))


def wished_balance(
    person: Person, attempt: Attempt, stage: Stage, force: np.ndarray
) -> tuple[MassPoints, Wrench]:
    """The body with its prosthesis undeformed, and the ground's wished force (N, 3) N on that at
    the wished place."""
    spot = target_centre(person, attempt.draw, attempt.time_s)
    return stage.points.together(stage.worn), Wrench(
        force, np.cross(np.column_stack([spot, 0.0 * spot[:, 0]]), force)
    )


def _shift(person: Person, attempt: Attempt, device: list[Support]) -> None:
    """Moves the base pelvis to where the loaded supports lie on average."""
    body = person.linearise(attempt.u[:, :MOVING])
    off, total = np.zeros(3), 0.0
    for support in device:
        loaded = support.load_n > 100.0
        p_W, _ = body.point(support.segment, support.p_B)
        off += (support.p_W - p_W)[loaded].sum(axis=0)
        total += np.count_nonzero(loaded)
    forward, left, up = off / total
    attempt.base[:, :3] += [forward, up, -left]


def common_targets(
    person: Person,
    attempt: Attempt,
    stage: Stage,
    body: Linearised,
    points: MassPoints,
    outer: Wrench,
    balance: tuple[float, float] = BALANCE,
) -> Targets:
    """What both stages ask: near the published curves, smooth, in balance with the wrench `outer`
    and the intact plate, intact foot on the floor, toes up in swing."""
    draw, time, u = attempt.draw, attempt.time_s, attempt.u
    targets = Targets(attempt.splines, FUNCTIONS)
    sigma = attempt.ease * standard_deviations()
    correction = attempt.splines.values @ attempt.c.T
    correction[:, :3] -= correction[:, :3].mean(axis=0)
    targets.values(-correction, sigma)
    targets.smooth(attempt.c, roughness())
    targets.repeat(attempt.c, REPEATED * sigma)
    for support in stage.intact:
        anchor(targets, body, support, INTACT_SUPPORT_M)
    load = stage.plate.wrench(u[:, MOVING:]).force[:, 2]
    _bear(targets, person, body, load)
    level(
        targets,
        body,
        INTACT_FOOT,
        load / (person.subject.mass_kg * GRAVITY),
        np.radians(draw.toe_out_deg),
        3.0 * ROLL_RAD,
    )
    ask_balance(targets, body, points, 1.0 / RATE_HZ, outer, stage.plate, u[:, MOVING:], balance)
    stride = draw.stride_s
    device = [
        np.array([x, 0.0, person.sole_height])
        for x in (0.01, 0.12, person.model.foot.length_m - 0.01)
    ]
    _clear(
        targets,
        body,
        DEVICE,
        device,
        time,
        lifts=(draw.stance_s - stride, draw.stance_s),
        strikes=(0.0, stride),
    )
    length, ankle = person.handles.body.foot_length, person.handles.body.ankle_height
    intact_foot = [
        np.array([(r - person.model.intact_foot.ankle_x_ratio) * length, 0.0, -ankle])
        for r in (0.1, 0.8)
    ]
    _clear(
        targets,
        body,
        INTACT_FOOT,
        intact_foot,
        time,
        lifts=(draw.intact_lift_s, draw.intact_lift_s + stride),
        strikes=(draw.intact_strike_s, draw.intact_strike_s + stride),
    )
    return targets


def _bear(targets: Targets, person: Person, body: Linearised, load_n: np.ndarray) -> None:
    """Asks that the intact foot's spheres, as springs, be pressed into the floor by what the foot
    shall carry."""
    sites = person.handles.intact_sites
    force, J = np.zeros(len(load_n)), np.zeros((len(load_n), MOVING))
    for p_BS, radius, stiffness in zip(sites.p_BS, sites.radius, sites.stiffness, strict=True):
        p_W, J_W = body.point(INTACT_FOOT, p_BS)
        depth = np.maximum(0.0, radius - p_W[:, 2])
        force += stiffness * depth
        J -= stiffness * (depth > 0.0)[:, None] * J_W[:, 2]
    width = np.where(load_n > 0.0, INTACT_N, np.inf)
    targets.pose(J[:, None], (load_n - force)[:, None], width[:, None])


def level(
    targets: Targets,
    body: Linearised,
    segment: int,
    load_bw: np.ndarray,
    turn_rad: float,
    sigma: float,
) -> None:
    """Asks that a loaded foot's transverse axis lies level, the foot turned by `turn_rad` about the
    vertical."""
    lateral = body.R_WB[:, segment, :, 1]
    J = cross(body.J_WB[:, segment, :3], lateral[:, :, None])[:, [0, 2]]
    width = np.where(load_bw > 0.03, sigma, np.inf)
    targets.pose(J, np.array([-np.sin(turn_rad), 0.0]) - lateral[:, [0, 2]], width[:, None])


def _clear(
    targets: Targets,
    body: Linearised,
    segment: int,
    sole: list[np.ndarray],
    time_s: np.ndarray,
    *,
    lifts: tuple[float, ...],
    strikes: tuple[float, ...],
) -> None:
    """Asks for LIFT_M under the points `sole` of a foot between its lift-offs and its next strikes.

    Points a little higher are asked to stay where they are, or they would sink again in the next
    step.
    """
    swing = np.zeros(len(time_s), dtype=bool)
    for lift, strike in zip(lifts, strikes, strict=True):
        swing |= (time_s > lift + AWAY_S) & (time_s < strike - NEAR_S)
    for p_B in sole:
        p_W, J = body.point(segment, p_B)
        low = LIFT_M - p_W[:, 2]
        width = np.where(swing & (low > -HELD_M), CLEARANCE_M, np.inf)
        targets.pose(J[:, 2:], np.maximum(low, 0.0)[:, None], width[:, None])
