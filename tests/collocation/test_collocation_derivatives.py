"""Assembled derivatives against finite differences, and the eliminated KKT system against the sparse whole."""

import numpy as np
import pytest
from collocation_problems import Outputs, chain

from vsf_drake.collocation import (
    Convex,
    Design,
    Grid,
    Layout,
    Limits,
    Residuals,
    TrajectoryProblem,
)
from vsf_drake.collocation.scaled import Scaled
from vsf_drake.collocation.step import SOFT, Kkt, normals, room_changes


def square(y):
    return np.cosh(y), np.sinh(y), np.cosh(y)


def line(y):
    return -0.3 * y, np.full_like(y, -0.3), np.zeros_like(y)


def anything(seed, *, method="hermite_simpson", intervals=9, periodic=True, fixed=False):
    """A random smooth problem with every kind of term, scale and equation."""
    draw = np.random.default_rng(seed)
    layout, grid = Layout(("a", "b"), ("c",), ("d",)), Grid(method, intervals, 1.3, periodic)
    by, mixed, share = draw.standard_normal((6, 9)), draw.standard_normal((6, 9)), draw.standard_normal((6, 2))

    def function(z, p):
        inner = z @ mixed.T + p @ share.T
        y = np.sin(inner) + z @ by.T
        return y, np.cos(inner)[:, :, None] * mixed + by, np.cos(inner)[:, :, None] * share

    count = grid.instants
    low, high = np.full((count, 9), -np.inf), np.full((count, 9), np.inf)
    if fixed:
        low[0, :2] = high[0, :2] = 0.3
    return TrajectoryProblem(
        Outputs(function), layout, grid, outputs=6, equations=[0], limits=[Limits(outputs=[3, 4], low=-1.0, high=2.0)],
        residuals=[Residuals(outputs=[1, 2], target=draw.standard_normal((count, 2)), weight=[1.0, 3.0]),
                   Residuals(outputs=[2], weight=draw.uniform(0.0, 1.0, (count, 1)))],
        convex=[Convex(output=3, function=square, weight=0.2), Convex(output=5, function=line)],
        design=Design(names=("m", "n"), low=-3.0, high=3.0), low=low, high=high,
        advance=[0.5, 0.0] if periodic else None,
        z_scale=draw.uniform(0.5, 2.0, 9), y_scale=draw.uniform(0.5, 2.0, 6), cost_scale=3.0)


CASES = pytest.mark.parametrize("case", [
    {}, {"method": "trapezoidal"}, {"method": "trapezoidal", "intervals": 15}, {"periodic": False},
    {"periodic": False, "fixed": True}, {"method": "trapezoidal", "periodic": False, "fixed": True},
    {"intervals": 4, "method": "trapezoidal"}], ids=str)


@CASES
@pytest.mark.parametrize("seed", [0, 1])
def test_first_derivatives_equal_central_differences(case, seed):
    scaled = Scaled(anything(seed, **case))
    draw = np.random.default_rng(seed + 10)
    x = scaled.scaled(draw.standard_normal(scaled.shape), draw.standard_normal(2))
    at, way, h = scaled.linearised(x), draw.standard_normal(len(x)), 1e-5
    plus, minus = scaled.point(x + h * way), scaled.point(x - h * way)
    z, p = way[:scaled.count].reshape(scaled.shape), way[scaled.count:]
    assert at.gradient @ way == pytest.approx((plus.cost - minus.cost) / (2 * h), rel=1e-6)
    along = np.einsum("nez,nz->ne", at.by_z, z) + at.by_p @ p
    assert along[:, :1] == pytest.approx((plus.equations - minus.equations) / (2 * h), abs=1e-6)
    assert along[:, 1:] == pytest.approx((plus.limited - minus.limited) / (2 * h), abs=1e-6)
    assert scaled.matrix @ way[:scaled.count] == pytest.approx((plus.linear - minus.linear) / (2 * h), abs=1e-8)
    assert at.terms == pytest.approx({name: each.sum() for name, each in scaled.instant_terms(at.y).items()})


@CASES
def test_rooms_change_as_their_normals_say(case):
    scaled = Scaled(anything(3, **case))
    draw = np.random.default_rng(4)
    at = scaled.linearised(scaled.scaled(draw.standard_normal(scaled.shape), draw.standard_normal(2)))
    which = np.flatnonzero(np.isfinite(scaled.slacks(at)))
    way = draw.standard_normal(len(at.x)) * ~scaled.fixed
    assert normals(scaled, at, which).T @ way == pytest.approx(room_changes(scaled, at, way)[which])


@CASES
def test_the_gauss_newton_hessian_is_that_of_the_linearised_outputs(case):
    """Where the outputs are linear the model is exact: second differences of the cost along a line equal it."""
    problem = anything(5, **case)
    rows = np.random.default_rng(6).standard_normal((6, 9))
    share = np.random.default_rng(7).standard_normal((6, 2))
    problem.function = Outputs(lambda z, p: (z @ rows.T + share @ p, np.tile(rows, (len(z), 1, 1)),
                                             np.tile(share, (len(z), 1, 1))))
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
    at = scaled.linearised(scaled.scaled(draw.standard_normal(scaled.shape), draw.standard_normal(2)))
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


@pytest.mark.parametrize("damping", [1e-9, 1e-3, 1e3])
def test_the_large_problem_is_solved_to_rounding_with_hardly_any_damping(damping):
    problem, start = chain(intervals=8)
    scaled = Scaled(problem)
    at = scaled.linearised(scaled.scaled(start.z, start.p))
    kkt = Kkt(scaled, at, np.full(len(at.x), damping))
    right = np.random.default_rng(0).standard_normal(kkt.size)
    found = kkt.solve(right)
    assert kkt.matrix @ found == pytest.approx(right, abs=1e-13 * np.abs(found).max() + 1e-8)
