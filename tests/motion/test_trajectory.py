"""Splines through recordings: right derivatives, quiet ends, nothing outside the recording."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from vsf_drake.errors import InputError
from vsf_drake.motion.trajectory import CoordinateTrajectory

OMEGA = 2 * np.pi * 3.0


def sine(time):
    return np.column_stack([np.sin(OMEGA * time), np.cos(OMEGA * time)])


@pytest.fixture
def recording():
    time = np.linspace(0.0, 1.2, 121)
    return CoordinateTrajectory(time, sine(time), ("a", "b"))


def test_samples_are_interpolated(recording):
    q, v, a = recording.sample(recording.time_s)
    np.testing.assert_allclose(q, recording.values, atol=1e-12)
    assert q.shape == v.shape == a.shape == (121, 2)


def test_derivatives_of_a_sine(recording):
    time = np.linspace(0.1, 1.1, 777)
    q, v, a = recording.sample(time)
    np.testing.assert_allclose(q, sine(time), atol=1e-6)
    np.testing.assert_allclose(v[:, 0], OMEGA * np.cos(OMEGA * time), atol=1e-4 * OMEGA)
    np.testing.assert_allclose(a, -(OMEGA**2) * sine(time), atol=1e-4 * OMEGA**2)


def test_velocity_is_the_integral_of_acceleration_and_position_of_velocity(recording):
    time = np.linspace(0.0, 1.2, 120001)
    q, v, a = recording.sample(time)
    np.testing.assert_allclose(v - v[0], cumulative_trapezoid(a, time, axis=0, initial=0), atol=1e-6)
    np.testing.assert_allclose(q - q[0], cumulative_trapezoid(v, time, axis=0, initial=0), atol=1e-6)


def test_acceleration_error_falls_with_the_fourth_power_of_the_spacing():
    time = np.linspace(0.4, 0.8, 1001)
    errors = []
    for n in (61, 121):
        knots = np.linspace(0.0, 1.2, n)
        a = CoordinateTrajectory(knots, sine(knots), ("a", "b")).sample(time)[2]
        errors.append(np.abs(a + OMEGA**2 * sine(time)).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.5)


def test_noise_is_not_louder_at_the_ends():
    time = np.linspace(0.0, 1.2, 121)
    inside, ends = 0.0, 0.0
    for seed in range(20):
        noise = np.random.default_rng(seed).normal(size=(121, 1))
        a = np.abs(CoordinateTrajectory(time, noise, ("a",)).sample(np.linspace(0, 1.2, 2401))[2][:, 0])
        inside, ends = max(inside, a[200:-200].max()), max(ends, a[:100].max(), a[-100:].max())
    assert ends < 1.2 * inside


def test_queries_outside_the_recording_are_refused(recording):
    for time in (-0.01, 1.21, np.nan):
        with pytest.raises(InputError, match=r"outside the recording of 0 to 1\.2 s"):
            recording.sample([0.5, time])
    np.testing.assert_allclose(recording.sample(1.2 + 1e-10)[0], recording.values[-1:], atol=1e-9)


def test_ordered_picks_columns_by_name(recording):
    swapped = recording.ordered(("b", "a"))
    assert swapped.names == ("b", "a")
    np.testing.assert_allclose(swapped.sample(0.33)[2], recording.sample(0.33)[2][:, ::-1])
    with pytest.raises(InputError, match=r"no coordinate c\. It has: a, b"):
        recording.ordered(("a", "c"))


@pytest.mark.parametrize(
    ("time", "values", "names"),
    [(np.arange(5.0), np.zeros((5, 1)), "a"), (np.zeros(9), np.zeros((9, 1)), "a"),
     (np.arange(9.0), np.full((9, 1), np.nan), "a"), (np.arange(9.0), np.zeros((9, 2)), "a"),
     (np.arange(9.0), np.zeros((9, 2)), "aa")],
)
def test_what_cannot_be_a_trajectory_is_refused(time, values, names):
    with pytest.raises(ValueError):
        CoordinateTrajectory(time, values, tuple(names))


def test_recording_cannot_be_changed_behind_its_splines(recording):
    with pytest.raises(ValueError, match="read-only"):
        recording.values[0, 0] = 1.0
