"""Corrects a motion by what the virtual prosthesis carries when it walks with it.

Where force and centre of pressure are off, the shank is moved by the error over the stiffness there
(lower for more load, backward for more push, tilted forward to load the toe); the whole motion is
fitted again to these wishes together with those of `placing`, and so on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from virtual_laboratory.balance import Wrench, steadying, triangle_mean
from virtual_laboratory.body import DEVICE, SHANK
from virtual_laboratory.fitting import Targets
from virtual_laboratory.motion import COORDINATES, MOVING, Linearised, Person
from virtual_laboratory.placing import (
    RATE_HZ,
    ROLL_RAD,
    Attempt,
    Stage,
    common_targets,
    level,
    wished_balance,
)
from virtual_laboratory.prosthesis import Prosthesis
from virtual_laboratory.reaction import Reaction
from virtual_laboratory.supports import Support, target_centre
from virtual_laboratory.targets import prosthetic_force
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.trajectory import CoordinateTrajectory

FORCE_HZ = 1000
"""Of the forces."""
MEASURED = (0, 2, 5)
"""Steps in which it is measured how the force answers to the shank's pose."""
COARSE_S, FINE_STEPS = 1e-3, 2
"""Time step of the virtual walks but in the last steps."""
BALANCING, HELD_M, HELD_RAD = 4, 1e-5, 2e-5
"""Steps at the end that balance the body with what the prosthesis carries, and what the shank may
move in them."""
CLOSE_BALANCE = (1.0, 0.2)
"""Force (N) and moment (N m) that they tolerate on the body."""
STRIKE_S, STRIKE_M = 0.013, 2e-5
"""So long before and after heel strike the foot is kept in its place, to about so much."""
SHEAR_N_PER_M, SOFTEST_N_PER_M = 15e3, 8e3
PROBE_M, PROBE_RAD = 1e-3, 0.005
FORCE_N, SHEAR_N, CENTRE_M = 12.0, 4.0, 0.012
"""Tolerated: vertical and horizontal force, place of the centre of pressure."""
LARGEST_N, LOADED_N, RELAXATION = 1000.0, 20.0, 0.7
"""Largest error that is corrected at once; load that counts; share of the error that is
corrected."""

Moved = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Takes the shank's R (n, 3, 3) and p (n, 3) to others."""


@dataclass(frozen=True)
class ForwardSensitivity:
    """What the virtual prosthesis carries at the instants of the kinematics: force (N, 3) N, cop
    (N, 2) m (or NaN); load: its action on the residual limb, mean around the instant
    (`balance.triangle_mean`)."""

    force: np.ndarray
    cop: np.ndarray
    load: Wrench


