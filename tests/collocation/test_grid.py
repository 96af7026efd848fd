"""Instants, quadrature, linear equations and names."""

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.collocation.problem import Grid, Layout

LAYOUT = Layout(("x", "y"), ("w",), ("s",))
GRIDS = pytest.mark.parametrize(
    "grid",
    [
        Grid(method, 10, 2.0, periodic)
        for method in ("trapezoidal", "hermite_simpson")
        for periodic in (True, False)
    ],
    ids=lambda grid: f"{grid.method} {'periodic' if grid.periodic else 'open'}",
)


@GRIDS
def test_weights_sum_to_the_duration(grid):
    assert grid.weights.sum() == pytest.approx(2.0)
    assert len(grid.weights) == len(grid.times_s) == grid.instants
    assert grid.times_s[-1] == pytest.approx(2.0 - grid.periodic * grid.step_s)


def test_simpson_integrates_cubics_and_trapezoids_integrate_lines():
    for method, power in (("hermite_simpson", 3), ("trapezoidal", 1)):
        grid = Grid(method, 4, 2.0, periodic=False)
        assert grid.weights @ grid.times_s**power == pytest.approx(2.0 ** (power + 1) / (power + 1))


def test_equations_hold_for_the_polynomials_that_they_are_exact_for():
    """Hermite-Simpson: x a cubic, so its rate is a parabola. Trapezoidal: x a parabola. u: w a
    parabola."""
    for method, value, rate, second in (
        ("hermite_simpson", (0, 0, 0, 1), (0, 0, 3), (0, 6)),
        ("trapezoidal", (0, 1, 0), (1,), (0,)),
    ):
        grid = Grid(method, 7, 2.0, periodic=False)
        t = grid.times_s
        q, v, a = (np.polynomial.polynomial.polyval(t, part) for part in (value, rate, second))
        z = np.stack([q, 2 * q, v, 2 * v, a, 2 * a, t**2, 2 * t, 0 * t], axis=1)
        matrix, right = grid.collocation(LAYOUT, np.zeros(2))
        assert matrix @ z.ravel() == pytest.approx(right, abs=1e-12)


def test_a_coordinate_may_advance_over_a_period():
    for method in ("trapezoidal", "hermite_simpson"):
        grid = Grid(method, 5, 2.0, periodic=True)
        t, o = grid.times_s, np.zeros(grid.instants)
        z = np.stack([0.7 * t, o, o + 0.7, o, o, o, o + 1.0, o, o], axis=1)
        matrix, right = grid.collocation(LAYOUT, np.array([1.4, 0.0]))
        assert matrix @ z.ravel() == pytest.approx(right, abs=1e-13)


@GRIDS
def test_rates_of_quasi_static_variables_are_of_second_order(grid):
    errors = []
    for more in (1, 2):
        fine = Grid(grid.method, grid.intervals * more * 2, 2.0, grid.periodic)
        t, z = fine.times_s, np.zeros((fine.instants, LAYOUT.size))
        z[:, LAYOUT.w], z[:, LAYOUT.u] = (
            np.sin(np.pi * t)[:, None],
            (np.pi * np.cos(np.pi * t))[:, None],
        )
        matrix, right = fine.collocation(LAYOUT, np.zeros(2))
        errors.append(np.abs(matrix @ z.ravel() - right)[-fine.instants :].max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)


def test_columns_go_by_kind_and_name():
    assert LAYOUT.names == ("q.x", "q.y", "v.x", "v.y", "a.x", "a.y", "w.w", "u.w", "s.s")
    assert LAYOUT.size == len(LAYOUT.names)
    assert [
        LAYOUT.names[part] for part in (LAYOUT.q, LAYOUT.v, LAYOUT.a, LAYOUT.w, LAYOUT.u, LAYOUT.s)
    ] == [("q.x", "q.y"), ("v.x", "v.y"), ("a.x", "a.y"), ("w.w",), ("u.w",), ("s.s",)]
    with pytest.raises(InputError, match="twice"):
        Layout(("x", "x"))
