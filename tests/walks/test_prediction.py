"""Prediction in layers: momentum mends what is wrong with one trial, and the person's own curve
needs no plate of it.

The walks are of the unfitted model; their plates are made so that the truth is known.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from made_contact import made_contact, made_person_walk
from made_fit import made_layer_row, made_layers, recording

from vsf_drake.base.files import plain, resource
from vsf_drake.model.contact_file import FittedTrial, MomentumBias, PersonCurve, load_contact
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.fitted_trial import fingerprint
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.reactions import follow
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.comparison import PERCENT
from vsf_drake.walks.embedded import embedded_contact
from vsf_drake.walks.momentum import (
    PRIOR,
    SIGMA_BW,
    MomentumCorrection,
    missed,
    needed_force,
    spread_of,
    swings,
)
from vsf_drake.walks.person_curve import DOUBTED
from vsf_drake.walks.prediction import (
    MOMENTUM,
    PERSON,
    PHYSICS,
    compared,
    judged,
    layer_curves,
    layer_sentences,
    layers_of,
    learned,
    predict,
    recording_of,
)

STEP_S = 2e-3


@pytest.fixture(scope="module")
def trial():
    return recording("medium_1")


@pytest.fixture(scope="module")
def walker(trial):
    return Walker(trial.subject, trial.model)


def walked(walker, trial):
    return walker.walk(
        trial.trajectory,
        fulcrum_m=trial.fulcrum_m,
        start_s=trial.start_s,
        end_s=trial.end_s,
        step_s=STEP_S,
        offsets=trial.offsets,
    )


@pytest.fixture(scope="module")
def walk(walker, trial):
    return walked(walker, trial)


@pytest.fixture(scope="module")
def true_trial(trial, walk):
    """The trial on a plate that measured what the model gives."""
    time, side = walk.record.time_s, trial.subject.prosthetic_side
    plate = replace(
        trial.prosthetic_plate,
        time_s=time,
        force_W=walk.prosthetic.grf_W,
        cop_W=np.nan_to_num(walk.prosthetic.cop_W),
        free_moment_nm=walk.prosthetic.free_moment_nm,
    )
    return replace(trial, plates={**trial.plates, side: plate})


def bare(*trials, **learnt):
    """A contact that changes nothing, fitted to these trials."""
    own = tuple(
        FittedTrial(name=str(i), fingerprint=fingerprint(one)) for i, one in enumerate(trials)
    )
    return made_contact(values={}, curves=(), trials=own, **learnt)


def bias_of(coefficients, sd=None, trials=("0" * 64, "1" * 64)):
    c, s = (None if values is None else tuple(map(float, values)) for values in (coefficients, sd))
    return MomentumBias(
        fore_aft_bw=c[:3],
        vertical_bw=c[3:],
        fore_aft_sd_bw=s and s[:3],
        vertical_sd_bw=s and s[3:],
        trials=trials,
    )


# Momentum.


def test_what_the_ground_must_give_is_mass_times_the_acceleration_of_its_centre_less_gravity(
    walk, trial
):
    """Second method: the second difference of the whole person's mass moment, from the poses alone,
    about the start of the step, which the stepper's equation M(q_k) (v_k+1 - v_k) / h is about."""
    tree, record = walk.mechanism.tree, walk.record
    moment = follow(
        tree,
        record.q,
        record.v,
        bodies=(0,),
        coordinates=(),
        inside=np.ones(len(tree.body_names), dtype=bool),
    )
    force = np.diff(moment.mass_moment, n=2, axis=0) / STEP_S**2 + [0.0, 0.0, moment.mass * GRAVITY]
    (window,) = swings(walk)
    needed, weight = needed_force(walk)[window], trial.subject.mass_kg * GRAVITY
    np.testing.assert_allclose(
        needed / weight, force[window.start - 2 : window.stop - 2] / weight, atol=1e-3
    )


def test_the_windows_lie_in_single_support_of_the_prosthesis(walk, trial):
    """Told by the plates under both feet, which `swings` does not see."""
    stances = {
        side: [(s.start_s, s.end_s) for s in find_stances(plate.time_s, plate.force_W[:, 2])]
        for side, plate in trial.plates.items()
    }
    own = stances.pop(trial.subject.prosthetic_side)
    (other,) = stances.values()
    for window in swings(walk):
        start, end = walk.record.time_s[window][[0, -1]]
        assert end - start > 0.3 and any(a < start and end < b for a, b in own)
        assert not any(a < end and start < b for a, b in other)


