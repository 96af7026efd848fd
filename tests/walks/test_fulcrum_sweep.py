"""Where the error over the fulcrum's position says that it stood, and when the stated position is
doubted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.fit.assessment import sweep_fulcrum
from vsf_drake.model.contact_file import load_contact
from vsf_drake.model.parameters import ModelParameters
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.comparison import compare
from vsf_drake.walks.embedded import embedded_contact, embedded_trials
from vsf_drake.walks.fulcrum_sweep import SWEEP_STEP_S, sweep_positions, swept
from vsf_drake.walks.metrics import walk_metrics
from vsf_drake.walks.plate_score import fulcrum_errors

AT = np.array([0.066, 0.087, 0.108, 0.129, 0.151])


@pytest.mark.parametrize(
    ("stated_m", "floor", "doubted"),
    [
        (0.108, 0.02, False),
        (0.151, 0.02, True),
        (0.087, 0.02, True),
        (0.151, 0.3, False),
        (0.112, 0.0, False),
    ],
)
def test_another_position_is_told_only_where_it_fits_clearly_better(stated_m, floor, doubted):
    """Errors sqrt(floor² + (3 x)²) of a fulcrum x m away: 13 % at 43 mm, 6 % at 21; a floor of 30 %
    hides them."""
    errors = np.hypot(floor, 3.0 * (AT - 0.108))
    found = swept(AT, errors, true_m=stated_m)
    assert found.doubted == doubted
    assert found.gain_bw == pytest.approx(float(np.interp(stated_m, AT, errors)) - floor)


def test_walks_that_failed_doubt_nothing():
    lost = swept(AT, [np.nan] * 5, true_m=0.108)
    beside = swept(AT, [0.02, 0.05, np.nan, np.nan, np.nan], true_m=0.151)
    assert (lost.gain_bw, lost.doubted) == (beside.gain_bw, beside.doubted) == (None, False)


def test_a_manifest_with_another_setting_than_the_walk_had_is_doubted_by_a_fit_of_two_others():
    """The embedded fit is of low_1 and high_1; medium_1, which it has not seen, was walked at
    108 mm."""
    trial = trial_with(
        load_trial(next(path for path in embedded_trials("exact") if path.stem == "medium_1")),
        load_contact(embedded_contact("exact")),
    )
    walker, positions = Walker(trial.subject, trial.model), sweep_positions(trial)

    errors = fulcrum_errors(walker, trial, positions)
    assert not np.isnan(errors).any()
    middle = len(positions) // 2
    walk = walker.walk_trial(trial, fulcrum_m=positions[middle], step_s=SWEEP_STEP_S)
    result, plate = walker.result(walk, trial, trial.offsets, energy=False), trial.prosthetic_plate
    alone = walk_metrics(result, plate, comparison=compare(result, plate))
    assert alone.grf_rmse_bw == errors[middle]
    assert not swept(positions, errors, true_m=0.108).doubted
    for wrong in (0.066, 0.151):
        found = swept(positions, errors, true_m=wrong)
        assert (
            found.doubted
            and found.best_mm == pytest.approx(108.0, abs=10.5)
            and found.gain_bw > 0.05
        )


def test_a_walk_that_fails_has_no_error_and_ends_no_other_but_what_cannot_be_walked_is_told():
    trial = load_trial(embedded_trials("exact")[0])
    walker = Walker(trial.subject, trial.model)
    buried = {"values": {"coordinate.pelvis_ty": -0.6}}
    assert np.isnan(fulcrum_errors(walker, trial, AT[:2], **buried)).all()
    with pytest.raises(InputError, match=r"values\['nonsense'\]|nonsense"):
        fulcrum_errors(walker, trial, AT[:2], values={"nonsense": 1.0})


def test_the_fulcrum_of_a_passive_foot_is_not_looked_for():
    model = ModelParameters()
    fixed = replace(model.foot.fulcrum, rearmost_m=0.1, foremost_m=0.1)
    trial = replace(
        load_trial(embedded_trials("exact")[0]),
        model=replace(model, foot=replace(model.foot, fulcrum=fixed)),
    )
    assert sweep_fulcrum(None, trial, None) is None
