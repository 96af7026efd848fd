"""The joint fit as a problem: exact derivatives, one cost by any way, and which recordings make one fit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff

from vsf_drake.analysis.contact_fit import ContactFit
from vsf_drake.analysis.contact_fit.parameters import standard_parameters
from vsf_drake.analysis.contact_fit.problem import check_recordings, labels_of
from vsf_drake.errors import InputError
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.simulation.walk import Walker

CHEAP = ("offset.height", "contact.forefoot.force", "contact.damping_time", "trial.low_1.height")
BOTH = ["low_1", "high_1"]


@pytest.fixture
def both(few_free, soft, stiff, measured_bench):
    def make(*names, **options):
        return few_free(*(names or CHEAP), trials=[soft, stiff], bench=measured_bench, **options)

    return make


def somewhere(fit, seed=0, scale=0.2):
    low, high = fit.parameters.bounds
    return np.clip(np.random.default_rng(seed).normal(0.0, scale, len(fit.parameters)), 0.9 * low, 0.9 * high)


def mismatch(fit, u, step=1e-5):
    """Of each parameter, how far the Jacobian's column is off central differences, over its size.

    The step is small: the filter of the model's centre of pressure begins and ends with the load, at an instant of the
    walk, so that the residuals jump by a hundredth of their noise where the load begins or ends one instant later.
    """
    exact, off = fit.evaluate(u).jacobian, {}
    for p, name in enumerate(fit.parameters.names):
        one = step * np.eye(len(u))[p]
        sides = [fit.evaluate(u + sign * one, derivatives=False).residual for sign in (-1.0, 1.0)]
        wanted = (sides[1] - sides[0]) / (2.0 * step)
        off[name] = float(np.linalg.norm(exact[:, p] - wanted) / np.linalg.norm(wanted))
    return off


@pytest.mark.slow
def test_jacobian_of_every_parameter_is_that_of_differences(fit_walker, soft, stiff, measured_bench):
    """All standard parameters, paths and the damping of each zone among them, on two trials and the bench.

    Left out of the derivatives is that a path at its ends turns the mean direction of walking (3e-3 of what it does).
    """
    parameters = standard_parameters(fit_walker.variables, "right", BOTH, damping_by_zone=True, paths=True)
    parameters = parameters.changed([*parameters.by_name], frozen=False)
    fit = ContactFit([soft, stiff], bench=measured_bench, parameters=parameters, walker=fit_walker, labels=BOTH)
    off = mismatch(fit, somewhere(fit))
    assert len(off) == len(parameters.items)
    assert max(off.values()) < 5e-3, sorted(off.items(), key=lambda item: -item[1])[:5]
    assert max(value for name, value in off.items() if "path" not in name) < 1e-4


def test_jacobian_of_a_parameter_of_each_kind_is_that_of_differences(both):
    fit = both("contact.heel_posterior.force", "contact.forefoot.exponent", "contact.forefoot.rise",
               "contact.damping_time", "offset.alignment", "coordinate.hip_flexion_r", "curve.knee_angle_r.2",
               "socket.tz.stiffness", "trial.high_1.height", "keel.flexural_modulus")
    off = mismatch(fit, somewhere(fit))
    assert max(off.values()) < 1e-4, off


def test_cost_is_half_the_sum_of_squared_weighted_residuals_and_priors(both):
    fit = both()
    u = somewhere(fit)
    at = fit.evaluate(u)
    by_hand = sum(0.5 * term.weight**2 * term.residual @ term.residual for term in at.terms)
    assert at.cost == pytest.approx(by_hand, rel=1e-12)
    *data, prior = at.terms
    assert [(term.trial, term.name) for term in data] == [
        *((label, name) for label in BOTH for name in fit.options.series), ("bench", "bench")]
    assert (prior.name, prior.weight) == ("prior", 1.0)
    np.testing.assert_array_equal(prior.residual, u)
    np.testing.assert_array_equal(prior.by, np.eye(len(u)))


def test_parameters_without_prior_are_held_by_the_data_alone(few_free, soft, fit_walker):
    fit = few_free("offset.height", "offset.fore_aft")
    without = ContactFit([soft], parameters=fit.parameters.changed(["offset.height"], prior=False), walker=fit_walker)
    u = np.array([0.3, 0.4])
    assert fit.evaluate(u).cost - without.evaluate(u).cost == pytest.approx(0.5 * 0.3**2)
    assert without.evaluate(u).terms[-1].residual.tolist() == [0.4]


def test_the_program_has_the_fits_cost_gradient_bounds_and_start(both):
    """By the chain rule of what Drake seeds it with, which may be derivatives by other variables than u."""
    fit = both()
    program = fit.program()
    (cost,), (box,) = program.GetAllCosts(), program.bounding_box_constraints()
    np.testing.assert_array_equal(box.evaluator().lower_bound(), fit.parameters.bounds[0])
    np.testing.assert_array_equal(box.evaluator().upper_bound(), fit.parameters.bounds[1])
    np.testing.assert_array_equal(program.initial_guess(), fit.parameters.start)
    u, turn = somewhere(fit), np.random.default_rng(3).normal(size=(len(CHEAP), 2))
    at = fit.evaluate(u)
    assert program.EvalBinding(cost, u)[0] == pytest.approx(at.cost, rel=1e-14)
    found = cost.evaluator().Eval(InitializeAutoDiff(u, gradient=turn))
    assert ExtractValue(found)[0, 0] == at.cost
    np.testing.assert_allclose(ExtractGradient(found)[0], at.jacobian.T @ at.residual @ turn, rtol=1e-12)


def test_trials_side_by_side_give_the_same_bits_as_one_after_the_other(both, soft, stiff):
    fit = both()
    u = somewhere(fit)
    together = fit.evaluate(u)
    serial = [term for trial, label in zip((soft, stiff), BOTH, strict=True)
              for term in fit.terms_of(trial, label).terms(u, derivatives=True)]
    for found, wanted in zip(together.terms, serial, strict=False):
        assert (found.name, found.trial) == (wanted.name, wanted.trial)
        np.testing.assert_array_equal(found.residual, wanted.residual)
        np.testing.assert_array_equal(found.by, wanted.by)


def test_a_point_is_walked_once(few_free):
    fit = few_free("offset.height")
    u = np.array([0.1])
    fit.evaluate(u)
    fit.evaluate(u, derivatives=False)
    assert fit.evaluations == 1
    fit.evaluate(u + 0.1, derivatives=False)
    fit.evaluate(u + 0.1)
    assert fit.evaluations == 3, "what was walked without derivatives lacks them"
    u += 0.1
    fit.evaluate(u)
    u += 0.1
    assert fit.evaluate(u).residual is not fit.evaluate(u - 0.1).residual, "the caller's array may change"


def test_parameters_of_another_fits_trials_and_a_walker_of_somebody_else_are_refused(fit_walker, soft):
    parameters = standard_parameters(fit_walker.variables, "right", ["low_1", "low_2"])
    with pytest.raises(InputError, match=r"trial.low_2.height belongs to no trial.*The trials are: low_1"):
        ContactFit([soft], parameters=parameters, walker=fit_walker)
    other = Walker(replace(soft.subject, mass_kg=soft.subject.mass_kg + 1.0), soft.model)
    with pytest.raises(InputError, match="another subject or model"):
        ContactFit([soft], walker=other)


def refused(trials, match, held_out=()):
    with pytest.raises(InputError, match=match) as caught:
        check_recordings(trials, held_out, series=("vertical", "cop_fore_aft"))
    return caught.value


def with_plate(trial, **fields):
    return replace(trial, plates=trial.plates | {"right": replace(trial.prosthetic_plate, **fields)})


def test_a_recording_that_is_given_twice_is_refused_whatever_its_name(soft, stiff):
    """A copy under another name, path and fulcrum is the same recording."""
    copy = replace(soft, path=Path("elsewhere/copy.yaml"), name="copy", fulcrum_m=0.1, notes=("copied",))
    error = refused([soft, stiff], "fitted and held out", [copy])
    assert error.file == copy.path and str(soft.path) in str(error)
    refused([soft, stiff, copy], "is the same recording as .*low_1.yaml. Give it once")
    refused([soft], "Give it once", [stiff, replace(stiff, path=Path("copy.yaml"))])


def test_recordings_that_do_not_go_together_are_refused_fitted_or_held_out(soft, stiff, fit_walker):
    def subject(**fields):
        return replace(stiff, subject=replace(stiff.subject, **fields))

    foot = replace(stiff.model.foot, mass_kg=1.1 * stiff.model.foot.mass_kg)
    plate = stiff.prosthetic_plate
    blind = with_plate(stiff, has_cop=False, cop_W=np.full_like(plate.cop_W, np.nan))
    part = "saw only part of the stance at "
    for other, match, where in (
            (subject(mass_kg=91.0), f"another subject than .*mass_kg 91.0 and {soft.subject.mass_kg}", "subject"),
            (subject(prosthetic_side="left"), "prosthetic_side left and right", "subject"),
            (replace(stiff, model=replace(stiff.model, foot=foot)), "another model than .*low_1.yaml", "model"),
            (replace(stiff, notes=("A fitted contact was applied from contact.yaml.",)), "a fitted contact already",
             None),
            (replace(stiff, start_s=0.6), part, "window"), (replace(stiff, end_s=0.9), part, "window"),
            (replace(stiff, start_s=0.0, end_s=0.3), "no stance of the prosthetic foot in the trial's", "forces"),
            (with_plate(stiff, force_W=0.0 * plate.force_W), "saw no stance", "forces"),
            (blind, "no centre of pressure, which is to be compared", "forces")):
        for trials, held in (([soft, other], []), ([soft], [other])):
            error = refused(trials, match, held)
            assert error.where == where and error.file == stiff.path
    with pytest.raises(InputError, match="another model"):
        ContactFit([soft, replace(stiff, model=replace(stiff.model, foot=foot))], walker=fit_walker)
    check_recordings([soft, blind], series=("vertical",))
    refused([], "no trial to fit", [stiff])
    refused(soft, "no list of trials")


def test_a_plate_that_begins_or_ends_under_load_is_refused(soft):
    plate = soft.prosthetic_plate
    for rows in (plate.time_s > 0.8, plate.time_s < 0.8):
        cut = PlateRecording(*(getattr(plate, name)[rows] for name in ("time_s", "force_W", "cop_W", "free_moment_nm")),
                             plate.has_cop)
        refused([replace(soft, plates=soft.plates | {"right": cut})], "saw only part of the stance")


def test_labels_are_file_names_with_as_many_folders_as_tell_them_apart(soft):
    names = ("a/low.yaml", "b/monday/soft/walk.yaml", "b/tuesday/soft/walk.yaml", "b/tuesday/soft/run.yaml")
    assert labels_of([replace(soft, path=Path(name)) for name in names]) == (
        "low", "monday/soft/walk", "tuesday/soft/walk", "run")
