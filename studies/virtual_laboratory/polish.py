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
from scipy.spatial.transform import Rotation
from virtual_laboratory.fitting import Wishes
from virtual_laboratory.motion import COORDINATES, DEVICE, INTACT_FOOT, SHANK, Linearised, Person, Splines, make_splines
from virtual_laboratory.prosthesis import Prosthesis
from virtual_laboratory.reaction import Reaction
from virtual_laboratory.supports import Support, anchor, device_supports, intact_supports
from virtual_laboratory.targets import Draw, intact_force, prosthetic_force, roll_over

from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import GRAVITY

RATE_HZ = 200
MARGIN_S = 0.42
"""Recorded before heel strike and after toe-off."""
PLACING = 8
STIFFNESS_EVERY = 5
"""Steps between two measurements of how the force answers to the shank's pose."""
STANDARD = {"pelvis_tx": 0.015, "pelvis_ty": 0.03, "pelvis_tz": 0.04, "pelvis_tilt": 0.02, "pelvis_list": 0.025,
            "pelvis_rotation": 0.03, "hip_flexion": 0.09, "hip_adduction": 0.035, "hip_rotation": 0.06,
            "knee_angle_r": 0.035, "knee_angle_l": 0.06, "knee_adduction": 0.02, "knee_rotation": 0.05, "ankle_angle": 0.1,
            "ankle_adduction": 0.04, "ankle_rotation": 0.04}
"""How far (m, rad) a coordinate may well be from its published curve."""
ROUGHNESS_PER_S3 = 2.0e3
"""Third derivative of a correction that goes with its `STANDARD`, as a multiple of it."""
SUPPORT_M, ROLL_RAD, CLEARANCE_M, ACCELERATION, ACCELERATION_ALONE = 5e-4, 0.01, 2e-3, 0.3, 0.2
"""Tolerated: position of a loaded support, roll and turn of a loaded foot, height of the sole in swing; acceleration of
the centre of mass (m/s²), and where the prosthesis stands alone, so that no other force can explain it."""
EARLY_S = 0.02
FORCE_HZ = 1000
STRIKE_S, STRIKE_M = 0.013, 5e-4
SHEAR_N_PER_M, SOFTEST_N_PER_M = 15e3, 8e3
PROBE_M, PROBE_RAD = 1e-3, 0.005
FORCE_N, SHEAR_N, CENTRE_M, LARGEST_N, LOADED_N, RELAXATION = 6.0, 4.0, 0.012, 250.0, 20.0, 0.7
"""Tolerated: vertical and horizontal force, centre of pressure; limit of an error, load that counts, share of a step."""
LIFT_M, AWAY_S = 0.022, 0.10
"""Wished height of the sole in swing, this long after lift-off and before strike."""


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
        wishes = _common(person, attempt, body, other)
        for support in device:
            anchor(wishes, body, support, SUPPORT_M)
        _level(wishes, body, DEVICE, prosthetic[:, 2], -np.radians(draw.toe_out_deg), ROLL_RAD)
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
    correction = attempt.splines.values @ attempt.c.T
    correction[:, :3] -= correction[:, :3].mean(axis=0)
    wishes.coordinates(-correction, sigma)
    wishes.smooth(attempt.c, ROUGHNESS_PER_S3 * sigma)
    for support in intact:
        anchor(wishes, body, support, 4.0 * SUPPORT_M)
    _level(wishes, body, INTACT_FOOT, intact_force(draw, time)[:, 2], np.radians(draw.toe_out_deg), 3.0 * ROLL_RAD)
    total = prosthetic_force(draw, time) + intact_force(draw, time)
    wanted = GRAVITY * (total - [0.0, 0.0, 1.0])
    step = time[1] - time[0]
    present = np.zeros_like(wanted)
    present[1:-1] = (body.com_W[2:] - 2.0 * body.com_W[1:-1] + body.com_W[:-2]) / step**2
    alone = (time > draw.intact_lift_s - EARLY_S) & (time < draw.intact_strike_s + EARLY_S)
    wishes.acceleration(body.J_com, wanted - present, np.where(alone, ACCELERATION_ALONE, ACCELERATION))
    stride = draw.stride_s
    device = [np.array([x, 0.0, person.sole_height]) for x in (0.01, 0.12, person.model.foot.length_m - 0.01)]
    _clear(wishes, body, DEVICE, device, time, lifts=(draw.stance_s - stride, draw.stance_s), strikes=(0.0, stride))
    length, ankle = person.handles.body.foot_length, person.handles.body.ankle_height
    intact_foot = [np.array([(r - person.model.intact_foot.ankle_x_ratio) * length, 0.0, -ankle]) for r in (0.1, 0.8)]
    _clear(wishes, body, INTACT_FOOT, intact_foot, time, lifts=(draw.intact_lift_s,), strikes=(draw.intact_strike_s,))
    return wishes


