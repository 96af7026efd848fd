"""Gauss-Newton SQP: each iteration one convex quadratic program, its step held by damping and an l1 merit.

    step:    quadratic model of the cost (J'WJ, phi'' J'J, totals) + Levenberg damping, subject to linearised equations,
             limits and bounds (`step`); where that is slow, with the outputs' own curvature (the section at the end)
    accept:  the merit falls by a part of what the model promises, at full length, after a second-order correction, or
             at a shorter length; else the damping grows
    end:     violation, first-order residual and step are below their tolerances
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from vsf_drake.analysis.collocation.kkt import Kkt, KktStructure
from vsf_drake.analysis.collocation.problem import CollocationOptions, TrajectoryProblem
from vsf_drake.analysis.collocation.scaled import Linearised, Scaled
from vsf_drake.analysis.collocation.solution import Iteration, Start, TrajectorySolution
from vsf_drake.analysis.collocation.step import (
    Merit,
    Step,
    find_step,
    finished,
    normals,
    optimality,
    room_changes,
    slacks,
    violations,
    worst,
)
from vsf_drake.analysis.collocation.threads import one_thread

Progress = Callable[[Iteration], None]
ENOUGH, SHORTEST, NOISE = 1e-4, 1.0 / 64.0, 1e-13
WASTED, LOST, NEAR = 30, 1e10, 1e-3
"""A search ends after so many iterations without less violation, or with multipliers beyond; below the last it goes on,
as it must where it begins on the equations and trades them for the cost."""
SLOW, NEAR, WAIT, SHIFTS = 4, 1e-2, 5, 3
"""Gauss-Newton is slow if this many iterations do not divide the first-order residual by ten; with violation and
residual this small the outputs' curvature may help; if it did not, it is tried again after so many iterations. So
often the damping grows tenfold to make the exact Hessian convex."""
FLAT = 1e-3
"""Damping of a variable that hardly enters the cost, as a part of what it is for the average variable."""


def solve(problem: TrajectoryProblem, start: Start, options: CollocationOptions | None = None,
          progress: Progress | None = None) -> TrajectorySolution:
    """Solves a trajectory problem from a start; an interrupt (Ctrl-C) ends it with the last iterate.

    Args:
        problem: what. start: from where; it is moved into the bounds. options: how.
        progress: called once an iteration.

    Raises:
        InputError: the start has another shape than the problem, or the function no value there.
    """
    with one_thread():
        search = _Search(problem, start, options or CollocationOptions(), progress)
        try:
            status, message = search.run()
        except KeyboardInterrupt:
            status, message = "interrupted", f"interrupted after {len(search.history)} iterations"
        return search.end(status, message)


@dataclass(eq=False)
class _Search:
    problem: TrajectoryProblem
    start: Start
    options: CollocationOptions
    progress: Progress | None
    history: list[Iteration] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.began = time.perf_counter()
        self.scaled = Scaled(self.problem)
        self.x = self.scaled.checked(self.start.z, self.start.p)
        self.at: Linearised = self.scaled.linearised_start(self.x)
        self.structure = KktStructure(self.scaled)
        self.merit = Merit(self.scaled, self.at)
        self.likely = np.zeros(0, dtype=int)
        weights = self.problem.grid.weights / self.problem.grid.duration_s
        self.share = np.concatenate([np.repeat(weights, self.scaled.shape[1]), np.ones(self.problem.parameters)])
        self.curve = np.zeros_like(self.share)
        self.damping, self.moved, self.length, self.optimality = self.options.damping, 0.0, 1.0, np.nan
        self.step: Step | None = None
        self.exact, self.resume, self.before = False, 0, self.damping

    def run(self) -> tuple[str, str]:
        """Iterates; returns the status and why."""
        options, least, since = self.options, np.inf, 0
        for number in range(options.iterations + 1):
            kkt, step = self._find()
            self.optimality = optimality(self.scaled, self.at, step)
            broken = violations(self.scaled, self.at).max(initial=0.0)
            change = np.abs(step.change).max(initial=0.0)
            self._note(number, broken, step)
            if broken <= options.violation and self.optimality <= options.optimality and (
                    change <= options.step or abs(step.predicted) <= options.gain * (1.0 + abs(self.at.cost))):
                return "optimal", "first-order conditions hold"
            least, since = (broken, 0) if broken < max(0.9 * least, NEAR) else (least, since + 1)
            lost = broken > options.violation and (since > WASTED or np.abs(step.multipliers).max(initial=0.0) > LOST)
            if lost:
                return self._stuck("the violation no longer falls")
            if number == options.iterations:
                return "iterations", f"{number} iterations were not enough"
            if time.perf_counter() - self.began > options.time_limit_s:
                return "time", f"{options.time_limit_s:g} s were not enough"
            if not self._advance(kkt, step):
                return self._stuck("no step lowers the merit")
        raise AssertionError

    def end(self, status: str, message: str) -> TrajectorySolution:
        """What it comes to."""
        z, p = self.scaled.unscaled(self.at.x)
        multipliers = None if self.step is None else self.step.multipliers
        return finished(self.scaled, self.at, Start(z, p, multipliers), status=status, message=message,
                        optimality=self.optimality, solver="gauss_newton_sqp", iterations=max(len(self.history) - 1, 0),
                        wall_s=time.perf_counter() - self.began, history=tuple(self.history))

    def _find(self) -> tuple[Kkt, Step]:
        """The step: with the outputs' curvature where that is wanted and does not mislead, else Gauss-Newton's."""
        if self._wants_curvature():
            if not self.exact:
                self.exact, self.before = True, self.damping
                self.damping = min(self.damping, self.options.damping)
            at = stiffened(self.scaled, with_curvature(self.scaled, self.at, self.step), self.step)
            for _ in range(SHIFTS):
                kkt = self._kkt(at, checked=True)
                if kkt.convex:
                    return kkt, self._step(kkt)
                self.damping = min(10.0 * max(self.damping, 1e-4), self.options.most_damping)
            self._mislead()
        kkt = self._kkt(self.at, checked=False)
        return kkt, self._step(kkt)

    def _wants_curvature(self) -> bool:
        past, wanted = self.history, self.options.curvature
        if wanted == "gauss_newton" or self.step is None or len(past) < self.resume or past[-1].violation > NEAR:
            return False
        return self.exact or wanted == "exact" or (
            len(past) > SLOW and past[-1].optimality < NEAR
            and past[-1].optimality > 0.1 * past[-1 - SLOW].optimality)

    def _mislead(self) -> None:
        """Curvature did no good here: none for some iterations."""
        self.exact, self.resume, self.damping = False, len(self.history) + WAIT, self.before

    def _kkt(self, at: Linearised, *, checked: bool) -> Kkt:
        own, _, shared = self.at.hessian  # Gauss-Newton's: never negative
        curve = np.concatenate([np.einsum("nzz->nz", own).ravel(), np.diag(shared)]) / self.share
        self.curve = np.maximum(self.curve, curve)
        usual = max(float(np.mean(self.curve)), float(np.mean(np.abs(self.at.gradient) / self.share)), 1e-8)
        shape = self.share * np.clip(self.curve, FLAT * usual, usual)
        return Kkt(self.structure, at, self.damping * shape, checked=checked)

    def _step(self, kkt: Kkt) -> Step:
        step = find_step(self.scaled, kkt, linear=self.at.linear, equations=self.at.equations,
                         room=slacks(self.scaled, self.at), likely=self.likely, weight=self.options.inequality_weight)
        self.likely, self.step = step.pressed, step
        return step

    def _advance(self, kkt: Kkt, step: Step) -> bool:
        """Moves to a better point, with more damping until there is one."""
        while True:
            self.merit.renew(step)
            if self._try(kkt, step):
                return True
            if self.exact:
                self._mislead()
                kkt, step = self._find()
                continue
            if self.damping >= self.options.most_damping:
                return False
            self.damping = min(30.0 * max(self.damping, 1e-4), self.options.most_damping)
            kkt, step = self._find()

    def _try(self, kkt: Kkt, step: Step) -> bool:
        before, promised = self.merit.value(self.at), step.predicted + self._mended(step)
        noise = NOISE * (1.0 + abs(before))
        full = self.scaled.linearised(self._moved(step.change))
        if self._enough(before, self.merit.value(full), promised, noise):
            gained = (before - self.merit.value(full)) / promised if promised > noise else 1.0
            factor = 0.2 if gained > 0.75 else (1.0 if gained > 0.25 else 4.0)
            return self._take(full, 1.0, factor)
        if full.finite:
            better = self._corrected(kkt, step, full)
            if self._enough(before, self.merit.value(better), promised, noise):
                return self._take(better, 1.0, 1.0)
        length = 0.5
        while length >= SHORTEST:
            near = self.scaled.point(self._moved(length * step.change))
            if self._enough(before, self.merit.value(near), length * promised, noise):
                return self._take(self.scaled.linearised(near.x), length, 4.0)
            length *= 0.5
        return False

    def _corrected(self, kkt: Kkt, step: Step, full: Linearised) -> Linearised:
        """The point after a step whose linearisation is corrected by what it left (second-order correction)."""
        scaled, at = self.scaled, self.at
        z, p = step.change[:scaled.count].reshape(scaled.shape), step.change[scaled.count:]
        bent = full.equations - (np.einsum("nez,nz->ne", at.by_z[:, :scaled.equations], z)
                                 + at.by_p[:, :scaled.equations] @ p)
        room = slacks(scaled, full) - room_changes(scaled, at, step.change[:, None])[:, 0]
        again = find_step(scaled, kkt, linear=at.linear, equations=bent, room=room, likely=step.pressed,
                          weight=self.options.inequality_weight)
        return scaled.linearised(self._moved(again.change))

    def _mended(self, step: Step) -> float:
        """By how much the violations in the merit fall if the linearisation were exact."""
        scaled, at = self.scaled, self.at
        room = slacks(scaled, at) + room_changes(scaled, at, step.change[:, None])[:, 0]
        left = self.merit.weights[len(at.linear) + at.equations.size:] @ np.maximum(-room, 0.0)
        return self.merit.broken(at) - float(left)

    @staticmethod
    def _enough(before: float, after: float, promised: float, noise: float) -> bool:
        return bool(before - after >= ENOUGH * promised - noise) and np.isfinite(after)

    def _moved(self, change: np.ndarray) -> np.ndarray:
        return np.clip(self.at.x + change, self.scaled.low, self.scaled.high)

    def _take(self, at: Linearised, length: float, factor: float) -> bool:
        if not at.finite:
            return False
        self.moved, self.length = float(np.abs(at.x - self.at.x).max(initial=0.0)), length
        self.at = at
        self.damping = float(np.clip(factor * self.damping, self.options.least_damping, self.options.most_damping))
        return True

    def _stuck(self, why: str) -> tuple[str, str]:
        broken, _, where = worst(self.scaled, self.at)
        if broken <= self.options.violation:
            return "stalled", f"{why}, with a first-order residual of {self.optimality:.2g}"
        said = f"{where} is broken by {broken:.2g} (scaled)"
        return ("stalled", f"{why}: {said}") if self._could_mend() else ("infeasible", f"no step mends what {said}")

    def _could_mend(self) -> bool:
        """Whether the shortest step that fulfils the linearised conditions, or a part of it, lowers violations."""
        scaled, at, before = self.scaled, self.at, violations(self.scaled, self.at).sum()
        bare = dataclasses.replace(at, gradient=0.0 * at.gradient, totals=0.0 * at.totals,
                                   hessian=tuple(0.0 * part for part in at.hessian))
        step = find_step(scaled, Kkt(self.structure, bare, self.share), linear=at.linear, equations=at.equations,
                         room=slacks(scaled, at), likely=self.likely, weight=self.options.inequality_weight)
        for length in 0.25 ** np.arange(5):
            near = scaled.point(self._moved(length * step.change))
            if near.finite and violations(scaled, near).sum() < (1.0 - 0.1 * length) * before:
                return True
        return False

    def _note(self, number: int, broken: float, step: Step) -> None:
        line = Iteration(
            number=number, cost=self.at.cost * self.problem.cost_scale, violation=float(broken),
            optimality=self.optimality, step=self.moved, length=self.length, damping=self.damping,
            active=len(step.pressed), exact=self.exact, evaluations=self.scaled.evaluations,
            wall_s=time.perf_counter() - self.began,
            p=tuple(self.scaled.unscaled(self.at.x)[1].tolist()))
        self.history.append(line)
        if self.progress is not None:
            self.progress(line)


# What Gauss-Newton leaves out of the Hessian: the outputs' own curvature times the forces of cost and multipliers.
#
#     H = Gauss-Newton + sum_i sum_m c_im  d2 y_im / d(z_i, p)^2,    c = slope of the cost + multipliers of y
#
# An instant's outputs depend on its own variables only, so that one difference of the derivatives in one variable of
# *all* instants gives a column for every instant: Z + P linearisations for the whole trajectory.


STEP = 1e-6
"""Of the scaled variables, for forward differences of derivatives that are exact to rounding."""
STIFF = 10.0
"""How much stiffer than the stiffest variable a bound or limit is that presses."""


def with_curvature(scaled: Scaled, at: Linearised, step: Step) -> Linearised:
    """The linearisation with the Hessian of the Lagrangian in place of Gauss-Newton's.

    Args:
        scaled: the problem. at: where. step: a step from about there, for its multipliers.
    """
    forces = scaled.slope(at.y)
    of_instants = step.multipliers[len(at.linear):].reshape(at.equations.shape)
    np.add.at(forces, (slice(None), scaled.which[:scaled.equations]),
              of_instants / scaled.problem.y_scale[scaled.which[:scaled.equations]])
    np.add.at(forces, (slice(None), scaled.which[scaled.equations:]),
              _of_limits(at, step) / scaled.problem.y_scale[scaled.which[scaled.equations:]])
    size, few = scaled.shape[1], scaled.parameters
    base_z, base_p = _pulled(scaled, at.x, forces)
    own, mixed, shared = (part.copy() for part in at.hessian)
    rest, cross = np.zeros_like(own), np.zeros_like(mixed)
    for column in range(size):
        moved = at.x.copy()
        moved[column:scaled.count:size] += STEP
        rest[:, :, column] = (_pulled(scaled, moved, forces)[0] - base_z) / STEP
    for column in range(few):
        moved = at.x.copy()
        moved[scaled.count + column] += STEP
        by_z, by_p = _pulled(scaled, moved, forces)
        cross[:, :, column] = (by_z - base_z) / STEP
        shared[:, column] += (by_p - base_p).sum(axis=0) / STEP
    own += 0.5 * (rest + rest.transpose(0, 2, 1))
    hessian = own, mixed + cross, 0.5 * (shared + shared.T)
    return at if not all(np.isfinite(part).all() for part in hessian) else dataclasses.replace(at, hessian=hessian)


def stiffened(scaled: Scaled, at: Linearised, step: Step) -> Linearised:
    """With weight/2 (slack)^2 added for what presses: nothing changes where it goes on pressing.

    It makes the Hessian convex across bounds and limits that hold, so that only directions that are free must be so.
    """
    if not len(step.pressed):
        return at
    own, mixed, shared = (part.copy() for part in at.hessian)
    across, room = normals(scaled, at, step.pressed), slacks(scaled, at)[step.pressed]
    weight = STIFF * max(np.abs(np.einsum("nzz->nz", own)).max(initial=0.0), np.abs(np.diag(shared)).max(initial=0.0))
    by_z, by_p = across[:scaled.count].reshape(*scaled.shape, len(room)), across[scaled.count:]
    own += weight * (by_z @ by_z.transpose(0, 2, 1))
    mixed += weight * (by_z @ by_p.T)
    shared += weight * (by_p @ by_p.T)
    return dataclasses.replace(at, hessian=(own, mixed, shared), gradient=at.gradient + weight * (across @ room))


def _pulled(scaled: Scaled, x: np.ndarray, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, Z) and (N, P): forces (N, m) times the derivatives of the outputs at x, scaled."""
    _, by_z, by_p = scaled.outputs(x)
    return (np.matmul(forces[:, None, :], by_z)[:, 0] * scaled.problem.z_scale,
            np.matmul(forces[:, None, :], by_p)[:, 0] * scaled.problem.p_scale)


def _of_limits(at: Linearised, step: Step) -> np.ndarray:
    """(N, C) multipliers of the limited outputs."""
    found, n = np.zeros(2 * at.limited.size), 2 * len(at.x)
    here = step.pressed >= n
    found[step.pressed[here] - n] = step.pressure[here]
    low, high = found.reshape(2, *at.limited.shape)
    return high - low
