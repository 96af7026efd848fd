"""Force control of the roll-over machine: a smooth path of the mount's height on which the foot
bears a given force.

First the heights are found one after the other in coarse steps, each the root of one equation. In
fine steps this would not do: pressed at its toe, the keel's inertia makes the inverse from force to
height unstable. So the path is then a cubic spline, whose coefficients are improved together by
Gauss-Newton steps on the force over the whole stance.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_lsq_spline
from scipy.sparse import csr_array
from scipy.sparse.linalg import spsolve

from vsf_drake.base.errors import InputError
from vsf_drake.model.model_file import check_fulcrum
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants.bench import MOUNT_COORDINATES, make_roll_over_machine
from vsf_drake.simulation.bench import advance_to_load
from vsf_drake.simulation.mechanism import roll_over_mechanism
from vsf_drake.simulation.reactions import PROSTHETIC, energy_ledger, foot_reaction
from vsf_drake.simulation.stepping.stepper import Inputs, Record, Stepper

# share of the largest force by which a run that follows its profile may be off (a choice)
FOLLOWS_WITHIN = 0.01
COARSE_STEPS = 60
COARSE_TOLERANCE_N = 0.1
KNOTS = 120
DEGREE = 3
APART = 7
"""Coefficients whose effects one run tells apart: each reaches over 4 intervals of the spline, and
dies out in 3."""
MOST_IMPROVEMENTS = 6
_GOOD_ENOUGH = 1e-3
_WORTHWHILE = 0.95
# what a second difference of the coefficients costs: 25 m/s^2 as much as 0.2 N (a choice)
ROUGHNESS_N_PER_M = 300.0
_TRIAL_M = 5e-5
_MOST_TRIALS = 40
_FIRST_STIFFNESS = 5e4
_LONGEST_MOVE_M = 2e-3
LONGEST_TRAVEL_M = 0.12  # travel after which a foot that does not bear the load has given way
LARGEST_PITCH_RAD = np.radians(60.0)


@dataclass(frozen=True, eq=False)
class Following:
    """How a rolled foot follows its force: n instants, the ends of the steps."""

    wanted_n: np.ndarray  # (n,) N along the fixed line
    force_n: np.ndarray
    deflection_m: np.ndarray
    """(n,) how much lower the mount is than where the unloaded foot would touch at that tilt"""

    @property
    def residual_n(self) -> float:
        """Largest difference (N) between the force and the wanted one."""
        return float(np.abs(self.force_n - self.wanted_n).max())

    @property
    def follows(self) -> bool:
        """Whether that is within FOLLOWS_WITHIN of the largest wanted force."""
        return self.residual_n <= FOLLOWS_WITHIN * float(np.max(self.wanted_n))


def _follow_coarsely(
    stepper: Stepper,
    first: Inputs,
    q0: np.ndarray,
    *,
    time_s: np.ndarray,
    tilt_rad: np.ndarray,
    force_n: np.ndarray,
    start_height_m: float,
) -> np.ndarray:
    """(n + 1,) heights (m) of the mount above the tilt axis at which the foot bears `force_n`, step
    by step.

    `first` are inputs of a single step from rest at q0: of the mount's three coordinates, then the
    carriage.
    """
    heights = np.full(len(time_s), start_height_m)
    q, v = np.array(q0), np.zeros_like(q0)
    rate = 0.0
    stiffness = _FIRST_STIFFNESS
    for k in range(len(time_s) - 1):
        now = mount_path(tilt_rad[k : k + 1], heights[k : k + 1])
        last: list[Record] = []

        def force(
            height: float,
            k: int = k,
            now: np.ndarray = now,
            q: np.ndarray = q,
            v: np.ndarray = v,
            last: list[Record] = last,
        ) -> float:
            then = mount_path(tilt_rad[k + 1 : k + 2], np.array([height]))
            path = np.column_stack([np.vstack([now, then]), first.prescribed_q[:, 3:]])
            record = stepper.run(
                dataclasses.replace(first, time_s=time_s[k : k + 2], prescribed_q=path), q, v
            )
            last[:] = [record]
            along = record.wrench[0, PROSTHETIC, 3]
            normal = record.wrench[0, PROSTHETIC, 5]
            return float(np.cos(then[0, 2]) * normal - np.sin(then[0, 2]) * along)

        step = float(time_s[k + 1] - time_s[k])
        heights[k + 1], stiffness = _root(
            force, heights[k] + rate * step, float(force_n[k + 1]), stiffness
        )
        rate = (heights[k + 1] - heights[k]) / step
        q = last[0].q[-1]
        v = last[0].v[-1]
    return heights


def _smooth_path(
    coarse_s: np.ndarray,
    coarse_m: np.ndarray,
    time_s: np.ndarray,
    force_along: Callable[[np.ndarray], np.ndarray],
    wanted_n: np.ndarray,
) -> np.ndarray:
    """(n + 1,) heights (m) at `time_s` on a spline, on which the force is as near the wanted one
    (n,) as it comes.

    `coarse_m` is a first guess; `force_along` leads from heights at `time_s` to the force (n,) N at
    the steps' ends.
    """
    inner = np.linspace(time_s[0], time_s[-1], KNOTS + 1)
    knots = np.concatenate([np.full(DEGREE, inner[0]), inner, np.full(DEGREE, inner[-1])])
    basis = BSpline.design_matrix(np.clip(time_s, inner[0], inner[-1]), knots, DEGREE).tocsr()
    guess = make_lsq_spline(time_s, np.interp(time_s, coarse_s, coarse_m), knots, DEGREE)
    coefficients = np.asarray(guess.c)
    coefficients[0] = coarse_m[0]
    residual = force_along(basis @ coefficients) - wanted_n
    bending = csr_array(np.diff(np.eye(len(coefficients)), n=2, axis=0))
    weight = ROUGHNESS_N_PER_M**2 * len(residual) / (time_s[-1] - time_s[0]) * 1e-3

    def cost(c: np.ndarray, r: np.ndarray) -> float:
        return float(r @ r + weight * np.sum((bending @ c) ** 2))

    for _ in range(MOST_IMPROVEMENTS):
        if np.abs(residual).max() <= _GOOD_ENOUGH * np.max(wanted_n):
            break
        slopes = csr_array(
            _slopes(basis, knots, coefficients, time_s, force_along, residual + wanted_n)
        )
        matrix = (slopes.T @ slopes + weight * (bending.T @ bending)).tocsc()
        downhill = -(slopes.T @ residual) - weight * (bending.T @ (bending @ coefficients))
        change = spsolve(matrix[1:, 1:], downhill[1:])
        before = cost(coefficients, residual)
        for share in (1.0, 0.5, 0.25, 0.1):
            trial = coefficients.copy()
            trial[1:] += share * change
            off = force_along(basis @ trial) - wanted_n
            if cost(trial, off) < cost(coefficients, residual):
                coefficients = trial
                residual = off
                break
        if cost(coefficients, residual) > _WORTHWHILE * before:
            break
    return np.asarray(basis @ coefficients)


def _slopes(
    basis: csr_array,
    knots: np.ndarray,
    coefficients: np.ndarray,
    time_s: np.ndarray,
    force_along: Callable[[np.ndarray], np.ndarray],
    force_n: np.ndarray,
) -> np.ndarray:
    """(n, coefficients) derivatives (N/m) of the force by the spline's coefficients, by
    differences."""
    slopes = np.zeros((len(time_s) - 1, len(coefficients)))
    until = np.append(knots[APART:], np.full(APART, np.inf))
    for group in range(APART):
        columns = np.arange(group, len(coefficients), APART)
        trial = coefficients.copy()
        trial[columns] -= _TRIAL_M
        change = (force_along(basis @ trial) - force_n) / -_TRIAL_M
        for column in columns:
            rows = (time_s[1:] >= knots[column]) & (time_s[1:] < until[column])
            slopes[rows, column] = change[rows]
    return slopes


def _root(
    force: Callable[[float], float], guess: float, wanted: float, stiffness: float
) -> tuple[float, float]:
    """The height with the wanted force, and the slope -dF/dh (N/m) there; `force` is last called at
    that height."""
    # the force is too large at `low`, too small at `high`
    height = guess
    low = -np.inf
    high = np.inf
    before: tuple[float, float] | None = None
    for trial in range(_MOST_TRIALS):
        excess = force(height) - wanted
        if abs(excess) <= COARSE_TOLERANCE_N or trial == _MOST_TRIALS - 1:
            break
        low, high = (max(low, height), high) if excess > 0.0 else (low, min(high, height))
        if before is not None and height != before[0]:
            slope = -(excess - before[1]) / (height - before[0])
            stiffness = slope if slope > 1.0 else stiffness
        before = (height, excess)
        following = height + float(np.clip(excess / stiffness, -_LONGEST_MOVE_M, _LONGEST_MOVE_M))
        height = following if low < following < high else 0.5 * (low + high)
    return height, stiffness


# Where the foot's mount goes when the platform under it tilts: the test's frame and the platform's.
#
# In a roll-over test the pylon stays on a fixed line and the platform under the foot turns by the
# tilt gamma about an axis T across its surface, under the line; gamma < 0 lowers its front, so that
# the heel is loaded. With z along the line, x forward and T as the origin the mount's origin is at
# (0, h). Seen from the platform, which is then level ground, everything turns by -gamma about T. So
# the foot's pitch (toes up) is -gamma, the mount's origin is at
#
#     x = -h sin(pitch),    z = h cos(pitch),
#
# and the test's line of force has the direction (-sin(pitch), 0, cos(pitch)). Contact knows
# relative motion only, so both give the same forces, but for the inertia of the foot in a frame
# that turns, which is left out: at 2.5 rad/s and 1 m/s that is a few newtons for 0.65 kg.


def mount_path(tilt_rad: np.ndarray, height_m: np.ndarray) -> np.ndarray:
    """(n, 3) forward (m, from T), up (m) and pitch (rad) of the mount over level ground: gamma and
    h as above."""
    pitch = -np.asarray(tilt_rad, dtype=float)
    h = np.asarray(height_m, dtype=float)
    return np.column_stack([-h * np.sin(pitch), h * np.cos(pitch), pitch])


def line_of_force(pitch_rad: np.ndarray) -> np.ndarray:
    """(n, 3) unit vectors in W of the fixed line, up; it is the pylon's axis."""
    pitch = np.asarray(pitch_rad, dtype=float)
    return np.column_stack([-np.sin(pitch), np.zeros_like(pitch), np.cos(pitch)])


