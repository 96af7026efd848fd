"""The reference subject's curves are the virtual foot's bench."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from virtual_laboratory import bench_curve_truth
from virtual_laboratory.prosthesis import Prosthesis

from vsf_drake.bench_curves import load_bench_curves
from vsf_drake.parameters import Subject

DATA = Path(__file__).resolve().parents[2] / "data" / "reference_subject"
SUBJECT = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")


def test_the_curves_have_the_stiffness_of_the_foot_that_walked():
    read = load_bench_curves(DATA / "bench_curves.csv")
    heel = read.curves[-1]
    for curve in read.curves[:-1]:
        walked = Prosthesis(SUBJECT, curve.fulcrum_m).bench()
        for one, name in ((curve, "forefoot"), (heel, "heel")):
            low, high = np.interp([200.0, 600.0], one.load_n, one.displacement_m)
            assert 0.4 / (high - low) == pytest.approx(walked[f"{name}_n_per_mm"], rel=5e-5)


def test_a_softer_setting_gives_way_further_at_every_load():
    curves = load_bench_curves(DATA / "bench_curves.csv").curves[:-1]
    for softer, stiffer in itertools.pairwise(curves):
        np.testing.assert_array_equal(softer.load_n, stiffer.load_n)
        assert (softer.displacement_m[1:] > stiffer.displacement_m[1:]).all()


def test_the_curve_file_comes_out_again(tmp_path):
    again = bench_curve_truth.write_bench_curves(tmp_path / "made").read_text(encoding="utf-8")
    assert again == (DATA / "bench_curves.csv").read_text(encoding="utf-8")
    assert "SYNTHETIC" in again.splitlines()[0]
