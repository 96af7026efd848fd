"""Splines through recordings, corrections over a window, and the zero-phase filter do what their
names say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from vsf_drake.base.errors import InputError
from vsf_drake.motion.trajectory import CoordinateTrajectory, low_pass, window_bsplines

OMEGA = 2 * np.pi * 3.0


def sine(time):
    return np.column_stack([np.sin(OMEGA * time), np.cos(OMEGA * time)])


@pytest.fixture
def recording():
    time = np.linspace(0.0, 1.2, 121)
    return CoordinateTrajectory(time, sine(time), ("a", "b"))


def test_derivatives_of_a_sine(recording):
    time = np.linspace(0.1, 1.1, 777)
    q, v, a = recording.sample(time)
    np.testing.assert_allclose(q, sine(time), atol=1e-6)
    np.testing.assert_allclose(v[:, 0], OMEGA * np.cos(OMEGA * time), atol=1e-4 * OMEGA)
    np.testing.assert_allclose(a, -(OMEGA**2) * sine(time), atol=1e-4 * OMEGA**2)


def test_acceleration_error_falls_with_the_fourth_power_of_the_spacing():
    time = np.linspace(0.4, 0.8, 1001)
    errors = []
    for n in (61, 121):
        knots = np.linspace(0.0, 1.2, n)
        a = CoordinateTrajectory(knots, sine(knots), ("a", "b")).sample(time)[2]
        errors.append(np.abs(a + OMEGA**2 * sine(time)).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.5)


def test_queries_outside_the_recording_are_refused(recording):
    for time in (-0.01, 1.21, np.nan):
        with pytest.raises(InputError, match=r"outside the recording of 0 to 1\.2 s"):
            recording.sample([0.5, time])
    np.testing.assert_allclose(recording.sample(1.2 + 1e-10)[0], recording.values[-1:], atol=1e-9)


@pytest.mark.parametrize(
    ("time", "values", "names"),
    [
        (np.arange(5.0), np.zeros((5, 1)), "a"),
        (np.zeros(9), np.zeros((9, 1)), "a"),
        (np.arange(9.0), np.full((9, 1), np.nan), "a"),
        (np.arange(9.0), np.zeros((9, 2)), "a"),
        (np.arange(9.0), np.zeros((9, 2)), "aa"),
    ],
)
def test_what_cannot_be_a_trajectory_is_refused(time, values, names):
    with pytest.raises(ValueError):
        CoordinateTrajectory(time, values, tuple(names))


BEGIN_S, END_S = 0.4, 1.9


@pytest.mark.parametrize("count", [4, 5, 9])
def test_splines_share_one_and_are_independent(count):
    basis = window_bsplines(BEGIN_S, END_S, count)(np.linspace(BEGIN_S - 1.0, END_S + 1.0, 501))
    for ends in (
        basis[[0, -1]],
        window_bsplines(BEGIN_S, END_S, count)(np.array([BEGIN_S, END_S])),
    ):
        np.testing.assert_allclose(ends, np.eye(count)[[0, -1]], atol=1e-13)
    assert basis.shape == (501, count) and basis.min() >= 0.0
    np.testing.assert_allclose(basis.sum(axis=1), 1.0, atol=1e-13)
    assert np.linalg.matrix_rank(basis) == count


@pytest.mark.parametrize("count", [4, 9])
def test_they_are_twice_continuously_differentiable_also_at_the_ends_of_the_window(count):
    """Steps of the second derivative shrink with the sampling; a corner or a jump would leave one
    that does not."""
    largest = []
    for n in (2001, 8001):
        times = np.linspace(BEGIN_S - 0.3, END_S + 0.3, n)
        second = (
            np.diff(window_bsplines(BEGIN_S, END_S, count)(times), 2, axis=0)
            / (times[1] - times[0]) ** 2
        )
        largest.append(np.abs(np.diff(second, axis=0)).max())
    assert largest[1] < 0.3 * largest[0]


RATE = 1000.0
TIME = np.arange(0.0, 4.0, 1.0 / RATE)
MIDDLE = (TIME > 1.0) & (TIME < 3.0)


def gain_and_lag(frequency, cutoff, rate=RATE):
    """Amplitude and phase (rad) of the filtered sine by projection, over whole periods in the
    middle."""
    time = np.arange(0.0, 4.0, 1.0 / rate)
    out = low_pass(np.sin(2 * np.pi * frequency * time), rate_hz=rate, cutoff_hz=cutoff)
    middle = (time >= 1.0) & (time < 3.0 - 0.5 / rate)
    carrier = np.exp(-2j * np.pi * frequency * time[middle])
    phasor = 2 * np.mean(out[middle] * carrier)
    return abs(phasor), np.angle(phasor * 1j)


@pytest.mark.parametrize(
    ("cutoff", "rate"), [(6.0, 1000.0), (40.0, 1000.0), (40.0, 100.0), (10.0, 60.0)]
)
def test_amplitude_at_the_cutoff_is_minus_3_db(cutoff, rate):
    gain, lag = gain_and_lag(cutoff, cutoff, rate)
    assert gain == pytest.approx(1 / np.sqrt(2), rel=1e-4) and abs(lag) < 1e-6


@pytest.mark.parametrize("cutoff", [500.0, 800.0, 0.0, -1.0, np.nan])
def test_impossible_cutoff_is_refused(cutoff):
    with pytest.raises(
        InputError,
        match=r"impossible at 1000 samples per second\. It must be above 0 and below 500",
    ):
        low_pass(np.zeros(100), rate_hz=RATE, cutoff_hz=cutoff)


@pytest.mark.parametrize("shape", [(1500, 3), (1500,), (7, 2, 3), (2, 1)])
@pytest.mark.parametrize("cutoff", [6.0, 40.0, 450.0])
def test_the_filter_is_that_of_scipy_run_forward_and_backward(shape, cutoff):
    values = 300.0 + np.cumsum(np.random.default_rng(0).normal(size=shape), axis=0)
    warped = np.tan(np.pi * cutoff / RATE) / (np.sqrt(2.0) - 1.0) ** 0.25
    section = butter(2, RATE / np.pi * np.arctan(warped), fs=RATE, output="sos")
    reflected = min(len(values) - 1, int(np.ceil(2.0 * RATE / cutoff)))
    expected = sosfiltfilt(section, values, axis=0, padtype="odd", padlen=reflected)
    np.testing.assert_allclose(
        low_pass(values, rate_hz=RATE, cutoff_hz=cutoff), expected, rtol=1e-11
    )


def test_low_pass_of_no_column_is_none():
    assert low_pass(np.zeros((50, 0)), rate_hz=1000.0, cutoff_hz=20.0).shape == (50, 0)