def in_mount_frame(points_W: np.ndarray, mount: np.ndarray) -> np.ndarray:
    """(n, 2) forward and up in the mount's frame of points (n, 3) in W, for the mount's coordinates
    (n, 3)."""
    x = points_W[:, 0] - mount[:, 0]
    z = points_W[:, 2] - mount[:, 1]
    cosine = np.cos(mount[:, 2])
    sine = np.sin(mount[:, 2])
    return np.column_stack([cosine * x + sine * z, -sine * x + cosine * z])


# Presses and rolls the prosthetic foot alone over level ground, by the implicit stepper.


@dataclass(frozen=True, eq=False)
class RollOverRun:
    """One run of the machine over n instants (the ends of the steps), ground level and z = 0 in
    W."""

    time_s: np.ndarray
    mount: np.ndarray  # (n, 3) m, m, rad (toes up): MOUNT_COORDINATES
    load: np.ndarray  # (n, 3) N, N, N m that the drive exerts along them
    grf_W: np.ndarray  # (n, 3) N on the foot
    cop_W: np.ndarray  # (n, 3) m, NaN below 20 N
    sphere_normal_n: np.ndarray  # (n, spheres)
    keel_turn_rad: np.ndarray  # (n,) of the keel's front end against the mount, toe up
    energy: dict[str, np.ndarray]  # `simulation.reactions.energy_ledger` (n,) J by name
    unconverged_steps: int  # that were accepted without convergence


