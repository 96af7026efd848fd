"""What a plate says of a foot whose force is unknown there counts for nothing."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_results import LIFT_S, MASS_KG, STRIKE_S, WEIGHT_N, make_plate, make_walk

from vsf_drake.motion.events import known_stances
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.embedded import embedded_trials
from vsf_drake.walks.metrics import stance_curve, walk_metrics
from vsf_drake.walks.momentum import missed


def test_a_force_where_it_is_unknown_is_compared_with_nothing():
    """Half a body weight beside the stance, which no foot put there; without the span it is an
    error of the model."""
    plate = make_plate()
    beside = (plate.time_s > STRIKE_S - 0.16) & (plate.time_s < STRIKE_S - 0.1)
    spoiled = dataclasses.replace(
        plate, force_W=plate.force_W + np.outer(0.5 * WEIGHT_N * beside, [0.0, 0.0, 1.0])
    )
    assert walk_metrics(make_walk(), spoiled).grf_rmse_bw > 0.05
    told = dataclasses.replace(spoiled, unknown_s=((STRIKE_S - 0.2, STRIKE_S - 0.05),))
    assert walk_metrics(make_walk(), told).grf_rmse_bw < 1e-4


def test_a_stance_that_the_plate_saw_in_part_is_no_stance():
    half = dataclasses.replace(make_plate(), unknown_s=((0.5 * (STRIKE_S + LIFT_S), LIFT_S),))
    found = walk_metrics(make_walk(), half)
    assert known_stances(half) == [] and found.stances == () and found.grf_rmse_bw is None
    assert found.extra_model_stances == 0, "that the model stands there is no contradiction"


def test_the_null_model_is_made_of_stances_that_are_known():
    later = (LIFT_S + 0.3, LIFT_S + 0.3 + (LIFT_S - STRIKE_S))
    plate = make_plate(end_s=3.0, stances=((STRIKE_S, LIFT_S), later))
    halved = np.where((plate.time_s > later[0] - 0.1)[:, None], 0.5 * plate.force_W, plate.force_W)
    spoiled = dataclasses.replace(
        plate, force_W=halved, unknown_s=((later[0] - 0.05, later[1] + 0.05),)
    )
    alone = stance_curve(make_plate(end_s=3.0), subject_mass_kg=MASS_KG)
    np.testing.assert_allclose(stance_curve(spoiled, subject_mass_kg=MASS_KG), alone, atol=1e-3)


def test_momentum_learns_nothing_where_the_plate_does_not_know():
    trial = load_trial(embedded_trials("exact")[3])
    walker = Walker(trial.subject, trial.model)
    assert missed(walker, trial) is not None
    side = trial.subject.prosthetic_side
    assert (
        missed(
            walker, dataclasses.replace(trial, unmeasured={side: ((trial.start_s, trial.end_s),)})
        )
        is None
    )


@pytest.mark.parametrize("spans", [(), ((0.3, 0.5),)])
def test_the_prosthetic_plate_knows_the_spans_of_its_trial(spans):
    trial = load_trial(embedded_trials("exact")[3])
    told = dataclasses.replace(trial, unmeasured={trial.subject.prosthetic_side: spans})
    assert told.prosthetic_plate.unknown_s == spans
