"""The roll-over machine: a path of the mount's height on which the foot bears a given force.

It is found in two moves. First the mount is free to move up and down under the force itself, and
what it carries without bending has no inertia. What the ground then bears differs from the force
by the inertia of the keel alone, a few per cent of it at most; without friction it is also what the
same path bears when it is prescribed. Then a cubic spline is added to that path, whose coefficients
are found together by a Gauss-Newton step on the force over the whole stance. Height after height
this would not do: pressed at its toe, the keel's inertia makes the inverse from force to height
unstable.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csr_array

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.model.model_file import check_fulcrum
from vsf_drake.model.parameters import FootParameters
from vsf_drake.model.setting import setting_of
from vsf_drake.plants.bench import MOUNT_COORDINATES, make_roll_over_machine
from vsf_drake.simulation.bench import advance_to_load
from vsf_drake.simulation.mechanism import roll_over_mechanism
from vsf_drake.simulation.reactions import PROSTHETIC, foot_reaction, strains_and_losses
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS
from vsf_drake.simulation.stepping.runs import Inputs, Record, Run, Torques
from vsf_drake.simulation.stepping.stepper import (
    ALONE,
    SIDE_BY_SIDE,
    Stepper,
    run_side_by_side,
)

# share of the largest force by which a run that follows its profile may be off (a choice)
FOLLOWS_WITHIN = 0.01
KNOTS = 120
DEGREE = 3
APART = 4
"""Coefficients whose effects one run tells apart: each reaches over 4 intervals of the spline; what
is left of it in the next is taken for theirs."""
SLOPE_STEP_S = 2e-3  # of the runs that tell the coefficients' effects
MOST_IMPROVEMENTS = 6
SHARES = (1.0, 0.5, 0.25, 0.1)  # of a step, one after the other until one makes it better
# what a second difference of the coefficients costs: 25 m/s^2 as much as 0.2 N (a choice)
ROUGHNESS_N_PER_M = 300.0
_TRIAL_M = 5e-5
LONGEST_TRAVEL_M = 0.12  # travel after which a foot that does not bear the load has given way
LARGEST_PITCH_RAD = np.radians(60.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Rolling:
    """What a foot is rolled by, over n + 1 instants."""

    fulcrum_m: float  # from A
    time_s: np.ndarray
    tilt_rad: np.ndarray
    """of the ground against the plane across the fixed line, negative with its front down"""
    force_n: np.ndarray  # along the line; 0 at first


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


class _Splines(NamedTuple):
    """Cubic splines of c coefficients over a stance of n steps, and over the same in coarse
    steps."""

    basis: np.ndarray  # (n + 1, c) values at the instants
    coarse_s: np.ndarray
    coarse_basis: np.ndarray
    columns: np.ndarray
    """(n, APART) coefficient that the trial of each group of every APART-th moves at each end of a
    step, -1 for none"""
    roughness: np.ndarray  # (c, c) what bending costs, N^2/m^2


@lru_cache(maxsize=4)
def _splines(begin_s: float, end_s: float, steps: int) -> _Splines:
    time = np.linspace(begin_s, end_s, steps + 1)
    coarse = np.linspace(begin_s, end_s, max(1, round((end_s - begin_s) / SLOPE_STEP_S)) + 1)
    inner = np.linspace(begin_s, end_s, KNOTS + 1)
    knots = np.concatenate([np.full(DEGREE, begin_s), inner, np.full(DEGREE, end_s)])
    count = KNOTS + DEGREE
    newest = np.searchsorted(knots[:count], time[1:], side="right") - 1
    groups = np.arange(APART)
    columns = newest[:, None] - (newest[:, None] - groups) % APART
    bending = np.diff(np.eye(count), n=2, axis=0)
    weight = ROUGHNESS_N_PER_M**2 * steps / (end_s - begin_s) * 1e-3
    return _Splines(
        basis=BSpline.design_matrix(time, knots, DEGREE).toarray(),
        coarse_s=coarse,
        coarse_basis=BSpline.design_matrix(coarse, knots, DEGREE).toarray(),
        columns=columns,
        roughness=weight * bending.T @ bending,
    )


def _change_of_height(
    splines: _Splines,
    time_s: np.ndarray,
    excess_n: np.ndarray,
    changes: np.ndarray,
) -> np.ndarray:
    """(n + 1,) m, the spline that, added to the height, leaves least of the force's excess (n,) N.

    `changes` (APART, coarse steps) N/m are what the force changes by with each group of
    coefficients.
    """
    steps = len(excess_n)
    at = time_s[1:]
    values = np.column_stack([np.interp(at, splines.coarse_s[1:], row) for row in changes])
    known = splines.columns >= 0
    slopes = csr_array(
        (
            np.where(known, values, 0.0).ravel(),
            np.maximum(splines.columns, 0).ravel(),
            APART * np.arange(steps + 1),
        ),
        shape=(steps, splines.basis.shape[1]),
    )
    matrix = (slopes.T @ slopes).toarray() + splines.roughness
    downhill = -(slopes.T @ excess_n)
    # the first coefficient is the height at the start, where the foot just touches
    return np.asarray(splines.basis[:, 1:] @ np.linalg.solve(matrix[1:, 1:], downhill[1:]))


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

UP = MOUNT_COORDINATES.index("mount_up")


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
    energy: dict[str, np.ndarray]  # `simulation.reactions.strains_and_losses`, (n,) J by name
    unconverged_steps: int  # that were accepted without convergence


class RollOver:
    """One machine, built once and used often, with the foot's own friction with the ground or
    none."""

    def __init__(self, parameters: FootParameters, *, friction: bool) -> None:
        self.machine = make_roll_over_machine(parameters, friction=friction)
        self.context = self.machine.diagram.CreateDefaultContext()
        self.parameters = parameters
        self.friction = friction
        self.mechanism = roll_over_mechanism(self.machine, self.context)
        tree = self.mechanism.tree
        names = (*MOUNT_COORDINATES, self.machine.foot.carriage_joint_name)
        self.driven = np.array([tree.index(name) for name in names])
        bends = tree.ancestors[:, self.mechanism.keel_coordinates].any(axis=1, keepdims=True)
        sliding = self.mechanism.sites.copy()
        sliding[:, [SITE_COLUMNS.index(name) for name in ("mu_static", "mu_kinetic")]] = 0.0
        self.guessed = dataclasses.replace(
            self.mechanism,
            sites=sliding,
            tree=dataclasses.replace(tree, inertias=np.where(bends, tree.inertias, 0.0)),
        )
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
        run = self.along(fulcrum_m, np.asarray(time_s, dtype=float), mount)
        stepper = Stepper(self.mechanism)
        stepper.warm_up()
        return self.result(run, stepper.run(run.inputs, run.q0, run.v0))

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
        down = self.along(fulcrum_m, travel / speed_m_per_s, lowered(travel))
        stepper = Stepper(self.mechanism)
        stepper.warm_up()
        _, count = advance_to_load(
            stepper,
            down.inputs,
            down.q0,
            max_load_n,
            travel,
            foot="foot",
            setting=setting_of(self.parameters, fulcrum_m).setting_words,
        )
        path = np.concatenate([travel[: count + 1], travel[count - 1 :: -1]])
        moments = 1e-3 / steps_per_mm / speed_m_per_s * np.arange(2 * count + 1)
        return self.follow(fulcrum_m=fulcrum_m, time_s=moments, mount=lowered(path))

    def roll(
        self, *, fulcrum_m: float, time_s: np.ndarray, tilt_rad: np.ndarray, force_n: np.ndarray
    ) -> tuple[RollOverRun, Following]:
        """Rolls the foot once, see `roll_side_by_side`; SimulationError if it cannot be rolled."""
        (outcome,) = self.roll_side_by_side(
            [Rolling(fulcrum_m=fulcrum_m, time_s=time_s, tilt_rad=tilt_rad, force_n=force_n)]
        )
        if isinstance(outcome, SimulationError):
            raise outcome
        return outcome

    def roll_side_by_side(
        self, cases: Sequence[Rolling]
    ) -> list[tuple[RollOverRun, Following] | SimulationError]:
        """Rolls the foot: tilt and force along the fixed line are given, evenly spaced in time, of
        as many instants in all cases, and the mount's height is found.

        The foot starts unloaded, as it touches, and moves with its mount at first. Returns of each
        case the run along the heights that were found, and how well it follows the force, or why
        there is none; it is the same to the bit in whatever company.
        """
        lengths = sorted({len(case.time_s) for case in cases})
        if len(lengths) > 1:
            raise InputError(
                f"have from {lengths[0]} to {lengths[-1]} instants",
                where="cases",
                right="Roll those of one length together",
            )
        Stepper(self.mechanism).warm_up(SIDE_BY_SIDE if len(cases) > 1 else ALONE)
        searches = [_Search(self, case) for case in cases]
        guesses = run_side_by_side([search.pushed() for search in searches], sites=False)
        for search, guess in zip(searches, guesses, strict=True):
            search.begin(guess)
        open_ones = [search for search in searches if search.failure is None]
        if self.friction:  # it has no part in the guess
            _measure(open_ones, [search.height for search in open_ones])
        for _ in range(MOST_IMPROVEMENTS):
            if open_ones:
                _improve(open_ones)
            open_ones = [search for search in open_ones if search.goes_on]
        as_guessed = [s for s in searches if s.record is None and s.failure is None]
        _measure(as_guessed, [search.height for search in as_guessed])
        return [search.outcome() for search in searches]

    def along(self, fulcrum_m: float, time_s: np.ndarray, mount: np.ndarray) -> Run:
        """The machine along `mount`, from rest."""
        check_fulcrum(fulcrum_m, self.parameters)
        fulcrum = np.full(len(time_s), fulcrum_m)
        inputs = Inputs(
            time_s=time_s,
            prescribed=self.driven,
            prescribed_q=np.column_stack([mount, fulcrum]),
            fulcrum=fulcrum,
            ground=np.zeros(len(time_s)),
        )
        q0 = np.zeros(self.mechanism.tree.num_coordinates)
        q0[self.driven] = inputs.prescribed_q[0]
        return Run(self.mechanism, inputs, q0, np.zeros_like(q0))

    def result(self, run: Run, record: Record) -> RollOverRun:
        """What the record of a run tells."""
        columns = self.driven[:3]
        reaction = foot_reaction(record, PROSTHETIC)
        keel = [self.mechanism.tree.index(name) for name in self.machine.foot.keel_joint_names]
        return RollOverRun(
            time_s=record.time_s,
            mount=record.q[:, columns],
            load=record.load[:, columns],
            grf_W=reaction.grf_W,
            cop_W=reaction.cop_W,
            sphere_normal_n=record.site("normal_force"),
            keel_turn_rad=record.q[:, keel].sum(axis=1),
            energy=strains_and_losses(self.mechanism, record, fulcrum_m=run.inputs.fulcrum),
            unconverged_steps=record.counts()["unconverged_steps"],
        )


class _Search:
    """The height of the mount in one case, as far as it is found."""

    def __init__(self, machine: RollOver, case: Rolling) -> None:
        self.machine = machine
        self.case = case
        self.time_s = np.asarray(case.time_s, dtype=float)
        self.tilt = np.asarray(case.tilt_rad, dtype=float)
        self.line = line_of_force(-self.tilt[1:])
        self.wanted = np.asarray(case.force_n[1:], dtype=float)
        # Height above T along the line of force at which the unloaded foot touches the tilted
        # platform.
        self.touch = machine.touch_height(-self.tilt) / np.cos(self.tilt)
        touching = mount_path(self.tilt[:2], self.touch[:2])
        self.rate = (touching[1] - touching[0]) / (self.time_s[1] - self.time_s[0])
        self.splines = _splines(float(self.time_s[0]), float(self.time_s[-1]), len(self.wanted))
        self.height = self.touch
        self.excess = np.full(len(self.wanted), np.inf)  # (n,) N of the force along `height`
        self.record: Record | None = None  # of the run along `height`
        self.failure: SimulationError | None = None
        self.goes_on = True

    def along(self, time_s: np.ndarray, tilt: np.ndarray, height: np.ndarray) -> Run:
        """The machine along a height (n + 1,), moving with its mount at first."""
        run = self.machine.along(self.case.fulcrum_m, time_s, mount_path(tilt, height))
        run.v0[self.machine.driven[:3]] = self.rate
        return run

    def pushed(self) -> Run:
        """The machine under the force, its mount free to move up and down, without friction."""
        machine = self.machine
        run = self.along(self.time_s, self.tilt, self.touch)
        held = np.delete(np.arange(len(machine.driven)), UP)
        steps = len(self.wanted)
        down = Torques(
            coordinates=machine.driven[[UP]],
            sensed=np.zeros(0, dtype=np.int64),
            feedforward=-(self.wanted / np.cos(self.tilt[1:]))[:, None],
            feedback=np.zeros((steps, 1, 0)),
            reference=np.zeros((steps, 0)),
        )
        inputs = dataclasses.replace(
            run.inputs,
            prescribed=machine.driven[held],
            prescribed_q=run.inputs.prescribed_q[:, held],
            torques=down,
        )
        return Run(machine.guessed, inputs, run.q0, run.v0)

    def begin(self, guess: Record | SimulationError) -> None:
        """Takes the path of the free mount."""
        if isinstance(guess, SimulationError):
            self.failure = guess
            return
        up = guess.q[:, self.machine.driven[UP]]
        self.height = np.append(self.touch[:1], up / np.cos(self.tilt[1:]))
        self.excess = _force_along(self.line, guess) - self.wanted

    def trials(self) -> list[Run]:
        """The path, and with each group of coefficients moved, in coarse steps."""
        time = self.splines.coarse_s
        tilt = np.interp(time, self.time_s, self.tilt)
        height = np.interp(time, self.time_s, self.height)
        moved = (
            height - _TRIAL_M * self.splines.coarse_basis[:, group::APART].sum(axis=1)
            for group in range(APART)
        )
        return [self.along(time, tilt, path) for path in (height, *moved)]

    def change(self, tried: Sequence[Record]) -> np.ndarray:
        """(n + 1,) m by which the height is to change, from the records of `trials`."""
        line = line_of_force(-np.interp(self.splines.coarse_s[1:], self.time_s, self.tilt))
        forces = [_force_along(line, record) for record in tried]
        changes = (np.array(forces[1:]) - forces[0]) / -_TRIAL_M
        return _change_of_height(self.splines, self.time_s, self.excess, changes)

    def take(self, height: np.ndarray, outcome: Record | SimulationError) -> bool:
        """Takes a height and what came of it, unless the one of before is better; whether it
        did."""
        the_same = height is self.height
        if isinstance(outcome, SimulationError):
            self.failure = outcome if the_same else None
            return False
        excess = _force_along(self.line, outcome) - self.wanted
        better = bool(excess @ excess < self.excess @ self.excess)
        if the_same or better:
            self.height = height
            self.excess = excess
            self.record = outcome
            self.goes_on = bool(np.abs(excess).max() > FOLLOWS_WITHIN * self.wanted.max())
        return better

    def outcome(self) -> tuple[RollOverRun, Following] | SimulationError:
        """What the case came to."""
        if self.record is None:
            return self.failure or SimulationError("the foot was not rolled", time_s=0.0)
        run = self.along(self.time_s, self.tilt, self.height)
        return self.machine.result(run, self.record), Following(
            wanted_n=self.wanted,
            force_n=self.wanted + self.excess,
            deflection_m=self.touch[1:] - self.height[1:],
        )


def _measure(searches: Sequence[_Search], heights: Sequence[np.ndarray]) -> list[bool]:
    """Moves the mount of each along its height; whether it was taken."""
    runs = [
        search.along(search.time_s, search.tilt, height)
        for search, height in zip(searches, heights, strict=True)
    ]
    outcomes = run_side_by_side(runs)
    return [
        search.take(height, outcome)
        for search, height, outcome in zip(searches, heights, outcomes, strict=True)
    ]


def _improve(searches: Sequence[_Search]) -> None:
    """One step of Gauss-Newton of each, or as much of it as makes it better."""
    runs = [run for each in searches for run in each.trials()]
    # of one foot one after the other: what takes them side by side need not be compiled for it
    companies = [[run] for run in runs] if len(searches) == 1 else [runs]
    records = [record for each in companies for record in run_side_by_side(each, sites=False)]
    waiting = []
    for k, search in enumerate(searches):
        search.goes_on = False
        own = records[k * (1 + APART) : (k + 1) * (1 + APART)]
        tried = [record for record in own if not isinstance(record, SimulationError)]
        if len(tried) == len(own):
            waiting.append((search, search.change(tried)))
    for share in SHARES:
        taken = _measure(
            [search for search, _ in waiting],
            [search.height + share * change for search, change in waiting],
        )
        waiting = [pair for pair, done in zip(waiting, taken, strict=True) if not done]


def _force_along(line: np.ndarray, record: Record) -> np.ndarray:
    """(n,) N of the ground on the foot along the line (n, 3)."""
    return np.asarray(np.sum(line * record.wrench[:, PROSTHETIC, 3:], axis=1))
