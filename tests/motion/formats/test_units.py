"""Times that were rounded become those of their clock again; what no rounding explains is refused
or left alone."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from vsf_drake.base.errors import InputError
from vsf_drake.motion.formats.units import check_clock, even_clock, even_rate


def written(style, times):
    """Times as a program prints them with a format of C and MATLAB."""
    return np.array([float(style % time) for time in times])


def checked(path, times):
    return check_clock(times, np.arange(len(times)), path / "walk.mot")


@pytest.mark.parametrize(
    ("style", "rate", "start"),
    [
        ("%.5g", 50.0, 0.0),
        ("%.5g", 400.0, 9.5),
        ("%.5g", 1000.0, 98.3),
        ("%.5g", 2000.0, 123.456),
        ("%.6g", 60.0, 9.5),
        ("%.6g", 1200.0, 98.3),
        ("%.6g", 2000.0, 0.4),
        ("%.3f", 60.0, 123.456),
        ("%.3f", 120.0, 0.4),
        ("%.3f", 2000.0, 98.3),
        ("%.4f", 1000.0, 0.0),
        ("%.4f", 1200.0, 123.456),
    ],
)
def test_rounded_times_become_those_of_their_clock_again(style, rate, start):
    """At a whole rate they are off by the start only, and by half a unit at most."""
    true = start + np.arange(3000) / rate
    clock = even_clock(written(style, true))
    assert clock.step_s == pytest.approx(1.0 / rate, rel=1e-12)
    assert abs(clock.start_s - start) <= 0.5 * last_place(style, true[-1]) + 1e-9


STYLES = st.sampled_from(["%.5g", "%.6g", "%.3f", "%.4f"])
RATES = st.sampled_from([50.0, 60.0, 120.0, 400.0, 1000.0, 1200.0, 2000.0])
few = settings(max_examples=40, deadline=None)


def last_place(style, time):
    """What the last digit of a printed time is worth."""
    before = np.floor(np.log10(time)) + 1 if style.endswith("g") else 0
    return 10.0 ** (before - int(style[2]))


@few
@given(style=STYLES, rate=RATES, start=st.floats(0.0, 150.0))
@example(style="%.5g", rate=50.0, start=1.4375)  # half-way at every row
def test_a_clock_that_fits_within_half_a_unit_at_every_row_is_off_by_a_unit_at_most(
    style, rate, start
):
    """None is found where rows lie half-way between two last places, and went up here and down
    there."""
    true = start + np.arange(3000) / rate
    clock = even_clock(written(style, true))
    if clock is None:
        later = true[true > 0.1]
        share = later / last_place(style, later) % 1.0
        assert np.abs(share - 0.5).min() < 1e-6
    else:
        off = clock.start_s + np.arange(3000) * clock.step_s - true
        assert np.abs(off).max() <= last_place(style, true[-1]) + 1e-9


def test_equal_times_are_explained_where_the_last_place_is_ten_rows(tmp_path):
    """Two minutes at 1000 Hz with five digits: 0.0001 s steps before 10 s, 0.001 s before 100 s,
    then 0.01 s."""
    times = written("%.5g", np.arange(120_000) / 1000.0)
    assert np.count_nonzero(np.diff(times) == 0.0) > 10_000
    rate, start, warnings = even_rate(times, np.arange(len(times)), tmp_path / "grf.sto")
    assert (rate, start) == (pytest.approx(1000.0, rel=1e-12), 0.0)
    assert (
        "written to 0.01 s where rows are 0.001 s apart" in warnings[0]
        and "missing row" in warnings[0]
    )
    even, more = checked(tmp_path, times)
    np.testing.assert_allclose(even, np.arange(120_000) / 1000.0, atol=1e-9)
    assert more == [warnings[0].replace("grf.sto", "walk.mot")]


def refused(style, rate, start, missing):
    times = written(style, np.delete(start + np.arange(4000) / rate, np.s_[1700 : 1700 + missing]))
    with pytest.raises(InputError, match="evenly spaced, without a missing one"):
        even_rate(times, np.arange(len(times)), Path("grf.sto"))


@few
@given(style=STYLES, rate=RATES, start=st.floats(0.0, 150.0), missing=st.sampled_from([1, 3, 40]))
def test_missing_rows_are_not_taken_for_rounding(style, rate, start, missing):
    """Wherever the gap is as wide as the last place."""
    assume(missing / rate >= 0.999 * last_place(style, start + 4000 / rate))
    refused(style, rate, start, missing)


@pytest.mark.parametrize(("rate", "start"), [(1000.0, 10.017), (1000.0, 98.3), (2000.0, 98.3)])
@pytest.mark.parametrize("missing", [1, 3])
def test_a_row_of_many_is_missed_where_the_last_place_is_some_of_them(rate, start, missing):
    refused("%.5g", rate, start, missing)


def test_uneven_and_exact_times_are_left_alone(tmp_path):
    uneven = np.cumsum(0.01 + 0.002 * np.random.default_rng(0).random(100))
    missing = np.delete(np.round(np.arange(100) / 60.0, 3), 40)
    for times in (uneven, missing, np.arange(100) / 100.0):
        assert checked(tmp_path, times)[0] is times
