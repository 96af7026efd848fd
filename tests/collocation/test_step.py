"""Derivatives against finite differences, the KKT system against the sparse whole, the Hessian of
the Lagrangian."""

import dataclasses

import numpy as np
import pytest
from collocation_problems import Outputs, chain
from scipy.linalg import null_space

from vsf_drake.collocation.pattern import SOFT
from vsf_drake.collocation.problem import (
    Convex,
    Design,
    Grid,
    Layout,
    Limits,
    Residuals,
    TrajectoryProblem,
)
from vsf_drake.collocation.program import confirm
from vsf_drake.collocation.scaled import Scaled
from vsf_drake.collocation.solution import Start
from vsf_drake.collocation.sqp import solve, stiffened, with_curvature
from vsf_drake.collocation.step import (
    Kkt,
    box_minimum,
    find_step,
    normals,
    optimality,
    slack_changes,
)


def square(y):
    return np.cosh(y), np.sinh(y), np.cosh(y)


def line(y):
    return -0.3 * y, np.full_like(y, -0.3), np.zeros_like(y)


def anything(seed, *, method="hermite_simpson", intervals=9, periodic=True, fixed=False):
    """A random smooth problem with every kind of term, scale and equation."""
    draw = np.random.default_rng(seed)
    layout, grid = Layout(("a", "b"), ("c",), ("d",)), Grid(method, intervals, 1.3, periodic)
    by, mixed, share = (
        draw.standard_normal((6, 9)),
        draw.standard_normal((6, 9)),
        draw.standard_normal((6, 2)),
    )

    def function(z, p):
        inner = z @ mixed.T + p @ share.T
        y = np.sin(inner) + z @ by.T
        return y, np.cos(inner)[:, :, None] * mixed + by, np.cos(inner)[:, :, None] * share

    count = grid.instants
    low, high = np.full((count, 9), -np.inf), np.full((count, 9), np.inf)
    if fixed:
        low[0, :2] = high[0, :2] = 0.3
    return TrajectoryProblem(
        Outputs(function),
        layout,
        grid,
        outputs=6,
        equations=[0],
        limits=[Limits(outputs=[3, 4], low=-1.0, high=2.0)],
        residuals=[
            Residuals(outputs=[1, 2], target=draw.standard_normal((count, 2)), weight=[1.0, 3.0]),
            Residuals(outputs=[2], weight=draw.uniform(0.0, 1.0, (count, 1))),
        ],
        convex=[
            Convex(output=3, function=square, weight=draw.uniform(0.1, 0.3, count)),
            Convex(output=5, function=line),
        ],
        design=Design(names=("m", "n"), low=-3.0, high=3.0),
        low=low,
        high=high,
        advance=[0.5, 0.0] if periodic else None,
        z_scale=draw.uniform(0.5, 2.0, 9),
        y_scale=draw.uniform(0.5, 2.0, 6),
        cost_scale=3.0,
    )


CASES = pytest.mark.parametrize(
    "case",
    [{}, {"method": "trapezoidal", "intervals": 4, "periodic": False, "fixed": True}],
    ids=str,
)


@CASES
def test_first_derivatives_equal_central_differences(case):
    scaled = Scaled(anything(0, **case))
    draw = np.random.default_rng(10)
    x = scaled.scaled(draw.standard_normal(scaled.shape), draw.standard_normal(2))
    at, way, h = scaled.linearised(x), draw.standard_normal(len(x)), 1e-5
    plus, minus = scaled.point(x + h * way), scaled.point(x - h * way)
    z, p = way[: scaled.count].reshape(scaled.shape), way[scaled.count :]
    assert at.gradient @ way == pytest.approx((plus.cost - minus.cost) / (2 * h), rel=1e-6)
    along = np.einsum("nez,nz->ne", at.by_z, z) + at.by_p @ p
    assert along[:, :1] == pytest.approx((plus.equations - minus.equations) / (2 * h), abs=1e-6)
    assert along[:, 1:] == pytest.approx((plus.limited - minus.limited) / (2 * h), abs=1e-6)
    assert scaled.matrix @ way[: scaled.count] == pytest.approx(
        (plus.linear - minus.linear) / (2 * h), abs=1e-8
    )
    assert at.terms == pytest.approx(
        {name: each.sum() for name, each in scaled.instant_terms(at.y).items()}
    )


