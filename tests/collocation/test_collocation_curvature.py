"""Costs that Gauss-Newton knows nothing of, and the Hessian of the Lagrangian by differences."""

import numpy as np
import pytest
from collocation_problems import Outputs, chain, pendulum
from scipy.linalg import null_space

from vsf_drake.collocation import (
    CollocationOptions,
    Convex,
    Design,
    Grid,
    Layout,
    Start,
    TrajectoryProblem,
    confirm,
    solve,
)
from vsf_drake.collocation.scaled import Scaled
from vsf_drake.collocation.sqp import stiffened, with_curvature
from vsf_drake.collocation.step import Kkt, find_step


def swing(intervals=12):
    """A pendulum's effort and its distance from a motion as a sum without squares: none for Gauss-Newton to see."""
    grid = Grid("hermite_simpson", intervals, 1.0, periodic=True)
    aim = np.cos(2.0 * np.pi * grid.times_s)

    def outputs(z, p):
        q, v, a, torque = z.T
        by_z, by_p = np.zeros((len(z), 2, 4)), np.zeros((len(z), 2, 1))
        by_z[:, 0] = np.stack([9.81 * np.cos(q) + p[0], 0.3 + 0 * q, 1 + 0 * q, -1 + 0 * q], axis=1)
        by_z[:, 1, 0], by_z[:, 1, 3], by_p[:, 0, 0] = 300.0 * np.sin(q - aim), torque, q
        return np.stack([a + 9.81 * np.sin(q) + 0.3 * v + p[0] * q - torque,
                         0.5 * torque**2 + 300.0 * (1.0 - np.cos(q - aim))], axis=1), by_z, by_p

    problem = TrajectoryProblem(
        Outputs(outputs), Layout(("q",), (), ("torque",)), grid, outputs=2, equations=[0],
        convex=[Convex(output=1, function=lambda y: (y, np.ones_like(y), np.zeros_like(y)))],
        z_scale=[1.0, 5.0, 40.0, 20.0], y_scale=[20.0, 1.0], cost_scale=10.0,
        design=Design(names=["stiffness"], low=0.0, high=100.0))
    z = np.zeros((grid.instants, 4))
    z[:, 0] = 0.5 * aim
    return problem, Start(z, np.array([5.0]))


def step_of(scaled, kkt):
    return find_step(kkt, equations=kkt.at.equations, room=scaled.slacks(kkt.at), likely=np.zeros(0, dtype=int))


def test_a_cost_without_squares_is_minimised_all_the_same():
    problem, start = swing()
    solution = solve(problem, start)
    assert solution.status == "optimal", solution.message
    theirs = confirm(problem, solution.last, "snopt")
    assert theirs.cost == pytest.approx(solution.cost, rel=1e-6)
    assert theirs.p == pytest.approx(solution.p, rel=1e-3)


def test_the_curvature_ends_a_search_quadratically():
    problem, start = swing()
    solution = solve(problem, start, CollocationOptions(optimality=1e-9, violation=1e-10))
    last = [line.optimality for line in solution.history[-4:]]
    assert all(line.exact for line in solution.history[-3:])
    assert last[-1] < 0.1 * last[-2] < 0.01 * last[-3]


@pytest.mark.parametrize("make", [swing, lambda: pendulum(intervals=6)[:2], lambda: chain(intervals=4)])
def test_its_hessian_is_the_second_difference_of_the_lagrangian(make):
    problem, start = make()
    scaled, draw = Scaled(problem), np.random.default_rng(0)
    x = scaled.scaled(start.z + 0.1 * problem.z_scale * draw.standard_normal(start.z.shape), start.p + 0.1)
    at = scaled.linearised(x)
    step = step_of(scaled, Kkt(scaled, at, np.ones(len(x))))
    own, mixed, shared = with_curvature(scaled, at, step).hessian
    pressure = np.zeros(4 * len(x) + 2 * at.limited.size)
    pressure[step.pressed] = step.pressure
    low, high = pressure[2 * len(x):][:2 * at.limited.size].reshape(2, *at.limited.shape)
    of_equations = step.multipliers[len(at.linear):].reshape(at.equations.shape)

    def lagrangian(where):
        here = scaled.point(where)
        return here.cost + np.sum(of_equations * here.equations) + np.sum((high - low) * here.limited)

    way, h = draw.standard_normal(len(x)), 1e-4
    z, p = way[:scaled.count].reshape(scaled.shape), way[scaled.count:]
    curve = np.einsum("nz,nzy,ny->", z, own, z) + 2.0 * np.einsum("nz,nzp,p->", z, mixed, p) + p @ shared @ p
    exact = (lagrangian(x + h * way) - 2.0 * lagrangian(x) + lagrangian(x - h * way)) / h**2
    assert curve == pytest.approx(exact, rel=1e-4, abs=1e-6)


def test_an_indefinite_hessian_is_recognised_by_its_inertia():
    """At the top of a cosine the Lagrangian is concave; with enough damping it is not."""
    problem, start = swing()
    scaled = Scaled(problem)
    at = scaled.linearised(scaled.scaled(start.z + np.array([np.pi, 0.0, 0.0, 0.0]), start.p))
    exact = with_curvature(scaled, at, step_of(scaled, Kkt(scaled, at, np.ones(len(at.x)))))
    found = {damping: Kkt(scaled, exact, np.full(len(at.x), damping)) for damping in (1e-6, 1e4)}
    assert [kkt.convex for kkt in found.values()] == [False, True]
    for damping, kkt in found.items():
        whole, n = kkt.matrix.toarray(), kkt.variables
        assert (np.linalg.eigvalsh(null_space(whole[n:, :n]).T @ whole[:n, :n] @ null_space(whole[n:, :n])).min()
                > 0.0) == kkt.convex, damping


def test_stiffening_what_presses_leaves_the_step_as_it_is():
    problem, start = chain(intervals=4)
    scaled = Scaled(problem)
    at = scaled.linearised(scaled.scaled(start.z, start.p))
    damping = np.full(len(at.x), 1e-2)
    plain = step_of(scaled, Kkt(scaled, at, damping))
    assert len(plain.pressed) > 0
    again = step_of(scaled, Kkt(scaled, stiffened(scaled, at, plain), damping))
    assert again.change == pytest.approx(plain.change, abs=1e-6)
    assert sorted(again.pressed) == sorted(plain.pressed)
