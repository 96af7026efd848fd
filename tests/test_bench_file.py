"""Bench files: what they say in SI, and what is refused."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsf_drake.bench_curves import BenchMeasurement, load_bench_file
from vsf_drake.errors import InputError

WHOLE = """\
# a comment
name: a foot
synthetic: true
forefoot: [{fulcrum_mm: 66, stiffness_n_per_mm: 10.0}, {fulcrum_mm: 151, stiffness_n_per_mm: 32}]
heel_stiffness_n_per_mm: 65.0
stiffness_uncertainty_n_per_mm: 0.5
max_load_n: 600
"""


def written(folder, text):
    path = folder / "bench.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def without(key):
    return "".join(line for line in WHOLE.splitlines(keepends=True) if not line.startswith(key))


def changed(old, new):
    assert old in WHOLE
    return WHOLE.replace(old, new)


def test_a_file_is_read_into_si(tmp_path):
    assert load_bench_file(written(tmp_path, WHOLE)) == BenchMeasurement(
        name="a foot", synthetic=True, fulcrum_m=(0.066, 0.151), stiffness_n_per_m=(10e3, 32e3),
        heel_stiffness_n_per_m=65e3, uncertainty_n_per_m=500.0, max_load_n=600.0)


def test_heel_and_synthetic_may_be_left_out(tmp_path):
    assert load_bench_file(written(tmp_path, without("heel"))).heel_stiffness_n_per_m is None
    assert load_bench_file(written(tmp_path, without("synthetic"))).synthetic is False


@given(fulcrums_mm=st.lists(st.integers(10, 1000), min_size=1, max_size=8, unique=True))
def test_positions_come_back_as_written(tmp_path_factory, fulcrums_mm):
    rows = "".join(f"  - {{fulcrum_mm: {x}, stiffness_n_per_mm: 12}}\n" for x in sorted(fulcrums_mm))
    text = without("forefoot") + f"forefoot:\n{rows}"
    read = load_bench_file(written(tmp_path_factory.mktemp("bench"), text))
    assert [round(1e3 * x, 9) for x in read.fulcrum_m] == sorted(fulcrums_mm)


@pytest.mark.parametrize("key", ["name", "forefoot", "stiffness_uncertainty", "max_load"])
def test_a_missing_key_is_named(tmp_path, key):
    with pytest.raises(InputError, match=f"{key}.*the key is missing"):
        load_bench_file(written(tmp_path, without(key)))


@pytest.mark.parametrize(("text", "words"), [
    (WHOLE + "stifness: 3\n", ["line 8", "stifness", "unknown key"]),
    (changed("synthetic", "synthetical"), ["Did you mean synthetic?"]),
    (WHOLE + "max_load_n: 700\n", ["max_load_n", "stands twice"]),
    (changed("10.0}", "10.0, load_n: 3}"), ["line 4", "forefoot[0].load_n", "unknown key"]),
    (changed("151", "0.151"), ["forefoot[1].fulcrum_mm", "0.151 mm", "between 10 and 1000 mm"]),
    (changed("10.0", "10000"), ["forefoot[0].stiffness_n_per_mm", "between 0.1 and 1000 N/mm"]),
    (changed("10.0", "-10"), ["forefoot[0].stiffness_n_per_mm", "outside its physical range"]),
    (changed("10.0", ".nan"), ["forefoot[0].stiffness_n_per_mm", "not a finite number"]),
    (changed("10.0", "soft"), ["forefoot[0].stiffness_n_per_mm", "'soft' is not a number"]),
    (changed("65.0", "65000"), ["heel_stiffness_n_per_mm", "between 0.1 and 1000 N/mm"]),
    (changed("0.5", "0"), ["stiffness_uncertainty_n_per_mm", "outside its physical range"]),
    (changed("600", "200"), ["max_load_n", "200 N", "mean slope above 200 N", "largest load"]),
    (changed("600", "0.6"), ["max_load_n", "0.6 N"]),
    (changed("151", "66"), ["forefoot[1].fulcrum_mm", "66 mm stands twice"]),
    (changed("66", "152"), ["forefoot[1].fulcrum_mm", "151 mm follows 152 mm", "must increase"]),
    (without("forefoot") + "forefoot: []\n", ["forefoot", "holds no setting"]),
    (without("forefoot") + "forefoot: {66: 10.0, 151: 32.0}\n", ["forefoot", "must be a list"]),
    (without("forefoot") + "forefoot: [10.0, 32.0]\n", ["forefoot[0]", "must be a mapping"]),
    ("", ["is empty", "forefoot"]),
    ("name: [", ["not valid YAML"]),
])
def test_what_is_wrong_is_named(tmp_path, text, words):
    path = written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        load_bench_file(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    for word in words:
        assert word in message


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        load_bench_file(tmp_path / "none.yaml")
