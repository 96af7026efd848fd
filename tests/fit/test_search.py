"""Searches of a fit: every solver finds the same minimum and survives failures; starts come from
the seed alone, and an interrupted fit goes on as it would have."""

from __future__ import annotations

import importlib
import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_fit import made_search, made_uncertainty
from scipy.stats import norm

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.fit.options import SOLVERS, ContactFitOptions
from vsf_drake.fit.parameters import FitParameter, FitParameters
from vsf_drake.fit.problem import ContactFit, FitEvaluation
from vsf_drake.fit.solution import solve
from vsf_drake.fit.solve import prior_samples, run_searches, search
from vsf_drake.motion.manifest import GeometricOffsets

# the package has a function of this name
searches = importlib.import_module("vsf_drake.fit.solve")
solutions = importlib.import_module("vsf_drake.fit.solution")
FREE = ("contact.forefoot.force", "offset.height", "offset.alignment")
MOST = {"gauss_newton": 25, "snopt": 40, "ipopt": 60, "nlopt": 60}
"""Walks of a search; it took 9, 20, 30 and, with 20 of them for its global part, 24 when this was
written."""


@pytest.fixture
def fit(few_free):
    def make(**options):
        return few_free(*FREE, **options)

    return make


def failing(fit, monkeypatch, where):
    """The fit with a walk that breaks where `where(u, i)` says so of the i-th point."""
    evaluate, seen = fit.evaluate, []

    def broken(u, **how):
        if u.tolist() not in seen:
            seen.append(u.tolist())
        if where(u, seen.index(u.tolist())):
            raise SimulationError("broke", time_s=0.3)
        return evaluate(u, **how)

    monkeypatch.setattr(fit, "evaluate", broken)
    return fit


@pytest.fixture(scope="module")
def minimum():
    return {}


@pytest.fixture(scope="module")
def halfway(few_free):
    """Of the second parameter, between the start and the minimum."""
    free = few_free(*FREE)
    return 0.5 * search(free, free.parameters.start).u[1]


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver_finds_the_same_minimum_in_few_walks(fit, minimum, solver):
    problem = fit(solver=solver, iterations=20 if solver == "nlopt" else 100)
    found = search(problem, problem.parameters.start)
    assert found.success, found.message
    assert found.evaluations == problem.evaluations <= MOST[solver] and found.failed == 0
    assert found.start_cost == pytest.approx(
        problem.evaluate(problem.parameters.start).cost, rel=1e-12
    )
    at = problem.evaluate(found.u)
    assert at.cost == pytest.approx(found.cost, rel=1e-12)
    gradient, curvature = at.jacobian.T @ at.residual, at.jacobian.T @ at.jacobian
    # Beside the minimum the cost jumps by 0.007 in steps of 2 ms: a search may end on either side.
    assert 0.5 * gradient @ np.linalg.solve(curvature, gradient) < 7e-3, (
        "what a last step would gain"
    )
    minimum.setdefault("cost", found.cost), minimum.setdefault("u", found.u)
    assert found.cost == pytest.approx(minimum["cost"], abs=0.01)
    apart = found.u - minimum["u"]
    assert 0.5 * apart @ curvature @ apart < 7e-3, "no further apart than such a jump can hide"


@pytest.mark.parametrize("solver", ["gauss_newton", "snopt"])
def test_a_walk_that_fails_on_the_way_is_survived(fit, monkeypatch, minimum, solver):
    problem = failing(fit(solver=solver), monkeypatch, lambda _, i: i == 1)
    found = search(problem, problem.parameters.start)
    assert found.success and found.failed == 1, found.message
    if minimum:
        assert found.cost == pytest.approx(minimum["cost"], abs=0.01)


def test_a_walk_that_fails_beside_a_start_on_a_bound_is_survived(fit, monkeypatch, minimum):
    problem = failing(fit(), monkeypatch, lambda _, i: i == 1)
    found = search(problem, problem.parameters.bounds[0])
    assert found.success and found.failed == 1, found.message
    if minimum:
        assert found.cost == pytest.approx(minimum["cost"], abs=0.01)