def _level(wishes: Wishes, body: Linearised, segment: int, load_bw: np.ndarray, turn_rad: float,
           sigma: float) -> None:
    """Asks that a loaded foot's transverse axis lies level, the foot turned by `turn_rad` about the vertical."""
    lateral = body.R_WB[:, segment, :, 1]
    J = np.cross(body.J_WB[:, segment, :3], lateral[:, :, None], axisa=1, axisb=1, axisc=1)[:, [0, 2]]
    width = np.where(load_bw > 0.03, sigma, np.inf)
    wishes.pose(J, np.array([-np.sin(turn_rad), 0.0]) - lateral[:, [0, 2]], width[:, None])


def _clear(wishes: Wishes, body: Linearised, segment: int, sole: list[np.ndarray], time_s: np.ndarray, *,
           lifts: tuple[float, ...], strikes: tuple[float, ...]) -> None:
    """Asks for LIFT_M under the points `sole` of a foot between its lift-offs and its next strikes."""
    swing = np.zeros(len(time_s), dtype=bool)
    for lift, strike in zip(lifts, strikes, strict=True):
        swing |= (time_s > lift + AWAY_S) & (time_s < strike - AWAY_S)
    for p_B in sole:
        p_W, J = body.point(segment, p_B)
        low = LIFT_M - p_W[:, 2]
        width = np.where(swing & (low > 0.0), CLEARANCE_M, np.inf)
        wishes.pose(J[:, 2:], low[:, None], width[:, None])


@dataclass(frozen=True)
class Carried:
    """What the virtual prosthesis carries at the instants of the kinematics: force (N, 3) N, cop (N, 2) m (NaN unloaded)."""

    force: np.ndarray
    cop: np.ndarray


def walk(person: Person, prosthesis: Prosthesis, time_s: np.ndarray, q: np.ndarray, instants: np.ndarray,
         moved: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]] | None = None) -> Reaction:
    """Drives the virtual prosthesis by the coordinates q (N, 21) recorded at `time_s`, as `vsf_drake` would.

    Args:
        instants: (n,) s of the reaction.
        moved: takes the shank's R (n, 3, 3) and p (n, 3) to others.
    """
    shank = CoordinateTrajectory(time_s, q, COORDINATES).sample(instants)[0]
    R_WB, p_WB = person.poses(shank)
    R, p = R_WB[:, SHANK], p_WB[:, SHANK]
    return prosthesis.walk(instants, *((R, p) if moved is None else moved(R, p)))


def carried(person: Person, prosthesis: Prosthesis, attempt: Attempt,
            moved: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]] | None = None) -> Carried:
    """One walk at 1 kHz, seen at the instants of the kinematics."""
    every = FORCE_HZ // RATE_HZ
    instants = attempt.time_s[0] + np.arange((len(attempt.time_s) - 1) * every + 1) / FORCE_HZ
    reaction = walk(person, prosthesis, attempt.time_s, attempt.q, instants, moved)
    return Carried(reaction.force[::every], reaction.cop[::every, :2])


def polish(person: Person, attempt: Attempt, prosthesis: Prosthesis, device: list[Support],
           intact: list[Support], steps: int) -> None:
    """Brings the force on the virtual prosthesis to the wished one."""
    weight = person.subject.mass_kg * GRAVITY
    wished = weight * prosthetic_force(attempt.draw, attempt.time_s)
    spot = wished_centre(person, attempt.draw, attempt.time_s)
    for k in range(steps):
        now = carried(person, prosthesis, attempt)
        if k % STIFFNESS_EVERY == 0:
            K = _stiffness(person, prosthesis, attempt, now, spot)
        body = person.linearise(attempt.q)
        wishes = _common(person, attempt, body, intact)
        _carry(wishes, body, now, wished, spot, K)
        _level(wishes, body, DEVICE, wished[:, 2] / weight, -np.radians(attempt.draw.toe_out_deg), 2.0 * ROLL_RAD)
        _strike(wishes, body, device[0], attempt.time_s)
        attempt.c += wishes.solve()


