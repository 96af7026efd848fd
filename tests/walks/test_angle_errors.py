"""Errors of hip and knee that each walk has for itself: none change nothing, larger ones more, and
all are counted."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from made_study import embedded_study

from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks import angle_errors as module
from vsf_drake.walks.angle_errors import DRAWS, LIMB_ANGLES, SD_DEG, JudgedTrial, angle_error_rows
from vsf_drake.walks.metrics import walk_metrics


@pytest.fixture(scope="module")
def study():
    return embedded_study()


def judged(walk, null=None):
    return JudgedTrial(
        walk.trial, walk.role, walk.metrics.null_model_grf_rmse_bw if null is None else null
    )


@pytest.fixture(scope="module")
def rows(study):
    return angle_error_rows(
        [judged(walk) for walk in study.walks], step_s=study.options.step_s, seed=0
    )


def test_without_extra_errors_the_scores_of_the_study_come_back(study, rows):
    still, *_ = rows
    assert (still.sd_deg, still.walks, still.failed, still.role) == (
        0.0,
        len(study.walks),
        0,
        study.walks[0].role,
    )
    errors = [walk.metrics.grf_rmse_bw for walk in study.walks]
    assert still.grf_rmse_bw == pytest.approx(np.mean(errors), rel=1e-12)
    assert still.grf_rmse_bw_worst == pytest.approx(max(errors), rel=1e-12)
    assert still.beats_null == sum(
        walk.metrics.grf_rmse_bw < walk.metrics.null_model_grf_rmse_bw for walk in study.walks
    )


def test_larger_errors_are_never_better_in_the_mean(rows):
    assert [row.sd_deg for row in rows] == list(SD_DEG)
    errors = [row.grf_rmse_bw for row in rows]
    assert errors == sorted(errors) and errors[-1] > 2.0 * errors[0]
    assert all(row.walks + row.failed == DRAWS * 3 for row in rows[1:])


def test_errors_stay_in_the_angles_for_the_whole_walk(study, monkeypatch):
    """By a second way: the drawn angles added to the recorded ones, and the trial walked as if it
    were recorded so."""
    walk, seen = study.walks[0], []
    batch = module.simulate_batch
    monkeypatch.setattr(
        module,
        "simulate_batch",
        lambda cases, **how: [
            seen.append(case) or outcome
            for case, outcome in zip(cases, batch(cases, **how), strict=True)
        ],
    )
    monkeypatch.setattr(module, "SD_DEG", (1.0,))
    monkeypatch.setattr(module, "DRAWS", 1)
    (row,) = angle_error_rows([judged(walk)], step_s=2e-3, seed=5)
    drawn = seen[0].values
    side = walk.trial.subject.prosthetic_side[0]
    assert list(drawn) == [f"coordinate.{name}_{side}" for name in LIMB_ANGLES]
    assert 0.2 < np.degrees(np.sqrt(np.mean(np.square(list(drawn.values()))))) < 2.5
    recorded = walk.trial.trajectory
    values = np.array(recorded.values)
    for name, error in drawn.items():
        values[:, recorded.names.index(name.removeprefix("coordinate."))] += error
    trial = dataclasses.replace(
        walk.trial, trajectory=CoordinateTrajectory(recorded.time_s, values, recorded.names)
    )
    walker = Walker(trial.subject, trial.model)
    made = walker.walk(
        trial.trajectory,
        fulcrum_m=trial.fulcrum_m,
        start_s=trial.start_s,
        end_s=trial.end_s,
        offsets=trial.offsets,
        step_s=2e-3,
    )
    alone = walk_metrics(
        walker.result(made, trial, trial.offsets, energy=False), trial.prosthetic_plate
    )
    assert row.grf_rmse_bw == pytest.approx(alone.grf_rmse_bw, rel=1e-6)


def test_each_angle_of_each_walk_has_an_error_of_its_own_of_the_stated_size(study, monkeypatch):
    seen = []
    monkeypatch.setattr(module, "SD_DEG", (0.5,))
    monkeypatch.setattr(module, "DRAWS", 3000)
    monkeypatch.setattr(
        module,
        "simulate_batch",
        lambda cases, **_: [
            seen.append(list(case.values.values())) or SimpleNamespace(ok=False, failure="diverged")
            for case in cases
        ],
    )
    angle_error_rows([judged(walk) for walk in study.walks[:2]], step_s=2e-3, seed=0)
    drawn = np.degrees(np.array(seen)).reshape(2, 3000, len(LIMB_ANGLES))
    np.testing.assert_allclose(drawn.std(axis=1), 0.5, rtol=0.05)
    every = np.corrcoef(np.concatenate([*drawn], axis=1).T) - np.eye(2 * len(LIMB_ANGLES))
    assert np.abs(every).max() < 0.08, "of other angles and of other walks"


def test_a_trial_has_the_same_errors_whichever_trials_stand_beside_it(study, monkeypatch):
    """So that fit and validation, which order trials differently, speak of the same walks; and of
    two trials of one name each has its own."""
    seen = []
    monkeypatch.setattr(
        module,
        "simulate_batch",
        lambda cases, **_: [
            seen.append((case.trial.name, tuple(case.values.values())))
            or SimpleNamespace(ok=False, failure="diverged")
            for case in cases
        ],
    )

    def drawn(walks):
        seen.clear()
        angle_error_rows([judged(walk) for walk in walks], step_s=2e-3, seed=0)
        return [values for name, values in seen if name == study.walks[0].trial.name]

    alone, among = drawn(study.walks[:1]), drawn(study.walks[::-1])
    assert alone == among and len(set(alone)) == 1 + DRAWS * len(SD_DEG[1:])
    assert len(set(drawn([study.walks[0], study.walks[0]]))) == 1 + 2 * DRAWS * len(SD_DEG[1:])


def test_walks_below_their_own_null_model_are_counted_and_failed_ones_are_not(study, monkeypatch):
    """Errors made up: of the first trial 2, 4, 6 and 8 % body weight beside 5, of the second one
    lost of four."""
    made = iter([0.02, 0.04, 0.06, 0.08, 0.03, None, 0.05, 0.07, 0.01, 0.01, 0.01, 0.01])
    monkeypatch.setattr(module, "SD_DEG", (1.0,))
    monkeypatch.setattr(
        module,
        "simulate_batch",
        lambda cases, **_: [next(made) for _ in cases],
    )
    monkeypatch.setattr(module, "judged", lambda error: (error, ""))
    walk = study.walks[0].trial
    held, fitted = angle_error_rows(
        [
            JudgedTrial(walk, "held out", 0.05),
            JudgedTrial(walk, "held out", 0.05),
            JudgedTrial(walk, "fitted", None),
        ],
        step_s=2e-3,
        seed=0,
    )
    assert (held.walks, held.failed, held.beats_null, held.beats_null_of) == (7, 1, 3, 7)
    assert held.grf_rmse_bw == pytest.approx(np.mean([0.02, 0.04, 0.06, 0.08, 0.03, 0.05, 0.07]))
    assert held.grf_rmse_bw_worst == 0.08
    assert (fitted.walks, fitted.beats_null, fitted.beats_null_of) == (4, 0, 0)