def test_more_noise_and_coarser_steps_come_first_and_the_end_is_without(fit, monkeypatch):
    problem, seen = fit(), []
    evaluate = problem.evaluate
    monkeypatch.setattr(
        problem,
        "evaluate",
        lambda u, **how: (
            seen.append((how.get("noise", 1.0), how.get("step_s"))),
            evaluate(u, **how),
        )[1],
    )
    assert search(problem, problem.parameters.start).success
    assert [*dict.fromkeys(seen)] == [
        (1.0, None),
        (30.0, 4e-3),
        (10.0, 4e-3),
        (3.0, 4e-3),
    ] and seen[-1] == (1.0, None)
    seen.clear()
    search(problem, problem.parameters.start, near=True)
    assert set(seen) == {(1.0, None)}, "near a minimum there is nothing to go round"


def test_noise_makes_data_weigh_less_and_the_prior_not(fit):
    problem = fit()
    u = np.array([0.3, -0.2, 0.1])
    plain, noisy = problem.evaluate(u).cost, problem.evaluate(u, noise=2.0).cost
    prior = 0.5 * u @ u
    assert noisy - prior == pytest.approx((plain - prior) / 4.0)


def test_a_kink_is_a_minimum_and_a_search_says_so(fit, monkeypatch):
    """|x| / 2 + x² / 2 with a slope of 5 either way: any linear model promises much, and nothing is
    to be had."""
    problem = fit()
    names = len(problem.parameters)

    def kinked(u, **how):
        x = u - 0.3
        residual = np.concatenate([5.0 + np.abs(x), u - u])
        by = np.vstack([np.diag(np.sign(x)), np.zeros((names, names))])
        return FitEvaluation(residual=residual, jacobian=by, terms=())

    monkeypatch.setattr(problem, "evaluate", kinked)
    found = search(problem, problem.parameters.start)
    assert found.success, found.message
    np.testing.assert_allclose(found.u, 0.3, atol=0.01)


def test_the_time_limit_ends_a_fit_where_it_is(fit):
    problem = fit(starts=3, time_limit_s=1e-6)
    (found,) = run_searches(problem)
    assert not found.success and "time limit" in found.message and np.isfinite(found.cost)


@pytest.fixture
def bowl(fit, monkeypatch):
    """A fit whose cost is least where all parameters are 0.3 standard deviations off, without a
    walk."""

    def make(**options):
        problem = fit(starts=2, screened=1, **options)

        def evaluate(u, **_):
            return FitEvaluation(
                residual=30.0 * (u - 0.3), jacobian=30.0 * np.eye(len(u)), terms=()
            )

        monkeypatch.setattr(problem, "evaluate", evaluate)
        return problem

    return make


def test_a_busy_machine_finds_the_same_unless_a_limit_of_wall_time_was_asked_for(
    bowl, hurried, monkeypatch
):
    """That limit is told even where it cut no search: one of two is missing."""
    known = run_searches(bowl())
    assert len(known) == 2 and all(s.success and not s.cut for s in known)
    hurried()
    for row, before in zip(run_searches(bowl()), known, strict=True):
        assert (row.message, row.evaluations) == (before.message, before.evaluations)
        np.testing.assert_array_equal(row.u, before.u)
    monkeypatch.setattr(solutions.ContactFitSolution, "checked", lambda solution: solution)
    monkeypatch.setattr(solutions, "uncertainty_at", lambda *_: made_uncertainty(names=FREE))
    whole = solve(bowl(time_limit_s=1e12))
    assert whole.success and not whole.end.late and "wall time" not in whole.message
    told = "the limit of 1 s of wall time ended the fit in search 1 of 2"
    cut = solve(bowl(time_limit_s=1.0))
    assert not cut.success and cut.end.late and told in cut.message
    monkeypatch.setattr(
        searches, "search", lambda *_, **__: replace(made_search(), u=np.full(3, 0.3))
    )
    short = solve(bowl(time_limit_s=1.0))
    assert short.success and short.end.late and told in short.message


def test_whatever_the_clock_cut_goes_on_without_a_limit_and_no_limit_is_told_then(
    bowl, monkeypatch
):
    """A search that was cut but had converged too."""
    monkeypatch.setattr(solutions.ContactFitSolution, "checked", lambda solution: solution)
    monkeypatch.setattr(solutions, "uncertainty_at", lambda *_: made_uncertainty(names=FREE))
    states = []
    run_searches(bowl(), checkpoint=lambda state: states.append(json.dumps(state)))
    state = json.loads(states[-1])
    state["searches"][0]["cut"] = True
    resumed = solve(bowl(), resume=state)
    assert resumed.success and not resumed.end.late and "wall time" not in resumed.message


