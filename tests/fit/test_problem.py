"""The joint fit as a problem: exact derivatives, one cost by any way, and which recordings make one
fit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.device.bench_metrics import mid_range_displacement
from vsf_drake.fit import problem as module
from vsf_drake.fit.options import FitNoise
from vsf_drake.fit.parameters import standard_parameters
from vsf_drake.fit.problem import ContactFit, check_recordings
from vsf_drake.fit.solve import search
from vsf_drake.model.contact_file import model_with
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.simulation.bench import run_bench
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.metrics import walk_metrics
from vsf_drake.walks.recorded_walk import labels_of

CHEAP = ("offset.height", "contact.forefoot.force", "contact.damping_time", "trial.low_1.height")
BOTH = ["low_1", "high_1"]


@pytest.fixture
def both(few_free, soft, stiff, measured_bench):
    def make(*names, **options):
        return few_free(*(names or CHEAP), trials=[soft, stiff], bench=measured_bench, **options)

    return make


def somewhere(fit, seed=0, scale=0.2):
    low, high = fit.parameters.bounds
    return np.clip(
        np.random.default_rng(seed).normal(0.0, scale, len(fit.parameters)), 0.9 * low, 0.9 * high
    )


def mismatch(fit, u, step=1e-5):
    """Of each parameter, how far the Jacobian's column is off central differences, over its size.

    The step is small: the filter of the model's centre of pressure begins and ends with the load,
    at an instant of the walk, so that the residuals jump by a hundredth of their noise where the
    load begins or ends one instant later.
    """
    exact, off = fit.evaluate(u).jacobian, {}
    for p, name in enumerate(fit.parameters.names):
        one = step * np.eye(len(u))[p]
        sides = [fit.evaluate(u + sign * one, derivatives=False).residual for sign in (-1.0, 1.0)]
        wanted = (sides[1] - sides[0]) / (2.0 * step)
        off[name] = float(np.linalg.norm(exact[:, p] - wanted) / np.linalg.norm(wanted))
    return off


@pytest.mark.slow
def test_jacobian_of_every_parameter_is_that_of_differences(
    fit_walker, soft, stiff, measured_bench
):
    """All standard parameters, paths and the damping of each zone among them, on two trials and the
    bench.

    Left out of the derivatives is that a path at its ends turns the mean direction of walking, and
    with it what is fore-aft and what lateral of the centre of pressure (5e-3 of what it does).
    """
    parameters = standard_parameters(
        fit_walker.variables, "right", BOTH, damping_by_zone=True, paths=True
    )
    parameters = parameters.changed([*parameters.by_name], frozen=False)
    fit = ContactFit(
        [soft, stiff], bench=measured_bench, parameters=parameters, walker=fit_walker, labels=BOTH
    )
    off = mismatch(fit, somewhere(fit))
    assert len(off) == len(parameters.items)
    assert max(off.values()) < 1e-2, sorted(off.items(), key=lambda item: -item[1])[:5]
    assert max(value for name, value in off.items() if "path" not in name) < 1e-4


def test_jacobian_of_a_parameter_of_each_kind_is_that_of_differences(both):
    fit = both(
        "contact.heel_posterior.force",
        "contact.forefoot.exponent",
        "contact.forefoot.rise",
        "contact.damping_time",
        "offset.alignment",
        "coordinate.hip_flexion_r",
        "curve.knee_angle_r.2",
        "socket.tz.stiffness",
        "trial.high_1.height",
        "keel.flexural_modulus",
    )
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
        *((label, name) for label in BOTH for name in fit.options.series),
        ("bench", "bench"),
    ]
    assert (prior.name, prior.weight) == ("prior", 1.0)
    np.testing.assert_array_equal(prior.residual, u)
    np.testing.assert_array_equal(prior.by, np.eye(len(u)))


def test_parameters_without_prior_are_held_by_the_data_alone(few_free, soft, fit_walker):
    fit = few_free("offset.height", "offset.fore_aft")
    without = ContactFit(
        [soft], parameters=fit.parameters.changed(["offset.height"], prior=False), walker=fit_walker
    )
    u = np.array([0.3, 0.4])
    assert fit.evaluate(u).cost - without.evaluate(u).cost == pytest.approx(0.5 * 0.3**2)
    assert without.evaluate(u).terms[-1].residual.tolist() == [0.4]


def test_the_program_has_the_fits_cost_gradient_bounds_and_start(both):
    """By the chain rule of what Drake seeds it with, which may be derivatives by other variables
    than u."""
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
    np.testing.assert_allclose(
        ExtractGradient(found)[0], at.jacobian.T @ at.residual @ turn, rtol=1e-12
    )


def test_costs_of_points_are_those_of_each_alone_and_infinite_where_a_walk_fails(
    both, stiff, monkeypatch
):
    fit = both()
    points = np.array([somewhere(fit, seed) for seed in range(3)])
    alone = [fit.evaluate(u, derivatives=False).cost for u in points]
    assert fit.costs(points).tolist() == alone and fit.evaluations == 2 * len(points)
    walks = fit.walks

    def one_fails(trial, changes, **shared):
        found = walks(trial, changes, **shared)
        return [*found[:2], SimulationError("broke", time_s=0.3)] if trial is stiff else found

    monkeypatch.setattr(fit, "walks", one_fails)
    assert fit.costs(points).tolist() == [*alone[:2], np.inf]


def test_trials_side_by_side_give_the_same_bits_as_one_after_the_other(both, soft, stiff):
    fit = both()
    u = somewhere(fit)
    together = fit.evaluate(u)
    serial = [
        term
        for trial, label in zip((soft, stiff), BOTH, strict=True)
        for term in fit.terms_of(trial, label).terms(u, derivatives=True)
    ]
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
    assert fit.evaluate(u).residual is not fit.evaluate(u - 0.1).residual, (
        "the caller's array may change"
    )


def test_parameters_of_another_fits_trials_and_a_walker_of_somebody_else_are_refused(
    fit_walker, soft
):
    parameters = standard_parameters(fit_walker.variables, "right", ["low_1", "low_2"])
    with pytest.raises(
        InputError, match=r"trial.low_2.height belongs to no trial.*The trials are: low_1"
    ):
        ContactFit([soft], parameters=parameters, walker=fit_walker)
    other = Walker(replace(soft.subject, mass_kg=soft.subject.mass_kg + 1.0), soft.model)
    with pytest.raises(InputError, match="another subject or model"):
        ContactFit([soft], walker=other)


def refused(trials, match, held_out=()):
    with pytest.raises(InputError, match=match) as caught:
        check_recordings(trials, held_out, series=("vertical", "cop_fore_aft"))
    return caught.value


def with_plate(trial, **fields):
    return replace(
        trial, plates=trial.plates | {"right": replace(trial.prosthetic_plate, **fields)}
    )


def test_a_recording_that_is_given_twice_is_refused_whatever_its_name(soft, stiff):
    """A copy under another name, path and fulcrum is the same recording."""
    copy = replace(
        soft, path=Path("elsewhere/copy.yaml"), name="copy", fulcrum_m=0.1, notes=("copied",)
    )
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
        (
            subject(mass_kg=91.0),
            f"another subject than .*mass_kg 91.0 and {soft.subject.mass_kg}",
            "subject",
        ),
        (subject(prosthetic_side="left"), "prosthetic_side left and right", "subject"),
        (
            replace(stiff, model=replace(stiff.model, foot=foot)),
            "another model than .*low_1.yaml",
            "model",
        ),
        (
            replace(stiff, notes=("A fitted contact was applied from contact.yaml.",)),
            "a fitted contact already",
            None,
        ),
        (replace(stiff, start_s=0.6), part, "window"),
        (replace(stiff, end_s=0.9), part, "window"),
        (
            replace(stiff, start_s=0.0, end_s=0.3),
            "no stance of the prosthetic foot in the trial's",
            "forces",
        ),
        (with_plate(stiff, force_W=0.0 * plate.force_W), "saw no stance", "forces"),
        (blind, "no centre of pressure, which is to be compared", "forces"),
    ):
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
        cut = PlateRecording(
            *(
                getattr(plate, name)[rows]
                for name in ("time_s", "force_W", "cop_W", "free_moment_nm")
            ),
            plate.has_cop,
        )
        refused([replace(soft, plates=soft.plates | {"right": cut})], "saw only part of the stance")


def test_labels_are_file_names_with_as_many_folders_as_tell_them_apart(soft):
    names = (
        "a/low.yaml",
        "b/monday/soft/walk.yaml",
        "b/tuesday/soft/walk.yaml",
        "b/tuesday/soft/run.yaml",
    )
    assert labels_of([replace(soft, path=Path(name)) for name in names]) == (
        "low",
        "monday/soft/walk",
        "tuesday/soft/walk",
        "run",
    )


# Residuals of a trial: the errors of the metrics in units of their noise.

NOISE = FitNoise(
    fore_aft=0.01,
    lateral=0.02,
    vertical=0.03,
    resultant=0.04,
    cop_fore_aft=0.05,
    correlation_s=0.06,
)
SERIES = ("fore_aft", "lateral", "vertical", "cop_fore_aft")
METRIC = {
    "fore_aft": "fore_aft_rmse_bw",
    "lateral": "medio_lateral_rmse_bw",
    "vertical": "vertical_rmse_bw",
    "resultant": "grf_rmse_bw",
    "cop_fore_aft": "cop_rmse_fl",
}
MOVED = ("offset.height", "offset.fore_aft", "contact.forefoot.force")
SHIFT = np.array([0.01, 0.0, 0.0])


@pytest.fixture
def of_trial(few_free):
    def make(trial, series=SERIES, **options):
        return few_free(
            *MOVED, trials=[trial], labels=["own"], series=series, noise=NOISE, **options
        )

    return make


def of(fit, *, derivatives=False):
    found = fit.terms_of(fit.trials[0], "own").terms(fit.parameters.start, derivatives=derivatives)
    return {term.name: term for term in found}


def own_walk(fit, **options):
    comparison, result = fit.terms_of(fit.trials[0], "own").walk(fit.parameters.start, **options)
    return comparison, result


@pytest.mark.parametrize("series", [SERIES, ("resultant", "cop_fore_aft")])
def test_residuals_are_the_errors_of_the_metrics_over_their_noise(
    monkeypatch, of_trial, soft, series
):
    monkeypatch.setattr(module, "STRIDE", 1)
    problem = of_trial(soft, series)
    comparison, result = own_walk(problem)
    metrics = walk_metrics(result, soft.prosthetic_plate, comparison=comparison)
    found = of(problem)
    monkeypatch.undo()
    strided = of(problem)
    assert set(found) == set(series) == set(strided)
    for name, term in found.items():
        residual = term.residual
        if name == "cop_fore_aft":
            residual = residual[np.isfinite(comparison.stances[0].model_cop[:, 0])]
            assert len(residual) == metrics.cop_points
        rms = getattr(NOISE, name) * np.sqrt(np.mean(residual**2))
        assert rms == pytest.approx(getattr(metrics, METRIC[name]), rel=1e-9), name
        assert len(strided[name].residual) < 0.27 * max(len(comparison.time_s), 101)
        fewer = getattr(NOISE, name) * np.sqrt(np.mean(strided[name].residual ** 2))
        assert fewer == pytest.approx(getattr(metrics, METRIC[name]), rel=0.05), (
            f"{name}, every fourth instant"
        )


def test_instants_are_where_the_series_was_compared_and_weigh_by_their_spacing(of_trial, soft):
    problem = of_trial(soft)
    comparison, _ = own_walk(problem)
    found, stance = of(problem), comparison.stances[0].measured
    for name, spacing in (("vertical", 8e-3), ("cop_fore_aft", 0.04 * stance.duration_s)):
        times = found[name].times_s
        np.testing.assert_allclose(np.diff(times), spacing, rtol=1e-6)
        assert found[name].weight == pytest.approx(np.sqrt(spacing / (2 * 0.06)))
    assert found["cop_fore_aft"].times_s[[0, -1]] == pytest.approx([stance.start_s, stance.end_s])
    inside = comparison.scored[np.searchsorted(comparison.time_s, found["vertical"].times_s - 1e-9)]
    assert inside.all()
    assert {term.trial for term in found.values()} == {"own"}


def test_a_plate_that_reads_more_makes_a_residual_of_that_much_less(of_trial, soft):
    _, result = own_walk(of_trial(soft))
    weight = soft.subject.mass_kg * 9.81
    plate = PlateRecording(
        result.time_s,
        result.grf_W * [1.0, 1.0, 1.1],
        result.cop_W + SHIFT,
        result.free_moment_nm,
        True,
    )
    heading = own_walk(of_trial(soft))[0].heading
    own = replace(soft, plates=soft.plates | {"right": plate})
    comparison, _ = own_walk(of_trial(own))
    found = of(of_trial(own))
    rows = np.searchsorted(comparison.time_s, found["vertical"].times_s - 1e-9)
    np.testing.assert_allclose(
        found["vertical"].residual, -0.1 * comparison.model[rows, 2] / weight / 0.03, atol=1e-6
    )
    inner = slice(5, -5)  # a plate that reads more is loaded a little sooner and longer
    np.testing.assert_allclose(
        found["cop_fore_aft"].residual[inner],
        -0.01 * heading[0] / result.foot_length_m / 0.05,
        rtol=1e-3,
    )


def test_without_a_centre_of_pressure_on_either_side_there_is_no_residual_and_no_derivative(
    of_trial, soft
):
    plate = soft.prosthetic_plate
    late = plate.time_s > 0.9
    cop = np.where(late[:, None], np.nan, plate.cop_W)
    own = replace(soft, plates=soft.plates | {"right": replace(plate, cop_W=cop)})
    term = of(of_trial(own), derivatives=True)["cop_fore_aft"]
    assert np.isfinite(term.residual).all() and np.isfinite(term.by).all()
    missing = term.times_s > 0.91
    assert missing.any() and not term.residual[missing].any() and not term.by[missing].any()
    assert term.residual[~missing].any() and term.by[~missing].any()


def test_derivatives_of_the_resultant_are_those_of_differences(of_trial, soft):
    """Of a walk whose forces change branch at single instants: compared in the mean."""
    problem = of_trial(soft, ("resultant",))
    terms, u, step = problem.terms_of(soft, "own"), problem.parameters.start, 1e-3
    exact = {term.name: term.by for term in terms.terms(u, derivatives=True)}
    for p in range(len(MOVED)):
        sides = [
            terms.terms(u + sign * step * np.eye(len(u))[p], derivatives=False)
            for sign in (-1.0, 1.0)
        ]
        for low, high in zip(*sides, strict=True):
            wanted = (high.residual - low.residual) / (2.0 * step)
            off = np.linalg.norm(exact[low.name][:, p] - wanted) / np.linalg.norm(wanted)
            assert off < 0.01, (low.name, MOVED[p], off)


# The bench: stiffness and mid-range displacement; nothing where unmeasured.

PRESSED = (
    "contact.forefoot.force",
    "contact.forefoot.exponent",
    "contact.heel.force",
    "contact.heel_posterior.rise",
    "offset.height",
)


@pytest.fixture
def pressed(few_free, bench_curves):
    return few_free(*PRESSED, bench=bench_curves)


def displacement(fit, u):
    return fit.machine.displacement(fit.shared.at(u).values)[0]


def test_residuals_are_the_misfits_over_their_uncertainty_and_need_no_displacement(
    few_free, pressed, bench_curves
):
    u = pressed.parameters.start + 0.1
    *_, stiffness, displaced, prior = pressed.evaluate(u).terms
    assert (stiffness.name, displaced.name, prior.name) == (
        "bench",
        "mid-range displacement",
        "prior",
    )
    for term, model, measured, heel, sd in (
        (
            stiffness,
            pressed.bench_stiffness(u),
            bench_curves.stiffness_n_per_m,
            bench_curves.heel_stiffness_n_per_m,
            bench_curves.uncertainty_n_per_m,
        ),
        (
            displaced,
            displacement(pressed, u),
            bench_curves.mid_range_m,
            bench_curves.heel_mid_range_m,
            5e-4,
        ),
    ):
        np.testing.assert_allclose(
            term.residual, (model - np.array([*measured, heel])) / sd, rtol=1e-12
        )
        assert term.trial == "bench" and term.weight == 1.0 and term.times_s is None
    without = few_free(
        *PRESSED,
        bench=replace(
            bench_curves, mid_range_m=None, heel_mid_range_m=None, mid_range_uncertainty_m=None
        ),
    )
    *_, alone, _ = without.evaluate(u).terms
    np.testing.assert_allclose(alone.residual, stiffness.residual, atol=1e-6)
    with pytest.raises(ValueError, match="no bench"):
        few_free("offset.height").bench_stiffness(np.zeros(1))
    far = replace(
        bench_curves, fulcrum_m=(0.066, 0.4), stiffness_n_per_m=(1e4, 3e4), mid_range_m=(0.03, 0.01)
    )
    with pytest.raises(InputError):
        few_free("offset.height", bench=far)


def test_gradients_on_the_bench_are_the_limits_of_differences(pressed):
    u = pressed.parameters.start + np.array([0.2, -0.3, 0.1, 0.4, 0.1])
    by = pressed.evaluate(u).terms[-2].by
    for p, name in enumerate(pressed.parameters.names):
        step = 1e-3 * np.eye(len(u))[p]
        ends = [
            pressed.evaluate(u + sign * step, derivatives=False).terms[-2].residual
            for sign in (1, -1)
        ]
        np.testing.assert_allclose(
            by[:, p], (ends[0] - ends[1]) / 2e-3, rtol=2e-4, atol=1e-5, err_msg=name
        )
    assert np.abs(by).max(axis=0)[:-1].all() and not by[:, PRESSED.index("offset.height")].any()


def test_the_model_is_that_of_the_simulated_bench(pressed, bench_curves):
    """Its passes end a step beyond 600 N; cut there."""
    u = pressed.parameters.start + np.array([0.5, 0.5, 0.0, 0.0, 0.0])
    values = {"contact.forefoot.stiffness", "contact.forefoot.exponent"}
    walk = {name: value for name, value in pressed.shared.at(u).values.items() if name in values}
    passes = run_bench(
        model_with(pressed.walker.model, walk), fulcrums_m=bench_curves.fulcrum_m
    ).forefoot
    simulated = []
    for setting in passes:
        end = np.interp(600.0, setting.load_n, setting.platen_m)
        rows = setting.platen_m < end
        simulated.append(
            mid_range_displacement(
                np.append(setting.platen_m[rows], end), np.append(setting.load_n[rows], 600.0)
            )
        )
    np.testing.assert_allclose(displacement(pressed, u)[:-1], simulated, rtol=2e-3)


def test_a_displacement_of_the_models_own_is_found_again(few_free, pressed, bench_curves):
    """The data are what the model does elsewhere: stiffness, displacement and walks pull back from
    there together."""
    u = pressed.parameters.start + np.array([0.6, 0.4, -0.3, 0.3, 0.0])
    stiffness, displaced = pressed.bench_stiffness(u), displacement(pressed, u)
    sharp = replace(
        bench_curves,
        stiffness_n_per_m=tuple(stiffness[:-1]),
        heel_stiffness_n_per_m=float(stiffness[-1]),
        mid_range_m=tuple(displaced[:-1]),
        heel_mid_range_m=float(displaced[-1]),
        mid_range_uncertainty_m=1e-6,
        uncertainty_n_per_m=1.0,
    )
    again = few_free(*PRESSED, bench=sharp)
    found = search(again, again.parameters.start)
    np.testing.assert_allclose(displacement(again, found.u), displaced, atol=5e-6)
    np.testing.assert_allclose(again.bench_stiffness(found.u), stiffness, rtol=2e-3)