def _strike(wishes: Wishes, body: Linearised, heel: Support, time_s: np.ndarray) -> None:
    """Asks that the foot comes down in its place: shear counts from where it does."""
    p_W, J = body.point(heel.segment, heel.p_B)
    width = np.where(np.abs(time_s) < STRIKE_S, STRIKE_M, np.inf)
    wishes.pose(J[:, :2], (heel.p_W - p_W)[:, :2], width[:, None])


def wished_centre(person: Person, draw: Draw, time_s: np.ndarray) -> np.ndarray:
    """(N, 2) m, wished centre of pressure on the floor."""
    heel, toe = (support.p_W[:2] for support in device_supports(person, draw, np.zeros(len(time_s)), time_s))
    return heel + np.outer(roll_over(time_s / draw.stance_s, draw.roll_over), toe - heel)


def _moment(now: Carried, spot: np.ndarray) -> np.ndarray:
    """(N, 2) N m about W's x and y through `spot` (N, 2) m: zero where the centre of pressure lies there."""
    arm = np.where(np.isfinite(now.cop), now.cop - spot, 0.0)
    return np.column_stack([arm[:, 1], -arm[:, 0]]) * now.force[:, 2:]


def _stiffness(person: Person, prosthesis: Prosthesis, attempt: Attempt, now: Carried, spot: np.ndarray) -> np.ndarray:
    """(N, 5, 6) change of force (3) and moment about the spot (2) per turn (3) and shift (3) of the shank there.

    Height, pitch and roll by walking again with each a little changed; what shear does is a constant.
    """
    K = np.zeros((len(attempt.time_s), 5, 6))
    K[:, 0, 3] = K[:, 1, 4] = -SHEAR_N_PER_M
    fine = attempt.time_s[0] + np.arange((len(attempt.time_s) - 1) * (FORCE_HZ // RATE_HZ) + 1) / FORCE_HZ
    centre = np.column_stack([np.interp(fine, attempt.time_s, line) for line in spot.T] + [np.zeros(len(fine))])
    for column, axis in ((0, [1.0, 0.0, 0.0]), (1, [0.0, 1.0, 0.0]), (5, None)):
        if axis is None:
            other = carried(person, prosthesis, attempt, lambda R, p: (R, p + [0.0, 0.0, -PROBE_M]))
            amount = -PROBE_M
        else:
            turn = Rotation.from_rotvec(PROBE_RAD * np.array(axis)).as_matrix()
            other = carried(person, prosthesis, attempt,
                            lambda R, p, turn=turn: (turn @ R, centre + (p - centre) @ turn.T))
            amount = PROBE_RAD
        K[:, :3, column] = (other.force - now.force) / amount
        K[:, 3:, column] = (_moment(other, spot) - _moment(now, spot)) / amount
    K[:, 2, 5] = np.minimum(K[:, 2, 5], -SOFTEST_N_PER_M)
    return K


def _carry(wishes: Wishes, body: Linearised, now: Carried, wished: np.ndarray, spot: np.ndarray,
           K: np.ndarray) -> None:
    """Asks for the wished force and, less strictly, for the wished centre of pressure."""
    lever = np.column_stack([spot, np.zeros(len(spot))]) - body.p_WB[:, SHANK]
    twist = np.concatenate([body.J_WB[:, SHANK, :3], body.carried(SHANK, lever)], axis=1)
    off = np.column_stack([np.clip(wished - now.force, -LARGEST_N, LARGEST_N), -_moment(now, spot)])
    loaded = np.maximum(wished[:, 2], now.force[:, 2]) > LOADED_N
    arm = np.maximum(wished[:, 2], 100.0) * CENTRE_M
    width = np.column_stack([np.full((len(off), 2), SHEAR_N), np.full(len(off), FORCE_N), arm, arm])
    wishes.pose(K @ twist, RELAXATION * off, np.where(loaded[:, None], width, np.inf))
