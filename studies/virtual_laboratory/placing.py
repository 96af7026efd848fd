"""Puts a motion on its feet, before anything is simulated.

Each foot is two supports, heel and forefoot, that rest on the floor, sunk in by what they shall carry; the centre of
mass is accelerated by both feet's forces; toes are clear of the floor in swing; everything stays near published curves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from virtual_laboratory.fitting import Targets
from virtual_laboratory.motion import COORDINATES, DEVICE, INTACT_FOOT, Linearised, Person, Splines, make_splines
from virtual_laboratory.supports import Support, anchor, device_supports, intact_supports
from virtual_laboratory.targets import Draw, intact_force, prosthetic_force
from vsf_drake.parameters import GRAVITY

RATE_HZ = 200
"""Of the kinematics."""
MARGIN_S = 0.42
"""Recorded before heel strike and after toe-off."""
PLACING = 8
"""Steps of the fit."""
STANDARD = {"pelvis_tx": 0.015, "pelvis_ty": 0.03, "pelvis_tz": 0.04, "pelvis_tilt": 0.02, "pelvis_list": 0.025,
            "pelvis_rotation": 0.03, "hip_flexion": 0.09, "hip_adduction": 0.035, "hip_rotation": 0.06,
            "knee_angle_r": 0.03, "knee_angle_l": 0.06, "knee_adduction": 0.02, "knee_rotation": 0.05,
            "ankle_angle": 0.1, "ankle_adduction": 0.04, "ankle_rotation": 0.04}
"""How far (m, rad) a coordinate may well be from its published curve; the pelvis, from its mean path."""
ROUGHNESS_PER_S3 = 2.0e3
"""Third derivative of a correction that goes with its `STANDARD`, as a multiple of it."""
SUPPORT_M, INTACT_SUPPORT_M, ROLL_RAD, CLEARANCE_M = 5e-4, 2e-3, 0.01, 2e-3
"""Tolerated: place of a loaded support of either foot, roll and turn of a loaded foot, height of the sole in swing."""
INTACT_N = 30.0
"""Tolerated load on the intact foot's spheres (N)."""
ACCELERATION, ACCELERATION_ALONE, EARLY_S = 0.2, 0.15, 0.02
"""Tolerated acceleration of the centre of mass (m/s^2), and where the prosthesis stands alone (and a little before and
after), so that no other force can explain it."""
LIFT_M, HELD_M, AWAY_S = 0.024, 0.012, 0.10
"""Wished height of the sole in swing and how far above it counts as near, so long after lift-off and before strike."""


@dataclass
class Attempt:
    """The motion as it stands.

    Attributes:
        time_s: (N,) s at RATE_HZ from the prosthetic foot's strike; base: (N, 21); c: (21, K) coefficients.
    """

    draw: Draw
    time_s: np.ndarray
    base: np.ndarray
    splines: Splines
    c: np.ndarray

    @property
    def q(self) -> np.ndarray:
        """(N, 21) m and rad."""
        moved: np.ndarray = self.base + self.splines.values @ self.c.T
        return moved


def recorded_time(draw: Draw) -> np.ndarray:
    """Instants (s) of the kinematics, from the wished heel strike."""
    before, after = round(MARGIN_S * RATE_HZ), round((draw.stance_s + MARGIN_S) * RATE_HZ)
    return np.arange(-before, after + 1) / RATE_HZ


def standard_deviations() -> np.ndarray:
    """(21,) `STANDARD` by coordinate."""
    return np.array([STANDARD.get(n) or STANDARD[n[:-2]] for n in COORDINATES])


def start(draw: Draw, base: Callable[[Draw, np.ndarray], np.ndarray]) -> Attempt:
    time_s = recorded_time(draw)
    splines = make_splines(time_s)
    return Attempt(draw, time_s, base(draw, time_s), splines, np.zeros((len(COORDINATES), splines.values.shape[1])))


def place(person: Person, attempt: Attempt) -> tuple[list[Support], list[Support]]:
    """Puts both feet on the floor where they carry their forces; returns the supports it used."""
    draw, weight = attempt.draw, person.subject.mass_kg * GRAVITY
    prosthetic, intact = prosthetic_force(draw, attempt.time_s), intact_force(draw, attempt.time_s)
    device = device_supports(person, draw, weight * prosthetic[:, 2], attempt.time_s)
    other = intact_supports(person, draw, weight * intact[:, 2], attempt.time_s)
    _shift(person, attempt, device)
    for _ in range(PLACING):
        body = person.linearise(attempt.q)
        targets = common_targets(person, attempt, body, other)
        for support in device:
            anchor(targets, body, support, SUPPORT_M)
        level(targets, body, DEVICE, prosthetic[:, 2], -np.radians(draw.toe_out_deg), ROLL_RAD)
        attempt.c += targets.solve()
    return device, other


