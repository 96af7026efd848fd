"""The bench that a fit takes: of curves whose stiffness and displacement are known, and of the stated file."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vsf_drake.analysis.validation.bench_lines import load_measured_bench
from vsf_drake.bench_curves import load_bench_file
from vsf_drake.errors import InputError
from vsf_drake.files import resource

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


def test_a_spring_has_its_stiffness_and_half_its_travel(tmp_path):
    read = load_measured_bench(written(tmp_path, HEAD + rows(66, spring(10.0), start=3.0) + rows("", spring(60.0))))
    assert (read.name, read.synthetic, read.fulcrum_m, read.max_load_n) == ("curves", False, (0.066,), 600.0)
    assert read.stiffness_n_per_m == pytest.approx((10e3,)) and read.heel_stiffness_n_per_m == pytest.approx(60e3)
    assert read.mid_range_m == pytest.approx((0.030,)) and read.heel_mid_range_m == pytest.approx(0.005)
    assert read.uncertainty_n_per_m == 500.0 and read.mid_range_uncertainty_m == pytest.approx(5e-4)


def test_a_curve_that_hardens_has_its_mean_slope_above_200_n(tmp_path):
    read = load_measured_bench(written(tmp_path, HEAD + rows(108, square)))
    assert read.stiffness_n_per_m == pytest.approx((400e3 / (20.0 * (1.0 - math.sqrt(1 / 3))),), rel=1e-6)
    assert read.mid_range_m == pytest.approx((0.020 * math.sqrt(0.5),), rel=1e-6)
    assert read.heel_stiffness_n_per_m is read.heel_mid_range_m is None


def test_repeats_are_averaged_and_all_are_cut_to_the_smallest_load(tmp_path):
    text = HEAD + rows(66, spring(10.0)) + rows(66, spring(12.0), repeat=2) + rows(151, square, to=500.0)
    read = load_measured_bench(written(tmp_path, text))
    assert read.max_load_n == 500.0 and read.fulcrum_m == (0.066, 0.151)
    assert read.stiffness_n_per_m[0] == pytest.approx(11e3)
    assert read.mid_range_m == pytest.approx((0.5 * (250 / 10 + 250 / 12) * 1e-3, 1e-3 * square(250.0)), rel=1e-4)


def test_comments_tell_uncertainties(tmp_path):
    head = "# name: foot 3\n# synthetic: true\n#  Stiffness_uncertainty_N_per_mm : 0.3\n"
    read = load_measured_bench(written(tmp_path, head + HEAD + rows(66, square), "UPPER.CSV"))
    assert (read.name, read.synthetic) == ("foot 3", True)
    assert read.uncertainty_n_per_m == pytest.approx(300.0) and read.mid_range_uncertainty_m == pytest.approx(5e-4)
    read = load_measured_bench(written(tmp_path, '"# displacement_uncertainty_mm: 1.5",,\n' + HEAD + rows(66, square)))
    assert read.uncertainty_n_per_m == 500.0 and read.mid_range_uncertainty_m == pytest.approx(1.5e-3)


def test_the_reference_subjects_two_files_tell_one_stiffness():
    curves, stated = load_measured_bench(DATA / "bench_curves.csv"), load_measured_bench(DATA / "bench.yaml")
    assert stated == load_bench_file(DATA / "bench.yaml") and stated.mid_range_m is None
    assert curves.fulcrum_m == stated.fulcrum_m and curves.max_load_n == stated.max_load_n and curves.synthetic
    np.testing.assert_allclose(curves.stiffness_n_per_m, stated.stiffness_n_per_m, rtol=5e-5)
    assert curves.heel_stiffness_n_per_m == pytest.approx(stated.heel_stiffness_n_per_m, rel=5e-5)
    assert np.all(np.diff(curves.mid_range_m) < 0.0), "the farther the fulcrum, the stiffer"


@pytest.mark.parametrize(("text", "words"), [
    (HEAD + rows("", spring(65.0)), ["column fulcrum", "holds the heel only"]),
    (HEAD + rows(66, spring(10.0)) + rows(108, spring(18.0), to=220.0),
     ["fulcrum at 108 mm, column load", "220 N", "above 200 N"]),
    (HEAD + rows(66, spring(10.0)) + rows("", spring(65.0), to=100.0), ["heel, column load", "100 N"]),
    ("# stiffness_uncertainty_n_per_mm: much\n" + HEAD + rows(66, square),
     ["line 1, # stiffness_uncertainty_n_per_mm", "'much' is not usable", "N/mm"]),
    ("# displacement_uncertainty_mm: 0\n" + HEAD + rows(66, square), ["line 1", "'0' is not usable", "300 mm"]),
    ("# displacement_uncertainty: 1\n" + HEAD + rows(66, square), ["line 1", "There are: stiffness_uncertainty_n_per"]),
    (2 * "# displacement_uncertainty_mm: 1\n" + HEAD + rows(66, square), ["line 2", "stands twice"]),
    ("displacement_mm,load_n\n1,2\n", ["line 1", "no column of fulcrum"]),
])
def test_what_is_wrong_is_named(tmp_path, text, words):
    path = written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        load_measured_bench(path)
    for word in (f"{path}: ", *words):
        assert word in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    for name in ("none.csv", "none.yaml"):
        with pytest.raises(InputError, match="there is no such file"):
            load_measured_bench(tmp_path / name)
