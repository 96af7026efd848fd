"""Walks stay sound whatever parameters a search may try, over the whole of their bounds."""

from __future__ import annotations

from functools import cache

import pytest
from drawn_walks import draws, outcomes, reach

from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.stepping.newton import MAX_ITERATIONS
from vsf_drake.simulation.walk import Walker

MOST_UNCONVERGED = 0.005
"""Share of the steps that may stay unconverged, which is what was promised."""
MOST_FAILED = 0.05
"""Share of the walks that may end in an error (a choice): a search can do without these."""


@cache
def reference_walk(setting):
    """(walker, trajectory, span) of an embedded trial: setting 0 soft, 1 medium, 2 stiff."""
    trial = load_trial(embedded_trials("exact")[3 * setting])
    span = {"fulcrum_m": trial.fulcrum_m, "start_s": trial.start_s, "end_s": trial.end_s}
    return Walker(trial.subject, trial.model), trial.trajectory, span


def drawn(setting, count, *, seed, step_s, **bounds):
    """Outcomes of `count` walks of an embedded trial."""
    walker, trajectory, span = reference_walk(setting)
    sets = draws(walker.variables, count, seed=seed, bounds=reach(walker, span["fulcrum_m"]) | bounds)
    return outcomes(walker, trajectory, sets, step_s=step_s, **span)


def assert_sound(found):
    """None NaN, none without end, hardly a step unconverged; what fails left the model's range and did not diverge."""
    walked = [one for one in found if one.failure is None]
    assert all(one.finite for one in walked)
    assert all(one.iterations <= MAX_ITERATIONS * one.steps for one in walked)
    assert sum(len(one.unconverged) for one in walked) < MOST_UNCONVERGED * sum(one.steps for one in walked)
    assert len(walked) > 0.5 * len(found)
    for one in found:
        if one.failure is not None:
            assert "beyond the" in one.failure, f"{one.failure} at {one.failed_s} s with {one.values}"


@pytest.mark.parametrize("setting", [0, 1, 2])
def test_walks_stay_sound_with_any_parameters(setting):
    assert_sound(drawn(setting, 12, seed=setting, step_s=2e-3))


@pytest.mark.parametrize("side", ["right", "left"])
def test_walks_on_either_foot_stay_sound_with_any_parameters(walker, motion, side):
    person = walker(side)
    sets = draws(person.variables, 12, seed=3, bounds=reach(person, 0.108))
    assert_sound(outcomes(person, motion(side), sets, fulcrum_m=0.108, start_s=0.0, end_s=0.94, step_s=2e-3))


def test_a_foot_far_above_or_within_the_ground_stays_sound():
    found = drawn(0, 20, seed=4, step_s=2e-3, **{"offset.height": (-0.1, 0.1)})
    assert_sound(found)
    peaks = [one.peak_bw for one in found if one.failure is None]
    assert min(peaks) == 0.0
    assert max(peaks) > 5.0


def test_steps_that_would_not_converge_are_cut_and_counted():
    """Where friction falls from static to kinetic at once, a whole step may find no end; its parts do."""
    walker, trajectory, span = reference_walk(0)
    sets = draws(walker.variables, 500, seed=1, bounds=reach(walker, span["fulcrum_m"]))
    (one,) = outcomes(walker, trajectory, [sets[75]], **span)
    assert one.values["friction.mu_static"] > 10.0 * one.values["friction.mu_kinetic"]
    assert len(one.cut) > 0
    assert one.unconverged == ()


def test_a_toe_that_catches_in_swing_ends_the_walk_at_the_same_time_in_any_step():
    """Held 30 mm too low and toes down over grippy ground, the driven leg drags the keel under the foot: that is the
    model's doing and not the stepper's, so that smaller steps end it as well, first order in the step."""
    walker, trajectory, span = reference_walk(0)
    values = {"offset.height": -0.03, "offset.alignment": -0.25, "friction.mu_static": 1.0, "friction.mu_kinetic": 1.0,
              "fulcrum.stiffness": 0.1 * walker.variables["fulcrum.stiffness"].default}
    ends = []
    for step_s in (2e-3, 1e-3, 2.5e-4):
        (caught,) = outcomes(walker, trajectory, [values], step_s=step_s, **span)
        assert caught.failure is not None
        assert caught.failure.startswith("coordinate keel_")
        ends.append(caught.failed_s)
    assert span["start_s"] < ends[-1] < span["end_s"]
    assert abs(ends[1] - ends[2]) <= 4e-3
    assert abs(ends[0] - ends[2]) <= 8e-3


@pytest.mark.slow
@pytest.mark.parametrize(("setting", "count", "step_s"), [(0, 500, 1e-3), (1, 200, 2e-3), (2, 200, 2e-3)])
def test_hundreds_of_walks_stay_sound_with_any_parameters(setting, count, step_s):
    found = drawn(setting, count, seed=1, step_s=step_s)
    assert_sound(found)
    assert sum(one.failure is not None for one in found) <= MOST_FAILED * len(found)
