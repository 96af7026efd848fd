"""Stances are contacts that carry a person; scuffs and drop-outs are not."""

import numpy as np
import pytest

from vsf_drake.motion.events import find_scuffs, find_stances
from vsf_drake.motion.formats.tables import read_storage

TIME = np.arange(0.0, 2.0, 0.001)


def pulse(start, end, peak=800.0):
    inside = (TIME > start) & (TIME < end)
    return np.where(inside, peak * np.sin(np.pi * (TIME - start) / (end - start)), 0.0)


def test_instants_are_the_crossings_of_the_threshold():
    (stance,) = find_stances(TIME, pulse(0.5, 1.2))
    late = 0.7 / np.pi * np.arcsin(20.0 / 800.0)
    assert stance.start_s == pytest.approx(0.5 + late, abs=1e-5)
    assert stance.end_s == pytest.approx(1.2 - late, abs=1e-5)
    assert stance.complete
    assert stance.duration_s == pytest.approx(0.7 - 2 * late, abs=2e-5)


def test_light_loads_that_a_laboratory_has_blanked_below_50_n_are_no_jump():
    """As of a child, or in a harness: the first force that is left is 50 N, which is much of the peak."""
    force = pulse(0.5, 1.2, 130.0)
    (stance,) = find_stances(TIME, np.where(force < 50.0, 0.0, force))
    assert stance.complete


def test_scuff_in_swing_is_not_a_stance():
    force = pulse(0.5, 1.2) + pulse(1.5, 1.58, 60.0)
    assert len(find_stances(TIME, force)) == 1
    (scuff,) = find_scuffs(TIME, force)
    assert 1.5 < scuff.start_s < scuff.end_s < 1.58


def test_long_but_light_touch_is_not_a_stance():
    assert find_stances(TIME, pulse(0.5, 1.2, 60.0)) == []


def test_short_drop_out_does_not_end_a_stance():
    force = pulse(0.5, 1.2)
    force[(TIME > 0.8) & (TIME < 0.81)] = 0.0
    assert len(find_stances(TIME, force)) == 1
    assert len(find_stances(TIME, force, bridge_s=0.005)) == 2


def test_noise_around_the_threshold_gives_one_stance():
    force = pulse(0.5, 1.2) + np.random.default_rng(0).normal(scale=8.0, size=len(TIME))
    assert len(find_stances(TIME, force)) == 1


def test_ends_outside_the_record_are_told():
    first, second = find_stances(TIME, pulse(-0.4, 0.4) + pulse(1.6, 2.4))
    assert (first.start_s, first.start_seen, first.end_seen, first.complete) == (0.0, False, True, False)
    assert (second.end_s, second.start_seen, second.end_seen, second.complete) == (TIME[-1], True, False, False)


@pytest.mark.parametrize("rate_hz", [200, 1000, 2000])
@pytest.mark.parametrize(("blank_from_s", "blank_to_s", "start_seen", "end_seen"), [
    (0.0, 0.0005, False, True), (-1.0, 0.3, False, True), (0.5, 3.0, True, False)])
def test_force_that_jumps_is_cut_off_and_no_strike_or_lift_off(rate_hz, blank_from_s, blank_to_s, start_seen, end_seen):
    """No foot takes up most of its load from one sample to the next: the force was blanked while the foot stood."""
    time = np.arange(0.0, 2.0, 1.0 / rate_hz)
    force = np.interp(time, TIME, pulse(-0.2 if blank_to_s < 0.1 else 0.1, 0.9))
    (whole,) = find_stances(time, force)
    force[(time >= blank_from_s) & (time < blank_to_s)] = 0.0
    (stance,) = find_stances(time, force)
    assert (stance.start_seen, stance.end_seen, stance.complete) == (start_seen, end_seen, False)
    assert whole.start_seen == (blank_to_s > 0.1) and whole.end_seen


def test_forces_switched_off_in_mid_stance_leave_two_cut_stances():
    force = pulse(0.5, 1.2)
    force[(TIME > 0.75) & (TIME < 0.85)] = 0.0
    assert [(s.start_seen, s.end_seen) for s in find_stances(TIME, force)] == [(True, False), (False, True)]


@pytest.mark.parametrize("before_s", [0.02, 0.05])
def test_strike_that_the_record_ends_upon_is_a_strike(before_s):
    """Steepest loading that was recorded: 27 body weights a second over 5 ms."""
    ramp = np.clip(27.0 * 800.0 * (TIME - 2.0 + before_s), 0.0, 800.0) + pulse(0.5, 1.2)
    last = find_stances(TIME, ramp)[-1]
    assert last.start_seen and not last.end_seen


def test_spike_of_one_sample_is_no_stance():
    force = pulse(0.5, 1.2)
    force[1600] = 900.0
    assert len(find_stances(TIME, force)) == 1


def test_foot_that_never_leaves_the_plate():
    (stance,) = find_stances(TIME, np.full(len(TIME), 400.0))
    assert (stance.start_s, stance.end_s) == (TIME[0], TIME[-1])
    assert not stance.start_seen and not stance.end_seen


def test_unloaded_plate_has_no_stance():
    assert find_stances(TIME, np.zeros(len(TIME))) == []
    assert find_stances(np.array([]), np.array([])) == []


def test_bad_arrays_are_refused():
    with pytest.raises(ValueError, match="both"):
        find_stances(TIME, TIME[1:])
    with pytest.raises(ValueError, match="finite"):
        find_stances(TIME, np.full(len(TIME), np.nan))


def test_real_stances(shared_data):
    """Right foot of OpenSim's example3DWalking: two stances, both inside the force record."""
    storage = read_storage(shared_data / "opensim_core" / "example3DWalking" / "grf_walk.mot")
    stances = find_stances(storage.time_s, storage.column("ground_force_r_vy"))
    assert [(round(s.start_s, 3), round(s.end_s, 3)) for s in stances] == [(0.267, 1.024), (1.411, 2.168)]
    assert all(s.complete for s in stances)
