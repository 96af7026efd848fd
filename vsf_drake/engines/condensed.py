"""The condensed foot: two hinges and six contact stations that stand for the full one, for optimal
control in the sagittal plane.

    A            hinge 1    hinge 2       K: x along the straight keel, z up, from A
    +--- frame ----o----------o------     the hinges move forward with the fulcrum
     s   s    s <--- middle      toe
                       s    s    s        six stations, which stay where they are

The full keel is pinned at A and supported at the fulcrum, so that it rocks: what is pressed up
behind the fulcrum goes down before it. So does the middle piece, which reaches behind its hinge and
carries the third station there; the first two are on the frame, the last three on the toe. A
station stands for spheres over a few centimetres, over which the load moves forward as the foot
pitches; so it is a sphere large enough to roll by as much. Each hinge has a straight line of torque
over its angle and its rate, and needs nothing of the other. (More than a straight line of CURVES
over the fulcrum's position brought the fit of the nominal foot no further.) So all of it is smooth
in angle, rate and fulcrum.

The numbers are fitted to the full foot at rest: under loads and pitches as they occur while it is
rolled over by the profile of ISO 22675, up to HEAVIEST_KG, at FULCRUMS positions, and under a small
load on C. Nothing is fitted to a motion: damping has the full foot's ratios to stiffness.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from scipy.optimize import least_squares

from vsf_drake.base.errors import FitError, require
from vsf_drake.device.roll_over import iso_22675
from vsf_drake.engines.sagittal_foot import (
    TURN_PER_M,
    Balance,
    Rest,
    SagittalFeet,
    at_rest,
    of_full,
    without_motion,
)
from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.model.model_file import (
    bending_stiffness,
    check_foot,
    check_fulcrum,
    check_movable,
)
from vsf_drake.model.parameters import GRAVITY, FootParameters
from vsf_drake.plants.foot import mount_pose, sole_height
from vsf_drake.plants.rigid_foot import rigid_foot
from vsf_drake.plants.solids import box
from vsf_drake.simulation.bench import keel_shape

PIECES = ("frame", "middle", "toe")
STATIONS = ("heel_rear", "heel", "heel_front", "midfoot", "ball", "toe")
PIECE_OF_STATION = (0, 0, 1, 2, 2, 2)
CURVES = (
    "place of hinge 1 (m from A)",
    "log of the distance of hinge 2 from it (over 1 m)",
    "log of the stiffness of hinge 1 (over 1 N m/rad)",
    "log of the stiffness of hinge 2 (over 1 N m/rad)",
)
DEGREE = 1  # of the polynomials in the fulcrum's position that they are
FULCRUMS = 8
"""At which it is fitted: as many as the nominal keel has joints, for the full foot has a corner in
its stiffness where the fulcrum passes one."""
HEAVIEST_KG = 110.0
SHARES = (0.36, 0.68, 1.0)  # of that
POSE_STEP_S = 20e-3  # of the profile of ISO 22675
LIGHTEST_N = 30.0
FORCE_WITHIN = 0.03  # of the peak
CENTRE_WITHIN_M = 5e-3
ENERGY_WITHIN = 0.05  # of the most that a roll-over stores
RISE_WITHIN = 0.03  # of the load point C under a small load on it
SMALL_LOAD_N = 10.0
"""What is asked of a roll-over, by which errors of different kinds weigh against each other."""
ALIKE_AT_M = 5e-3  # depth at which spheres of different exponents count by their forces
PRIOR = 0.01
"""of a parameter's change by its scale, against errors; it only keeps free what nothing tells"""
EVALUATIONS = 15, 60
"""of the fit, first to the errors' squares, then to their fourth powers: large ones count most"""
SMALL = 1e-6  # step of the differences that the fit's slopes are made of


@dataclass(frozen=True, kw_only=True, eq=False)
class Piece:
    """A rigid piece at rest, in K."""

    name: str
    mass_kg: float
    centre_m: np.ndarray  # (3,) centre of mass
    inertia_kg_m2: np.ndarray  # (3, 3) about it


