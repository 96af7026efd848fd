"""Standing in the validation: the ground carries the weight, and a person who cannot stand is reported."""

from __future__ import annotations

import json

import pytest
from made_study import embedded_study
from made_study_walk import with_walks

from vsf_drake.analysis.validation import bench_section as module
from vsf_drake.analysis.validation.bench_section import standing_section
from vsf_drake.errors import SimulationError


@pytest.fixture(scope="module")
def section():
    return standing_section(embedded_study())


def test_who_stands_still_is_carried_with_the_whole_mass(section):
    """Newton: the mean force over a time without net momentum change is the weight."""
    rows = json.loads(json.dumps(section.table, allow_nan=False))["rows"]
    assert [row["fulcrum_mm"] for row in rows] == [66.0, 108.0, 151.0]
    for row in rows:
        assert row["mass_predicted_kg"] == pytest.approx(row["mass_known_kg"], rel=1e-4)
        assert row["mass_error"] == pytest.approx(row["mass_predicted_kg"] / 78.0 - 1.0)
        assert row["stands"] and row["drift_mm"] < 1.0
    assert abs(section.table["worst_mass_error"]) < 1e-4


def test_paper_predicts_too_little_by_its_published_share(section):
    assert section.table["paper_mass_error"] == -0.026


def test_both_feet_carry_the_weight_at_every_instant_after_settling(section):
    both = section.arrays["standing_0_prosthetic_n"] + section.arrays["standing_0_intact_n"]
    late = section.arrays["standing_0_time_s"] > 1.0
    assert both[late] == pytest.approx(section.table["rows"][0]["weight_n"], rel=1e-3)


def test_short_form_is_said(section):
    assert section.table["duration_s"] == pytest.approx(2.0)
    assert any("short form" in sentence for sentence in section.missing)


def test_one_condition_alone_is_stood_on():
    study = embedded_study()
    rows = standing_section(with_walks(study, study.walks[1])).table["rows"]
    assert [row["fulcrum_mm"] for row in rows] == [108.0]


def test_failed_standing_is_told_and_the_others_stand(monkeypatch):
    real = module.simulate_standing

    def failing(*arguments, fulcrum_m, **options):
        if fulcrum_m < 0.1:
            raise SimulationError("the person fell", time_s=0.1)
        return real(*arguments, fulcrum_m=fulcrum_m, **options)

    monkeypatch.setattr(module, "simulate_standing", failing)
    found = standing_section(embedded_study())
    assert found.table["rows"][0]["mass_predicted_kg"] is None
    assert "the person fell" in found.table["rows"][0]["failure"]
    assert found.table["rows"][1]["failure"] is None
    assert any("66 mm failed" in sentence for sentence in found.missing)
    assert "standing_0_time_s" not in found.arrays


def test_progress_runs_from_condition_to_condition():
    told = []
    study = with_walks(embedded_study(), *embedded_study().walks[:2])
    standing_section(study, progress=lambda what, fraction: told.append(fraction))
    assert told == sorted(told) and told[-1] == pytest.approx(1.0, abs=0.02)
