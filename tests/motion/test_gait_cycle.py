"""The gait cycle's phase, and periodic curves over it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsf_drake.errors import InputError
from vsf_drake.files import resource
from vsf_drake.motion.events import Stance, find_stances
from vsf_drake.motion.fitted_trial import STANCE_SHARE, gait_phase
from vsf_drake.motion.trajectory import periodic_bsplines
from vsf_drake.motion.trial import load_trial

STANCES = (Stance(0.3, 1.0), Stance(1.5, 2.25), Stance(2.65, 3.42))
SPLINES = 8


def events(stances):
    return np.array([(stance.start_s, stance.end_s) for stance in stances]).ravel()


def derivatives_jump(function, times):
    """Largest steps of value, rate (1/s) and acceleration (1/s^2) across each of `times`, from one-sided cubics."""
    h, jumps = 2e-3, np.zeros(3)
    for time in times:
        sides = []
        for sign in (-1.0, 1.0):
            steps = sign * h * np.arange(6)
            cubic = np.polynomial.Polynomial.fit(steps, function(time + steps), 5).convert()
            sides.append([cubic(0.0), cubic.deriv(1)(0.0), cubic.deriv(2)(0.0)])
        jumps = np.maximum(jumps, np.abs(np.subtract(*sides)))
    return jumps


def test_phase_counts_strikes_and_reaches_the_stance_share_at_lift_off():
    np.testing.assert_allclose(gait_phase(STANCES)(events(STANCES)), [0.0, 0.62, 1.0, 1.62, 2.0, 2.62], atol=1e-12)


def test_a_single_stance_makes_a_straight_line():
    times = np.linspace(-1.0, 3.0, 401)
    expected = STANCE_SHARE * (times - 0.3) / 0.7
    np.testing.assert_allclose(gait_phase(STANCES[:1])(times), expected, atol=1e-12)


def test_before_the_first_and_after_the_last_stance_the_phase_goes_on_at_their_rates():
    phase = gait_phase(STANCES)
    np.testing.assert_allclose(np.diff(phase(np.array([-0.9, 0.1, 0.2]))) / [1.0, 0.1], STANCE_SHARE / 0.7)
    np.testing.assert_allclose(np.diff(phase(np.array([3.5, 3.6, 5.0]))) / [0.1, 1.4], STANCE_SHARE / 0.77)


@pytest.mark.parametrize("at", [events(STANCES), np.array([0.7, 1.2, 2.9])])
def test_phase_is_twice_continuously_differentiable(at):
    value, rate, acceleration = derivatives_jump(gait_phase(STANCES), at)
    assert value < 1e-9 and rate < 1e-6 and acceleration < 1e-3


@given(lengths=st.lists(st.floats(0.16, 1.5), min_size=1, max_size=9).filter(lambda n: len(n) % 2 == 1))
def test_phase_rises_whatever_the_rhythm(lengths):
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    stances = [Stance(start, end) for start, end in zip(ends[::2], ends[1::2], strict=True)]
    times = np.linspace(-0.5, ends[-1] + 0.5, 4001)
    assert np.diff(gait_phase(stances)(times)).min() > 0.0


def test_a_stance_that_no_plate_saw_counts_as_a_cycle():
    phase = gait_phase([STANCES[0], STANCES[2]])
    np.testing.assert_allclose(phase(events([STANCES[0], STANCES[2]])), [0.0, 0.62, 2.0, 2.62], atol=1e-12)


def test_stances_that_were_cut_do_not_count_and_none_that_is_whole_is_refused():
    cut = Stance(3.9, 4.2, end_seen=False)
    times = np.linspace(0.0, 5.0, 51)
    np.testing.assert_array_equal(gait_phase([*STANCES, cut])(times), gait_phase(STANCES)(times))
    with pytest.raises(InputError, match="the plate saw only part of the stance"):
        gait_phase([cut])
    with pytest.raises(InputError, match="no stance"):
        gait_phase([])


def test_stances_out_of_order_are_a_mistake():
    with pytest.raises(ValueError, match="follow each other"):
        gait_phase(STANCES[::-1])


def test_phase_of_a_trial_is_that_of_its_prosthetic_plate():
    trial = load_trial(resource("data/reference_subject/exact/low_1.yaml"))
    plate = trial.prosthetic_plate
    stances = find_stances(plate.time_s, plate.force_W[:, 2])
    np.testing.assert_array_equal(gait_phase(trial)(plate.time_s), gait_phase(stances)(plate.time_s))
    start = plate.time_s[np.argmax(plate.force_W[:, 2] > 20.0)]
    assert gait_phase(trial)(np.array([start])) == pytest.approx(0.0, abs=2e-3)


def test_a_trial_whose_plate_saw_no_whole_stance_is_named(trial_files):
    trial_files.manifest["window"] = {"start_s": 0.3, "end_s": 0.9}
    keep = trial_files.force_time <= 0.9
    trial_files.force_time = trial_files.force_time[keep]
    trial_files.forces = {name: values[keep] for name, values in trial_files.forces.items()}
    trial = load_trial(trial_files.write())
    with pytest.raises(InputError, match=r"trial\.yaml: forces: the plate saw only part of the stance"):
        gait_phase(trial)


@pytest.mark.parametrize("count", [4, 5, SPLINES, 17])
def test_periodic_splines_share_one_and_repeat_every_cycle(count):
    phase = np.linspace(-1.3, 2.7, 1001)
    basis = periodic_bsplines(count)(phase)
    assert basis.shape == (1001, count) and basis.min() >= 0.0
    np.testing.assert_allclose(basis.sum(axis=1), 1.0, atol=1e-13)
    np.testing.assert_allclose(periodic_bsplines(count)(phase + 3.0), basis, atol=1e-12)
    assert np.linalg.matrix_rank(basis) == count


def test_the_jth_spline_is_centred_on_the_jth_knot():
    basis = periodic_bsplines(SPLINES)(np.arange(SPLINES) / SPLINES)
    np.testing.assert_allclose(np.diag(basis), 2.0 / 3.0, atol=1e-12)
    np.testing.assert_allclose(basis[0], [2 / 3, 1 / 6, 0, 0, 0, 0, 0, 1 / 6], atol=1e-12)


def test_periodic_splines_are_twice_continuously_differentiable_also_where_a_cycle_ends():
    knots = np.arange(-1, SPLINES + 1) / SPLINES
    for j in range(SPLINES):
        jumps = derivatives_jump(lambda phase, j=j: periodic_bsplines(SPLINES)(phase)[:, j], knots)
        assert jumps[0] < 1e-9 and jumps[1] < 1e-6 and jumps[2] < 1e-3


def test_a_curve_follows_a_harmonic_of_the_cycle():
    """Splines through a sine at 12 knots: fourth order, (pi / 6)^4 / 384 of the amplitude and some."""
    count, phase = 12, np.linspace(0.0, 2.0, 401)
    knots = np.arange(count) / count
    coefficients = np.linalg.solve(periodic_bsplines(count)(knots), np.sin(2 * np.pi * knots))
    assert np.abs(periodic_bsplines(count)(phase) @ coefficients - np.sin(2 * np.pi * phase)).max() < 4e-4


def test_too_few_splines_are_a_mistake():
    with pytest.raises(ValueError, match="at least 4"):
        periodic_bsplines(3)
