"""Times that were rounded become those of their clock again; what no rounding explains is refused or left alone."""

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.units import check_clock, even_clock, even_rate


def written(style, times):
    """Times as a program prints them with a format of C and MATLAB."""
    return np.array([float(style % time) for time in times])


def checked(path, times):
    return check_clock(times, np.arange(len(times)), path / "walk.mot")


@pytest.mark.parametrize("style", ["%.5g", "%.6g", "%.3f", "%.4f"])
@pytest.mark.parametrize("rate", [50.0, 60.0, 120.0, 400.0, 1000.0, 1200.0, 2000.0])
@pytest.mark.parametrize("start", [0.0, 0.4, 9.5, 98.3, 123.456])
def test_rounded_times_become_those_of_their_clock_again(style, rate, start):
    """A clock that fits within half a unit at every row is off by a unit at most, at a whole rate by the start only."""
    true = start + np.arange(3000) / rate
    clock = even_clock(written(style, true))
    assert clock.step_s == pytest.approx(1.0 / rate, rel=1e-12)
    first_place = np.floor(np.log10(true[-1])) + 1 if style.endswith("g") else 0
    coarsest = 10.0 ** (first_place - int(style[2]))
    assert abs(clock.start_s - start) <= 0.5 * coarsest + 1e-9


def test_equal_times_are_explained_where_the_last_place_is_ten_rows(tmp_path):
    """Two minutes at 1000 Hz with five digits: 0.0001 s steps before 10 s, 0.001 s before 100 s, then 0.01 s."""
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


@pytest.mark.parametrize("style", ["%.5g", "%.6g", "%.3f", "%.4f"])
@pytest.mark.parametrize(
    ("rate", "start"),
    [(60, 0.0), (100, 10.017), (250, 3.0), (1000, 0.0), (1000, 10.017), (1000, 98.3), (2000, 98.3)],
)
@pytest.mark.parametrize("missing", [1, 3, 40])
def test_missing_rows_are_not_taken_for_rounding(tmp_path, style, rate, start, missing):
    """Wherever the gap is wider than the last place, and even where one row of many is missing."""
    times = written(style, np.delete(start + np.arange(4000) / rate, np.s_[1700 : 1700 + missing]))
    with pytest.raises(InputError, match="evenly spaced, without a missing one"):
        even_rate(times, np.arange(len(times)), tmp_path / "grf.sto")


def test_uneven_and_exact_times_are_left_alone(tmp_path):
    uneven = np.cumsum(0.01 + 0.002 * np.random.default_rng(0).random(100))
    missing = np.delete(np.round(np.arange(100) / 60.0, 3), 40)
    for times in (uneven, missing, np.arange(100) / 100.0):
        assert checked(tmp_path, times)[0] is times
