"""Times that were rounded become those of their clock again; what no rounding explains is refused or left alone."""

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.motion import read_trial
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


@pytest.mark.parametrize("style", ["%.5g", "%.3f"])
@pytest.mark.parametrize("rate", [59.94, 119.88, 1.0 / 0.0166])
def test_a_rate_that_is_no_whole_number_is_restored_within_the_rounding(style, rate):
    true = 0.4 + np.arange(400) / rate
    clock = even_clock(written(style, true))
    assert np.abs(clock.start_s + np.arange(400) * clock.step_s - true).max() < 1e-3


def test_equal_times_are_explained_where_the_last_place_is_ten_rows(tmp_path):
    """Two minutes at 1000 Hz with five digits: 0.0001 s steps before 10 s, 0.001 s before 100 s, then 0.01 s."""
    times = written("%.5g", np.arange(120_000) / 1000.0)
    assert np.count_nonzero(np.diff(times) == 0.0) > 10_000
    rate, start, doubts = even_rate(times, np.arange(len(times)), tmp_path / "grf.sto")
    assert (rate, start) == (pytest.approx(1000.0, rel=1e-12), 0.0)
    assert "written to 0.01 s where rows are 0.001 s apart" in doubts[0] and "missing row" in doubts[0]
    even, more = checked(tmp_path, times)
    np.testing.assert_allclose(even, np.arange(120_000) / 1000.0, atol=1e-9)
    assert more == [doubts[0].replace("grf.sto", "walk.mot")]


@pytest.mark.parametrize("style", ["%.5g", "%.6g", "%.3f", "%.4f"])
@pytest.mark.parametrize(("rate", "start"), [(60, 0.0), (100, 10.017), (250, 3.0), (1000, 0.0), (1000, 10.017),
                                             (1000, 98.3), (2000, 98.3)])
@pytest.mark.parametrize("missing", [1, 3, 40])
def test_missing_rows_are_not_taken_for_rounding(tmp_path, style, rate, start, missing):
    """Wherever the gap is wider than the last place, and even where one row of many is missing."""
    times = written(style, np.delete(start + np.arange(4000) / rate, np.s_[1700:1700 + missing]))
    with pytest.raises(InputError, match="evenly spaced, without a missing one"):
        even_rate(times, np.arange(len(times)), tmp_path / "grf.sto")


@pytest.mark.parametrize("decimals", [2, 3, 4])
def test_instants_of_a_table_are_evenly_spaced_again(tmp_path, decimals):
    true = 0.4 + np.arange(73) / 60.0
    np.testing.assert_allclose(checked(tmp_path, np.round(true, decimals))[0], true, atol=1e-9)


def test_uneven_and_exact_times_are_left_alone(tmp_path):
    uneven = np.cumsum(0.01 + 0.002 * np.random.default_rng(0).random(100))
    missing = np.delete(np.round(np.arange(100) / 60.0, 3), 40)
    for times in (uneven, missing, np.arange(100) / 100.0):
        assert checked(tmp_path, times)[0] is times


@pytest.mark.parametrize("suffix", ["mot", "csv", "trc"])
def test_every_text_format_is_read_with_five_digits(tmp_path, suffix):
    times = np.arange(98_000, 102_000) / 1000.0
    names = [f"ground_force_r_{kind}{axis}" for kind in "vp" for axis in "xyz"]
    cells = [f"{time:.5g}," + "0,700,0,0.1,0,0.2" for time in times]
    head = {"mot": ["walk", "endheader"], "csv": [], "trc": ["PathFileType\t4", "DataRate\tUnits", "1000\tmm"]}[suffix]
    head.append(",".join(["time", *names]) if suffix != "trc" else "Frame#\tTime\ta\t\t\tb\t\t")
    cells = [f"{i},{cell}" for i, cell in enumerate(cells)] if suffix == "trc" else cells
    text = "\n".join([*head, *cells])
    path = tmp_path / f"walk.{suffix}"
    path.write_text(text if suffix == "csv" else text.replace(",", "\t"))
    read = read_trial(path)
    assert (read.marker_rate_hz or read.force_rate_hz) == pytest.approx(1000.0, rel=1e-12)
    assert (read.marker_start_s or read.force_start_s) == 98.0
