"""Gauss-Newton SQP: each iteration one convex quadratic program, its step held by damping and an l1
merit.

    step:    quadratic model of the cost (J'WJ, phi'' J'J) + Levenberg damping, subject to
             linearised equations, limits and bounds (`step`); where that is slow, with the outputs'
             own curvature (the section at the end)
    accept:  the merit falls by a part of what the model promises, at full length, after a
             second-order correction, or at a shorter length; else the damping grows
    end:     violation, first-order residual and step are below their tolerances
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vsf_drake.base.schema import check, quantity
from vsf_drake.collocation.problem import TrajectoryProblem
from vsf_drake.collocation.scaled import Linearised, Point, Scaled
from vsf_drake.collocation.solution import Iteration, Start, TrajectorySolution, finished
from vsf_drake.collocation.step import Kkt, Step, find_step, normals, optimality, slack_changes

Progress = Callable[[Iteration], None]
ENOUGH = 1e-4
SHORTEST = 1.0 / 64.0
NOISE = 1e-13
# at an optimum the next step would change no scaled variable by more, or gain too little
STEP = 1e-5
# Levenberg damping of the scaled step: the first, and its range
DAMPING = 1e-3
LEAST_DAMPING = 1e-9
MOST_DAMPING = 1e6
WASTED, LOST, TRADING = 30, 1e10, 1e-2
"""A search ends after so many iterations without less violation, or with multipliers beyond; below
the last it goes on, as it must where it begins on the equations and trades them for the cost."""
SLOW, NEAR, WAIT, SHIFTS = 4, 1e-2, 5, 3
"""Gauss-Newton is slow if this many iterations do not divide the first-order residual by ten; with
violation and residual this small the outputs' curvature may help; if it did not, it is tried again
after so many iterations. So often the damping grows tenfold to make the exact Hessian convex."""
# steps that a search which is stuck may take toward the equations and limits alone
RESTORATIONS = 20
# damping of a variable that hardly enters the cost, as a part of what it is for the average
# variable
FLAT = 1e-3


@dataclass(frozen=True, kw_only=True)
class CollocationOptions:
    """Options of the Gauss-Newton SQP; tolerances are in the problem's scales.

    Attributes:
        iterations: most iterations; no clock ends a search, so that no result depends on how busy a
            machine is.
        violation: largest violation of any equation or limit of a solution.
        optimality: largest first-order residual, relative to 1 + the largest multiplier.
        gain: part of 1 + the cost, scaled, that a next step must promise, or the search is at rest.
    """

    iterations: int = quantity(200, unit="1", low=1, source="choice")
    violation: float = quantity(1e-8, unit="1", low=1e-300, source="choice")
    optimality: float = quantity(1e-6, unit="1", low=1e-300, source="choice")
    gain: float = quantity(1e-11, unit="1", low=1e-300, source="choice")

    def __post_init__(self) -> None:
        check(self)


def solve(
    problem: TrajectoryProblem,
    start: Start,
    options: CollocationOptions | None = None,
    progress: Progress | None = None,
) -> TrajectorySolution:
    """Solves a trajectory problem from a start, which is moved into the bounds; an interrupt
    (Ctrl-C) ends it with the last iterate. InputError where the start has another shape than the
    problem, or the function no value there."""
    search = _SqpSearch(problem, start, options or CollocationOptions(), progress)
    try:
        status, message = search.run()
    except KeyboardInterrupt:
        status = "interrupted"
        message = f"interrupted after {len(search.history)} iterations"
    return finished(
        search.scaled,
        search.at,
        status=status,
        message=message,
        optimality=search.optimality,
        history=tuple(search.history),
    )


class _SqpSearch:
    """The merit is cost + sum of weight * violation, a weight for each equation and inequality
    above its multiplier: then it is exact (l1), and a step of the quadratic program is a direction
    in which it falls."""

    def __init__(
        self,
        problem: TrajectoryProblem,
        start: Start,
        options: CollocationOptions,
        progress: Progress | None,
    ) -> None:
        self.options = options
        self.progress = progress
        self.history: list[Iteration] = []
        self.scaled = Scaled(problem)
        self.at = self.scaled.start(start.z, start.p)
        self.weights = np.zeros(len(self.scaled.violations(self.at)))
        parts = problem.grid.weights / problem.grid.duration_s
        self.share = np.concatenate(
            [np.repeat(parts, self.scaled.shape[1]), np.ones(problem.parameters)]
        )
        self.curve = np.zeros_like(self.share)
        self.damping = DAMPING
        self.optimality = np.nan
        self.step: Step | None = None  # the last
        self.exact = False
        self.resume = 0
        self.before = DAMPING

    def run(self) -> tuple[str, str]:
        options = self.options
        least = np.inf
        since = 0
        for number in range(options.iterations + 1):
            kkt, step = self._find()
            self.optimality = optimality(self.scaled, self.at, step)
            violation = float(self.scaled.violations(self.at).max(initial=0.0))
            change = np.abs(step.change).max(initial=0.0)
            self._note(number, violation, step)

            # Feasible, stationary, and at rest: where the cost is flat a small slope alone says
            # little.
            if (
                violation <= options.violation
                and self.optimality <= options.optimality
                and (
                    change <= STEP
                    or abs(step.predicted) <= options.gain * (1.0 + abs(self.at.cost))
                )
            ):
                return "optimal", "first-order conditions hold"

            # Multipliers beyond all bounds, or a violation that stays, are those of conditions that
            # cannot be met.
            least, since = (
                (violation, 0) if violation < max(0.9 * least, TRADING) else (least, since + 1)
            )
            if violation > options.violation and (
                since > WASTED or np.abs(step.multipliers).max(initial=0.0) > LOST
            ):
                return self._stuck("the violation no longer falls")
            if number == options.iterations:
                return "iterations", f"{number} iterations were not enough"
            if not self._advance(kkt, step):
                return self._stuck("no step lowers the merit")
        raise AssertionError

    def _find(self) -> tuple[Kkt, Step]:
        """The step: with the outputs' curvature where that is wanted and does not mislead, else
        Gauss-Newton's."""
        if self.step is not None and self._wants_curvature():
            if not self.exact:
                self.exact = True
                self.before = self.damping
                self.damping = min(self.damping, DAMPING)
            at = stiffened(self.scaled, with_curvature(self.scaled, self.at, self.step), self.step)
            # H + D must be positive on the equations' null space, as the inertia of the factors
            # tells (`Kkt.convex`).
            for _ in range(SHIFTS):
                kkt = self._kkt(at)
                if kkt.convex:
                    return kkt, self._step(kkt)
                self.damping = min(10.0 * max(self.damping, 1e-4), MOST_DAMPING)
            self._mislead()
        kkt = self._kkt(self.at)
        return kkt, self._step(kkt)

    def _wants_curvature(self) -> bool:
        past = self.history
        if len(past) < self.resume or past[-1].violation > NEAR:
            return False
        return self.exact or (
            len(past) > SLOW and 0.1 * past[-1 - SLOW].optimality < past[-1].optimality < NEAR
        )

    def _mislead(self) -> None:
        self.exact, self.resume, self.damping = False, len(self.history) + WAIT, self.before

    def _kkt(self, at: Linearised) -> Kkt:
        # D is the damping times the largest curvature that each variable has shown (as in Moré
        # 1978), per second of its instant; between FLAT of the usual one and that, so that no
        # variable is free and none is held. Gauss-Newton's: never negative
        self.curve = np.maximum(self.curve, self.at.diagonal / self.share)
        usual = max(
            float(np.mean(self.curve)), float(np.mean(np.abs(self.at.gradient) / self.share)), 1e-8
        )
        return Kkt(
            self.scaled, at, self.damping * self.share * np.clip(self.curve, FLAT * usual, usual)
        )

    def _step(self, kkt: Kkt) -> Step:
        likely = np.zeros(0, dtype=int) if self.step is None else self.step.active
        self.step = find_step(
            kkt, equations=self.at.equations, slacks=self.scaled.slacks(self.at), likely=likely
        )
        return self.step

    def _advance(self, kkt: Kkt, step: Step) -> bool:
        """Moves to a better point, with more damping until there is one."""
        while True:
            # weights rise to the multipliers of the step; those fade that were too large
            # (Powell 1978)
            size = np.zeros_like(self.weights)
            size[: len(step.multipliers)] = np.abs(step.multipliers)
            size[len(step.multipliers) + step.active] = step.duals
            self.weights = np.maximum(1.1 * size, 0.5 * (self.weights + size))
            if self._try(kkt, step):
                return True
            if self.exact:
                self._mislead()
            elif self.damping >= MOST_DAMPING:
                return False
            else:
                self.damping = min(30.0 * max(self.damping, 1e-4), MOST_DAMPING)
            kkt, step = self._find()

    def _merit(self, at: Point) -> float:
        """Infinite where the function has no value."""
        return float(at.cost + self.weights @ self.scaled.violations(at)) if at.finite else np.inf

    def _try(self, kkt: Kkt, step: Step) -> bool:
        before = self._merit(self.at)

        # By how much the merit would fall if the linearisation were exact: equations are met, and
        # of the inequalities is left what the elastic program left.
        slacks = self.scaled.slacks(self.at) + slack_changes(self.scaled, self.at, step.change)
        left = self.weights[len(self.weights) - len(slacks) :] @ np.maximum(-slacks, 0.0)
        promised = step.predicted + float(self.weights @ self.scaled.violations(self.at) - left)
        noise = NOISE * (1.0 + abs(before))

        def lowers(at: Point, length: float) -> bool:
            after = self._merit(at)
            return bool(before - after >= ENOUGH * length * promised - noise) and np.isfinite(after)

        # At full length; the damping follows how much of the promise was kept (a trust region's
        # rule).
        full = self.scaled.linearised(self._moved(step.change))
        if lowers(full, 1.0):
            gained = (before - self._merit(full)) / promised if promised > noise else 1.0
            return self._take(full, 0.2 if gained > 0.5 else (1.0 if gained > 0.25 else 4.0))

        # Where curved equations hold such a step back (Maratos effect), once more with what it
        # left; then shorter.
        if full.finite:
            better = self._corrected(kkt, step, full)
            if lowers(better, 1.0):
                return self._take(better, 1.0)
        length = 0.5
        while length >= SHORTEST:
            near = self.scaled.point(self._moved(length * step.change))
            if lowers(near, length):
                return self._take(self.scaled.linearised(near.x), 4.0)
            length *= 0.5
        return False

    def _corrected(self, kkt: Kkt, step: Step, full: Linearised) -> Linearised:
        """The point after a step whose linearisation is corrected by what it left (second-order
        correction)."""
        scaled = self.scaled
        at = self.at
        z, p = scaled.split(step.change)
        conditions = scaled.equations
        # c(x + d) - A d in place of c(x): a step that meets this leaves of the curved equations
        # what is of third order.
        bent = (
            full.equations
            - np.einsum("nez,nz->ne", at.by_z[:, :conditions], z)
            - at.by_p[:, :conditions] @ p
        )
        slacks = scaled.slacks(full) - slack_changes(scaled, at, step.change)
        again = find_step(kkt, equations=bent, slacks=slacks, likely=step.active)
        return scaled.linearised(self._moved(again.change))

    def _moved(self, change: np.ndarray) -> np.ndarray:
        x: np.ndarray = self.at.x + change
        return x.clip(self.scaled.low, self.scaled.high)

    def _take(self, at: Linearised, factor: float) -> bool:
        if not at.finite:
            return False
        self.at = at
        self.damping = float(np.clip(factor * self.damping, LEAST_DAMPING, MOST_DAMPING))
        return True

    def _stuck(self, why: str) -> tuple[str, str]:
        violation, where = self.scaled.worst(self.at)
        if violation <= self.options.violation:
            return "stalled", f"{why}, with a first-order residual of {self.optimality:.2g}"
        restored = self._restored()
        if self.scaled.violations(restored).max() <= NEAR * violation:
            return "stalled", f"{why}: {where} is broken by {violation:.2g} (scaled)"
        # Restoring feasibility alone got no nearer either.
        self.at = restored
        violation, where = self.scaled.worst(restored)
        return "infeasible", f"no step mends what {where} is broken by {violation:.2g} (scaled)"

    def _restored(self) -> Linearised:
        """The point to which the shortest steps that fulfil the linearised conditions lead while
        violations fall."""
        scaled = self.scaled
        at = self.at
        likely = np.zeros(0, dtype=int)
        for _ in range(RESTORATIONS):
            own, mixed, shared = at.hessian
            bare = dataclasses.replace(
                at, gradient=0.0 * at.gradient, hessian=(0.0 * own, 0.0 * mixed, 0.0 * shared)
            )
            step = find_step(
                Kkt(scaled, bare, self.share),
                equations=at.equations,
                slacks=scaled.slacks(at),
                likely=likely,
            )
            least = scaled.violations(at).sum()
            # Armijo's rule for the sum of violations, which a full step would bring to 0 if they
            # were linear.
            for length in 0.25 ** np.arange(5):
                near = scaled.linearised(
                    np.clip(at.x + length * step.change, scaled.low, scaled.high)
                )
                if near.finite and scaled.violations(near).sum() < (1.0 - 0.1 * length) * least:
                    break
            else:
                break
            at = near
            likely = step.active
        return at

    def _note(self, number: int, violation: float, step: Step) -> None:
        self.history.append(
            Iteration(
                number=number,
                cost=self.at.cost * self.scaled.problem.cost_scale,
                violation=violation,
                optimality=self.optimality,
                active=len(step.active),
                exact=self.exact,
            )
        )
        if self.progress is not None:
            self.progress(self.history[-1])


