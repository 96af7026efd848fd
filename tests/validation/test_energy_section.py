"""Stored and returned energy by fulcrum position, and what the energy section says of it."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from made_study import embedded_study, saved_section

from vsf_drake.base.files import resource
from vsf_drake.model.model_file import load_model
from vsf_drake.motion.trial import load_trial
from vsf_drake.validation import energy_section as energy
from vsf_drake.validation.energy_section import (
    ASKED_SHARE,
    EnergyCase,
    _judged,
    energy_section,
    walk_cases,
)
from vsf_drake.walks.embedded import embedded_trials

POSITIONS_MM = (66.0, 87.0, 108.0, 129.0, 151.0)


@pytest.fixture(scope="module")
def table(quick_validation):
    return saved_section(quick_validation, "energy").table


def by_trial(rows, key):
    curves = {}
    for row in rows:
        curves.setdefault(row.label, []).append(getattr(row, key))
    assert len(curves) == 3
    return np.array([*curves.values()])


def test_ledger_closes_within_one_percent_of_stored_energy_in_every_trial(table):
    assert len(table.trials) == 3
    assert 0.0 < table.ledger_remainder_share_max <= ASKED_SHARE == 0.01
    assert table.ledger_closes is True


@pytest.mark.parametrize(
    ("model", "least", "most"), [("nominal", 0.0, 0.1), ("soft_support", 0.3, 0.7)]
)
def test_a_stiff_support_holds_less_than_a_tenth_of_what_the_foot_stores_at_every_setting(
    model, least, most
):
    """The devices as calibrated; a support that yields under R = F x_load / x_fulcrum holds R²/2k,
    a third or more."""
    device = load_model(resource(f"models/{model}.yaml"))
    trials = [
        dataclasses.replace(load_trial(path), model=device) for path in embedded_trials(quick=True)
    ]
    walks = walk_cases(
        [
            EnergyCase(label=trial.name, trial=trial, fulcrum_m=trial.fulcrum_m, step_s=1e-3)
            for trial in trials
        ],
        workers=1,
    )
    for walk in walks:
        row = walk.stances[0].row
        assert least <= row.fulcrum_at_most_j / row.stored_j <= most
        assert row.remainder_share < 0.01


def test_softer_setting_stores_and_returns_more_as_recorded_and_under_the_same_load(table):
    """As measured on the real device (Glanzer & Adamczyk 2018), and as F^2/2k says."""
    assert table.softer_stores_more is True and table.softer_returns_more is True
    for key in ("stored_j", "returned_j"):
        assert (np.diff(by_trial(table.same_load, key)) < 0).all()


def test_stiffer_setting_stores_more_where_the_motion_is_kept_and_bears_more(table):
    """A spring that is pressed by a given path stores k x^2/2: the load, not the setting, tells
    what is stored."""
    for key in ("stored_j", "late_load_n"):
        assert (np.diff(by_trial(table.same_motion, key)) > 0).all()
    assert table.softer["stored_j"].same_motion is False


def test_load_is_kept_while_the_fulcrum_moves_over_the_five_published_positions(table):
    trials = {row.label: row for row in table.trials}
    for rows in (table.same_motion, table.same_load):
        assert (by_trial(rows, "fulcrum_mm") == POSITIONS_MM).all()
        for row in rows:
            if row.fulcrum_mm == trials[row.label].fulcrum_mm:
                assert row.stored_j == pytest.approx(trials[row.label].stored_j, rel=2e-3)
    for row in table.same_load:
        assert row.off_bw < 0.005
        assert row.late_load_n == pytest.approx(trials[row.label].late_load_n, rel=0.02)
        assert (row.height_mm == 0.0) == (row.fulcrum_mm == trials[row.label].fulcrum_mm)


def test_conditions_are_means_of_their_stances_and_twice_the_step_leaves_twice_the_remainder(table):
    assert [c.fulcrum_mm for c in table.conditions] == [66.0, 108.0, 151.0]
    for c, row in zip(table.conditions, table.trials, strict=True):
        assert c.means["stored_j"] == row.stored_j and c.means["stored_j_sd"] is None
        # first order, with some of the second
        assert 1.7 < row.coarse_remainder_max_j / row.remainder_max_j < 2.6


def test_walk_without_a_whole_stance_is_missing_and_stops_no_other():
    study = embedded_study()
    cut = dataclasses.replace(study.walks[0].trial, end_s=0.6)
    section = energy_section(
        dataclasses.replace(study, walks=(dataclasses.replace(study.walks[0], trial=cut),))
    )
    assert section.table.trials == () and section.table.ledger_remainder_share_max is None
    assert any("no whole stance" in sentence for sentence in section.missing)


def test_numbers_do_not_depend_on_the_number_of_threads():
    cases = [
        EnergyCase(label=walk.label, trial=walk.trial, fulcrum_m=x, step_s=2e-3)
        for walk in embedded_study().walks
        for x in (0.066, 0.151)
    ]
    one, two = (walk_cases(cases, workers=count) for count in (1, 2))
    for a, b in zip(one, two, strict=True):
        assert a.stances[0].row == b.stances[0].row


def test_what_the_results_own_ledger_misses_is_that_of_the_arrays_that_are_kept(table):
    """And it is below 1 % of what the foot stores for each millisecond of the step."""
    shares = []
    for walk, row in zip(embedded_study().walks, table.trials, strict=True):
        result = walk.result
        total = dict(zip(result.energy_names, result.energy_j.T, strict=True))["remainder"]
        loaded = np.flatnonzero(result.grf_W[:, 2] > 20.0)
        first, last = loaded[0], loaded[-1] + 1
        shares.append(np.abs(total[first:last] - total[first]).max() / row.stored_j)
    assert table.result_remainder_share_max == pytest.approx(max(shares), rel=1e-6)
    assert table.result_remainder_share_max < 10.0 * table.result_step_s


def test_trial_that_lacks_a_position_and_a_single_setting_give_no_verdict():
    """Two positions skipped over by a failed walk are no step of the fulcrum."""
    rows = [
        SimpleNamespace(label=label, fulcrum_mm=x, stored_j=e)
        for label, energies in (("whole", (15.0, 12.0, 8.0)), ("holed", (15.0, None, 20.0)))
        for x, e in zip((66.0, 108.0, 151.0), energies, strict=True)
        if e is not None
    ]
    found = _judged(rows, [], [], "stored_j")
    assert (found.same_load, found.same_load_against, found.recorded, found.both) == (
        True,
        (),
        None,
        None,
    )
    other = SimpleNamespace(label="other", fulcrum_mm=108.0, stored_j=12.0)
    assert _judged([*rows[3:], other], [], [], "stored_j").same_load is None
    rising = [SimpleNamespace(label="odd", fulcrum_mm=x, stored_j=x) for x in (66.0, 108.0, 151.0)]
    found = _judged([*rows[:3], *rising], rising, [], "stored_j")
    assert (found.same_load, found.same_load_against, found.same_motion) == (False, ("odd",), False)


def test_settings_of_two_persons_are_not_compared_as_recorded(monkeypatch):
    study = embedded_study()
    trial = study.walks[0].trial
    walked = walk_cases(
        [EnergyCase(label="", trial=trial, fulcrum_m=trial.fulcrum_m, step_s=2e-3)], workers=1
    )[0]
    stance = walked.stances[0]
    monkeypatch.setattr(
        energy,
        "walk_cases",
        lambda cases, **_: [
            dataclasses.replace(
                walked,
                case=case,
                stances=(
                    dataclasses.replace(
                        stance, row=dataclasses.replace(stance.row, fulcrum_mm=1e3 * case.fulcrum_m)
                    ),
                ),
            )
            for case in cases
        ],
    )
    other = dataclasses.replace(trial.subject, mass_kg=60.0)
    walks = (
        dataclasses.replace(study.walks[0], trial=dataclasses.replace(trial, subject=other)),
        *study.walks[1:],
    )
    section = energy_section(dataclasses.replace(study, walks=walks))
    assert (
        section.table.softer["stored_j"].recorded is None
        and section.table.softer_stores_more is None
    )
    assert any("more than one person" in sentence for sentence in section.missing)
    assert energy_section(study).table.softer["stored_j"].recorded is False
