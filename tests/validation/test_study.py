"""A study's inputs: which walks it is made of, what each may claim, and what cannot be used."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from made_study import embedded_study

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.model.contact_file import load_contact
from vsf_drake.motion.fitted_trial import fingerprint
from vsf_drake.motion.trial import load_trial
from vsf_drake.validation import study as inputs
from vsf_drake.validation.study import FITTED, HELD_OUT, OFFSETS_FITTED, StudyOptions, make_study
from vsf_drake.walks.embedded import embedded_contact, embedded_trials

QUICK = StudyOptions(quick=True)


@pytest.mark.parametrize("tier", ["laboratory", "exact"])
def test_stored_contact_was_fitted_to_the_first_soft_and_the_first_stiff_trial(tier):
    contact = load_contact(embedded_contact(tier))
    prints = {fingerprint(load_trial(path)): path.stem for path in embedded_trials(tier)}
    assert [prints[trial.fingerprint] for trial in contact.trials] == ["low_1", "high_1"]
    assert contact.converged


def test_a_fitted_walk_cut_otherwise_is_not_held_out(tmp_path):
    home = embedded_contact().parent
    for file in home.glob("low_1*"):
        shutil.copy(file, tmp_path)
    text = (home / "low_1.yaml").read_text(encoding="utf-8")
    assert "../subject.yaml" in text and "start_s: 0," in text
    manifest = tmp_path / "cut.yaml"
    text = text.replace("../subject.yaml", str(home.parent / "subject.yaml"))
    manifest.write_text(text.replace("start_s: 0,", "start_s: 0.02,"), encoding="utf-8")
    [walk] = make_study([manifest], contact=embedded_contact(), options=QUICK).walks
    assert walk.role == FITTED


def test_quick_trials_were_not_seen_by_the_stored_fit():
    study = embedded_study()
    assert [walk.label for walk in study.walks] == ["low_2", "medium_2", "high_2"]
    assert {walk.role for walk in study.walks} == {HELD_OUT}
    assert [at.fulcrum_mm for at in study.conditions()] == [66.0, 108.0, 151.0]


def test_null_model_of_a_held_out_walk_is_a_fitted_trials_curve():
    """Of low_1, the only fitted one here: its curve over low_3's stance errs by 4.7 % BW, as a fit
    to both says too."""
    study = make_study([*embedded_trials()[:3]], contact=embedded_contact(), options=QUICK)
    walks = {walk.label: walk for walk in study.walks}
    assert [walks[name].role for name in ("low_1", "low_2", "low_3")] == [
        FITTED,
        HELD_OUT,
        HELD_OUT,
    ]
    assert walks["low_1"].metrics.null_model_grf_rmse_bw is None
    low_1, low_3 = (walks[name] for name in ("low_1", "low_3"))
    ours = low_3.comparison
    stance = ours.stances[0].measured
    rows = ours.within(stance.start_s, stance.end_s)
    theirs = low_1.comparison
    other = theirs.stances[0].measured
    curve = np.linalg.norm(theirs.measured, axis=1)
    share = (ours.time_s[rows] - stance.start_s) / stance.duration_s
    stretched = np.zeros(len(ours.time_s))
    stretched[rows] = np.interp(other.start_s + share * other.duration_s, theirs.time_s, curve)
    error = (stretched - np.linalg.norm(ours.measured, axis=1))[
        ours.scored
    ] / low_3.metrics.body_weight_n
    assert low_3.metrics.null_model_grf_rmse_bw == pytest.approx(
        float(np.sqrt(np.mean(error**2))), rel=0.01
    )


def test_without_a_contact_agreement_is_called_fitted_and_offsets_are_the_fits():
    study = make_study([embedded_trials()[0]], options=QUICK)
    walk = study.walks[0]
    assert walk.role == OFFSETS_FITTED
    assert walk.trial.offsets != walk.recorded.offsets
    assert walk.result.parameters["offsets"]["height_m"] == walk.trial.offsets.height_m


def test_a_trial_that_diverges_is_kept_apart_and_the_only_one_is_a_failed_simulation(monkeypatch):
    walk = inputs.walk_trial

    def diverges(trial, **options):
        if "medium" in trial.path.stem:
            raise SimulationError("the keel gave way", time_s=0.1)
        return walk(trial, **options)

    monkeypatch.setattr(inputs, "walk_trial", diverges)
    soft, medium = embedded_trials(quick=True)[:2]
    study = make_study([soft, medium], contact=embedded_contact(), options=QUICK)
    assert [walk.label for walk in study.walks] == ["low_2"]
    assert study.failed[0][0] == "medium_2" and "the keel gave way" in study.failed[0][1]
    with pytest.raises(SimulationError, match="the keel gave way"):
        make_study([medium], contact=embedded_contact(), options=QUICK)


def test_no_usable_trial_is_an_error_that_names_them_all(tmp_path):
    with pytest.raises(InputError, match=r"no trial can be used.*one\.yaml.*two\.yaml"):
        make_study([tmp_path / "one.yaml", tmp_path / "two.yaml"], options=QUICK)
    with pytest.raises(InputError, match="no trial"):
        make_study([], options=QUICK)


def test_another_persons_contact_is_named_for_every_trial(trial_files):
    trial_files.subject["mass_kg"] = 95.0
    manifest = trial_files.write()
    with pytest.raises(InputError, match="fitted to a person"):
        make_study([manifest], contact=embedded_contact(), options=QUICK)
