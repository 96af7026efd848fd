"""The condensed foot as files: a table of its torques, and a model of MuJoCo, whose texts are in
`engines/templates`."""

from __future__ import annotations

import numpy as np

from vsf_drake.engines.condensed import PIECES, CondensedAt, CondensedFoot
from vsf_drake.engines.condensed_error import CondensedError
from vsf_drake.engines.mjcf import IMPRATIO
from vsf_drake.engines.written import STEP_S, filled, rendered
from vsf_drake.plants.rigid_foot import NAME
from vsf_drake.plants.solids import RIGHTWARD

TABLE_FULCRUM_MM = 5.0  # from one position of the table to the next, at most
TABLE_ANGLES_DEG = tuple(range(-10, 31, 5))
TABLE_RATES_DEG_PER_S = (-200.0, 0.0, 200.0)


def condensed_csv(condensed: CondensedFoot, error: CondensedError) -> str:
    """The torques of both hinges against fulcrum, angle and rate, rows of
    `hinge,fulcrum_mm,hinge_mm,angle_deg,rate_deg_per_s,torque_nm`; what they mean, the stations,
    and the `error` against the full foot stand in lines that begin with #."""
    reach = condensed.full.fulcrum
    count = int(np.ceil((reach.foremost_m - reach.rearmost_m) * 1e3 / TABLE_FULCRUM_MM)) + 1
    settings = [
        condensed.at(float(fulcrum))
        for fulcrum in np.linspace(reach.rearmost_m, reach.foremost_m, count)
    ]
    return filled(
        "condensed.csv.j2",
        foot=condensed,
        error=error,
        pieces=PIECES,
        settings=settings,
        angles_deg=TABLE_ANGLES_DEG,
        rates_deg_per_s=TABLE_RATES_DEG_PER_S,
        rad=float(np.radians(1.0)),
    )


def condensed_mjcf(condensed: CondensedFoot, error: CondensedError, *, fulcrum_m: float) -> str:
    """The condensed foot with its fulcrum at `fulcrum_m` (m from A) as an MJCF model's text, named
    vsf, with the `error` against the full foot in its head. Spheres, their numerics and the mount
    have the names of `foot_mjcf`.

    InputError if the carriage cannot reach the fulcrum.
    """
    at = condensed.at(fulcrum_m)
    return rendered(
        "condensed.mjcf.j2",
        foot=condensed,
        error=error,
        at=at,
        name=NAME,
        axis=RIGHTWARD,
        step_s=_step(at),
        mount_K=condensed.mount_K,
        impratio=IMPRATIO,
    )


def _step(at: CondensedAt) -> float:
    """Half of the longest step (s) that is steady in theory, STEP_S at most: MuJoCo takes springs K
    at the start of a step h and dampers tau K at its end, so that a mode of frequency w grows where
    4 / w^2 + 2 h tau - h^2 is negative (`written.py`)."""
    M = np.zeros((2, 2))
    for piece, carried in zip(at.pieces[1:], ([0], [0, 1]), strict=True):
        arm = np.zeros((1, 2))
        turn = np.zeros((1, 2))
        arm[0, carried] = piece.centre_m[0] - at.hinge_m[carried]
        turn[0, carried] = 1.0
        M += piece.mass_kg * arm.T @ arm + piece.inertia_kg_m2[1, 1] * turn.T @ turn
    fastest = np.linalg.eigvals(np.linalg.solve(M, np.diag(at.stiffness_nm_per_rad))).real.max()
    tau = at.damping_nm_s_per_rad[0] / at.stiffness_nm_per_rad[0]
    return min(STEP_S, 0.5 * float(tau + np.sqrt(tau**2 + 4.0 / fastest)))
