"""A recording with a fitted contact: what is changed, for whom, on which recording; the phase of
the gait cycle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_contact import CURVE, OF_THE_MODEL, OWN, made_contact

from vsf_drake.base.errors import InputError
from vsf_drake.model.contact_file import FittedSubject, model_with
from vsf_drake.motion.events import Stance
from vsf_drake.motion.fitted_trial import fingerprint, gait_phase, trial_with
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import periodic_bsplines, window_bsplines
from vsf_drake.motion.trial import load_trial

SUBJECT = FittedSubject(mass_kg=80.0, stature_m=1.8, prosthetic_side="right")


@pytest.fixture
def trial(trial_files):
    trial_files.manifest["offsets"] = {"height_mm": 3, "alignment_deg": 2}
    return load_trial(trial_files.write())


def contact_for(trial=None, **changes):
    """A contact for the made walk; with a trial, fitted to it."""
    own = () if trial is None else (replace(OWN, fingerprint=fingerprint(trial)),)
    return made_contact(**{"subject": SUBJECT, "trials": own} | changes)


def added(fitted, trial, name):
    column = trial.trajectory.names.index(name)
    return fitted.trajectory.values[:, column] - trial.trajectory.values[:, column]


def test_model_offsets_and_angles_are_those_of_the_fit(trial):
    fitted = trial_with(trial, contact_for())
    assert fitted.model == model_with(trial.model, OF_THE_MODEL)
    expected = GeometricOffsets(
        height_m=4e-3,
        fore_aft_m=-2e-3,
        alignment_rad=np.radians(2.0) + 0.01,
        inversion_rad=-0.05,
        toe_out_rad=0.02,
    )
    assert vars(fitted.offsets) == pytest.approx(vars(expected))
    np.testing.assert_allclose(added(fitted, trial, "hip_flexion_r"), 0.012, atol=1e-15)
    np.testing.assert_allclose(added(fitted, trial, "pelvis_ty"), -5e-4, atol=1e-15)
    curve = periodic_bsplines(6)(gait_phase(trial)(trial.trajectory.time_s)) @ np.array(
        CURVE.coefficients
    )
    np.testing.assert_allclose(added(fitted, trial, "knee_angle_r"), curve, atol=1e-15)
    untouched = set(trial.trajectory.names) - {"hip_flexion_r", "pelvis_ty", "knee_angle_r"}
    assert not any(added(fitted, trial, name).any() for name in untouched)
    assert (fitted.trajectory.names, fitted.plates, fitted.fulcrum_m) == (
        trial.trajectory.names,
        trial.plates,
        trial.fulcrum_m,
    )


def test_height_and_path_go_to_the_recording_that_they_were_fitted_to_and_to_no_other(trial):
    fitted = trial_with(trial, contact_for(trial))
    assert fitted.offsets.height_m == pytest.approx(4.5e-3)
    basis = window_bsplines(trial.start_s, trial.end_s, 5)(trial.trajectory.time_s)
    np.testing.assert_allclose(
        added(fitted, trial, "pelvis_tx"), basis @ np.array(OWN.path["pelvis_tx"]), atol=1e-15
    )
    slow = window_bsplines(trial.start_s, trial.end_s, 4)(trial.trajectory.time_s)
    np.testing.assert_allclose(
        added(fitted, trial, "hip_flexion_r"),
        0.012 + slow @ np.array(OWN.curves["hip_flexion_r"]),
        atol=1e-15,
    )
    assert added(fitted, trial, "pelvis_tz").any()
    assert fitted.notes[-1].endswith("with the height that was fitted to this trial and its path.")
    other = replace(trial, end_s=trial.end_s - 0.05)
    elsewhere = trial_with(other, contact_for(trial))
    assert elsewhere.offsets.height_m == pytest.approx(4e-3)
    assert not added(elsewhere, other, "pelvis_tx").any()
    assert "height" not in elsewhere.notes[-1]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"prosthetic_side": "left"},
            ["prosthetic_side", "prosthesis on the left", "one on the right"],
        ),
        ({"mass_kg": 86.0}, ["mass_kg", "a person of 86 kg", "has 80 kg"]),
        ({"stature_m": 1.85}, ["stature_m", "a person of 1.85 m", "has 1.8 m"]),
    ],
)
def test_another_persons_contact_is_refused_with_both_numbers(trial, change, words):
    contact = contact_for(subject=replace(SUBJECT, **change), values={}, curves=())
    with pytest.raises(InputError) as caught:
        trial_with(trial, contact, file="contact.yaml")
    for word in ("contact.yaml", *words):
        assert word in str(caught.value)


def test_a_contact_that_was_fitted_to_a_foot_of_another_length_is_refused(trial):
    same, other = (
        contact_for(foot_length_m=length_m, values={}, curves=())
        for length_m in (trial.model.foot.length_m, 0.275)
    )
    trial_with(trial, same)
    with pytest.raises(InputError, match=r"a foot of 275 mm.*245 mm.*prosthesis.foot_length_mm"):
        trial_with(trial, other)


@pytest.mark.parametrize(
    ("stated_mm", "known"), [(None, False), (245, False), (275, False), (275, True)]
)
def test_a_contact_of_an_unknown_shell_is_told_where_another_shell_is_stated(
    trial_files, stated_mm, known
):
    trial_files.manifest["prosthesis"] |= {} if stated_mm is None else {"foot_length_mm": stated_mm}
    trial = load_trial(trial_files.write())
    length_m = trial.model.foot.length_m if known else None
    notes = trial_with(trial, contact_for(foot_length_m=length_m)).notes
    told = [note for note in notes if "The shell in which this contact was fitted" in note]
    assert len(told) == (stated_mm == 275 and not known)
    assert all("one of 275 mm" in note for note in told)


@pytest.mark.parametrize("change", ["angle", "force", "window"])
def test_fingerprint_differs_with_what_was_recorded(trial, trial_files, change):
    if change == "angle":
        trial_files.columns["knee_angle_r"][50] += 0.01
    elif change == "force":
        trial_files.forces["ground_force_r_vy"][500] += 0.1
    else:
        trial_files.manifest["window"] = {"start_s": 0.1, "end_s": 1.7}
    assert fingerprint(load_trial(trial_files.write())) != fingerprint(trial)


def test_fingerprint_is_of_the_recording_not_of_its_files(trial, trial_files, tmp_path):
    mark = fingerprint(trial)
    trial_files.manifest |= {"name": "another name", "prosthesis": {"fulcrum_mm": 100}}
    trial_files.folder = tmp_path / "elsewhere"
    trial_files.folder.mkdir()
    assert fingerprint(load_trial(trial_files.write())) == mark
    motion = trial.trajectory  # another processor or library may round otherwise
    rounded = type(motion)(motion.time_s, motion.values * (1.0 + 1e-15), motion.names)
    assert fingerprint(replace(trial, trajectory=rounded)) == mark


STANCES = (Stance(0.3, 1.0), Stance(1.5, 2.25), Stance(2.65, 3.42))
SPLINES = 8


def events(stances):
    return np.array([(stance.start_s, stance.end_s) for stance in stances]).ravel()


def derivatives_jump(function, times):
    """Largest steps of value, rate (1/s) and acceleration (1/s^2) across each of `times`, from
    one-sided cubics."""
    h, jumps = 2e-3, np.zeros(3)
    for time in times:
        sides = []
        for sign in (-1.0, 1.0):
            steps = sign * h * np.arange(6)
            cubic = np.polynomial.Polynomial.fit(steps, function(time + steps), 5).convert()
            sides.append([cubic(0.0), cubic.deriv(1)(0.0), cubic.deriv(2)(0.0)])
        jumps = np.maximum(jumps, np.abs(np.subtract(*sides)))
    return jumps


def test_phase_counts_strikes_and_reaches_the_stance_share_at_lift_off():
    np.testing.assert_allclose(
        gait_phase(STANCES)(events(STANCES)), [0.0, 0.62, 1.0, 1.62, 2.0, 2.62], atol=1e-12
    )


@pytest.mark.parametrize("at", [events(STANCES), np.array([0.7, 1.2, 2.9])])
def test_phase_is_twice_continuously_differentiable(at):
    value, rate, acceleration = derivatives_jump(gait_phase(STANCES), at)
    assert value < 1e-9 and rate < 1e-6 and acceleration < 1e-3


@given(
    lengths=st.lists(st.floats(0.16, 1.5), min_size=1, max_size=9).filter(lambda n: len(n) % 2 == 1)
)
def test_phase_rises_whatever_the_rhythm(lengths):
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    stances = [Stance(start, end) for start, end in zip(ends[::2], ends[1::2], strict=True)]
    times = np.linspace(-0.5, ends[-1] + 0.5, 4001)
    assert np.diff(gait_phase(stances)(times)).min() > 0.0


def test_stances_that_were_cut_do_not_count_beside_whole_ones():
    cut = Stance(3.9, 4.2, end_seen=False)
    times = np.linspace(0.0, 5.0, 51)
    np.testing.assert_array_equal(gait_phase([*STANCES, cut])(times), gait_phase(STANCES)(times))


@pytest.mark.parametrize(
    ("cut", "whole"),
    [
        (Stance(3.9, 4.2, end_seen=False), Stance(3.9, 4.6)),
        (Stance(3.9, 4.2, start_seen=False), Stance(3.5, 4.2)),
        (Stance(3.9, 4.8, start_seen=False), Stance(3.9, 4.8)),
    ],
)
def test_a_stance_that_was_seen_at_one_end_lasts_as_usual_or_as_long_as_it_was_seen(cut, whole):
    """The paper's stances last 0.7 to 0.8 s."""
    times = np.linspace(3.0, 5.0, 41)
    np.testing.assert_allclose(gait_phase([cut])(times), gait_phase([whole])(times), atol=1e-12)


@pytest.mark.parametrize("stances", [[], [Stance(3.9, 4.2, False, False)]])
def test_without_strike_and_lift_off_nothing_is_laid_over_the_gait_cycle(stances):
    with pytest.raises(InputError, match=r"neither strike nor lift-off .* was seen"):
        gait_phase(stances)


@pytest.mark.parametrize("count", [4, 5, SPLINES, 17])
def test_periodic_splines_share_one_and_repeat_every_cycle(count):
    phase = np.linspace(-1.3, 2.7, 1001)
    basis = periodic_bsplines(count)(phase)
    assert basis.shape == (1001, count) and basis.min() >= 0.0
    np.testing.assert_allclose(basis.sum(axis=1), 1.0, atol=1e-13)
    np.testing.assert_allclose(periodic_bsplines(count)(phase + 3.0), basis, atol=1e-12)
    assert np.linalg.matrix_rank(basis) == count