@dataclass(frozen=True, kw_only=True)
class Station:
    """A contact sphere: stiffness * depth**exponent, and damping as `laws.kelvin_voigt` has it."""

    name: str
    piece: int  # index into PIECES
    x_m: float  # of its centre in K at rest; y is 0
    z_m: float
    radius_m: float
    stiffness: float  # N/m^exponent
    exponent: float
    damping_n_s_per_m: float
    full_damping_depth_m: float


@dataclass(frozen=True, kw_only=True, eq=False)
class CondensedAt:
    """The condensed foot with its fulcrum at one position; arrays are of hinges 1 and 2.

    The torque of a hinge on the piece ahead of it, toe up positive, is -(stiffness * angle +
    damping * rate).
    """

    fulcrum_m: float
    hinge_m: np.ndarray  # (2,) places on the keel's centreline from A
    stiffness_nm_per_rad: np.ndarray
    damping_nm_s_per_rad: np.ndarray
    pieces: tuple[Piece, ...]

    @property
    def starts_m(self) -> np.ndarray:
        """(3, 3) m, origins of the frames of frame and pieces in K."""
        return np.pad(np.append(0.0, self.hinge_m)[:, np.newaxis], ((0, 0), (0, 2)))


@dataclass(frozen=True, kw_only=True, eq=False)
class CondensedFoot:
    """The condensed foot at all positions of its fulcrum."""

    full: FootParameters
    curves: np.ndarray
    """(4, DEGREE + 1) coefficients, in rising powers of the fulcrum's place in its reach (-1
    rearmost, 1 foremost), of CURVES"""
    stations: tuple[Station, ...]
    largest_angle_rad: np.ndarray  # (2,) in the poses to which it was fitted

    def at(self, fulcrum_m: float) -> CondensedAt:
        """With the fulcrum at `fulcrum_m` (m from A); InputError if the carriage cannot reach
        it."""
        check_fulcrum(fulcrum_m, self.full, where="fulcrum_m")
        hinge, stiffness = _hinges(self.full, self.curves, np.array([fulcrum_m]))[:, 0]
        return CondensedAt(
            fulcrum_m=fulcrum_m,
            hinge_m=hinge,
            stiffness_nm_per_rad=stiffness,
            damping_nm_s_per_rad=self.full.keel.damping_time_s * stiffness,
            pieces=_pieces(self.full, fulcrum_m, hinge),
        )

    @property
    def mount_K(self) -> np.ndarray:
        """(3,) m, the mount M in K, its axes those of K."""
        return np.asarray(mount_pose(self.full).translation())

    def sagittal(self, fulcrum_m: np.ndarray) -> SagittalFeet:
        """Without mass, with the fulcrum at each of (B,) m from A."""
        return _sagittal(self.full, self.stations, self.curves, np.asarray(fulcrum_m))


def condense(parameters: FootParameters) -> CondensedFoot:
    """Fits the condensed foot to the full one of `parameters`, always the same for the same ones.

    InputError if the foot is none, its support does not move, or a station would have no sphere to
    stand for; SimulationError if a foot finds no rest under a load that it must bear; FitError if
    the hinges leave the keel.
    """
    check_foot(parameters)
    check_movable(parameters, "A condensed foot is over the fulcrum's reach. Export the full foot")
    return _Fit(parameters).solved()


def _powers(foot: FootParameters, fulcrum_m: np.ndarray) -> np.ndarray:
    """(B, DEGREE + 1) of the place of (B,) m in the reach."""
    reach = foot.fulcrum
    half = 0.5 * (reach.foremost_m - reach.rearmost_m)
    place = (fulcrum_m - reach.rearmost_m - half) / half
    return np.vander(place, DEGREE + 1, increasing=True)


def _hinges(foot: FootParameters, curves: np.ndarray, fulcrum_m: np.ndarray) -> np.ndarray:
    """(2, B, 2) places (m from A) and stiffness (N m/rad) of the hinges."""
    hinge_1, log_gap, *log_stiffness = curves @ _powers(foot, fulcrum_m).T
    places = np.column_stack([hinge_1, hinge_1 + np.exp(log_gap)])
    return np.array([places, np.exp(np.transpose(log_stiffness))])


