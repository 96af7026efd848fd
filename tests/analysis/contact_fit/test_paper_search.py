"""The search of the paper's contact fit, on an objective that costs nothing: the distance from a point."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest

from vsf_drake.analysis.contact_fit.options import PaperOptions
from vsf_drake.analysis.contact_fit.paper import (
    FRICTION,
    PaperSpace,
    PaperState,
    Score,
    iterate,
    read_state,
    verdict,
)
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.schema import to_plain

SPACE = PaperSpace(names=FRICTION, start=np.array([0.5, 0.3, 0.1]), low=np.array([0.1, 0.1, 0.02]),
                   high=np.array([1.5, 1.0, 0.5]))
TRUTH = np.array([0.9, 0.5, 0.05])
INSTANTS = 50


def distance(values):
    return Score(INSTANTS * 1e6 * float(np.sum((np.array([values[name] for name in FRICTION]) - TRUTH) ** 2)), 1)


def begin():
    first = distance(dict(zip(FRICTION, SPACE.start, strict=True))).objective_n2
    return PaperState(stiffness=1.0, initial_objective_n2=first, objective_n2=first, best=tuple(SPACE.start),
                       instants=INSTANTS, simulations=1, failed_simulations=0, wall_s=0.0)


def all_of(one):
    return lambda scenarios: [one(values) for values in scenarios]


def search(options, state=None, score=None, after=lambda state: None):
    state, score = state or begin(), score or all_of(distance)
    while (end := verdict(state, options)) is None:
        state = iterate(state, SPACE, score, options)
        after(state)
    return state, *end


def test_the_best_scenario_is_carried_on_and_never_lost():
    seen = []

    def noted(scenarios):
        found = all_of(distance)(scenarios)
        seen.append((scenarios, [item.objective_n2 for item in found]))
        return found

    state, *_ = search(PaperOptions(scenarios=20, settled=3), score=noted)
    best, point = state.initial_objective_n2, SPACE.start
    assert len(seen) == len(state.history)
    for (scenarios, objectives), (_, objective, change) in zip(seen, state.history, strict=True):
        before = point
        if min(objectives) < best:
            best = min(objectives)
            point = np.array([scenarios[objectives.index(best)][name] for name in FRICTION])
        assert objective == best
        assert change == pytest.approx(np.max(np.abs(point - before) / (SPACE.high - SPACE.low)))
    assert state.objective_n2 == best
    assert state.best == tuple(point)
    assert state.objective_n2 < 0.01 * state.initial_objective_n2
    assert state.simulations == 1 + 20 * len(state.history)


def test_scenarios_are_drawn_round_the_best():
    """After 30 iterations without an end, the mean of what is drawn is nearer to the best than to the start."""
    drawn = []

    def noted(scenarios):
        drawn.append(np.mean([[values[name] for name in FRICTION] for values in scenarios], axis=0))
        return all_of(distance)(scenarios)

    state, *_ = search(PaperOptions(scenarios=30, settled=30, iterations=30, restarts=0), score=noted)
    assert drawn[0] == pytest.approx(SPACE.start, rel=0.05)
    assert drawn[-1] == pytest.approx(state.best, rel=0.05)


def test_same_seed_same_search_other_seed_another():
    first, again, other = (search(PaperOptions(scenarios=10, seed=seed))[0] for seed in (4, 4, 5))
    assert first == again
    assert first.best != other.best


def test_search_resumed_after_any_iteration_ends_as_if_never_interrupted():
    """Through JSON, bit for bit."""
    kept = []
    options = PaperOptions(scenarios=10, settled=2)
    whole = search(options, after=lambda state: kept.append(json.dumps(dataclasses.asdict(state))))
    assert len(kept) > 3
    for text in kept:
        assert search(options, state=read_state(json.loads(text))) == whole


def history(*entries, **fields):
    """A state after iterations with these root mean squares (N) and changes, from 100 N."""
    state = dataclasses.replace(begin(), initial_objective_n2=INSTANTS * 100.0**2)
    rows = tuple((i, INSTANTS * rms**2, change) for i, (rms, change) in enumerate(entries, start=1))
    return dataclasses.replace(state, history=rows, objective_n2=rows[-1][1] if rows else 1.0, **fields)


def test_search_ends_when_objective_and_parameters_change_less_than_their_tolerances():
    """0.1 N of root mean square and 0.001 of the bounds; both, not one of them."""
    options = PaperOptions()
    assert verdict(history(), options) is None
    assert verdict(history((99.95, 2e-3)), options) is None
    assert verdict(history((99.85, 0.5e-3)), options) is None
    converged, words = verdict(history((99.95, 0.5e-3)), options)
    assert converged and "0.1 N" in words and "0.001" in words


def test_an_iteration_that_finds_nothing_better_ends_the_search():
    worse = all_of(lambda values: Score(1e12, 1))
    state, converged, words = search(PaperOptions(scenarios=5), score=worse)
    assert converged and "iteration 1" in words
    assert state.best == tuple(SPACE.start)
    assert state.history == ((1, state.initial_objective_n2, 0.0),)


def test_settled_asks_for_as_many_iterations_in_a_row():
    options = PaperOptions(settled=2)
    still, moved = (50.0, 0.0), (40.0, 0.1)
    assert verdict(history((50.0, 0.1), still), options) is None
    assert verdict(history((50.0, 0.1), still, moved), options) is None
    assert verdict(history((50.0, 0.1), still, still), options)[0]


def test_search_that_does_not_converge_is_restarted_as_often_as_allowed_and_says_so():
    options = PaperOptions(iterations=3, restarts=2)
    falling = [(100.0 - i, 0.1) for i in range(1, 10)]
    for done in range(9):
        assert verdict(history(*falling[:done]), options) is None
    converged, words = verdict(history(*falling), options)
    assert not converged and "not converged" in words
    after = verdict(history(*falling[:4], (96.0, 0.0)), options)
    assert after[0] and "after 1 restarts" in after[1]
    assert not verdict(history(*falling[:3]), PaperOptions(iterations=3, restarts=0))[0]


def test_scenario_that_fails_loses_and_is_counted():
    def fragile(values):
        found = distance(values)
        return Score(math.inf, 1, SimulationError("broke", time_s=0.1)) if values[FRICTION[0]] > 0.5 else found

    state, *_ = search(PaperOptions(scenarios=10), score=all_of(fragile))
    assert state.failed_simulations > 0
    assert state.best[0] <= 0.5
    assert np.isfinite(state.objective_n2)


def test_iteration_in_which_every_scenario_fails_is_a_failed_fit():
    broken = all_of(lambda values: Score(math.inf, 1, SimulationError("broke", time_s=0.1)))
    with pytest.raises(SimulationError, match="broke"):
        iterate(begin(), SPACE, broken, PaperOptions(scenarios=3))


@pytest.mark.parametrize("wrong", [
    {"scenarios": 0}, {"scenarios": 2.5}, {"scenarios": True}, {"iterations": 0}, {"restarts": -1}, {"seed": -1},
    {"workers": 0}, {"settled": 0}, {"spread": 0.0}, {"spread": math.nan}, {"fold": 1.0}, {"step_s": "2 ms"},
    {"objective_tolerance_n": 0.0}, {"parameter_tolerance": -1e-3}, {"exponents": (2.0, 1.0)}, {"friction": "no"}])
def test_options_out_of_range_are_refused_by_name(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        PaperOptions(**wrong)


def test_options_may_be_numbers_of_numpy():
    options = PaperOptions(scenarios=np.int64(5), spread=np.float32(0.5), exponents=[1, 2])
    assert json.loads(json.dumps(to_plain(options)))["scenarios"] == 5
