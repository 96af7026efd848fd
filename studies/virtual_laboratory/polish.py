"""Makes a motion whose prosthetic foot carries the wished force: placed on its supports first, then by what it carries.

1. `place`: each foot as two supports, heel and forefoot, that rest on the floor, sunk in by what they carry; the
   centre of mass accelerated by both feet's forces; toes clear of the floor in swing.
2. `polish`: the virtual prosthesis walks with the motion; where its force and centre of pressure are off, the shank is
   moved by the error over the stiffness there (lower for more load, backward for more push, tilted forward to load
   the toe). The whole motion is fitted again to these wishes, and so on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from virtual_laboratory.fitting import Wishes
from virtual_laboratory.motion import COORDINATES, DEVICE, INTACT_FOOT, Linearised, Person, Splines, make_splines
from virtual_laboratory.supports import Support, anchor, device_supports, intact_supports
from virtual_laboratory.targets import Draw, intact_force, prosthetic_force, roll_over

from vsf_drake.parameters import GRAVITY

RATE_HZ = 200
MARGIN_S = 0.42
"""Recorded before heel strike and after toe-off."""
PLACING, STEPS = 8, 14
STANDARD = {"pelvis_tx": 0.006, "pelvis_ty": 0.02, "pelvis_tz": 0.02, "pelvis_tilt": 0.02, "pelvis_list": 0.025,
            "pelvis_rotation": 0.03, "hip_flexion": 0.06, "hip_adduction": 0.035, "hip_rotation": 0.06,
            "knee_angle": 0.06, "knee_adduction": 0.02, "knee_rotation": 0.05, "ankle_angle": 0.08,
            "ankle_adduction": 0.04, "ankle_rotation": 0.04}
"""How far (m, rad) a coordinate may well be from its published curve."""
ROUGHNESS_PER_S3 = 2.0e3
"""Third derivative of a correction that goes with its `STANDARD`, as a multiple of it."""
SUPPORT_M, ROLL_RAD, ACCELERATION, CLEARANCE_M = 5e-4, 0.01, 0.25, 2e-3
"""Tolerated: position of a loaded support, roll of a loaded foot, acceleration of the centre of mass (m/s²), height."""
LIFT_M = 0.022
"""Wished height of the prosthesis's sole in the middle of its swing."""


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
    return np.array([STANDARD[n if n.startswith("pelvis") else n[:-2]] for n in COORDINATES])


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
        wishes = _common(person, attempt, body, other)
        for support in device:
            anchor(wishes, body, support, SUPPORT_M)
        _level(wishes, body, DEVICE, prosthetic[:, 2], ROLL_RAD)
        attempt.c += wishes.solve()
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


def _common(person: Person, attempt: Attempt, body: Linearised, intact: list[Support]) -> Wishes:
    """What both stages ask: near the published curves, smooth, dynamics, intact foot on the floor, toes up in swing."""
    draw, time = attempt.draw, attempt.time_s
    wishes, sigma = Wishes(attempt.splines), standard_deviations()
    wishes.coordinates(-(attempt.splines.values @ attempt.c.T), 3.0 * sigma)
    wishes.smooth(attempt.c, ROUGHNESS_PER_S3 * sigma)
    for support in intact:
        anchor(wishes, body, support, 2.0 * SUPPORT_M)
    _level(wishes, body, INTACT_FOOT, intact_force(draw, time)[:, 2], 3.0 * ROLL_RAD)
    total = prosthetic_force(draw, time) + intact_force(draw, time)
    wanted = GRAVITY * (total - [0.0, 0.0, 1.0])
    step = time[1] - time[0]
    present = np.zeros_like(wanted)
    present[1:-1] = (body.com_W[2:] - 2.0 * body.com_W[1:-1] + body.com_W[:-2]) / step**2
    wishes.acceleration(body.J_com, wanted - present, np.full(len(time), ACCELERATION * 6.0))
    _clear(wishes, person, body, draw, time)
    return wishes


def _level(wishes: Wishes, body: Linearised, segment: int, load_bw: np.ndarray, sigma: float) -> None:
    """Asks that a loaded foot's transverse axis lies level."""
    lateral = body.R_WB[:, segment, :, 1]
    J = np.cross(body.J_WB[:, segment, :3], lateral[:, :, None], axisa=1, axisb=1, axisc=1)[:, 2:]
    width = np.where(load_bw > 0.05, sigma, np.inf)
    wishes.pose(J, -lateral[:, 2:], width[:, None])


def _clear(wishes: Wishes, person: Person, body: Linearised, draw: Draw, time_s: np.ndarray) -> None:
    """Asks for LIFT_M under both ends of the prosthesis's sole, away from strike and lift-off."""
    away = np.minimum(np.abs(time_s[:, None] - [draw.stance_s - draw.stride_s, draw.stance_s]).min(axis=1),
                      np.abs(time_s[:, None] - [0.0, draw.stride_s]).min(axis=1))
    swing = ((time_s < 0.0) | (time_s > draw.stance_s)) & (away > 0.11)
    for x in (0.01, 0.12, person.model.foot.length_m - 0.01):
        p_W, J = body.point(DEVICE, np.array([x, 0.0, person.sole_height]))
        low = LIFT_M - p_W[:, 2]
        width = np.where(swing & (low > 0.0), CLEARANCE_M, np.inf)
        wishes.pose(J[:, 2:], low[:, None], width[:, None])


def along_foot(draw: Draw, time_s: np.ndarray) -> np.ndarray:
    """Wished centre of pressure of the prosthetic foot, 0 to 1 between its supports."""
    return roll_over(time_s / draw.stance_s, draw.roll_over)