# What Gauss-Newton leaves out of the Hessian: the outputs' own curvature times the forces of cost
# and multipliers.
#
#     H = Gauss-Newton + sum_i sum_m c_im  d2 y_im / d(z_i, p)^2,
#     c = slope of the cost + multipliers of y
#
# An instant's outputs depend on its own variables only, so that one difference of the derivatives
# in one variable of *all* instants gives a column for every instant: Z + P linearisations for the
# whole trajectory.


# of the scaled variables, for forward differences of derivatives that are exact to rounding
DIFFERENCE = 1e-6
TOGETHER = 4  # columns worked out at once: what they take together stays in the processor's caches
STIFF = 10.0  # how much stiffer than the stiffest variable a bound or limit is that presses


def with_curvature(scaled: Scaled, at: Linearised, step: Step) -> Linearised:
    """The linearisation with the Hessian of the Lagrangian, by the multipliers of `step`, for
    Gauss-Newton's."""
    n = len(at.x)
    y_scale = scaled.problem.y_scale

    # c: slopes of the cost, multipliers of the equations, and of the limits those from above less
    # those from below.
    duals = np.zeros(2 * n + 2 * at.limited.size)
    duals[step.active] = step.duals
    low, high = duals[2 * n :].reshape(2, *at.limited.shape)
    multipliers = np.hstack(
        [step.multipliers[len(at.linear) :].reshape(at.equations.shape), high - low]
    )
    forces = scaled.slopes(at.y)[0]
    np.add.at(forces.T, scaled.which, (multipliers / y_scale[scaled.which]).T)

    def pulled(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(r, N, Z) and (r, N, P): forces times the derivatives of the outputs at r points x."""
        _, *slopes = scaled.outputs(x)
        points = len(np.atleast_2d(x))
        by_z, by_p = (
            np.matmul(forces[:, None, :], by.reshape(points, *at.y.shape, by.shape[2]))[:, :, 0]
            for by in slopes
        )
        return by_z, by_p

    # Columns of the second derivatives, by z of all instants at once, then by p, but for those that
    # are fixed; their asymmetry is rounding.
    (base_z,), (base_p,) = pulled(at.x)
    own, mixed, shared = (part.copy() for part in at.hessian)
    rest = np.zeros_like(own)
    fixed_z, fixed_p = scaled.split(scaled.fixed)
    varied = np.flatnonzero(~fixed_z.all(axis=0))
    for first in range(0, len(varied), TOGETHER):
        columns = varied[first : first + TOGETHER]
        moved = np.tile(at.x, (len(columns), 1))
        for row, column in enumerate(columns):
            moved[row, column : scaled.count : scaled.shape[1]] += DIFFERENCE
        rest[:, :, columns] = np.moveaxis((pulled(moved)[0] - base_z) / DIFFERENCE, 0, 2)
    for column in np.flatnonzero(~fixed_p):
        moved = at.x.copy()
        moved[scaled.count + column] += DIFFERENCE
        (by_z,), (by_p,) = pulled(moved)
        mixed[:, :, column] += (by_z - base_z) / DIFFERENCE
        shared[:, column] += (by_p - base_p).sum(axis=0) / DIFFERENCE
    hessian = own + 0.5 * (rest + rest.transpose(0, 2, 1)), mixed, 0.5 * (shared + shared.T)
    return (
        dataclasses.replace(at, hessian=hessian)
        if all(np.isfinite(part).all() for part in hessian)
        else at
    )


def stiffened(scaled: Scaled, at: Linearised, step: Step) -> Linearised:
    """With weight/2 (slack)^2 added for what presses: nothing changes where it goes on pressing,
    yet the Hessian is convex across bounds and limits that hold, so that only directions that are
    free must be so."""
    if not len(step.active):
        return at
    own, mixed, shared = at.hessian

    # H += w b b', g += w b s for a slack s with slope b: a spring that is at rest where the slack
    # is 0.
    across = normals(scaled, at, step.active)
    slacks = scaled.slacks(at)[step.active]
    weight = STIFF * np.abs(at.diagonal).max(initial=0.0)
    by_z, by_p = scaled.split(across)
    hessian = (
        own + weight * (by_z @ by_z.transpose(0, 2, 1)),
        mixed + weight * (by_z @ by_p.T),
        shared + weight * (by_p @ by_p.T),
    )
    return dataclasses.replace(
        at, hessian=hessian, gradient=at.gradient + weight * (across @ slacks)
    )
