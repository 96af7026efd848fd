"""From a fitted motion to what a laboratory would have recorded of it: coordinates and both feet's
forces.

The prosthetic foot's force is what the virtual prosthesis gives when driven by the coordinates *as
written*: rounded, at 200 Hz, splined as `vsf_drake` splines them. The intact foot's is designed and
then, together with the trunk's motion, fitted to what the prosthesis did to the body; the trunk's
motion is closed by Newton's and Euler's equations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from virtual_laboratory.balance import (
    FUNCTIONS,
    PLATE,
    Wrench,
    ask_balance,
    steadying,
    triangle_mean,
)
from virtual_laboratory.body import HAT, PELVIS, SHANK
from virtual_laboratory.closing import Trunk, close, missing
from virtual_laboratory.fitting import Targets
from virtual_laboratory.motion import COORDINATES, MOVING, TRUNK, Person, trunk_turn
from virtual_laboratory.placing import (
    RATE_HZ,
    REPEATED,
    Attempt,
    Stage,
    roughness,
    set_stage,
    standard_deviations,
)
from virtual_laboratory.polish import FORCE_HZ, limb_load
from virtual_laboratory.prosthesis import Prosthesis, centre_of_pressure
from virtual_laboratory.reaction import Reaction
from virtual_laboratory.targets import Draw
from vsf_drake.model.parameters import PELVIS_TRANSLATIONS
from vsf_drake.motion.trajectory import CoordinateTrajectory

DECIMALS = 7
"""Of what is written: 1e-7 m and 1e-7 degrees."""
MOVED_M = 0.5
"""How far ahead of the laboratory's origin the foot comes down."""
CLOSING, RECORDED_BALANCE = 3, (0.3, 0.06)
"""Steps of the last fit, of trunk and intact plate alone, and force (N) and moment (N m) that it
tolerates: integrated, what is left sets the trunk adrift."""


@dataclass(frozen=True)
class Foot:
    """One foot's plate in W: force (n, 3) N, cop (n, 3) m (NaN below 20 N), free_moment (n,) N
    m."""

    force: np.ndarray
    cop: np.ndarray
    free_moment: np.ndarray


@dataclass(frozen=True)
class Truth:
    """What nobody records, at the n instants of the feet.

    Attributes:
        R_WB, p_WB: (n, S, 3, 3) and (n, S, 3) m, poses of `body.SEGMENTS`, the trunk's the last.
        shift: (n, 3) m, of the trunk's lumbar joint from its place in the pelvis, along W's axes.
        missing, lumped: what both plates and weight do not explain of the whole person's motion
            (`closing.missing`); lumped: if the trunk did not move in the pelvis.
    """

    R_WB: np.ndarray
    p_WB: np.ndarray
    shift: np.ndarray
    missing: Wrench
    lumped: Wrench


@dataclass(frozen=True)
class Recorded:
    """A trial as recorded; time starts at 0, the prosthetic foot strikes at MARGIN_S.

    Attributes:
        time_s: (N,) s, coordinates (N, 21) in m and degrees, rounded.
        force_time_s: (n,) s of the feet.
        reaction: all that the virtual prosthesis did.
    """

    draw: Draw
    time_s: np.ndarray
    coordinates: np.ndarray
    force_time_s: np.ndarray
    right: Foot
    left: Foot
    reaction: Reaction
    truth: Truth

    @property
    def trajectory(self) -> CoordinateTrajectory:
        """As a user of the files gets it, m and rad."""
        return CoordinateTrajectory(self.time_s, in_radians(self.coordinates), COORDINATES)


def in_degrees(q: np.ndarray) -> np.ndarray:
    """(N, 21) m and rad to m and degrees."""
    return np.where(np.isin(COORDINATES, PELVIS_TRANSLATIONS), q, np.degrees(q))


def in_radians(q: np.ndarray) -> np.ndarray:
    """(N, 21) m and degrees to m and rad."""
    return np.where(np.isin(COORDINATES, PELVIS_TRANSLATIONS), q, np.radians(q))


