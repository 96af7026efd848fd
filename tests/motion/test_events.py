"""Stances are contacts that carry a person, by force or by the feet alone; scuffs and drop-outs are
not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_steps import STANCE_S, TIME, feet, steps
from scipy.signal import find_peaks

from vsf_drake.motion.events import (
    PROMINENCE,
    SHORTEST_S,
    _extremes,
    find_scuffs,
    find_stances,
    kinematic_stances,
    united,
    walking_direction,
)

FORCE_TIME = np.arange(0.0, 2.0, 0.001)


def pulse(start, end, peak=800.0):
    inside = (FORCE_TIME > start) & (FORCE_TIME < end)
    return np.where(inside, peak * np.sin(np.pi * (FORCE_TIME - start) / (end - start)), 0.0)


def test_instants_are_the_crossings_of_the_threshold():
    (stance,) = find_stances(FORCE_TIME, pulse(0.5, 1.2))
    late = 0.7 / np.pi * np.arcsin(20.0 / 800.0)
    assert stance.start_s == pytest.approx(0.5 + late, abs=1e-5)
    assert stance.end_s == pytest.approx(1.2 - late, abs=1e-5)
    assert stance.complete
    assert stance.duration_s == pytest.approx(0.7 - 2 * late, abs=2e-5)


def test_scuff_in_swing_is_not_a_stance():
    force = pulse(0.5, 1.2) + pulse(1.5, 1.58, 60.0)
    assert len(find_stances(FORCE_TIME, force)) == 1
    (scuff,) = find_scuffs(FORCE_TIME, force)
    assert 1.5 < scuff.start_s < scuff.end_s < 1.58
    assert [len(find_stances(FORCE_TIME, pulse(0.5, 1.2, peak))) for peak in (95.0, 105.0)] == [
        0,
        1,
    ]


def test_short_drop_out_does_not_end_a_stance():
    force = pulse(0.5, 1.2)
    force[(FORCE_TIME > 0.8) & (FORCE_TIME < 0.81)] = 0.0
    assert len(find_stances(FORCE_TIME, force)) == 1
    assert len(find_stances(FORCE_TIME, force, bridge_s=0.005)) == 2


def test_spans_less_than_a_bridge_apart_are_one_and_so_are_those_that_touch():
    spans = ((0.0, 1.0), (1.5, 2.0))
    assert united(spans, bridge_s=0.5) == united(spans) == spans
    assert united(spans, bridge_s=0.5 + 1e-9) == ((0.0, 2.0),)
    assert united(((0.0, 1.0), (1.0, 2.0))) == ((0.0, 2.0),)


def test_ends_outside_the_record_are_told():
    first, second = find_stances(FORCE_TIME, pulse(-0.4, 0.4) + pulse(1.6, 2.4))
    assert (first.start_s, first.start_seen, first.end_seen, first.complete) == (
        0.0,
        False,
        True,
        False,
    )
    assert (second.end_s, second.start_seen, second.end_seen, second.complete) == (
        FORCE_TIME[-1],
        True,
        False,
        False,
    )


@pytest.mark.parametrize("rate_hz", [200, 1000, 2000])
@pytest.mark.parametrize(
    ("blank_from_s", "blank_to_s", "start_seen", "end_seen"),
    [(0.0, 0.0005, False, True), (-1.0, 0.3, False, True), (0.5, 3.0, True, False)],
)
def test_force_that_jumps_is_cut_off_and_no_strike_or_lift_off(
    rate_hz, blank_from_s, blank_to_s, start_seen, end_seen
):
    """No foot takes up most of its load from one sample to the next: the force was blanked while
    the foot stood."""
    time = np.arange(0.0, 2.0, 1.0 / rate_hz)
    force = np.interp(time, FORCE_TIME, pulse(-0.2 if blank_to_s < 0.1 else 0.1, 0.9))
    (whole,) = find_stances(time, force)
    force[(time >= blank_from_s) & (time < blank_to_s)] = 0.0
    (stance,) = find_stances(time, force)
    assert (stance.start_seen, stance.end_seen, stance.complete) == (start_seen, end_seen, False)
    assert whole.start_seen == (blank_to_s > 0.1) and whole.end_seen


def wanted(side):
    return [(s, s + STANCE_S) for s, _ in steps(side) if TIME[0] < s + STANCE_S and s < TIME[-1]]


@pytest.mark.parametrize("side", ["right", "left"])
def test_made_steps_are_found(side):
    tracks, pelvis = feet()
    stances = kinematic_stances(TIME, tracks[side], pelvis)
    assert len(stances) == len(wanted(side))
    for stance, (start, end) in zip(stances, wanted(side), strict=True):
        assert stance.start_seen == (start > TIME[0]) and stance.end_seen == (end < TIME[-1])
        assert stance.start_s == pytest.approx(max(start, TIME[0]), abs=0.05)
        assert stance.end_s == pytest.approx(min(end, TIME[-1]), abs=0.05)


def cut(track, rows):
    return dataclasses.replace(
        track, heel_W=track.heel_W[rows], toe_W=track.toe_W[rows], ankle_W=track.ankle_W[rows]
    )


@pytest.mark.parametrize(("beyond_s", "seen"), [(-0.1, False), (0.15, True)])
@pytest.mark.parametrize("backward", [False, True])
def test_an_event_shortly_before_the_record_ends_is_seen(beyond_s, seen, backward):
    """0.15 s after its lift-off a foot is 0.2 m ahead of where it was farthest behind (0.06 s after
    it), not yet 0.3 of its travel; the strike at the other end likewise."""
    tracks, pelvis = feet()
    start, end = wanted("right")[1]
    rows = TIME >= start - beyond_s if backward else TIME <= end + beyond_s
    stances = kinematic_stances(TIME[rows], cut(tracks["right"], rows), pelvis[rows])
    stance = stances[0 if backward else -1]
    assert (stance.start_seen if backward else stance.end_seen) == seen
    if seen:
        assert (stance.start_s, stance.end_s) == pytest.approx((start, end), abs=0.05)


def test_who_halts_and_sways_has_not_lifted_the_foot():
    """The pelvis stops over the standing foot and sways by 2 cm to and fro."""
    tracks, pelvis = feet()
    start, end = wanted("right")[1]
    halt = 0.5 * (start + end)
    pelvis, held = pelvis.copy(), np.maximum(TIME - halt, 0.0)
    pelvis[TIME > halt] = pelvis[np.searchsorted(TIME, halt)]
    pelvis[:, 0] += 0.02 * np.sin(2.0 * np.pi * held)
    standing = {
        side: cut(track, np.where(TIME > halt, np.searchsorted(TIME, halt), np.arange(len(TIME))))
        for side, track in tracks.items()
    }
    assert not kinematic_stances(TIME, standing["right"], pelvis, forward_W=np.array([1.0, 0.0]))[
        -1
    ].end_seen


@pytest.mark.parametrize("heading", [0.5, 2.0, np.pi, -1.5])
def test_direction_of_walking_does_not_matter(heading):
    turn = np.array(
        [[np.cos(heading), -np.sin(heading), 0], [np.sin(heading), np.cos(heading), 0], [0, 0, 1]]
    )
    tracks, pelvis = feet()
    turned = dataclasses.replace(
        tracks["right"],
        heel_W=tracks["right"].heel_W @ turn.T,
        toe_W=tracks["right"].toe_W @ turn.T,
    )
    assert np.allclose(
        walking_direction({"": turned}, pelvis @ turn.T), [np.cos(heading), np.sin(heading)]
    )
    for one, other in zip(
        kinematic_stances(TIME, turned, pelvis @ turn.T),
        kinematic_stances(TIME, tracks["right"], pelvis),
        strict=True,
    ):
        assert (one.start_s, one.end_s) == pytest.approx((other.start_s, other.end_s), abs=1e-9)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("level", [False, True])
def test_extremes_are_the_peaks_that_scipy_finds(seed, level):
    """Of ripples on a slow wave, also where three samples in a row are level."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(500) / 100.0
    values = np.sin(6.0 * time_s) + 0.2 * rng.normal(size=len(time_s))
    values = np.repeat(values, 3)[: len(time_s)] if level else values
    peaks, _ = find_peaks(
        values, prominence=PROMINENCE * np.ptp(values), distance=round(100 * SHORTEST_S)
    )
    assert len(peaks) > 1 and _extremes(values, time_s) == list(time_s[peaks])