def test_the_largest_violation_is_told_by_name():
    problem = anything(0, intervals=4)
    problem.low[:], problem.high[:] = -9.0, 9.0
    scaled, grid = Scaled(problem), problem.grid
    at = scaled.linearised(scaled.scaled(np.zeros(scaled.shape), np.zeros(2)))

    def told(field, place, value):
        changed = getattr(at, field).copy()
        changed[place] = value
        return scaled.worst(dataclasses.replace(at, **{field: changed}))

    i, time = 7, f"{grid.times_s[7]:.3f} s"
    assert told("equations", (i, 0), -50.0) == (50.0, f"output 0 at {time}, an equation")
    assert told("limited", (i, 1), -70.0) == (
        pytest.approx(70.0 - 1.0 / problem.y_scale[4]),
        f"output 4 at {time}, a limit",
    )
    assert told("x", 9 * i + 3, -80.0) == (
        pytest.approx(80.0 - 9.0 / problem.z_scale[i, 3]),
        f"lower bound of v.b at {time}",
    )
    assert told("x", 9 * 8 + 1, 80.0)[1] == "upper bound of n"
    for row in (0, len(at.linear) - 1):
        instant, column = divmod(np.abs(scaled.matrix.toarray()[row]).argmax(), 9)
        assert told("linear", row, -60.0) == (
            60.0,
            f"a linear equation of {problem.layout.names[column]} at {grid.times_s[instant]:.3f} s",
        )


@CASES
def test_the_gauss_newton_hessian_is_that_of_the_linearised_outputs(case):
    """Where the outputs are linear the model is exact: second differences of the cost along a line
    equal it."""
    problem = anything(5, **case)
    rows = np.random.default_rng(6).standard_normal((6, 9))
    share = np.random.default_rng(7).standard_normal((6, 2))
    problem.function = Outputs(
        lambda z, p: (
            z @ rows.T + share @ p,
            np.tile(rows, (len(z), 1, 1)),
            np.tile(share, (len(z), 1, 1)),
        )
    )
    problem.terms = tuple(part for part in problem.terms if isinstance(part, Residuals))
    scaled = Scaled(problem)
    scaled.fixed[:] = False
    draw, n = np.random.default_rng(8), problem.size
    x, way = draw.standard_normal(n), draw.standard_normal(n)
    curve = way @ (Kkt(scaled, scaled.linearised(x), np.zeros(n)).matrix[:n, :n] @ way)
    exact = scaled.point(x + way).cost - 2.0 * scaled.point(x).cost + scaled.point(x - way).cost
    assert curve == pytest.approx(exact, rel=1e-8)


@CASES
def test_elimination_along_the_chain_solves_the_whole_system(case):
    scaled = Scaled(anything(9, **case))
    draw = np.random.default_rng(10)
    at = scaled.linearised(
        scaled.scaled(draw.standard_normal(scaled.shape), draw.standard_normal(2))
    )
    kkt = Kkt(scaled, at, np.full(len(at.x), 0.1))
    whole = kkt.matrix.toarray()
    assert whole == pytest.approx(whole.T)
    assert sorted(kkt.order) == list(range(kkt.size))
    right = draw.standard_normal(kkt.size)
    assert kkt.matrix @ kkt.solve(right) == pytest.approx(right, abs=1e-8)
    soft = whole - np.diag(np.where(np.arange(kkt.size) < kkt.variables, 0.0, SOFT))
    assert kkt.roughly(right) == pytest.approx(np.linalg.solve(soft, right), rel=1e-6, abs=1e-6)
    assert kkt.convex
    assert (np.linalg.eigvalsh(whole) < 0.0).sum() == kkt.size - kkt.variables


@pytest.mark.parametrize("damping", [1e-9, 1e3])
def test_the_large_problem_is_solved_to_rounding_with_hardly_any_damping(damping):
    problem, start = chain(intervals=8)
    scaled = Scaled(problem)
    at = scaled.linearised(scaled.scaled(start.z, start.p))
    kkt = Kkt(scaled, at, np.full(len(at.x), damping))
    right = np.random.default_rng(0).standard_normal(kkt.size)
    unknowns = kkt.solve(right)
    assert kkt.matrix @ unknowns == pytest.approx(right, abs=1e-13 * np.abs(unknowns).max() + 1e-8)


