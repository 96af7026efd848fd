"""The zero-phase low-pass filter does what its name says, at the frequency it says."""

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.motion.trajectory import low_pass

RATE = 1000.0
TIME = np.arange(0.0, 4.0, 1.0 / RATE)
MIDDLE = (TIME > 1.0) & (TIME < 3.0)


def gain_and_lag(frequency, cutoff, rate=RATE, order=4):
    """Amplitude and phase (rad) of the filtered sine by projection, over whole periods in the middle."""
    time = np.arange(0.0, 4.0, 1.0 / rate)
    out = low_pass(np.sin(2 * np.pi * frequency * time), rate_hz=rate, cutoff_hz=cutoff, order=order)
    middle = (time >= 1.0) & (time < 3.0 - 0.5 / rate)
    carrier = np.exp(-2j * np.pi * frequency * time[middle])
    phasor = 2 * np.mean(out[middle] * carrier)
    return abs(phasor), np.angle(phasor * 1j)


def test_constant_passes_unchanged():
    np.testing.assert_allclose(low_pass(np.full(500, 7.0), rate_hz=RATE, cutoff_hz=6.0), 7.0, rtol=1e-9)


def test_straight_line_passes_unchanged():
    np.testing.assert_allclose(low_pass(TIME, rate_hz=RATE, cutoff_hz=6.0), TIME, atol=1e-3)
    np.testing.assert_allclose(low_pass(TIME, rate_hz=RATE, cutoff_hz=6.0)[MIDDLE], TIME[MIDDLE], atol=1e-9)


@pytest.mark.parametrize(("cutoff", "rate"), [(6.0, 1000.0), (40.0, 1000.0), (40.0, 100.0), (10.0, 60.0)])
@pytest.mark.parametrize("order", [2, 4, 8])
def test_amplitude_at_the_cutoff_is_minus_3_db(cutoff, rate, order):
    gain, _ = gain_and_lag(cutoff, cutoff, rate, order)
    assert gain == pytest.approx(1 / np.sqrt(2), rel=1e-4)


@pytest.mark.parametrize("frequency", [2.0, 6.0, 10.0])
def test_there_is_no_phase_lag(frequency):
    _, lag = gain_and_lag(frequency, 6.0)
    assert abs(lag) < 1e-6


def test_fourth_order_roll_off():
    near, far = gain_and_lag(60.0, 6.0)[0], gain_and_lag(120.0, 6.0)[0]
    warped = np.tan(np.pi * 120.0 / RATE) / np.tan(np.pi * 60.0 / RATE)
    assert near / far == pytest.approx(warped**4, rel=0.01)


def test_columns_are_filtered_apart():
    table = np.column_stack([np.sin(TIME), np.cos(40 * TIME)])
    out = low_pass(table, rate_hz=RATE, cutoff_hz=6.0)
    for i in range(2):
        np.testing.assert_array_equal(out[:, i], low_pass(table[:, i], rate_hz=RATE, cutoff_hz=6.0))


def test_time_reversed_input_gives_time_reversed_output():
    signal = np.random.default_rng(0).normal(size=2000)
    forward = low_pass(signal, rate_hz=RATE, cutoff_hz=40.0)
    backward = low_pass(signal[::-1], rate_hz=RATE, cutoff_hz=40.0)[::-1]
    np.testing.assert_allclose(forward[200:-200], backward[200:-200], atol=1e-9)


@pytest.mark.parametrize("cutoff", [500.0, 800.0, 0.0, -1.0, np.nan])
def test_impossible_cutoff_is_refused(cutoff):
    with pytest.raises(InputError, match=r"impossible at 1000 samples per second\. It must be above 0 and below 500"):
        low_pass(np.zeros(100), rate_hz=RATE, cutoff_hz=cutoff)


def test_nan_is_refused_with_its_place():
    signal = np.zeros(100)
    signal[25] = np.nan
    with pytest.raises(InputError, match=r"sample 25 \(after 0\.025 s\)"):
        low_pass(signal, rate_hz=RATE, cutoff_hz=6.0)


def test_too_short_and_odd_order_are_refused():
    with pytest.raises(InputError, match="1 samples"):
        low_pass(np.zeros(1), rate_hz=RATE, cutoff_hz=6.0)
    with pytest.raises(ValueError, match="even"):
        low_pass(np.zeros(100), rate_hz=RATE, cutoff_hz=6.0, order=3)