def record(person: Person, prosthesis: Prosthesis, attempt: Attempt, stage: Stage) -> Recorded:
    """Rounds the motion as it will be written, measures the prosthetic foot's force and closes the
    rest."""
    every = FORCE_HZ // RATE_HZ
    coordinates = in_degrees(attempt.q).round(DECIMALS)
    q = in_radians(coordinates)
    instants = attempt.time_s[0] + np.arange((len(q) - 1) * every + 1) / FORCE_HZ
    legs = person.leg_poses(
        CoordinateTrajectory(attempt.time_s, q, COORDINATES).sample(instants)[0]
    )
    R, p = legs[0][:, SHANK], legs[1][:, SHANK]
    reaction = prosthesis.walk(instants, R, p)
    load = limb_load(prosthesis, reaction, R, p)

    # Trunk and intact plate, as smooth functions, to what the prosthesis really did.
    u, c = attempt.u, attempt.c.copy()
    u[:, : len(COORDINATES)] = q
    sigma, active = standard_deviations(), slice(len(COORDINATES), None)
    seen = Wrench(triangle_mean(load.force, every), triangle_mean(load.moment, every))
    for _ in range(CLOSING):
        body = person.linearise(u[:, :MOVING])
        targets = Targets(attempt.splines, FUNCTIONS)
        targets.values(attempt.base - u, sigma)
        targets.smooth(c, roughness())
        targets.repeat(c, REPEATED * sigma)
        ask_balance(
            targets,
            body,
            stage.points,
            1.0 / RATE_HZ,
            seen,
            stage.plate,
            u[:, MOVING:],
            RECORDED_BALANCE,
        )
        change = targets.solve(active)
        c += change
        u += attempt.splines.values @ change.T
        level = steadying(
            person.linearise(u[:, :MOVING]),
            stage.points,
            1.0 / RATE_HZ,
            seen,
            stage.plate,
            u[:, MOVING:],
            attempt.stride,
        )
        attempt.base[:, MOVING:] += level
        u[:, MOVING:] += level
    # as the prosthesis's: mean over the last step
    between = np.maximum(instants - 0.5 / FORCE_HZ, instants[0])
    smooth = CoordinateTrajectory(attempt.time_s, u[:, active], TRUNK + PLATE).sample(between)[0]

    plate = set_stage(person, attempt.draw, prosthesis, between).plate.wrench(
        smooth[:, len(TRUNK) :]
    )
    acting = Wrench(load.force + plate.force, load.moment + plate.moment)
    near = person.with_trunk(*legs, trunk_turn(smooth[:, 3:6]).as_matrix(), smooth[:, :3])
    trunk = close(instants, stage.points, *legs, acting, Trunk(near[0][:, HAT], near[1][:, HAT]))
    poses = tuple(
        np.concatenate([leg, own[:, None]], axis=1)
        for leg, own in zip(legs, (trunk.R_WH, trunk.p_WL), strict=True)
    )
    shift = trunk.p_WL - legs[1][:, PELVIS] - legs[0][:, PELVIS] @ person.p_PL
    turned = (
        Rotation.from_matrix(legs[0][:, PELVIS].transpose(0, 2, 1) @ trunk.R_WH).mean().as_matrix()
    )
    lumped = person.with_trunk(*legs, legs[0][:, PELVIS] @ turned, np.zeros_like(shift))
    truth = Truth(
        *poses,
        shift,
        missing(reaction, plate, stage.points, *poses),
        missing(reaction, plate, stage.points, *lumped),
    )
    return _written(attempt.draw, coordinates, instants - instants[0], reaction, plate, truth)


def _written(
    draw: Draw,
    coordinates: np.ndarray,
    force_time_s: np.ndarray,
    reaction: Reaction,
    plate: Wrench,
    truth: Truth,
) -> Recorded:
    """Everything MOVED_M ahead, from time zero on."""
    ahead = np.array([MOVED_M, 0.0, 0.0])
    cop, free_moment = centre_of_pressure(plate.force, plate.moment)
    return Recorded(
        draw,
        np.arange(len(coordinates)) / RATE_HZ,
        coordinates + MOVED_M * np.isin(COORDINATES, "pelvis_tx"),
        force_time_s,
        Foot(reaction.force, reaction.cop + ahead, reaction.free_moment),
        Foot(plate.force, cop + ahead, free_moment),
        replace(reaction, time_s=force_time_s, cop=reaction.cop + ahead),
        replace(truth, p_WB=truth.p_WB + ahead),
    )