@pytest.mark.parametrize("rank", [6, 4])
def test_a_quadratic_within_a_box_is_least_where_its_slope_pushes_against_the_bounds(rank):
    """Also where the matrix is singular."""
    draw = np.random.default_rng(rank)
    for _ in range(20):
        root, linear = draw.standard_normal((rank, 6)), draw.standard_normal(6)
        matrix = root.T @ root
        x = box_minimum(matrix, matrix @ linear, 0.8, np.zeros(6))
        slope = matrix @ (x + linear)
        assert (x >= 0.0).all() and (x <= 0.8 + 1e-12).all()
        assert slope[(x > 1e-9) & (x < 0.8 - 1e-9)] == pytest.approx(0.0, abs=1e-8)
        assert (slope[x <= 1e-9] > -1e-8).all() and (slope[x >= 0.8 - 1e-9] < 1e-8).all()


@CASES
def test_a_step_is_the_minimum_of_its_quadratic_program(case):
    """Its first-order conditions, put together from the sparse whole; the program is convex, so
    they suffice."""
    scaled, draw = Scaled(anything(9, **case)), np.random.default_rng(10)
    at = scaled.linearised(
        scaled.scaled(0.3 * draw.standard_normal(scaled.shape), draw.standard_normal(2))
    )
    n, free, slacks = len(at.x), ~scaled.fixed, scaled.slacks(at)
    damping = draw.uniform(0.5, 2.0, n)
    kkt, bare = Kkt(scaled, at, damping), Kkt(scaled, at, np.zeros(n)).matrix[:n, :n]
    for likely in ([], [2 * n], np.flatnonzero(slacks < 1.0)):
        step = find_step(
            kkt, equations=at.equations, slacks=slacks, likely=np.array(likely, dtype=int)
        )
        d, conditions = step.change, kkt.matrix[n:, :n]
        assert conditions @ d == pytest.approx(
            -np.concatenate([at.linear, at.equations.ravel()]), abs=1e-12
        )
        after = slacks + slack_changes(scaled, at, d)
        assert after.min() > -1e-9 and (step.duals > 0.0).all() and len(step.active) > 1
        assert after[step.active] == pytest.approx(0.0, abs=1e-10)
        assert step.pull == pytest.approx(-normals(scaled, at, step.active) @ step.duals)
        slope = at.gradient + kkt.matrix[:n, :n] @ d + conditions.T @ step.multipliers + step.pull
        assert slope[free] == pytest.approx(0.0, abs=1e-11)
        assert d[scaled.fixed] == pytest.approx(0.0, abs=1e-12)
        assert step.predicted == pytest.approx(-at.gradient @ d - 0.5 * d @ (bare @ d))


@CASES
def test_the_first_order_residual_is_the_slope_of_the_lagrangian_over_the_largest_multiplier(case):
    scaled, draw = Scaled(anything(9, **case)), np.random.default_rng(10)
    at = scaled.linearised(
        scaled.scaled(0.3 * draw.standard_normal(scaled.shape), draw.standard_normal(2))
    )
    n, kkt = len(at.x), Kkt(scaled, at, np.ones(len(at.x)))
    step = step_of(scaled, kkt)
    slope = (at.gradient + kkt.matrix[n:, :n].T @ step.multipliers + step.pull)[~scaled.fixed]
    apart = step.duals * scaled.slacks(at)[step.active]
    largest = max(np.abs(step.multipliers).max(), step.duals.max())
    expected = max(np.abs(slope).max(), np.abs(apart).max()) / (1.0 + largest)
    assert optimality(scaled, at, step) == pytest.approx(expected)
    sole = dataclasses.replace(step, duals=1e3 * step.duals)
    assert optimality(scaled, at, sole) == pytest.approx(
        max(np.abs(slope).max(), 1e3 * np.abs(apart).max()) / (1.0 + 1e3 * step.duals.max())
    )


# Costs that Gauss-Newton knows nothing of.


def swing(intervals=12):
    """A pendulum's effort and its distance from a motion as a sum without squares: none for
    Gauss-Newton to see."""
    grid = Grid("hermite_simpson", intervals, 1.0, periodic=True)
    aim = np.cos(2.0 * np.pi * grid.times_s)

    def outputs(z, p):
        q, v, a, torque = z.T
        off = q - np.resize(aim, len(q))
        by_z, by_p = np.zeros((len(z), 2, 4)), np.zeros((len(z), 2, 1))
        by_z[:, 0] = np.stack([9.81 * np.cos(q) + p[0], 0.3 + 0 * q, 1 + 0 * q, -1 + 0 * q], axis=1)
        by_z[:, 1, 0], by_z[:, 1, 3], by_p[:, 0, 0] = 300.0 * np.sin(off), torque, q
        return (
            np.stack(
                [
                    a + 9.81 * np.sin(q) + 0.3 * v + p[0] * q - torque,
                    0.5 * torque**2 + 300.0 * (1.0 - np.cos(off)),
                ],
                axis=1,
            ),
            by_z,
            by_p,
        )

    problem = TrajectoryProblem(
        Outputs(outputs),
        Layout(("q",), (), ("torque",)),
        grid,
        outputs=2,
        equations=[0],
        convex=[Convex(output=1, function=lambda y: (y, np.ones_like(y), np.zeros_like(y)))],
        z_scale=[1.0, 5.0, 40.0, 20.0],
        y_scale=[20.0, 1.0],
        cost_scale=10.0,
        design=Design(names=["stiffness"], low=0.0, high=100.0),
    )
    z = np.zeros((grid.instants, 4))
    z[:, 0] = 0.5 * aim
    return problem, Start(z, np.array([5.0]))