@pytest.mark.parametrize("solver", ["gauss_newton", pytest.param("snopt", marks=pytest.mark.slow)])
def test_a_search_that_a_failing_region_keeps_from_the_minimum_has_not_converged(
    fit, monkeypatch, halfway, solver
):
    """The best that is found lies on the good side, near the edge; it is no minimum."""
    problem = failing(fit(solver=solver), monkeypatch, lambda u, _: u[1] / halfway > 1.0)
    found = search(problem, problem.parameters.start)
    assert not found.success and found.failed >= 1
    assert np.isfinite(found.cost) and found.cost < found.start_cost and found.u[1] / halfway <= 1.0


@pytest.mark.parametrize("solver", ["gauss_newton", "snopt"])
def test_a_minimum_beyond_a_bound_is_found_on_it(fit, soft, fit_walker, halfway, solver):
    free = fit(solver=solver)
    edge = free.parameters.by_name[FREE[1]].from_u(halfway)
    problem = ContactFit(
        [soft],
        walker=fit_walker,
        options=free.options,
        parameters=free.parameters.changed([FREE[1]], **{"low" if halfway < 0.0 else "high": edge}),
    )
    found = search(problem, np.array([0.0, -100.0 * np.sign(halfway), 0.0]))
    assert found.start[1] in [bound[1] for bound in problem.parameters.bounds], (
        "a start beyond them is moved there"
    )
    assert found.start[1] != pytest.approx(halfway) and found.success, found.message
    assert found.u[1] == pytest.approx(halfway, abs=1e-2)


@pytest.mark.parametrize("solver", SOLVERS)
def test_ctrl_c_ends_a_fit_in_the_midst_of_any_solver(fit, monkeypatch, solver):
    problem, count = fit(solver=solver, starts=1, iterations=20), 0
    evaluate = problem.evaluate

    def pressed_at_the_third(u, **how):
        nonlocal count
        count += 1
        if count == 3:
            raise KeyboardInterrupt
        return evaluate(u, **how)

    monkeypatch.setattr(problem, "evaluate", pressed_at_the_third)
    with pytest.raises(KeyboardInterrupt):
        solve(problem)
    assert count == 3


# Several searches.

SHORT = {"starts": 3, "screened": 2, "iterations": 4, "seed": 5, "step_s": 4e-3}


@pytest.fixture
def brief(few_free):
    def make(**options):
        return few_free(*FREE[:2], **(SHORT | options))

    return make


@pytest.fixture(scope="module")
def ended(few_free):
    """The short fit: its searches, its state after each as it would stand in a file, and what it
    told."""
    states, told = [], []
    searches = run_searches(
        few_free(*FREE[:2], **SHORT),
        progress=lambda *what: told.append(what),
        checkpoint=lambda state: states.append(json.dumps(state)),
    )
    return SimpleNamespace(searches=searches, states=states, told=told)


def same(found, wanted):
    assert len(found) == len(wanted)
    for a, b in zip(found, wanted, strict=True):
        for name, value in vars(b).items():
            np.testing.assert_array_equal(getattr(a, name), value)


def test_samples_are_stratified_and_follow_the_prior_within_the_bounds():
    def normal(name, low=-10.0, high=10.0):
        return FitParameter(name=name, unit="m", start=0.0, mean=0.0, low=low, high=high, scale=1.0)

    u = prior_samples(FitParameters([normal("a"), normal("b", low=-0.5, high=2.0)]), 200, [3, 1])
    assert u.shape == (200, 2)
    assert sorted(np.floor(200 * norm.cdf(u[:, 0]))) == [*range(200)], (
        "one in each part of equal probability"
    )
    assert np.all((u[:, 1] >= -0.5) & (u[:, 1] <= 2.0))
    inside = (norm.cdf(u[:, 1]) - norm.cdf(-0.5)) / (norm.cdf(2.0) - norm.cdf(-0.5))
    assert sorted(np.floor(200 * inside)) == [*range(200)]
    assert abs(np.corrcoef(u.T)[0, 1]) < 0.2


