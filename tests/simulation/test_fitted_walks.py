"""A walk of the fitted model and trial is the walk with the fitted values, by whichever way they get there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_contact import CURVE, OF_THE_MODEL, OF_THE_TRIAL, OWN, made_contact

from vsf_drake.contact_file import model_with
from vsf_drake.files import resource
from vsf_drake.motion.fitted_trial import fingerprint, gait_phase, trial_with
from vsf_drake.motion.trajectory import periodic_bsplines, window_bsplines
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.variables import Course
from vsf_drake.simulation.walk import Walker, walk_notes

STEP_S = 2e-3


@pytest.fixture(scope="module")
def trial():
    return load_trial(resource("data/reference_subject/exact/medium_1.yaml"))


@pytest.fixture(scope="module")
def person(trial):
    return Walker(trial.subject, trial.model)


def walked(walker, trial, **options):
    return walker.walk(trial.trajectory, fulcrum_m=trial.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s,
                       step_s=STEP_S, offsets=trial.offsets, **options)


def assert_same(a, b, tolerance):
    """Forces to `tolerance` of the largest, coordinates to `tolerance` (m, rad)."""
    largest = np.abs(a.prosthetic.grf_W).max()
    np.testing.assert_allclose(b.prosthetic.grf_W, a.prosthetic.grf_W, rtol=0.0, atol=tolerance * largest)
    np.testing.assert_allclose(b.record.q, a.record.q, rtol=0.0, atol=tolerance)


ONE_BY_ONE = [{name: value} for name, value in OF_THE_MODEL.items()]


@pytest.mark.parametrize("values", [*ONE_BY_ONE, OF_THE_MODEL], ids=lambda v: next(iter(v)) if len(v) == 1 else "all")
def test_values_in_the_model_walk_as_values_of_the_walk(trial, person, values):
    wanted = walked(person, trial, values=values)
    assert np.abs(wanted.prosthetic.grf_W - walked(person, trial).prosthetic.grf_W).max() > 1e-3
    found = walked(Walker(trial.subject, model_with(trial.model, values)), trial)
    assert_same(wanted, found, 1e-10)


def test_the_fitted_model_is_one_whose_variables_have_the_fitted_values_as_their_own(trial):
    variables = Walker(trial.subject, model_with(trial.model, OF_THE_MODEL)).variables
    for name, value in OF_THE_MODEL.items():
        assert variables[name].default == (0.0 if name.endswith("rise") else pytest.approx(value))


def test_offsets_and_shifts_in_the_trial_walk_as_values_of_the_walk(trial, person):
    contact = made_contact(values=OF_THE_TRIAL, curves=(), trials=())
    assert_same(walked(person, trial, values=OF_THE_TRIAL), walked(person, trial_with(trial, contact)), 1e-10)


def test_a_fitted_trial_walks_as_the_fit_did_with_courses(trial, person):
    """The samples carry curve and path to the spline's accuracy: fourth order in a hundredth of a second."""
    contact = made_contact(trials=(replace(OWN, fingerprint=fingerprint(trial)),))
    phase, splines = gait_phase(trial), periodic_bsplines(len(CURVE.coefficients))
    values = {**OF_THE_MODEL, **OF_THE_TRIAL}
    values["offset.height"] += OWN.height_m
    courses = []

    def course(name, coordinate, shape, value):
        courses.append(Course(name=name, coordinate=coordinate, shape=shape))
        values[f"course.{name}"] = value

    for i, value in enumerate(CURVE.coefficients):
        course(f"curve.{i}", CURVE.coordinate, lambda t, i=i: splines(phase(t))[:, i], value)
    for name, coefficients in OWN.path.items():
        basis = window_bsplines(trial.start_s, trial.end_s, len(coefficients))
        for i, value in enumerate(coefficients):
            course(f"{name}.{i}", name, lambda t, i=i, basis=basis: basis(t)[:, i], value)
    wanted = walked(person, trial, values=values, courses=courses)
    fitted = trial_with(trial, contact)
    found = walked(Walker(fitted.subject, fitted.model), fitted)
    assert_same(wanted, found, 1e-5)
    without = walked(person, trial, values={name: v for name, v in values.items() if not name.startswith("course.")})
    assert np.abs(without.prosthetic.grf_W - wanted.prosthetic.grf_W).max() > 20.0


def test_a_fitted_foot_walks_on_the_foam_that_it_is_tested_with(trial):
    """Notes tell of feet that do not; the fitted exponent is no excuse any more."""
    fitted = model_with(trial.model, OF_THE_MODEL)
    walk = walked(Walker(trial.subject, fitted), trial)
    assert not any("another foam" in note for note in walk_notes(walk, trial.subject, fitted))
    other = replace(fitted, foot=replace(fitted.foot, series_exponent=1.0, series_stiffness_n_per_m=62.98e3))
    assert any("another foam" in note for note in walk_notes(walk, trial.subject, other))
