"""The comparison of contacts: what runs at 1 ms stands on its weight, is as stiff as the bench, near the law."""

from __future__ import annotations

import csv
import json

import contact_alternatives
import pytest

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("contact_alternatives")
    return contact_alternatives.main(folder, quick=True), folder


@pytest.mark.parametrize("contact", ["drake_point", "hydroelastic"])
def test_drakes_contact_at_a_millisecond_is_right_in_the_end_and_near_the_law_on_the_way(made, contact):
    numbers, _ = made
    assert numbers["weight"] == pytest.approx((10.0 + 0.649) * 9.81)
    assert numbers[f"{contact}_settled"] == pytest.approx(1.0, abs=5e-3)
    assert numbers[f"{contact}_stiffness_n_per_m"] == pytest.approx(numbers["bench_stiffness"], rel=0.02)
    reference = json.loads((made[1] / "contact_alternatives.json").read_text())["reference_peak_n"]
    assert numbers[f"{contact}_peak_n"] == pytest.approx(reference, rel=0.15)
    assert numbers[f"{contact}_rms_n"] < 0.1 * reference


def test_what_is_refused_or_wrong_is_said_in_its_row(made):
    _, folder = made
    with open(folder / "contact_alternatives.csv", newline="") as stream:
        rows = {(row["contact"], row["plant and integrator"]): row for row in csv.DictReader(stream)}
    assert len(rows) == len(contact_alternatives.QUICK_CONTACTS) * len(contact_alternatives.QUICK_WAYS)
    refused = rows["kelvin_voigt", "discrete 1 ms"]
    assert refused["runs"] == "no"
    assert "explicit force" in refused["remark"]
    wrong = rows["kelvin_voigt", "cenic, steps to 1 ms"]
    assert wrong["runs"] == "no" or "not on its weight" in wrong["remark"]


def test_table_and_picture_are_written(made):
    _, folder = made
    text = (folder / "contact_alternatives.md").read_text(encoding="utf-8")
    assert text.count("\n| ") == 1 + len(contact_alternatives.QUICK_CONTACTS) * len(contact_alternatives.QUICK_WAYS)
    assert (folder / "contact_alternatives.png").stat().st_size > 10_000