@pytest.mark.parametrize("height_m", [2e-3, -2e-3])
def test_a_walk_whose_height_is_wrong_is_mended_where_momentum_is_exact(
    walker, true_trial, height_m
):
    """The bias is that of the true walk, so that momentum knows its force; 2 mm are two standard
    deviations of what the layer believes before, and some 6 % body weight."""
    bias = bias_of(missed(walker, true_trial))
    wrong = replace(
        true_trial, offsets=GeometricOffsets(height_m=true_trial.offsets.height_m + height_m)
    )
    found = predict(wrong, bare(momentum=bias), walker=walker, step_s=STEP_S)
    assert found.correction.believed and found.correction.height_m * height_m < 0.0
    beside = compared(found, wrong.prosthetic_plate)
    before, after = (layers_error(beside[layer]) for layer in (PHYSICS, MOMENTUM))
    assert before > 0.04 and after < 0.25 * before
    by_physics, by_momentum = (beside[layer].stances[0].model for layer in (PHYSICS, MOMENTUM))
    doubt = np.mean((found.correction.values / PRIOR) ** 2) / DOUBTED**2
    (own,) = found.seen.stances
    assert own.start_s - by_physics.start_s == pytest.approx(
        (by_momentum.start_s - by_physics.start_s) * doubt / (1.0 + doubt), abs=1e-9
    )
    assert by_momentum.start_s != by_physics.start_s, "a foot of another height strikes elsewhen"
    missing = np.abs(found.correction.missing_bw[1])
    assert np.all(missing < 0.5 * SIGMA_BW), "it stops where less is missing than is known"


def layers_error(comparison):
    sizes = (
        np.linalg.norm(force, axis=1)[comparison.scored]
        for force in (comparison.model, comparison.measured)
    )
    return (
        float(np.sqrt(np.mean((next(sizes) - next(sizes)) ** 2))) / comparison.measured[:, 2].max()
    )


def test_a_component_whose_bias_differs_between_the_fitted_trials_counts_the_less(
    walker, true_trial
):
    """Fore-aft a thousand times as uncertain: a shift of its bias by 10 % body weight then changes
    nothing; with the error that is told it turns the leg."""
    shift = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    sd = np.repeat([1e3, 0.5], 3) * SIGMA_BW
    turned, still = (
        predict(
            true_trial,
            bare(momentum=bias_of(missed(walker, true_trial) + shift, own)),
            walker=walker,
            step_s=STEP_S,
        ).correction
        for own in (None, sd)
    )
    assert np.hypot(turned.hip_flexion_rad, turned.alignment_rad) > 0.5 * PRIOR[1]
    assert still.believed and np.hypot(still.hip_flexion_rad, still.alignment_rad) < 1e-3 * PRIOR[1]


def test_few_trials_that_agree_by_chance_do_not_make_momentum_surer_than_it_is_known():
    """Fore-aft they agree to a tenth of its error, vertically they are twice as far apart as it."""
    found = spread_of(bias_of(np.zeros(6), np.repeat([0.1, 2.0], 3) * SIGMA_BW))
    np.testing.assert_allclose(found, np.repeat([1.0, 2.0], 3))


def test_where_nothing_is_missing_nothing_is_corrected(walker, true_trial):
    bias = bias_of(missed(walker, true_trial))
    found = predict(true_trial, bare(momentum=bias), walker=walker, step_s=STEP_S).correction
    values = [found.height_m, found.hip_flexion_rad, found.knee_angle_rad, found.alignment_rad]
    np.testing.assert_allclose(values / PRIOR, 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("sd", "shift", "why"),
    [
        (3.1 * SIGMA_BW, 0.0, "spread"),
        (0.5 * SIGMA_BW, 1.0, "motion"),
        (None, 1.0, "motion"),
        (None, None, "bias"),
    ],
)
def test_a_momentum_that_cannot_be_believed_changes_nothing(walker, true_trial, sd, shift, why):
    """Biases of fitted trials more than three times as far apart as their error; a trial that lacks
    its whole weight; no bias."""
    bias = None if shift is None else bias_of(missed(walker, true_trial) - shift, sd)
    found = predict(true_trial, bare(momentum=bias), walker=walker, step_s=STEP_S)
    assert not found.correction.believed and found.correction.why_not == why
    assert found.results[MOMENTUM] is found.results[PHYSICS] and found.person is None


