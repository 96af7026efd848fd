"""The fulcrum sweep of the validation on real walks, and with walks that fail."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_study import embedded_study
from made_study_walk import with_walks
from shown_chapter import Shown

from vsf_drake.analysis.comparison import compare, rmse
from vsf_drake.analysis.fulcrum_sweep import swept
from vsf_drake.analysis.validation import walking_section as module
from vsf_drake.analysis.validation.walking_section import QUICK_POSITIONS, sweep_entry, sweep_study, walking_section
from vsf_drake.report.validation.walking_chapter import walking_chapter
from vsf_drake.simulation.many import WalkOutcome
from vsf_drake.simulation.walk import Walker


@pytest.fixture(scope="module")
def sweeps():
    return sweep_study(embedded_study())


def test_error_is_least_where_the_fulcrum_stood_in_every_walk(sweeps):
    assert {label: sweep.right for label, sweep in sweeps.items()} == {"low_2": True, "medium_2": True, "high_2": True}
    assert [sweeps[label].at_end for label in ("low_2", "medium_2", "high_2")] == [True, False, True]


def test_wrong_position_is_an_error_of_a_different_size(sweeps):
    """From 10 to 32 N/mm: the far end of the carriage is another foot."""
    for sweep in sweeps.values():
        assert max(sweep.grf_rmse_bw) > 5.0 * min(sweep.grf_rmse_bw)


def test_error_of_a_position_is_that_of_a_walk_made_by_hand(sweeps):
    walk = embedded_study().walks[1]
    trial, i = walk.trial, 4
    walker = Walker(trial.subject, trial.model)
    made = walker.result(walker.walk(
        trial.trajectory, fulcrum_m=1e-3 * sweeps[walk.label].fulcrum_mm[i], start_s=trial.start_s, end_s=trial.end_s,
        step_s=2e-3, offsets=trial.offsets), trial, trial.offsets, energy=False)
    c = compare(made, trial.prosthetic_plate)
    sizes = [np.linalg.norm(force, axis=1)[c.scored] for force in (c.model, c.measured)]
    assert sweeps[walk.label].grf_rmse_bw[i] == pytest.approx(
        rmse(*sizes) / (trial.subject.mass_kg * 9.81), rel=1e-6)


def test_positions_where_the_walk_fails_are_unknown_and_the_others_stand(monkeypatch, sweeps):
    real = module.simulate_many

    def failing(cases, **options):
        return [WalkOutcome(case=o.case, failure="it diverged") if o.case.fulcrum_m > 0.12 else o
                for o in real(cases, **options)]

    monkeypatch.setattr(module, "simulate_many", failing)
    study = with_walks(embedded_study(), embedded_study().walks[0])
    found = sweep_entry(sweep_study(study)["low_2"])
    assert len(found["grf_rmse_bw"]) == QUICK_POSITIONS
    assert [e is None for e in found["grf_rmse_bw"]] == [x > 120.0 for x in found["fulcrum_mm"]]
    assert found["best_mm"] == pytest.approx(sweeps["low_2"].best_mm)


def test_sweep_of_which_every_walk_fails_has_no_least_error(monkeypatch):
    monkeypatch.setattr(module, "simulate_many", lambda cases, **_: [
        WalkOutcome(case=case, failure="it diverged") for case in cases])
    found = sweep_entry(sweep_study(with_walks(embedded_study(), embedded_study().walks[0]))["low_2"])
    assert found["best_mm"] is None and found["off_mm"] is None and found["right"] is None
    assert set(found["grf_rmse_bw"]) == {None}


@pytest.mark.parametrize(("errors", "known"), [
    ((0.3, 0.1, 0.2, 0.4), True), ((0.1, 0.2, 0.3, np.nan), True), ((np.nan, 0.1, 0.2, 0.3), False),
    ((np.nan, np.nan, 0.1, np.nan), False)])
def test_least_error_beside_a_walk_that_failed_names_no_position(errors, known):
    """It might be lower there: a number would be the failure's, not the foot's."""
    found = sweep_entry(swept(np.array([0.066, 0.087, 0.108, 0.129]), errors, true_m=0.087))
    assert [found[key] is not None for key in ("best_mm", "off_mm", "right")] == [known] * 3


def test_walks_of_a_sweep_that_failed_are_said_with_the_reason(monkeypatch):
    real = module.simulate_many
    monkeypatch.setattr(module, "simulate_many", lambda cases, **options: [
        WalkOutcome(case=o.case, failure="the worker runs other software") if o.case.fulcrum_m < 0.08 else o
        for o in real(cases, **options)])
    found = walking_section(with_walks(embedded_study(), embedded_study().walks[0]))
    assert found.table["sweeps"] == 0 and found.table["rows"][0]["sweep"]["right"] is None
    said = [sentence for sentence in found.missing if "other software" in sentence]
    assert len(said) == 1 and f"of the {QUICK_POSITIONS} walks" in said[0]
    assert "not known of low_2" in Shown(walking_chapter(found.table, found.arrays)).words


@pytest.mark.slow
def test_sweep_is_the_same_to_the_last_digit_on_one_worker_and_on_two(sweeps):
    study = embedded_study()
    two = sweep_study(dataclasses.replace(study, options=dataclasses.replace(study.options, workers=2)))
    assert two == sweeps
