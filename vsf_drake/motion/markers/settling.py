"""How much a prosthesis gives under the person who stands on it while it is measured.

Markers show the prosthesis as long as it is under load. The model's length is the unloaded one; between them lie
foam, keel and socket. Statics for small deflections, the sole held flat: contact spheres against the rigid heel block
and against a keel of sprung joints, pinned at its end A and carried by the fulcrum; the socket in series, along the
limb.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.optimize import brentq

from vsf_drake.laws.beam import section_inertia
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.parameters import GRAVITY, FootParameters, ModelParameters

STANDING_SHARE = 0.5
"""Share of the weight on the prosthesis in standing, where it was not measured (a choice: even)."""
WALKING_SHARE = 0.85
"""Vertical force in mid-stance over the weight: Schwartz et al. (2008, doi 10.1016/j.jbiomech.2008.03.015) at
1.1 m/s; for a walk that stands in for the standing trial."""
MID_FULCRUM_M = 0.108
"""Where the fulcrum is taken to have stood, if nobody says: mid-range of 66 to 151 mm (a choice)."""
LEAST_LOAD_N, NEAR_M, SAME_WEIGHT = 50.0, 0.2, 0.1
"""A plate carries a foot if it bears so much, its centre of pressure is so near to that ankle and twice as far from the
other; the feet carry the person if their loads make up the weight to this part (choices)."""
_DEEPEST_M = 0.1
_ITERATIONS = 50


def settling(load_n: float, model: ModelParameters, *, fulcrum_m: float = MID_FULCRUM_M) -> float:
    """Metres by which the sole comes nearer to the residual limb under `load_n` (N) along the pylon."""
    if load_n <= 0.0:
        return 0.0
    depth = brentq(lambda d: flat_sole_force(d, model.foot, fulcrum_m=fulcrum_m) - load_n, 0.0, _DEEPEST_M)
    return float(depth) + load_n / model.socket.tz.stiffness


def flat_sole_force(depth: float, foot: FootParameters, *, fulcrum_m: float) -> float:
    """N on the flat sole pressed `depth` (m) into the ground.

    Keel joints turn by theta and raise the keel at x by the sum of theta_j (x - x_j) over the joints behind x; their
    moments, the fulcrum's force and those of the spheres balance (Newton's method on theta).
    """
    x, rise, k, n = (np.array(column) for column in zip(*(
        (1e-3 * x, 1e-3 * rise, zone.stiffness, zone.exponent) for zone in foot.zones
        for x, rise in zip(zone.x_mm, zone.rise_mm, strict=True)), strict=True))
    lengths = np.array(foot.keel.element_lengths_m)
    joints = np.concatenate(([0.0], np.cumsum(lengths) - 0.5 * lengths))
    bending = foot.keel.flexural_modulus_pa * section_inertia(foot.keel.width_m, foot.keel.thickness_m)
    springs = np.diag(np.concatenate(([0.0], bending / lengths)))
    at_fulcrum = np.maximum(0.0, fulcrum_m - joints)
    springs += foot.fulcrum.stiffness_n_per_m * np.outer(at_fulcrum, at_fulcrum)
    lever = np.maximum(0.0, x[:, None] - joints) * (x >= foot.fulcrum.rearmost_m)[:, None]
    theta = np.zeros(len(joints))
    for _ in range(_ITERATIONS):
        pressed = np.maximum(0.0, depth - rise - lever @ theta)
        force = k * pressed**n
        slope = np.where(pressed > 0.0, k * n * pressed ** (n - 1.0), 0.0)
        residual = springs @ theta - lever.T @ force
        step = np.linalg.solve(springs + lever.T @ (slope[:, None] * lever), residual)
        theta -= step
        if np.abs(step).max() < 1e-12:
            break
    return float(force.sum())


def measured_under(
    standing: Recording, ankles_W: Mapping[str, np.ndarray], prosthetic_side: str, mass_kg: float, *, start_s: float,
    end_s: float, still: bool
) -> tuple[float, str]:
    """N on the prosthesis while its length was measured, and where that is from.

    Standing with each foot on plates of its own, the plates tell the share of the weight; else it is taken as half of
    the weight, or 0.85 of it in a walk.

    Args:
        ankles_W: (3,) m by side, where the feet stand. start_s, end_s: the stretch that was averaged.
    """
    weight = mass_kg * GRAVITY
    if not still:
        return WALKING_SHARE * weight, f"taken as {WALKING_SHARE:g} of the weight, as in mid-stance"
    loads = dict.fromkeys(ankles_W, 0.0)
    time = standing.force_time_s
    during = (time >= start_s) & (time <= end_s)
    for plate in standing.plates:
        vertical, cop = plate.force_n[during, 2], plate.cop_m[during, :2]
        if not len(vertical) or not np.isfinite(cop).all() or np.mean(vertical) < LEAST_LOAD_N:
            continue
        away = {side: float(np.linalg.norm(cop.mean(axis=0) - ankle[:2])) for side, ankle in ankles_W.items()}
        near, far = sorted(away, key=lambda side: away[side])
        if away[near] < NEAR_M and away[near] < 0.5 * away[far]:
            loads[near] += float(np.mean(vertical))
    if min(loads.values()) > 0.0 and abs(sum(loads.values()) / weight - 1.0) < SAME_WEIGHT:
        share = loads[prosthetic_side] / sum(loads.values())
        return share * weight, f"{share:.2f} of the weight by the plates"
    return STANDING_SHARE * weight, "taken as half of the weight, not measured"