def step_of(scaled, kkt):
    return find_step(
        kkt, equations=kkt.at.equations, slacks=scaled.slacks(kkt.at), likely=np.zeros(0, dtype=int)
    )


def test_a_cost_without_squares_is_minimised_all_the_same():
    problem, start = swing()
    solution = solve(problem, start)
    assert solution.status == "optimal", solution.message
    theirs = confirm(problem, solution.last, "snopt")
    assert theirs.cost == pytest.approx(solution.cost, rel=1e-6)
    assert theirs.p == pytest.approx(solution.p, rel=1e-3)


@pytest.mark.parametrize("make", [swing, lambda: chain(intervals=4)])
def test_its_hessian_is_the_second_difference_of_the_lagrangian(make):
    problem, start = make()
    scaled, draw = Scaled(problem), np.random.default_rng(0)
    x = scaled.scaled(
        start.z + 0.1 * problem.z_scale * draw.standard_normal(start.z.shape), start.p + 0.1
    )
    at = scaled.linearised(x)
    step = step_of(scaled, Kkt(scaled, at, np.ones(len(x))))
    own, mixed, shared = with_curvature(scaled, at, step).hessian
    duals = np.zeros(4 * len(x) + 2 * at.limited.size)
    duals[step.active] = step.duals
    low, high = duals[2 * len(x) :][: 2 * at.limited.size].reshape(2, *at.limited.shape)
    of_equations = step.multipliers[len(at.linear) :].reshape(at.equations.shape)

    def lagrangian(where):
        here = scaled.point(where)
        return (
            here.cost + np.sum(of_equations * here.equations) + np.sum((high - low) * here.limited)
        )

    way, h = draw.standard_normal(len(x)), 1e-4
    z, p = way[: scaled.count].reshape(scaled.shape), way[scaled.count :]
    curve = (
        np.einsum("nz,nzy,ny->", z, own, z)
        + 2.0 * np.einsum("nz,nzp,p->", z, mixed, p)
        + p @ shared @ p
    )
    exact = (lagrangian(x + h * way) - 2.0 * lagrangian(x) + lagrangian(x - h * way)) / h**2
    assert curve == pytest.approx(exact, rel=1e-4, abs=1e-6)


def test_an_indefinite_hessian_is_recognised_by_its_inertia():
    """At the top of a cosine the Lagrangian is concave; with enough damping it is not."""
    problem, start = swing()
    scaled = Scaled(problem)
    at = scaled.linearised(scaled.scaled(start.z + np.array([np.pi, 0.0, 0.0, 0.0]), start.p))
    exact = with_curvature(scaled, at, step_of(scaled, Kkt(scaled, at, np.ones(len(at.x)))))
    for damping, convex in ((1e-6, False), (1e4, True)):
        kkt = Kkt(scaled, exact, np.full(len(at.x), damping))
        whole, n = kkt.matrix.toarray(), kkt.variables
        free = null_space(whole[n:, :n])
        assert (
            kkt.convex == convex == (np.linalg.eigvalsh(free.T @ whole[:n, :n] @ free).min() > 0.0)
        ), damping


def test_stiffening_what_presses_leaves_the_step_as_it_is():
    problem, start = chain(intervals=4)
    scaled = Scaled(problem)
    at = scaled.linearised(scaled.scaled(start.z, start.p))
    damping = np.full(len(at.x), 1e-2)
    plain = step_of(scaled, Kkt(scaled, at, damping))
    assert len(plain.active) > 0
    again = step_of(scaled, Kkt(scaled, stiffened(scaled, at, plain), damping))
    assert again.change == pytest.approx(plain.change, abs=1e-6)
    assert sorted(again.active) == sorted(plain.active)