def _pieces(foot: FootParameters, fulcrum_m: float, hinge_m: np.ndarray) -> tuple[Piece, ...]:
    """The full foot's mass on three pieces. Of the keel behind the fulcrum the half that is next to
    the pin hardly moves as it rocks, and counts for the frame, as the carriage does."""
    keel = foot.keel
    hinge_1, hinge_2 = (float(place) for place in hinge_m)
    cuts = (0.0, min(0.5 * fulcrum_m, hinge_1), hinge_2, sum(keel.element_lengths_m))
    pieces = []
    for name, start, end in zip(PIECES, cuts[:-1], cuts[1:], strict=True):
        size = (end - start, keel.width_m, keel.thickness_m)
        mass = keel.density_kg_m3 * float(np.prod(size))
        inertia = box(mass, size, (0.5 * (start + end), 0.0, 0.0))
        if name == "frame":
            frame, carriage = _above_the_keel(foot)
            inertia += frame
            inertia += carriage.Shift(np.array([-fulcrum_m, 0.0, 0.0]))
        centre = inertia.get_com()
        pieces.append(
            Piece(
                name=name,
                mass_kg=inertia.get_mass(),
                centre_m=centre,
                inertia_kg_m2=inertia.Shift(centre).CalcRotationalInertia().CopyToFullMatrix3(),
            )
        )
    return tuple(pieces)


@lru_cache(maxsize=4)
def _above_the_keel(foot: FootParameters) -> tuple[SpatialInertia, SpatialInertia]:
    """Of the full foot's frame about A, and of its carriage about the fulcrum."""
    full, _ = rigid_foot(foot)
    # the stub has no types
    plant: MultibodyPlant = full.frame.GetParentPlant()  # type: ignore[no-untyped-call]
    carriage = full.carriage_joint(plant).child_body()
    return full.frame.default_spatial_inertia(), carriage.default_spatial_inertia()


def _sagittal(
    foot: FootParameters,
    stations: Sequence[Station],
    curves: np.ndarray,
    fulcrum_m: np.ndarray,
) -> SagittalFeet:
    starts, stiffness = _hinges(foot, curves, fulcrum_m)
    constant = np.ones(len(fulcrum_m))

    def each(name: str) -> np.ndarray:
        return np.array([getattr(station, name) for station in stations])

    return SagittalFeet(
        starts=starts,
        stiffness=stiffness,
        damping=foot.keel.damping_time_s * stiffness,
        support=np.zeros((len(fulcrum_m), 3)),
        piece=each("piece") - 1,
        x=np.outer(constant, each("x_m")),
        z=np.outer(constant, each("z_m")),
        radius=each("radius_m"),
        law=LawConstants(
            stiffness=each("stiffness"),
            exponent=each("exponent"),
            damping=each("damping_n_s_per_m"),
            full_damping_depth=each("full_damping_depth_m"),
        ),
        mount_K=mount_pose(foot).translation()[[0, 2]],
    )


def _lumped(foot: FootParameters) -> list[Station]:
    """The stations before the fit: each stands for the spheres of a part of the sole."""
    rear = foot.fulcrum.rearmost_m
    x = np.array([1e-3 * x for zone in foot.zones for x in zone.x_mm])
    rise = np.array([1e-3 * rise for zone in foot.zones for rise in zone.rise_mm])
    zones = [zone for zone in foot.zones for _ in zone.x_mm]
    middle = 0.5 * (rear + foot.fulcrum.foremost_m)
    behind = x[x < rear]
    before = x[x > middle]
    require(
        behind.size and before.size,
        "there are spheres only behind the fulcrum, or only before it",
        "foot.zones",
        "A condensed foot stands for a foot that rolls over both",
    )
    ends = np.concatenate(
        (
            [-np.inf, 0.5 * (behind.min() + behind.max()), rear, middle],
            np.linspace(before.min(), before.max(), 4)[1:3],
            [np.inf],
        )
    )
    stations = []
    for i, name in enumerate(STATIONS):
        own = np.flatnonzero((ends[i] <= x) & (x < ends[i + 1]))
        exponents = np.array([zones[s].exponent for s in own])
        forces = np.array([zones[s].stiffness for s in own]) * ALIKE_AT_M**exponents
        require(
            forces.sum() > 0.0,
            f"no sphere bears from {1e3 * ends[i]:.0f} to {1e3 * ends[i + 1]:.0f} mm, for which "
            f"the station {name} is to stand",
            "foot.zones",
            "Add one, or export the full foot",
        )

        def mean(values: Any, forces: np.ndarray = forces) -> float:
            return float(np.average(values, weights=forces))

        radius = mean([zones[s].radius_m for s in own]) + float(np.std(x[own]))
        stations.append(
            Station(
                name=name,
                piece=PIECE_OF_STATION[i],
                x_m=mean(x[own]),
                z_m=sole_height(foot) + mean(rise[own]) + radius,
                radius_m=radius,
                stiffness=float(forces.sum()) / ALIKE_AT_M ** mean(exponents),
                exponent=mean(exponents),
                damping_n_s_per_m=float(sum(zones[s].damping_n_s_per_m for s in own)),
                full_damping_depth_m=mean([zones[s].full_damping_depth_m for s in own]),
            )
        )
    return stations


