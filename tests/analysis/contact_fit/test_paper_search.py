"""The paper's search, its parameters and its Latin hypercube, on an objective that costs nothing."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from vsf_drake.analysis.contact_fit.options import PaperOptions
from vsf_drake.analysis.contact_fit.paper import (
    FRICTION,
    PaperSpace,
    PaperState,
    Score,
    iterate,
    paper_space,
    read_state,
    verdict,
)
from vsf_drake.analysis.contact_fit.parameters import zones_of
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.laws.kelvin_voigt import normal_force
from vsf_drake.motion.trial import default_model
from vsf_drake.parameters import Subject
from vsf_drake.simulation.walk import Walker

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


LAW = ("stiffness", "exponent", "damping", "full_damping_depth")


@pytest.fixture(scope="module")
def variables():
    return Walker(Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right"), default_model()).variables


def test_initial_guess_is_the_papers(variables):
    """n = 1, full damping at 1 mm, b in N s/mm half of k in N/mm, one stiffness for all five zones."""
    space = paper_space(variables, 3.0, PaperOptions())
    assert len(zones_of(variables)) == 5
    assert space.names == tuple(f"contact.{zone}.{name}" for zone in zones_of(variables) for name in LAW)
    values = space.values(space.start)
    for zone in zones_of(variables):
        assert [values[f"contact.{zone}.{name}"] for name in LAW] == pytest.approx([3e3, 1.0, 1.5e3, 1e-3])


def test_sphere_a_millimetre_deep_carries_its_stiffness_whatever_the_exponent(variables):
    """Stiffness in N/mm^n; damping in N s/mm, in full at the full-damping depth."""
    space = paper_space(variables, 3.0, PaperOptions())
    for exponent in (1.0, 1.5, 2.0):
        x = np.tile([4.0, exponent, 2.5, 0.8], 5)
        values = space.values(x)
        own = {name: values[f"contact.midfoot.{name}"] for name in LAW}
        assert normal_force(1e-3, 0.0, **own) == pytest.approx(4.0)
        assert normal_force(1e-3, 1e-3, **own) == pytest.approx(4.0 + 2.5)
        assert normal_force(0.8e-3, 1e-3, **own) == pytest.approx(4.0 * 0.8**exponent + 2.5)


def test_friction_is_varied_only_if_asked_for(variables):
    assert not set(FRICTION) & set(paper_space(variables, 3.0, PaperOptions()).names)
    space = paper_space(variables, 3.0, PaperOptions(friction=True))
    values = space.values(space.start)
    assert [values[name] for name in FRICTION] == [0.5, 0.3, 0.1]


@pytest.mark.parametrize("wrong", [
    {"exponents": (1.1, 2.0)}, {"exponents": (0.5, 2.0)}, {"exponents": (2.0, 1.0)}, {"full_damping_mm": (2.0, 5.0)},
    {"full_damping_mm": (0.0, 5.0)}, {"full_damping_mm": (0.2, 500.0)}, {"fold": 1e30}])
def test_bounds_that_leave_out_the_initial_guess_or_the_models_range_are_refused(variables, wrong):
    with pytest.raises(InputError):
        paper_space(variables, 3.0, PaperOptions(**wrong))


def two_parameters(start, low, high):
    return PaperSpace(names=("friction.mu_static", "friction.mu_kinetic"), start=np.array(start), low=np.array(low),
                      high=np.array(high))


@given(st.integers(1, 60), st.floats(0.01, 5.0), st.integers(0, 1000), st.floats(0.0, 1.0))
@settings(deadline=None, max_examples=60)
def test_each_slice_of_equal_probability_is_met_once(count, spread, seed, place):
    """The probability of what is drawn, from the definition of the normal distribution cut off at the bounds."""
    low, high = np.array([1.0, 0.2]), np.array([2.0, 30.0])
    space = two_parameters(low, low, high)
    centre = low + place * (high - low)
    drawn = space.sample(centre, count=count, spread=spread, random=np.random.default_rng(seed))
    assert drawn.shape == (count, 2)
    assert np.all((drawn >= low) & (drawn <= high))
    below, above, at = (norm.cdf((end - centre) / (spread * centre)) for end in (low, high, drawn))
    share = (at - below) / (above - below)
    if np.all(above - below > 1e-6):
        slices = np.clip(np.floor(share * count), 0, count - 1)
        edge = np.abs(share * count - np.round(share * count)) < 1e-6
        if not edge.any():
            assert np.array_equal(np.sort(slices, axis=0), np.tile(np.arange(count)[:, None], 2))


def test_columns_are_drawn_independently():
    """The correlation of 4000 independent pairs is below 4 / sqrt(4000)."""
    space = two_parameters([1.0, 1.0], [0.5, 0.5], [1.5, 1.5])
    drawn = space.sample(space.start, count=4000, spread=0.2, random=np.random.default_rng(3))
    assert abs(np.corrcoef(drawn.T)[0, 1]) < 4 / np.sqrt(4000)
    assert drawn.mean(axis=0) == pytest.approx([1.0, 1.0], abs=1e-3)


def test_change_is_the_largest_over_the_distance_of_bounds():
    space = two_parameters([1.0, 1.0], [0.0, 0.0], [2.0, 10.0])
    assert space.change(np.array([1.0, 1.0]), np.array([1.2, 3.0])) == pytest.approx(0.2)
    assert space.change(np.array([1.0, 1.0]), np.array([0.8, 0.9])) == pytest.approx(0.1)
