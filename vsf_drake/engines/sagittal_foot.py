"""Feet in the sagittal plane without mass: what the ground does to them at rest and as they roll.

Each is a chain of rigid pieces on sprung hinges, held at its mount over level ground without
friction, with spheres on its frame and its pieces. The full keel is one such chain, of nine hinges
on a support (`of_full`); the condensed foot another, of two. A foot without mass is what a
roll-over tests: along 15 paths (five fulcrum positions; 40, 75 and 110 kg) the full one's vertical
force is within 1.2 % of the peak of that with its mass, 0.1 % root mean square.

All arrays begin with an axis of B feet, which are solved side by side. Frames are those of
`plants.foot` and `plants.bench`: K of the keel, W of the ground; a mount's place is forward (m), up
(m) and pitch (rad), positive with the toe up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsf_drake.base.errors import SimulationError
from vsf_drake.laws import kelvin_voigt
from vsf_drake.laws.contact_law import LawConstants, power_law_strain
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants.foot import (
    keel_joint_positions,
    keel_joint_stiffness,
    mount_pose,
    sole_height,
)

ITERATIONS = 100
LARGEST_TURN_RAD = 0.1  # of a hinge in one iteration
TURN_PER_M = 10.0
"""Turn (rad) that counts as much as a metre of the mount's height."""
SOFTEST_N_M = 1.0  # slope below which an iteration goes no further downhill
AT_REST_RAD = 1e-9  # last step of what is at rest
MOVES_AT_RAD_PER_S = 1e-6  # last step of the rates of what rolls
WHOLE_STEPS = 12  # of Newton's method; of later ones it takes the half


@dataclass(frozen=True, eq=False)
class SagittalFeet:
    """B feet of m hinges and S spheres, see above."""

    starts: np.ndarray  # (B, m) m, the hinges' places from A along the straight keel
    stiffness: np.ndarray  # (B, m) N m/rad
    damping: np.ndarray  # (B, m) N m s/rad
    support: np.ndarray
    """(B, 3) where the keel is supported along z_K (m from A), N/m and N s/m; no support: N/m 0"""
    piece: np.ndarray  # (S,) hinge that carries each sphere, -1 for the frame
    x: np.ndarray  # (B, S) m, the centres in K with the keel straight
    z: np.ndarray  # (B, S) m
    radius: np.ndarray  # (S,) m
    law: LawConstants  # of `laws.kelvin_voigt`, (B, S) or (S,)
    mount_K: np.ndarray  # (2,) m, x and z of the mount in K


class Balance(NamedTuple):
    """Moments on the hinges and what the ground does."""

    moment: np.ndarray  # (B, m) N m, springs and dampers less what the ground exerts
    by_angle: np.ndarray  # (B, m, m) N m/rad
    by_rate: np.ndarray  # (B, m, m) N m s/rad
    depth: np.ndarray  # (B, S) m, negative above the ground
    normal: np.ndarray  # (B, S) N
    by_depth: np.ndarray  # (B, S) N/m
    rise: np.ndarray  # (B, S, m) m/rad, of each sphere by each hinge
    forward: np.ndarray  # (B, S) m, the spheres' x in W
    strain: np.ndarray  # (B,) J in springs, support and foam
    loss: np.ndarray  # (B,) W that dampers take

    @property
    def force(self) -> np.ndarray:
        """(B,) N, vertical, on the foot."""
        return np.asarray(self.normal.sum(axis=1))

    @property
    def centre_of_pressure(self) -> np.ndarray:
        """(B,) m, forward in W; NaN without force."""
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sum(self.normal * self.forward, axis=1) / self.force)


def of_full(foot: FootParameters, fulcrum_m: np.ndarray) -> SagittalFeet:
    """The full foot with its fulcrum at each of (B,) m from A."""
    starts = np.concatenate(([0.0], keel_joint_positions(foot.keel)))
    stiffness = np.concatenate(([0.0], keel_joint_stiffness(foot.keel)))
    spheres = [
        (1e-3 * x, 1e-3 * rise, zone)
        for zone in foot.zones
        for x, rise in zip(zone.x_mm, zone.rise_mm, strict=True)
    ]
    x = np.array([sphere[0] for sphere in spheres])
    radius = np.array([zone.radius_m for *_, zone in spheres])
    bottom = sole_height(foot) + np.array([sphere[1] for sphere in spheres])
    on_frame = x < foot.fulcrum.rearmost_m
    constant = np.ones_like(fulcrum_m)
    support = foot.fulcrum.stiffness_n_per_m
    return SagittalFeet(
        starts=np.outer(constant, starts),
        stiffness=np.outer(constant, stiffness),
        damping=np.outer(constant, stiffness * foot.keel.damping_time_s),
        support=np.column_stack(
            [fulcrum_m, support * constant, support * foot.fulcrum.damping_time_s * constant]
        ),
        piece=np.where(on_frame, -1, np.searchsorted(starts, x, side="right") - 1),
        x=np.outer(constant, x),
        z=np.outer(constant, bottom + radius),
        radius=radius,
        law=LawConstants(
            stiffness=np.array([zone.stiffness for *_, zone in spheres]),
            exponent=np.array([zone.exponent for *_, zone in spheres]),
            damping=np.array([zone.damping_n_s_per_m for *_, zone in spheres]),
            full_damping_depth=np.array([zone.full_damping_depth_m for *_, zone in spheres]),
        ),
        mount_K=mount_pose(foot).translation()[[0, 2]],
    )