def test_the_first_search_starts_as_the_parameters_say_and_others_at_the_best_of_their_samples(
    brief, ended, monkeypatch
):
    problem = brief()
    first, *others = ended.searches
    np.testing.assert_array_equal(first.start, problem.parameters.start)
    for i, found in enumerate(others, start=1):
        samples = prior_samples(problem.parameters, SHORT["screened"], [SHORT["seed"], i])
        costs = [problem.evaluate(u, derivatives=False).cost for u in samples]
        np.testing.assert_array_equal(found.start, samples[int(np.argmin(costs))])
        assert found.start_cost == pytest.approx(min(costs), rel=1e-9)
    costs = problem.costs
    monkeypatch.setattr(
        problem,
        "costs",
        lambda points: np.where(
            (points == ended.searches[1].start).all(axis=1), np.inf, costs(points)
        ),
    )
    again = run_searches(problem, resume={"key": problem.key} | json.loads(ended.states[0]))
    assert not np.array_equal(again[1].start, ended.searches[1].start), (
        "a sample at which the walk fails"
    )


@pytest.mark.parametrize("after", [0, 2])
def test_a_fit_resumed_from_a_file_ends_as_if_never_interrupted(brief, ended, after):
    problem, again = brief(), []
    found = run_searches(problem, resume=json.loads(ended.states[after]), checkpoint=again.append)
    same(found, ended.searches)
    assert [json.dumps(state) for state in again] == ended.states[after + 1 :]
    assert (problem.evaluations == 0) == (after == 2), "nothing is left to do"
    fewer = brief(starts=2)
    same(
        run_searches(fewer, resume=json.loads(ended.states[2]) | {"key": fewer.key}),
        ended.searches[:2],
    )


def test_an_interrupted_search_is_begun_anew(brief, ended):
    """The state that was kept is that of the last search that ended."""
    states, told = [], []

    def interrupt(what, share):
        told.append(what)
        if sum(what.startswith("search 2") for what in told) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_searches(
            brief(), progress=interrupt, checkpoint=lambda state: states.append(json.dumps(state))
        )
    assert states == ended.states[:1]


def valleys():
    """A cost with a valley at every whole number of the first parameter, the one at 1 the
    deepest."""
    items = [
        FitParameter(name=name, unit="m", start=start, mean=0.0, low=-4.0, high=4.0, scale=1.0)
        for name, start in (("contact.heel.rise", -0.1), ("offset.height", 0.5))
    ]

    def evaluate(u, *, noise=1.0, **_):
        a, b = u
        fit.evaluations += 1
        residual = np.array([8.0 * np.sin(np.pi * a) / noise, 3.0 * (a - 1.0) / noise, a, b])
        jacobian = np.array(
            [
                [8.0 * np.pi * np.cos(np.pi * a) / noise, 0.0],
                [3.0 / noise, 0.0],
                [1.0, 0.0],
                [0.0, 1.0],
            ]
        )
        return FitEvaluation(residual=residual, jacobian=jacobian, terms=())

    fit = SimpleNamespace(
        parameters=FitParameters(items), joint=ContactFitOptions(), evaluations=0, evaluate=evaluate
    )
    return fit


def test_a_search_hops_from_the_valley_where_it_ended_into_a_deeper_one_beside_it():
    found = search(valleys(), np.array([-0.1, 0.5]))
    assert found.success and found.u[0] == pytest.approx(1.0, abs=0.02)
    assert found.cost == pytest.approx(0.5, rel=0.01), "of the prior alone"
    cost, *there = found.beside[0]
    assert round(there[0]) in (0, 2) and cost > found.cost, (
        "the valley that it hopped over is remembered"
    )
    stays = search(valleys(), np.array([0.1, 0.5]), near=True)
    assert stays.success and stays.u[0] == pytest.approx(0.0, abs=0.02), (
        "no hops where it is to stay near"
    )


def test_a_search_whose_limit_leaves_no_hops_says_so_and_a_resumed_search_hops():
    few = valleys()
    few.joint = ContactFitOptions(iterations=8)
    found = search(few, np.array([-0.1, 0.5]))
    assert (
        found.success and found.cost > 4.0 and "the limit of 8 iterations ended it" in found.message
    )
    resumed = search(valleys(), np.array([0.1, 0.5]), near=True, hops=True)
    assert resumed.success and resumed.cost == pytest.approx(0.5, rel=0.01) and len(resumed.beside)