class _Fit:
    """The poses, and the feet at rest in them.

    Parameters are changes of the start in units of their scales: of the curves by rows, then of the
    stations' x, logarithm of stiffness and of radius; their bottoms stay where they are.
    """

    def __init__(self, foot: FootParameters) -> None:
        self.foot = foot
        self.stations = _lumped(foot)
        reach = foot.fulcrum
        positions = np.linspace(reach.rearmost_m, reach.foremost_m, FULCRUMS)
        self.positions = positions
        self.rise = np.array(
            [
                keel_shape(foot, fulcrum_m=fulcrum, load_n=SMALL_LOAD_N).load_point_K[1]
                for fulcrum in positions
            ]
        )
        profile = iso_22675(POSE_STEP_S)
        peak = HEAVIEST_KG * GRAVITY
        poses = [
            (fulcrum, -tilt, share * peak * force, share * peak)
            for fulcrum in positions
            for share in SHARES
            for tilt, force in zip(profile.tilt_rad, profile.force_bw, strict=True)
        ]
        self.fulcrum, self.pitch, load, self.peak = np.array(poses).T
        self.load = np.maximum(load, LIGHTEST_N)
        self.full = at_rest(of_full(foot, self.fulcrum), pitch_rad=self.pitch, load_n=self.load)
        keel = self.full.slope[:, :-1, :-1]
        across = self.full.slope[:, :-1, -1:]
        stored = self.full.at.strain.reshape(FULCRUMS * len(SHARES), -1)
        self.most = np.repeat(stored.max(axis=1), stored.shape[1])
        yields = across.transpose(0, 2, 1) @ np.linalg.solve(keel, across)
        # N/m, of load by height
        self.stiffness = TURN_PER_M**2 * (self.full.slope[:, -1, -1] - yields[:, 0, 0])
        self.scale = np.repeat(
            [10e-3, 1.0, 10e-3, 1.0, 1.0],
            [DEGREE + 1, 3 * (DEGREE + 1), *3 * (len(STATIONS),)],
        )
        bending = float(bending_stiffness(foot.keel).mean())
        free = foot.load_point_m - positions
        # a beam that is pinned at A, supported at the fulcrum and loaded at C
        begin = np.log([free / 3.0, 3.0 * bending / positions, 3.0 * bending / free])
        self.start = np.linalg.lstsq(
            _powers(foot, positions), np.vstack([positions, begin]).T, rcond=None
        )[0].T
        self.rest: Rest | None = None

    def condensed(self, p: np.ndarray) -> tuple[np.ndarray, list[Station]]:
        """Coefficients (4, DEGREE + 1) and stations at the parameters."""
        change = self.scale * p
        curves, stations = np.split(change, [self.start.size])
        moved = [
            replace(
                station,
                x_m=station.x_m + float(x),
                z_m=station.z_m + station.radius_m * math.expm1(rounder),
                radius_m=station.radius_m * math.exp(rounder),
                stiffness=station.stiffness * math.exp(firmer),
                damping_n_s_per_m=station.damping_n_s_per_m * math.exp(firmer),
            )
            for station, x, firmer, rounder in zip(
                self.stations, *stations.reshape(3, -1), strict=True
            )
        ]
        return self.start + curves.reshape(self.start.shape), moved

    def feet(self, p: np.ndarray) -> SagittalFeet:
        """At the parameters, one in each pose."""
        curves, stations = self.condensed(p)
        return _sagittal(self.foot, stations, curves, self.fulcrum)

    def settled(self, p: np.ndarray) -> Rest:
        """At rest in each pose, from where the last ones were."""
        known = self.rest
        self.rest = at_rest(
            self.feet(p),
            pitch_rad=self.pitch,
            load_n=self.load,
            q=None if known is None else known.q,
            height_m=None if known is None else known.mount[:, 1],
        )
        return self.rest

    def errors(self, at: Balance, mount: np.ndarray) -> np.ndarray:
        """(3 B,) of the force on the full foot's path, of the centre of pressure and of the stored
        energy under its load, over what is asked."""
        lower = self.full.mount[:, 1] - mount[:, 1]
        apart = at.centre_of_pressure - self.full.at.centre_of_pressure
        more = at.strain - self.full.at.strain
        return np.concatenate(
            [
                self.stiffness * lower / (FORCE_WITHIN * self.peak),
                apart / CENTRE_WITHIN_M,
                more / (ENERGY_WITHIN * self.most),
            ]
        )

    def rise_errors(self, p: np.ndarray) -> np.ndarray:
        """(FULCRUMS,) of the load point's rise under SMALL_LOAD_N, over what is asked."""
        places, stiffness = _hinges(self.foot, self.condensed(p)[0], self.positions)
        rise = SMALL_LOAD_N * np.sum((self.foot.load_point_m - places) ** 2 / stiffness, axis=1)
        return np.asarray((rise / self.rise - 1.0) / RISE_WITHIN)

    def residuals(self, p: np.ndarray, power: int) -> np.ndarray:
        """The errors to a power, their signs kept, and the prior."""
        rest = self.settled(p)
        errors = np.append(self.errors(rest.at, rest.mount), self.rise_errors(p))
        return np.append(errors * np.abs(errors) ** (power - 1), PRIOR * p)

    def slopes(self, p: np.ndarray, power: int) -> np.ndarray:
        """Of `residuals` by p: with another p a foot at rest moves by -slope^-1 times what its
        moments change by."""
        rest = self.settled(p)
        errors = self.errors(rest.at, rest.mount)
        rise_errors = self.rise_errors(p)
        columns = []
        for i in range(len(p)):
            other = p + SMALL * np.eye(len(p))[i]
            feet = self.feet(other)
            pushed = without_motion(feet, rest.q, rest.mount)
            change = np.column_stack([pushed.moment, (self.load - pushed.force) / TURN_PER_M])
            moved = -np.linalg.solve(rest.slope, change[..., None])[..., 0]
            mount = rest.mount.copy()
            mount[:, 1] += moved[:, -1] / TURN_PER_M
            at = without_motion(feet, rest.q + moved[:, :-1], mount)
            changes = self.errors(at, mount) - errors, self.rise_errors(other) - rise_errors
            columns.append(np.concatenate(changes) / SMALL)
        size = np.abs(np.append(errors, rise_errors))[:, None]
        by = power * size ** (power - 1) * np.array(columns).T
        return np.vstack([by, PRIOR * np.eye(len(p))])

    def solved(self) -> CondensedFoot:
        """What fits best."""
        p = np.zeros(len(self.scale))
        for power, evaluations in enumerate(EVALUATIONS, start=1):
            p = least_squares(
                self.residuals, p, jac=self.slopes, args=(power,), max_nfev=evaluations
            ).x
        curves, stations = self.condensed(p)
        rest = self.settled(p)
        places, _ = _hinges(self.foot, curves, self.positions)
        if places.min() <= 0.0 or places.max() >= sum(self.foot.keel.element_lengths_m):
            raise FitError(
                f"hinges came to lie from {1e3 * places.min():.0f} to {1e3 * places.max():.0f} mm "
                "from A, beyond the keel: this foot does not bend as a condensed one can"
            )
        return CondensedFoot(
            full=self.foot,
            curves=curves,
            stations=tuple(stations),
            largest_angle_rad=np.abs(rest.q).max(axis=0),
        )
