"""The reference subject's bench file is the virtual foot's bench."""

from __future__ import annotations

from pathlib import Path

import pytest
from virtual_laboratory import bench_truth
from virtual_laboratory.bench import LOADS_N
from virtual_laboratory.prosthesis import Prosthesis

from vsf_drake.bench_curves import load_bench_file
from vsf_drake.parameters import Subject

DATA = Path(__file__).resolve().parents[2] / "data" / "reference_subject"
SUBJECT = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")


def test_the_file_holds_what_the_foot_that_walked_shows_on_the_bench():
    read = load_bench_file(DATA / "bench.yaml")
    assert read.synthetic and "SYNTHETIC" in read.name
    assert read.max_load_n == LOADS_N[1]
    for x, k in zip(read.fulcrum_m, read.stiffness_n_per_m, strict=True):
        walked = Prosthesis(SUBJECT, x).bench()
        assert 1e-3 * k == pytest.approx(walked["forefoot_n_per_mm"], abs=6e-4)
        assert 1e-3 * read.heel_stiffness_n_per_m == pytest.approx(walked["heel_n_per_mm"], abs=6e-4)


def test_softest_and_stiffest_setting_are_the_published_ones():
    found = bench_truth.forefoot_n_per_mm()
    assert found[66] == pytest.approx(10.0, abs=0.01) and found[151] == pytest.approx(32.0, abs=0.01)
    assert list(found.values()) == sorted(found.values())
    assert bench_truth.heel_n_per_mm() == pytest.approx(65.0, abs=0.01)


def test_the_file_comes_out_again(tmp_path):
    again = bench_truth.write_bench(tmp_path / "made")
    assert load_bench_file(again) == load_bench_file(DATA / "bench.yaml")
    assert "SYNTHETIC" in again.read_text(encoding="utf-8").splitlines()[0]
