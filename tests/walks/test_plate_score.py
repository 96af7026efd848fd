"""Scores of many walks at once are those of each alone, to the bit, wherever they are made; and a
changed plate is another score."""

from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np
import pytest
from made_results import make_plate, make_walk

from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.batch import WalkCase, simulate_batch
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.comparison import compare, compare_all
from vsf_drake.walks.embedded import embedded_trials
from vsf_drake.walks.metrics import agreement, agreements, walk_metrics
from vsf_drake.walks.plate_score import AGREED, judged, plate_scorer

TWICE = ((0.5, 0.9), (1.1, 1.4))


@pytest.fixture(scope="module")
def trial():
    """The second half of a stance."""
    whole = load_trial(embedded_trials("exact")[0])
    return replace(whole, start_s=0.6, end_s=1.2)


def test_walks_that_are_compared_together_are_each_what_they_are_alone():
    """Loads of other length, none at all, two stances, another heading: none touches another."""
    turned = make_walk(scale=1.2)
    turned.q[:, turned.coordinate_names.index("pelvis_tz")] += 0.1 * turned.time_s
    walks = [
        make_walk(delay_s=0.02),
        turned,
        make_walk(stances=()),
        make_walk(stances=TWICE, cop_shift=(0.01, 0.002)),
        make_walk(stances=((0.5, 0.97),)),
    ]
    plate = make_plate(stances=TWICE)
    options = {"body_weight_n": 700.0, "foot_length_m": 0.26}
    together = compare_all(walks, plate)
    numbers = agreements(together, plate, **options)
    for walk, one, number in zip(walks, together, numbers, strict=True):
        alone = compare(walk, plate)
        for name in ("model", "measured", "scored", "heading"):
            assert getattr(one, name).tobytes() == getattr(alone, name).tobytes()
        for stance, other in zip(one.stances, alone.stances, strict=True):
            assert stance.model == other.model
            assert stance.model_cop.tobytes() == other.model_cop.tobytes()
            assert stance.measured_cop.tobytes() == other.measured_cop.tobytes()
        assert astuple(number) == astuple(agreement(alone, plate, **options))
    assert numbers[2].cop_points == 0 and numbers[2].cop_rmse_fl is None
    assert numbers[3].grf_rmse_bw < 1e-12 < numbers[0].grf_rmse_bw


def test_what_all_walks_beside_a_plate_share_cannot_be_changed_through_one_of_them():
    one = compare(make_walk(), make_plate())
    for shared in (one.time_s, one.scored):
        with pytest.raises(ValueError, match="read-only"):
            shared[:] = 0


def test_walks_on_other_instants_are_not_compared_together():
    with pytest.raises(ValueError, match="same instants"):
        compare_all([make_walk(), make_walk(start_s=0.3)], make_plate())


def test_a_batch_that_is_scored_keeps_no_arrays_and_has_the_numbers_of_each_walk(trial):
    cases = [
        WalkCase(trial=trial, fulcrum_m=0.08),
        WalkCase(trial=trial, fulcrum_m=0.12, step_s=2e-3),
        WalkCase(trial=trial, values={"coordinate.pelvis_ty": -0.6}),
        WalkCase(trial=trial, values={"coordinate.pelvis_tx": 0.004}),
    ]
    outcomes = simulate_batch(cases, keep=(), score=plate_scorer, workers=1)
    assert [outcome.ok for outcome in outcomes] == [True, True, False, True]
    assert judged(outcomes[2]) == (None, outcomes[2].failure) and not outcomes[2].scores
    walker = Walker(trial.subject, trial.model)
    for case, outcome in zip(cases, outcomes, strict=True):
        if outcome.ok:
            assert not outcome.arrays
            walk = walker.walk_trial(
                trial,
                fulcrum_m=case.fulcrum_m or trial.fulcrum_m,
                step_s=case.step_s,
                values=case.values,
            )
            result = walker.result(walk, trial, trial.offsets, energy=False)
            metrics = walk_metrics(result, trial.prosthetic_plate)
            assert {name: outcome.scores[name] for name in AGREED} == {
                name: getattr(metrics, name) for name in AGREED
            }
            assert judged(outcome) == (metrics.grf_rmse_bw, "")


def test_scores_are_kept_and_another_plate_is_scored_anew(trial, tmp_path):
    def swept(of):
        cases = [WalkCase(trial=of, fulcrum_m=x) for x in (0.08, 0.12)]
        return simulate_batch(cases, keep=(), score=plate_scorer, workers=1, cache=tmp_path)

    first, again = swept(trial), swept(trial)
    assert all(outcome.from_cache for outcome in again)
    assert [dict(o.scores) for o in first] == [dict(o.scores) for o in again]
    plate = trial.prosthetic_plate
    side = trial.subject.prosthetic_side
    heavier = replace(trial, plates={side: replace(plate, force_W=1.1 * plate.force_W)})
    other = swept(heavier)
    assert not any(outcome.from_cache for outcome in other)
    assert all(a.scores != b.scores for a, b in zip(first, other, strict=True))
    assert len({plate_scorer(each).key for each in (trial, heavier)}) == 2


def test_walks_beside_a_plate_of_another_time_fail_by_that_reason(trial):
    plate = trial.prosthetic_plate
    side = trial.subject.prosthetic_side
    later = replace(trial, plates={side: replace(plate, time_s=plate.time_s + 100.0)})
    cases = [WalkCase(trial=later), WalkCase(trial=trial)]
    lost, sound = simulate_batch(cases, keep=(), score=plate_scorer, workers=1)
    assert ": the plate's record, " in lost.failure and "Error" not in lost.failure
    assert "does not overlap the simulation" in lost.failure and sound.ok
    assert np.isfinite(sound.scores["grf_rmse_bw"])
