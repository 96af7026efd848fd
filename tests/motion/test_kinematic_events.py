"""Strikes and lifts told by the feet alone agree with those told by force."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_steps import STANCE_S, TIME, feet, steps

from vsf_drake.motion.events import kinematic_stances, walking_direction


def wanted(side):
    return [(s, s + STANCE_S) for s, _ in steps(side) if TIME[0] < s + STANCE_S and s < TIME[-1]]


@pytest.mark.parametrize("side", ["right", "left"])
def test_made_steps_are_found(side):
    tracks, pelvis = feet()
    found = kinematic_stances(TIME, tracks[side], pelvis)
    assert len(found) == len(wanted(side))
    for stance, (start, end) in zip(found, wanted(side), strict=True):
        assert stance.start_seen == (start > TIME[0]) and stance.end_seen == (end < TIME[-1])
        assert stance.start_s == pytest.approx(max(start, TIME[0]), abs=0.05)
        assert stance.end_s == pytest.approx(min(end, TIME[-1]), abs=0.05)


@pytest.mark.parametrize("heading", [0.5, 2.0, np.pi, -1.5])
def test_direction_of_walking_does_not_matter(heading):
    turn = np.array([[np.cos(heading), -np.sin(heading), 0], [np.sin(heading), np.cos(heading), 0], [0, 0, 1]])
    tracks, pelvis = feet()
    turned = dataclasses.replace(tracks["right"], heel_W=tracks["right"].heel_W @ turn.T,
                                 toe_W=tracks["right"].toe_W @ turn.T)
    assert np.allclose(walking_direction({"": turned}, pelvis @ turn.T), [np.cos(heading), np.sin(heading)])
    for one, other in zip(kinematic_stances(TIME, turned, pelvis @ turn.T),
                          kinematic_stances(TIME, tracks["right"], pelvis), strict=True):
        assert (one.start_s, one.end_s) == pytest.approx((other.start_s, other.end_s), abs=1e-9)


def test_treadmill_gives_the_same_events():
    """The same walk seen from a laboratory in which the floor runs backward."""
    tracks, pelvis = feet()
    drift = np.column_stack([1.18 * TIME, 0 * TIME, 0 * TIME])
    carried = dataclasses.replace(tracks["left"], heel_W=tracks["left"].heel_W - drift,
                                  toe_W=tracks["left"].toe_W - drift)
    for one, other in zip(kinematic_stances(TIME, carried, pelvis - drift, forward_W=np.array([1.0, 0.0])),
                          kinematic_stances(TIME, tracks["left"], pelvis), strict=True):
        assert (one.start_s, one.end_s) == pytest.approx((other.start_s, other.end_s), abs=1e-6)


def test_person_who_stands_has_one_stance_that_never_ends():
    tracks, _ = feet()
    still = dataclasses.replace(tracks["right"], heel_W=np.tile([0.0, 0.1, 0.0], (len(TIME), 1)),
                                toe_W=np.tile([0.25, 0.1, 0.0], (len(TIME), 1)))
    (stance,) = kinematic_stances(TIME, still, np.tile([0.1, 0.0, 0.9], (len(TIME), 1)))
    assert not stance.start_seen and not stance.end_seen and stance.duration_s == pytest.approx(TIME[-1])
