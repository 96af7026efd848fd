"""Walks stay sound whatever parameters a search may try, over the whole of their bounds."""

from __future__ import annotations

import pytest
from drawn_walks import assert_sound, drawn, draws, outcomes, reach, reference_walk

MOST_FAILED = 0.05
"""Share of the walks that may end in an error (a choice): a search can do without these."""


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