def test_a_walk_in_which_the_intact_foot_never_swings_free_is_left_alone(walker, true_trial):
    (window,) = swings(walked(walker, true_trial))
    early = replace(true_trial, end_s=true_trial.start_s + 0.5 * window.stop * STEP_S + 0.4)
    found = predict(early, bare(momentum=bias_of(np.zeros(6))), walker=walker, step_s=STEP_S)
    assert (found.correction.believed, found.correction.why_not) == (False, "window")


@pytest.mark.parametrize("name", ["low_1", "high_1"])
def test_a_fitted_walk_is_recognised_by_its_steps_in_another_file(name):
    """Cut otherwise, its angles found in another way, its forces rounded to 0.01 N, the person
    weighed again."""
    contact = load_contact(embedded_contact())
    own = load_trial(resource(f"data/reference_subject/laboratory/{name}.yaml"))
    side = own.subject.prosthetic_side
    plate = replace(own.plates[side], force_W=own.plates[side].force_W.round(2))
    motion = own.trajectory.with_values(own.trajectory.values + 0.01)
    again = replace(own, plates={side: plate}, trajectory=motion, start_s=own.start_s + 0.02)
    assert fingerprint(again) != fingerprint(own) == recording_of(again, contact)
    for ratio, same in ((1.002, own), (0.97, own), (1.08, None)):
        subject = replace(own.subject, mass_kg=ratio * own.subject.mass_kg)
        weighed = replace(again, subject=subject)
        assert recording_of(weighed, contact) == fingerprint(same or weighed)
    other = load_trial(resource(f"data/reference_subject/laboratory/{name[:-1]}2.yaml"))
    assert recording_of(other, contact) == fingerprint(other)


# The person's own curve: what it is made of, tests/walks/test_person_curve.py tells.


def test_a_trial_that_taught_its_own_curve_is_predicted_with_it_and_without_its_plate(
    walker, trial
):
    contact = learned(bare(trial), [trial], walker=walker, step_s=STEP_S)
    (own,) = contact.person_curve.walks
    assert contact.momentum.trials == (fingerprint(trial),) == (own.fingerprint,)
    row = layers_of(trial, "again", contact, walker=walker, step_s=STEP_S)
    assert row.fitted and row.null_model_grf_rmse_bw is None
    assert row.error_in(PERSON) < 0.01 and row.error_in(PERSON) < 0.2 * row.error_in(MOMENTUM), (
        "but for the ends of stance"
    )
    assert row.layers[PERSON]["cop_rmse_fl"] < 0.01
    shorter = replace(trial, end_s=trial.end_s - 0.01)
    assert fingerprint(shorter) != fingerprint(trial)
    assert layers_of(shorter, "cut", contact, walker=walker, step_s=STEP_S).fitted

    plates = {
        side: replace(plate, force_W=0.0 * plate.force_W) for side, plate in trial.plates.items()
    }
    blind, sighted = (
        predict(one, contact, walker=walker, step_s=STEP_S).person
        for one in (replace(trial, plates=plates), trial)
    )
    np.testing.assert_array_equal(blind.force_n, sighted.force_n)
    assert blind.corrected and blind.half_width_n is None


def test_the_null_model_has_the_measured_times_or_the_predicted_ones(walker, true_trial):
    """Of a model that strikes and lifts as the plate says they are the same; a foot that is 8 mm
    higher is late."""
    measured = 1.1 * np.sin(np.pi * PERCENT / 100.0)
    other = made_person_walk(vertical_bw=tuple(map(float, measured)))
    contact = bare(true_trial, person_curve=PersonCurve(walks=(other,)))
    same = layers_of(true_trial, "same", contact, walker=walker, step_s=STEP_S)
    assert same.null_model_predicted_times_grf_rmse_bw == pytest.approx(
        same.null_model_grf_rmse_bw, rel=0.02
    )
    high = replace(
        true_trial, offsets=GeometricOffsets(height_m=true_trial.offsets.height_m + 8e-3)
    )
    late = layers_of(high, "late", contact, walker=walker, step_s=STEP_S)
    assert late.null_model_grf_rmse_bw == pytest.approx(same.null_model_grf_rmse_bw, rel=1e-3)
    assert late.null_model_predicted_times_grf_rmse_bw > 1.05 * late.null_model_grf_rmse_bw