class _Points(NamedTuple):
    """Points of the chain in K: places (B, P) and their changes by the hinges (B, P, m)."""

    x: np.ndarray
    z: np.ndarray
    x_by: np.ndarray
    z_by: np.ndarray


def _points(
    feet: SagittalFeet, q: np.ndarray, piece: np.ndarray, x: np.ndarray, z: np.ndarray
) -> _Points:
    """The points that are at x, z (B, P) on the straight chain, on `piece` (B, P)."""
    angle = np.cumsum(q, axis=1)
    length = np.diff(feet.starts, axis=1)
    first = feet.starts[:, :1]
    hinge_x = np.hstack([first, first + np.cumsum(length * np.cos(angle[:, :-1]), axis=1)])
    hinge_z = np.hstack([0.0 * first, np.cumsum(length * np.sin(angle[:, :-1]), axis=1)])
    row = np.arange(len(q))[:, None]
    on_frame = piece < 0
    c = np.where(on_frame, 1.0, np.cos(angle)[row, piece])
    s = np.where(on_frame, 0.0, np.sin(angle)[row, piece])
    along = x - np.where(on_frame, 0.0, feet.starts[row, piece])
    point_x = np.where(on_frame, 0.0, hinge_x[row, piece]) + along * c - z * s
    point_z = np.where(on_frame, 0.0, hinge_z[row, piece]) + along * s + z * c
    carried = np.arange(q.shape[1]) <= piece[..., None]
    return _Points(
        x=point_x,
        z=point_z,
        x_by=np.where(carried, hinge_z[:, None] - point_z[..., None], 0.0),
        z_by=np.where(carried, point_x[..., None] - hinge_x[:, None], 0.0),
    )


def balance(
    feet: SagittalFeet, q: np.ndarray, rate: np.ndarray, mount: np.ndarray, mount_rate: np.ndarray
) -> Balance:
    """At hinge angles and rates (B, m), positive with the toe up, and the mount's places and rates
    (B, 3)."""
    m = q.shape[1]
    spheres = _points(feet, q, np.broadcast_to(feet.piece, feet.x.shape), feet.x, feet.z)
    cosine = np.cos(mount[:, 2:])
    sine = np.sin(mount[:, 2:])
    x = spheres.x - feet.mount_K[0]
    z = spheres.z - feet.mount_K[1]
    lever = cosine * x - sine * z
    rise = sine[..., None] * spheres.x_by + cosine[..., None] * spheres.z_by
    depth = feet.radius - (mount[:, 1:2] + sine * x + cosine * z)
    depth_rate = -(
        mount_rate[:, 1:2] + lever * mount_rate[:, 2:] + np.einsum("bsj,bj->bs", rise, rate)
    )
    pressed = np.maximum(depth, 0.0)
    normal, by_depth, by_depth_rate = kelvin_voigt.normal_force(pressed, depth_rate, feet.law)
    by_depth = np.where(depth > 0.0, by_depth, 0.0)
    elastic, foam = power_law_strain(depth, feet.law)

    place, spring, damper = feet.support.T
    piece = np.sum(feet.starts <= place[:, None], axis=1) - 1
    under = _points(
        feet, q, np.maximum(piece, 0)[:, None], place[:, None], np.zeros((len(place), 1))
    )
    lift = under.z_by[:, 0]
    sinking = np.einsum("bj,bj->b", lift, rate)
    held = spring * under.z[:, 0] + damper * sinking

    moment = (
        feet.stiffness * q
        + feet.damping * rate
        + held[:, None] * lift
        - np.einsum("bs,bsj->bj", normal, rise)
    )
    # what the lever of a force changes by: of hinges i and j it is that about the later one
    later = np.maximum.outer(np.arange(m), np.arange(m))
    turned = cosine[..., None] * spheres.x_by - sine[..., None] * spheres.z_by
    squares = np.einsum("bsi,bsj->bsij", rise, rise)
    lifted = np.einsum("bi,bj->bij", lift, lift)
    by_angle = (
        np.einsum("bs,bsij->bij", by_depth, squares)
        - np.einsum("bs,bsij->bij", normal, turned[:, :, later])
        + spring[:, None, None] * lifted
        + held[:, None, None] * under.x_by[:, 0][:, later]
    )
    by_rate = np.einsum("bs,bsij->bij", by_depth_rate, squares) + damper[:, None, None] * lifted
    hinges = np.arange(m)
    by_angle[:, hinges, hinges] += feet.stiffness
    by_rate[:, hinges, hinges] += feet.damping
    return Balance(
        moment=moment,
        by_angle=by_angle,
        by_rate=by_rate,
        depth=depth,
        normal=normal,
        by_depth=by_depth,
        rise=rise,
        forward=mount[:, :1] + lever,
        strain=0.5 * np.sum(feet.stiffness * q**2, axis=1)
        + 0.5 * spring * under.z[:, 0] ** 2
        + foam.sum(axis=1),
        loss=np.sum(feet.damping * rate**2, axis=1)
        + damper * sinking**2
        + np.sum((normal - elastic) * depth_rate, axis=1),
    )


