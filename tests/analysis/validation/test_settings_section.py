"""The section on real walks: repeats bit for bit, agrees with linear propagation, and copes with what is missing."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from made_study import embedded_study
from made_study_walk import with_plate, with_walks

from vsf_drake.analysis.validation import settings_section as settings
from vsf_drake.analysis.validation.settings_section import fulcrum_estimates, settings_section
from vsf_drake.analysis.validation.settings_walks import NAMES, NoiseSizes, base_of
from vsf_drake.analysis.validation.study import KEEP, STEP_S
from vsf_drake.simulation.many import WalkCase, simulate_many

DESIGNS = ("same_recording", "same_session", "two_sessions")


@pytest.fixture(scope="module")
def table():
    return settings_section(embedded_study()).table


def walks_of(base, trials, positions=(0.108,)):
    cases = [WalkCase(trial=trial, fulcrum_m=x, step_s=STEP_S) for trial in trials for x in positions]
    return [base.record(outcome) for outcome in simulate_many(cases, keep=KEEP, workers=1)]


def with_options(study, **changes):
    return dataclasses.replace(study, options=dataclasses.replace(study.options, **changes))


def test_same_seed_gives_the_same_numbers_on_one_worker_and_on_two(monkeypatch):
    monkeypatch.setattr(settings, "QUICK_NOISY_WALKS", 18)
    study = with_walks(embedded_study(), embedded_study().walks[1])
    one, two = (settings_section(with_options(study, workers=workers)) for workers in (1, 2))
    assert json.dumps(one.table, sort_keys=True) == json.dumps(two.table, sort_keys=True)
    assert np.array_equal(one.arrays["effects"], two.arrays["effects"])
    other = settings_section(with_options(study, seed=1)).table["outcomes"][0]
    assert other["effect"] == one.table["outcomes"][0]["effect"]
    assert other["noise_sdd_two_sessions"] != one.table["outcomes"][0]["noise_sdd_two_sessions"]


def test_the_section_is_plain_and_counts_its_walks(table):
    assert json.loads(json.dumps(table, allow_nan=False)) == table
    assert table["walks"] == 3 * 3 * (1 + 2 * table["draws"]) and table["failed_walks"] == 0
    assert [row["name"] for row in table["outcomes"]] == list(NAMES)
    assert len(table["pairs"]) == 3 * len(NAMES) and table["held_out_trials"] == 3
    assert table["answer"].startswith("With the same motion")


def test_more_that_differs_between_two_walks_makes_more_noise(table):
    for row in table["outcomes"]:
        limits = [row[f"noise_sdd_{design}"] for design in DESIGNS]
        assert limits[0] < 1.05 * limits[1] < limits[2]
        if row["sdd_same_recording"] is not None:
            assert all(row[f"sdd_{d}"] >= row[f"noise_sdd_{d}"] for d in DESIGNS)


def test_a_stiffer_setting_carries_more_under_the_same_motion(table):
    rows = {row["name"]: row for row in table["outcomes"]}
    assert rows["vertical_second_bw"]["effect_ends"] > 0.3
    assert rows["cop_mid_stance_fl"]["effect_ends"] > 0.05
    assert table["stiffness_n_per_mm"] == sorted(table["stiffness_n_per_mm"])


def test_energy_has_no_plate_and_is_judged_by_noise_alone(table):
    for row in table["outcomes"][-2:]:
        assert row["unit"] == "J" and row["model_error_sd"] is None and row["sdd_two_sessions"] is None
        assert row["noise_sdd_two_sessions"] > 0.0


def test_a_difference_is_told_apart_if_it_exceeds_the_limit(table):
    for row in table["pairs"]:
        for design in DESIGNS:
            assert row[f"noise_told_apart_{design}"] == (abs(row["effect"]) > row[f"noise_sdd_{design}"])


def test_monte_carlo_agrees_with_linear_propagation_of_each_error():
    base = base_of(embedded_study().walks[1], NoiseSizes(session_deg=0.0, session_smooth_deg=0.0))
    noise, size = base.noise, base.noise.sizes
    count = base.trial.trajectory.values.shape[1]
    sigma = {i: np.radians(size.recording_deg) for i in noise.angles}
    sigma |= {i: 1e-3 * size.recording_mm for i in noise.place}
    errors = [sign * value * np.eye(count)[i] for i, value in sigma.items() for sign in (1.0, -1.0)]
    ends = np.array([record.values for record in walks_of(base, map(noise.perturbed, errors))])
    slopes = 0.5 * (ends[::2] - ends[1::2])  # of one standard deviation of each error
    random = np.random.default_rng(4)
    drawn = np.array([noise.recording(random) for _ in range(60)])
    found = np.std([record.values for record in walks_of(base, map(noise.perturbed, drawn))], axis=0, ddof=1)
    linear = np.std(drawn[:, list(sigma)] / np.array([*sigma.values()]) @ slopes, axis=0, ddof=1)
    assert found == pytest.approx(linear, rel=0.25)  # the same draws: what is left is that peaks are not linear
    assert np.median(found / linear) == pytest.approx(1.0, abs=0.05)
    # of 60 draws a standard deviation has a standard error of 9 %
    assert linear == pytest.approx(np.sqrt(np.sum(slopes**2, axis=0)), rel=0.4)


def test_the_fulcrum_is_found_where_the_model_itself_stood():
    base = base_of(embedded_study().walks[1])
    at = np.array([66.0, 87.0, 108.0, 129.0, 151.0])
    locked = np.array([record.locked for record in walks_of(base, [base.trial], (*(1e-3 * at), 0.097, 0.1405))])
    for target, true in ((locked[5], 97.0), (locked[6], 140.5)):
        assert float(fulcrum_estimates(at, locked[:5], target)) == pytest.approx(true, abs=1.0)
        assert float(fulcrum_estimates(at[::2], locked[:5:2], target)) == pytest.approx(true, abs=2.5)


def test_estimates_are_exact_where_the_force_is_linear_in_the_position_and_stop_at_the_ends():
    at, shape = np.array([0.0, 10.0, 20.0]), np.sin(np.linspace(0.0, 3.0, 50))
    curves = 1.0 + np.outer(at, shape)
    for true in (3.2, 10.0, 17.77):
        assert float(fulcrum_estimates(at, curves, 1.0 + true * shape)) == pytest.approx(true, abs=1e-6)
    assert float(fulcrum_estimates(at, curves, 1.0 + 25.0 * shape)) == 20.0
    assert np.isnan(fulcrum_estimates(at, curves * np.nan, shape))


def test_one_trial_without_contact_fit_still_says_what_noise_allows(monkeypatch):
    monkeypatch.setattr(settings, "QUICK_NOISY_WALKS", 24)
    study = embedded_study(with_contact=False)
    section = settings_section(with_walks(study, study.walks[0]))
    assert all(row["sdd_same_session"] is None and row["noise_sdd_same_session"] > 0.0
               for row in section.table["outcomes"])
    assert section.table["as_walked"] == [] and section.table["fulcrum_estimate_sd_mm"] is None
    said = " ".join(section.missing)
    assert "offsets of every walk" in said and "one setting" in said and "between the ends" in said
    assert "model's error is not known" in section.table["answer"]


def test_plates_without_centre_of_pressure_leave_its_error_unknown(monkeypatch):
    monkeypatch.setattr(settings, "QUICK_NOISY_WALKS", 54)
    study = embedded_study()
    blind = [with_plate(walk, has_cop=False, cop_W=np.full_like(walk.recorded.prosthetic_plate.cop_W, np.nan))
             for walk in study.walks]
    section = settings_section(with_walks(study, *blind))
    rows = {row["name"]: row for row in section.table["outcomes"]}
    assert rows["cop_mid_stance_fl"]["sdd_same_session"] is None and rows["cop_mid_stance_fl"]["model_error_n"] == 0
    assert rows["resultant_first_bw"]["sdd_same_session"] > 0.0
    assert any("centre of pressure" in sentence for sentence in section.missing)


def test_a_stance_that_no_plate_shows_as_a_whole_is_named(monkeypatch):
    study = embedded_study()
    walk = study.walks[0]
    silent = dataclasses.replace(walk, comparison=dataclasses.replace(walk.comparison, stances=()))
    section = settings_section(with_walks(study, silent))
    assert section.table["outcomes"] == [] and walk.label in section.missing[0]
