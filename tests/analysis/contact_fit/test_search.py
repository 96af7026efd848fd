"""One search of a fit: every solver finds the same minimum, what fails on the way is survived; Ctrl-C ends it."""

from __future__ import annotations

import importlib
import math
from types import SimpleNamespace

import numpy as np
import pytest

from vsf_drake.analysis.contact_fit import ContactFit, ContactFitOptions, solve
from vsf_drake.analysis.contact_fit.options import SOLVERS
from vsf_drake.analysis.contact_fit.solve import FitSearch, search
from vsf_drake.errors import SimulationError

FREE = ("contact.forefoot.force", "offset.height", "offset.alignment")
MOST = {"gauss_newton": 20, "snopt": 40, "ipopt": 60, "nlopt": 60}
"""Walks of a search; it took 9, 20, 30 and, with 20 of them for its global part, 24 when this was written."""


@pytest.fixture
def fit(few_free):
    def make(**options):
        return few_free(*FREE, **{"iterations": 100, **options})

    return make


def failing(fit, monkeypatch, where):
    """The fit with a walk that breaks where `where(u, i)` says so of the i-th point."""
    evaluate, seen = fit.evaluate, []

    def broken(u, *, derivatives=True):
        if u.tolist() not in seen:
            seen.append(u.tolist())
        if where(u, seen.index(u.tolist())):
            raise SimulationError("broke", time_s=0.3)
        return evaluate(u, derivatives=derivatives)

    monkeypatch.setattr(fit, "evaluate", broken)
    return fit


@pytest.fixture(scope="module")
def minimum():
    return {}


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver_finds_the_same_minimum_in_few_walks(fit, minimum, solver):
    problem = fit(solver=solver, iterations=20 if solver == "nlopt" else 100)
    found = search(problem, problem.parameters.start)
    assert found.success, found.message
    assert found.evaluations <= MOST[solver]
    assert found.evaluations == problem.evaluations and found.failed == 0
    assert found.start_cost == pytest.approx(problem.evaluate(problem.parameters.start).cost, rel=1e-12)
    at = problem.evaluate(found.u)
    assert at.cost == pytest.approx(found.cost, rel=1e-12)
    gradient = at.jacobian.T @ at.residual
    curvature = at.jacobian.T @ at.jacobian
    assert 0.5 * gradient @ np.linalg.solve(curvature, gradient) < 1e-3, "what a last step would gain"
    minimum.setdefault("cost", found.cost), minimum.setdefault("u", found.u)
    assert found.cost == pytest.approx(minimum["cost"], abs=1e-3)
    np.testing.assert_allclose(found.u, minimum["u"], atol=0.02)


@pytest.mark.parametrize("solver", ["gauss_newton", "snopt", "ipopt"])
def test_a_walk_that_fails_on_the_way_is_survived(fit, monkeypatch, minimum, solver):
    problem = failing(fit(solver=solver), monkeypatch, lambda _, i: i == 1)
    found = search(problem, problem.parameters.start)
    assert found.failed == 1
    assert found.success, found.message
    if minimum:
        assert found.cost == pytest.approx(minimum["cost"], abs=0.01)


@pytest.mark.parametrize("solver", ["gauss_newton", pytest.param("snopt", marks=pytest.mark.slow)])
def test_a_search_that_a_failing_region_keeps_from_the_minimum_has_not_converged(fit, monkeypatch, solver):
    """The best that is found lies on the good side, near the edge; it is no minimum."""
    problem = failing(fit(solver=solver), monkeypatch, lambda u, _: u[0] < -1.0)
    found = search(problem, problem.parameters.start)
    assert not found.success
    assert found.failed >= 1
    assert np.isfinite(found.cost) and found.cost < found.start_cost
    assert found.u[0] >= -1.0


def test_a_start_at_which_the_walk_fails_is_a_search_that_failed(fit, monkeypatch):
    problem = failing(fit(), monkeypatch, lambda *_: True)
    found = search(problem, problem.parameters.start)
    assert (found.success, found.cost, found.start_cost) == (False, np.inf, np.inf)
    assert "fails where the search starts" in found.message and "broke" in found.message
    assert found.evaluations == found.failed == 1
    np.testing.assert_array_equal(found.u, problem.parameters.start)


def test_a_start_outside_of_the_bounds_is_moved_to_them(fit):
    problem = fit(iterations=1)
    found = search(problem, np.array([100.0, 0.0, -100.0]))
    low, high = problem.parameters.bounds
    np.testing.assert_array_equal(found.start, [high[0], 0.0, low[2]])


@pytest.mark.parametrize("solver", ["gauss_newton", "snopt"])
def test_a_minimum_beyond_a_bound_is_found_on_it(fit, soft, fit_walker, solver):
    """Free, the force falls by more than three standard deviations; held to one, it ends there."""
    free = fit(solver=solver)
    mean = free.parameters.by_name[FREE[0]].mean
    problem = ContactFit([soft], walker=fit_walker, options=free.options,
                         parameters=free.parameters.changed([FREE[0]], low=mean * math.exp(-0.5)))
    found = search(problem, problem.parameters.start)
    assert found.success, found.message
    assert found.u[0] == pytest.approx(-1.0, abs=1e-2)


searches = importlib.import_module("vsf_drake.analysis.contact_fit.solve")  # the package has a function of this name


@pytest.mark.parametrize("solver", SOLVERS)
def test_ctrl_c_ends_a_fit_in_the_midst_of_any_solver(soft, fit_walker, monkeypatch, solver):
    fit = ContactFit([soft], walker=fit_walker, options=ContactFitOptions(solver=solver, starts=1, iterations=20))
    evaluate, count = fit.evaluate, 0

    def pressed_at_the_third(u, *, derivatives=True):
        nonlocal count
        count += 1
        if count == 3:
            raise KeyboardInterrupt
        return evaluate(u, derivatives=derivatives)

    monkeypatch.setattr(fit, "evaluate", pressed_at_the_third)
    with pytest.raises(KeyboardInterrupt):
        solve(fit)
    assert count == 3


def test_the_share_that_is_done_goes_by_the_time_of_searches_that_ended(soft, fit_walker, monkeypatch):
    fit = ContactFit([soft], walker=fit_walker, options=ContactFitOptions(starts=3))
    clock, told = SimpleNamespace(now=0.0), []

    def ten_seconds_long(_fit, start, progress):
        for i in range(1, 6):
            clock.now += 2.0
            progress(i, 1.0)
        return FitSearch(start=start, u=start, start_cost=2.0, cost=1.0, success=True, message="", evaluations=5,
                         failed=0)

    monkeypatch.setattr(searches, "time", SimpleNamespace(perf_counter=lambda: clock.now))
    monkeypatch.setattr(searches, "_start", lambda fit, i: fit.parameters.start)
    monkeypatch.setattr(searches, "search", ten_seconds_long)
    searches.run_searches(fit, progress=lambda _, share: told.append((clock.now, share)))
    assert [share for _, share in told[5:]] == pytest.approx([now / 30.0 for now, _ in told[5:]])