def _shift(person: Person, attempt: Attempt, device: list[Support]) -> None:
    """Moves the base pelvis to where the loaded supports lie on average."""
    body = person.linearise(attempt.q)
    off, total = np.zeros(3), 0.0
    for support in device:
        loaded = support.load_n > 100.0
        p_W, _ = body.point(support.segment, support.p_B)
        off += (support.p_W - p_W)[loaded].sum(axis=0)
        total += np.count_nonzero(loaded)
    forward, left, up = off / total
    attempt.base[:, :3] += [forward, up, -left]


def common_targets(person: Person, attempt: Attempt, body: Linearised, intact: list[Support]) -> Targets:
    """What both stages ask: near the published curves, smooth, dynamics, intact foot on the floor, toes up in swing."""
    draw, time = attempt.draw, attempt.time_s
    targets, sigma = Targets(attempt.splines), standard_deviations()
    correction = attempt.splines.values @ attempt.c.T
    correction[:, :3] -= correction[:, :3].mean(axis=0)
    targets.coordinates(-correction, sigma)
    targets.smooth(attempt.c, ROUGHNESS_PER_S3 * sigma)
    for support in intact:
        anchor(targets, body, support, INTACT_SUPPORT_M)
    _bear(targets, person, body, person.subject.mass_kg * GRAVITY * intact_force(draw, time)[:, 2])
    level(targets, body, INTACT_FOOT, intact_force(draw, time)[:, 2], np.radians(draw.toe_out_deg), 3.0 * ROLL_RAD)
    total = prosthetic_force(draw, time) + intact_force(draw, time)
    wanted = GRAVITY * (total - [0.0, 0.0, 1.0])
    step = time[1] - time[0]
    present = np.zeros_like(wanted)
    present[1:-1] = (body.com_W[2:] - 2.0 * body.com_W[1:-1] + body.com_W[:-2]) / step**2
    alone = (time > draw.intact_lift_s - EARLY_S) & (time < draw.intact_strike_s + EARLY_S)
    targets.acceleration(body.J_com, wanted - present, np.where(alone, ACCELERATION_ALONE, ACCELERATION))
    stride = draw.stride_s
    device = [np.array([x, 0.0, person.sole_height]) for x in (0.01, 0.12, person.model.foot.length_m - 0.01)]
    _clear(targets, body, DEVICE, device, time, lifts=(draw.stance_s - stride, draw.stance_s), strikes=(0.0, stride))
    length, ankle = person.handles.body.foot_length, person.handles.body.ankle_height
    intact_foot = [np.array([(r - person.model.intact_foot.ankle_x_ratio) * length, 0.0, -ankle]) for r in (0.1, 0.8)]
    _clear(targets, body, INTACT_FOOT, intact_foot, time, lifts=(draw.intact_lift_s,), strikes=(draw.intact_strike_s,))
    return targets


def _bear(targets: Targets, person: Person, body: Linearised, load_n: np.ndarray) -> None:
    """Asks that the intact foot's spheres, as springs, be pressed into the floor by what the foot shall carry."""
    sites = person.handles.intact_sites
    force, J = np.zeros(len(load_n)), np.zeros((len(load_n), len(COORDINATES)))
    for p_BS, radius, stiffness in zip(sites.p_BS, sites.radius, sites.stiffness, strict=True):
        p_W, J_W = body.point(INTACT_FOOT, p_BS)
        depth = np.maximum(0.0, radius - p_W[:, 2])
        force += stiffness * depth
        J -= stiffness * (depth > 0.0)[:, None] * J_W[:, 2]
    width = np.where(load_n > 0.0, INTACT_N, np.inf)
    targets.pose(J[:, None], (load_n - force)[:, None], width[:, None])


def level(targets: Targets, body: Linearised, segment: int, load_bw: np.ndarray, turn_rad: float,
           sigma: float) -> None:
    """Asks that a loaded foot's transverse axis lies level, the foot turned by `turn_rad` about the vertical."""
    lateral = body.R_WB[:, segment, :, 1]
    J = np.cross(body.J_WB[:, segment, :3], lateral[:, :, None], axisa=1, axisb=1, axisc=1)[:, [0, 2]]
    width = np.where(load_bw > 0.03, sigma, np.inf)
    targets.pose(J, np.array([-np.sin(turn_rad), 0.0]) - lateral[:, [0, 2]], width[:, None])


def _clear(targets: Targets, body: Linearised, segment: int, sole: list[np.ndarray], time_s: np.ndarray, *,
           lifts: tuple[float, ...], strikes: tuple[float, ...]) -> None:
    """Asks for LIFT_M under the points `sole` of a foot between its lift-offs and its next strikes.

    Points a little higher are asked to stay where they are, or they would sink again in the next step.
    """
    swing = np.zeros(len(time_s), dtype=bool)
    for lift, strike in zip(lifts, strikes, strict=True):
        swing |= (time_s > lift + AWAY_S) & (time_s < strike - AWAY_S)
    for p_B in sole:
        p_W, J = body.point(segment, p_B)
        low = LIFT_M - p_W[:, 2]
        width = np.where(swing & (low > -HELD_M), CLEARANCE_M, np.inf)
        targets.pose(J[:, 2:], np.maximum(low, 0.0)[:, None], width[:, None])
