"""Mid-range displacements in a bench file: of all settings or of none."""

from __future__ import annotations

import pytest

from vsf_drake.bench_curves import load_bench_file
from vsf_drake.errors import InputError

WHOLE = """\
name: a foot
forefoot:
  - {fulcrum_mm: 66, stiffness_n_per_mm: 10.0, mid_range_displacement_mm: 31.5}
  - {fulcrum_mm: 151, stiffness_n_per_mm: 32, mid_range_displacement_mm: 9.25}
heel_stiffness_n_per_mm: 65.0
heel_mid_range_displacement_mm: 4.5
displacement_uncertainty_mm: 0.25
stiffness_uncertainty_n_per_mm: 0.5
max_load_n: 600
"""


def written(folder, text):
    path = folder / "bench.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def without(*keys):
    return "".join(line for line in WHOLE.splitlines(keepends=True) if not line.startswith(keys))


def test_displacements_are_read_into_si(tmp_path):
    read = load_bench_file(written(tmp_path, WHOLE))
    assert read.mid_range_m == pytest.approx((0.0315, 0.00925))
    assert read.heel_mid_range_m == pytest.approx(4.5e-3) and read.mid_range_uncertainty_m == pytest.approx(2.5e-4)
    assert read.stiffness_n_per_m == pytest.approx((10e3, 32e3)) and read.heel_stiffness_n_per_m == pytest.approx(65e3)


def test_without_them_all_is_as_before_and_without_the_heel_its_own_is_not_asked_for(tmp_path):
    bare = without("heel_mid", "displacement").replace(", mid_range_displacement_mm: 31.5", "")
    read = load_bench_file(written(tmp_path, bare.replace(", mid_range_displacement_mm: 9.25", "")))
    assert read.mid_range_m is read.heel_mid_range_m is read.mid_range_uncertainty_m is None
    read = load_bench_file(written(tmp_path, without("heel")))
    assert read.heel_mid_range_m is None and len(read.mid_range_m) == 2


@pytest.mark.parametrize(("text", "words"), [
    (WHOLE.replace(", mid_range_displacement_mm: 9.25", ""), ["forefoot[1].mid_range_displacement_mm", "missing"]),
    (without("displacement_uncertainty"), ["displacement_uncertainty_mm", "missing", "every setting"]),
    (without("heel_mid"), ["heel_mid_range_displacement_mm", "missing"]),
    (without("heel_stiffness"), ["heel_mid_range_displacement_mm", "no heel_stiffness_n_per_mm"]),
    (WHOLE.replace("31.5", "0.0"), ["forefoot[0].mid_range_displacement_mm", "between 0.01 and 300 mm"]),
    (WHOLE.replace("31.5", "3150"), ["forefoot[0].mid_range_displacement_mm", "between 0.01 and 300 mm"]),
    (WHOLE.replace("0.25", "0"), ["displacement_uncertainty_mm", "between"]),
    (WHOLE.replace("heel_mid_range_d", "heel_midrange_d"), ["Did you mean heel_mid_range_displacement_mm?"]),
])
def test_what_is_wrong_is_named(tmp_path, text, words):
    path = written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        load_bench_file(path)
    for word in (f"{path}: ", *words):
        assert word in str(caught.value)