def test_curves_to_be_drawn_are_the_ones_that_are_judged_and_need_no_plate(walker, true_trial):
    contact = bare(true_trial, person_curve=PersonCurve(walks=(made_person_walk(),)))
    walk = predict(true_trial, contact, walker=walker, step_s=STEP_S)
    curves = layer_curves(walk, true_trial, contact)
    row = judged(walk, true_trial, "same", contact)
    scored = compared(walk, true_trial.plate)[PHYSICS].scored
    for name, error in (
        ("person", row.error_in(PERSON)),
        ("null", row.null_model_grf_rmse_bw),
        ("null_predicted", row.null_model_predicted_times_grf_rmse_bw),
    ):
        off = [np.linalg.norm(curves[one][scored], axis=1) for one in (name, "plate")]
        assert np.sqrt(np.mean(np.subtract(*off) ** 2)) == pytest.approx(error, rel=1e-6), name
    assert "half_width" not in curves
    bare_trial = replace(true_trial, plates={})
    told = layer_curves(walk, bare_trial, contact)
    assert np.isnan(told["plate"]).all() and "null" not in told
    np.testing.assert_allclose(told["person"], curves["person"], atol=1e-12)
    assert told["null_predicted"][:, 2].max() == pytest.approx(
        curves["null_predicted"][:, 2].max(), rel=1e-6
    )
    (stance,) = compared(walk, None)[PHYSICS].model_stances
    cut = replace(bare_trial, start_s=0.5 * (stance.start_s + stance.end_s))
    part = predict(cut, contact, walker=walker, step_s=STEP_S)
    told = layer_curves(part, cut, contact)
    assert "person" in told and "null_predicted" not in told, "it is laid on whole stances alone"


def test_a_layer_that_no_plate_could_teach_has_no_score_and_is_said_not_to_be_learned(
    walker, trial
):
    """The walk begins within the stance: neither curve over the model's stance nor times that it
    predicts."""
    stance = find_stances(trial.prosthetic_plate.time_s, trial.prosthetic_plate.force_W[:, 2])[0]
    late = replace(trial, start_s=stance.start_s + 0.05)
    contact = learned(bare(late), [late], walker=walker, step_s=STEP_S)
    assert contact.person_curve is None
    row = layers_of(late, "late", contact, walker=walker, step_s=STEP_S)
    assert set(row.layers[PERSON].values()) == {None} and row.error_in("momentum") > 0.0
    assert row.null_model_grf_rmse_bw is None and row.null_model_unknown == "alone"
    table = made_layers(replace(row, fitted=False), person_curve=None)
    text = " ".join(layer_sentences(table))
    assert "could not be learned: no fitted trial has a stance" in text
    assert table.earned != PERSON and "by the person's own curve" not in text


# What is told.


def test_the_verdict_names_the_layer_that_is_nearest_to_the_held_out_plates():
    first = made_layer_row("low_1", (0.02, 0.01, 0.0), fitted=True)
    table = made_layers(
        first,
        made_layer_row("low_2", (0.07, 0.05, 0.06)),
        made_layer_row("low_3", (0.05, 0.05, 0.05), believed=False, why_not="motion"),
    )
    assert table.earned == "momentum" and table.mean(
        "momentum", "fore_aft_rmse_bw"
    ) == pytest.approx(0.05)
    text = " ".join(layer_sentences(table))
    for words in (
        "6.0 % body weight off by physics alone",
        "5.0 % with the person's own momentum",
        "5.5 % by the person's own curve",
        "3.0 % off with the measured times",
        "4.0 % with those",
        "the null model is 3.0 %",
        "nearest single curve is 5.0 % off",
        "support physics and momentum, nearer than the null model in 0 of 2",
        "loading 5.5 %, null 3.0 %; single support 5.5 %, null 3.0 %; push-off 11.0 %",
        "further off than that null, by more than 0.2 % of body weight, in loading (fore-aft, ",
        "does not correct low_3: the recorded motion",
        "No interval is told around the person's own curve",
    ):
        assert words in text
    assert made_layers(made_layer_row("a", (0.05,) * 3)).earned == "physics", (
        "a layer that does nothing earns nothing"
    )
    alone = made_layers(
        replace(first, correction=MomentumCorrection(believed=False, why_not="spread"))
    )
    text = " ".join(layer_sentences(alone))
    assert alone.earned is None and "held-out" not in text and "corrects none of the trials" in text
    text = " ".join(layer_sentences(made_layers(first)))
    assert "further off" not in text and "By phase" not in text, "its plate is in the curve"
    late = replace(
        made_layer_row("low_2", (0.05, 0.05, 0.02)), null_model_predicted_times_grf_rmse_bw=0.02
    )
    assert (
        "the null model is 2.0 % off with those that the physics predicts, and 3.0 %"
        in " ".join(layer_sentences(made_layers(late)))
    ), "the harder null first"
    assert json.loads(json.dumps(plain(table))) == plain(table)
