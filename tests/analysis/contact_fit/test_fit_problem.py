"""The joint fit as a problem: exact derivatives, one cost by any way, and what is no problem."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.solvers import MathematicalProgram

from vsf_drake.analysis.contact_fit import ContactFit, ContactFitOptions
from vsf_drake.analysis.contact_fit.parameters import FitParameter, FitParameters, standard_parameters
from vsf_drake.errors import InputError, SimulationError
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
@pytest.mark.parametrize(("series", "tolerance"), [
    (("fore_aft", "lateral", "vertical", "cop_fore_aft"), 5e-3), (("resultant", "cop_fore_aft"), 0.03)])
def test_jacobian_of_every_parameter_is_that_of_differences(
        fit_walker, soft, stiff, measured_bench, series, tolerance):
    """All standard parameters, paths and the damping of each zone among them, on two trials and the bench.

    Two things are left out of the derivatives: that a path at its ends turns the mean direction of walking (3e-3 of
    what it does at all), and the direction of a resultant below 1 N (2e-2 of what little some curves do).
    """
    parameters = standard_parameters(fit_walker.variables, "right", BOTH, damping_by_zone=True, paths=True)
    parameters = parameters.changed([*parameters.by_name], frozen=False)
    fit = ContactFit([soft, stiff], bench=measured_bench, parameters=parameters, walker=fit_walker, labels=BOTH,
                     options=ContactFitOptions(series=series))
    off = mismatch(fit, somewhere(fit))
    assert len(off) == len(parameters.items)
    assert max(off.values()) < tolerance, sorted(off.items(), key=lambda item: -item[1])[:5]
    if "resultant" not in series:
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


def test_bench_residual_is_the_misfit_of_the_stiffness_over_its_uncertainty(both, measured_bench):
    fit = both("contact.forefoot.force")
    u = fit.parameters.start
    stiffness = fit.bench_stiffness(u)
    measured = np.array([*measured_bench.stiffness_n_per_m, measured_bench.heel_stiffness_n_per_m])
    term = fit.evaluate(u).terms[-2]
    np.testing.assert_allclose(term.residual, (stiffness - measured) / measured_bench.uncertainty_n_per_m)
    assert term.times_s is None and term.weight == 1.0


def test_the_program_has_the_fits_cost_gradient_bounds_and_start(both):
    fit = both()
    program = fit.program()
    assert isinstance(program, MathematicalProgram)
    (cost,), (box,) = program.GetAllCosts(), program.bounding_box_constraints()
    np.testing.assert_array_equal(box.evaluator().lower_bound(), fit.parameters.bounds[0])
    np.testing.assert_array_equal(box.evaluator().upper_bound(), fit.parameters.bounds[1])
    np.testing.assert_array_equal(program.initial_guess(), fit.parameters.start)
    for seed in (1, 2):
        u = somewhere(fit, seed)
        at = fit.evaluate(u)
        assert program.EvalBinding(cost, u)[0] == pytest.approx(at.cost, rel=1e-14)
        found = cost.evaluator().Eval(InitializeAutoDiff(u))
        assert ExtractValue(found)[0, 0] == at.cost
        np.testing.assert_allclose(ExtractGradient(found)[0], at.jacobian.T @ at.residual, rtol=1e-12)


def test_gradient_follows_the_chain_rule_of_what_it_is_given(both):
    """Drake may seed it with derivatives by other variables than u."""
    fit = both()
    u, turn = somewhere(fit), np.random.default_rng(3).normal(size=(len(CHEAP), 2))
    (cost,) = fit.program().GetAllCosts()
    found = cost.evaluator().Eval(InitializeAutoDiff(u, gradient=turn))
    at = fit.evaluate(u)
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
    again = both().evaluate(u)
    np.testing.assert_array_equal(again.residual, together.residual)
    np.testing.assert_array_equal(again.jacobian, together.jacobian)


def test_derivatives_do_not_change_the_residuals(few_free):
    u = np.array([0.1])
    with_, without = (few_free("offset.height").evaluate(u, derivatives=derivatives) for derivatives in (True, False))
    np.testing.assert_allclose(with_.residual, without.residual, rtol=1e-9, atol=1e-9)
    assert without.jacobian.shape == (len(without.residual), 0)


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


def test_a_walk_that_fails_is_told(few_free, monkeypatch):
    fit = few_free("offset.height")

    def broken(*_, **__):
        raise SimulationError("broke", time_s=0.3)

    monkeypatch.setattr(fit.walker, "walk", broken)
    with pytest.raises(SimulationError, match="broke"):
        fit.evaluate(np.zeros(1))


def test_parameters_of_another_fits_trials_are_refused(fit_walker, soft):
    parameters = standard_parameters(fit_walker.variables, "right", ["low_1", "low_2"])
    with pytest.raises(InputError, match=r"trial.low_2.height belongs to no trial.*The trials are: low_1"):
        ContactFit([soft], parameters=parameters, walker=fit_walker)


def test_unknown_parameters_are_refused_before_anything_is_walked(fit_walker, soft):
    parameter = FitParameter(name="offset.hight", unit="m", start=0.0, low=-1.0, high=1.0, mean=0.0, scale=1.0)
    with pytest.raises(InputError, match=r"offset.hight is no parameter of a contact fit"):
        ContactFit([soft], parameters=FitParameters([parameter]), walker=fit_walker)


def test_a_walker_of_somebody_else_is_refused(soft):
    other = Walker(replace(soft.subject, mass_kg=soft.subject.mass_kg + 1.0), soft.model)
    with pytest.raises(InputError, match="another subject or model"):
        ContactFit([soft], walker=other)


def test_without_a_bench_there_is_no_stiffness_to_tell(few_free):
    fit = few_free("offset.height")
    with pytest.raises(ValueError, match="no bench"):
        fit.bench_stiffness(np.zeros(1))
    assert "bench" not in [term.name for term in fit.evaluate(np.zeros(1)).terms]


def test_a_bench_beyond_the_carriage_is_refused(few_free, measured_bench):
    far = replace(measured_bench, fulcrum_m=(0.066, 0.4), stiffness_n_per_m=(1e4, 3e4))
    with pytest.raises(InputError):
        few_free("offset.height", bench=far)


def test_fits_by_default_what_a_careful_experimenter_would(soft, fit_walker):
    fit = ContactFit([soft], walker=fit_walker)
    assert fit.labels == ("low_1",)
    frozen = {item.name for item in fit.parameters.items if item.frozen}
    assert {"friction.mu_static", "friction.mu_kinetic", "contact.heel.full_damping_depth",
            "keel.flexural_modulus"} <= frozen
    assert {"contact.damping_time", "coordinate.hip_flexion_r", "socket.tz.stiffness"} <= set(fit.parameters.names)