def shank_poses(
    person: Person, time_s: np.ndarray, q: np.ndarray, instants: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """R (n, 3, 3) and p (n, 3) m of the shank at `instants` for coordinates q (N, 21) recorded at
    `time_s`, as `vsf_drake` interpolates them."""
    R_WB, p_WB = person.leg_poses(CoordinateTrajectory(time_s, q, COORDINATES).sample(instants)[0])
    return R_WB[:, SHANK], p_WB[:, SHANK]


def limb_load(
    prosthesis: Prosthesis, reaction: Reaction, R_WS: np.ndarray, p_WS: np.ndarray
) -> Wrench:
    """The socket's action on the residual limb at each instant."""
    force, moment = (
        np.einsum("nij,nj->ni", R_WS, part) for part in np.split(reaction.socket_load, 2, axis=1)
    )
    end = p_WS - prosthesis.residual_length * R_WS[:, :, 2]
    return Wrench(force, moment + np.cross(end, force))


def forward(
    person: Person, prosthesis: Prosthesis, attempt: Attempt, moved: Moved | None = None
) -> ForwardSensitivity:
    """One walk at 1 kHz, seen at the instants of the kinematics."""
    every = FORCE_HZ // RATE_HZ
    instants = attempt.time_s[0] + np.arange((len(attempt.time_s) - 1) * every + 1) / FORCE_HZ
    R, p = shank_poses(person, attempt.time_s, attempt.q, instants)
    if moved:
        R, p = moved(R, p)
    reaction = prosthesis.walk(instants, R, p)
    load = limb_load(prosthesis, reaction, R, p)
    return ForwardSensitivity(
        reaction.force[::every],
        reaction.cop[::every, :2],
        Wrench(triangle_mean(load.force, every), triangle_mean(load.moment, every)),
    )


def polish(
    person: Person,
    attempt: Attempt,
    prosthesis: Prosthesis,
    stage: Stage,
    steps: int,
    targeted: np.ndarray | None = None,
    tolerated_n: float = FORCE_N,
) -> None:
    """Brings the force on the virtual prosthesis to the wished one: `targeted` (N, 3) N, by default
    the draw's; vertically to about `tolerated_n`."""
    weight = person.subject.mass_kg * GRAVITY
    if targeted is None:
        targeted = weight * prosthetic_force(attempt.draw, attempt.time_s)
    spot = target_centre(person, attempt.draw, attempt.time_s)
    fine_s = prosthesis.step_s
    for k in range(steps):
        prosthesis.step_s = fine_s if k >= steps - FINE_STEPS else max(fine_s, COARSE_S)
        now = forward(person, prosthesis, attempt)
        if k in MEASURED:
            K = _stiffness(person, prosthesis, attempt, now, spot)
        body = person.linearise(attempt.u[:, :MOVING])
        targets = common_targets(
            person, attempt, stage, body, *wished_balance(person, attempt, stage, targeted)
        )
        _carry(targets, body, now, targeted, spot, K, tolerated_n)
        level(
            targets,
            body,
            DEVICE,
            targeted[:, 2] / weight,
            -np.radians(attempt.draw.toe_out_deg),
            2.0 * ROLL_RAD,
        )
        for heel, strike_s in ((stage.device[0], 0.0), (stage.device[2], attempt.draw.stride_s)):
            _strike(targets, body, heel, attempt.time_s - strike_s)
        attempt.c += targets.solve()
    prosthesis.step_s = fine_s
    _balance(person, attempt, stage, forward(person, prosthesis, attempt).load)


def _balance(person: Person, attempt: Attempt, stage: Stage, load: Wrench) -> None:
    """Brings the body in balance with what the prosthesis does to it, the shank and so that load
    held."""
    wanted = person.linearise(attempt.u[:, :MOVING])
    attempt.base[:, MOVING:] += steadying(
        wanted,
        stage.points,
        1.0 / RATE_HZ,
        load,
        stage.plate,
        attempt.u[:, MOVING:],
        attempt.stride,
    )
    for _ in range(BALANCING):
        body = person.linearise(attempt.u[:, :MOVING])
        targets = common_targets(person, attempt, stage, body, stage.points, load, CLOSE_BALANCE)
        turned = Rotation.from_matrix(
            wanted.R_WB[:, SHANK] @ body.R_WB[:, SHANK].transpose(0, 2, 1)
        ).as_rotvec()
        off = np.column_stack([turned, wanted.p_WB[:, SHANK] - body.p_WB[:, SHANK]])
        targets.pose(body.J_WB[:, SHANK], off, np.array([HELD_RAD] * 3 + [HELD_M] * 3))
        attempt.c += targets.solve()


def _strike(targets: Targets, body: Linearised, heel: Support, time_s: np.ndarray) -> None:
    """Asks that the foot comes down in its place: shear counts from where it does."""
    p_W, J = body.point(heel.segment, heel.p_B)
    width = np.where(np.abs(time_s) < STRIKE_S, STRIKE_M, np.inf)
    targets.pose(J[:, :2], (heel.p_W - p_W)[:, :2], width[:, None])


def _moment(now: ForwardSensitivity, spot: np.ndarray) -> np.ndarray:
    """(N, 2) N m about W's x and y through `spot` (N, 2) m: zero where the centre of pressure lies
    there."""
    arm = np.where(np.isfinite(now.cop), now.cop - spot, 0.0)
    return np.column_stack([arm[:, 1], -arm[:, 0]]) * now.force[:, 2:]


def _stiffness(
    person: Person,
    prosthesis: Prosthesis,
    attempt: Attempt,
    now: ForwardSensitivity,
    spot: np.ndarray,
) -> np.ndarray:
    """(N, 5, 6) change of force (3) and moment about the spot (2) per turn (3) and shift (3) of the
    shank there.

    Height, pitch and roll by walking again with each a little changed; what shear does is a
    constant.
    """
    K = np.zeros((len(attempt.time_s), 5, 6))
    K[:, 0, 3] = K[:, 1, 4] = -SHEAR_N_PER_M
    fine = (
        attempt.time_s[0]
        + np.arange((len(attempt.time_s) - 1) * (FORCE_HZ // RATE_HZ) + 1) / FORCE_HZ
    )
    centre = np.column_stack(
        [np.interp(fine, attempt.time_s, line) for line in spot.T] + [np.zeros(len(fine))]
    )
    for column, axis in ((0, [1.0, 0.0, 0.0]), (1, [0.0, 1.0, 0.0]), (5, None)):
        if axis is None:
            other = forward(
                person, prosthesis, attempt, lambda R, p: (R, p - np.array([0.0, 0.0, PROBE_M]))
            )
            amount = -PROBE_M
        else:
            turn = Rotation.from_rotvec(PROBE_RAD * np.array(axis)).as_matrix()
            other = forward(
                person,
                prosthesis,
                attempt,
                lambda R, p, turn=turn: (turn @ R, centre + (p - centre) @ turn.T),
            )
            amount = PROBE_RAD
        K[:, :3, column] = (other.force - now.force) / amount
        K[:, 3:, column] = (_moment(other, spot) - _moment(now, spot)) / amount
    K[:, 2, 5] = np.minimum(K[:, 2, 5], -SOFTEST_N_PER_M)
    return K


def _carry(
    targets: Targets,
    body: Linearised,
    now: ForwardSensitivity,
    targeted: np.ndarray,
    spot: np.ndarray,
    K: np.ndarray,
    tolerated_n: float,
) -> None:
    """Asks for the wished force and, less strictly, for the wished centre of pressure."""
    lever = np.column_stack([spot, np.zeros(len(spot))]) - body.p_WB[:, SHANK]
    twist = np.concatenate([body.J_WB[:, SHANK, :3], body.forward(SHANK, lever)], axis=1)
    off = np.column_stack(
        [np.clip(targeted - now.force, -LARGEST_N, LARGEST_N), -_moment(now, spot)]
    )
    loaded = np.maximum(targeted[:, 2], now.force[:, 2]) > LOADED_N
    arm = np.maximum(targeted[:, 2], 100.0) * CENTRE_M
    width = np.column_stack(
        [np.full((len(off), 2), SHEAR_N), np.full(len(off), tolerated_n), arm, arm]
    )
    targets.pose(K @ twist, RELAXATION * off, np.where(loaded[:, None], width, np.inf))
