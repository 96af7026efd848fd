"""A walk at a setting between recorded ones: at a recorded setting it is the recorded walk, loads
follow statics, and the table holds what is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.base.sentences import say
from vsf_drake.model.contact_file import load_contact
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.reactions import follow
from vsf_drake.tuning.answered import carrying, predict
from vsf_drake.walks.answer import answer_of
from vsf_drake.walks.embedded import embedded_contact, embedded_trials
from vsf_drake.walks.momentum import MomentumCorrection
from vsf_drake.walks.prediction import PHYSICS

STEP_S = 2e-3


@pytest.fixture(scope="module")
def recorded():
    """Trials as recorded, by label, and their contact."""
    paths = {path.stem: path for path in embedded_trials("exact")}
    names = ("low_1", "low_2", "high_1", "high_2")
    return [load_trial(paths[name]) for name in names], load_contact(embedded_contact("exact"))


@pytest.fixture(scope="module")
def found(recorded):
    trials, contact = recorded
    return predict(trials, contact, fulcrum_m=0.108, step_s=STEP_S)


def test_the_mean_of_one_walk_is_that_walk(recorded, shared_walker):
    """Told over shares of stance and back in time, the foot carries what it did: within 1 % of
    body weight, which is a third of a millimetre of height."""
    (soft, _, stiff, _), contact = recorded
    own = trial_with(soft, contact)
    answer = answer_of([own, trial_with(stiff, contact)])
    again = answer.trial_at(own.fulcrum_m)
    walk, same = (shared_walker.walk_trial(one, step_s=STEP_S) for one in (own, again))
    strike = own.prosthetic_plate
    shift = strike.time_s[np.flatnonzero(strike.force_W[:, 2] > 20.0)[0]]
    at = np.linspace(-0.1, 0.9, 500)
    forces = [
        np.interp(at + by, each.time_s, each.grf_W[:, 2])
        for each, by in ((walk, shift), (same, 0.0))
    ]
    weight = own.subject.mass_kg * 9.81
    assert np.sqrt(np.mean((forces[0] - forces[1]) ** 2)) < 0.01 * weight


@pytest.mark.parametrize(("joint", "turns"), [("knee_angle", "knee"), ("hip_flexion", "hip")])
def test_a_force_through_a_joint_changes_no_moment_there(made_tuning, joint, turns):
    part = made_tuning("medium_2").parts[0]
    result = part.at(part.own, step_s=STEP_S)
    walk = result.walk
    tree = walk.mechanism.tree
    index = tree.index(f"{joint}_{part.trial.subject.prosthetic_side[0]}")
    motion = follow(
        tree,
        walk.record.q,
        walk.record.v,
        bodies=[0],
        coordinates=[index],
        inside=np.zeros(len(tree.body_names), dtype=bool),
    ).joints[:, 0]
    axis, moved = motion[:, :3], motion[:, 3:]
    centre = np.cross(axis, moved)  # the point of the axis that is nearest to W's origin
    force = np.tile([30.0, -20.0, 500.0], (len(centre), 1))
    through = np.column_stack([np.cross(centre, force), force])
    ground = result.loads.ground[..., 0]
    column = part.joints.index(f"{joint}_{part.trial.subject.prosthetic_side[0]}")
    before = result.loads.joints[:, column, 0]
    same = carrying(part, result, ground)
    assert np.allclose(same.loads.joints, result.loads.joints, atol=1e-9)
    pushed = carrying(part, result, ground + through)
    assert np.allclose(pushed.loads.joints[:, column, 0], before, atol=1e-6)
    # the same force 0.1 m ahead: its arm about the joint's axis
    arm = np.array([0.1, 0.0, 0.0])
    ahead = np.column_stack([np.cross(centre + arm, force), force])
    moment = np.sum(axis * np.cross(arm, force), axis=1)
    changed = carrying(part, result, ground + ahead).loads.joints[:, column, 0]
    assert np.allclose(changed, before - moment, atol=1e-6)


def test_the_socket_bears_what_the_ground_gives_more(made_tuning):
    """The norm of the force on the residual limb changes by the ground's force, whatever the
    socket's axes: what hangs below it is taken as massless for the difference."""
    part = made_tuning("medium_2").parts[0]
    result = part.at(part.own, step_s=STEP_S)
    force = np.tile([0.0, 0.0, 100.0], (len(result.frame.time_s), 1))
    ground = result.loads.ground[..., 0] + np.column_stack([0.0 * force, force])
    pushed = carrying(part, result, ground)
    change = (pushed.loads.socket - result.loads.socket)[:, :3, 0]
    assert np.allclose(np.linalg.norm(change, axis=1), 100.0, rtol=0.02)


def test_it_says_setting_peaks_spread_and_that_it_interpolates(found):
    table = found.table
    assert "At 108 mm" in found.sentences[0]
    assert any("does not know how people adapt" in line for line in found.sentences)
    assert not table.recorded_setting
    assert table.converged
    assert [walk.fulcrum_mm for walk in table.recorded] == [66.0, 66.0, 151.0, 151.0]
    assert {walk.fulcrum_mm for walk in table.moved} == {108.0}
    assert 0.6 < table.stance_s < 0.85
    assert found.arrays[PHYSICS].shape == (101, 3)
    assert {row.seen for row in table.rows()} <= {True, False}
    for row in table.rows():
        assert min(row.soft, row.stiff) <= row.between <= max(row.soft, row.stiff)


def test_a_load_that_seems_to_differ_may_do_so_by_chance_and_it_says_how_many_would(found):
    """Of twelve true nulls at a level of 0.05 each, 12 x 0.05 on average."""
    rows = [replace(row, seen=k == 0) for k, row in enumerate(found.table.rows())]
    told = " ".join(say("predicted", t=found.table, rows=rows, near_mm=5.0))
    assert len(rows) == 12 and "Of 12 loads and costs 1 differ" in told
    assert "of 12 that do not differ, 0.6 would seem to" in told
    none = [replace(row, seen=False) for row in rows]
    assert "would seem" not in " ".join(say("predicted", t=found.table, rows=none, near_mm=5.0))


def test_where_the_intact_foot_was_not_seen_to_swing_it_says_what_is_left(found):
    unseen = MomentumCorrection(believed=False, why_not="window")
    table = replace(found.table, correction=unseen)
    told = say("predicted", t=table, rows=table.rows(), near_mm=5.0)
    (line,) = (line for line in told if "Momentum does not correct" in line)
    assert "the intact foot was not seen to swing" in line
    assert "the mean of the plates, interpolated" in line


def test_the_foot_at_the_middle_stores_less_than_at_the_soft_setting_and_more_than_at_the_stiff(
    found,
):
    """Of two springs under about one load the softer one stores more."""
    (row,) = (row for row in found.table.rows() if row.name == "stored_energy")
    assert row.soft > row.predicted > row.stiff


def test_a_setting_beyond_the_recorded_ones_and_another_person_are_refused(recorded):
    trials, contact = recorded
    middle = [
        replace(trial, fulcrum_m=0.09) if trial.fulcrum_m < 0.07 else trial for trial in trials
    ]
    with pytest.raises(InputError, match="outside of the recorded settings, 90 to 151 mm"):
        predict(middle, contact, fulcrum_m=0.07)
    heavier = replace(trials[0].subject, mass_kg=1.2 * trials[0].subject.mass_kg)
    with pytest.raises(InputError, match="it was fitted to a person of"):
        predict([replace(trial, subject=heavier) for trial in trials], contact, fulcrum_m=0.1)