def without_motion(feet: SagittalFeet, q: np.ndarray, mount: np.ndarray) -> Balance:
    """At hinge angles (B, m) and the mount's places (B, 3), all at rest."""
    return balance(feet, q, np.zeros_like(q), mount, np.zeros_like(mount))


class Rest(NamedTuple):
    """B feet at rest under their loads."""

    q: np.ndarray  # (B, m) rad
    mount: np.ndarray  # (B, 3)
    at: Balance
    slope: np.ndarray
    """(B, m + 1, m + 1) of moments and load by angles and the mount's height, scaled: the height in
    TURN_PER_M"""


def at_rest(
    feet: SagittalFeet,
    *,
    pitch_rad: np.ndarray,
    load_n: np.ndarray,
    q: np.ndarray | None = None,
    height_m: np.ndarray | None = None,
) -> Rest:
    """Under a vertical load (B,) at a pitch (B,), the mount free to move up and down; searched from
    `q` (B, m) and `height_m` (B,), or from the straight keel 1 mm in the ground.

    The energy is brought to a minimum by Newton's method on the absolute values of the slope's
    eigenvalues. SimulationError where it comes to none.
    """
    nowhere = np.zeros(len(pitch_rad))
    mount = np.column_stack([nowhere, nowhere, pitch_rad])
    q = np.zeros(feet.starts.shape) if q is None else q
    if height_m is None:
        height_m = without_motion(feet, q, mount).depth.max(axis=1) - 1e-3
    mount[:, 1] = height_m
    for _ in range(ITERATIONS):
        at = without_motion(feet, q, mount)
        slope = _with_height(at)
        values, vectors = np.linalg.eigh(slope)
        rest = np.column_stack([at.moment, (load_n - at.force) / TURN_PER_M])
        along = np.einsum("bij,bi->bj", vectors, rest) / np.maximum(np.abs(values), SOFTEST_N_M)
        step = -np.einsum("bij,bj->bi", vectors, along)
        largest = np.abs(step).max(axis=1, keepdims=True)
        step *= np.minimum(1.0, LARGEST_TURN_RAD / np.maximum(largest, 1e-300))
        q = q + step[:, :-1]
        mount[:, 1] += step[:, -1] / TURN_PER_M
        if largest.max() < AT_REST_RAD:
            at = without_motion(feet, q, mount)
            return Rest(q, mount, at, _with_height(at))
    raise SimulationError("a foot finds no rest under its load", time_s=0.0)


def _with_height(at: Balance) -> np.ndarray:
    """(B, m + 1, m + 1): see `Rest.slope`."""
    across = np.einsum("bs,bsj->bj", at.by_depth, at.rise)[..., None] / TURN_PER_M
    alone = at.by_depth.sum(axis=1)[:, None, None] / TURN_PER_M**2
    return np.block([[at.by_angle, across], [across.transpose(0, 2, 1), alone]])


class Roll(NamedTuple):
    """B feet as they roll, at the ends of n steps."""

    force_n: np.ndarray  # (n, B) vertical, on the foot
    centre_m: np.ndarray  # (n, B) of pressure, forward in W; NaN without force
    strain_j: np.ndarray  # (n, B) in springs and foam
    taken_j: np.ndarray  # (n, B) that and what damping has lost


def rolled(feet: SagittalFeet, time_s: np.ndarray, mount: np.ndarray) -> Roll:
    """The feet along the paths (n + 1, B, 3) of their mounts at `time_s` (n + 1,), straight at
    first: step after step by Euler's implicit method.

    SimulationError where no rates balance the moments.
    """
    q = np.zeros(feet.starts.shape)
    rate = np.zeros_like(q)
    lost = np.zeros(len(q))
    rows = []
    for start, end, before, after in zip(
        time_s[:-1], time_s[1:], mount[:-1], mount[1:], strict=True
    ):
        h = end - start
        for iteration in range(ITERATIONS):
            at = balance(feet, q + h * rate, rate, after, (after - before) / h)
            step = -np.linalg.solve(h * at.by_angle + at.by_rate, at.moment[..., None])[..., 0]
            rate = rate + (step if iteration < WHOLE_STEPS else 0.5 * step)
            if np.abs(step).max() < MOVES_AT_RAD_PER_S:
                break
        else:
            raise SimulationError("no rates of a foot balance its hinges", time_s=float(end))
        q = q + h * rate
        lost = lost + h * at.loss
        rows.append((at.force, at.centre_of_pressure, at.strain, at.strain + lost))
    return Roll(*(np.array(column) for column in zip(*rows, strict=True)))