class RollOver:
    """One machine, built once and used often, with the foot's own friction with the ground or
    none."""

    def __init__(self, parameters: FootParameters, *, friction: bool) -> None:
        self.machine = make_roll_over_machine(parameters, friction=friction)
        self.context = self.machine.diagram.CreateDefaultContext()
        self.parameters = parameters
        self.friction = friction
        sites = self.machine.foot.sites
        plant = self.machine.plant
        straight = plant.CreateDefaultContext()
        self._centres = np.array(
            [
                plant.get_body(body).EvalPoseInWorld(straight) @ p
                for body, p in zip(sites.body_indices, sites.p_BS, strict=True)
            ]
        )[:, [0, 2]]

    def touch_height(self, pitch_rad: float | np.ndarray) -> np.ndarray:
        """Height (m) of the mount's origin over the ground at which the unloaded foot touches
        it."""
        pitch = np.atleast_1d(np.asarray(pitch_rad, dtype=float))[:, None]
        x, z = self._centres.T
        radius = self.machine.foot.sites.radius
        return np.asarray(-(x * np.sin(pitch) + z * np.cos(pitch) - radius).min(axis=1))

    def follow(self, *, fulcrum_m: float, time_s: np.ndarray, mount: np.ndarray) -> RollOverRun:
        """Moves the mount along `mount` (n + 1, 3: MOUNT_COORDINATES) at `time_s` (n + 1,), the
        foot at rest at first.
        """
        stepper, inputs, q0 = self._begin(fulcrum_m, time_s, mount)
        record = stepper.run(inputs, q0, np.zeros_like(q0))
        columns = inputs.prescribed[:3]
        reaction = foot_reaction(record, PROSTHETIC)
        keel = [stepper.mechanism.tree.index(name) for name in self.machine.foot.keel_joint_names]
        return RollOverRun(
            time_s=record.time_s,
            mount=record.q[:, columns],
            load=record.load[:, columns],
            grf_W=reaction.grf_W,
            cop_W=reaction.cop_W,
            sphere_normal_n=record.site("normal_force"),
            keel_turn_rad=record.q[:, keel].sum(axis=1),
            energy=energy_ledger(
                stepper.mechanism, record, driven=inputs.prescribed, fulcrum_m=inputs.fulcrum
            ),
            unconverged_steps=record.counts()["unconverged_steps"],
        )

    def press(
        self,
        *,
        fulcrum_m: float,
        pitch_rad: float,
        max_load_n: float,
        speed_m_per_s: float,
        steps_per_mm: float,
    ) -> RollOverRun:
        """Lowers the pitched foot from first touch at constant speed until the vertical load is
        reached, and raises it.

        SimulationError if the foot gives way before, or the run diverges.
        """
        for value, where, most in (
            (max_load_n, "max_load_n", 5000.0),
            (speed_m_per_s, "speed_m_per_s", 1.0),
            (steps_per_mm, "steps_per_mm", 1e4),
        ):
            if not 0.0 < value <= most:
                raise InputError(
                    f"is {value:g}", where=where, right=f"It must be above 0 and at most {most:g}"
                )
        if not abs(pitch_rad) <= LARGEST_PITCH_RAD:
            raise InputError(
                f"is {pitch_rad:g} rad", where="pitch_rad", right="It must be within 60 degrees"
            )
        top = float(self.touch_height(pitch_rad)[0])

        def lowered(travel: np.ndarray) -> np.ndarray:
            return np.column_stack(
                [np.zeros_like(travel), top - travel, np.full_like(travel, pitch_rad)]
            )

        steps = int(np.ceil(min(LONGEST_TRAVEL_M, top) * 1e3 * steps_per_mm))
        travel = 1e-3 / steps_per_mm * np.arange(steps + 1)
        stepper, down, q0 = self._begin(fulcrum_m, travel / speed_m_per_s, lowered(travel))
        _, count = advance_to_load(
            stepper,
            down,
            q0,
            max_load_n,
            travel,
            foot="foot",
            where=(
                f"at {np.degrees(pitch_rad):g} degrees with the fulcrum at {1e3 * fulcrum_m:g} mm"
            ),
        )
        path = np.concatenate([travel[: count + 1], travel[count - 1 :: -1]])
        moments = 1e-3 / steps_per_mm / speed_m_per_s * np.arange(2 * count + 1)
        return self.follow(fulcrum_m=fulcrum_m, time_s=moments, mount=lowered(path))

    def roll(
        self, *, fulcrum_m: float, time_s: np.ndarray, tilt_rad: np.ndarray, force_n: np.ndarray
    ) -> tuple[RollOverRun, Following]:
        """Rolls the foot: tilt and force (n + 1,) along the fixed line are given, the mount's
        height is found.

        The foot starts unloaded, as it touches. Returns the run along the heights that were found,
        and how well it follows the force.
        """
        # Height above T along the line of force at which the unloaded foot touches the tilted
        # platform.
        touch = self.touch_height(-tilt_rad) / np.cos(tilt_rad)
        start = mount_path(tilt_rad[:1], touch[:1])
        stepper, first, q0 = self._begin(
            fulcrum_m, np.asarray(time_s[:2]), np.repeat(start, 2, axis=0)
        )
        coarse_s = np.linspace(time_s[0], time_s[-1], COARSE_STEPS + 1)
        coarse = _follow_coarsely(
            stepper,
            first,
            q0,
            time_s=coarse_s,
            tilt_rad=np.interp(coarse_s, time_s, tilt_rad),
            force_n=np.interp(coarse_s, time_s, force_n),
            start_height_m=float(touch[0]),
        )
        line = line_of_force(-tilt_rad[1:])

        def force_along(height: np.ndarray) -> np.ndarray:
            mount = mount_path(tilt_rad, height)
            record = stepper.run(
                self._inputs(stepper, fulcrum_m, time_s, mount), q0, np.zeros_like(q0)
            )
            return np.asarray(
                line[:, 0] * record.wrench[:, PROSTHETIC, 3]
                + line[:, 2] * record.wrench[:, PROSTHETIC, 5]
            )

        height = _smooth_path(coarse_s, coarse, time_s, force_along, force_n[1:])
        mount = mount_path(tilt_rad, height)
        run = self.follow(fulcrum_m=fulcrum_m, time_s=time_s, mount=mount)
        return run, Following(
            wanted_n=np.asarray(force_n[1:], dtype=float),
            force_n=np.sum(run.grf_W * line, axis=1),
            deflection_m=touch[1:] - height[1:],
        )

    def _begin(
        self, fulcrum_m: float, time_s: np.ndarray, mount: np.ndarray
    ) -> tuple[Stepper, Inputs, np.ndarray]:
        """The machine along `mount`, and where it is at rest at first."""
        check_fulcrum(fulcrum_m, self.parameters)
        stepper = Stepper(roll_over_mechanism(self.machine, self.context))
        stepper.warm_up()
        inputs = self._inputs(stepper, fulcrum_m, np.asarray(time_s, dtype=float), mount)
        q0 = np.zeros(stepper.mechanism.tree.num_coordinates)
        q0[inputs.prescribed] = inputs.prescribed_q[0]
        return stepper, inputs, q0

    def _inputs(
        self, stepper: Stepper, fulcrum_m: float, time_s: np.ndarray, mount: np.ndarray
    ) -> Inputs:
        names = (*MOUNT_COORDINATES, self.machine.foot.carriage_joint_name)
        fulcrum = np.full(len(time_s), fulcrum_m)
        return Inputs(
            time_s=time_s,
            prescribed=np.array([stepper.mechanism.tree.index(name) for name in names]),
            prescribed_q=np.column_stack([mount, fulcrum]),
            fulcrum=fulcrum,
            ground=np.zeros(len(time_s)),
        )