def test_searches_that_meet_while_the_prior_decides_are_one():
    first = search(valleys(), np.array([-0.1, 0.5]))
    met = search(valleys(), np.array([1.7, -2.0]), others=[first])
    assert met.success and met.cost == first.cost and met.met == 1 and first.met == 0
    np.testing.assert_array_equal(met.u, first.u)
    assert (
        met.start[0] == 1.7
        and met.start_cost > first.start_cost
        and met.evaluations < 0.5 * first.evaluations
    )
    for other in (
        replace(first, smooth=first.smooth + 0.1),
        replace(first, success=False, cost=50.0),
    ):
        alone = search(valleys(), np.array([1.7, -2.0]), others=[other])
        assert alone.met == 0 and alone.cost == pytest.approx(0.5, rel=0.01), "elsewhere, or failed"


def test_state_of_another_problem_or_a_damaged_one_is_refused(
    brief, few_free, ended, soft, stiff, measured_bench
):
    state = json.loads(ended.states[0])
    moved = replace(soft, offsets=GeometricOffsets(height_m=1e-3))
    elsewhere = replace(soft, fulcrum_m=soft.fulcrum_m + 1e-3)
    for other in (
        brief(seed=6),
        brief(step_s=2e-3),
        brief(solver="snopt"),
        brief(trials=[stiff], labels=["low_1"]),
        brief(trials=[moved]),
        brief(trials=[elsewhere]),
        brief(bench=measured_bench),
        brief(labels=["another"]),
        few_free("offset.height", **SHORT),
    ):
        with pytest.raises(InputError, match="other trials, parameters or options") as caught:
            run_searches(other, resume=state)
        assert caught.value.where == "resume"
    row = state["searches"][0]
    for damage in (
        {},
        {"searches": 3},
        {"searches": [{"u": [1.0]}]},
        {"searches": [row | {"start": [0.0]}]},
    ):
        with pytest.raises(InputError, match="no state of such a fit"):
            run_searches(brief(), resume={"key": state["key"]} | damage)


def test_a_start_at_which_the_walk_fails_is_a_search_that_failed_and_is_kept(brief, monkeypatch):
    problem = brief(starts=1)
    with monkeypatch.context() as patch:
        failing(problem, patch, lambda *_: True)
        states = []
        (failed,) = run_searches(
            problem, checkpoint=lambda state: states.append(json.dumps(state, allow_nan=False))
        )
    assert (failed.success, failed.cost, failed.start_cost) == (False, np.inf, np.inf)
    assert "fails where the search starts" in failed.message and "broke" in failed.message
    assert failed.evaluations == failed.failed == 1
    np.testing.assert_array_equal(failed.u, problem.parameters.start)
    same(run_searches(problem, resume=json.loads(states[0])), [failed])


def test_progress_tells_search_lowest_cost_and_the_share_by_the_time_of_those_that_ended(
    ended, fit, monkeypatch
):
    assert list(dict.fromkeys(what.split(",")[0] for what, _ in ended.told)) == [
        f"search {i} of 3" for i in (1, 2, 3)
    ]
    costs = [float(what.rsplit(" ", 1)[1]) for what, _ in ended.told]
    assert costs == sorted(costs, reverse=True) and costs[-1] == round(
        min(s.cost for s in ended.searches), 1
    )
    shares = [share for what, share in ended.told if what.startswith("search 1")]
    assert shares == sorted(shares) and 0.0 < shares[0] and shares[-1] < 1 / 3
    clock, told = SimpleNamespace(now=0.0), []

    def ten_seconds_long(_fit, start, progress, **_):
        for i in range(1, 6):
            clock.now += 2.0
            progress(i, 1.0)
        return made_search()

    monkeypatch.setattr(searches, "time", SimpleNamespace(perf_counter=lambda: clock.now))
    monkeypatch.setattr(searches, "_start", lambda fit, i: fit.parameters.start)
    monkeypatch.setattr(searches, "search", ten_seconds_long)
    searches.run_searches(fit(starts=3), progress=lambda _, share: told.append((clock.now, share)))
    assert [share for _, share in told[5:]] == pytest.approx([now / 30.0 for now, _ in told[5:]])
