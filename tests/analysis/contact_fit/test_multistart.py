"""Several searches: their starts come from the seed alone, and an interrupted fit goes on as it would have."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from vsf_drake.analysis.contact_fit.parameters import FitParameter, FitParameters
from vsf_drake.analysis.contact_fit.solve import prior_samples, run_searches
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.motion.manifest import GeometricOffsets

FREE = ("contact.forefoot.force", "offset.height")
SHORT = {"starts": 3, "screened": 2, "iterations": 4, "seed": 5, "step_s": 4e-3}


@pytest.fixture
def fit(few_free):
    def make(**options):
        return few_free(*FREE, **(SHORT | options))

    return make


@pytest.fixture(scope="module")
def whole():
    return {}


@pytest.fixture
def ended(fit, whole):
    """The short fit, run once: its searches, and its state after each as it would stand in a file."""
    if not whole:
        states = []
        whole["searches"] = run_searches(fit(), checkpoint=lambda state: states.append(json.dumps(state)))
        whole["states"] = states
    return whole


def same(found, wanted):
    assert len(found) == len(wanted)
    for a, b in zip(found, wanted, strict=True):
        for name in ("start", "u"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        for name in ("start_cost", "cost", "success", "message", "evaluations", "failed"):
            assert getattr(a, name) == getattr(b, name), name


def normal(name, low=-10.0, high=10.0):
    return FitParameter(name=name, unit="m", start=0.0, mean=0.0, low=low, high=high, scale=1.0)


def test_samples_are_stratified_and_follow_the_prior_within_the_bounds():
    parameters = FitParameters([normal("a"), normal("b", low=-0.5, high=2.0)])
    u = prior_samples(parameters, 200, [3, 1])
    assert u.shape == (200, 2)
    share = norm.cdf(u[:, 0])
    assert sorted(np.floor(200 * share)) == list(range(200)), "one in each of 200 parts of equal probability"
    assert np.all((u[:, 1] >= -0.5) & (u[:, 1] <= 2.0))
    inside = (norm.cdf(u[:, 1]) - norm.cdf(-0.5)) / (norm.cdf(2.0) - norm.cdf(-0.5))
    assert sorted(np.floor(200 * inside)) == list(range(200))
    assert u[:, 0].std() == pytest.approx(1.0, abs=0.02) and u[:, 0].mean() == pytest.approx(0.0, abs=0.01)
    assert abs(np.corrcoef(u.T)[0, 1]) < 0.2


def test_the_first_search_starts_as_the_parameters_say_and_others_at_the_best_of_their_samples(fit, ended):
    problem = fit()
    first, *others = ended["searches"]
    np.testing.assert_array_equal(first.start, problem.parameters.start)
    for i, found in enumerate(others, start=1):
        samples = prior_samples(problem.parameters, SHORT["screened"], [SHORT["seed"], i])
        costs = [problem.evaluate(u, derivatives=False).cost for u in samples]
        np.testing.assert_array_equal(found.start, samples[int(np.argmin(costs))])
        assert found.start_cost == pytest.approx(min(costs), rel=1e-9)


def test_a_seed_repeats_a_fit_to_the_last_bit(fit, ended):
    same(run_searches(fit()), ended["searches"])


@pytest.mark.parametrize("after", [0, 1, 2])
def test_a_fit_resumed_from_a_file_ends_as_if_never_interrupted(fit, ended, after):
    problem, again = fit(), []
    found = run_searches(problem, resume=json.loads(ended["states"][after]), checkpoint=again.append)
    same(found, ended["searches"])
    assert [json.dumps(state) for state in again] == ended["states"][after + 1:]
    if after == SHORT["starts"] - 1:
        assert problem.evaluations == 0, "nothing is left to do"


def test_an_interrupted_search_is_begun_anew(fit, ended):
    """The state that was kept is that of the last search that ended."""
    states, told = [], []

    def interrupt(what, share):
        told.append(what)
        if sum(what.startswith("search 2") for what in told) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_searches(fit(), progress=interrupt, checkpoint=lambda state: states.append(json.dumps(state)))
    assert states == ended["states"][:1]
    same(run_searches(fit(), resume=json.loads(states[-1])), ended["searches"])


def test_fewer_starts_than_were_done_take_the_first_of_them(fit, ended):
    state = json.loads(ended["states"][2])
    state["key"] = fit(starts=2).key
    same(run_searches(fit(starts=2), resume=state), ended["searches"][:2])


def test_state_of_another_problem_is_refused(fit, few_free, ended, soft, stiff, measured_bench):
    state = json.loads(ended["states"][0])
    moved = replace(soft, offsets=GeometricOffsets(height_m=1e-3))
    elsewhere = replace(soft, fulcrum_m=soft.fulcrum_m + 1e-3)
    others = [fit(seed=6), fit(step_s=2e-3), fit(solver="snopt"), fit(trials=[stiff], labels=["low_1"]),
              fit(trials=[moved]), fit(trials=[elsewhere]), fit(bench=measured_bench), fit(labels=["another"]),
              few_free("offset.height", **SHORT)]
    for other in others:
        with pytest.raises(InputError, match="other trials, parameters or options") as caught:
            run_searches(other, resume=state)
        assert caught.value.where == "resume"


@pytest.mark.parametrize("damage", [
    {}, {"searches": 3}, {"searches": [{"u": [1.0]}]},
    {"searches": [{"start": [0.0], "u": [0.0, 1.0], "start_cost": 1.0, "cost": 1.0, "success": True, "message": "",
                   "evaluations": 1, "failed": 0}]}])
def test_a_damaged_state_is_refused(fit, damage):
    with pytest.raises(InputError, match="no state of such a fit"):
        run_searches(fit(), resume={"key": fit().key} | damage)


def test_a_search_whose_start_fails_is_kept_in_the_state(fit, monkeypatch, ended):
    problem = fit(starts=1)

    def broken(*_, **__):
        raise SimulationError("broke", time_s=0.1)

    evaluate = problem.evaluate
    monkeypatch.setattr(problem, "evaluate", broken)
    states = []
    failed, = run_searches(problem, checkpoint=lambda state: states.append(json.dumps(state, allow_nan=False)))
    assert failed.cost == np.inf and not failed.success
    monkeypatch.setattr(problem, "evaluate", evaluate)
    same(run_searches(problem, resume=json.loads(states[0])), [failed])


def test_samples_at_which_the_walk_fails_are_not_started_from(fit, monkeypatch):
    problem = fit(starts=2)
    samples = prior_samples(problem.parameters, SHORT["screened"], [SHORT["seed"], 1])
    evaluate = problem.evaluate
    best = min(samples, key=lambda u: evaluate(u, derivatives=False).cost)

    def without_best(u, *, derivatives=True):
        if np.array_equal(u, best):
            raise SimulationError("broke", time_s=0.1)
        return evaluate(u, derivatives=derivatives)

    monkeypatch.setattr(problem, "evaluate", without_best)
    _, second = run_searches(problem)
    assert not np.array_equal(second.start, best)
    assert any(np.array_equal(second.start, u) for u in samples)


def test_progress_tells_search_lowest_cost_and_share(fit, ended):
    told = []
    found = run_searches(fit(), progress=lambda *what: told.append(what))
    assert list(dict.fromkeys(what.split(",")[0] for what, _ in told)) == [f"search {i} of 3" for i in (1, 2, 3)]
    costs = [float(what.rsplit(" ", 1)[1]) for what, _ in told]
    assert costs == sorted(costs, reverse=True)
    assert told[-1][0] == f"search 3 of 3, best cost {min(s.cost for s in found):.1f}"
    shares = [share for what, share in told if what.startswith("search 1")]
    assert shares == sorted(shares) and 0.0 < shares[0] and shares[-1] < 1 / 3
    assert all(0.0 <= share <= 1.0 for _, share in told)
