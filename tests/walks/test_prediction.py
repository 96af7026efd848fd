"""Prediction in layers: momentum mends what is wrong with one trial, and a discrepancy helps as far
as it was earned.

The walks are of the unfitted model; their plates are made so that the truth is known.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from made_contact import made_contact
from made_fit import made_layer_row, made_layers, recording

from vsf_drake.base.files import plain
from vsf_drake.model.contact_file import Discrepancy, DiscrepancyCurve, FittedTrial, MomentumBias
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.fitted_trial import fingerprint
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.simulation.reactions import follow
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.comparison import PERCENT
from vsf_drake.walks.discrepancy import (
    CODE_SCALE,
    COMPONENTS,
    beside_the_plates,
    earned,
    interpolated,
    over_stances,
)
from vsf_drake.walks.momentum import (
    PRIOR,
    SIGMA_BW,
    MomentumCorrection,
    missed,
    needed_force,
    spread_of,
    swings,
)
from vsf_drake.walks.prediction import (
    MOMENTUM,
    PHYSICS,
    layer_sentences,
    layers_of,
    learned,
    predict,
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
    before, after = (layers_error(found.comparisons[layer]) for layer in (PHYSICS, MOMENTUM))
    assert before > 0.04 and after < 0.25 * before
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
    assert found.comparisons[MOMENTUM] is found.comparisons[PHYSICS] and not found.added_bw.any()


def test_a_walk_in_which_the_intact_foot_never_swings_free_is_left_alone(walker, true_trial):
    (window,) = swings(walked(walker, true_trial))
    early = replace(true_trial, end_s=true_trial.start_s + 0.5 * window.stop * STEP_S + 0.4)
    found = predict(early, bare(momentum=bias_of(np.zeros(6))), walker=walker, step_s=STEP_S)
    assert (found.correction.believed, found.correction.why_not) == (False, "window")


# Discrepancy.


def curve_of(values, fulcrum_m, name="0", plate=(0.0,) * 101):
    """The same (101,) BW in every component."""
    series, alone = (tuple(map(float, each)) for each in (values, plate))
    return DiscrepancyCurve(
        fingerprint=name * 64,
        fulcrum_m=fulcrum_m,
        measured_bw=series,
        **dict.fromkeys(COMPONENTS, series),
        **{f"plate_{part}": alone for part in COMPONENTS},
    )


SHAPE = 0.1 * np.sin(np.pi * PERCENT / 100.0)


def test_what_a_repeated_trial_shows_again_is_added_whole():
    found = earned([curve_of(SHAPE, 0.066), curve_of(SHAPE, 0.066)])
    np.testing.assert_allclose(interpolated(found, 0.066), np.stack([SHAPE] * 3, axis=1), atol=1e-6)
    np.testing.assert_allclose(
        interpolated(found, 0.151), 0.0, atol=1e-12, err_msg="no other setting was tried"
    )


def test_noise_earns_nothing():
    """Independent noise of 0.05 BW at three settings, twice each. By chance two curves of 101
    points resemble each other by 1 / sqrt(101) of themselves; twice that is added at most."""
    draws = np.random.default_rng(3)
    added = [
        interpolated(
            earned(
                [curve_of(0.05 * draws.standard_normal(101), x) for x in (0.066, 0.108, 0.151) * 2]
            ),
            0.108,
        )
        for _ in range(8)
    ]
    assert np.sqrt(np.mean(np.square(added))) < 0.2 * 0.05


def test_a_discrepancy_goes_to_another_setting_only_if_the_settings_share_it():
    alike = earned([curve_of(SHAPE, x) for x in (0.066, 0.108, 0.151)])
    opposite = earned(
        [curve_of(sign * SHAPE, x) for sign, x in ((1.0, 0.066), (-1.0, 0.108), (1.0, 0.151))]
    )
    assert interpolated(alike, 0.087).max() > 0.7 * SHAPE.max()
    np.testing.assert_allclose(interpolated(opposite, 0.087), 0.0, atol=1e-4)
    np.testing.assert_allclose(
        interpolated(opposite, 0.066), 0.0, atol=1e-12, err_msg="no setting was tried twice"
    )
    two = earned([curve_of(SHAPE, 0.066), curve_of(SHAPE, 0.151)])
    np.testing.assert_allclose(
        interpolated(two, 0.108), 0.0, atol=1e-12, err_msg="each was told by one trial"
    )
    twice = earned(
        [curve_of(sign * SHAPE, x) for sign, x in ((1.0, 0.066), (-1.0, 0.151)) for _ in range(2)]
    )
    np.testing.assert_allclose(interpolated(twice, 0.066)[:, 2], SHAPE, rtol=1e-6, atol=1e-9)


def test_what_a_setting_has_to_itself_fades_by_a_normal_curve_of_one_centimetre():
    """The mean of a Gaussian process with exp(-d^2 / 2 l^2) for a covariance that knows one value:
    exp(-1/2) of it at d = l, exp(-2) at twice that, whichever way."""
    known = Discrepancy(curves=(curve_of(SHAPE, 0.1),), shared=(0.0,) * 3, own=(1.0,) * 3)
    for fulcrum_m, share in ((0.1, 1.0), (0.11, 0.6065), (0.09, 0.6065), (0.12, 0.1353)):
        np.testing.assert_allclose(interpolated(known, fulcrum_m)[:, 0], share * SHAPE, atol=1e-5)


def test_what_a_setting_has_to_itself_is_not_believed_where_no_setting_was_walked_twice():
    """Neighbours 14 mm apart that are alike, and a third setting that is not, would have it so; but
    only a repeated walk tells it from the noise of each."""
    once = [curve_of(sign * SHAPE, x) for sign, x in ((1.0, 0.066), (1.0, 0.08), (-1.0, 0.151))]
    assert earned(once).own == (0.0,) * 3
    assert min(earned(once * 2).own) > 0.0


def test_a_prediction_is_partly_the_model_and_the_rest_the_fitted_plates_linear_in_settings(
    walker, trial
):
    """Plates of 0 and 1 BW at two settings, no discrepancy: in stance the force is CODE_SCALE of
    the model's and the rest of what lies between; beyond the settings the plates fade, outside of
    stance there are none."""
    known = Discrepancy(
        shared=(0.0,) * 3,
        own=(0.0,) * 3,
        curves=tuple(
            curve_of(np.zeros(101), x, plate=np.full(101, load))
            for x, load in ((0.066, 0.0), (0.106, 1.0))
        ),
    )
    comparison = predict(trial, bare(trial), walker=walker, step_s=STEP_S).comparisons[MOMENTUM]
    weight = trial.subject.mass_kg * GRAVITY
    inside = over_stances(comparison, np.ones((101, 3)))[:, 0] > 0.0
    assert inside.any() and not inside.all()
    for fulcrum_m, load in ((0.066, 0.0), (0.096, 0.75), (0.106, 1.0)):
        force = beside_the_plates(comparison, known, fulcrum_m, weight)
        np.testing.assert_allclose(
            force[inside],
            CODE_SCALE * comparison.model[inside] + (1.0 - CODE_SCALE) * load * weight,
            atol=1e-9 * weight,
        )
        np.testing.assert_array_equal(force[~inside], comparison.model[~inside])
    far = beside_the_plates(comparison, known, 0.151, weight)
    np.testing.assert_allclose(far, comparison.model, atol=1e-4 * weight)


def test_a_trial_that_taught_its_whole_error_is_predicted_without_one(walker, trial):
    contact = learned(bare(trial), [trial], walker=walker, step_s=STEP_S)
    (curve,) = contact.discrepancy.curves
    assert contact.momentum.trials == (fingerprint(trial),) == (curve.fingerprint,)
    whole = replace(
        contact, discrepancy=Discrepancy(curves=(curve,), shared=(0.0,) * 3, own=(1.0,) * 3)
    )
    row = layers_of(trial, "again", whole, walker=walker, step_s=STEP_S)
    before, last = (row.layers[layer]["grf_rmse_bw"] for layer in ("momentum", "discrepancy"))
    assert row.fitted and row.null_model_grf_rmse_bw is None and last < 0.2 * before, (
        "but for the ends of stance"
    )
    assert row.layers["discrepancy"]["cop_rmse_fl"] == row.layers["momentum"]["cop_rmse_fl"]


def test_the_null_model_has_the_measured_times_or_the_predicted_ones(walker, true_trial):
    """Of a model that strikes and lifts as the plate says they are the same; a foot that is 8 mm
    higher is late."""
    measured = 1.1 * np.sin(np.pi * PERCENT / 100.0)
    other = replace(curve_of(np.zeros(101), 0.066), measured_bw=tuple(map(float, measured)))
    contact = bare(
        true_trial, discrepancy=Discrepancy(curves=(other,), shared=(0.0,) * 3, own=(0.0,) * 3)
    )
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


def test_a_layer_that_no_plate_could_teach_has_no_score_and_is_said_not_to_be_learned(
    walker, trial
):
    """The walk begins within the stance: neither curve over the model's stance nor times that it
    predicts."""
    stance = find_stances(trial.prosthetic_plate.time_s, trial.prosthetic_plate.force_W[:, 2])[0]
    late = replace(trial, start_s=stance.start_s + 0.05)
    contact = learned(bare(late), [late], walker=walker, step_s=STEP_S)
    assert contact.discrepancy is None
    row = layers_of(late, "late", contact, walker=walker, step_s=STEP_S)
    assert set(row.layers["discrepancy"].values()) == {None} and row.error_in("momentum") > 0.0
    assert row.null_model_grf_rmse_bw is None and row.null_model_unknown == "alone"
    table = made_layers(replace(row, fitted=False), discrepancy=None)
    text = " ".join(layer_sentences(table))
    assert (
        "could not be learned: no fitted trial has a stance" in text
        and "From the fitted plates" not in text
    )
    assert (
        table.earned != "discrepancy"
        and "with the discrepancy of the fitted trials added" not in text
    )


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
        "5.5 % with the disc",
        "3.0 % off with the measured times",
        "4.0 % with those",
        "the null model is 3.0 %",
        "nearest single curve is 5.0 % off",
        "support physics and momentum, nearer than the null model in 0 of 2",
        "does not correct low_3: the recorded motion",
        "40 % of their curves",
        "fewer than three settings were fitted, and none twice",
    ):
        assert words in text
    assert made_layers(made_layer_row("a", (0.05,) * 3)).earned == "physics", (
        "a layer that does nothing earns nothing"
    )
    alone = made_layers(
        replace(first, correction=MomentumCorrection(believed=False, why_not="spread")),
        untried=False,
    )
    text = " ".join(layer_sentences(alone))
    assert alone.earned is None and "held-out" not in text and "corrects none of the trials" in text
    assert "To another trial of the same setting 60, 60, 60 %" in text and "left out" not in text
    curve = table.discrepancy.curves[0]
    known = replace(
        table.discrepancy, curves=tuple(replace(curve, fulcrum_m=x) for x in (0.066, 0.108, 0.151))
    )
    text = " ".join(layer_sentences(replace(table, discrepancy=known)))
    assert "To a setting that was left out 10, 20, 30 % of it" in text
    assert json.loads(json.dumps(plain(table))) == plain(table)
