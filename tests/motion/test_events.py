"""Stances are contacts that carry a person; scuffs and drop-outs are not."""

import numpy as np
import pytest

from vsf_drake.motion.events import find_scuffs, find_stances
from vsf_drake.motion.storage import read_storage

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
