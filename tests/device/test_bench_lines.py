"""Curves of the bench: statistics and shapes of known answer, and the bench that a fit takes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.device.bench_lines import (
    CurveValues,
    SettingRow,
    curve_values,
    load_measured_bench,
    mean_and_half_width,
    rising,
    statistics,
    up_to,
)
from vsf_drake.device.bench_metrics import at_loads
from vsf_drake.model.bench_curves import load_bench_file

MEASURED = np.array([10.0, 13.7, 18.4, 24.3, 32.0])
LOADS = np.linspace(0.0, 600.0, 601)


def compared(k, mid, rmse=None):
    return CurveValues(
        stiffness_n_per_mm=k,
        mid_range_mm=mid,
        max_displacement_mm=1.0,
        curvature_share=0.0,
        curve_rmse_mm=rmse,
    )


def test_agreement_is_that_of_the_forefoots_settings_with_a_stiffness():
    """Twice the measurement explains nothing; the heel and a pass of too little load do not
    count."""

    def row(x, k):
        return SettingRow(
            fulcrum_mm=x,
            max_load_n=600.0,
            repeats=1,
            published_n_per_mm=None,
            tuned_joints_n_per_mm=None,
            lines={"measured": compared(k, 10.0), "model": compared(k and 2.0 * k, 13.0, 4.0)},
        )

    rows = [*(row(i, k) for i, k in enumerate(MEASURED)), row(9.0, None), row(None, 1e3)]
    found = statistics(rows, "model")
    assert found.n == 5 and (found.mid_range_rmse_mm, found.curve_rmse_mm) == (3.0, 4.0)
    assert found.stiffness_rmse_n_per_mm == pytest.approx(np.sqrt(np.mean(MEASURED**2)))
    assert found.stiffness_r2 == pytest.approx(
        1.0 - np.sum(MEASURED**2) / (4.0 * 5.0 * np.var(MEASURED)) * 4.0
    )
    assert (
        statistics(rows[:1], "model").stiffness_r2 is None and statistics(rows[5:], "model") is None
    )


def test_repeats_have_students_interval_and_one_pass_none():
    passes = np.array([[1.0, 10.0], [2.0, 10.0], [4.0, 13.0]])
    mean, half = mean_and_half_width(passes)
    np.testing.assert_allclose(mean, passes.mean(axis=0))
    np.testing.assert_allclose(half, stats.t.ppf(0.975, 2) * stats.sem(passes, axis=0))
    assert np.isnan(mean_and_half_width(passes[:1])[1]).all()


def test_two_springs_differ_by_their_compliances():
    """x = F / k and F / 2k up to 600 N: root mean square over the load of F / k - F / 2k."""
    found = curve_values((LOADS / 10.0, LOADS), (LOADS / 20.0, LOADS))
    assert found.curve_rmse_mm == pytest.approx(600.0 / 20.0 / np.sqrt(3.0), rel=5e-3)
    assert found.mid_range_offset_mm == pytest.approx(15.0) and found.max_displacement_mm == 60.0


def test_a_noisy_curve_becomes_the_nearest_that_rises_and_is_cut_between_its_samples():
    x, load = np.arange(5.0), np.array([0.0, 2.0, 1.0, 3.0, 4.0])
    np.testing.assert_allclose(rising(x, load)[1], [0.0, 1.5, 1.5, 3.0, 4.0])
    np.testing.assert_array_equal(rising(x, np.sort(load))[1], np.sort(load))
    np.testing.assert_allclose(at_loads(*rising(x, load), [0.75, 2.25, 5.0]), [0.5, 2.5, np.nan])
    x, load = up_to(np.array([0.0, 1.0, 1.4, 2.0]), np.array([0.0, 10.0, 14.0, 30.0]), 15.0)
    np.testing.assert_allclose([x, load], [[0.0, 1.0, 1.4, 1.4375], [0.0, 10.0, 14.0, 15.0]])


def test_a_spring_is_straight_and_one_that_hardens_leaves_its_chord():
    """10 N/mm up to 100 N, then 20."""
    straight = curve_values((LOADS / 25.0, LOADS))
    assert (
        straight.curvature_share == pytest.approx(0.0, abs=1e-12)
        and straight.stiffness_n_per_mm == 25.0
    )
    x = np.where(LOADS < 100.0, LOADS / 10.0, 10.0 + (LOADS - 100.0) / 20.0)
    assert curve_values((x, LOADS)).curvature_share * 35.0 == pytest.approx(
        10.0 - 100.0 * 35.0 / 600.0
    )


# The bench that a fit takes: of curves whose stiffness and displacement are known, and of the
# stated file.

DATA = resource("data/reference_subject")
HEAD = "fulcrum_mm,displacement_mm,load_n,repeat\n"


def written(folder, text, name="curves.csv"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def rows(fulcrum, law, *, to=600.0, repeat=1, start=0.0):
    """A pass in which the displacement (mm) is `law` of the load (N), 10 N apart."""
    loads = np.append(np.arange(0.0, to, 10.0), to)
    return "".join(f"{fulcrum},{start + law(load):.9f},{load},{repeat}\n" for load in loads)


def spring(n_per_mm):
    return lambda load: load / n_per_mm


def square(load):
    """A foam of 600 N at 20 mm whose load is the square of its depth."""
    return 20.0 * math.sqrt(load / 600.0)


def test_a_spring_and_a_curve_that_hardens_have_their_mean_slope_above_200_n_and_their_travel(
    tmp_path,
):
    read = load_measured_bench(
        written(tmp_path, HEAD + rows(66, spring(10.0), start=3.0) + rows("", spring(60.0)))
    )
    assert (read.name, read.synthetic, read.fulcrum_m, read.max_load_n) == (
        "curves",
        False,
        (0.066,),
        600.0,
    )
    assert read.stiffness_n_per_m == pytest.approx(
        (10e3,)
    ) and read.heel_stiffness_n_per_m == pytest.approx(60e3)
    assert read.mid_range_m == pytest.approx((0.030,)) and read.heel_mid_range_m == pytest.approx(
        0.005
    )
    assert read.uncertainty_n_per_m == 500.0 and read.mid_range_uncertainty_m == pytest.approx(5e-4)
    head = (
        '# synthetic: true\n#  Stiffness_uncertainty_N_per_mm : 0.3\n"# '
        'displacement_uncertainty_mm: 1.5",,\n'
    )
    read = load_measured_bench(written(tmp_path, head + HEAD + rows(108, square), "UPPER.CSV"))
    assert read.stiffness_n_per_m == pytest.approx(
        (400e3 / (20.0 * (1.0 - math.sqrt(1 / 3))),), rel=1e-6
    )
    assert read.mid_range_m == pytest.approx((0.020 * math.sqrt(0.5),), rel=1e-6)
    assert read.heel_stiffness_n_per_m is read.heel_mid_range_m is None and read.synthetic
    assert read.uncertainty_n_per_m == pytest.approx(
        300.0
    ) and read.mid_range_uncertainty_m == pytest.approx(1.5e-3)


def test_repeats_are_averaged_and_all_are_cut_to_the_smallest_load(tmp_path):
    text = (
        HEAD
        + rows(66, spring(10.0))
        + rows(66, spring(12.0), repeat=2)
        + rows(151, square, to=500.0)
    )
    read = load_measured_bench(written(tmp_path, text))
    assert read.max_load_n == 500.0 and read.fulcrum_m == (0.066, 0.151)
    assert read.stiffness_n_per_m[0] == pytest.approx(11e3)
    assert read.mid_range_m == pytest.approx(
        (0.5 * (250 / 10 + 250 / 12) * 1e-3, 1e-3 * square(250.0)), rel=1e-4
    )


def test_the_reference_subjects_two_files_tell_one_stiffness():
    curves, stated = (
        load_measured_bench(DATA / "bench_curves.csv"),
        load_measured_bench(DATA / "bench.yaml"),
    )
    assert stated == load_bench_file(DATA / "bench.yaml") and stated.mid_range_m is None
    assert (
        curves.fulcrum_m == stated.fulcrum_m
        and curves.max_load_n == stated.max_load_n
        and curves.synthetic
    )
    np.testing.assert_allclose(
        (*curves.stiffness_n_per_m, curves.heel_stiffness_n_per_m),
        (*stated.stiffness_n_per_m, stated.heel_stiffness_n_per_m),
        rtol=5e-5,
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD + rows("", spring(65.0)), ["column fulcrum", "holds the heel only"]),
        (
            HEAD + rows(66, spring(10.0)) + rows(108, spring(18.0), to=220.0),
            ["fulcrum at 108 mm, column load", "220 N", "above 200 N"],
        ),
        (
            "# stiffness_uncertainty_n_per_mm: much\n" + HEAD + rows(66, square),
            ["line 1, # stiffness_uncertainty_n_per_mm", "'much' is not usable", "N/mm"],
        ),
        (
            "# displacement_uncertainty_mm: 0\n" + HEAD + rows(66, square),
            ["line 1", "'0' is not usable", "300 mm"],
        ),
        (
            "# displacement_uncertainty: 1\n" + HEAD + rows(66, square),
            ["line 1", "There are: stiffness_uncertainty_n_per"],
        ),
        (
            2 * "# displacement_uncertainty_mm: 1\n" + HEAD + rows(66, square),
            ["line 2", "stands twice"],
        ),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, words):
    path = written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        load_measured_bench(path)
    for word in (f"{path}: ", *words):
        assert word in str(caught.value)
