"""A walk whose force nobody measured, and recordings cut at the strike, at lift-off and in
mid-stance: what of the walk stays the same, and by how much the rest is off.

SYNTHETIC walks of the reference subject that its stored contact was not fitted to.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.model.contact_file import load_contact
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial import NO_PLATE, load_trial
from vsf_drake.optimal_control.recorded_stride import recorded_stride
from vsf_drake.recording.examine import examine
from vsf_drake.simulation.options import STARTS_LOADED, TRANSIENT_BW, TRANSIENT_S
from vsf_drake.simulation.walk import Walker, simulate_trial
from vsf_drake.walks.comparison import compare
from vsf_drake.walks.embedded import embedded_contact, embedded_trials
from vsf_drake.walks.metrics import known_curves, unfitted_note, walk_metrics
from vsf_drake.walks.null_model import PLATELESS
from vsf_drake.walks.offsets import fit_offsets
from vsf_drake.walks.plate_score import plate_scorer
from vsf_drake.walks.prediction import LAYERS, compared, layers_of, predict
from vsf_drake.walks.recorded_walk import ONE_END_BW, with_contact

STEP_S = 2e-3


@pytest.fixture(scope="module")
def contact():
    return load_contact(embedded_contact())


@pytest.fixture(scope="module")
def recorded():
    return load_trial(embedded_trials()[1])


@pytest.fixture(scope="module")
def walker(recorded, contact):
    applied = trial_with(recorded, contact)
    return Walker(applied.subject, applied.model)


def without_plates(trial):
    return replace(trial, plates={})


def bodyweights(force, trial):
    return force / (trial.subject.mass_kg * 9.81)


def test_a_walk_without_its_plate_is_the_same_to_the_bit_in_every_layer(recorded, contact, walker):
    """Of a contact without curves over the gait cycle, the only place where a plate enters."""
    contact = replace(contact, curves=())
    with_plate, without = (
        predict(with_contact(trial, contact), contact, walker=walker, step_s=STEP_S)
        for trial in (recorded, without_plates(recorded))
    )
    assert with_plate.correction.believed
    assert replace(without.correction, wall_s=0.0) == replace(with_plate.correction, wall_s=0.0)
    for layer, result in with_plate.results.items():
        np.testing.assert_array_equal(without.results[layer].q, result.q)
        np.testing.assert_array_equal(without.results[layer].grf_W, result.grf_W)
    np.testing.assert_array_equal(without.person.force_n, with_plate.person.force_n)
    np.testing.assert_array_equal(without.person.cop_m, with_plate.person.cop_m)
    told = compared(without, None)
    assert set(told) == set(LAYERS)
    for layer, comparison in compared(with_plate, recorded.plate).items():
        assert told[layer].laid_on == comparison.laid_on


def test_angles_laid_on_predicted_times_move_the_force_by_a_percent_of_body_weight(
    recorded, contact, walker
):
    """The model strikes 13 ms late, 2 % of stance: so far are the curves of 1.5 degrees shifted,
    which change the force by 5 % of body weight (docs: 4 to 7.5 % a degree)."""
    laid = with_contact(without_plates(recorded), contact)
    forces = [
        compare(walker.walk_trial(trial, step_s=STEP_S), recorded.plate)
        for trial in (trial_with(recorded, contact), laid)
    ]
    apart = bodyweights(forces[0].model - forces[1].model, recorded)[forces[0].scored]
    assert 0.0 < np.sqrt(np.mean(np.sum(apart**2, axis=1))) < 0.015
    [note] = [note for note in laid.notes if "no plate tells them" in note]
    stance = forces[0].stances[0].model
    told = [float(word) for word in note.split() if word.startswith(("0.", "1."))]
    assert told == pytest.approx(stance.span, abs=0.005)


def test_without_a_plate_nothing_is_scored_and_the_models_own_stance_is_told(
    recorded, contact, walker
):
    bare = without_plates(recorded)
    walk = walker.walk_trial(with_contact(bare, contact), step_s=STEP_S)
    result = walker.result(walk, bare, bare.offsets, energy=False)
    found = walk_metrics(result, bare.plate, others=known_curves([recorded, bare]))
    assert (found.error_bw, found.null_bw, found.beats_null, found.cop_rmse_fl) == (None,) * 4
    assert (found.null_model_unknown, found.extra_model_stances) == (PLATELESS, None)
    assert found.scored_window_s == () and found.coverage is None
    [stance] = found.stances
    [own] = find_stances(walk.time_s, walk.grf_W[:, 2])
    assert (stance.measured_start_s, stance.measured_end_s) == (None, None)
    assert (stance.model_start_s, stance.model_end_s) == pytest.approx(own.span, abs=STEP_S)
    assert found.stance_model_s == pytest.approx(own.duration_s, abs=STEP_S)
    largest = bodyweights(walk.grf_W[:, 2].max(), recorded)
    assert found.peak_vertical_bw == pytest.approx(largest, rel=0.02)
    assert found.measured_peak_vertical_bw is None
    comparison = compare(result, bare.plate)
    assert np.isnan(comparison.measured).all() and not comparison.scored.any()
    row = layers_of(bare, "bare", contact, walker=walker, step_s=STEP_S)
    assert [row.error_in(layer) for layer in LAYERS] == [None] * 3
    assert row.correction.believed and row.null_model_unknown == PLATELESS


def test_what_cannot_do_without_a_plate_names_the_file_and_what_to_do(recorded):
    bare = without_plates(recorded)
    for use in (fit_offsets, plate_scorer, recorded_stride, lambda trial: trial.prosthetic_plate):
        with pytest.raises(InputError, match=r"low_2\.yaml: forces: no force was measured.*\. \w"):
            use(bare)
    assert "fit TRIAL_WITH_FORCES.yaml" in unfitted_note(bare, offsets_fitted=False)


def test_a_recording_without_forces_is_doubted_for_its_mass_alone(recorded, monkeypatch):
    """Nothing tells the mass; no force of zero is taken for one, not even where the motion shows no
    stance."""
    assert examine(recorded).mark == "good"
    for _ in range(2):
        found = examine(without_plates(recorded))
        assert found.mark == "doubtful"
        [doubt] = [check for check in found.checks if check.mark != "good" and check.needed]
        assert doubt.name == "body mass that no plate tells" and doubt.value is None
        monkeypatch.setattr("vsf_drake.recording.examine.kinematic_stances", lambda *_, **__: [])


def cut(walker, trial, start_s, end_s):
    """The trial with this window as it walks, and the whole walk on the same instants (N)."""
    part = walker.walk_trial(trial, start_s=start_s, end_s=end_s)
    whole = walker.walk_trial(trial, end_s=end_s).grf_W
    return part, whole[-len(part.time_s) :]


@pytest.fixture(scope="module")
def applied(recorded, contact):
    return trial_with(recorded, contact)


@pytest.fixture(scope="module")
def plate_stance(recorded):
    [stance] = [
        one
        for one in find_stances(recorded.plate.time_s, recorded.plate.force_W[:, 2])
        if one.end_s < recorded.end_s
    ]
    return stance


@pytest.mark.parametrize("late_s", [0.0, 0.005])
def test_a_recording_from_the_strike_to_lift_off_has_a_whole_stance(
    recorded, applied, walker, plate_stance, late_s
):
    """Laboratories cut at 20 N, or a little later. Socket and keel are at rest at the strike, which
    the first 20 ms show; what follows is as if the swing had been recorded."""
    window = plate_stance.start_s + late_s, plate_stance.end_s - late_s
    part, whole = cut(walker, applied, *window)
    apart = bodyweights(np.linalg.norm(part.grf_W - whole, axis=1), applied)
    assert apart.max() < 0.1 and apart[part.time_s > part.time_s[0] + 0.02].max() < 0.01
    rows = (recorded.plate.time_s >= window[0]) & (recorded.plate.time_s <= window[1])
    plate = recorded.plate
    plate = replace(
        plate,
        time_s=plate.time_s[rows],
        force_W=plate.force_W[rows],
        cop_W=plate.cop_W[rows],
        free_moment_nm=plate.free_moment_nm[rows],
    )
    [stance] = find_stances(plate.time_s, plate.force_W[:, 2])
    assert stance.whole and not (late_s and stance.complete)
    for real in (plate, recorded.plate):
        comparison = compare(part, real)
        assert comparison.stances[0].inside and comparison.laid_on
        assert comparison.scored.all()


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5, 0.7, 0.9])
def test_a_walk_that_starts_in_mid_stance_is_off_by_no_more_than_is_said(
    recorded, applied, walker, plate_stance, share
):
    start_s = plate_stance.start_s + share * plate_stance.duration_s
    part, whole = cut(walker, applied, start_s, recorded.end_s)
    apart = bodyweights(np.linalg.norm(part.grf_W - whole, axis=1), applied)
    late = part.time_s > start_s + TRANSIENT_S
    assert apart.max() < TRANSIENT_BW[0] and apart[late].max() < TRANSIENT_BW[1]
    late &= part.time_s < plate_stance.end_s
    comparison = compare(part, recorded.plate)
    assert comparison.laid_on == [] and compare(part, None).laid_on == []
    if not late.any():
        assert not comparison.scored.any() and comparison.stances == ()
        return
    resultants = [np.linalg.norm(force[late], axis=1) for force in (part.grf_W, whole)]
    off = bodyweights(resultants[0] - resultants[1], applied)
    assert np.sqrt(np.mean(off**2)) < TRANSIENT_BW[2]
    assert comparison.time_s[comparison.scored][0] == pytest.approx(start_s + TRANSIENT_S, abs=2e-3)
    assert not comparison.stances[0].inside


@pytest.mark.parametrize("share", [0.1, 0.3])
def test_a_file_that_starts_in_mid_stance_and_has_no_forces_is_off_by_no_more_than_is_said(
    recorded, applied, contact, walker, plate_stance, share
):
    """Neither its motion before is known nor when the foot struck."""
    motion = recorded.trajectory
    rows = motion.time_s >= plate_stance.start_s + share * plate_stance.duration_s
    start_s = float(motion.time_s[rows][0])
    rest = CoordinateTrajectory(motion.time_s[rows], motion.values[rows], motion.names)
    bare = replace(recorded, plates={}, trajectory=rest, start_s=start_s)
    laid = with_contact(bare, contact)
    assert any("a stance of 0.7 s" in note for note in laid.notes)
    part = walker.walk_trial(laid)
    whole = walker.walk_trial(applied)
    late = (part.time_s > start_s + TRANSIENT_S) & (part.time_s < plate_stance.end_s)
    forces = np.array([np.interp(part.time_s[late], whole.time_s, f) for f in whole.grf_W.T]).T
    apart = bodyweights(np.linalg.norm(part.grf_W[late] - forces, axis=1), recorded)
    assert apart.max() < ONE_END_BW[0] and np.sqrt(np.mean(apart**2)) < ONE_END_BW[1]
    sizes = [np.linalg.norm(force, axis=1) for force in (part.grf_W[late], forces)]
    off = bodyweights(sizes[0] - sizes[1], recorded)
    assert np.sqrt(np.mean(off**2)) < TRANSIENT_BW[2]


def test_a_start_in_mid_stance_and_a_missing_plate_are_said_first(recorded, trial_files):
    early = simulate_trial(replace(recorded, start_s=0.6), step_s=STEP_S)
    [said] = [note for note in early.notes if note.startswith(STARTS_LOADED)]
    assert "21 % of body weight" in said and "0.2 s are not scored" in said
    assert not any(note.startswith(NO_PLATE) for note in early.notes)
    del trial_files.manifest["forces"]
    trial = load_trial(trial_files.write())
    assert trial.plate is None and trial.intact_plate is None and trial.plates == {}
    assert (trial.start_s, trial.end_s) == pytest.approx((0.0, 1.8))
    [said] = [note for note in trial.notes if note.startswith(NO_PLATE)]
    assert "compared with nothing" in said
    trial_files.manifest["window"] = {"start_s": 0.3, "end_s": 0.4}
    with pytest.raises(InputError, match=r"window: the trial of 0\.300 to 0\.400 s is shorter"):
        load_trial(trial_files.write())
