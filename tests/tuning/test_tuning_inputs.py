"""Which trials a tuning takes, and what is done to them before they are walked."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.model.contact_file import load_contact
from vsf_drake.model.parameters import FootParameters
from vsf_drake.motion.trial import load_trial
from vsf_drake.tuning import inputs
from vsf_drake.tuning.inputs import embedded_tuning_trials, load_tuning_trials
from vsf_drake.tuning.options import TuningOptions, design_variables
from vsf_drake.walks.embedded import embedded_contact, embedded_trials

LOW, MEDIUM, HIGH = embedded_trials(quick=True)


def test_embedded_trials_are_repeated_walks_at_the_middle_setting():
    paths = embedded_tuning_trials(level=1)
    assert [path.stem for path in paths] == ["medium_1", "medium_2", "medium_3"]
    assert {load_trial(path).fulcrum_m for path in paths} == {0.108}
    assert (
        embedded_tuning_trials(level=1, quick=True) == embedded_tuning_trials(level=2) == (MEDIUM,)
    )


def test_embedded_trials_come_with_the_contact_that_was_fitted_to_their_person():
    given = load_tuning_trials([], quick=True)
    recorded = load_trial(MEDIUM)
    fitted = load_contact(embedded_contact()).values
    assert given.labels == ("medium_2",) and given.notes == ()
    assert all(trial.synthetic for trial in given.trials)
    assert given.recorded_mm == [108.0]
    assert given.trials[0].model != recorded.model
    assert given.trials[0].model.foot.fulcrum.stiffness_n_per_m == fitted["fulcrum.stiffness"]
    assert any(name.startswith("medium_2: contact: contact.yaml") for name in given.inputs)


def test_without_a_contact_offsets_go_to_the_trial_and_progress_runs_forward(monkeypatch):
    shares = []

    def fit_offsets(trial, progress):
        for count in (1, 10, 30):
            progress(count, 5.0)
        return SimpleNamespace(
            doubts=["not converged."], offsets=type(trial.offsets)(height_m=0.004)
        )

    monkeypatch.setattr(inputs, "fit_offsets", fit_offsets)
    given = load_tuning_trials([LOW, HIGH], progress=lambda what, share: shares.append(share))
    assert [trial.offsets.height_m for trial in given.trials] == [0.004, 0.004]
    assert given.notes[0].startswith("UNFITTED") and "no prediction" in given.notes[0]
    assert given.notes[1:] == ("low_2: not converged.", "high_2: not converged.")
    assert shares == sorted(shares) and 0.0 < shares[0] and shares[-1] < 1.0


def test_a_trial_that_is_named_twice_or_not_there_is_refused():
    with pytest.raises(InputError, match="is named twice"):
        load_tuning_trials(
            [LOW, LOW.parent / ".." / LOW.parent.name / LOW.name], contact=embedded_contact()
        )
    with pytest.raises(InputError, match="there is no such file"):
        load_tuning_trials([LOW.with_name("none.yaml")])


def test_a_passive_foot_is_not_tuned():
    foot = FootParameters()
    fixed = replace(foot, fulcrum=replace(foot.fulcrum, rearmost_m=0.1, foremost_m=0.1))
    with pytest.raises(InputError, match=r"no fulcrum.*nothing to tune"):
        design_variables(TuningOptions(), [foot, fixed])
